//! What the tests of all readers share.

use std::{fmt::Debug, io::Write as _};

use tempfile::NamedTempFile;

use super::{BLOCK_POINTS, InputInfo, PointReader, Positions, ReadReport};
use crate::error::{Error, Result};

/// A file of these bytes.
pub(crate) fn file(bytes: &[u8]) -> NamedTempFile {
    let mut file = NamedTempFile::new().expect("a temporary file can be made");
    file.write_all(bytes).expect("a temporary file can be written");
    file
}

/// Everything that a reader of floating-point coordinates gives.
#[derive(Debug, PartialEq)]
pub(super) struct Cloud {
    pub(super) info: InputInfo,
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) attributes: Vec<u8>,
    pub(super) report: ReadReport,
}

impl Cloud {
    pub(super) fn read(reader: Box<dyn PointReader>) -> Result<Self> {
        let info = reader.info().clone();
        let (mut positions, mut attributes) = (Vec::new(), Vec::new());
        let report = reader.read(&mut |block| {
            assert!(block.positions.len() <= BLOCK_POINTS);
            let Positions::Float(block_positions) = block.positions else { panic!("not floats") };
            positions.extend(block_positions);
            attributes.extend(block.attributes);
            Ok(())
        })?;
        Ok(Self { info, positions, attributes, report })
    }
}

/// What an input is refused with.
pub(super) fn refusal_of(outcome: Result<impl Debug>) -> String {
    match outcome {
        Err(Error::Input { message, .. }) => message,
        other => panic!("not refused: {other:?}"),
    }
}
