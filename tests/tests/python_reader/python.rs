//! A Python with the packages that the reader needs.

use std::{
    env,
    ffi::OsStr,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// Runs `read_lods.py` on a dataset; gives what it printed, or what it said when it failed.
pub fn read_lods(dataset: &Path, options: &[&str]) -> Result<String, String> {
    let script = folder().join("read_lods.py");
    let mut command = Command::new(interpreter());
    run(command.arg(script).arg(dataset).args(options))
}

/// The interpreter that `LODESTREAM_PYTHON` names (`./dev test` sets it), or one in an environment
/// made here. Never none: a reader that is not tried proves nothing.
fn interpreter() -> &'static Path {
    static INTERPRETER: OnceLock<PathBuf> = OnceLock::new();
    INTERPRETER.get_or_init(|| match env::var_os("LODESTREAM_PYTHON") {
        Some(python) => python.into(),
        None => prepare().unwrap_or_else(|why| {
            panic!(
                "the reader in Python needs Python 3 with its venv module and the packages of \
                 tests/python/requirements.txt; set LODESTREAM_PYTHON to an interpreter that has \
                 them, or mend this: {why}"
            )
        }),
    })
}

/// Makes the environment in the target folder, unless it is there already with the same packages;
/// the same one as `./dev test` makes.
fn prepare() -> Result<PathBuf, String> {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a target folder");
    let environment = target.join("python");
    let requirements = folder().join("requirements.txt");
    let done = environment.join("requirements.txt");
    let programs = environment.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let python = programs.join("python");
    let read = |path: &Path| std::fs::read(path).ok();
    if read(&done).is_none() || read(&done) != read(&requirements) {
        run(Command::new("python3")
            .args([OsStr::new("-m"), OsStr::new("venv")])
            .arg(&environment))?;
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(&python).args(install).arg(&requirements))?;
        std::fs::copy(&requirements, &done).map_err(|e| format!("{}: {e}", done.display()))?;
    }
    Ok(python)
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("python")
}

fn run(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if output.status.success() {
        Ok(text(&output.stdout))
    } else {
        Err(format!("{command:?}: {}: {}", output.status, text(&output.stderr)))
    }
}
