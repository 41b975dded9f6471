//! Simulated scans: see [`crate::sim`].

use lodestream_protocol::ScalarType;
use rayon::prelude::*;

use super::{
    Block, CoordinateKind, InputAttribute, InputInfo, PointReader, Positions, ReadReport,
    ahead::{batch_parts, run_ahead},
};
use crate::{
    error::{Error, Result},
    sim::{Plan, STATIONS, STEPS_PER_METRE, Sample, Scanner, SimSpec},
};

/// Decimal places of the coordinates.
const DECIMALS: u8 = 4;
const _: () = assert!(STEPS_PER_METRE == 10_i64.pow(DECIMALS as u32));

/// Opens the simulated scan with the address `spec`, as in `sim:courtyard?points=2M&seed=1`.
///
/// # Errors
/// [`Error::Input`] where the address is wrong.
pub fn open(spec: &str) -> Result<Box<dyn PointReader>> {
    let parsed = SimSpec::parse(spec).map_err(|message| Error::input(spec, message))?;
    Ok(Box::new(SimReader { info: info(spec, &parsed), spec: parsed }))
}

struct SimReader {
    info: InputInfo,
    spec: SimSpec,
}

fn info(address: &str, spec: &SimSpec) -> InputInfo {
    let attribute =
        |name: &str, scalar, components| InputAttribute { name: name.into(), scalar, components };
    let mut attributes = vec![
        attribute("color", ScalarType::U8, 3),
        attribute("intensity", ScalarType::U16, 1),
        attribute("classification", ScalarType::U8, 1),
        attribute("point_source_id", ScalarType::U16, 1),
    ];
    if spec.normals {
        attributes.push(attribute("normal", ScalarType::F32, 3));
    }
    if spec.surfaces {
        attributes.push(attribute("surface_id", ScalarType::U16, 1));
    }
    if spec.axes {
        attributes.push(attribute("axis_u", ScalarType::F32, 3));
        attributes.push(attribute("axis_v", ScalarType::F32, 3));
    }
    InputInfo {
        path: address.into(),
        points: Some(spec.points),
        coordinates: CoordinateKind::Float { decimals: Some(DECIMALS), single_precision: false },
        attributes,
        crs: None,
        left_out: Vec::new(),
    }
}

impl PointReader for SimReader {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn read(self: Box<Self>, sink: &mut dyn FnMut(Block) -> Result<()>) -> Result<ReadReport> {
        let spec = self.spec;
        let plan = Plan::new(spec.points, spec.seed);
        let scanner = Scanner::courtyard();
        let mut next = 0;
        let produce = || {
            let first = next;
            next = plan.sectors().min(first + batch_parts() as u64);
            let sectors: Vec<u64> = (first..next).collect();
            let scan = |&number: &u64| {
                let sector = plan.sector(number);
                block(&sector.scan(&scanner), sector.station(), &spec)
            };
            let blocks: Vec<Block> = sectors.par_iter().map(scan).collect();
            Ok((!blocks.is_empty()).then_some(blocks))
        };
        run_ahead(produce, |blocks| blocks.into_iter().try_for_each(&mut *sink))?;
        Ok(ReadReport {
            points_read: spec.points,
            decimals: Some(DECIMALS),
            ..ReadReport::default()
        })
    }
}

