//! nginx with a configuration of the test's.

use std::{
    fs,
    net::{SocketAddr, TcpListener, TcpStream},
    os::unix::fs::PermissionsExt,
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use rustix::process::{Pid, Signal, kill_process};

/// A running nginx; ended when dropped.
pub struct Nginx {
    pub addr: SocketAddr,
    pub folder: tempfile::TempDir,
    child: Child,
}

impl Nginx {
    /// Starts it with what `http` puts into the `http` block, given a free address to listen on and a
    /// folder to write to.
    pub fn start(http: impl Fn(SocketAddr, &Path) -> String) -> Self {
        // The port is free for a moment only: another program may take it meanwhile.
        (0..10)
            .find_map(|_| Self::try_start(&http))
            .expect("nginx comes up; ./dev test installs it")
    }

    fn try_start(http: &impl Fn(SocketAddr, &Path) -> String) -> Option<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        // Its workers may run as another user.
        let open = fs::Permissions::from_mode(0o777);
        fs::set_permissions(folder.path(), open).expect("ours");
        let addr = TcpListener::bind(("127.0.0.1", 0)).and_then(|l| l.local_addr()).expect("free");
        let place = folder.path().display();
        let temporary: String = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"]
            .map(|kind| format!("{kind}_temp_path {place}/{kind};\n"))
            .concat();
        let config = format!(
            "daemon off; pid {place}/pid; worker_processes 1; error_log {place}/error.log warn;\n\
             events {{ worker_connections 1024; }}\n\
             http {{\naccess_log off;\n{temporary}{}\n}}\n",
            http(addr, folder.path())
        );
        let file = folder.path().join("nginx.conf");
        fs::write(&file, config).expect("writable");
        let mut child = Command::new(program())
            .args(["-p".as_ref(), folder.path().as_os_str(), "-e".as_ref(), "stderr".as_ref()])
            .args(["-c".as_ref(), file.as_os_str()])
            .stdout(Stdio::null())
            .spawn()
            .expect("nginx is installed by ./dev test, or: apt-get install nginx");
        let deadline = Instant::now() + Duration::from_secs(30);
        while TcpStream::connect(addr).is_err() {
            if child.try_wait().is_ok_and(|ended| ended.is_some()) || Instant::now() > deadline {
                let _ = child.kill();
                let _ = child.wait();
                return None;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        Some(Self { addr, folder, child })
    }

    /// What it has complained of.
    pub fn errors(&self) -> String {
        fs::read_to_string(self.folder.path().join("error.log")).unwrap_or_default()
    }
}

impl Drop for Nginx {
    fn drop(&mut self) {
        // Its own way to stop: the master ends its workers, then itself.
        if kill_process(Pid::from_child(&self.child), Signal::TERM).is_err() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

/// Debian keeps it where only root looks.
fn program() -> &'static str {
    if Path::new("/usr/sbin/nginx").exists() { "/usr/sbin/nginx" } else { "nginx" }
}
