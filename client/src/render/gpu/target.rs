//! What a frame is drawn into, and its way back into memory.

use super::{
    device::Device,
    pipelines::{COLOR_FORMAT, DEPTH_FORMAT},
};
use crate::render::{Picture, RenderError};

/// Colour and depth of one picture size.
pub struct Target {
    pub size_px: [u32; 2],
    color: wgpu::Texture,
    depth: wgpu::Texture,
    pub color_view: wgpu::TextureView,
    pub depth_view: wgpu::TextureView,
    /// Colours, then depths; rows padded as copies want them.
    readback: wgpu::Buffer,
}

impl Target {
    pub fn new(device: &wgpu::Device, size_px: [u32; 2]) -> Self {
        let texture = |label, format| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: extent(size_px),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let color = texture("colour", COLOR_FORMAT);
        let depth = texture("depth", DEPTH_FORMAT);
        let readback = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: 2 * plane_bytes(size_px),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let color_view = color.create_view(&Default::default());
        let depth_view = depth.create_view(&Default::default());
        Self { size_px, color, depth, color_view, depth_view, readback }
    }

    /// Records the copy of colours and depths.
    pub fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        let planes = [(&self.color, 0), (&self.depth, plane_bytes(self.size_px))];
        for (texture, offset) in planes {
            encoder.copy_texture_to_buffer(
                texture.as_image_copy(),
                wgpu::TexelCopyBufferInfo {
                    buffer: &self.readback,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset,
                        bytes_per_row: Some(row_bytes(self.size_px[0])),
                        rows_per_image: None,
                    },
                },
                extent(self.size_px),
            );
        }
    }

    /// Waits for the submitted frame and takes the picture; `distance` undoes the shaders' depth.
    pub fn read(
        &self,
        device: &Device,
        distance: impl Fn(f32) -> f32,
    ) -> Result<Picture, RenderError> {
        let gpu = |e: &dyn std::fmt::Display| RenderError::Gpu(e.to_string());
        let (sender, mapped) = std::sync::mpsc::channel();
        self.readback.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // The receiver waits below; where it is gone, nobody wants to know.
            let _ = sender.send(result);
        });
        device.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| gpu(&e))?;
        device.check()?;
        mapped.recv().map_err(|e| gpu(&e))?.map_err(|e| gpu(&e))?;
        let [width, height] = self.size_px;
        let pixels = width as usize * height as usize;
        let mut picture = Picture {
            width,
            height,
            rgba8: Vec::with_capacity(4 * pixels),
            depth: Vec::with_capacity(pixels),
        };
        {
            let bytes = self.readback.slice(..).get_mapped_range().map_err(|e| gpu(&e))?;
            let (colors, depths) = bytes.split_at(bytes.len() / 2);
            let rows = |plane| <[u8]>::chunks_exact(plane, row_bytes(width) as usize);
            for (colors, depths) in rows(colors).zip(rows(depths)) {
                picture.rgba8.extend_from_slice(&colors[..4 * width as usize]);
                let depths = depths[..4 * width as usize].chunks_exact(4);
                picture.depth.extend(depths.map(|d| {
                    let depth = f32::from_le_bytes([d[0], d[1], d[2], d[3]]);
                    if depth > 0.0 { distance(depth) } else { f32::INFINITY }
                }));
            }
        }
        self.readback.unmap();
        Ok(picture)
    }
}

fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d { width, height, depth_or_array_layers: 1 }
}

/// Both planes have four bytes a pixel.
fn row_bytes(width: u32) -> u32 {
    (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

fn plane_bytes([width, height]: [u32; 2]) -> u64 {
    u64::from(row_bytes(width)) * u64::from(height)
}
