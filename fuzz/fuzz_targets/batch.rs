//! Batches: a request's body, then the response to it, cut anywhere.
//!
//! The first two bytes are the length of the body, the third is how long the pieces are in which the
//! rest arrives.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lodestream_protocol::{BatchDecoder, BatchRequest, MAX_BATCH_BYTES, MAX_BATCH_PARTS};

fuzz_target!(|data: &[u8]| {
    let [a, b, cut, rest @ ..] = data else { return };
    let (body, response) = rest.split_at(usize::from(u16::from_le_bytes([*a, *b])).min(rest.len()));
    let Ok(request) = BatchRequest::decode(body) else { return };
    assert!((1..=MAX_BATCH_PARTS).contains(&request.parts.len()));
    let expected: u64 = request.parts.iter().map(|part| u64::from(part.bytes)).sum();
    assert!(expected <= MAX_BATCH_BYTES);
    let again = request.encode().and_then(|body| BatchRequest::decode(&body));
    assert_eq!(again.as_ref(), Ok(&request));

    let mut decoder = BatchDecoder::new(request);
    let mut payload = 0;
    for mut piece in response.chunks(usize::from(*cut).max(1)) {
        while !piece.is_empty() {
            let Ok(step) = decoder.step(piece) else { return };
            // Who takes a response apart relies on that to come to its end.
            assert!(step.bytes > 0 && step.bytes <= piece.len());
            payload += if step.is_payload { step.bytes as u64 } else { 0 };
            piece = &piece[step.bytes..];
        }
        assert!(payload <= expected);
    }
    assert!(!decoder.is_complete() || payload == expected);
});
