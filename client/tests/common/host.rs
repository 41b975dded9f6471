//! A host of one file, over real HTTP on a real socket, that misbehaves when it is told to.

use std::{
    net::SocketAddr,
    sync::{Arc, Mutex},
    time::Duration,
};

use lodestream_client::source::LinkSpec;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    sync::{Barrier, mpsc::UnboundedSender},
    time::{Instant, sleep, sleep_until},
};

/// Bytes that an answer sends in turn, where the link is slow.
const TURN_BYTES: usize = 16 << 10;

/// What a request asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Counts up from 0 with every request that the host has seen.
    pub number: usize,
    /// First byte and one past the last, where there was a range.
    pub range: Option<(u64, u64)>,
}

/// How to answer one request.
#[derive(Debug, Clone)]
pub enum Answer {
    /// As a host should.
    Good,
    /// This status, without a body of use.
    Status(u16),
    /// Status 200 and all of the file, as of a host that knows no ranges.
    WholeFile,
    /// The right head, but the connection closes after this part of the body.
    CutShort { share: f64 },
    /// The right head and the body up to this share; then nothing, for as long as the host runs.
    /// The channel is told when it has come to that.
    Hang { share: f64, reached: UnboundedSender<()> },
    /// The answer comes later, its halves apart.
    Late(Duration),
    /// As good, once as many requests wait for their answers as the barrier is for.
    Together(Arc<Barrier>),
    /// Announces (and sends) as many bytes from somewhere else in the file.
    WrongRange,
    /// Announces the right range, but sends the file's bytes turned over.
    Garbage,
    /// As good, with this entity tag.
    Tagged(&'static str),
    /// As good, with this date instead of an entity tag.
    Dated(&'static str),
    /// Closes the connection without an answer.
    Close,
}

/// Chooses the answer to each request.
pub type Manners = Box<dyn FnMut(Request) -> Answer + Send>;

struct State {
    file: Vec<u8>,
    manners: Manners,
    seen: Vec<Request>,
    link: Option<LinkSpec>,
    /// When the link has sent what it was given so far.
    free_at: Option<Instant>,
    connections: usize,
    most_connections: usize,
}

/// A running host; [`stop`](Self::stop) (or dropping it) closes all of its connections at once.
pub struct Host {
    address: SocketAddr,
    state: Arc<Mutex<State>>,
    runtime: Option<tokio::runtime::Runtime>,
}

impl Host {
    /// Starts on a free port.
    pub fn start(file: Vec<u8>, manners: impl FnMut(Request) -> Answer + Send + 'static) -> Self {
        let manners: Manners = Box::new(manners);
        let state = Arc::new(Mutex::new(State {
            file,
            manners,
            seen: vec![],
            link: None,
            free_at: None,
            connections: 0,
            most_connections: 0,
        }));
        let mut host = Self { address: ([127, 0, 0, 1], 0).into(), state, runtime: None };
        host.restart();
        host
    }

    /// A host that behaves.
    pub fn good(file: Vec<u8>) -> Self {
        Self::start(file, |_| Answer::Good)
    }

    pub fn url(&self) -> String {
        format!("http://{}/dataset.lods", self.address)
    }

    /// Changes how requests are answered from now on.
    pub fn behave(&self, manners: impl FnMut(Request) -> Answer + Send + 'static) {
        self.state.lock().expect("no panic").manners = Box::new(manners);
    }

    /// Bodies come as slowly as that link lets them, from now on; losses aside.
    pub fn throttle(&self, link: LinkSpec) {
        self.state.lock().expect("no panic").link = Some(link);
    }

    /// Most connections that were open at a time.
    pub fn most_connections(&self) -> usize {
        self.state.lock().expect("no panic").most_connections
    }

    /// Serves another file from now on.
    pub fn replace(&self, file: Vec<u8>) {
        self.state.lock().expect("no panic").file = file;
    }

    /// Requests seen so far.
    pub fn requests(&self) -> Vec<Request> {
        self.state.lock().expect("no panic").seen.clone()
    }

    /// Closes the port and every connection, in the middle of whatever they were doing.
    pub fn stop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }

    /// Opens the same port again.
    pub fn restart(&mut self) {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .expect("a thread");
        let address = self.address;
        let listener = runtime.block_on(async move {
            // The connections that were closed a moment ago may still hold the port.
            loop {
                match TcpListener::bind(address).await {
                    Ok(listener) => break listener,
                    Err(_) => tokio::task::yield_now().await,
                }
            }
        });
        self.address = listener.local_addr().expect("bound");
        let state = Arc::clone(&self.state);
        runtime.spawn(async move {
            loop {
                if let Ok((stream, _)) = listener.accept().await {
                    let _ = stream.set_nodelay(true);
                    tokio::spawn(serve(stream, Arc::clone(&state)));
                }
            }
        });
        self.runtime = Some(runtime);
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.stop();
    }
}

async fn serve(mut stream: TcpStream, state: Arc<Mutex<State>>) {
    let _counted = Connection::count(&state);
    // Ends with the connection: an error here is the client's or the test's wish.
    while let Some(range) = read_request(&mut stream).await {
        let (answer, len) = {
            let mut state = state.lock().expect("no panic");
            let request = Request { number: state.seen.len(), range };
            state.seen.push(request);
            ((state.manners)(request), state.file.len() as u64)
        };
        if reply(&mut stream, &state, range, len, answer).await.is_err() {
            return;
        }
    }
}

/// Counts a connection for as long as it is open.
struct Connection(Arc<Mutex<State>>);

impl Connection {
    fn count(state: &Arc<Mutex<State>>) -> Self {
        let mut counted = state.lock().expect("no panic");
        counted.connections += 1;
        counted.most_connections = counted.most_connections.max(counted.connections);
        Self(Arc::clone(state))
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.0.lock().expect("no panic").connections -= 1;
    }
}

/// Reads a request's head; `None` at the end of the connection.
async fn read_request(stream: &mut TcpStream) -> Option<Option<(u64, u64)>> {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        head.push(stream.read_u8().await.ok()?);
    }
    let head = String::from_utf8(head).ok()?.to_ascii_lowercase();
    // The body of a batch request.
    let body = head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
    stream.read_exact(&mut vec![0; body.unwrap_or(0)]).await.ok()?;
    let range = head.lines().find_map(|line| {
        let (first, last) = line.strip_prefix("range: bytes=")?.trim().split_once('-')?;
        Some((first.parse().ok()?, last.parse::<u64>().ok()? + 1))
    });
    Some(range)
}

