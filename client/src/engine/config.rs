//! What the engine is told when it starts. Some of it may be changed later: see `settings.rs`.

use lodestream_protocol::BOOT_SPECULATIVE_BYTES;

use super::priority::Priority;

/// Settings of an engine.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineConfig {
    /// Most points drawn at once, over all clouds.
    pub point_budget: u64,
    /// A node is left out where the sphere around its cube appears with a smaller radius than this,
    /// in pixels. A sampled node's points keep a distance of 1/128 of the cube's side (1/111 of
    /// that radius).
    pub min_size_px: f64,
    /// Where positions and colours are stored in two parts: the fine part is fetched of nodes whose points lie
    /// in cells that appear larger than this, in pixels. 0: of all nodes, so that every position and colour is exact.
    pub cell_px: f64,
    /// Whether nodes outside the picture are left out. (Off to measure what that saves.)
    pub culls_outside: bool,
    /// Whether nodes behind what was drawn are left out, where depths are
    /// [told](super::Engine::set_depth).
    pub occlusion: bool,
    /// Which nodes come first.
    pub priority: Priority,
    /// Most bytes of decoded nodes that are kept though they are not drawn.
    pub cache_bytes: u64,
    /// Most requests at a time, over all clouds. Where several hosts are asked, each may have its share of them,
    /// whatever the others have.
    pub requests_in_flight: usize,
    /// Which neighbouring ranges are fetched with one request.
    pub coalesce: Coalesce,
    /// Whether one request asks for ranges that are no neighbours, of hosts that take such.
    pub batches: bool,
    /// In which order wanted pieces are loaded.
    pub order: LoadOrder,
    /// Whether a request is held back while those before it keep the link busy.
    pub paces: bool,
    /// Whether requests that nothing wants any more are broken off.
    pub cancels: bool,
    /// Bytes that the first request asks for: header, manifest and root page, and what lies behind
    /// them, which are the payloads of the top nodes. The header at least.
    pub speculative_bytes: u64,
    /// Attributes that the view needs besides positions. Their column groups are fetched; the
    /// others are not. Names that a cloud lacks are ignored.
    pub attributes: Vec<String>,
    /// What becomes of payloads that have come.
    pub payloads: Payloads,
}

/// What becomes of payloads that have come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Payloads {
    /// They are decoded and kept.
    Decode,
    /// Their checksums are verified; then only their sizes are kept. Plans draw nodes without points, and
    /// count those that there would be.
    Count,
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
    /// Gaps of 16 KiB (a turn of a slow link, and fewer than its round trip), spans of 256 KiB: longer
    /// ones bring what matters less before what matters more. Six requests of them fill links up to
    /// 300 Mbit/s at 40 ms. On the overview of an aerial scan (1 M points, 5.6 MB): the area between
    /// SSIM and 1 over time is 0.80 of that with gaps of 64 KiB and spans of 2 MiB at 20 Mbit/s and
    /// 40 ms, 0.84 at 100 Mbit/s and 20 ms; all is there after 1.02 and 1.08 times the least time that
    /// the link allows. Shorter spans gain nothing on slow links and lose on fast ones.
    fn default() -> Self {
        Self { gap_bytes: 16 << 10, span_bytes: 256 << 10 }
    }
}

impl Default for EngineConfig {
    /// 1 M points, 512 MiB, six requests, colours.
    fn default() -> Self {
        Self {
            point_budget: 1_000_000,
            min_size_px: 40.0,
            cell_px: 0.25,
            culls_outside: true,
            occlusion: true,
            priority: Priority::default(),
            cache_bytes: 512 << 20,
            requests_in_flight: 6,
            coalesce: Coalesce::default(),
            batches: true,
            order: LoadOrder::Importance,
            paces: true,
            cancels: true,
            speculative_bytes: BOOT_SPECULATIVE_BYTES,
            attributes: vec!["color".into()],
            payloads: Payloads::Decode,
        }
    }
}
