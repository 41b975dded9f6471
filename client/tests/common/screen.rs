//! A screen of its own (Xvfb), hands (xdotool), and the real program in a real window.
#![allow(dead_code, reason = "each of its users needs a part of it")]

use std::{
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{Arc, Condvar, Mutex, PoisonError},
    time::{Duration, Instant},
};

use serde_json::Value;

/// Longest wait for anything: the machine may be busy, and draw in software.
const PATIENCE: Duration = Duration::from_secs(60);

/// Longest wait until a click is told; one that takes longer has missed.
const CLICK: Duration = Duration::from_secs(10);

/// Most attempts to hit a widget, each at another place or [`CLICK`] long.
const MOST_CLICKS: usize = 40;

/// Between two movements of a hand; a pace, not a wait.
const PACE_MS: &str = "30";

const MISSING: &str = "needs Xvfb and xdotool (Debian, Ubuntu: apt-get install xvfb xdotool), and a Vulkan \
                       driver (mesa-vulkan-drivers); './dev test' installs them";

/// A screen.
pub struct Screen {
    server: Child,
    display: String,
    folder: tempfile::TempDir,
}

impl Screen {
    /// Of that size in pixels.
    pub fn new(width: u32, height: u32) -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-noreset", "-screen", "0"])
            .arg(format!("{width}x{height}x24"))
            .arg("-fbdir")
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| panic!("Xvfb: {e}; this test {MISSING}"));
        // Told once it takes connections.
        let mut number = String::new();
        let out = server.stdout.as_mut().expect("piped");
        BufReader::new(out).read_line(&mut number).expect("Xvfb tells its number");
        assert!(!number.trim().is_empty(), "Xvfb does not start; this test {MISSING}");
        Self { server, display: format!(":{}", number.trim()), folder }
    }

    /// Its name, for programs.
    pub fn display(&self) -> &str {
        &self.display
    }

    /// What is on it: red, green, blue, alpha.
    pub fn picture(&self) -> (u32, u32, Vec<u8>) {
        // Xvfb keeps the screen in a file, as the X Window Dump that "xwd" writes.
        let dump = std::fs::read(self.folder.path().join("Xvfb_screen0")).expect("the screen");
        let word = |index: usize| {
            let bytes: [u8; 4] = dump[4 * index..4 * index + 4].try_into().expect("four bytes");
            u32::from_be_bytes(bytes)
        };
        let (header, width, height) = (word(0) as usize, word(4), word(5));
        let (row_bytes, colors) = (word(12) as usize, word(19) as usize);
        let start = header + 12 * colors;
        let rows =
            (0..height as usize).map(|row| &dump[start + row * row_bytes..][..4 * width as usize]);
        let pixels = rows.flat_map(|row| row.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0], 255]));
        (width, height, pixels.collect())
    }

    /// Writes what is on it, without what is black to the right and below: where no window is.
    pub fn write(&self, path: &Path) {
        let (width, height, pixels) = self.picture();
        let picture = image::RgbaImage::from_raw(width, height, pixels).expect("all pixels");
        let shown = picture.enumerate_pixels().filter(|(_, _, pixel)| pixel.0[..3] != [0; 3]);
        let (right, below) = shown.fold((0, 0), |(w, h), (x, y, _)| (w.max(x + 1), h.max(y + 1)));
        let window = image::imageops::crop_imm(&picture, 0, 0, right.max(1), below.max(1));
        window.to_image().save(path).expect("written");
    }

    /// Moves hands: arguments of xdotool.
    pub fn hand(&self, arguments: &[&str]) {
        let mut command = Command::new("xdotool");
        let output = command.args(arguments).env("DISPLAY", &self.display).output();
        let output = output.unwrap_or_else(|e| panic!("xdotool: {e}; this test {MISSING}"));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "xdotool {arguments:?}: {said}");
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// What the program has told so far.
#[derive(Default)]
struct Told {
    events: Vec<Value>,
    widgets: Value,
    errors: String,
    is_over: bool,
}

