//! Where the programs under test lie.

use std::{
    env, io,
    path::{Path, PathBuf},
};

/// The program `name` of the same build as the calling test or bench.
///
/// Cargo names a program's path only to tests of the program's own package; but a test is
/// `target/PROFILE/deps/TEST-…`, and the program `target/PROFILE/NAME`.
///
/// # Errors
/// Where it has not been built: `cargo test` builds it along, a single `cargo bench` does not.
pub fn program(name: &str) -> io::Result<PathBuf> {
    let caller = env::current_exe()?;
    let folder = caller.ancestors().nth(2).unwrap_or(Path::new(""));
    let program = folder.join(name).with_extension(env::consts::EXE_EXTENSION);
    if program.is_file() {
        return Ok(program);
    }
    let why = format!("{}: not there; run ./dev test or ./dev bench", program.display());
    Err(io::Error::new(io::ErrorKind::NotFound, why))
}
