//! A host of one file over real HTTP on a real socket, sound but for one sickness.

use std::{
    io::Write,
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, SystemTime},
};

use axum::{
    Router,
    body::{Body, Bytes},
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header},
    response::Response,
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
};

const TAG: &str = "\"894b4401\"";

/// What is wrong with a host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sickness {
    None,
    IgnoresRanges,
    ShiftsRanges,
    TellsNoRange,
    HidesTheLength,
    AnswersBeyondTheEnd,
    BreaksOff,
    Compresses,
    ForbidsOthers,
    AllowsOneOther,
    HidesFields,
    RefusesPreflight,
    NoTag,
    WeakTag,
    ChangingTag,
    IgnoresConditions,
    KeepsFromCaches,
    WrongClock,
    TextType,
    WebPage,
    NotFound,
    Denies,
    DeniesByAWrongClock,
    Busy,
    /// Closes every connection without an answer.
    Crashes,
    LimitsRequests,
    RefusesHead,
    ClosesConnections,
    OldHttp,
    Redirects,
    DamagesPayloads,
    Narrow,
}

/// The host. Dropping it closes all of its connections.
pub struct Patient {
    address: SocketAddr,
    _runtime: tokio::runtime::Runtime,
}

struct Ward {
    file: Bytes,
    sickness: Sickness,
    requests: AtomicUsize,
    at_once: AtomicUsize,
}

impl Patient {
    /// Starts on a free port.
    pub fn admit(file: Vec<u8>, sickness: Sickness) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .expect("a thread");
        let listener = runtime.block_on(TcpListener::bind(("127.0.0.1", 0))).expect("a free port");
        let address = listener.local_addr().expect("bound");
        let ward = Arc::new(Ward {
            file: file.into(),
            sickness,
            requests: AtomicUsize::new(0),
            at_once: AtomicUsize::new(0),
        });
        runtime.spawn(async move {
            match sickness {
                Sickness::Crashes | Sickness::OldHttp => serve_by_hand(listener, ward).await,
                _ => {
                    let router = Router::new().fallback(answer).with_state(ward);
                    axum::serve(listener, router).await.expect("serves");
                }
            }
        });
        Self { address, _runtime: runtime }
    }

    pub fn url(&self) -> String {
        format!("http://{}/dataset.lods", self.address)
    }
}

