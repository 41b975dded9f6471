//! What the engine is told once.

use lodestream_protocol::BOOT_SPECULATIVE_BYTES;

/// Settings of an engine.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineConfig {
    /// Most points drawn at once, over all clouds.
    pub point_budget: u64,
    /// A node is left out where the sphere around its cube appears with a smaller radius than this,
    /// in pixels. A sampled node's points keep a distance of 1/128 of the cube's side (1/111 of
    /// that radius).
    pub min_size_px: f64,
    /// Most bytes of decoded nodes that are kept though they are not drawn.
    pub cache_bytes: u64,
    /// Most requests at a time, over all clouds.
    pub requests_in_flight: usize,
    /// Which neighbouring ranges are fetched with one request.
    pub coalesce: Coalesce,
    /// In which order wanted pieces are loaded.
    pub order: LoadOrder,
    /// Whether requests that nothing wants any more are broken off.
    pub cancels: bool,
    /// Bytes that the first request asks for: header, manifest and root page, and what lies behind
    /// them, which are the payloads of the top nodes. The header at least.
    pub speculative_bytes: u64,
    /// Attributes that the view needs besides positions. Their column groups are fetched; the
    /// others are not. Names that a cloud lacks are ignored.
    pub attributes: Vec<String>,
}

/// In which order wanted pieces are loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadOrder {
    /// As they matter to the newest view.
    Importance,
    /// As they were first wanted: a queue. (Fraiss 2017, 3.2.6)
    Arrival,
}

/// Which neighbouring ranges are fetched with one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coalesce {
    /// Bytes between two ranges that are fetched in vain rather than asked for apart.
    pub gap_bytes: u64,
    /// Most bytes of one request; a single range may be longer.
    pub span_bytes: u64,
}

impl Coalesce {
    /// A request for every range.
    pub const NONE: Self = Self { gap_bytes: 0, span_bytes: 0 };
}

impl Default for Coalesce {
    /// Gaps of 64 KiB (5 ms at 100 Mbit/s: no more than a round trip), spans of 2 MiB. On the
    /// overview of an aerial scan (1 M points, 5.6 MB) gaps cost 1.4 % of the bytes.
    fn default() -> Self {
        Self { gap_bytes: 64 << 10, span_bytes: 2 << 20 }
    }
}

impl Default for EngineConfig {
    /// 1 M points, 512 MiB, six requests, colours.
    fn default() -> Self {
        Self {
            point_budget: 1_000_000,
            min_size_px: 40.0,
            cache_bytes: 512 << 20,
            requests_in_flight: 6,
            coalesce: Coalesce::default(),
            order: LoadOrder::Importance,
            cancels: true,
            speculative_bytes: BOOT_SPECULATIVE_BYTES,
            attributes: vec!["color".into()],
        }
    }
}
