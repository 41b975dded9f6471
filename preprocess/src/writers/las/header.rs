//! The header and the variable length records of a file being written.

use las::{Version, raw};
use laz::{LazVlr, LazVlrBuilder};
use lodestream_protocol::{Attribute, Lattice};

use super::{plan::Plan, records::Tally};
use crate::{
    error::{Error, Result},
    numbers::Decimal,
    readers::las::point_format::is_extended,
    writers::{ExportInfo, source::range},
};

/// Set where GPS times count from 1980 less 10^9 s, and not from the start of their week.
const STANDARD_GPS_TIME: u16 = 1;

/// Set where the coordinate reference system is WKT.
const WKT: u16 = 16;

/// Marks compressed points in the point format.
const COMPRESSED: u8 = 0x80;

/// How lattice coordinates become LAS coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    /// What is added to a coordinate relative to the root cube.
    pub(super) shift: [i64; 3],
    /// World coordinate of integer zero.
    offset: [f64; 3],
    scale: f64,
}

impl Grid {
    /// The lattice itself where its coordinates fit 32 bits; else the same lattice counted from
    /// another point of it, as round as possible, so that its offset is a short number.
    pub(super) fn new(info: &ExportInfo) -> Self {
        let Lattice { scale, offset, origin, .. } = info.lattice;
        let mut grid = Self { shift: origin, offset, scale };
        for a in 0..3 {
            let (min, max) = (info.bounds.min[a], info.bounds.max[a]);
            if min > max {
                grid.shift[a] = 0;
                continue;
            }
            let (min, max) = (origin[a] + i64::from(min), origin[a] + i64::from(max));
            let fits =
                |zero: i64| i32::try_from(min - zero).is_ok() && i32::try_from(max - zero).is_ok();
            let middle = min + (max - min + 1) / 2;
            let zero = (0..=18u32)
                .rev()
                .map(|digits| {
                    let step = 10i64.pow(digits);
                    middle.div_euclid(step) * step
                })
                .chain([middle])
                .find(|&zero| fits(zero))
                .expect("at most 2^32 steps lie around their middle");
            let zero = if fits(0) { 0 } else { zero };
            grid.shift[a] = origin[a] - zero;
            grid.offset[a] = moved(offset[a], scale, zero);
        }
        grid
    }

    fn world(&self, axis: usize, steps: i32) -> f64 {
        f64::from(steps) * self.scale + self.offset[axis]
    }
}

/// `offset + scale * steps`, rounded once where the numbers are decimals.
fn moved(offset: f64, scale: f64, steps: i64) -> f64 {
    if steps == 0 {
        return offset;
    }
    let exact = || {
        let (offset, scale) = (Decimal::of(offset)?, Decimal::of(scale)?);
        let exponent = offset.exponent.min(scale.exponent);
        let product = scale.at_exponent(exponent)?.checked_mul(i128::from(steps))?;
        let mantissa = offset.at_exponent(exponent)?.checked_add(product)?;
        Some(Decimal { mantissa, exponent }.to_f64())
    };
    exact().unwrap_or(offset + scale * steps as f64)
}

/// What lies before the points.
#[derive(Debug)]
pub(super) struct Front {
    header: raw::Header,
    records: Vec<u8>,
    grid: Grid,
    /// The LASzip record, where points are compressed.
    pub(super) laz: Option<LazVlr>,
}

impl Front {
    /// Chooses the version and writes the records.
    pub(super) fn new(
        plan: &Plan,
        info: &ExportInfo,
        grid: Grid,
        compressed: bool,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let mut records = Records::default();
        let mut global_encoding = 0;
        if let Some(crs) = &info.crs {
            if records.add("LASF_Projection", 2112, &[crs.as_bytes(), &[0]].concat()).is_some() {
                global_encoding |= WKT;
            } else {
                notes.push("the coordinate reference system is left out: it is too long".into());
            }
        }
        if !plan.descriptors.is_empty() {
            let data: Vec<u8> = plan.descriptors.iter().flat_map(|d| d.bytes()).collect();
            if records.add("LASF_Spec", 4, &data).is_none() {
                return Err(Error::Setup(format!(
                    "{} attributes go into extra bytes, of which LAS can describe 341; export to \
                     PLY, or fewer attributes",
                    plan.descriptors.len()
                )));
            }
        }
        let laz = compressed.then(|| laz_vlr(plan)).transpose()?;
        if let Some(laz) = &laz {
            let mut data = Vec::new();
            laz.write_to(&mut data).map_err(|e| Error::Setup(format!("LASzip record: {e}")))?;
            records.add(LazVlr::USER_ID, LazVlr::RECORD_ID, &data);
        }
        if standard_times(&info.attributes) {
            global_encoding |= STANDARD_GPS_TIME;
        }
        // Plain points are what everything reads: the oldest version that has them. Coordinate
        // systems in WKT, descriptors, waveforms and large files are of 1.4.
        let plain = plan.format < 4
            && plan.descriptors.is_empty()
            && info.crs.is_none()
            && u32::try_from(info.points).is_ok();
        let version = Version::new(1, if plain { 2 } else { 4 });
        let header_bytes = version.header_size();
        let offset_to_point_data = u32::from(header_bytes)
            + u32::try_from(records.bytes.len()).expect("three records of 64 KiB at most");
        let header = raw::Header {
            version,
            global_encoding,
            system_identifier: *b"EXTRACTION\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0",
            generating_software: generating_software(),
            header_size: header_bytes,
            offset_to_point_data,
            number_of_variable_length_records: records.count,
            point_data_record_format: plan.format | if compressed { COMPRESSED } else { 0 },
            point_data_record_length: u16::try_from(plan.record_bytes)
                .expect("checked by the plan"),
            x_scale_factor: grid.scale,
            y_scale_factor: grid.scale,
            z_scale_factor: grid.scale,
            x_offset: grid.offset[0],
            y_offset: grid.offset[1],
            z_offset: grid.offset[2],
            ..raw::Header::default()
        };
        Ok(Self { header, records: records.bytes, grid, laz })
    }