async fn answer(State(ward): State<Arc<Ward>>, request: Request) -> Response {
    use Sickness::*;
    let number = ward.requests.fetch_add(1, Ordering::Relaxed);
    let at_once = ward.at_once.fetch_add(1, Ordering::Relaxed);
    if ward.sickness == LimitsRequests {
        // Long enough for the others to come.
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let response = match (ward.sickness, request.uri().path()) {
        (Redirects, "/dataset.lods") => {
            let mut response = status(StatusCode::FOUND, "");
            let place = HeaderValue::from_static("/elsewhere.lods");
            response.headers_mut().insert(header::LOCATION, place);
            response
        }
        (NotFound, _) => status(StatusCode::NOT_FOUND, "no such file"),
        (Denies | DeniesByAWrongClock, _) => status(StatusCode::FORBIDDEN, "not for you"),
        (Busy, _) => status(StatusCode::SERVICE_UNAVAILABLE, "later"),
        (LimitsRequests, _) if at_once >= 3 => status(StatusCode::TOO_MANY_REQUESTS, "slowly"),
        (WebPage, _) => {
            let mut response = status(StatusCode::OK, "<!doctype html><p>Welcome");
            let html = HeaderValue::from_static("text/html");
            response.headers_mut().insert(header::CONTENT_TYPE, html);
            response
        }
        _ if request.method() == Method::OPTIONS => match ward.sickness {
            RefusesPreflight => status(StatusCode::METHOD_NOT_ALLOWED, ""),
            _ => status(StatusCode::NO_CONTENT, ""),
        },
        _ if request.method() == Method::HEAD && ward.sickness == RefusesHead => {
            status(StatusCode::METHOD_NOT_ALLOWED, "")
        }
        _ => ward.deliver(request.headers()),
    };
    ward.at_once.fetch_sub(1, Ordering::Relaxed);
    ward.label(response, number)
}

fn status(status: StatusCode, text: &'static str) -> Response {
    let mut response = Response::new(Body::from(text));
    *response.status_mut() = status;
    response
}

impl Ward {
    /// The file, or the range of it that is asked for.
    fn deliver(&self, asked: &HeaderMap) -> Response {
        let total = self.file.len() as u64;
        let text = |name: HeaderName| asked.get(name).and_then(|v| v.to_str().ok());
        if text(header::IF_NONE_MATCH) == Some(TAG) && self.sickness != Sickness::IgnoresConditions
        {
            return status(StatusCode::NOT_MODIFIED, "");
        }
        let range = text(header::RANGE).and_then(|range| {
            let (first, last) = range.strip_prefix("bytes=")?.split_once('-')?;
            Some((first.parse::<u64>().ok()?, last.parse::<u64>().ok()?))
        });
        let Some((first, last)) = range.filter(|_| self.sickness != Sickness::IgnoresRanges) else {
            return Response::new(Body::from(self.file.clone()));
        };
        if first >= total {
            if self.sickness == Sickness::AnswersBeyondTheEnd {
                return status(StatusCode::OK, "");
            }
            let mut response = status(StatusCode::RANGE_NOT_SATISFIABLE, "");
            insert(response.headers_mut(), header::CONTENT_RANGE, &format!("bytes */{total}"));
            return response;
        }
        let end = (last + 1).min(total);
        let mut body = self.file.slice(first as usize..end as usize);
        let mut told = format!("bytes {first}-{}/{total}", end - 1);
        match self.sickness {
            Sickness::ShiftsRanges => told = format!("bytes {}-{end}/{total}", first + 1),
            Sickness::HidesTheLength => told = format!("bytes {first}-{}/*", end - 1),
            Sickness::DamagesPayloads if first > 100_000 => {
                body = body.iter().map(|byte| byte ^ 1).collect::<Vec<_>>().into();
            }
            _ => {}
        }
        let takes_gzip = text(header::ACCEPT_ENCODING).is_some_and(|e| e.contains("gzip"));
        let compresses = self.sickness == Sickness::Compresses && takes_gzip;
        if compresses {
            body = gzip(&body).into();
        }
        let len = body.len();
        let mut response = Response::new(self.body(body));
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
        insert(response.headers_mut(), header::CONTENT_LENGTH, &len.to_string());
        if self.sickness != Sickness::TellsNoRange {
            insert(response.headers_mut(), header::CONTENT_RANGE, &told);
        }
        if compresses {
            insert(response.headers_mut(), header::CONTENT_ENCODING, "gzip");
        }
        response
    }

    fn body(&self, bytes: Bytes) -> Body {
        match self.sickness {
            Sickness::BreaksOff => {
                let half = bytes.slice(..bytes.len() / 2);
                let pieces = [Ok(half), Err(std::io::Error::other("the disk is gone"))];
                // What has been written by the time of the error is sent.
                let stream = futures_util::stream::unfold(pieces.into_iter(), async |mut left| {
                    let piece = left.next()?;
                    tokio::time::sleep(Duration::from_millis(20)).await;
                    Some((piece, left))
                });
                Body::from_stream(stream)
            }
            // Two megabits a second.
            Sickness::Narrow if bytes.len() > 100_000 => {
                let pieces: Vec<_> = bytes.chunks(16 << 10).map(Bytes::copy_from_slice).collect();
                let stream = futures_util::stream::unfold(pieces.into_iter(), async |mut left| {
                    let piece = left.next()?;
                    tokio::time::sleep(Duration::from_millis(64)).await;
                    Some((Ok::<_, std::io::Error>(piece), left))
                });
                Body::from_stream(stream)
            }
            _ => Body::from(bytes),
        }
    }

    /// The fields of every answer.
    fn label(&self, mut response: Response, number: usize) -> Response {
        use Sickness::*;
        let headers = response.headers_mut();
        let tag = match self.sickness {
            WeakTag => format!("W/{TAG}"),
            ChangingTag => format!("\"{number}\""),
            _ => TAG.to_owned(),
        };
        if self.sickness != NoTag {
            insert(headers, header::ETAG, &tag);
        }
        if !headers.contains_key(header::CONTENT_TYPE) {
            let kind =
                if self.sickness == TextType { "text/plain" } else { "application/octet-stream" };
            insert(headers, header::CONTENT_TYPE, kind);
        }
        let control = if self.sickness == KeepsFromCaches { "no-store" } else { "max-age=60" };
        insert(headers, header::CACHE_CONTROL, control);
        insert(headers, header::ACCEPT_RANGES, "bytes");
        match self.sickness {
            ForbidsOthers => {}
            AllowsOneOther => {
                insert(headers, header::ACCESS_CONTROL_ALLOW_ORIGIN, "https://other.example");
            }
            _ => insert(headers, header::ACCESS_CONTROL_ALLOW_ORIGIN, "*"),
        }
        if self.sickness != HidesFields {
            let exposed = "Content-Range, Content-Length, ETag";
            insert(headers, header::ACCESS_CONTROL_EXPOSE_HEADERS, exposed);
        }
        insert(headers, header::ACCESS_CONTROL_ALLOW_HEADERS, "Range, If-Range");
        if matches!(self.sickness, WrongClock | DeniesByAWrongClock) {
            let later = SystemTime::now() + Duration::from_secs(2 * 3600 + 5);
            insert(headers, header::DATE, &httpdate::fmt_http_date(later));
        }
        if self.sickness == ClosesConnections {
            insert(headers, header::CONNECTION, "close");
        }
        response
    }
}

fn insert(headers: &mut HeaderMap, name: HeaderName, value: &str) {
    headers.insert(name, HeaderValue::from_str(value).expect("a value"));
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

/// What no HTTP library would do.
async fn serve_by_hand(listener: TcpListener, ward: Arc<Ward>) {
    loop {
        let Ok((stream, _)) = listener.accept().await else { continue };
        if ward.sickness == Sickness::OldHttp {
            tokio::spawn(serve_old(stream, Arc::clone(&ward)));
        }
    }
}

/// One request a connection, as HTTP/1.0 has it.
async fn serve_old(mut stream: TcpStream, ward: Arc<Ward>) {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let Ok(byte) = stream.read_u8().await else { return };
        head.push(byte);
    }
    let head = String::from_utf8_lossy(&head).into_owned();
    let mut lines = head.lines();
    let method =
        lines.next().and_then(|line| line.split(' ').next()).unwrap_or_default().to_owned();
    let mut asked = HeaderMap::new();
    for (name, value) in lines.filter_map(|line| line.split_once(": ")) {
        let name = HeaderName::from_bytes(name.as_bytes()).expect("a name");
        asked.insert(name, HeaderValue::from_str(value).expect("a value"));
    }
    let response = match method.as_str() {
        "OPTIONS" => status(StatusCode::NO_CONTENT, ""),
        _ => ward.deliver(&asked),
    };
    let response = ward.label(response, 0);
    let (parts, body) = response.into_parts();
    let body = axum::body::to_bytes(body, usize::MAX).await.expect("a body");
    let mut answer = format!("HTTP/1.0 {}\r\n", parts.status);
    for (name, value) in &parts.headers {
        answer += &format!("{name}: {}\r\n", value.to_str().expect("text"));
    }
    if !parts.headers.contains_key(header::CONTENT_LENGTH) {
        answer += &format!("content-length: {}\r\n", body.len());
    }
    answer += "\r\n";
    let _ = stream.write_all(answer.as_bytes()).await;
    if method != "HEAD" {
        let _ = stream.write_all(&body).await;
    }
}
