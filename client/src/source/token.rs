//! The bearer token that this process shows to the servers it reads from.
//!
//! One for the process, given by its user before anything is read: sources are named by plain text
//! all over the commands, and a token has no place in such text, which is printed and logged.

use std::sync::OnceLock;

use reqwest::header::HeaderValue;

static TOKEN: OnceLock<HeaderValue> = OnceLock::new();

/// Shows this token to every server that is read from, from the next [`HttpSource`](super::HttpSource)
/// on. The first call counts.
///
/// # Errors
/// Where the token cannot be sent.
pub fn use_token(token: &str) -> Result<(), String> {
    let mut value = HeaderValue::try_from(format!("Bearer {}", token.trim()))
        .map_err(|_| "a token holds visible ASCII characters only".to_owned())?;
    value.set_sensitive(true);
    let _ = TOKEN.set(value);
    Ok(())
}

pub(super) fn authorization() -> Option<HeaderValue> {
    TOKEN.get().cloned()
}
