//! Signed addresses: whoever has one may read what it names, until it expires.
//!
//! `?datasets=PATTERN&expires=SECONDS&signature=MAC` behind any address of the server, where MAC is
//! the HMAC-SHA256 (RFC 2104) of a line that says what is signed, the pattern and the expiry in
//! seconds since 1970, each ended by a line feed, in base64url without padding. What is signed is
//! the right, not the request: a viewer that asks for a dataset's ranges, its batches and its
//! preview does so with one signature, and one for `site-*` opens a project. The pattern has no
//! line feed, so no two rights have the same text.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use base64::{Engine, prelude::BASE64_URL_SAFE_NO_PAD};
use hmac::{Hmac, KeyInit, Mac};
use percent_encoding::percent_decode_str;
use sha2::Sha256;

use super::{DatasetPattern, Secret};

/// Shortest signing key in bytes (RFC 2104, section 3: no shorter than the hash's output).
pub const MIN_KEY_BYTES: usize = 32;
/// The fields of a signed address.
pub const LINK_FIELDS: [&str; 3] = ["datasets", "expires", "signature"];

const PURPOSE: &str = "lodestream read 1";

/// What a signed address grants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Link {
    /// Datasets that may be read.
    pub datasets: DatasetPattern,
    /// Until when, in seconds since 1970.
    pub expires: u64,
}

/// What is wrong with an address's signature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flaw {
    /// Not one of ours, or altered.
    Forged,
    /// Ours, but its time is over.
    Expired {
        /// Since when, in seconds since 1970.
        since: u64,
    },
}

/// The query of a signed address, without its question mark.
#[must_use]
pub fn sign(link: &Link, key: &Secret) -> String {
    let signature = BASE64_URL_SAFE_NO_PAD.encode(mac(link, key).finalize().into_bytes());
    let datasets = percent_encoding::utf8_percent_encode(
        &link.datasets.to_string(),
        percent_encoding::NON_ALPHANUMERIC,
    )
    .to_string();
    let [d, e, s] = LINK_FIELDS;
    format!("{d}={datasets}&{e}={}&{s}={signature}", link.expires)
}

fn mac(link: &Link, key: &Secret) -> Hmac<Sha256> {
    let mut mac = Hmac::<Sha256>::new_from_slice(key.bytes()).expect("HMAC takes keys of any size");
    mac.update(format!("{PURPOSE}\n{}\n{}\n", link.datasets, link.expires).as_bytes());
    mac
}

/// The right that an address's query grants; `None` where it has no signature.
pub(super) fn verify(query: &str, keys: &[Secret], now: SystemTime) -> Result<Option<Link>, Flaw> {
    let [datasets, expires, signature] = match fields(query)? {
        [None, None, None] => return Ok(None),
        [Some(datasets), Some(expires), Some(signature)] => [datasets, expires, signature],
        _ => return Err(Flaw::Forged),
    };
    let link = Link {
        datasets: datasets.parse().map_err(|_| Flaw::Forged)?,
        // No sign, no leading zero: one right has one text.
        expires: expires
            .parse()
            .ok()
            .filter(|e: &u64| e.to_string() == expires)
            .ok_or(Flaw::Forged)?,
    };
    let signature = BASE64_URL_SAFE_NO_PAD.decode(&signature).map_err(|_| Flaw::Forged)?;
    // All keys are tried, and each comparison takes the same time wherever the first difference is.
    let is_ours = keys
        .iter()
        .fold(false, |found, key| mac(&link, key).verify_slice(&signature).is_ok() | found);
    if !is_ours {
        return Err(Flaw::Forged);
    }
    let end = UNIX_EPOCH.checked_add(Duration::from_secs(link.expires));
    if end.is_some_and(|end| end <= now) {
        return Err(Flaw::Expired { since: link.expires });
    }
    Ok(Some(link))
}

/// The fields of a signed address, without what else the query holds.
pub(super) fn only_link(query: &str) -> String {
    let name =
        |pair: &&str| pair.split_once('=').is_some_and(|(name, _)| LINK_FIELDS.contains(&name));
    query.split('&').filter(name).collect::<Vec<_>>().join("&")
}

/// The values of [`LINK_FIELDS`]. A field that comes twice is a forgery: which one counts could be
/// seen differently by what stands between client and server.
fn fields(query: &str) -> Result<[Option<String>; 3], Flaw> {
    let mut values = [const { None }; 3];
    for pair in query.split('&') {
        let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
        let Some(field) = LINK_FIELDS.iter().position(|known| *known == name) else { continue };
        let value = percent_decode_str(value).decode_utf8().map_err(|_| Flaw::Forged)?;
        if values[field].replace(value.into_owned()).is_some() {
            return Err(Flaw::Forged);
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn key(byte: u8) -> Secret {
        Secret::new(vec![byte; MIN_KEY_BYTES])
    }

    fn at(seconds: u64) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(seconds)
    }

    fn link() -> Link {
        Link { datasets: "site-*".parse().expect("a pattern"), expires: 1000 }
    }

    #[test]
    fn a_signed_right_is_granted_until_it_expires() {
        let query = sign(&link(), &key(1));
        assert_eq!(verify(&query, &[key(1)], at(999)), Ok(Some(link())));
        assert_eq!(verify(&query, &[key(2), key(1)], at(999)), Ok(Some(link())));
        assert_eq!(verify(&query, &[key(1)], at(1000)), Err(Flaw::Expired { since: 1000 }));
        assert_eq!(verify(&query, &[key(2)], at(999)), Err(Flaw::Forged));
        assert_eq!(verify(&query, &[], at(999)), Err(Flaw::Forged));
        assert_eq!(verify("", &[key(1)], at(999)), Ok(None));
        assert_eq!(verify("v=1&other", &[key(1)], at(999)), Ok(None));
    }

    #[test]
    fn signatures_are_what_any_hmac_makes() {
        // python3: hmac.new(bytes([1]) * 32, b"lodestream read 1\nsite-*\n1000\n", "sha256")
        let query = sign(&link(), &key(1));
        let signature = query.rsplit_once("signature=").expect("signed").1;
        assert_eq!(query.split_once("&expires").expect("dated").0, "datasets=site%2D%2A");
        assert_eq!(signature, "4G55NDbhDNAn2o6x9d-rA1I7Xp1ns5BB444sB48NdVk");
    }

    proptest! {
        #[test]
        fn an_altered_address_grants_nothing(place in 0usize..200, byte in b' '..b'~') {
            let query = sign(&link(), &key(1));
            let mut altered = query.clone().into_bytes();
            let place = place % altered.len();
            altered[place] = byte;
            let altered = String::from_utf8(altered).expect("ASCII");
            let granted = verify(&altered, &[key(1)], at(999)).ok().flatten();
            // A character may be escaped or not; the right is the same one then.
            prop_assert!(granted.is_none() || granted == Some(link()) , "{altered}");
            if granted.is_some() {
                let plain = |text: &str| percent_decode_str(text).decode_utf8_lossy().into_owned();
                prop_assert_eq!(plain(&altered), plain(&query));
            }
        }
    }
}
