//! The commands that need the client; the others are the server's.

pub mod appearance;
pub mod demo;
pub mod doctor;
pub mod eval;
pub mod export;
pub mod load;
pub mod shot;
pub mod stability;
pub mod view;

use crate::source::without_secrets;

/// The command line that was given, without what is secret: reports are made to be shown around.
fn command_line() -> String {
    quoted_line(std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()))
}

/// Options whose value is a secret.
const SECRET: &str = "--token";

fn quoted_line(arguments: impl Iterator<Item = String>) -> String {
    let quoted = |argument: String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=%…".contains(c);
        let is_plain = !argument.is_empty() && argument.chars().all(plain);
        if is_plain { argument } else { format!("'{}'", argument.replace('\'', r"'\''")) }
    };
    let mut is_secret = false;
    let shown = |argument: String| {
        if std::mem::replace(&mut is_secret, argument == SECRET) {
            return "…".to_owned();
        }
        if argument.strip_prefix(SECRET).is_some_and(|rest| rest.starts_with('=')) {
            return format!("{SECRET}=…");
        }
        // A signature or a password in an address opens what it names.
        if argument.contains("://") {
            let url = reqwest::Url::parse(&argument);
            return url.map_or("…".to_owned(), |url| without_secrets(&url));
        }
        if argument.contains("signature=") {
            return argument.split('?').next().unwrap_or_default().to_owned();
        }
        argument
    };
    let arguments: Vec<_> = arguments.map(shown).map(quoted).collect();
    format!("lodestream {}", arguments.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_lines_are_told_without_secrets() {
        let line = |arguments: &[&str]| quoted_line(arguments.iter().map(|a| (*a).to_owned()));
        let given =
            ["load", "--token", "hush", "https://me:hush@host:1/a?signature=hush", "-o", "d e"];
        assert_eq!(line(&given), "lodestream load --token … https://host:1/a -o 'd e'");
        assert_eq!(
            line(&["load", "--token=hush", "host/a?x=1&signature=hush"]),
            "lodestream load --token=… host/a"
        );
        assert_eq!(line(&["eval", "sim:a?points=5"]), "lodestream eval 'sim:a?points=5'");
    }
}
