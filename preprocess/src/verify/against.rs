//! A dataset beside its inputs: the same points, every value bit by bit.

use std::sync::atomic::Ordering;

use lodestream_protocol::Manifest;
use rayon::prelude::*;

use super::{Comparison, Fingerprint, VerifyConfig, VerifyReport};
use crate::{
    build::Progress,
    error::{Error, Result},
    grid::{self, InputCoordinates},
    inputs,
    readers::CoordinateKind,
    schema::{RowMap, Schema},
    store::{RawBlock, Store, StoreWriter},
};

/// Reads the inputs as the build does, on the dataset's lattice, and compares fingerprints.
pub(super) fn compare(
    config: &VerifyConfig,
    manifest: &Manifest,
    dataset: Fingerprint,
    report: &mut VerifyReport,
    progress: &dyn Progress,
) -> Result<()> {
    let opened = inputs::open_all(&config.against, config.columns.as_deref())?;
    let announced: Option<u64> = opened.iter().map(|i| i.info.points).sum();
    progress.phase("compare", announced.unwrap_or(0), "points");
    let mut comparison = Comparison::default();
    let mut left_out: Vec<String> = Vec::new();
    for attribute in opened.iter().flat_map(|i| &i.info.attributes) {
        if manifest.attribute(&attribute.name).is_none() && !left_out.contains(&attribute.name) {
            left_out.push(attribute.name.clone());
        }
    }
    let schema = Schema::union(opened.iter().map(|i| &i.info.attributes[..]), &left_out);
    let same =
        schema.attributes.len() == manifest.attributes.len()
            && schema.attributes.iter().zip(&manifest.attributes).all(|(a, b)| {
                (&a.name, a.scalar, a.components) == (&b.name, b.scalar, b.components)
            });
    if !same {
        report.find(format!(
            "the inputs have attributes {:?}, the dataset {:?}",
            schema.attributes.iter().map(|a| &a.name).collect::<Vec<_>>(),
            manifest.attributes.iter().map(|a| &a.name).collect::<Vec<_>>(),
        ));
    }
    comparison.attributes_left_out = left_out;

    let mut inputs_print = Fingerprint::default();
    for (index, input) in opened.into_iter().enumerate() {
        let map = RowMap::new(&input.info.attributes, &schema);
        // One input at a time goes through the store that the build uses, held in memory: its
        // lattice placement may only be known once all of it has been read.
        let folder = std::env::temp_dir();
        let mut writer = StoreWriter::new(1, u64::MAX, &folder);
        let read = input.reader.read(&mut |block| {
            if config.cancel.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let count = block.positions.len();
            let rows = map.apply(block.attributes, count, &schema);
            progress.advance(count as u64);
            writer.push(RawBlock { input: 0, positions: block.positions, rows })
        })?;
        let kind = match input.info.coordinates {
            CoordinateKind::Float { single_precision, decimals } => {
                CoordinateKind::Float { decimals: read.decimals.or(decimals), single_precision }
            }
            scaled => scaled,
        };
        comparison.dropped += read.dropped.iter().map(|(_, n)| n).sum::<u64>();
        let (bounds, steps) = (writer.bounds[0], writer.steps[0]);
        let coordinates = InputCoordinates { kind, bounds, steps };
        let placement = grid::placement_on(&manifest.lattice, &coordinates);
        let store = writer.finish()?.place(vec![placement], manifest.lattice, &schema);
        let Store::Memory { blocks, rounding } = store else {
            return Err(Error::Setup(format!("input {index} left memory")));
        };
        comparison.largest_coordinate_error = comparison.largest_coordinate_error.max(rounding);
        let row_bytes = schema.row_bytes;
        let prints = blocks.par_iter().map(|block| {
            let mut print = Fingerprint::default();
            let mut record = Vec::with_capacity(12 + row_bytes);
            for (i, q) in block.positions.iter().enumerate() {
                record.clear();
                record.extend(q.iter().flat_map(|c| c.to_le_bytes()));
                record.extend_from_slice(&block.rows[i * row_bytes..][..row_bytes]);
                print.add(&record);
            }
            print
        });
        inputs_print = inputs_print.merge(prints.reduce(Fingerprint::default, Fingerprint::merge));
    }
    comparison.input_points = inputs_print.points;
    comparison.identical = inputs_print == dataset;
    if inputs_print.points != dataset.points {
        report.find(format!(
            "the inputs have {} points, the dataset {}",
            inputs_print.points, dataset.points
        ));
    } else if !comparison.identical {
        report.find("the inputs' points and the dataset's are not the same".into());
    }
    report.against = Some(comparison);
    Ok(())
}
