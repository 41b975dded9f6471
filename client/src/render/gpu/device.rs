//! The adapter and the device: the one place that asks for features and limits.
//!
//! Needed is what every adapter that can draw this way has: compute shaders, storage buffers in the
//! vertex stage, half-precision floats in words. 64-bit atomics and blending of 32-bit floats are
//! taken where they are, and done without elsewhere. Limits are the adapter's own, as the defaults
//! allow 128 MiB a binding. Where there is no such adapter, the caller draws on the CPU.

use std::sync::{Arc, Mutex, PoisonError};

use lodestream_shaders::Pixels;

use crate::render::RenderError;

/// Bytes of a page of nodes, where the adapter allows it.
const PAGE_BYTES: u64 = 32 << 20;

/// Bytes of the smallest page that is worth while.
const SMALLEST_PAGE_BYTES: u64 = 1 << 20;

/// An open device.
pub struct Device {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Adapter, kind and backend, for a user.
    pub name: String,
    pub page_bytes: u64,
    /// How the compute path keeps pixels.
    pub pixels: Pixels,
    /// What blended splats are summed up in.
    pub sums_format: wgpu::TextureFormat,
    failure: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// The best adapter there is; a software one too. `least`: as if it had nothing but what is
    /// needed.
    pub fn open(least: bool) -> Result<Self, RenderError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|_| {
            let advice = "install a driver (Debian, Ubuntu: mesa-vulkan-drivers)";
            RenderError::NoGpu(format!("no Vulkan, Metal or DirectX 12 adapter; {advice}"))
        })?;
        Self::on(&adapter, least)
    }

    /// On an adapter of the caller's choice.
    pub fn on(adapter: &wgpu::Adapter, least: bool) -> Result<Self, RenderError> {
        let info = adapter.get_info();
        let name = format!("{} ({:?}, {})", info.name, info.device_type, info.backend);
        let lacks = |what: &str| RenderError::NoGpu(format!("{name} lacks {what}"));
        let flags = adapter.get_downlevel_capabilities().flags;
        for (flag, what) in [
            (wgpu::DownlevelFlags::COMPUTE_SHADERS, "compute shaders"),
            (wgpu::DownlevelFlags::VERTEX_STORAGE, "storage buffers in the vertex stage"),
            (wgpu::DownlevelFlags::SHADER_F16_IN_F32, "half-precision floats in words"),
        ] {
            if !flags.contains(flag) {
                return Err(lacks(what));
            }
        }
        let limits = if least { wgpu::Limits::default() } else { adapter.limits() };
        let page_bytes =
            PAGE_BYTES.min(limits.max_storage_buffer_binding_size).min(limits.max_buffer_size);
        if page_bytes < SMALLEST_PAGE_BYTES {
            return Err(lacks("storage buffers of a useful size"));
        }
        let wide = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX;
        let blendable = wgpu::Features::FLOAT32_BLENDABLE;
        let has = |features| !least && adapter.features().contains(features);
        let pixels = if has(wide) { Pixels::Wide } else { Pixels::Narrow };
        let sums_format = if has(blendable) {
            wgpu::TextureFormat::Rgba32Float
        } else {
            wgpu::TextureFormat::Rgba16Float
        };
        let wanted = [wide, blendable].into_iter().filter(|features| has(*features));
        let wanted = wanted.fold(wgpu::Features::empty(), |all, features| all | features);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("lodestream"),
            required_features: wanted,
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| RenderError::NoGpu(format!("{name}: {e}")))?;
        // The default is to panic; the first failure is kept and told by `check` instead.
        let failure = Arc::new(Mutex::new(None));
        let keep = {
            let failure = Arc::clone(&failure);
            move |message: String| {
                failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
            }
        };
        let keep_lost = keep.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| keep(error.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep_lost(message);
            }
        });
        Ok(Self { device, queue, name, page_bytes, pixels, sums_format, failure })
    }

    /// What went wrong since the last call, if anything.
    pub fn check(&self) -> Result<(), RenderError> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        failure.map_or(Ok(()), |message| Err(RenderError::Gpu(message)))
    }

    /// Most bytes of a buffer that shaders are bound to.
    pub fn largest_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// A buffer that holds `bytes` (not empty, a multiple of four).
    pub fn filled(&self, label: &str, usage: wgpu::BufferUsages, bytes: &[u8]) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// Longest side of a picture.
    pub fn largest_side_px(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }
}
