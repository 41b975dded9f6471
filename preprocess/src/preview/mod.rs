//! A small picture of a dataset, for lists of datasets.
//!
//! It lies beside the dataset, as `NAME.preview.png`: the dataset's own bytes stay those that a
//! client needs, and any host can hand out the picture as it is. A text in the PNG names the content
//! that it shows, so that a picture is never taken for that of a dataset which has replaced its own.
//!
//! Drawn from the upper levels alone, looking down from the south-west, in parallel projection; with
//! the points' colours, or else by height. What is not covered is transparent, so that the picture
//! looks well on any page. The same dataset gives the same picture.

mod canvas;
mod palette;
mod view;

use std::{
    io::{Cursor, Write},
    path::{Path, PathBuf},
};

use lodestream_protocol::{Dataset, Node, NodePoints, Refinement};

use crate::{
    error::{Error, Result},
    file::FileSource,
    target::Target,
};

use canvas::Canvas;
use palette::Palette;
use view::View;

/// Width and height in pixels.
pub const PREVIEW_SIZE: [u32; 2] = [640, 400];
/// Most bytes of a file that is looked at as a preview.
pub const MAX_PREVIEW_BYTES: usize = 2 << 20;

/// What the name of a preview ends in, in place of the dataset's `.lods`.
pub const PREVIEW_SUFFIX: &str = ".preview.png";

/// Points that a picture is drawn from, unless the top level alone has more: about two a sample.
const MAX_POINTS: u64 = 2_000_000;
/// The text that names the content.
const CONTENT_KEYWORD: &str = "lodestream-content-id";

/// Where a dataset's preview lies.
#[must_use]
pub fn preview_path(dataset: &Path) -> PathBuf {
    dataset.with_extension(&PREVIEW_SUFFIX[1..])
}

/// Draws a dataset's preview and writes it beside the dataset; nothing for one without points.
///
/// # Errors
/// Where the dataset cannot be read, or the picture not be written.
pub fn write_preview(dataset: &Path) -> Result<Option<PathBuf>> {
    let Some(picture) = draw_preview(dataset)? else { return Ok(None) };
    let path = preview_path(dataset);
    let mut target = Target::create(&path)?;
    target.write_all(&picture).map_err(Error::io(&path, "cannot write"))?;
    target.finish()?;
    Ok(Some(path))
}

/// The preview as PNG; nothing for a dataset without points.
///
/// # Errors
/// Where the dataset cannot be read.
pub fn draw_preview(path: &Path) -> Result<Option<Vec<u8>>> {
    let failed = |source| Error::Format { path: path.display().to_string(), source };
    let dataset = Dataset::open(FileSource::open(path)?).map_err(failed)?;
    let manifest = dataset.manifest();
    let nodes = upper_levels(&dataset.boot().root_page.nodes, manifest.refinement);
    let palette = Palette::of(manifest);
    let Some(view) = View::of(manifest, PREVIEW_SIZE.map(|size| size * canvas::SAMPLES)) else {
        return Ok(None);
    };
    let groups: Vec<usize> = palette.group().into_iter().collect();
    let read = |node: &Node| dataset.read_node(node, &groups).map_err(failed);
    let points: Vec<NodePoints> =
        nodes.iter().map(|(node, _)| read(node)).collect::<Result<_>>()?;
    let view = view.fitted(points.iter().flat_map(|node| {
        let corner = manifest.lattice.node_min(node.key);
        node.positions.iter().map(move |q| std::array::from_fn(|a| corner[a] + q[a]))
    }));
    let deepest = nodes.iter().map(|(node, _)| node.key.level()).max().unwrap_or(0);
    let finest = manifest.spacing_world(deepest);
    let mut canvas = Canvas::new(PREVIEW_SIZE);
    for ((node, has_children_drawn), points) in nodes.iter().zip(&points) {
        let corner = manifest.lattice.node_min(node.key);
        let spacing = if *has_children_drawn { finest } else { f64::from(node.spacing) };
        let side = view.pixels(spacing);
        for (i, q) in points.positions.iter().enumerate() {
            let position = std::array::from_fn(|a| corner[a] + q[a]);
            canvas.splat(view.project(position), side, palette.color(points, i, position[2]));
        }
    }
    canvas.shade();
    Ok(Some(encode(&canvas.resolve(), &dataset.boot().header.content_id_hex())))
}

/// The content that a preview shows: its identity, in hexadecimal. `None` where the bytes are no
/// preview of ours.
#[must_use]
pub fn preview_content_id(bytes: &[u8]) -> Option<String> {
    if bytes.len() > MAX_PREVIEW_BYTES {
        return None;
    }
    let limits = png::Limits { bytes: MAX_PREVIEW_BYTES };
    let reader = png::Decoder::new_with_limits(Cursor::new(bytes), limits).read_info().ok()?;
    let info = reader.info();
    let text = info.uncompressed_latin1_text.iter().find(|text| text.keyword == CONTENT_KEYWORD)?;
    ([info.width, info.height] == PREVIEW_SIZE).then(|| text.text.clone())
}

/// Whole levels from the root on, as many as [`MAX_POINTS`] allows, each node with whether its
/// children are drawn too.
fn upper_levels(nodes: &[Node], refinement: Refinement) -> Vec<(&Node, bool)> {
    let depth = nodes.iter().map(|node| node.key.level()).max().unwrap_or(0);
    let of = |level| nodes.iter().filter(move |node| node.key.level() == level);
    let (mut points, mut last) = (0, 0);
    for level in 0..=depth {
        points += of(level).map(|node| u64::from(node.points)).sum::<u64>();
        // A page may end within a level: what lies below such nodes is not here.
        if level > 0 && points > MAX_POINTS {
            break;
        }
        last = level;
    }
    let drawn = nodes.iter().filter(|node| node.key.level() <= last);
    let drawn = drawn.map(|node| {
        (node, node.key.level() < last && !node.is_leaf() && node.child_page.is_none())
    });
    // In a tree whose children stand for their parents, only the lowest of those drawn count.
    drawn.filter(|(_, has_children)| refinement == Refinement::Additive || !has_children).collect()
}

fn encode(rgba: &[u8], content_id: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let [width, height] = PREVIEW_SIZE;
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder
        .add_text_chunk(CONTENT_KEYWORD.into(), content_id.into())
        .and_then(|()| encoder.write_header())
        .and_then(|mut writer| writer.write_image_data(rgba))
        .expect("writing a picture of the stated size to memory does not fail");
    bytes
}

#[cfg(test)]
mod tests;
