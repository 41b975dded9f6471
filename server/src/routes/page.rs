//! The list of datasets for people.

use std::{fmt::Write, sync::Arc};

use axum::{extract::State, http::header, response::IntoResponse};
use indicatif::{BinaryBytes, HumanCount};

use super::{Refusal, Site};
use crate::index::DatasetIndex;

/// `GET /`: the list as a small page without scripts.
pub(super) async fn page(State(site): State<Arc<Site>>) -> Result<impl IntoResponse, Refusal> {
    let index = site.read_index().await?;
    let fields = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CACHE_CONTROL, "no-cache"),
        (header::CONTENT_SECURITY_POLICY, "default-src 'none'; style-src 'unsafe-inline'"),
    ];
    Ok((fields, render(&index)))
}

fn render(index: &DatasetIndex) -> String {
    let mut rows = String::new();
    for dataset in &index.datasets {
        let attributes: Vec<_> = dataset.attributes.iter().map(|a| a.name.as_str()).collect();
        // Writing to a string does not fail.
        let _ = writeln!(
            rows,
            "<tr><td><a href=\"{}\">{}</a><td class=n>{}<td class=n>{}<td class=n>{}<td>{}",
            escape(&dataset.url),
            escape(&dataset.name),
            HumanCount(dataset.points),
            dataset.levels,
            BinaryBytes(dataset.bytes),
            escape(&attributes.join(", ")),
        );
    }
    for file in &index.unreadable {
        let (name, reason) = (escape(&file.file), escape(&file.reason));
        let _ = writeln!(rows, "<tr class=bad><td>{name}<td colspan=4>not served: {reason}");
    }
    if rows.is_empty() {
        rows.push_str("<tr><td colspan=5>No datasets here yet.\n");
    }
    format!(
        "<!doctype html>\n<html lang=en>\n<meta charset=utf-8>\n<title>lodestream</title>\n\
         <style>\n{STYLE}</style>\n<h1>lodestream</h1>\n<table>\n\
         <tr><th>dataset<th class=n>points<th class=n>levels<th class=n>size<th>attributes\n\
         {rows}</table>\n<p>For programs: <a href=datasets>datasets</a> (JSON).\n"
    )
}

const STYLE: &str = "\
:root { color-scheme: light dark }
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem }
table { border-collapse: collapse; width: 100% }
th, td { border-bottom: 1px solid #8884; padding: .3rem .8rem .3rem 0; text-align: left }
.n { font-variant-numeric: tabular-nums; text-align: right }
.bad { opacity: .6 }
";

fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::UnreadableEntry;

    #[test]
    fn names_and_reasons_cannot_bring_markup_in() {
        let file = "<script>&\"'.lods".to_owned();
        let unreadable = vec![UnreadableEntry { reason: file.clone(), file }];
        let page = render(&DatasetIndex { datasets: Vec::new(), unreadable });
        assert!(!page.contains("<script>"), "{page}");
        assert!(page.contains("&lt;script&gt;&amp;&quot;&#39;.lods"), "{page}");
    }
}
