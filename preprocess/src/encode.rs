//! From points to node payloads: gathers a node's columns and encodes them, group by group.

use lodestream_protocol::{
    Attribute, Domain, Error as FormatError, Fine, GroupInfo, LatticeBox, Manifest, MortonCode,
    NodeKey, NormalCone, ScalarType, encode_cells, encode_colors, encode_column,
    encode_fine_positions, encode_positions, is_partable_color,
};

use crate::{cones::NormalColumn, readers::InputAttribute, schema::Schema};

/// Which columns the dataset stores, and where they are in the store's rows.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The manifest's attributes; ranges are filled in at the end.
    pub attributes: Vec<Attribute>,
    /// Per attribute: where its value starts in a cut row.
    pub offsets: Vec<usize>,
    /// The manifest's groups; bytes are filled in at the end.
    pub groups: Vec<GroupInfo>,
    /// The group of fine positions and colours, where these are stored in two parts.
    pub fine: Option<usize>,
    /// The attribute of the colours that are stored in two parts.
    pub fine_color: Option<usize>,
    /// Bytes of a cut row: what varies.
    pub row_bytes: usize,
    /// Where the normals are in a cut row, if there are any and they vary.
    pub normal: Option<NormalColumn>,
    /// What is kept of a row of the store.
    kept: Vec<std::ops::Range<usize>>,
    /// Bytes of a row of the store.
    store_row_bytes: usize,
}

/// The group an attribute belongs to: what views ask for together.
fn group_name(attribute: &InputAttribute) -> &'static str {
    match attribute.name.as_str() {
        "color" => "base",
        "normal" | "curvature" => "normal",
        "intensity" => "intensity",
        "classification" => "classification",
        "gps_time" => "time",
        "return_number"
        | "number_of_returns"
        | "scan_direction_flag"
        | "edge_of_flight_line"
        | "synthetic"
        | "key_point"
        | "withheld"
        | "overlap"
        | "scanner_channel"
        | "user_data"
        | "scan_angle"
        | "scan_angle_rank"
        | "point_source_id" => "scan",
        _ => "extra",
    }
}

impl Layout {
    /// Lays out columns for the attributes of `schema`; those of which every value equals that in
    /// `first_row` (`constant[i]`) are not stored, and rows are cut to the others. `has_fine` where
    /// positions are stored in two parts.
    pub fn new(schema: &Schema, constant: &[bool], first_row: &[u8], has_fine: bool) -> Self {
        let mut row_bytes = 0;
        let mut offsets = Vec::new();
        let mut kept = Vec::new();
        let group = |name: &str| GroupInfo { name: name.into(), columns: vec![0] };
        let mut groups = vec![group("base")];
        let fine = has_fine.then_some(groups.len());
        groups.extend(fine.map(|_| group("fine")));
        let mut attributes = Vec::new();
        for ((input, &offset), &constant) in
            schema.attributes.iter().zip(&schema.offsets).zip(constant)
        {
            let value_bytes = crate::schema::value_bytes(input);
            offsets.push(row_bytes);
            if !constant {
                kept.push(offset..offset + value_bytes);
                row_bytes += value_bytes;
            }
            let storage = if constant {
                Attribute::constant_storage(&first_row[offset..offset + value_bytes])
            } else {
                let name = group_name(input);
                let group = groups.iter().position(|g| g.name == name).unwrap_or_else(|| {
                    groups.push(GroupInfo { name: name.into(), columns: Vec::new() });
                    groups.len() - 1
                });
                groups[group].columns.push(0);
                lodestream_protocol::Storage::Column { group }
            };
            attributes.push(Attribute {
                name: input.name.clone(),
                scalar: input.scalar,
                components: input.components,
                domain: Domain::Element,
                storage,
                min: Vec::new(),
                max: Vec::new(),
            });
        }
        let normal =
            attributes.iter().zip(&offsets).find(|(a, _)| a.is_normal() && a.group().is_some());
        let normal = normal.map(|(a, &offset)| NormalColumn { offset, scalar: a.scalar });
        let fine_color = fine.and_then(|_| attributes.iter().position(is_partable_color));
        if let (Some(fine), Some(_)) = (fine, fine_color) {
            groups[fine].columns.push(0);
        }
        Self {
            attributes,
            offsets,
            groups,
            fine,
            fine_color,
            row_bytes,
            normal,
            kept,
            store_row_bytes: schema.row_bytes,
        }
    }

