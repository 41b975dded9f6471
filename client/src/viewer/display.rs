//! The window, and what shows pictures in it.
//!
//! One device draws the points and the panel: the points' picture never leaves it. Where the adapter can show
//! windows but lacks what drawing points needs, the CPU draws them, and their picture is sent to it.

use std::sync::Arc;

use egui_wgpu::{Renderer as Painter, RendererOptions, ScreenDescriptor};
use winit::{
    dpi::{LogicalSize, PhysicalSize},
    event_loop::ActiveEventLoop,
    window::Window,
};

use super::options::ViewRenderer;
use crate::render::{
    CloudColors, CpuRenderer, FrameStatistics, GpuConfig, GpuRenderer, Picture, RenderError,
    RenderSettings, Scene,
};

/// Why there is no window, or no picture in it.
#[derive(Debug, thiserror::Error)]
pub enum DisplayError {
    /// The system gives no window.
    #[error("cannot open a window: {0}")]
    Window(String),
    /// Nothing can show pictures in it.
    #[error(
        "no graphics adapter can show a window: {0}; install a driver (Debian, Ubuntu: \
         mesa-vulkan-drivers), or draw pictures without a window by 'lodestream shot'"
    )]
    NoAdapter(String),
    /// The GPU failed: a new display may work.
    #[error("the GPU failed: {0}")]
    Gpu(String),
}

/// What draws points.
enum Points {
    Gpu(Box<GpuRenderer>),
    Cpu { why: String, shown: Option<(wgpu::Texture, Picture)> },
}

/// The window and the GPU.
pub struct Display {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    device: wgpu::Device,
    queue: wgpu::Queue,
    painter: Painter,
    points: Points,
    /// The picture of points, for egui.
    texture: Option<egui::TextureId>,
    adapter: String,
    largest_side_px: u32,
    failure: Arc<std::sync::Mutex<Option<String>>>,
}

impl Display {
    /// Opens a window.
    ///
    /// # Errors
    /// [`DisplayError::Window`] where the system gives none, and as [`on`](Self::on).
    pub fn open(
        events: &ActiveEventLoop,
        title: &str,
        size: [u32; 2],
        gpu: GpuConfig,
        renderer: ViewRenderer,
    ) -> Result<Self, DisplayError> {
        let attributes = Window::default_attributes()
            .with_title(title)
            .with_inner_size(LogicalSize::new(f64::from(size[0]), f64::from(size[1])));
        let window = events.create_window(attributes);
        let window = window.map_err(|e| DisplayError::Window(e.to_string()))?;
        Self::on(events, Arc::new(window), gpu, renderer)
    }

