//! `lodestream view`: a real window on a real screen, moved by real input.
#![cfg(target_os = "linux")]

#[path = "../common/drag.rs"]
mod drag;
#[path = "../common/screen.rs"]
mod screen;
#[path = "../common/world.rs"]
mod world;

mod bad_cases;
mod clouds;
mod drop;
mod explore;
mod paths;

/// Whether nothing can show a window here: then only that is tried.
fn is_without_gpu() -> bool {
    let is_without = std::env::var_os("LODESTREAM_NO_GPU").is_some_and(|value| value == "1");
    if is_without {
        println!("LODESTREAM_NO_GPU=1: no window can be shown, so none is tried");
    }
    is_without
}

const PROGRAM: &str = env!("CARGO_BIN_EXE_lodestream");
