//! What a frame is drawn into, and its way back into memory.

use lodestream_shaders::Pixels;

use super::{
    device::Device,
    pipelines::{COLOR_FORMAT, DEPTH_FORMAT},
};
use crate::render::{Picture, RenderError};

/// Colour and depth of one picture size, and what some ways to draw need besides.
pub struct Target {
    pub size_px: [u32; 2],
    color: wgpu::Texture,
    depth: wgpu::Texture,
    pub color_view: wgpu::TextureView,
    pub depth_view: wgpu::TextureView,
    /// The colours after eye-dome lighting.
    lit: Option<(wgpu::Texture, wgpu::TextureView)>,
    /// Blended splats, summed up.
    sums: Option<wgpu::TextureView>,
    /// What the compute path finds.
    pixels: Option<PixelBuffers>,
    /// Colours, then depths; rows padded as copies want them.
    readback: Option<wgpu::Buffer>,
}

/// What the compute path finds: one number of 64 bits a pixel and nothing, or two of 32.
pub struct PixelBuffers {
    pub first: wgpu::Buffer,
    pub second: wgpu::Buffer,
    /// Whether they are two of 32 bits.
    narrow: bool,
}

impl Target {
    pub fn new(device: &wgpu::Device, size_px: [u32; 2]) -> Self {
        let usage = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::TEXTURE_BINDING;
        let color = texture(device, "colour", COLOR_FORMAT, size_px, usage);
        let depth = texture(device, "depth", DEPTH_FORMAT, size_px, usage);
        let color_view = color.create_view(&Default::default());
        let depth_view = depth.create_view(&Default::default());
        let (lit, sums, pixels, readback) = (None, None, None, None);
        Self { size_px, color, depth, color_view, depth_view, lit, sums, pixels, readback }
    }

    /// The texture of the picture after eye-dome lighting, made if it is not there yet.
    pub fn lit(&mut self, device: &wgpu::Device) -> wgpu::TextureView {
        let (_, view) = self.lit.get_or_insert_with(|| {
            let usage = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::TEXTURE_BINDING;
            let lit = texture(device, "lit colour", COLOR_FORMAT, self.size_px, usage);
            let view = lit.create_view(&Default::default());
            (lit, view)
        });
        view.clone()
    }

    /// The texture of sums, made if it is not there yet.
    pub fn sums(&mut self, device: &Device) -> wgpu::TextureView {
        let view = self.sums.get_or_insert_with(|| {
            let usage = wgpu::TextureUsages::TEXTURE_BINDING;
            texture(&device.device, "sums", device.sums_format, self.size_px, usage)
                .create_view(&Default::default())
        });
        view.clone()
    }

    /// What is seen, lit if so.
    pub fn shown(&self, lit: bool) -> &wgpu::TextureView {
        self.lit.as_ref().filter(|_| lit).map_or(&self.color_view, |(_, view)| view)
    }

    /// Buffers for what the compute path finds, made if they are not there yet.
    pub fn pixels(&mut self, device: &Device, pixels: Pixels) -> &PixelBuffers {
        let narrow = pixels == Pixels::Narrow;
        if self.pixels.as_ref().is_none_or(|found| found.narrow != narrow) {
            let count = pixel_count(self.size_px);
            let make = |label, size| {
                device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size,
                    usage: wgpu::BufferUsages::STORAGE
                        | wgpu::BufferUsages::COPY_DST
                        | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                })
            };
            let (first, second) = if narrow { (4 * count, 4 * count) } else { (8 * count, 8) };
            let first = make("pixels", first);
            self.pixels = Some(PixelBuffers { first, second: make("owners", second), narrow });
        }
        self.pixels.as_ref().expect("made above where it was missing")
    }

    /// Records the copy of colours (lit ones, if so) and depths.
    pub fn copy(&mut self, device: &Device, encoder: &mut wgpu::CommandEncoder, lit: bool) {
        let size_px = self.size_px;
        let readback = self.readback.get_or_insert_with(|| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("picture"),
                size: 2 * plane_bytes(size_px),
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        });
        let color = self.lit.as_ref().filter(|_| lit).map_or(&self.color, |(lit, _)| lit);
        for (texture, offset) in [(color, 0), (&self.depth, plane_bytes(size_px))] {
            encoder.copy_texture_to_buffer(
                texture.as_image_copy(),
                wgpu::TexelCopyBufferInfo {
                    buffer: readback,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset,
                        bytes_per_row: Some(row_bytes(size_px[0])),
                        rows_per_image: None,
                    },
                },
                extent(size_px),
            );
        }
    }

    /// Waits for the copy and takes the picture; `distance` undoes the shaders' depth.
    pub fn read(
        &self,
        device: &Device,
        distance: impl Fn(f32) -> f32,
    ) -> Result<Picture, RenderError> {
        let [width, height] = self.size_px;
        let pixels = width as usize * height as usize;
        let mut picture = Picture {
            width,
            height,
            rgba8: Vec::with_capacity(4 * pixels),
            depth: Vec::with_capacity(pixels),
        };
        let Some(readback) = &self.readback else { return Ok(picture) };
        read(device, readback, |bytes| {
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
        })?;
        Ok(picture)
    }
}

/// Waits for a buffer that can be mapped, and shows its bytes.
pub fn read(
    device: &Device,
    buffer: &wgpu::Buffer,
    see: impl FnOnce(&[u8]),
) -> Result<(), RenderError> {
    let gpu = |e: &dyn std::fmt::Display| RenderError::Gpu(e.to_string());
    let (sender, mapped) = std::sync::mpsc::channel();
    buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        // The receiver waits below; where it is gone, nobody wants to know.
        let _ = sender.send(result);
    });
    device.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| gpu(&e))?;
    device.check()?;
    mapped.recv().map_err(|e| gpu(&e))?.map_err(|e| gpu(&e))?;
    see(&buffer.slice(..).get_mapped_range().map_err(|e| gpu(&e))?);
    buffer.unmap();
    Ok(())
}

fn texture(
    device: &wgpu::Device,
    label: &str,
    format: wgpu::TextureFormat,
    size_px: [u32; 2],
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: extent(size_px),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d { width, height, depth_or_array_layers: 1 }
}

pub fn pixel_count([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Both planes have four bytes a pixel.
fn row_bytes(width: u32) -> u32 {
    (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

fn plane_bytes([width, height]: [u32; 2]) -> u64 {
    u64::from(row_bytes(width)) * u64::from(height)
}
