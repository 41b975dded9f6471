//! The adapter and the device: the one place that asks for features and limits.
//!
//! Nothing is asked for but what every adapter that can draw this way has: storage buffers in the
//! vertex stage. Limits are the adapter's own, as the defaults allow 128 MiB a binding. Where there
//! is no such adapter, the caller draws on the CPU: there is no lesser GPU path.

use std::sync::{Arc, Mutex, PoisonError};

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
    failure: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// The best adapter there is; a software one too.
    pub fn open() -> Result<Self, RenderError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|_| {
            let advice = "install a driver (Debian, Ubuntu: mesa-vulkan-drivers)";
            RenderError::NoGpu(format!("no Vulkan, Metal or DirectX 12 adapter; {advice}"))
        })?;
        let info = adapter.get_info();
        let name = format!("{} ({:?}, {})", info.name, info.device_type, info.backend);
        let lacks = |what: &str| RenderError::NoGpu(format!("{name} lacks {what}"));
        let flags = adapter.get_downlevel_capabilities().flags;
        if !flags.contains(wgpu::DownlevelFlags::VERTEX_STORAGE) {
            return Err(lacks("storage buffers in the vertex stage"));
        }
        let limits = adapter.limits();
        let page_bytes =
            PAGE_BYTES.min(limits.max_storage_buffer_binding_size).min(limits.max_buffer_size);
        if page_bytes < SMALLEST_PAGE_BYTES {
            return Err(lacks("storage buffers of a useful size"));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("lodestream"),
            required_features: wgpu::Features::empty(),
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
        Ok(Self { device, queue, name, page_bytes, failure })
    }

    /// What went wrong since the last call, if anything.
    pub fn check(&self) -> Result<(), RenderError> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        failure.map_or(Ok(()), |message| Err(RenderError::Gpu(message)))
    }

    /// Longest side of a picture.
    pub fn largest_side_px(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }
}
