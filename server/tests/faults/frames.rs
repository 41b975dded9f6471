//! A client of HTTP/2 that does as it likes, frame by frame (RFC 9113, section 4).

use std::{
    io::{self, Read, Write},
    net::{SocketAddr, TcpStream},
    time::Duration,
};

pub const DATA: u8 = 0;
const HEADERS: u8 = 1;
const SETTINGS: u8 = 4;
const PING: u8 = 6;
pub const GOAWAY: u8 = 7;
const WINDOW_UPDATE: u8 = 8;

const ACK: u8 = 1;
const END_STREAM_AND_HEADERS: u8 = 5;

/// Longest wait for the server: it may be busy.
const PATIENCE: Duration = Duration::from_secs(30);

pub struct FrameClient {
    stream: TcpStream,
    pub data_bytes: usize,
}

impl FrameClient {
    /// Speaks HTTP/2 from the start; streams may send `window` bytes.
    pub fn connect(addr: SocketAddr, window: u32) -> Self {
        let mut stream = TcpStream::connect(addr).expect("the server accepts");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time");
        stream.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").expect("the server reads");
        let mut client = Self { stream, data_bytes: 0 };
        let initial_window = [&[0, 4][..], &window.to_be_bytes()].concat();
        client.send(SETTINGS, 0, 0, &initial_window).expect("the server reads");
        client
    }

    fn send(&mut self, kind: u8, flags: u8, id: u32, payload: &[u8]) -> io::Result<()> {
        let mut frame = (payload.len() as u32).to_be_bytes()[1..].to_vec();
        frame.extend([kind, flags]);
        frame.extend(id.to_be_bytes());
        frame.extend(payload);
        self.stream.write_all(&frame)
    }

    /// Asks for a path of less than 127 letters, on the stream of that (odd) number.
    pub fn get(&mut self, id: u32, path: &str) -> io::Result<()> {
        // Indexed: GET, http; then a path and an authority, as they are (RFC 7541).
        let mut block = vec![0x82, 0x86, 0x04, path.len() as u8];
        block.extend(path.bytes());
        block.extend([0x01, 1, b'x']);
        self.send(HEADERS, END_STREAM_AND_HEADERS, id, &block)
    }

    /// Lets a stream send so many more bytes.
    pub fn allow(&mut self, id: u32, bytes: u32) -> io::Result<()> {
        self.send(WINDOW_UPDATE, 0, id, &bytes.to_be_bytes())
    }

    /// Reads the next frame and answers what has to be answered; its kind, or `None` at the end.
    pub fn next(&mut self) -> Option<u8> {
        let mut head = [0; 9];
        match self.stream.read_exact(&mut head) {
            Ok(()) => {}
            Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                panic!("the server neither speaks nor closes")
            }
            Err(_) => return None,
        }
        let length = u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize;
        let mut payload = vec![0; length];
        self.stream.read_exact(&mut payload).ok()?;
        let is_ack = head[4] & ACK != 0;
        match head[3] {
            // The server may be gone by then: the next read tells.
            PING if !is_ack => drop(self.send(PING, ACK, 0, &payload)),
            SETTINGS if !is_ack => drop(self.send(SETTINGS, ACK, 0, &[])),
            DATA => self.data_bytes += length,
            _ => {}
        }
        Some(head[3])
    }
}
