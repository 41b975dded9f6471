//! Environments of Python for tests that need programs or readers in it.

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// The interpreter of an environment `NAME` in the target folder that has the packages of
/// `tests/python/REQUIREMENTS`; made where it is not there, or has others. Tests that ask at the same
/// time in several processes may both make it: each ends with a whole one.
///
/// # Errors
/// What `venv` or `pip` said.
pub fn python_environment(name: &str, requirements: &str) -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let target = target_folder()?;
    let environment = target.join("python-environments").join(name);
    let requirements = folder.join("python").join(requirements);
    let done = environment.join("requirements.txt");
    let programs = environment.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let python = programs.join("python");
    let read = |path: &Path| fs::read(path).ok();
    if read(&done).is_none() || read(&done) != read(&requirements) {
        run(Command::new("python3")
            .args([OsStr::new("-m"), OsStr::new("venv")])
            .arg(&environment))?;
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(&python).args(install).arg(&requirements))?;
        fs::copy(&requirements, &done).map_err(|e| format!("{}: {e}", done.display()))?;
    }
    Ok(python)
}

/// `target`, in which the calling test is `PROFILE/deps/TEST-…`.
fn target_folder() -> Result<PathBuf, String> {
    let caller = std::env::current_exe().map_err(|e| e.to_string())?;
    let target = caller.ancestors().nth(3);
    target.map(Path::to_owned).ok_or_else(|| "a test lies in no target folder".to_owned())
}

fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    match output.status.success() {
        true => Ok(()),
        false => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr))),
    }
}
