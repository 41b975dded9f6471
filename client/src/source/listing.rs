//! What there is to open: a server's list, a folder's files.

use std::path::Path;

use lodestream_server::DatasetIndex;
use reqwest::Url;

use super::{HttpSource, SourceError};

/// Longest list that is read.
const MAX_BYTES: usize = 16 << 20;

/// Whether a text names a server as such, without a dataset.
#[must_use]
pub fn is_server(text: &str) -> bool {
    address(text).is_some()
}

/// The address of a server's list, where the text is that of a server.
fn address(text: &str) -> Option<Url> {
    let text = text.trim();
    let is_url = text.starts_with("http://") || text.starts_with("https://");
    if !is_url && (Path::new(text).exists() || !super::locator::is_server_address(text)) {
        return None;
    }
    let mut url = Url::parse(&if is_url { text.into() } else { format!("http://{text}") }).ok()?;
    let path = url.path().trim_end_matches('/').to_owned();
    if !(path.is_empty() || path == "/datasets") {
        return None;
    }
    url.set_path("/datasets");
    Some(url)
}

/// Asks a server for its list. Waits for it: not for a thread that draws.
///
/// # Errors
/// [`SourceError`] where there is none.
pub fn list_datasets(server: &str) -> Result<DatasetIndex, SourceError> {
    let url = address(server)
        .ok_or_else(|| SourceError::permanent(server, "not the address of a server"))?;
    let place = super::without_secrets(&url);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|e| SourceError::transient(&place, format!("no thread: {e}")))?;
    // The client that datasets are read by.
    let source = HttpSource::new(url);
    let bytes = runtime.block_on(source.read_document(MAX_BYTES))?;
    serde_json::from_slice(&bytes).map_err(|e| {
        let why = format!("its answer is no list of datasets ({e}); name a dataset on it instead");
        SourceError::permanent(place, why)
    })
}

/// The dataset files of a folder, by name.
#[must_use]
pub fn datasets_of_folder(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let files = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let datasets = files.filter(|path| path.extension().is_some_and(|end| end == "lods"));
    let mut datasets: Vec<String> = datasets.map(|path| path.display().to_string()).collect();
    datasets.sort();
    datasets
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servers_are_told_from_datasets() {
        for text in
            ["127.0.0.1:8080", "http://a.example", "http://a.example/datasets/", "[::1]:80/"]
        {
            let address = address(text).expect(text);
            assert_eq!(address.path(), "/datasets", "{text}");
        }
        for text in ["127.0.0.1:8080/x", "http://a.example/b.lods", "a.lods", "", "."] {
            assert!(!is_server(text), "{text}");
        }
    }
}