    /// The columns of a dataset, positions and colours in one part; rows hold what is stored.
    pub fn of(manifest: &Manifest) -> Self {
        let mut row_bytes = 0;
        let offsets = manifest.attributes.iter().map(|attribute| {
            let offset = row_bytes;
            row_bytes += attribute.group().map_or(0, |_| attribute.value_bytes());
            offset
        });
        let offsets = offsets.collect();
        Self {
            attributes: manifest.attributes.clone(),
            offsets,
            groups: manifest.groups.clone(),
            fine: None,
            fine_color: None,
            row_bytes,
            normal: None,
            kept: Vec::new(),
            store_row_bytes: row_bytes,
        }
    }

    /// Rows of the store cut to what varies.
    pub fn cut(&self, rows: Vec<u8>) -> Vec<u8> {
        if self.row_bytes == self.store_row_bytes {
            return rows;
        }
        if self.row_bytes == 0 {
            return Vec::new();
        }
        let mut cut = Vec::with_capacity(rows.len() / self.store_row_bytes * self.row_bytes);
        for row in rows.chunks_exact(self.store_row_bytes) {
            for kept in &self.kept {
                match kept.len() {
                    // A byte or two is a move, not a call.
                    1 => cut.push(row[kept.start]),
                    2 => cut.extend_from_slice(&[row[kept.start], row[kept.start + 1]]),
                    _ => cut.extend_from_slice(&row[kept.clone()]),
                }
            }
        }
        cut
    }
}

/// Smallest and largest value of every component of every attribute.
#[derive(Debug, Clone)]
pub struct Ranges {
    /// Per attribute, per component.
    pub components: Vec<Vec<(f64, f64)>>,
    /// Encoded bytes per attribute (first: positions, or the cells they lie in).
    pub column_bytes: Vec<u64>,
    /// Encoded bytes of fine positions.
    pub fine_bytes: u64,
    /// Encoded bytes of fine colours.
    pub fine_color_bytes: u64,
}

impl Ranges {
    /// No values yet.
    pub fn new(layout: &Layout) -> Self {
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        let components =
            layout.attributes.iter().map(|a| vec![none; usize::from(a.components)]).collect();
        let column_bytes = vec![0; layout.attributes.len() + 1];
        Self { components, column_bytes, fine_bytes: 0, fine_color_bytes: 0 }
    }

    /// Takes in another part's ranges.
    pub fn merge(&mut self, other: &Self) {
        let mine = self.components.iter_mut().flatten();
        for (a, b) in mine.zip(other.components.iter().flatten()) {
            *a = (a.0.min(b.0), a.1.max(b.1));
        }
        for (a, b) in self.column_bytes.iter_mut().zip(&other.column_bytes) {
            *a += b;
        }
        self.fine_bytes += other.fine_bytes;
        self.fine_color_bytes += other.fine_color_bytes;
    }

    /// Tells the manifest the ranges and the bytes of its columns.
    pub fn fill(&self, manifest: &mut Manifest) {
        for (attribute, components) in manifest.attributes.iter_mut().zip(&self.components) {
            fill_range(attribute, components);
        }
        let columns = manifest.attributes.iter().map(Attribute::group);
        let columns = std::iter::once(Some(0)).chain(columns).zip(&self.column_bytes);
        let fine_group = manifest.fine.map(|fine| fine.group);
        let fine = self.fine_columns(manifest.fine).map(|(_, bytes)| (fine_group, bytes));
        let columns = columns.chain(fine);
        for (index, group) in manifest.groups.iter_mut().enumerate() {
            let own = columns.clone().filter(|(group, _)| *group == Some(index));
            group.columns = own.map(|(_, &bytes)| bytes).collect();
        }
    }

    /// Names and bytes of the fine group's columns, in order.
    pub fn fine_columns(&self, fine: Option<Fine>) -> impl Iterator<Item = (&str, &u64)> + Clone {
        let names = fine.map_or(&[][..], Fine::columns);
        names.iter().copied().zip([&self.fine_bytes, &self.fine_color_bytes])
    }