impl Told {
    /// The middle of a widget, if it is there.
    fn middle_of(&self, role: &str, label: &str) -> Option<[i64; 2]> {
        let widgets = self.widgets.as_array()?;
        let found = widgets.iter().find(|widget| widget[0] == role && widget[1] == label)?;
        let side = |index: usize| found[2][index].as_f64();
        let (x, y) = (side(0)? + side(2)?, side(1)? + side(3)?);
        Some([(x / 2.0) as i64, (y / 2.0) as i64])
    }
}

/// The program in its window.
pub struct Window<'a> {
    screen: &'a Screen,
    program: Child,
    told: Arc<(Mutex<Told>, Condvar)>,
    /// Events before this one are of the past.
    now: usize,
}

impl<'a> Window<'a> {
    /// Starts `lodestream view` with these arguments and waits until its window is there.
    pub fn open(screen: &'a Screen, program: &str, arguments: &[&str]) -> Self {
        let mut window = Self::start(screen, program, arguments, &[]);
        window.wait("ready", |_| true);
        window.focus();
        window
    }

    /// Starts `lodestream view` in an environment.
    pub fn start(
        screen: &'a Screen,
        program: &str,
        arguments: &[&str],
        environment: &[(&str, &str)],
    ) -> Self {
        let mut program = Command::new(program)
            .args(["view", "--events"])
            .args(arguments)
            .env("DISPLAY", &screen.display)
            .env_remove("WAYLAND_DISPLAY")
            .envs(environment.iter().copied())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let told: Arc<(Mutex<Told>, Condvar)> = Arc::default();
        let out = program.stdout.take().expect("piped");
        let listener = Arc::clone(&told);
        std::thread::spawn(move || {
            for line in BufReader::new(out).lines().map_while(Result::ok) {
                let event: Value = serde_json::from_str(&line).expect("a line of JSON");
                let mut told = listener.0.lock().unwrap_or_else(PoisonError::into_inner);
                if event["event"] == "widgets" {
                    told.widgets = event["widgets"].clone();
                } else {
                    println!("{line}");
                    told.events.push(event);
                }
                listener.1.notify_all();
            }
            listener.0.lock().unwrap_or_else(PoisonError::into_inner).is_over = true;
            listener.1.notify_all();
        });
        let mut errors = program.stderr.take().expect("piped");
        let listener = Arc::clone(&told);
        std::thread::spawn(move || {
            let mut text = String::new();
            // What is not text is not told.
            let _ = errors.read_to_string(&mut text);
            listener.0.lock().unwrap_or_else(PoisonError::into_inner).errors = text;
        });
        Self { screen, program, told, now: 0 }
    }

    /// Gives the window the keyboard: there is no window manager to do so.
    pub fn focus(&self) {
        self.screen.hand(&["search", "--sync", "--name", "^lodestream$", "windowfocus", "--sync"]);
    }

    /// From here on, only what is told later counts.
    pub fn forget_past(&mut self) {
        self.now = self.told.0.lock().unwrap_or_else(PoisonError::into_inner).events.len();
    }

