//! A description for people.

use indicatif::{BinaryBytes, HumanCount};
use lodestream_protocol::ScalarType;

use super::{
    Description,
    table::{Align, table},
};

/// Lays a description out as aligned text, without the dataset's name.
#[must_use]
pub fn render(description: &Description) -> String {
    let parts = [
        facts(description),
        groups(description),
        attributes(description),
        levels(description),
        sources(description),
    ];
    let parts: Vec<_> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    parts.join("\n")
}

fn facts(d: &Description) -> String {
    let mut rows = vec![
        ["points".into(), count(d.points)],
        ["nodes".into(), format!("{} on {} levels", count(d.nodes), d.levels.len())],
        [
            "size".into(),
            format!("{}, {:.3} bytes per point", bytes(d.file_bytes), d.bytes_per_point),
        ],
        ["first picture".into(), format!("the first {}", bytes(d.boot_bytes))],
        ["method".into(), method(d)],
        ["lattice".into(), lattice(d)],
    ];
    if let Some(crs) = &d.crs {
        rows.push(["reference system".into(), shorten(crs, 60)]);
    }
    let (major, minor) = d.format_version;
    rows.push(["written by".into(), format!("{}, format {major}.{minor}", d.generator)]);
    rows.push(["content".into(), d.content_id.clone()]);
    table([Align::Left, Align::Left], &rows) + &bounds(d)
}

fn method(d: &Description) -> String {
    let m = &d.method;
    let leaf = count(u64::from(m.leaf_capacity));
    let (refinement, primitive) = (name(&d.refinement), name(&d.primitive));
    format!("{}, grid {}, leaves of up to {leaf}; {refinement} {primitive}s", m.name, m.grid)
}

fn lattice(d: &Description) -> String {
    let (scale, bits) = (d.lattice.scale, d.lattice.side_bits);
    let rounding = match d.largest_rounding {
        0.0 => "exact".to_owned(),
        largest => format!("coordinates rounded by at most {largest:e}"),
    };
    format!("steps of {scale}, root cube of 2^{bits} steps; {rounding}")
}

fn bounds(d: &Description) -> String {
    let Some(bounds) = &d.bounds else { return String::new() };
    let digits = decimals(d.lattice.scale);
    let number = |v: f64| format!("{v:.digits$}");
    let mut rows = vec![["bounds", "lowest", "highest", "extent"].map(str::to_owned)];
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        rows.push([name.into(), number(low), number(high), number(high - low)]);
    }
    format!("\n{}", table([Align::Left, Align::Right, Align::Right, Align::Right], &rows))
}

fn groups(d: &Description) -> String {
    let mut rows = vec![["group", "column", "bytes", "per point"].map(str::to_owned)];
    let row = |group: &str, column: &str, bytes, per_point: f64| {
        [group.to_owned(), column.to_owned(), count(bytes), format!("{per_point:.3}")]
    };
    for group in &d.groups {
        if let [column] = &group.columns[..] {
            rows.push(row(&group.name, &column.name, group.bytes, group.bytes_per_point));
            continue;
        }
        rows.push(row(&group.name, "", group.bytes, group.bytes_per_point));
        for column in &group.columns {
            rows.push(row("", &column.name, column.bytes, column.bytes_per_point));
        }
    }
    let index_per_point = if d.points == 0 { 0.0 } else { d.index_bytes as f64 / d.points as f64 };
    rows.push(row("index", "", d.index_bytes, index_per_point));
    table([Align::Left, Align::Left, Align::Right, Align::Right], &rows)
}

fn attributes(d: &Description) -> String {
    let mut rows = vec![["attribute", "type", "lowest", "highest"].map(str::to_owned)];
    for a in &d.attributes {
        let (low, high) = (values(&a.min), values(&a.max));
        rows.push([a.name.clone(), type_name(a.scalar, a.components.into()), low, high]);
    }
    for c in &d.constants {
        let kind = type_name(c.scalar, c.value.len());
        rows.push([c.name.clone(), kind, values(&c.value), "the same everywhere".into()]);
    }
    for name in &d.absent {
        rows.push([(*name).to_owned(), "-".into(), "absent".into(), String::new()]);
    }
    table([Align::Left; 4], &rows)
}

fn levels(d: &Description) -> String {
    let titles = ["level", "nodes", "points", "bytes", "spacing"];
    let mut rows = vec![titles.map(str::to_owned)];
    for l in &d.levels {
        let spacing = significant(l.spacing);
        rows.push([l.level.to_string(), count(l.nodes), count(l.points), count(l.bytes), spacing]);
    }
    if d.levels.is_empty() { String::new() } else { table([Align::Right; 5], &rows) }
}

fn sources(d: &Description) -> String {
    let mut rows = vec![["source", "points"].map(str::to_owned)];
    rows.extend(d.sources.iter().map(|s| [s.name.clone(), count(s.points)]));
    if d.sources.is_empty() { String::new() } else { table([Align::Left, Align::Right], &rows) }
}

fn count(n: u64) -> String {
    HumanCount(n).to_string()
}

fn bytes(n: u64) -> String {
    BinaryBytes(n).to_string()
}

/// Decimal places that tell steps of `scale` apart.
fn decimals(scale: f64) -> usize {
    let places = (-scale.log10()).ceil().clamp(0.0, 12.0);
    places as usize
}

/// Four significant digits.
fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let places = (3.0 - value.abs().log10().floor()).clamp(0.0, 12.0);
    format!("{value:.*}", places as usize)
}

fn values(values: &[f64]) -> String {
    let texts: Vec<_> = values.iter().map(f64::to_string).collect();
    match texts.first() {
        None => "unknown".into(),
        Some(first) if texts.iter().all(|text| text == first) => first.clone(),
        Some(_) => texts.join(" "),
    }
}

fn type_name(scalar: ScalarType, components: usize) -> String {
    match components {
        1 => name(&scalar),
        _ => format!("{} x {components}", name(&scalar)),
    }
}

/// The name of a unit variant.
fn name(value: &impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}

fn shorten(text: &str, max: usize) -> String {
    if text.chars().count() <= max {
        return text.to_owned();
    }
    text.chars().take(max).chain("…".chars()).collect()
}
