//! `token`: makes a secret that nobody guesses.

use std::process::ExitCode;

use anyhow::Context;
use clap::Args;

use super::print;
use crate::access::{TokenHash, new_token};

/// Make a bearer token (or a signing key) of 256 random bits
///
/// The token goes to standard output, what the server's configuration needs to know of it to
/// standard error.
#[derive(Debug, Clone, Args)]
pub struct TokenArgs {
    /// What the configuration and the log call it
    #[arg(long, default_value = "new")]
    pub name: String,
}

/// Prints a new token.
///
/// # Errors
/// Where the system has no random numbers, or standard output cannot be written.
pub fn run(args: &TokenArgs) -> anyhow::Result<ExitCode> {
    let token = new_token().context("no random numbers")?;
    let hash = TokenHash::of_new(&token).map_err(anyhow::Error::msg)?.to_hex();
    eprintln!("[[access.tokens]]\nname = {:?}\nsha256 = \"{hash}\"\ndatasets = [\"*\"]", args.name);
    print(&format!("{token}\n"))?;
    Ok(ExitCode::SUCCESS)
}
