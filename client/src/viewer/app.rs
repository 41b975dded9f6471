//! The event loop: what wakes the window, and when it sleeps.
//!
//! Nothing is drawn unless something is new: input, a plan, an answer, something that moves. egui says when it
//! wants to be drawn again; the engine and the jobs wake the loop by a message. Between these, the thread waits
//! in the system's queue.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use anyhow::Context as _;
use serde_json::json;
use winit::{
    application::ApplicationHandler,
    event::{StartCause, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy},
    window::WindowId,
};

use super::{
    display::{Display, DisplayError},
    options::{ViewOptions, ViewRenderer},
    panel,
    state::Viewer,
    theme,
};
use crate::render::GpuConfig;

/// A frame sends at most so many bytes of nodes to the GPU, so that none takes much longer than others.
const UPLOAD_BYTES_PER_FRAME: u64 = 24 << 20;

/// The longest step of what moves by itself: after a pause it goes on where it was.
const LONGEST_STEP: f64 = 0.1;

/// Seconds between two frames, as most screens have it.
const USUAL_STEP: f64 = 1.0 / 60.0;

/// Failures of the GPU in a row that are taken for accidents.
const MOST_FAILURES: u32 = 3;

/// Wakes the loop.
#[derive(Debug)]
struct Wake;

/// Opens a window and runs until it is closed.
///
/// # Errors
/// Where the system gives no window, or nothing can show pictures in it.
pub fn run(options: ViewOptions) -> anyhow::Result<()> {
    let events = EventLoop::<Wake>::with_user_event().build();
    let events = events.map_err(|e| anyhow::anyhow!("{}", no_display(&e.to_string())))?;
    let mut app = App::new(options, events.create_proxy())?;
    events.run_app(&mut app).context("the window's event loop failed")?;
    app.viewer.keep_settings();
    app.viewer.events.tell("closed", json!({}));
    match app.error {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

fn no_display(why: &str) -> String {
    let none = ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"]
        .iter()
        .all(|name| std::env::var_os(name).is_none_or(|value| value.is_empty()));
    let why = if cfg!(target_os = "linux") && none {
        "neither DISPLAY nor WAYLAND_DISPLAY is set"
    } else {
        why
    };
    format!(
        "cannot open a window: {why}; start it in a desktop session, or draw pictures without a window by \
         'lodestream shot'"
    )
}

/// The window and what is in it.
struct App {
    viewer: Viewer,
    display: Option<Display>,
    input: Option<egui_winit::State>,
    context: egui::Context,
    gpu: GpuConfig,
    renderer: ViewRenderer,
    /// Whether a message to wake up is under way already.
    is_woken: Arc<AtomicBool>,
    has_news: bool,
    theme: Option<super::Theme>,
    last_frame: Instant,
    /// When egui wants to be drawn again.
    next_frame: Option<Instant>,
    failures: u32,
    is_ready: bool,
    is_hovered_by_file: bool,
    error: Option<anyhow::Error>,
}

impl App {
    fn new(options: ViewOptions, proxy: EventLoopProxy<Wake>) -> anyhow::Result<Self> {
        let is_woken = Arc::new(AtomicBool::new(false));
        let wake = {
            let (is_woken, proxy) = (Arc::clone(&is_woken), std::sync::Mutex::new(proxy));
            move || {
                // One message is enough, however much news there is.
                if !is_woken.swap(true, Ordering::AcqRel) {
                    let proxy = proxy.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    // The loop has ended: nobody is to be woken.
                    let _ = proxy.send_event(Wake);
                }
            }
        };
        let gpu = GpuConfig {
            path: options.gpu_path,
            upload_bytes_per_frame: UPLOAD_BYTES_PER_FRAME,
            ..GpuConfig::default()
        };
        let renderer = options.renderer;
        let viewer = Viewer::start(options, Arc::new(wake))?;
        Ok(Self {
            viewer,
            display: None,
            input: None,
            context: egui::Context::default(),
            gpu,
            renderer,
            is_woken,
            has_news: true,
            theme: None,
            last_frame: Instant::now(),
            next_frame: None,
            failures: 0,
            is_ready: false,
            is_hovered_by_file: false,
            error: None,
        })
    }

    fn fail(&mut self, events: &ActiveEventLoop, error: DisplayError) {
        let text = match error {
            DisplayError::Window(why) => no_display(&why),
            error => error.to_string(),
        };
        self.error = Some(anyhow::anyhow!("{text}"));
        events.exit();
    }

    fn set_display(&mut self, display: Display) {
        if self.input.is_none() {
            let window = display.window();
            let scale = Some(window.scale_factor() as f32);
            let largest = Some(display.largest_side_px() as usize);
            let context = self.context.clone();
            let id = egui::ViewportId::ROOT;
            self.input = Some(egui_winit::State::new(context, id, window, scale, None, largest));
        }
        self.viewer.renderer = display.renderer_name();
        display.window().request_redraw();
        self.display = Some(display);
    }

    /// Draws the window anew after a failure, or gives up what fails again and again.
    fn recover(&mut self, events: &ActiveEventLoop, why: String) {
        self.failures += 1;
        self.viewer.last = Default::default();
        let Some(display) = self.display.take() else { return };
        if self.failures > MOST_FAILURES {
            self.renderer = ViewRenderer::Cpu;
        }
        if self.failures > 2 * MOST_FAILURES {
            return self.fail(events, DisplayError::Gpu(why));
        }
        self.viewer.warn(format!("The GPU failed ({why}); drawing anew"));
        // The textures of a new painter are to be sent anew: a new context sends all.
        self.context = egui::Context::default();
        (self.input, self.theme) = (None, None);
        match display.again(events, self.gpu, self.renderer) {
            Ok(display) => self.set_display(display),
            Err(error) => self.fail(events, error),
        }
    }

    fn draw(&mut self, events: &ActiveEventLoop) {
        let (Some(display), Some(input)) = (&mut self.display, &mut self.input) else { return };
        let size = display.window().inner_size();
        if size.width == 0 || size.height == 0 {
            return;
        }
        let now = Instant::now();
        // After a rest nothing was drawn for long: what begins now begins with a step of a usual frame.
        let longest = if self.viewer.navigator.is_settled() { USUAL_STEP } else { LONGEST_STEP };
        let seconds = (now - self.last_frame).as_secs_f64().min(longest);
        self.last_frame = now;
        if std::mem::take(&mut self.has_news) {
            self.viewer.take_news();
            self.viewer.take_answers();
        }
        if self.theme != Some(self.viewer.settings.theme) {
            theme::apply(&self.context, self.viewer.settings.theme);
            self.theme = Some(self.viewer.settings.theme);
        }
        if self.viewer.events.is_on() {
            self.context.enable_accesskit();
        }
        let window = Arc::clone(display.window());
        let raw = input.take_egui_input(&window);
        let (texture, largest) = (display.texture(), display.largest_side_px());
        let (viewer, is_hovered) = (&mut self.viewer, self.is_hovered_by_file);
        let mut walks = false;
        let output = self.context.run_ui(raw, |ui| {
            let context = ui.ctx().clone();
            viewer.obey_keys(&context);
            panel::show(viewer, ui);
            egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
                walks |= viewer.show_view(ui, texture, largest);
            });
            viewer.show_open_dialog(&context);
            panel::show_help(viewer, &context);
            if is_hovered {
                viewer.show_drop_hint(&context);
            }
        });
        self.viewer.events.tell_clicks(&output.platform_output.events);
        if let Some(update) = &output.platform_output.accesskit_update {
            self.viewer.events.tell_widgets(update, output.pixels_per_point);
        }
        input.handle_platform_output(&window, output.platform_output.clone());
        let logical = size.to_logical::<f64>(window.scale_factor());
        self.viewer.settings.window =
            [logical.width, logical.height].map(|side| (side as u32).max(1));
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let delay = root.map_or(Duration::MAX, |viewport| viewport.repaint_delay);
        let drawn = self.viewer.draw(display, now, seconds);
        let presented = display.present(&self.context, output);
        let goes_on = match (drawn, presented) {
            (Ok(goes_on), Ok(())) => goes_on,
            (Err(crate::render::RenderError::Gpu(why)), _) => return self.recover(events, why),
            (_, Err(error)) => return self.recover(events, error.to_string()),
            (Err(error), Ok(())) => {
                // Settings that cannot be drawn: said once, and drawn as usual again.
                self.viewer.warn(error.to_string());
                self.viewer.settings.look = Default::default();
                false
            }
        };
        if self.viewer.statistics.uploaded_bytes == 0 && self.viewer.is_settled() {
            self.failures = 0;
        }
        if goes_on || walks || delay.is_zero() {
            window.request_redraw();
        }
        // Very long delays are no moments of this clock.
        self.next_frame = now
            .checked_add(delay)
            .filter(|_| !delay.is_zero() && delay < Duration::from_secs(3600));
        if !std::mem::replace(&mut self.is_ready, true) {
            let renderer = &self.viewer.renderer;
            let size = [size.width, size.height];
            self.viewer.events.tell("ready", json!({ "renderer": renderer, "size": size }));
        }
        if self.viewer.is_closing {
            events.exit();
        }
    }

    fn redraw(&self) {
        if let Some(display) = &self.display {
            display.window().request_redraw();
        }
    }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.display.is_some() || self.error.is_some() {
            return;
        }
        let size = self.viewer.settings.window;
        match Display::open(events, "lodestream", size, self.gpu, self.renderer) {
            Ok(display) => {
                if self.renderer == ViewRenderer::Gpu && display.is_on_cpu() {
                    let name = display.renderer_name();
                    self.viewer.warn(format!("Points are drawn by the {name}"));
                }
                self.set_display(display);
            }
            Err(error) => self.fail(events, error),
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let StartCause::ResumeTimeReached { .. } = cause {
            self.next_frame = None;
            self.redraw();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: Wake) {
        // From here on, news wakes the loop again.
        self.is_woken.store(false, Ordering::Release);
        self.has_news = true;
        self.redraw();
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let (Some(display), Some(input)) = (&mut self.display, &mut self.input) else { return };
        match &event {
            WindowEvent::RedrawRequested => return self.draw(events),
            WindowEvent::CloseRequested | WindowEvent::Destroyed => return events.exit(),
            WindowEvent::Resized(size) => display.resize(*size),
            WindowEvent::HoveredFile(_) => self.is_hovered_by_file = true,
            WindowEvent::HoveredFileCancelled => self.is_hovered_by_file = false,
            WindowEvent::DroppedFile(path) => {
                self.is_hovered_by_file = false;
                self.viewer.open_any(&path.display().to_string());
            }
            _ => {}
        }
        let window = Arc::clone(display.window());
        if input.on_window_event(&window, &event).repaint {
            window.request_redraw();
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        events.set_control_flow(self.next_frame.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }
}
