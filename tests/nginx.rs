//! An nginx beside which the server is held up: started on a free port, ended when dropped.
//!
//! Included by path where it is needed, so that no crate depends on another for it.

use std::{
    fs,
    io::{self, Read},
    net::{SocketAddr, TcpListener, TcpStream},
    os::unix::fs::PermissionsExt,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

/// A running nginx that serves the files of a folder.
#[derive(Debug)]
pub struct Nginx {
    /// Where it listens.
    pub addr: SocketAddr,
    child: Child,
    prefix: tempfile::TempDir,
}

impl Nginx {
    /// Starts nginx on the files of `root`, as fast as it can be made: `sendfile`, `tcp_nodelay`, a
    /// worker for every core, no access log.
    ///
    /// # Errors
    /// Where it is not installed or does not come up.
    pub fn start(root: &Path) -> io::Result<Self> {
        Self::start_on(root, None)
    }

    /// The same, on these processors alone (as `taskset` takes them), a worker for each.
    ///
    /// # Errors
    /// As for [`start`](Self::start).
    pub fn start_on(root: &Path, processors: Option<(&str, usize)>) -> io::Result<Self> {
        // Its workers may run as another user.
        fs::set_permissions(root, fs::Permissions::from_mode(0o755))?;
        // The port is free for a moment only: another program may take it meanwhile.
        let mut failure = io::Error::other("nginx was not tried");
        for _ in 0..10 {
            match Self::try_start(root, processors) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => failure = e,
                other => return other,
            }
        }
        Err(failure)
    }

    /// `nginx/1.22.1`.
    ///
    /// # Errors
    /// Where it is not installed.
    pub fn version() -> io::Result<String> {
        let output = Command::new(program()).arg("-v").output().map_err(explain)?;
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        Ok(text.trim().rsplit(' ').next().unwrap_or_default().to_owned())
    }

    /// Processor time that its workers have taken.
    #[allow(dead_code, reason = "tests do not measure")]
    pub fn pids(&self) -> Vec<u32> {
        let id = self.child.id();
        let children = fs::read_to_string(format!("/proc/{id}/task/{id}/children"));
        let workers = children.unwrap_or_default();
        workers.split_whitespace().filter_map(|pid| pid.parse().ok()).chain([id]).collect()
    }

    fn try_start(root: &Path, processors: Option<(&str, usize)>) -> io::Result<Self> {
        let prefix = tempfile::tempdir()?;
        fs::set_permissions(prefix.path(), fs::Permissions::from_mode(0o755))?;
        let addr = TcpListener::bind(("127.0.0.1", 0))?.local_addr()?;
        let folder = prefix.path().display();
        // "auto" counts processors that it may not use.
        let workers = processors.map_or("auto".into(), |(_, count)| count.to_string());
        let config = format!(
            "daemon off; pid {folder}/pid; worker_processes {workers}; error_log stderr crit;\n\
             events {{ worker_connections 16384; }}\n\
             http {{\n\
                 access_log off; sendfile on; tcp_nodelay on; default_type application/octet-stream;\n\
                 client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy;\n\
                 fastcgi_temp_path {folder}/fastcgi; uwsgi_temp_path {folder}/uwsgi;\n\
                 scgi_temp_path {folder}/scgi; keepalive_requests 1000000000;\n\
                 large_client_header_buffers 4 64k;\n\
                 server {{ listen {addr}; root {}; }}\n\
             }}\n",
            root.display()
        );
        let file = prefix.path().join("nginx.conf");
        fs::write(&file, config)?;
        let mut command = match processors {
            Some((list, _)) => {
                let mut command = Command::new("taskset");
                command.args(["-c", list, program()]);
                command
            }
            None => Command::new(program()),
        };
        let mut child = command
            .args(["-p".as_ref(), prefix.path(), "-e".as_ref(), "stderr".as_ref(), "-c".as_ref()])
            .arg(&file)
            .stderr(Stdio::piped())
            .spawn()
            .map_err(explain)?;
        let deadline = Instant::now() + Duration::from_secs(30);
        while TcpStream::connect(addr).is_err() {
            if child.try_wait()?.is_some() || Instant::now() > deadline {
                let _ = child.kill();
                let mut said = String::new();
                let _ = child.stderr.take().map(|mut pipe| pipe.read_to_string(&mut said));
                return Err(io::Error::other(format!("nginx did not come up: {said}")));
            }
            thread::sleep(Duration::from_millis(5));
        }
        Ok(Self { addr, child, prefix })
    }
}

impl Drop for Nginx {
    fn drop(&mut self) {
        // Its own way to stop: the master ends its workers, then itself.
        let stopped = Command::new(program())
            .args(["-p".as_ref(), self.prefix.path(), "-e".as_ref(), "stderr".as_ref()])
            .args(["-s", "stop", "-c"])
            .arg(self.prefix.path().join("nginx.conf"))
            .status();
        if !stopped.is_ok_and(|status| status.success()) {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

/// Debian keeps it where only root looks.
fn program() -> &'static str {
    if Path::new("/usr/sbin/nginx").exists() { "/usr/sbin/nginx" } else { "nginx" }
}

fn explain(error: io::Error) -> io::Error {
    let what = "nginx cannot be started; ./dev test installs it, or: apt-get install nginx";
    io::Error::new(error.kind(), format!("{what}: {error}"))
}