    /// Encoded bytes of all columns.
    pub fn bytes(&self) -> u64 {
        self.column_bytes.iter().sum::<u64>() + self.fine_bytes + self.fine_color_bytes
    }

    fn grow(&mut self, attribute: usize, scalar: ScalarType, values: &[u8]) {
        let ranges = &mut self.components[attribute];
        let size = scalar.size_bytes();
        let components = ranges.len();
        // Integers of one and two bytes are the rule and worth a loop of their own.
        macro_rules! narrow {
            ($t:ty) => {{
                for (c, range) in ranges.iter_mut().enumerate() {
                    let (mut low, mut high) = (<$t>::MAX, <$t>::MIN);
                    for value in values.chunks_exact(size * components) {
                        let at = c * size;
                        let v = bytemuck::pod_read_unaligned::<$t>(&value[at..at + size]);
                        (low, high) = (low.min(v), high.max(v));
                    }
                    if !values.is_empty() {
                        *range = (range.0.min(f64::from(low)), range.1.max(f64::from(high)));
                    }
                }
            }};
        }
        match scalar {
            ScalarType::U8 => narrow!(u8),
            ScalarType::U16 if cfg!(target_endian = "little") => narrow!(u16),
            _ => {
                for value in values.chunks_exact(size * components) {
                    for (range, v) in ranges.iter_mut().zip(value.chunks_exact(size)) {
                        let v = scalar.to_f64(v);
                        *range = (range.0.min(v), range.1.max(v));
                    }
                }
            }
        }
    }
}

fn fill_range(attribute: &mut Attribute, components: &[(f64, f64)]) {
    if let Some(value) = attribute.constant() {
        let size = attribute.scalar.size_bytes();
        let values = value.chunks_exact(size).map(|v| attribute.scalar.to_f64(v));
        attribute.min = values.clone().collect();
        attribute.max = values.collect();
    } else if components.iter().all(|r| r.0.is_finite() && r.1.is_finite()) {
        attribute.min = components.iter().map(|r| r.0).collect();
        attribute.max = components.iter().map(|r| r.1).collect();
    }
    // JSON has no infinities: an attribute with NaN or infinite values may have no finite range.
    if attribute.min.iter().chain(&attribute.max).any(|v| !v.is_finite()) {
        attribute.min.clear();
        attribute.max.clear();
    }
}

/// Length and checksum of a node's payload of one group.
#[derive(Debug, Clone, Copy, Default)]
pub struct Payload {
    /// Bytes.
    pub bytes: u32,
    /// CRC-32.
    pub crc: u32,
}

/// Encodes nodes one after the other into one buffer per group.
#[derive(Debug)]
pub struct NodeEncoder<'a> {
    layout: &'a Layout,
    /// Encoded payloads, per group, back to back.
    pub buffers: Vec<Vec<u8>>,
    /// Ranges of all values encoded so far.
    pub ranges: Ranges,
    rows: Vec<u8>,
    values: Vec<u8>,
}

impl<'a> NodeEncoder<'a> {
    /// An encoder with empty buffers.
    pub fn new(layout: &'a Layout) -> Self {
        Self {
            layout,
            buffers: vec![Vec::new(); layout.groups.len()],
            ranges: Ranges::new(layout),
            rows: Vec::new(),
            values: Vec::new(),
        }
    }

