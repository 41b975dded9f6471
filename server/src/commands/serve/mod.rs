//! `serve`: hosts datasets until it is told to stop.

mod args;
mod settings;

use std::{future::Future, io, process::ExitCode};

use anyhow::Context;

use super::{log_to_stderr_as, print};
use crate::server::{Control, Server};

pub use args::ServeArgs;
pub use settings::LogFormat;
use settings::Settings;
pub(super) use settings::read_key;

/// Environment variables that object stores' own tools read; they count less than `[storage]`.
const STORAGE_VARIABLES: [&str; 3] = ["AWS_", "GOOGLE_", "AZURE_"];

/// Serves until Ctrl-C or the termination signal. The first line on standard output is the address.
/// At a hang-up signal, the configuration's rules of access and the certificate are read again.
///
/// # Errors
/// Where the configuration is not good, the data cannot be read, or the address not be listened on.
pub fn run(args: ServeArgs) -> anyhow::Result<ExitCode> {
    let settings = settings_of(&args)?;
    if args.print_config {
        print(&settings.print()?)?;
        return Ok(ExitCode::SUCCESS);
    }
    log_to_stderr_as(settings.log.format);
    let config = settings.resolve()?;
    raise_file_limit();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("cannot start the server's threads")?;
    let outcome = runtime.block_on(async {
        // Before the address is printed: whoever has read it may send the signal.
        let stop = stop_signal().context("cannot handle the termination signal")?;
        let server = Server::bind(config).await?;
        reload_on_hangup(server.control(), args).context("cannot handle the hang-up signal")?;
        print(&format!("{}\n", server.url()))?;
        server.run(stop).await;
        Ok(ExitCode::SUCCESS)
    });
    // A read from a dead disk must not keep the process.
    runtime.shutdown_background();
    outcome
}

/// Flags and environment over the file over the defaults.
fn settings_of(args: &ServeArgs) -> anyhow::Result<Settings> {
    let mut settings = match &args.config {
        Some(path) => Settings::read(path)?,
        None => Settings::default(),
    };
    args.overlay(&mut settings);
    if settings.data.as_ref().is_some_and(|data| data.contains("://")) {
        for (name, value) in std::env::vars() {
            if STORAGE_VARIABLES.iter().any(|prefix| name.starts_with(prefix)) {
                settings.storage.entry(name.to_ascii_lowercase()).or_insert(value);
            }
        }
    }
    Ok(settings)
}

fn reload(control: &Control, args: &ServeArgs) -> anyhow::Result<()> {
    control.set_access(settings_of(args)?.resolve()?.access)?;
    control.reload_tls()?;
    Ok(())
}

#[cfg(unix)]
fn reload_on_hangup(control: Control, args: ServeArgs) -> io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut hangup = signal(SignalKind::hangup())?;
    tokio::spawn(async move {
        while hangup.recv().await.is_some() {
            match reload(&control, &args) {
                Ok(()) => tracing::info!("rules of access and certificate were read again"),
                Err(e) => tracing::error!("not all was read again, the old stays: {e:#}"),
            }
        }
    });
    Ok(())
}

#[cfg(not(unix))]
fn reload_on_hangup(_: Control, _: ServeArgs) -> io::Result<()> {
    Ok(())
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
