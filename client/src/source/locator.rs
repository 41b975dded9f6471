//! From what a user types to a source.

use reqwest::Url;

use super::{FileSource, HttpSource, Source, SourceError};

/// What may be typed, for messages.
const ACCEPTED: &str =
    "name a .lods file, an http(s) URL of one, or a server and a dataset (127.0.0.1:8080/NAME)";

/// See [`Source::parse`].
pub fn parse(text: &str) -> Result<Source, SourceError> {
    match url(text)? {
        Some(url) => Ok(Source::Http(HttpSource::new(url))),
        None => FileSource::open(text).map(Source::File),
    }
}

/// The URL that is named; `None` where it is a file.
pub fn url(text: &str) -> Result<Option<Url>, SourceError> {
    if text.starts_with("http://") || text.starts_with("https://") {
        dataset_url(text).map(Some)
    } else if std::path::Path::new(text).exists() {
        Ok(None)
    } else if is_server_address(text) {
        dataset_url(&format!("http://{text}")).map(Some)
    } else {
        Err(SourceError::permanent(text, format!("no such file; {ACCEPTED}")))
    }
}

/// Whether `text` reads `host:port` or `host:port/…`.
pub(super) fn is_server_address(text: &str) -> bool {
    let authority = text.split('/').next().unwrap_or(text);
    let Some((host, port)) = authority.rsplit_once(':') else { return false };
    // A single letter is a Windows drive.
    host.len() > 1 && port.parse::<u16>().is_ok()
}

/// The URL of the dataset file: as it stands where its path ends in `.lods`; otherwise the last
/// segment is the name of a dataset on one of our servers, which lie under `datasets/`.
fn dataset_url(text: &str) -> Result<Url, SourceError> {
    let mut url = Url::parse(text)
        .map_err(|e| SourceError::permanent(text, format!("not a URL: {e}; {ACCEPTED}")))?;
    url.set_fragment(None);
    let path = url.path().trim_end_matches('/').to_owned();
    if path.ends_with(".lods") {
        return Ok(url);
    }
    let Some((folder, name)) = path.rsplit_once('/').filter(|(_, name)| !name.is_empty()) else {
        let message = format!("which dataset? Add its name, as in {}NAME", url.as_str());
        return Err(SourceError::permanent(text, message));
    };
    let folder = folder.strip_suffix("/datasets").unwrap_or(folder);
    url.set_path(&format!("{folder}/datasets/{name}.lods"));
    Ok(url)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(text: &str) -> String {
        match parse(text).expect(text) {
            Source::Http(source) => source.url().to_string(),
            Source::File(source) => source.path().display().to_string(),
            Source::Linked(source) => source.describe(),
        }
    }

    #[test]
    fn a_url_of_a_file_stays_as_it_is() {
        let url = "https://data.example/scans/a%20b.lods?token=x";
        assert_eq!(resolved(url), url);
    }

    #[test]
    fn a_server_and_a_name_become_the_servers_dataset() {
        for text in [
            "http://127.0.0.1:8080/courtyard",
            "http://127.0.0.1:8080/courtyard/",
            "http://127.0.0.1:8080/datasets/courtyard",
            "127.0.0.1:8080/courtyard",
        ] {
            assert_eq!(resolved(text), "http://127.0.0.1:8080/datasets/courtyard.lods");
        }
        assert_eq!(
            resolved("localhost:80/courtyard.lods"),
            "http://localhost/courtyard.lods",
            "a file name is taken as it stands"
        );
        assert_eq!(resolved("https://a.example/b/c"), "https://a.example/b/datasets/c.lods");
        assert_eq!(resolved("[::1]:8080/c"), "http://[::1]:8080/datasets/c.lods");
    }

    #[test]
    fn a_file_that_is_there_is_a_file() {
        let file = tempfile::NamedTempFile::new().expect("temporary file");
        let path = file.path().to_str().expect("readable path");
        assert_eq!(resolved(path), path);
    }

    #[test]
    fn what_names_nothing_is_refused_with_advice() {
        let message = |text: &str| parse(text).expect_err(text).to_string();
        assert!(message("no/such.lods").contains("no such file"));
        assert!(message("127.0.0.1:8080").contains("which dataset"));
        assert!(message("http://127.0.0.1:8080/").contains("which dataset"));
        assert!(message("http://").contains("not a URL"));
        assert!(message("C:/scans/a.lods").contains("no such file"));
    }
}
