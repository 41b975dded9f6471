//! Whether the bytes are a dataset's, and those that were written.

use lodestream_protocol::{
    BOOT_SPECULATIVE_BYTES, Boot, Error, HEADER_BYTES, Header, Node, decode_group,
};

use super::{finding::Finding, probe::Probe, ranges};

/// Payloads and pages that are looked at, and how many bytes at most.
const SAMPLES: usize = 8;
const SAMPLE_BYTES: u64 = 4 << 20;

/// What the bytes turned out to be.
#[derive(Debug, Default)]
pub struct Content {
    /// In the order in which it was looked at.
    pub findings: Vec<Finding>,
    /// The index, where it is whole.
    pub boot: Option<Boot>,
}

/// Reads the index and looks at samples of the rest. `total` is the file's length, where the host tells.
pub async fn content(probe: &Probe, total: Option<u64>) -> Content {
    let mut content = Content::default();
    match index(probe, total, &mut content.findings).await {
        Ok(boot) => {
            let finding = samples(probe, &boot).await;
            content.findings.push(finding);
            content.boot = Some(boot);
        }
        Err(finding) => content.findings.push(finding),
    }
    content
}

async fn index(
    probe: &Probe,
    total: Option<u64>,
    findings: &mut Vec<Finding>,
) -> Result<Boot, Finding> {
    let end = BOOT_SPECULATIVE_BYTES.min(total.unwrap_or(u64::MAX));
    let mut bytes = read(probe, "index", 0, end).await?;
    let header = Header::parse(&bytes).map_err(|error| what_it_is(&error, &bytes))?;
    findings.push(Finding::ok(
        "format",
        format!("a dataset of format {}.{}", header.version.0, header.version.1),
    ));
    if let Some(total) = total {
        findings.push(match total.cmp(&header.file_bytes) {
            std::cmp::Ordering::Less => Finding::fail(
                "size",
                format!("the file has {total} bytes of {}: cut short", header.file_bytes),
                "copy it to the host again, whole",
            ),
            std::cmp::Ordering::Greater => Finding::warn(
                "size",
                format!("the file has {total} bytes, the dataset ends at {}", header.file_bytes),
                "something was added behind it: copy it to the host again",
            ),
            std::cmp::Ordering::Equal => Finding::ok("size", format!("{total} bytes, all of it")),
        });
    }
    let needed = header.index_bytes();
    if needed > bytes.len() as u64 {
        bytes.extend(read(probe, "index", bytes.len() as u64, needed).await?);
    }
    Boot::parse(&bytes).map_err(|error| damaged("index", &error))
}

/// Exactly these bytes (or up to the end of a file of unknown length).
async fn read(probe: &Probe, check: &str, start: u64, end: u64) -> Result<Vec<u8>, Finding> {
    let answer = probe.range(start, end).await.map_err(|why| {
        let found = format!("bytes {start} to {end}: {why}");
        Finding::fail(check, found, "look into the host's log")
    })?;
    let wrong = ranges::range(&answer, start, end).or_else(|| ranges::length(&answer, start));
    wrong.map_or_else(|| Ok(answer.body.to_vec()), Err)
}

fn what_it_is(error: &Error, bytes: &[u8]) -> Finding {
    const CHECK: &str = "format";
    match error {
        Error::NotADataset => {
            let looks = looks_like(bytes);
            Finding::fail(
                CHECK,
                format!("no dataset: {looks}"),
                "check the address; a dataset is made by `lodestream build` and ends in .lods. Where the file \
                 on the host is one, something on the way changes it",
            )
        }
        Error::NewerVersion { .. } => Finding::fail(CHECK, error.to_string(), "update lodestream"),
        _ => damaged(CHECK, error),
    }
}

/// What bytes that are no dataset look like.
fn looks_like(bytes: &[u8]) -> String {
    let start = &bytes[..bytes.len().min(HEADER_BYTES)];
    let text = String::from_utf8_lossy(start).trim_start().to_ascii_lowercase();
    match start {
        [] => "it is empty".into(),
        _ if text.starts_with("<!doctype html") || text.starts_with("<html") => {
            "it is a web page, perhaps of an error".into()
        }
        [b'L', b'O', b'D', b'S', ..] => {
            "its line ends were changed, as by a transfer in text mode".into()
        }
        [b'L', b'A', b'S', b'F', ..] => {
            "it is a LAS or LAZ file, which has to be built first".into()
        }
        [b'p', b'l', b'y', ..] => "it is a PLY file, which has to be built first".into(),
        [0x1f, 0x8b, ..] => "it is compressed (gzip)".into(),
        [b'v', b'e', b'r', b's', b'i', b'o', b'n', ..] => {
            "it is a pointer of Git LFS, not the file".into()
        }
        [b'{' | b'[', ..] => "it is JSON".into(),
        _ => "it does not start with the LODS signature".into(),
    }
}

fn damaged(check: &str, error: &Error) -> Finding {
    Finding::fail(
        check,
        error.to_string(),
        "copy the file to the host again; `lodestream verify` there tells whether it is whole. If it is, a \
         cache on the way is damaged: empty it",
    )
}

/// Decodes payloads from all over the file, and the first page that hangs below the root's.
async fn samples(probe: &Probe, boot: &Boot) -> Finding {
    const CHECK: &str = "payloads";
    let mut nodes: Vec<&Node> = boot.root_page.nodes.iter().filter(|n| n.points > 0).collect();
    nodes.sort_by_key(|node| node.payloads.first().map(|payload| payload.offset));
    let step = nodes.len().div_ceil(SAMPLES).max(1);
    let last = nodes.last().copied();
    let chosen = nodes.iter().copied().step_by(step).chain(last);
    let (mut looked_at, mut bytes) = (0, 0);
    for node in chosen {
        for (group, payload) in node.payloads.iter().enumerate() {
            let len = u64::from(payload.bytes);
            if bytes + len > SAMPLE_BYTES || len == 0 {
                continue;
            }
            match read(probe, CHECK, payload.offset, payload.offset + len).await {
                Err(finding) => return finding,
                Ok(payload) => {
                    if let Err(error) = decode_group(&boot.manifest, group, node, &payload) {
                        return damaged(CHECK, &error);
                    }
                }
            }
            looked_at += 1;
            bytes += len;
        }
    }
    let below = boot.root_page.nodes.iter().find_map(|node| Some((node, node.child_page?)));
    if let Some((node, page)) = below {
        match read(probe, CHECK, page.offset, page.offset + u64::from(page.bytes)).await {
            Err(finding) => return finding,
            Ok(bytes) => {
                if let Err(error) = boot.parse_child_page(&bytes, node) {
                    return damaged(CHECK, &error);
                }
            }
        }
        looked_at += 1;
    }
    Finding::ok(CHECK, format!("{looked_at} samples from all over the file are what was written"))
}
