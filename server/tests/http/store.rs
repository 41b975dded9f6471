//! An object store of one bucket that speaks as much of S3 as the server asks of it, and fails where
//! it is told to.

use std::{
    collections::HashMap,
    io::{BufRead, BufReader, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::{Arc, Condvar, Mutex, MutexGuard},
};

use lodestream_server::DataPlace;

/// How requests for objects are answered; lists always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mood {
    Good,
    /// Refuses all, which nobody tries again.
    Refusing,
    /// Refuses what is asked of an object that was looked at before.
    RefusingParts,
    /// Keeps requests until its mood is another.
    Silent,
}

/// Where datasets are in it.
const PREFIX: &str = "scans/";

/// A store on a thread of its own, which ends with the process.
#[derive(Clone)]
pub struct Store {
    addr: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    mood: Mood,
    objects: HashMap<String, Vec<u8>>,
    asked: Vec<Asked>,
}

/// A request for an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    pub name: String,
    /// Whether it was for more of an object that was looked at before.
    pub is_part: bool,
}

impl Store {
    pub fn new(objects: &[(&str, &[u8])]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("port 0 is free");
        let addr = listener.local_addr().expect("bound");
        let objects = objects.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec()));
        let state = State { mood: Mood::Good, objects: objects.collect(), asked: Vec::new() };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() });
        let store = Self { addr, shared };
        let serving = store.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let (store, stream) = (serving.clone(), stream.expect("accepted"));
                std::thread::spawn(move || store.serve(&stream));
            }
        });
        store
    }

    /// What a server is told to find it.
    pub fn place(&self) -> DataPlace {
        let options = self.options().map(|(name, value)| (name.to_lowercase(), value));
        DataPlace::new("s3://bucket/scans", options.to_vec())
    }

    /// The same, as the program's environment.
    pub fn options(&self) -> [(&'static str, String); 5] {
        [
            ("AWS_ENDPOINT", format!("http://{}", self.addr)),
            ("AWS_ALLOW_HTTP", "true".into()),
            ("AWS_REGION", "us-east-1".into()),
            ("AWS_ACCESS_KEY_ID", "key".into()),
            ("AWS_SECRET_ACCESS_KEY", "hush".into()),
        ]
    }

    pub fn set(&self, mood: Mood) {
        self.state().mood = mood;
        self.shared.changed.notify_all();
    }

    /// The requests for objects so far.
    pub fn asked(&self) -> Vec<Asked> {
        self.state().asked.clone()
    }

    /// Waits until so many requests for objects have come.
    pub fn wait_for(&self, count: usize) {
        let waiting = self.shared.changed.wait_while(self.state(), |s| s.asked.len() < count);
        drop(waiting.expect("no panic"));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.shared.state.lock().expect("no panic")
    }

    fn serve(&self, mut stream: &TcpStream) {
        let mut lines = BufReader::new(stream).lines();
        loop {
            let head: Vec<_> =
                lines.by_ref().map_while(Result::ok).take_while(|l| !l.is_empty()).collect();
            let Some((line, fields)) = head.split_first() else { return };
            let path = line.split(' ').nth(1).expect("a path");
            let field = |name: &str| {
                let is_it = |line: &&String| line.to_lowercase().starts_with(&format!("{name}:"));
                fields.iter().find(is_it).map(|line| line[name.len() + 1..].trim().to_owned())
            };
            let answer = match path.strip_prefix("/bucket/").filter(|path| !path.starts_with('?')) {
                Some(path) => self.object(path.trim_start_matches(PREFIX), &field),
                None => self.list(),
            };
            // Whoever has gone away does not read it.
            if stream.write_all(&answer).is_err() {
                return;
            }
        }
    }

    fn object(&self, name: &str, field: &dyn Fn(&str) -> Option<String>) -> Vec<u8> {
        let is_part = field("if-match").is_some();
        let mut state = self.state();
        state.asked.push(Asked { name: name.to_owned(), is_part });
        self.shared.changed.notify_all();
        let state = self.shared.changed.wait_while(state, |s| s.mood == Mood::Silent);
        let state = state.expect("no panic");
        if state.mood == Mood::Refusing || (state.mood == Mood::RefusingParts && is_part) {
            return answer("403 Forbidden", "", b"<Error><Code>AccessDenied</Code></Error>");
        }
        let Some(bytes) = state.objects.get(name) else {
            return answer("404 Not Found", "", b"<Error><Code>NoSuchKey</Code></Error>");
        };
        let etag = etag(bytes);
        if field("if-match").is_some_and(|tag| tag != etag) {
            return answer("412 Precondition Failed", "", b"");
        }
        let fields = format!("etag: {etag}\r\nlast-modified: Sun, 06 Nov 1994 08:49:37 GMT\r\n");
        if field("if-none-match") == Some(etag) {
            return answer("304 Not Modified", &fields, b"");
        }
        let range = field("range").expect("the server asks for ranges alone");
        let (first, last) = range.trim_start_matches("bytes=").split_once('-').expect("a range");
        let first: usize = first.parse().expect("a number");
        let last = last.parse::<usize>().expect("a number").min(bytes.len() - 1);
        let fields = format!("{fields}content-range: bytes {first}-{last}/{}\r\n", bytes.len());
        answer("206 Partial Content", &fields, &bytes[first..=last])
    }

    fn list(&self) -> Vec<u8> {
        let state = self.state();
        let entry = |(name, bytes): (&String, &Vec<u8>)| {
            let etag = etag(bytes);
            format!(
                "<Contents><Key>{PREFIX}{name}</Key><LastModified>1994-11-06T08:49:37Z</LastModified>\
                 <ETag>{etag}</ETag><Size>{}</Size></Contents>",
                bytes.len()
            )
        };
        let entries: String = state.objects.iter().map(entry).collect();
        let text = format!(
            "<ListBucketResult><IsTruncated>false</IsTruncated>{entries}</ListBucketResult>"
        );
        answer("200 OK", "content-type: application/xml\r\n", text.as_bytes())
    }
}

/// FNV-1a: tells contents apart.
fn etag(bytes: &[u8]) -> String {
    let hash = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    format!("\"{:x}\"", bytes.iter().fold(0xcbf2_9ce4_8422_2325, hash))
}

fn answer(status: &str, fields: &str, body: &[u8]) -> Vec<u8> {
    let head = format!("HTTP/1.1 {status}\r\n{fields}content-length: {}\r\n\r\n", body.len());
    [head.as_bytes(), body].concat()
}
