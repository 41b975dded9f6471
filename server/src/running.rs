//! A server on a thread of its own, for programs that bring one along.
//!
//! The thread `lodestream-server` owns the runtime: it binds, serves, and ends when the handle
//! says so or is dropped.

use std::{net::SocketAddr, sync::mpsc, thread::JoinHandle};

use tokio::sync::oneshot;

use crate::{
    config::ServeConfig,
    error::{Error, Result},
    server::{Control, Server},
};

/// A server that runs until it is stopped or dropped.
#[derive(Debug)]
pub struct RunningServer {
    addr: SocketAddr,
    url: String,
    control: Control,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Starts a server; returns once it accepts connections.
///
/// # Errors
/// As for [`Server::bind`]; [`Error::Thread`] where the system gives no thread.
pub fn spawn(config: ServeConfig) -> Result<RunningServer> {
    let (report, bound) = mpsc::sync_channel(1);
    let (stop, stopped) = oneshot::channel();
    let thread = std::thread::Builder::new()
        .name("lodestream-server".into())
        .spawn(move || run(config, &report, stopped))
        .map_err(Error::Thread)?;
    match bound.recv() {
        Ok(Ok((addr, url, control))) => {
            Ok(RunningServer { addr, url, control, stop: Some(stop), thread: Some(thread) })
        }
        Ok(Err(e)) => Err(e),
        Err(_) => Err(Error::Panicked),
    }
}

fn run(
    config: ServeConfig,
    report: &mpsc::SyncSender<Result<(SocketAddr, String, Control)>>,
    stopped: oneshot::Receiver<()>,
) {
    // A send fails only where `spawn` has ended, which then has reported another failure.
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(e) => return report.send(Err(Error::Thread(e))).unwrap_or_default(),
    };
    runtime.block_on(async {
        match Server::bind(config).await {
            Ok(server) => {
                let _ = report.send(Ok((server.local_addr(), server.url(), server.control())));
                // A dropped handle stops the server as a signal does.
                server.run(async { stopped.await.unwrap_or_default() }).await;
            }
            Err(e) => report.send(Err(e)).unwrap_or_default(),
        }
    });
    runtime.shutdown_background();
}

impl RunningServer {
    /// The address it listens on.
    #[must_use]
    pub const fn addr(&self) -> SocketAddr {
        self.addr
    }

    /// `http://ADDRESS:PORT` or `https://…`, without a slash at the end.
    #[must_use]
    pub fn url(&self) -> String {
        self.url.clone()
    }

    /// What changes the server while it runs.
    #[must_use]
    pub const fn control(&self) -> &Control {
        &self.control
    }

    /// Stops accepting, lets responses under way end within the drain time, and joins the thread.
    ///
    /// # Errors
    /// [`Error::Panicked`] where the thread had ended in a panic.
    pub fn stop(mut self) -> Result<()> {
        self.join()
    }

    fn join(&mut self) -> Result<()> {
        drop(self.stop.take());
        self.thread.take().map_or(Ok(()), |thread| thread.join().map_err(|_| Error::Panicked))
    }
}

impl Drop for RunningServer {
    fn drop(&mut self) {
        // The panic's message is on standard error already.
        let _ = self.join();
    }
}
