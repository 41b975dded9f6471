//! Clients that ask for ranges without a pause and look at every byte.

use std::{
    io::{self, Read, Write},
    net::{SocketAddr, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
};

/// The longest range that is asked for.
const MAX_RANGE: u64 = 300_000;

/// A connection.
pub struct Client {
    stream: TcpStream,
}

/// An answer, whole or broken off.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub etag: String,
    /// As far as it came.
    pub body: Vec<u8>,
    pub is_whole: bool,
}

impl Client {
    pub fn connect(addr: SocketAddr) -> io::Result<Self> {
        Ok(Self { stream: TcpStream::connect(addr)? })
    }

    /// Asks for a range.
    ///
    /// # Errors
    /// Where not even the head of an answer comes.
    pub fn ask(&mut self, path: &str, first: u64, last: u64) -> io::Result<Answer> {
        let head = self.begin(path, first, last)?;
        let field = |name: &str| {
            let value = head.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
            value.unwrap_or_default().to_owned()
        };
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok());
        let length: usize = field("content-length").parse().expect("a length");
        let body = self.rest(length);
        let is_whole = body.len() == length;
        Ok(Answer { status: status.expect("a status"), etag: field("etag"), body, is_whole })
    }

    /// Asks for a range, and takes nothing of the answer but its head.
    pub fn begin(&mut self, path: &str, first: u64, last: u64) -> io::Result<String> {
        let request =
            format!("GET {path} HTTP/1.1\r\nhost: x\r\nrange: bytes={first}-{last}\r\n\r\n");
        self.stream.write_all(request.as_bytes())?;
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            self.stream.read_exact(&mut byte)?;
            head.push(byte[0]);
        }
        Ok(String::from_utf8(head).expect("ASCII"))
    }

    /// So many bytes of the body, or as many as come.
    pub fn rest(&mut self, length: usize) -> Vec<u8> {
        let mut body = Vec::with_capacity(length);
        // What came before an error is there.
        let _ = (&mut self.stream).take(length as u64).read_to_end(&mut body);
        body
    }
}

/// What clients have seen so far.
#[derive(Debug, Default)]
pub struct Tally {
    /// Whole answers with the right bytes.
    pub good: AtomicU64,
    /// Answers that broke off; what came of them was right.
    pub broken: AtomicU64,
    /// Refusals.
    pub refused: AtomicU64,
    /// Connections that failed before an answer began.
    pub failed: AtomicU64,
}

impl Tally {
    /// Waits until so many more good answers have come.
    pub fn wait_for_good(&self, more: u64) {
        let goal = self.good.load(Ordering::Relaxed) + more;
        while self.good.load(Ordering::Relaxed) < goal {
            std::thread::yield_now();
        }
    }
}

/// Clients on threads of their own, until they are stopped.
pub struct Crowd {
    pub tally: Arc<Tally>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Crowd {
    /// `right` tells, by entity tag, what the file holds.
    pub fn start(
        addr: SocketAddr,
        path: &'static str,
        clients: u64,
        right: impl Fn(&str) -> Arc<Vec<u8>> + Send + Sync + 'static,
    ) -> Self {
        let (tally, stop) = (Arc::new(Tally::default()), Arc::new(AtomicBool::new(false)));
        let right = Arc::new(right);
        let threads = (0..clients).map(|seed| {
            let (tally, stop, right) = (Arc::clone(&tally), Arc::clone(&stop), Arc::clone(&right));
            std::thread::spawn(move || ask_on(addr, path, seed, &tally, &stop, &*right))
        });
        Self { threads: threads.collect(), tally, stop }
    }

    /// Ends all of them; panics where one saw a wrong byte.
    pub fn stop(self) -> Arc<Tally> {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads {
            thread.join().expect("no client saw a wrong byte");
        }
        self.tally
    }
}

fn ask_on(
    addr: SocketAddr,
    path: &str,
    seed: u64,
    tally: &Tally,
    stop: &AtomicBool,
    right: &dyn Fn(&str) -> Arc<Vec<u8>>,
) {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = |below: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state % below
    };
    let count = |counter: &AtomicU64| _ = counter.fetch_add(1, Ordering::Relaxed);
    let mut client = None;
    while !stop.load(Ordering::Relaxed) {
        let mut open = match client.take().map_or_else(|| Client::connect(addr), Ok) {
            Ok(open) => open,
            Err(_) => {
                count(&tally.failed);
                std::thread::yield_now();
                continue;
            }
        };
        // Half of them so long that they go through several pieces.
        let longest = if random(2) == 0 { 5_000 } else { MAX_RANGE };
        let length = 1 + random(longest);
        let first = random(right("").len() as u64 - length);
        let Ok(answer) = open.ask(path, first, first + length - 1) else {
            count(&tally.failed);
            continue;
        };
        if answer.status != 206 {
            count(&tally.refused);
        } else {
            let file = right(&answer.etag);
            let expected = &file[first as usize..];
            let at = answer.body.iter().zip(expected).position(|(a, b)| a != b);
            assert_eq!(at, None, "wrong from there on, of {first} to {}", first + length - 1);
            count(if answer.is_whole { &tally.good } else { &tally.broken });
        }
        if answer.is_whole {
            client = Some(open);
        }
    }
}