    /// Header and records, for the points of `tally`.
    pub(super) fn bytes(&self, tally: &Tally) -> Result<Vec<u8>> {
        let mut header = self.header.clone();
        let legacy = u32::try_from(tally.points).ok();
        let format = header.point_data_record_format & !COMPRESSED;
        if header.version.minor < 4 && legacy.is_none() {
            return Err(Error::Setup(format!(
                "{} points have come, more than were announced and LAS 1.2 can count",
                tally.points
            )));
        }
        // Extended formats and large counts have zeros there (1.4 R15, 2.4).
        if let Some(points) = legacy.filter(|_| !is_extended(format)) {
            header.number_of_point_records = points;
            for (count, &of_return) in
                header.number_of_points_by_return.iter_mut().zip(&tally.by_return)
            {
                *count = u32::try_from(of_return).expect("no more than all points");
            }
        }
        if header.version.minor >= 4 {
            header.large_file = Some(raw::header::LargeFile {
                number_of_point_records: tally.points,
                number_of_points_by_return: tally.by_return,
            });
        }
        if tally.points > 0 {
            let [min_x, min_y, min_z] = [0, 1, 2].map(|a| self.grid.world(a, tally.min[a]));
            let [max_x, max_y, max_z] = [0, 1, 2].map(|a| self.grid.world(a, tally.max[a]));
            header = raw::Header { min_x, min_y, min_z, max_x, max_y, max_z, ..header };
        }
        let mut bytes = Vec::new();
        header.write_to(&mut bytes).map_err(|e| Error::Setup(format!("LAS header: {e}")))?;
        bytes.extend_from_slice(&self.records);
        Ok(bytes)
    }
}

/// Whether GPS times are beyond what a week has: the dataset does not keep the bit that tells.
fn standard_times(attributes: &[Attribute]) -> bool {
    const SECONDS_OF_A_WEEK: f64 = 604_800.0;
    attributes.iter().find(|a| a.name == "gps_time" && !a.max.is_empty()).is_some_and(|times| {
        let (least, greatest) = range(times);
        least < 0.0 || greatest > SECONDS_OF_A_WEEK
    })
}

fn laz_vlr(plan: &Plan) -> Result<LazVlr> {
    let extra = u16::try_from(plan.extra_bytes).expect("less than the record, by the plan");
    let builder = LazVlrBuilder::default()
        .with_point_format(plan.format, extra)
        .map_err(|e| Error::Setup(format!("LASzip: {e}")))?;
    Ok(builder.build())
}

fn generating_software() -> [u8; 32] {
    let mut bytes = [0; 32];
    let text = concat!("lodestream ", env!("CARGO_PKG_VERSION"));
    for (byte, character) in bytes.iter_mut().zip(text.bytes()) {
        *byte = character;
    }
    bytes
}

#[derive(Default)]
struct Records {
    bytes: Vec<u8>,
    count: u32,
}

impl Records {
    /// Adds a record; `None` where its data is too long for one.
    fn add(&mut self, user: &str, id: u16, data: &[u8]) -> Option<()> {
        let length = u16::try_from(data.len()).ok()?;
        let mut head = [0; 54];
        head[2..2 + user.len()].copy_from_slice(user.as_bytes());
        head[18..20].copy_from_slice(&id.to_le_bytes());
        head[20..22].copy_from_slice(&length.to_le_bytes());
        self.bytes.extend_from_slice(&head);
        self.bytes.extend_from_slice(data);
        self.count += 1;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::LatticeBox;

    use super::*;

    fn info(scale: f64, offset: f64, origin: i64, max: u32) -> ExportInfo {
        ExportInfo {
            lattice: Lattice { scale, offset: [offset; 3], origin: [origin; 3], side_bits: 32 },
            bounds: LatticeBox { min: [0; 3], max: [max; 3] },
            points: 1,
            attributes: Vec::new(),
            crs: None,
        }
    }

    #[test]
    fn a_lattice_that_fits_is_kept_as_it_is() {
        let grid = Grid::new(&info(0.01, 637_291.0, -200_000, 400_000));
        assert_eq!((grid.shift, grid.offset), ([-200_000; 3], [637_291.0; 3]));
    }

    #[test]
    fn a_lattice_counted_from_afar_is_counted_from_a_round_number() {
        // Northings of 5,000 km in tenths of millimetres.
        let grid = Grid::new(&info(0.0001, 0.0, 52_345_678_901, 10_000_000));
        assert_eq!(grid.offset, [5_200_000.0; 3]);
        let first = i32::try_from(grid.shift[0]).expect("it fits");
        assert_eq!(grid.world(0, first), 5_234_567.890_1);
    }

    #[test]
    fn the_largest_cube_fits_around_its_middle() {
        for origin in [0, 1, -7, 1 << 60, -(1 << 61)] {
            let grid = Grid::new(&info(0.5, 0.0, origin, u32::MAX));
            assert!(i32::try_from(grid.shift[0]).is_ok());
            assert!(i32::try_from(grid.shift[0] + i64::from(u32::MAX)).is_ok());
        }
    }

    #[test]
    fn moving_the_offset_rounds_once() {
        assert_eq!(moved(0.1, 0.1, 2), 0.3);
        assert_eq!(moved(1e300, 1e-300, 5), 1e300);
        assert_eq!(moved(7.0, 0.1, 0), 7.0);
    }
}
