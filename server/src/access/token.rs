//! Bearer tokens.
//!
//! The server knows their SHA-256 only. A slow password hash would add nothing: tokens are 256
//! random bits ([`new_token`]), which no one guesses however quick the hash is; and a slow hash on
//! every request is a way to keep a server busy.

use std::fmt::Write;

use base64::{Engine, prelude::BASE64_URL_SAFE_NO_PAD};
use sha2::{Digest, Sha256};
use subtle::{Choice, ConstantTimeEq};

use super::DatasetPattern;

/// Shortest token that is taken from a file, in bytes: what 128 bits take in base64.
const MIN_TOKEN_BYTES: usize = 22;

/// What the holder of a token may do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TokenRule {
    /// What the operator calls it; the log tells this name, never the token.
    pub name: String,
    /// The token's hash.
    pub hash: TokenHash,
    /// Datasets that it opens.
    pub datasets: Vec<DatasetPattern>,
    /// Whether it opens `/metrics`.
    pub metrics: bool,
}

/// SHA-256 of a token.
#[derive(Debug, Clone, Copy, Eq)]
pub struct TokenHash([u8; 32]);

impl TokenHash {
    /// The hash of a token, which may have white space around it, as a file's last line end.
    ///
    /// # Errors
    /// Where it is too short to be secret, or has characters that no `Authorization` field can hold.
    pub fn of_new(token: &str) -> Result<Self, String> {
        let token = token.trim();
        if token.len() < MIN_TOKEN_BYTES || !token.bytes().all(|b| b.is_ascii_graphic()) {
            return Err(format!(
                "a token has at least {MIN_TOKEN_BYTES} visible ASCII characters; \
                 `lodestream-server token` makes one"
            ));
        }
        Ok(Self::of(token))
    }

    /// The hash of what a client sent.
    pub(super) fn of(token: &str) -> Self {
        Self(Sha256::digest(token.as_bytes()).into())
    }

    /// Parses 64 hexadecimal digits.
    ///
    /// # Errors
    /// Where the text is anything else.
    pub fn parse(hex: &str) -> Result<Self, String> {
        let advice = || "a token's sha256 is 64 hexadecimal digits, as `sha256sum` prints them";
        if hex.len() != 64 || !hex.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(advice().into());
        }
        let byte = |i: usize| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16);
        let mut hash = [0; 32];
        for (i, value) in hash.iter_mut().enumerate() {
            *value = byte(i).map_err(|_| advice())?;
        }
        Ok(Self(hash))
    }

    /// 64 hexadecimal digits.
    #[must_use]
    pub fn to_hex(&self) -> String {
        self.0.iter().fold(String::with_capacity(64), |mut hex, byte| {
            // Writing to a string does not fail.
            let _ = write!(hex, "{byte:02x}");
            hex
        })
    }

    pub(super) fn is(&self, other: &Self) -> Choice {
        self.0.ct_eq(&other.0)
    }
}

impl PartialEq for TokenHash {
    fn eq(&self, other: &Self) -> bool {
        self.is(other).into()
    }
}

/// A new token: 256 random bits in 43 characters.
///
/// # Errors
/// Where the system has no random numbers.
pub fn new_token() -> std::io::Result<String> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
    Ok(BASE64_URL_SAFE_NO_PAD.encode(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_that_sha256sum_prints() {
        let hex = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(TokenHash::of("abc").to_hex(), hex);
        assert_eq!(TokenHash::parse(hex), Ok(TokenHash::of("abc")));
        assert_eq!(TokenHash::parse(&hex.to_uppercase()), Ok(TokenHash::of("abc")));
        for bad in ["", "ba78", &hex[1..], &format!("{}g", &hex[1..]), &"é".repeat(32)] {
            assert!(TokenHash::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn new_tokens_differ_and_are_long_enough() {
        let (a, b) = (new_token().expect("random"), new_token().expect("random"));
        assert_ne!(a, b);
        assert_eq!(TokenHash::of_new(&format!("{a}\n")), Ok(TokenHash::of(&a)));
    }

    #[test]
    fn what_can_be_guessed_or_cannot_be_sent_is_no_token() {
        for bad in ["", "secret", &"a".repeat(21), "a b c d e f g h i j k l", &"é".repeat(30)] {
            assert!(TokenHash::of_new(bad).is_err(), "{bad}");
        }
    }
}
