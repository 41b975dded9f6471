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

/// The command line that was given.
fn command_line() -> String {
    let quoted = |argument: String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=%".contains(c);
        let is_plain = !argument.is_empty() && argument.chars().all(plain);
        if is_plain { argument } else { format!("'{}'", argument.replace('\'', r"'\''")) }
    };
    let arguments = std::env::args_os().skip(1).map(|a| quoted(a.to_string_lossy().into_owned()));
    let arguments: Vec<_> = arguments.collect();
    format!("lodestream {}", arguments.join(" "))
}
