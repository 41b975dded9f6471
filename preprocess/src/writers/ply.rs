//! PLY files, binary little-endian.
//!
//! Coordinates are `double x y z`; `color` is `red green blue`, of 8 bits where no value is above
//! 255 and of 16 bits else; a `normal` in floating point is `nx ny nz`. Every other attribute goes
//! by its name, with `_0`, `_1`, … where it has several components. PLY knows no integers of 64
//! bits: they are written as `double` where that holds them exactly, else as two halves. It has no
//! place for a coordinate reference system either.

use std::{
    collections::HashSet,
    io::{Seek as _, SeekFrom, Write as _},
    path::{Path, PathBuf},
};

use lodestream_protocol::{Attribute, Lattice, ScalarType};
use rayon::prelude::*;

use super::{
    ExportBlock, ExportInfo, PointWriter,
    source::{Source, is_exact_as_f64, is_per_point, range},
};
use crate::{
    error::{Error, Result},
    target::Target,
};

/// Points that a thread turns into vertices at a time.
const TASK_POINTS: usize = 8192;

/// Bytes of the three coordinates of a vertex.
const POSITION_BYTES: usize = 24;

/// Creates the file.
pub(super) fn create(path: &Path, info: ExportInfo) -> Result<Box<dyn PointWriter>> {
    let mut layout = Layout::new(&info.attributes);
    let mut notes = std::mem::take(&mut layout.notes);
    if info.crs.is_some() {
        notes.push("the coordinate reference system is left out: PLY has no place for it".into());
    }
    let mut target = Target::create(path)?;
    // Room for the header: the number of vertices is known at the end.
    let room = layout.header(0);
    target.write_all(room.as_bytes()).map_err(Error::io(path, "cannot write"))?;
    let path = path.to_owned();
    Ok(Box::new(PlyWriter { path, info, layout, target, vertices: Vec::new(), points: 0, notes }))
}

struct PlyWriter {
    path: PathBuf,
    info: ExportInfo,
    layout: Layout,
    target: Target,
    /// The block as vertices; kept for its memory.
    vertices: Vec<u8>,
    points: u64,
    notes: Vec<String>,
}

impl PointWriter for PlyWriter {
    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn write(&mut self, block: &ExportBlock) -> Result<()> {
        let Self { info, layout, vertices, .. } = self;
        layout.fill(&info.attributes, &info.lattice, block, vertices)?;
        self.points += block.positions.len() as u64;
        self.target.write_all(&self.vertices).map_err(Error::io(&self.path, "cannot write"))
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        let failed = |e| Error::io(&self.path, "cannot write")(e);
        let header = self.layout.header(self.points);
        self.target.seek(SeekFrom::Start(0)).map_err(failed)?;
        self.target.write_all(header.as_bytes()).map_err(failed)?;
        self.target.finish()
    }
}

/// Which properties a vertex has, and where they come from.
#[derive(Debug, Default)]
struct Layout {
    /// Type and name, in order.
    properties: Vec<(&'static str, String)>,
    steps: Vec<Step>,
    vertex_bytes: usize,
    notes: Vec<String>,
}

/// An attribute on its way into vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Step {
    attribute: usize,
    /// First byte in the vertex.
    at: usize,
    change: Change,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    /// All bytes as they are.
    Copy,
    /// 16-bit components as 8 bits, which hold them.
    Narrow,
    /// 64-bit integers as `double`, which holds them.
    Double(ScalarType),
}

impl Layout {
    fn new(attributes: &[Attribute]) -> Self {
        let mut layout = Self { vertex_bytes: POSITION_BYTES, ..Self::default() };
        let mut taken = HashSet::new();
        for axis in ["x", "y", "z"] {
            taken.insert(axis.to_owned());
            layout.properties.push(("double", axis.to_owned()));
        }
        for (index, attribute) in attributes.iter().enumerate() {
            if is_per_point(attribute) {
                layout.add(index, attribute, &mut taken);
            } else {
                layout.notes.push(format!(
                    "attribute {} is left out: it belongs to textures, not to points",
                    attribute.name
                ));
            }
        }
        layout
    }