    /// Shows pictures in a window that is there.
    ///
    /// # Errors
    /// [`DisplayError::NoAdapter`] where nothing can.
    pub fn on(
        events: &ActiveEventLoop,
        window: Arc<Window>,
        gpu: GpuConfig,
        renderer: ViewRenderer,
    ) -> Result<Self, DisplayError> {
        let none = |e: &dyn std::fmt::Display| DisplayError::NoAdapter(e.to_string());
        let display = Box::new(events.owned_display_handle());
        let descriptor = wgpu::InstanceDescriptor::new_with_display_handle(display);
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance.create_surface(Arc::clone(&window)).map_err(|e| none(&e))?;
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: Some(&surface),
            ..Default::default()
        }))
        .map_err(|_| none(&"no Vulkan, Metal or DirectX 12 adapter"))?;
        let info = adapter.get_info();
        let points = match renderer {
            ViewRenderer::Gpu => match GpuRenderer::on(&adapter, gpu) {
                Ok(gpu) => Points::Gpu(Box::new(gpu)),
                Err(error) => Points::Cpu { why: error.to_string(), shown: None },
            },
            ViewRenderer::Cpu => Points::Cpu { why: "as asked for".into(), shown: None },
        };
        let failure = Arc::default();
        let (device, queue) = match &points {
            Points::Gpu(gpu) => {
                let (device, queue) = gpu.device();
                (device.clone(), queue.clone())
            }
            Points::Cpu { .. } => open_device(&adapter, &failure).map_err(|e| none(&e))?,
        };
        let capabilities = surface.get_capabilities(&adapter);
        // Values as displays take them: what the points' pictures and egui have.
        let is_plain = |format: &wgpu::TextureFormat| {
            matches!(format, wgpu::TextureFormat::Rgba8Unorm | wgpu::TextureFormat::Bgra8Unorm)
        };
        let format = capabilities.formats.iter().copied().find(is_plain);
        let format = format.or_else(|| capabilities.formats.first().copied());
        let format = format.ok_or_else(|| none(&"it can show nothing in this window"))?;
        let PhysicalSize { width, height } = window.inner_size();
        let config = surface.get_default_config(&adapter, width.max(1), height.max(1));
        let config = config.ok_or_else(|| none(&"it can show nothing in this window"))?;
        let config = wgpu::SurfaceConfiguration {
            format,
            present_mode: wgpu::PresentMode::AutoVsync,
            desired_maximum_frame_latency: 1,
            ..config
        };
        let painter = Painter::new(&device, format, RendererOptions::default());
        let adapter = format!("{} ({:?}, {})", info.name, info.device_type, info.backend);
        let largest_side_px = device.limits().max_texture_dimension_2d;
        let mut display = Self {
            window,
            surface,
            config,
            device,
            queue,
            painter,
            points,
            texture: None,
            adapter,
            largest_side_px,
            failure,
        };
        display.resize(display.window.inner_size());
        Ok(display)
    }

    /// Shows pictures in the same window anew, after a failure.
    ///
    /// # Errors
    /// As [`on`](Self::on).
    pub fn again(
        self,
        events: &ActiveEventLoop,
        gpu: GpuConfig,
        renderer: ViewRenderer,
    ) -> Result<Self, DisplayError> {
        let window = Arc::clone(&self.window);
        // Two surfaces of one window are not allowed.
        drop(self);
        Self::on(events, window, gpu, renderer)
    }

    /// The window.
    #[must_use]
    pub fn window(&self) -> &Arc<Window> {
        &self.window
    }

    /// What draws the points, for people.
    #[must_use]
    pub fn renderer_name(&self) -> String {
        match &self.points {
            Points::Gpu(_) => self.adapter.clone(),
            Points::Cpu { why, .. } => format!("CPU ({why})"),
        }
    }

    /// Whether the CPU draws the points.
    #[must_use]
    pub const fn is_on_cpu(&self) -> bool {
        matches!(self.points, Points::Cpu { .. })
    }

    /// Longest side of a picture.
    #[must_use]
    pub const fn largest_side_px(&self) -> u32 {
        self.largest_side_px
    }

    /// The window has another size.
    pub fn resize(&mut self, size: PhysicalSize<u32>) {
        self.config.width = size.width.clamp(1, self.largest_side_px);
        self.config.height = size.height.clamp(1, self.largest_side_px);
        self.surface.configure(&self.device, &self.config);
    }

    /// The picture of points, for egui; `None` before the first.
    #[must_use]
    pub const fn texture(&self) -> Option<egui::TextureId> {
        self.texture
    }

    /// Draws points; the picture is shown from the next [`present`](Self::present) on.
    ///
    /// # Errors
    /// Where the picture cannot be drawn.
    pub fn draw(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        colors: CloudColors,
    ) -> Result<FrameStatistics, RenderError> {
        let (statistics, view) = match &mut self.points {
            Points::Gpu(gpu) => {
                let statistics = gpu.draw_colored(scene, settings, colors)?;
                (statistics, gpu.picture_view().cloned())
            }
            Points::Cpu { shown, .. } => {
                let frame = CpuRenderer.render_colored(scene, settings, colors)?;
                let texture = sent(&self.device, &self.queue, shown.take(), &frame.picture);
                let view = texture.create_view(&Default::default());
                *shown = Some((texture, frame.picture));
                (frame.statistics, Some(view))
            }
        };
        let Some(view) = view else { return Ok(statistics) };
        let filter = wgpu::FilterMode::Nearest;
        match self.texture {
            Some(id) => {
                let painter = &mut self.painter;
                painter.update_egui_texture_from_wgpu_texture(&self.device, &view, filter, id);
            }
            None => {
                let id = self.painter.register_native_texture(&self.device, &view, filter);
                self.texture = Some(id);
            }
        }
        Ok(statistics)
    }

    /// The last picture of points, in memory.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] where there is none, or where the GPU fails.
    pub fn take_picture(&mut self) -> Result<Picture, RenderError> {
        match &mut self.points {
            Points::Gpu(gpu) => gpu.take_picture(),
            Points::Cpu { shown: Some((_, picture)), .. } => Ok(picture.clone()),
            Points::Cpu { .. } => Err(RenderError::Gpu("nothing was drawn yet".into())),
        }
    }

    /// Shows what egui has painted.
    ///
    /// # Errors
    /// [`DisplayError::Gpu`] where the GPU failed: open it [`again`](Self::again).
    pub fn present(
        &mut self,
        context: &egui::Context,
        output: egui::FullOutput,
    ) -> Result<(), DisplayError> {
        let gpu = DisplayError::Gpu;
        let pixels_per_point = output.pixels_per_point;
        let paint = context.tessellate(output.shapes, pixels_per_point);
        let mut textures = output.textures_delta;
        for (id, deltas) in textures.set.drain() {
            for delta in deltas {
                self.painter.update_texture(&self.device, &self.queue, id, &delta);
            }
        }
        let screen = ScreenDescriptor {
            size_in_pixels: [self.config.width, self.config.height],
            pixels_per_point,
        };
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let painted =
            self.painter.update_buffers(&self.device, &self.queue, &mut encoder, &paint, &screen);
        let frame = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(frame)
            | wgpu::CurrentSurfaceTexture::Suboptimal(frame) => Some(frame),
            wgpu::CurrentSurfaceTexture::Timeout | wgpu::CurrentSurfaceTexture::Occluded => None,
            wgpu::CurrentSurfaceTexture::Outdated => {
                self.resize(self.window.inner_size());
                self.window.request_redraw();
                None
            }
            wgpu::CurrentSurfaceTexture::Lost | wgpu::CurrentSurfaceTexture::Validation => {
                return Err(gpu("the window can no longer be drawn into".into()));
            }
        };
        if let Some(frame) = frame {
            let view = frame.texture.create_view(&Default::default());
            let color = wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            };
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(color)],
                ..Default::default()
            });
            self.painter.render(&mut pass.forget_lifetime(), &paint, &screen);
            self.queue.submit(painted.into_iter().chain([encoder.finish()]));
            self.window.pre_present_notify();
            self.queue.present(frame);
        }
        for id in &textures.free {
            self.painter.free_texture(id);
        }
        match &self.points {
            Points::Gpu(points) => points.check().map_err(|e| gpu(e.to_string())),
            Points::Cpu { .. } => {
                let failure =
                    self.failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
                failure.map_or(Ok(()), |message| Err(gpu(message)))
            }
        }
    }
}

/// A device that only has to show pictures.
fn open_device(
    adapter: &wgpu::Adapter,
    failure: &Arc<std::sync::Mutex<Option<String>>>,
) -> Result<(wgpu::Device, wgpu::Queue), wgpu::RequestDeviceError> {
    let opened = adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("lodestream window"),
        required_limits: wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits()),
        ..Default::default()
    });
    let (device, queue) = pollster::block_on(opened)?;
    let failure = Arc::clone(failure);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        let mut failure = failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        failure.get_or_insert(error.to_string());
    }));
    Ok((device, queue))
}

/// The texture of a picture: the last one's where it has its size.
fn sent(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    last: Option<(wgpu::Texture, Picture)>,
    picture: &Picture,
) -> wgpu::Texture {
    let size =
        wgpu::Extent3d { width: picture.width, height: picture.height, depth_or_array_layers: 1 };
    let last = last.map(|(texture, _)| texture).filter(|texture| texture.size() == size);
    let texture = last.unwrap_or_else(|| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some("points, drawn by the CPU"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    });
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(4 * picture.width),
        rows_per_image: None,
    };
    queue.write_texture(texture.as_image_copy(), &picture.rgba8, layout, size);
    texture
}