/// `Err` where the connection is to be closed.
async fn reply(
    stream: &mut TcpStream,
    state: &Mutex<State>,
    range: Option<(u64, u64)>,
    len: u64,
    answer: Answer,
) -> Result<(), ()> {
    let slice = |start: u64, end: u64| {
        state.lock().expect("no panic").file[start as usize..end as usize].to_vec()
    };
    let (start, end) = range.map_or((0, len), |(start, end)| (start, end.min(len)));
    if let Answer::Status(status) = answer {
        return send(stream, &head(status, 0, None, "")).await;
    }
    if let Answer::Close = answer {
        return Err(());
    }
    if matches!(answer, Answer::WholeFile) || range.is_none() {
        send(stream, &head(200, len, None, "")).await?;
        return send(stream, &slice(0, len)).await;
    }
    if start >= end {
        let mut beyond = head(416, 0, None, "");
        let line = format!("Content-Range: bytes */{len}\r\n\r\n");
        beyond.splice(beyond.len() - 2.., line.into_bytes());
        return send(stream, &beyond).await;
    }
    let good = head(206, end - start, Some((start, end, len)), "\"first\"");
    let body = slice(start, end);
    let part = |share: f64| &body[..(body.len() as f64 * share) as usize];
    match answer {
        Answer::CutShort { share } => {
            send(stream, &good).await?;
            send_body(stream, state, part(share)).await?;
            Err(())
        }
        Answer::Hang { share, reached } => {
            send(stream, &good).await?;
            send_body(stream, state, part(share)).await?;
            let _ = reached.send(());
            std::future::pending().await
        }
        Answer::Late(delay) => {
            sleep(delay).await;
            send(stream, &good).await?;
            send_body(stream, state, part(0.5)).await?;
            sleep(delay).await;
            send_body(stream, state, &body[part(0.5).len()..]).await
        }
        Answer::Together(barrier) => {
            barrier.wait().await;
            send(stream, &good).await?;
            send_body(stream, state, &body).await
        }
        Answer::WrongRange => {
            let shifted = if start > 0 { (start - 1, end - 1) } else { (start + 1, end + 1) };
            let wrong = head(206, end - start, Some((shifted.0, shifted.1, len + 1)), "\"first\"");
            send(stream, &wrong).await?;
            send_body(stream, state, &body).await
        }
        Answer::Garbage => {
            let turned: Vec<u8> = body.iter().map(|b| !b).collect();
            send(stream, &good).await?;
            send_body(stream, state, &turned).await
        }
        Answer::Tagged(tag) => {
            send(stream, &head(206, end - start, Some((start, end, len)), tag)).await?;
            send_body(stream, state, &body).await
        }
        Answer::Dated(date) => {
            let mut dated = head(206, end - start, Some((start, end, len)), "");
            let line = format!("Last-Modified: {date}\r\n\r\n");
            dated.splice(dated.len() - 2.., line.into_bytes());
            send(stream, &dated).await?;
            send_body(stream, state, &body).await
        }
        _ => {
            send(stream, &good).await?;
            send_body(stream, state, &body).await
        }
    }
}

fn head(status: u16, length: u64, range: Option<(u64, u64, u64)>, tag: &str) -> Vec<u8> {
    let mut head = format!("HTTP/1.1 {status} X\r\nContent-Length: {length}\r\n");
    if let Some((start, end, total)) = range {
        head += &format!("Content-Range: bytes {start}-{}/{total}\r\n", end - 1);
    }
    if !tag.is_empty() {
        head += &format!("ETag: {tag}\r\n");
    }
    head += "\r\n";
    head.into_bytes()
}

async fn send(stream: &mut TcpStream, bytes: &[u8]) -> Result<(), ()> {
    stream.write_all(bytes).await.map_err(|_| ())
}

/// Sends as slowly as the link wants it.
async fn send_body(stream: &mut TcpStream, state: &Mutex<State>, body: &[u8]) -> Result<(), ()> {
    let link = state.lock().expect("no panic").link;
    let Some(link) = link else { return send(stream, body).await };
    sleep(link.round_trip).await;
    for turn in body.chunks(TURN_BYTES) {
        let takes = Duration::from_secs_f64(turn.len() as f64 * 8.0 / link.bits_per_second);
        let end = {
            let (mut state, now) = (state.lock().expect("no panic"), Instant::now());
            let end = state.free_at.map_or(now, |free| free.max(now)) + takes;
            state.free_at = Some(end);
            end
        };
        sleep_until(end).await;
        send(stream, turn).await?;
    }
    Ok(())
}
