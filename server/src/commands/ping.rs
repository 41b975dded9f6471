//! `ping`: asks a server whether it is ready; what an image without other programs checks itself by.

use std::{
    io::{Read, Write},
    net::{TcpStream, ToSocketAddrs},
    process::ExitCode,
    time::Duration,
};

use anyhow::{Context, bail};
use clap::Args;

use super::print;

/// How long each step may take.
const PATIENCE: Duration = Duration::from_secs(2);

/// Ask a server whether it is ready
///
/// Exit code 0 where it is, 1 where it is not or does not answer.
#[derive(Debug, Clone, Args)]
pub struct PingArgs {
    /// The server's address; without encryption, as from within its own machine
    #[arg(value_name = "http://HOST:PORT", default_value = "http://127.0.0.1:8080")]
    pub server: String,
}

/// Asks `/readyz`.
///
/// # Errors
/// Where the server is not ready or does not answer.
pub fn run(args: &PingArgs) -> anyhow::Result<ExitCode> {
    let server = &args.server;
    let host = server.strip_prefix("http://").context("write http://HOST:PORT")?;
    let host = host.trim_end_matches('/');
    let address = host.to_socket_addrs().ok().and_then(|mut addresses| addresses.next());
    let address = address.with_context(|| format!("{server}: write http://HOST:PORT"))?;
    let answer = ask(address, host).with_context(|| format!("{server}: no answer"))?;
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
    if head.split(' ').nth(1) != Some("200") {
        bail!("{server}: not ready: {}", body.trim());
    }
    print("ready\n")?;
    Ok(ExitCode::SUCCESS)
}

fn ask(address: std::net::SocketAddr, host: &str) -> std::io::Result<String> {
    let mut stream = TcpStream::connect_timeout(&address, PATIENCE)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    let request = format!("GET /readyz HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes())?;
    let mut answer = Vec::new();
    stream.take(4096).read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}