    fn add(&mut self, index: usize, attribute: &Attribute, taken: &mut HashSet<String>) {
        let Attribute { name, scalar, components, .. } = attribute;
        let wide = matches!(scalar, ScalarType::U64 | ScalarType::I64);
        let is_color = name == "color" && *components == 3;
        let (change, kind, parts) = match scalar {
            ScalarType::U16 if is_color && range(attribute).1 <= 255.0 => {
                (Change::Narrow, "uchar", 1)
            }
            _ if wide && is_exact_as_f64(attribute) => (Change::Double(*scalar), "double", 1),
            ScalarType::U64 | ScalarType::I64 => {
                self.notes.push(format!(
                    "attribute {name}: its 64-bit integers are written as {name}_low and _high"
                ));
                (Change::Copy, "uint", 2)
            }
            ScalarType::U8 => (Change::Copy, "uchar", 1),
            ScalarType::I8 => (Change::Copy, "char", 1),
            ScalarType::U16 => (Change::Copy, "ushort", 1),
            ScalarType::I16 => (Change::Copy, "short", 1),
            ScalarType::U32 => (Change::Copy, "uint", 1),
            ScalarType::I32 => (Change::Copy, "int", 1),
            ScalarType::F32 => (Change::Copy, "float", 1),
            ScalarType::F64 => (Change::Copy, "double", 1),
        };
        self.steps.push(Step { attribute: index, at: self.vertex_bytes, change });
        self.vertex_bytes += match change {
            Change::Narrow => usize::from(*components),
            Change::Copy | Change::Double(_) => attribute.value_bytes(),
        };
        for component in 0..usize::from(*components) {
            let part = match (name.as_str(), components) {
                ("color", 3) => ["red", "green", "blue"][component].to_owned(),
                ("normal", 3) if !scalar.is_integer() => ["nx", "ny", "nz"][component].to_owned(),
                (_, 1) => name.clone(),
                _ => format!("{name}_{component}"),
            };
            let halves = if parts == 2 { &["_low", "_high"][..] } else { &[""] };
            for half in halves {
                let wanted = property_name(&format!("{part}{half}"));
                let unique = std::iter::once(wanted.clone())
                    .chain((2..).map(|n: u32| format!("{wanted}_{n}")))
                    .find(|candidate| !taken.contains(candidate))
                    .expect("there are more numbers than properties");
                taken.insert(unique.clone());
                self.properties.push((kind, unique));
            }
        }
    }

    /// The header; equally long for any number of points.
    fn header(&self, points: u64) -> String {
        const MOST_DIGITS: usize = 20;
        let count = points.to_string();
        let filler = " ".repeat(MOST_DIGITS - count.len());
        let version = env!("CARGO_PKG_VERSION");
        let properties: String = self
            .properties
            .iter()
            .map(|(kind, name)| format!("property {kind} {name}\n"))
            .collect();
        format!(
            "ply\nformat binary_little_endian 1.0\ncomment written by lodestream {version}{filler}\n\
             element vertex {count}\n{properties}end_header\n"
        )
    }

    /// Turns a block into vertices.
    fn fill(
        &self,
        attributes: &[Attribute],
        lattice: &Lattice,
        block: &ExportBlock,
        vertices: &mut Vec<u8>,
    ) -> Result<()> {
        let sources = self
            .steps
            .iter()
            .map(|step| {
                let source = Source::find(&attributes[step.attribute], step.attribute, block)?;
                Ok((*step, source))
            })
            .collect::<Result<Vec<(Step, Source)>>>()?;
        vertices.resize(block.positions.len() * self.vertex_bytes, 0);
        vertices
            .par_chunks_mut(TASK_POINTS * self.vertex_bytes)
            .zip(block.positions.par_chunks(TASK_POINTS))
            .enumerate()
            .try_for_each(|(task, (vertices, positions))| {
                for (vertex, position) in
                    vertices.chunks_exact_mut(self.vertex_bytes).zip(positions)
                {
                    for (axis, world) in lattice.world(*position).iter().enumerate() {
                        vertex[8 * axis..8 * axis + 8].copy_from_slice(&world.to_le_bytes());
                    }
                }
                for (step, source) in &sources {
                    let name = &attributes[step.attribute].name;
                    step.run(source, task * TASK_POINTS, vertices, self.vertex_bytes, name)?;
                }
                Ok(())
            })
    }
}

impl Step {
    fn run(
        self,
        source: &Source,
        first: usize,
        vertices: &mut [u8],
        vertex_bytes: usize,
        name: &str,
    ) -> Result<()> {
        for (i, vertex) in vertices.chunks_exact_mut(vertex_bytes).enumerate() {
            let value = source.value(first + i);
            let out = &mut vertex[self.at..];
            match self.change {
                Change::Copy => out[..value.len()].copy_from_slice(value),
                Change::Narrow => {
                    for (out, pair) in out.iter_mut().zip(value.chunks_exact(2)) {
                        let &[low, 0] = pair else {
                            return Err(Error::Setup(format!(
                                "attribute {name}: a value lies outside the range announced for it"
                            )));
                        };
                        *out = low;
                    }
                }
                Change::Double(scalar) => {
                    for (out, bytes) in out.chunks_exact_mut(8).zip(value.chunks_exact(8)) {
                        out.copy_from_slice(&scalar.to_f64(bytes).to_le_bytes());
                    }
                }
            }
        }
        Ok(())
    }
}

/// A name without the blanks that end a name in a PLY header.
fn property_name(name: &str) -> String {
    name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_is_equally_long_for_any_number_of_points() {
        let layout = Layout::new(&[]);
        assert_eq!(layout.header(0).len(), layout.header(u64::MAX).len());
        assert!(layout.header(17).contains("element vertex 17\n"));
    }

    #[test]
    fn names_have_no_blanks() {
        assert_eq!(property_name("height above ground"), "height_above_ground");
    }
}