    /// Encodes one node: `codes` are ascending and relative to the node, whose side is `bits` bits and
    /// that of its cells `cell_bits`; `row(i)` is the attribute row of point `i`.
    ///
    /// # Errors
    /// [`FormatError`] where the node has too many points.
    pub fn encode<'r, C: MortonCode>(
        &mut self,
        codes: &[C],
        bits: u8,
        cell_bits: u8,
        row: impl Fn(usize) -> &'r [u8],
    ) -> Result<Vec<Payload>, FormatError> {
        if codes.is_empty() {
            return Ok(vec![Payload::default(); self.buffers.len()]);
        }
        let starts: Vec<usize> = self.buffers.iter().map(Vec::len).collect();
        match self.layout.fine {
            Some(fine) if cell_bits > 0 => {
                encode_cells(&mut self.buffers[0], codes, bits, cell_bits)?;
                encode_fine_positions(&mut self.buffers[fine], codes, cell_bits)?;
                self.ranges.fine_bytes += (self.buffers[fine].len() - starts[fine]) as u64;
            }
            _ => encode_positions(&mut self.buffers[0], codes, bits)?,
        }
        self.ranges.column_bytes[0] += (self.buffers[0].len() - starts[0]) as u64;
        self.rows.clear();
        self.rows.reserve(codes.len() * self.layout.row_bytes);
        for i in 0..codes.len() {
            self.rows.extend_from_slice(row(i));
        }
        for (index, attribute) in self.layout.attributes.iter().enumerate() {
            let Some(group) = attribute.group() else { continue };
            let (offset, len) = (self.layout.offsets[index], attribute.value_bytes());
            gather(&self.rows, self.layout.row_bytes, offset, len, &mut self.values);
            self.ranges.grow(index, attribute.scalar, &self.values);
            let before = self.buffers[group].len();
            if let Some(fine) = self.layout.fine.filter(|_| self.layout.fine_color == Some(index))
                && let Ok([coarse, fine]) = self.buffers.get_disjoint_mut([group, fine])
            {
                let fine_before = fine.len();
                encode_colors(coarse, fine, attribute, &self.values)?;
                self.ranges.fine_color_bytes += (fine.len() - fine_before) as u64;
            } else {
                encode_column(&mut self.buffers[group], attribute, &self.values)?;
            }
            self.ranges.column_bytes[index + 1] += (self.buffers[group].len() - before) as u64;
        }
        let payloads = self.buffers.iter().zip(starts).map(|(buffer, start)| {
            let payload = &buffer[start..];
            let bytes = u32::try_from(payload.len()).map_err(|_| FormatError::Corrupt {
                what: "node",
                why: "more than 4 GiB of payload".into(),
            })?;
            Ok(Payload { bytes, crc: crc32fast::hash(payload) })
        });
        payloads.collect()
    }
}

/// The values of `len` bytes at `offset` of every row.
fn gather(rows: &[u8], row_bytes: usize, offset: usize, len: usize, values: &mut Vec<u8>) {
    /// Copies of a length known to the compiler take no call each.
    fn fixed<const N: usize>(rows: &[u8], row_bytes: usize, offset: usize, values: &mut Vec<u8>) {
        for row in rows.chunks_exact(row_bytes) {
            if let Some(value) = row.get(offset..).and_then(|r| r.first_chunk::<N>()) {
                values.extend_from_slice(value);
            }
        }
    }
    values.clear();
    values.reserve(rows.len() / row_bytes * len);
    match len {
        1 => fixed::<1>(rows, row_bytes, offset, values),
        2 => fixed::<2>(rows, row_bytes, offset, values),
        3 => fixed::<3>(rows, row_bytes, offset, values),
        4 => fixed::<4>(rows, row_bytes, offset, values),
        6 => fixed::<6>(rows, row_bytes, offset, values),
        8 => fixed::<8>(rows, row_bytes, offset, values),
        12 => fixed::<12>(rows, row_bytes, offset, values),
        _ => {
            for row in rows.chunks_exact(row_bytes) {
                values.extend_from_slice(&row[offset..offset + len]);
            }
        }
    }
}

/// A node that is ready to be written.
#[derive(Debug, Clone)]
pub struct OutNode {
    /// Its cube.
    pub key: NodeKey,
    /// Octants of its children.
    pub child_mask: u8,
    /// Points in it.
    pub points: u32,
    /// Tight bounds of the points in it and below it.
    pub bounds: LatticeBox,
    /// World units; 0 for leaves.
    pub geometric_error: f32,
    /// World units.
    pub spacing: f32,
    /// Where there are normals: holds those of the points in it and below it.
    pub normal_cone: Option<NormalCone>,
    /// Per group.
    pub payloads: Vec<Payload>,
    /// Which part of the build encoded it, and where its payloads start in that part's buffers.
    pub part: u32,
    /// See [`part`](Self::part).
    pub starts: Vec<u64>,
}
