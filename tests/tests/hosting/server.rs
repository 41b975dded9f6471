//! The server's program.

use std::process::Command;

use lodestream_tests::program;

use crate::process::Process;

/// `lodestream-server` with these arguments, free of the caller's settings.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(program("lodestream-server").expect("built along"));
    for (name, _) in std::env::vars() {
        if name.starts_with("LODESTREAM_") || name.starts_with("AWS_") {
            command.env_remove(name);
        }
    }
    command.args(arguments);
    command
}

/// Serves `data` on a free port of this machine; returns the address.
pub fn serve(data: &str, arguments: &[&str]) -> (Process, String) {
    let all = [&["serve", data, "--listen", "127.0.0.1:0"], arguments].concat();
    Process::start(command(&all), false, |line| Some(line.to_owned()))
}

/// Builds a simulated scan.
pub fn build(output: &std::path::Path, points: &str, seed: u8) {
    let input = format!("sim:courtyard?points={points}&seed={seed}");
    let output = output.to_str().expect("a plain path");
    let done = command(&["build", &input, "-o", output]).output().expect("it starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}
