//! A drawn picture.

use std::{path::Path, sync::Arc};

use crate::{engine::DepthPyramid, render::RenderError};

/// Colours and depths, row by row from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue, alpha per pixel, as displays take them (sRGB); alpha is 255.
    pub rgba8: Vec<u8>,
    /// Distance along the view direction in world units; infinite where nothing was drawn.
    pub depth: Vec<f32>,
}

impl Picture {
    /// Share of pixels on which something was drawn.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        let drawn = self.depth.iter().filter(|d| d.is_finite()).count();
        drawn as f64 / self.depth.len().max(1) as f64
    }

    /// What hides things in it, for [`Engine::set_depth`](crate::engine::Engine::set_depth); `None`
    /// where there are not as many depths as pixels, or none.
    #[must_use]
    pub fn depth_pyramid(&self) -> Option<Arc<DepthPyramid>> {
        DepthPyramid::new([self.width, self.height], &self.depth).map(Arc::new)
    }

    /// Reads the colours of a PNG file; nothing has a depth.
    ///
    /// # Errors
    /// [`RenderError::Read`] where the file cannot be read as a PNG.
    pub fn read_png(path: &Path) -> Result<Self, RenderError> {
        let failed = |why: String| RenderError::Read { path: path.to_owned(), why };
        let bytes = std::fs::read(path).map_err(|e| failed(e.to_string()))?;
        let image = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png)
            .map_err(|e| failed(e.to_string()))?
            .into_rgba8();
        let (width, height) = image.dimensions();
        let depth = vec![f32::INFINITY; width as usize * height as usize];
        Ok(Self { width, height, rgba8: image.into_raw(), depth })
    }

    /// Writes the colours as a PNG file.
    ///
    /// # Errors
    /// [`RenderError::Write`] where the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), RenderError> {
        let format = image::ImageFormat::Png;
        let color = image::ExtendedColorType::Rgba8;
        image::save_buffer_with_format(path, &self.rgba8, self.width, self.height, color, format)
            .map_err(|e| RenderError::Write { path: path.to_owned(), why: e.to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_holds_the_pixels() {
        let picture = Picture {
            width: 2,
            height: 1,
            rgba8: vec![1, 2, 3, 255, 4, 5, 6, 255],
            depth: vec![1.0, f32::INFINITY],
        };
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("picture.png");
        picture.write_png(&path).expect("written");
        let read = Picture::read_png(&path).expect("a PNG file");
        assert_eq!((read.width, read.height), (2, 1));
        assert_eq!(read.rgba8, picture.rgba8);
        assert!(Picture::read_png(folder.path()).is_err());
        assert!((picture.coverage() - 0.5).abs() < 1e-12);
        let error = picture.write_png(&folder.path().join("no/such.png")).expect_err("no folder");
        assert!(error.to_string().contains("such.png"), "{error}");
    }
}
