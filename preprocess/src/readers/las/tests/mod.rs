//! Tests of the whole reader, over files made here and over small real ones.

mod damage;
mod formats;
mod records;
pub(crate) mod scan;

use std::path::Path;

use super::open;
use crate::{
    error::Result,
    readers::{InputInfo, Positions, ReadReport},
};

/// Everything that a file gives.
#[derive(Debug, PartialEq)]
pub(crate) struct Contents {
    pub(crate) info: InputInfo,
    pub(crate) positions: Vec<[i32; 3]>,
    pub(crate) rows: Vec<u8>,
    pub(crate) report: ReadReport,
}

impl Contents {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let reader = open(path)?;
        let info = reader.info().clone();
        let (mut positions, mut rows) = (Vec::new(), Vec::new());
        let report = reader.read(&mut |block| {
            let Positions::Scaled(block_positions) = block.positions else {
                panic!("LAS coordinates are integers");
            };
            positions.extend(block_positions);
            rows.extend(block.attributes);
            Ok(())
        })?;
        let contents = Self { info, positions, rows, report };
        assert_eq!(contents.rows.len(), contents.positions.len() * contents.row_bytes());
        Ok(contents)
    }

    fn row_bytes(&self) -> usize {
        let size =
            |a: &super::super::InputAttribute| a.scalar.size_bytes() * usize::from(a.components);
        self.info.attributes.iter().map(size).sum()
    }

    /// The values of one attribute, point after point.
    pub(crate) fn values(&self, name: &str) -> Vec<u8> {
        let mut at = 0;
        for attribute in &self.info.attributes {
            let size = attribute.scalar.size_bytes() * usize::from(attribute.components);
            if attribute.name == name {
                let rows = self.rows.chunks_exact(self.row_bytes());
                return rows.flat_map(|row| row[at..at + size].to_vec()).collect();
            }
            at += size;
        }
        panic!("no attribute {name}");
    }

    /// The first line that holds `text`, of warnings and of what is left out.
    fn says(&self, text: &str) -> bool {
        self.report.warnings.iter().chain(&self.info.left_out).any(|line| line.contains(text))
    }
}
