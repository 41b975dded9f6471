//! `serve`: hosts a folder of datasets until it is told to stop.

use std::{
    future::Future,
    io,
    net::{SocketAddr, ToSocketAddrs},
    path::PathBuf,
    process::ExitCode,
};

use anyhow::Context;
use clap::Args;

use super::{log_to_stderr, print};
use crate::{config::ServeConfig, server::Server};

/// Host a folder's datasets over HTTP
#[derive(Debug, Clone, Args)]
pub struct ServeArgs {
    /// Folder of NAME.lods files; new ones appear without a restart
    pub dir: PathBuf,
    /// Address and port to listen on; port 0 takes a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:8080", value_parser = resolve)]
    pub listen: SocketAddr,
    /// Log every request
    #[arg(short, long)]
    pub verbose: bool,
}

/// Serves until Ctrl-C or the termination signal. The first line on standard output is the address.
///
/// # Errors
/// Where the folder cannot be read or the address cannot be listened on.
pub fn run(args: ServeArgs) -> anyhow::Result<ExitCode> {
    log_to_stderr(args.verbose);
    raise_file_limit();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("cannot start the server's threads")?;
    let outcome = runtime.block_on(async {
        // Before the address is printed: whoever has read it may send the signal.
        let stop = stop_signal().context("cannot handle the termination signal")?;
        let server = Server::bind(ServeConfig::new(args.dir, args.listen)).await?;
        print(&format!("http://{}\n", server.local_addr()))?;
        server.run(stop).await;
        Ok(ExitCode::SUCCESS)
    });
    // A read from a dead disk must not keep the process.
    runtime.shutdown_background();
    outcome
}

fn resolve(text: &str) -> Result<SocketAddr, String> {
    let mut addrs = text.to_socket_addrs().map_err(|e| format!("{e}; write ADDRESS:PORT"))?;
    addrs.next().ok_or_else(|| "the name has no address".to_owned())
}

#[cfg(unix)]
fn stop_signal() -> io::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
        tracing::info!("stopping");
    })
}

#[cfg(not(unix))]
fn stop_signal() -> io::Result<impl Future<Output = ()>> {
    Ok(async {
        // Without the signal there is nothing to stop for.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    })
}

/// Connections and files count against the process's limit of open files, which is often 1024.
fn raise_file_limit() {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let limit = getrlimit(Resource::Nofile);
        let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
        if let Err(e) = setrlimit(Resource::Nofile, raised) {
            tracing::debug!("the limit of open files stays: {e}");
        }
    }
}
