//! What points know of the surface they lie on: normals, half axes, radii.

use glam::DVec3;
use lodestream_protocol::{Attribute, Manifest, NodePoints, ScalarType};
use lodestream_shaders::Footprint;

use crate::render::settings::{ColorMode, RenderSettings, SplatSize};

/// A column of numbers, or one value for all points.
#[derive(Debug, Clone, Copy)]
struct Numbers<'a, const N: usize> {
    bytes: &'a [u8],
    scalar: ScalarType,
    constant: Option<[f64; N]>,
}

impl<'a, const N: usize> Numbers<'a, N> {
    /// The attribute's values in a node; `None` where the cloud has no such attribute of `N`
    /// components, or where its column has not arrived.
    fn of(manifest: &Manifest, name: &str, points: &'a NodePoints) -> Option<Self> {
        let (index, attribute) = find(manifest, name, N)?;
        let scalar = attribute.scalar;
        if let Some(value) = attribute.constant() {
            return Some(Self { bytes: &[], scalar, constant: Some(numbers(&value, scalar)) });
        }
        let bytes = points.column(index)?.bytes.as_slice();
        Some(Self { bytes, scalar, constant: None })
    }

    fn get(&self, index: usize) -> Option<[f64; N]> {
        if self.constant.is_some() {
            return self.constant;
        }
        let size = N * self.scalar.size_bytes();
        let start = index.checked_mul(size)?;
        let value = self.bytes.get(start..start.checked_add(size)?)?;
        Some(numbers(value, self.scalar))
    }
}

fn numbers<const N: usize>(bytes: &[u8], scalar: ScalarType) -> [f64; N] {
    let size = scalar.size_bytes();
    std::array::from_fn(|i| bytes.get(i * size..).map_or(0.0, |rest| scalar.to_f64(rest)))
}

fn find<'a>(
    manifest: &'a Manifest,
    name: &str,
    components: usize,
) -> Option<(usize, &'a Attribute)> {
    let is_it = |a: &Attribute| a.name == name && usize::from(a.components) == components;
    manifest.attributes.iter().enumerate().find(|(_, a)| is_it(a))
}

/// The surface at a node's points, as far as a picture asks for it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NodeSurface<'a> {
    normals: Option<Numbers<'a, 3>>,
    axes: Option<[Numbers<'a, 3>; 2]>,
    radii: Option<Numbers<'a, 1>>,
}

impl<'a> NodeSurface<'a> {
    /// What `settings` ask for and the node has.
    pub fn of(settings: &RenderSettings, manifest: &Manifest, points: &'a NodePoints) -> Self {
        let SurfaceParts { normals, axes, radii } = SurfaceParts::of(settings, manifest);
        let normals = normals.then(|| Numbers::of(manifest, "normal", points)).flatten();
        let axes = axes.then(|| {
            let axis = |name| Numbers::of(manifest, name, points);
            Some([axis("axis_u")?, axis("axis_v")?])
        });
        let radii = radii.then(|| Numbers::of(manifest, "radius", points)).flatten();
        Self { normals, axes: axes.flatten(), radii }
    }

    /// Normals alone: of the attribute, or across the half axes, as far as the node has them.
    pub fn of_normals(manifest: &Manifest, points: &'a NodePoints) -> Self {
        let normals = Numbers::of(manifest, "normal", points);
        let axis = |name| Numbers::of(manifest, name, points);
        let axes = || Some([axis("axis_u")?, axis("axis_v")?]);
        let axes = if normals.is_none() { axes() } else { None };
        Self { normals, axes, radii: None }
    }

    /// The normal of a point, world space, a unit vector; `None` where it has none: the attribute is
    /// absent, zero or not finite.
    pub fn normal(&self, index: usize) -> Option<DVec3> {
        if let Some([u, v]) = self.axes(index)
            && self.normals.is_none()
        {
            return u.cross(v).try_normalize();
        }
        DVec3::from(self.normals?.get(index)?).try_normalize()
    }

    /// Half axes of a point's ellipse, world units; `None` where it has none: the attributes are
    /// absent or not finite, or both are zero.
    pub fn axes(&self, index: usize) -> Option<[DVec3; 2]> {
        let [u, v] = self.axes?.map(|axis| axis.get(index).map(DVec3::from));
        let (u, v) = (u?, v?);
        let longest = u.length_squared().max(v.length_squared());
        (u.is_finite() && v.is_finite() && longest > 0.0).then_some([u, v])
    }

    /// Whether points of the node have radii of their own.
    pub const fn has_own_radii(&self) -> bool {
        self.radii.is_some() || self.axes.is_some()
    }

    /// A point's own radius, world units: `radius`, else the longer half axis. `None` where it has
    /// neither.
    pub fn own_radius(&self, index: usize) -> Option<f64> {
        let radius = self.radii.and_then(|radii| radii.get(index)).map(|[radius]| radius);
        let axes = || self.axes(index).map(|[u, v]| u.length().max(v.length()));
        radius.or_else(axes).filter(|radius| *radius > 0.0 && radius.is_finite())
    }
}

/// Which parts of the surface a picture of a cloud takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct SurfaceParts {
    /// Normals: of the attribute, or across the half axes.
    pub normals: bool,
    /// Half axes.
    pub axes: bool,
    /// Radii.
    pub radii: bool,
}

impl SurfaceParts {
    /// What `settings` ask for and the cloud has.
    pub fn of(settings: &RenderSettings, manifest: &Manifest) -> Self {
        if settings.color == ColorMode::Density {
            return Self::default();
        }
        let has = |name, components| find(manifest, name, components).is_some();
        let has_axes = has("axis_u", 3) && has("axis_v", 3);
        let footprint = settings.splat.footprint();
        let is_ellipse = footprint == Footprint::Ellipse;
        let wants_normals = settings.shading.phong
            || settings.color == ColorMode::Normal
            || footprint == Footprint::Disc
            || (is_ellipse && !has_axes);
        let normals = wants_normals && has("normal", 3);
        let own = settings.splat_size == SplatSize::Own;
        let axes = has_axes && (is_ellipse || own || (wants_normals && !normals));
        Self { normals, axes, radii: own && has("radius", 1) }
    }

    /// Names of the attributes.
    pub fn attributes(self) -> impl Iterator<Item = &'static str> {
        let named = [
            ("normal", self.normals),
            ("axis_u", self.axes),
            ("axis_v", self.axes),
            ("radius", self.radii),
        ];
        named.into_iter().filter_map(|(name, taken)| taken.then_some(name))
    }
}
