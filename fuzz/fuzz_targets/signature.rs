//! Signed addresses: any query, then one that was signed and altered on its way.
//!
//! The server's own files are compiled here: the whole server would bring some hundred crates along.
#![no_main]

#[path = "../../server/src/access/pattern.rs"]
#[expect(dead_code, reason = "what a right covers is no matter of its signature")]
mod pattern;
#[path = "../../server/src/access/secret.rs"]
mod secret;
#[path = "../../server/src/access/signature.rs"]
mod signature;

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use libfuzzer_sys::fuzz_target;
use lodestream_fuzz::LinkInput;
use pattern::DatasetPattern;
use secret::Secret;
use signature::{Link, MIN_KEY_BYTES, only_link, sign, verify};

fuzz_target!(|data: &[u8]| {
    let keys = [1, 2].map(|byte| Secret::new(vec![byte; MIN_KEY_BYTES]));
    assert_eq!(granted(&String::from_utf8_lossy(data), &keys, UNIX_EPOCH), None);

    let Some(input) = LinkInput::parse(data) else { return };
    let Ok(datasets) = input.datasets.parse::<DatasetPattern>() else { return };
    let link = Link { datasets, expires: input.expires };
    let query = sign(&link, &keys[1]);
    let is_in_time = link.expires > 0;
    assert_eq!(granted(&query, &keys, UNIX_EPOCH), is_in_time.then(|| link.clone()));
    if let Some(end) = UNIX_EPOCH.checked_add(Duration::from_secs(link.expires)) {
        assert_eq!(granted(&query, &keys, end), None);
    }
    // However it was altered, it opens what was signed, or nothing.
    let altered = granted(&input.alter(&query), &keys, UNIX_EPOCH);
    assert!(altered.is_none_or(|altered| altered == link));
});

/// The right that a query grants at that time.
fn granted(query: &str, keys: &[Secret], now: SystemTime) -> Option<Link> {
    let link = verify(query, keys, now).ok().flatten()?;
    // What the server hands on in other addresses opens the same.
    assert_eq!(verify(&only_link(query), keys, now), Ok(Some(link.clone())));
    Some(link)
}