fn block(samples: &[Sample], station: usize, spec: &SimSpec) -> Block {
    let source = u16::try_from(station + 1).expect("there are few stations");
    let mut positions = Vec::with_capacity(samples.len());
    let mut attributes = Vec::with_capacity(samples.len() * 22);
    for sample in samples {
        positions.push(sample.coordinates(spec.offset_steps));
        attributes.extend_from_slice(&sample.color);
        attributes.extend_from_slice(&sample.intensity.to_le_bytes());
        attributes.push(sample.class);
        attributes.extend_from_slice(&source.to_le_bytes());
        if spec.normals {
            for component in sample.normal.to_array() {
                attributes.extend_from_slice(&component.to_le_bytes());
            }
        }
        if spec.surfaces {
            attributes.extend_from_slice(&sample.surface.to_le_bytes());
        }
        if spec.axes {
            for component in
                sample.beam_axes(&STATIONS[station]).map(|axis| axis.to_array()).as_flattened()
            {
                attributes.extend_from_slice(&component.to_le_bytes());
            }
        }
    }
    Block { positions: Positions::Float(positions), attributes }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::readers::testing::Cloud;

    fn read(spec: &str) -> (InputInfo, Vec<[f64; 3]>, Vec<u8>) {
        let reader = open(spec).expect("a right address");
        let cloud = Cloud::read(reader).expect("the sink takes everything");
        let Cloud { info, positions, attributes, report } = cloud;
        assert_eq!(Some(report.points_read), info.points);
        (info, positions, attributes)
    }

    #[test]
    fn delivers_exactly_the_points_asked_for() {
        for points in [1, 7, 65_537] {
            let (info, positions, attributes) = read(&format!("sim:courtyard?points={points}"));
            assert_eq!(positions.len(), points);
            let row: usize = info
                .attributes
                .iter()
                .map(|a| a.scalar.size_bytes() * usize::from(a.components))
                .sum();
            assert_eq!(attributes.len(), points * row);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_for_any_number_of_threads() {
        let with_threads = |threads: usize, spec: &'static str| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a small pool");
            pool.install(|| read(spec))
        };
        let one = with_threads(1, "sim:courtyard?points=70k&seed=5");
        let two = with_threads(2, "sim:courtyard?points=70k&seed=5");
        assert!(one == two);
        let other = with_threads(2, "sim:courtyard?points=70k&seed=6");
        assert!(one.1 != other.1);
    }

    #[test]
    fn leaves_out_what_is_switched_off() {
        let (info, ..) = read("sim:courtyard?points=5");
        assert_eq!(
            info.attributes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(),
            ["color", "intensity", "classification", "point_source_id", "normal", "surface_id"]
        );
        let (info, _, attributes) = read("sim:courtyard?points=5&normals=0&surfaces=0");
        assert_eq!(info.attributes.len(), 4);
        assert_eq!(attributes.len(), 5 * 8);
    }

    #[test]
    fn ellipses_lie_on_their_surface_and_reach_farther_where_it_is_turned_away() {
        let (info, _, attributes) = read("sim:courtyard?points=20k&surfaces=0&axes=1");
        assert_eq!(info.attributes.last().map(|a| a.name.as_str()), Some("axis_v"));
        let row = 8 + 3 * 12;
        let mut longest = 0.0_f32;
        for values in attributes.chunks_exact(row) {
            let vector = |at: usize| {
                Vec3::from_array(std::array::from_fn(|i| {
                    f32::from_le_bytes(values[at + 4 * i..][..4].try_into().expect("four bytes"))
                }))
            };
            let [normal, u, v] = [vector(8), vector(20), vector(32)];
            assert!(normal.dot(u).abs() < 1e-3 * u.length() && u.dot(v).abs() < 1e-3 * u.length());
            let ratio = u.length() / v.length();
            assert!((0.999..8.001).contains(&ratio), "{ratio}");
            longest = longest.max(ratio);
        }
        assert!(longest > 4.0, "{longest}");
    }

    #[test]
    fn coordinates_are_decimals_and_move_with_the_offset() {
        let (_, here, _) = read("sim:courtyard?points=2k");
        let (_, there, _) = read("sim:courtyard?points=2k&offset=500000.5,5000000,-12.0001");
        for (a, b) in here.iter().zip(&there) {
            for axis in 0..3 {
                let steps = (b[axis] * 1e4).round();
                assert_eq!(steps / 1e4, b[axis]);
                let moved = steps - (a[axis] * 1e4).round();
                assert_eq!(moved, [5_000_005_000.0, 50_000_000_000.0, -120_001.0][axis]);
            }
        }
    }

    #[test]
    fn stops_at_the_sinks_first_error() {
        let mut blocks = 0;
        let result = open("sim:courtyard?points=200k").expect("a right address").read(&mut |_| {
            blocks += 1;
            Err(Error::Interrupted)
        });
        assert!(matches!(result, Err(Error::Interrupted)));
        assert_eq!(blocks, 1);
    }

    #[test]
    fn names_the_address_in_a_refusal() {
        let Err(error) = open("sim:courtyard?points=many") else { panic!("must be refused") };
        let line = error.to_string();
        assert!(
            line.starts_with("sim:courtyard?points=many: points=many is not a count"),
            "{line}"
        );
    }
}
