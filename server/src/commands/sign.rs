//! `sign`: makes an address that opens datasets for a time.

use std::{
    path::PathBuf,
    process::ExitCode,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use anyhow::Context;
use clap::Args;
use percent_encoding::utf8_percent_encode;

use super::{print, serve::read_key};
use crate::{
    access::{DatasetPattern, Link, sign},
    index::SEGMENT,
};

/// Sign an address that opens datasets until it expires
///
/// Whoever has the address reads what it names, without a token. It cannot be taken back but by
/// changing the key.
#[derive(Debug, Clone, Args)]
pub struct SignArgs {
    /// A dataset's name, or how names begin: 'site-*'
    #[arg(value_name = "DATASET|PREFIX*")]
    pub datasets: DatasetPattern,
    /// File with the key: the first of the server's access.signing_keys
    #[arg(long, value_name = "FILE", env = "LODESTREAM_SIGNING_KEY")]
    pub key: PathBuf,
    /// How long it is to open them: 90s, 12h, 7days
    #[arg(long = "for", value_name = "TIME", default_value = "7days", value_parser = humantime::parse_duration)]
    pub duration: Duration,
    /// The server's address, as clients reach it
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8080")]
    pub server: String,
}

/// Prints the address: the dataset's, or for a prefix the list's.
///
/// # Errors
/// Where the key cannot be read, or standard output not be written.
pub fn run(args: &SignArgs) -> anyhow::Result<ExitCode> {
    let end = SystemTime::now().checked_add(args.duration);
    let end = end.and_then(|end| end.duration_since(UNIX_EPOCH).ok());
    let expires = end.context("--for: too long a time")?.as_secs();
    let link = Link { datasets: args.datasets.clone(), expires };
    let query = sign(&link, &read_key(&args.key)?);
    let server = args.server.trim_end_matches('/');
    let name = args.datasets.to_string();
    let path = match name.strip_suffix('*') {
        Some(_) => String::new(),
        None => format!("datasets/{}.lods", utf8_percent_encode(&name, SEGMENT)),
    };
    print(&format!("{server}/{path}?{query}\n"))?;
    Ok(ExitCode::SUCCESS)
}
