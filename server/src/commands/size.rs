//! Sizes on the command line: `4GiB`, `256MiB`, `1.5G`.

use parse_size::Config;

/// Bytes of a size. `K`, `M`, `G` alone mean the binary units, as memory is counted; `kB`, `MB`,
/// `GB` too.
///
/// # Errors
/// What is wrong with the text.
pub fn parse_size(text: &str) -> Result<u64, String> {
    let size = Config::new().with_binary().parse_size(text);
    size.map_err(|e| format!("{e}; write a size such as 256MiB or 4GiB"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_binary() {
        assert_eq!(parse_size("4GiB"), Ok(4 << 30));
        assert_eq!(parse_size("256 MiB"), Ok(256 << 20));
        assert_eq!(parse_size("1.5G"), Ok(3 << 29));
        assert_eq!(parse_size("4096"), Ok(4096));
    }

    #[test]
    fn what_is_no_size_is_refused() {
        for text in ["", "GiB", "-1", "4 apples", "1e99GiB", "NaN"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }
}
