//! What is open, as the viewer sees it.

use std::{collections::BTreeSet, sync::Arc};

use glam::DVec3;
use lodestream_protocol::Manifest;

use super::{crs::Crs, session::SessionCloud};
use crate::{engine::CloudStatus, render::ColorMode};

/// A cloud that is open, or being opened. Its number is its place among them, the engine's too.
#[derive(Debug, Clone, Default)]
pub struct Cloud {
    /// As it was asked for.
    pub source: String,
    /// Whether it is shown.
    pub is_visible: bool,
    /// Where its colours come from, if not from where the look says.
    pub color: Option<ColorMode>,
    /// Classes that are not shown.
    pub hidden_classes: BTreeSet<u8>,
    /// Whether it was closed. Its number stays.
    pub is_closed: bool,
    /// How the engine finds it.
    pub status: CloudStatus,
    /// What coordinates mean.
    pub crs: Crs,
    /// The version whose opening was told, counted from 0.
    pub told_version: Option<u32>,
}

impl Cloud {
    /// One that is to be opened.
    #[must_use]
    pub fn new(source: &str) -> Self {
        Self { source: source.into(), is_visible: true, ..Self::default() }
    }

    /// What the dataset is, once it is open.
    #[must_use]
    pub fn manifest(&self) -> Option<&Manifest> {
        self.status.boot.as_ref().map(|boot| &boot.manifest)
    }

    /// Lowest and highest corner; `None` where it is not open or has no points.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let (min, max) = self.manifest()?.bounds_world()?;
        Some((min.into(), max.into()))
    }

    /// The name, without the way to it.
    #[must_use]
    pub fn name(&self) -> &str {
        let path = self.source.split(['?', '#']).next().unwrap_or(&self.source);
        let name = path.trim_end_matches('/').rsplit(['/', '\\']).next().unwrap_or(path);
        name.strip_suffix(".lods").unwrap_or(name)
    }

    /// Notes how the engine finds it.
    pub fn set_status(&mut self, status: CloudStatus) {
        let is_other = match (&self.status.boot, &status.boot) {
            (Some(a), Some(b)) => !Arc::ptr_eq(a, b),
            (a, b) => a.is_some() != b.is_some(),
        };
        self.status = status;
        if is_other {
            self.crs = Crs::of(self.manifest().and_then(|manifest| manifest.crs.as_deref()));
        }
    }

    /// As a session holds it.
    #[must_use]
    pub fn to_session(&self) -> SessionCloud {
        SessionCloud {
            source: self.source.clone(),
            visible: self.is_visible,
            color: self.color,
            hidden_classes: self.hidden_classes.clone(),
        }
    }

    /// As a session held it.
    #[must_use]
    pub fn from_session(cloud: &SessionCloud) -> Self {
        Self {
            is_visible: cloud.visible,
            color: cloud.color,
            hidden_classes: cloud.hidden_classes.clone(),
            ..Self::new(&cloud.source)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_is_called_by_the_last_part_of_its_source() {
        let name = |source: &str| Cloud::new(source).name().to_owned();
        assert_eq!(name("/data/scans/house.lods"), "house");
        assert_eq!(name("127.0.0.1:8080/courtyard"), "courtyard");
        assert_eq!(name("https://a.example/x/y.lods?token=z/w"), "y");
        assert_eq!(name(r"C:\scans\a.lods"), "a");
        assert_eq!(name("http://a.example/b/"), "b");
    }
}
