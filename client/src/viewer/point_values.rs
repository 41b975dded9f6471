//! All attributes of one point: what is not part of the picture is fetched for its node.

use lodestream_protocol::{Dataset, Lattice, Manifest, NodeKey, NodePoints, ReadAt, ScalarType};

use crate::source::{BlockingSource, Source};

/// Components that are shown of a value.
const MOST_COMPONENTS: usize = 8;

/// Names and values, in the dataset's order.
pub type Values = Vec<(String, String)>;

/// What is known of a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Known {
    /// All attributes.
    pub values: Values,
    /// Where it lies in its node, lattice units.
    pub within_node: Option<[u32; 3]>,
    /// The lattice of its dataset.
    pub lattice: Option<Lattice>,
}

/// Reads position and attributes of a point, to the last bit, of the dataset that was drawn. Waits for the
/// source: not for the window's thread.
///
/// # Errors
/// What went wrong, for people.
pub fn fetch(
    source: &str,
    key: NodeKey,
    point: usize,
    drawn: Option<&Manifest>,
) -> Result<Known, String> {
    let source = Source::parse(source).map_err(|e| e.to_string())?;
    let source = BlockingSource::new(source).map_err(|e| e.to_string())?;
    let dataset = Dataset::open(source).map_err(|e| e.to_string())?;
    if drawn.is_some_and(|drawn| drawn != dataset.manifest()) {
        return Err("the dataset has changed since: this is where the point was before".into());
    }
    read(&dataset, key, point).map_err(|e| e.to_string())
}

fn read<R: ReadAt>(
    dataset: &Dataset<R>,
    key: NodeKey,
    point: usize,
) -> lodestream_protocol::Result<Known> {
    let Some(node) = dataset.node(key)? else { return Ok(Known::default()) };
    let manifest = dataset.manifest();
    let groups: Vec<_> = (1..manifest.groups.len()).collect();
    let points = dataset.read_node(&node, &groups)?;
    Ok(Known {
        values: values(manifest, &points, point),
        within_node: points.positions.get(point).copied(),
        lattice: Some(manifest.lattice),
    })
}

/// The values of a point, as far as they are there.
#[must_use]
pub fn values(manifest: &Manifest, points: &NodePoints, point: usize) -> Values {
    let attributes = manifest.attributes.iter().enumerate();
    let value = attributes.filter_map(|(index, attribute)| {
        let size = attribute.value_bytes();
        let constant = attribute.constant();
        let bytes = match &constant {
            Some(value) => value.as_slice(),
            None => points.column(index)?.bytes.get(point * size..(point + 1) * size)?,
        };
        let text = components(attribute.scalar, bytes);
        let text = match attribute.name.as_str() {
            "classification" => match class_name(attribute.scalar.to_f64(bytes)) {
                Some(name) => format!("{text} ({name})"),
                None => text,
            },
            _ => text,
        };
        Some((attribute.name.clone(), text))
    });
    value.collect()
}

/// The components of a value, exactly.
fn components(scalar: ScalarType, bytes: &[u8]) -> String {
    let each = bytes.chunks_exact(scalar.size_bytes());
    let more = if each.len() > MOST_COMPONENTS { ", …" } else { "" };
    let texts: Vec<String> = each
        .take(MOST_COMPONENTS)
        .map(|component| match (scalar.to_i128(component), scalar) {
            (Some(integer), _) => integer.to_string(),
            (None, ScalarType::F32) => (scalar.to_f64(component) as f32).to_string(),
            (None, _) => scalar.to_f64(component).to_string(),
        })
        .collect();
    texts.join(", ") + more
}

/// The name of a class of the LAS specification (1.4, table 17).
#[must_use]
pub fn class_name(class: f64) -> Option<&'static str> {
    const NAMES: [&str; 19] = [
        "never classified",
        "unclassified",
        "ground",
        "low vegetation",
        "medium vegetation",
        "high vegetation",
        "building",
        "low point",
        "key point",
        "water",
        "rail",
        "road",
        "overlap",
        "wire guard",
        "wire conductor",
        "transmission tower",
        "wire connector",
        "bridge deck",
        "high noise",
    ];
    // False for NaN and for what is beyond.
    let is_class = (0.0..NAMES.len() as f64).contains(&class);
    is_class.then(|| NAMES[class as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing;

    #[test]
    fn values_are_exact_and_classes_have_their_names() {
        assert_eq!(components(ScalarType::U16, &[1, 0, 255, 255]), "1, 65535");
        assert_eq!(components(ScalarType::I8, &[255]), "-1");
        assert_eq!(components(ScalarType::F32, &0.1f32.to_le_bytes()), "0.1");
        assert_eq!(components(ScalarType::F64, &0.1f64.to_le_bytes()), "0.1");
        assert_eq!(components(ScalarType::U8, &[7; 20]), "7, 7, 7, 7, 7, 7, 7, 7, …");
        assert_eq!(class_name(2.0), Some("ground"));
        assert_eq!([class_name(19.0), class_name(-1.0), class_name(f64::NAN)], [None; 3]);
    }

    #[test]
    fn columns_that_have_not_arrived_are_left_out() {
        let world = testing::small_cube(&[[1, 2, 3], [4, 5, 6]]);
        let mut points = world.nodes[0].points.as_ref().clone();
        let all = values(&world.clouds[0], &points, 1);
        points.columns.pop();
        let fewer = values(&world.clouds[0], &points, 1);
        assert_eq!(fewer.len() + 1, all.len());
        assert!(values(&world.clouds[0], &points, 99).len() < all.len());
    }
}
