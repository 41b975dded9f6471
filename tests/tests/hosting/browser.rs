//! A browser without a window: Chromium.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use image::RgbaImage;

/// How a page is looked at.
#[derive(Clone, Copy)]
pub struct Look {
    pub width: u32,
    pub height: u32,
    pub is_dark: bool,
}

/// The page's picture.
pub fn photograph(url: &str, look: Look, output: &Path) -> RgbaImage {
    let size = format!("--window-size={},{}", look.width, look.height);
    let screenshot = format!("--screenshot={}", output.display());
    run(look, &[&size, &screenshot, "--hide-scrollbars", url]);
    image::open(output).expect("a picture").to_rgba8()
}

/// The page's elements, as they are once it has loaded.
pub fn elements(url: &str, look: Look) -> String {
    let size = format!("--window-size={},{}", look.width, look.height);
    run(look, &[&size, "--dump-dom", url])
}

/// The elements of a page that is a file, and may look into others beside it.
pub fn elements_of_file(page: &Path, look: Look) -> String {
    let url = format!("file://{}", page.display());
    run(look, &["--allow-file-access-from-files", "--dump-dom", &url])
}

fn run(look: Look, arguments: &[&str]) -> String {
    let profile = tempfile::tempdir().expect("a temporary folder");
    let mut command = Command::new(program());
    command
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-dev-shm-usage"])
        .args(["--disable-component-update", "--virtual-time-budget=10000"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .env("HOME", profile.path())
        .stderr(Stdio::piped())
        .stdout(Stdio::piped());
    if look.is_dark {
        command.arg("--blink-settings=preferredColorScheme=0");
    } else {
        command.arg("--blink-settings=preferredColorScheme=1");
    }
    let child = command.args(arguments).spawn();
    let child = child.unwrap_or_else(|e| panic!("./dev test installs chromium: {e}"));
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn program() -> PathBuf {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<_> = std::env::split_paths(&folders).collect();
    let mut places = names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
    places.find(|place| fs::metadata(place).is_ok()).unwrap_or_else(|| names[0].into())
}