    /// Looks at what is told, until something is found or the time is over; what was told by then.
    fn watch<T>(
        &self,
        patience: Duration,
        what: &str,
        look: impl Fn(&Told) -> Option<T>,
    ) -> Result<T, Vec<Value>> {
        let end = Instant::now() + patience;
        let mut told = self.told.0.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(found) = look(&told) {
                return Ok(found);
            }
            let left = end.saturating_duration_since(Instant::now());
            assert!(!told.is_over, "the window is closed; waited for {what}");
            if left.is_zero() {
                return Err(told.events.clone());
            }
            let waited = self.told.1.wait_timeout(told, left);
            told = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn wait_for<T>(&self, what: &str, look: impl Fn(&Told) -> Option<T>) -> T {
        let found = self.watch(PATIENCE, what, look);
        found.unwrap_or_else(|told| panic!("waited for {what} in vain; told: {told:#?}"))
    }

    /// Waits for an event.
    pub fn wait(&mut self, name: &str, is_it: impl Fn(&Value) -> bool) -> Value {
        let now = self.now;
        self.wait_for(name, |told| {
            let mut news = told.events.iter().skip(now);
            news.find(|event| event["event"] == name && is_it(event)).cloned()
        })
    }

    /// Waits for an event; from it on counts what is told.
    pub fn wait_from(&mut self, name: &str, is_it: impl Fn(&Value) -> bool) {
        let now = self.now;
        self.now = self.wait_for(name, |told| {
            let mut news = told.events.iter().enumerate().skip(now);
            let found = news.find(|(_, event)| event["event"] == name && is_it(event));
            found.map(|(index, _)| index)
        });
    }

    /// Waits until the picture of what hands did is complete.
    pub fn settled(&mut self) -> Value {
        self.wait("settled", |_| true)
    }

    /// The last picture that was complete.
    pub fn last_settled(&self) -> Value {
        let told = self.told.0.lock().unwrap_or_else(PoisonError::into_inner);
        let last = told.events.iter().rev().find(|event| event["event"] == "settled");
        last.cloned().expect("a complete picture")
    }

    /// Presses keys, each once.
    pub fn keys(&mut self, keys: &[&str]) {
        self.forget_past();
        self.screen.hand(&[&["key", "--delay", PACE_MS], keys].concat());
    }

    /// Types a text.
    pub fn text(&mut self, text: &str) {
        self.screen.hand(&["type", "--delay", PACE_MS, text]);
    }

    /// The middle of a widget, once it is there.
    fn widget(&self, role: &str, label: &str) -> [i64; 2] {
        self.wait_for(&format!("{role} {label:?}"), |told| told.middle_of(role, label))
    }

    /// The middle of a widget, if it is there at the moment.
    fn widget_now(&self, role: &str, label: &str) -> Option<[i64; 2]> {
        self.told.0.lock().unwrap_or_else(PoisonError::into_inner).middle_of(role, label)
    }

    /// Waits until a widget is there.
    pub fn see(&self, role: &str, label: &str) {
        self.widget(role, label);
    }

    /// Waits until a widget is gone: widgets are told a moment after the picture that lacks them.
    pub fn miss(&self, role: &str, label: &str) {
        let is_gone = |told: &Told| told.middle_of(role, label).is_none().then_some(());
        self.wait_for(&format!("the end of {role} {label:?}"), is_gone);
    }

    /// Clicks a widget.
    pub fn press(&mut self, role: &str, label: &str) {
        loop {
            let at = self.widget(role, label);
            if self.press_at(role, label, at) {
                return;
            }
        }
    }

    /// Clicks a widget that was there; `false` where it was gone before it was hit.
    fn press_at(&mut self, role: &str, label: &str, mut at: [i64; 2]) -> bool {
        self.forget_past();
        // Sections of the panel open smoothly, and where they are is told a moment later: a hand follows what
        // moves, and clicks again what it has missed.
        for _ in 0..MOST_CLICKS {
            let [x, y] = at.map(|c| c.to_string());
            self.screen.hand(&["mousemove", &x, &y, "sleep", "0.4"]);
            match self.widget_now(role, label) {
                None => return false,
                Some(now) if now == at => {
                    self.click_at(at[0], at[1], 1);
                    if self.is_clicked(role, label) {
                        return true;
                    }
                }
                Some(now) => at = now,
            }
        }
        panic!("{role} {label:?} cannot be hit");
    }

    /// Waits a while until the window tells that it took a click on a widget.
    fn is_clicked(&self, role: &str, label: &str) -> bool {
        let is_it = |event: &Value| {
            event["event"] == "clicked" && event["role"] == role && event["label"] == label
        };
        let click = |told: &Told| told.events.iter().skip(self.now).any(is_it).then_some(());
        self.watch(CLICK, "a click", click).is_ok()
    }

    /// Chooses an entry of a list that folds out. Where another list is still folding in, the first click
    /// only closes that: a hand clicks again.
    pub fn choose(&mut self, list: &str, entry: &str) {
        for _ in 0..10 {
            self.press("ComboBox", list);
            let end = Instant::now() + Duration::from_secs(3);
            while Instant::now() < end {
                // A slow window may fold the list in again meanwhile.
                if let Some(at) = self.widget_now("Button", entry)
                    && self.press_at("Button", entry, at)
                {
                    return;
                }
                self.screen.hand(&["sleep", "0.05"]);
            }
        }
        panic!("{list:?} does not fold out to {entry:?}");
    }

    /// Clicks a place of the window so many times.
    pub fn click_at(&mut self, x: i64, y: i64, times: u32) {
        let [x, y, times] = [x.to_string(), y.to_string(), times.to_string()];
        self.screen.hand(&["mousemove", &x, &y, "sleep", "0.05"]);
        self.screen.hand(&["click", "--repeat", &times, "--delay", "10", "1"]);
    }

    /// Turns the wheel at a place: 4 is ahead, 5 is back.
    pub fn wheel(&mut self, x: i64, y: i64, button: u32, turns: u32) {
        self.forget_past();
        let [x, y, button, turns] =
            [x, y, i64::from(button), i64::from(turns)].map(|n| n.to_string());
        self.screen.hand(&["mousemove", &x, &y, "sleep", "0.05"]);
        self.screen.hand(&["click", "--repeat", &turns, "--delay", PACE_MS, &button]);
    }

    /// Drags with a button from a place, in ten steps.
    pub fn drag(&mut self, button: u32, from: [i64; 2], step: [i64; 2]) {
        self.forget_past();
        let [x, y, dx, dy, button] =
            [from[0], from[1], step[0], step[1], i64::from(button)].map(|n| n.to_string());
        self.screen.hand(&["mousemove", &x, &y, "sleep", "0.05", "mousedown", &button]);
        for _ in 0..10 {
            self.screen.hand(&["mousemove_relative", "--", &dx, &dy, "sleep", "0.04"]);
        }
        self.screen.hand(&["sleep", "0.05", "mouseup", &button]);
    }

    /// Holds a key for some time.
    pub fn hold(&mut self, key: &str, seconds: &str) {
        self.forget_past();
        self.screen.hand(&["keydown", key, "sleep", seconds, "keyup", key]);
    }

    /// Another size of the window.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.forget_past();
        let [width, height] = [width.to_string(), height.to_string()];
        self.screen.hand(&["search", "--name", "^lodestream$", "windowsize", &width, &height]);
    }

    /// Writes the picture of the points once it is complete; returns its file. What a hand did just before may
    /// still be going on where the machine is busy.
    pub fn picture(&mut self) -> PathBuf {
        for _ in 0..MOST_CLICKS {
            self.keys(&["F12"]);
            let event = self.wait("picture", |_| true);
            assert!(event["error"].is_null(), "{event}");
            if event["complete"] == true {
                return PathBuf::from(event["file"].as_str().expect("a file"));
            }
            self.screen.hand(&["sleep", "0.2"]);
        }
        panic!("no picture is complete");
    }

    /// The process.
    pub fn pid(&self) -> u32 {
        self.program.id()
    }

    /// Closes it as a hand does, and expects success.
    pub fn close(mut self) {
        self.keys(&["ctrl+q"]);
        self.wait("closed", |_| true);
        let status = self.program.wait().expect("it ends");
        assert!(status.success(), "{status}");
    }

    /// Waits for its end; the exit code, and what it said on standard error.
    pub fn end(mut self) -> (Option<i32>, String) {
        let status = self.program.wait().expect("it ends");
        let errors = |told: &Told| told.is_over.then(|| told.errors.clone());
        let mut said = String::new();
        // The listener for errors may be a moment behind.
        let end = Instant::now() + PATIENCE;
        while said.is_empty() && Instant::now() < end && !status.success() {
            said = errors(&self.told.0.lock().unwrap_or_else(PoisonError::into_inner))
                .unwrap_or_default();
            std::thread::yield_now();
        }
        (status.code(), said)
    }
}

impl Drop for Window<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}
