//! A served folder, and files for it.

use std::{fs, net::SocketAddr, path::PathBuf};

use lodestream_protocol::{
    Attribute, Boot, Domain, GroupInfo, HierarchyPage, Lattice, LatticeBox, Manifest, Method,
    Primitive, Refinement, ScalarType, Storage,
};
use lodestream_server::{RunningServer, ServeConfig, spawn};
use reqwest::{Method as HttpMethod, Response, header::HeaderMap};

/// A dataset without points, followed by `tail` filler bytes: sound to its header, and all that a
/// host looks at.
pub fn dataset(seed: u8, tail: usize) -> Vec<u8> {
    let lattice = Lattice { scale: 0.01, offset: [0.0; 3], origin: [0; 3], side_bits: 10 };
    let color = Attribute {
        name: "color".into(),
        scalar: ScalarType::U8,
        components: 3,
        domain: Domain::Element,
        storage: Storage::Column { group: 0 },
        min: vec![],
        max: vec![],
    };
    let manifest = Manifest {
        generator: format!("test {seed}"),
        points: 0,
        nodes: 0,
        levels: 0,
        refinement: Refinement::Additive,
        primitive: Primitive::Point,
        method: Method { name: "poisson".into(), grid: 128, leaf_capacity: 16384 },
        lattice,
        bounds: LatticeBox::EMPTY,
        largest_rounding: 0.0,
        attributes: vec![color],
        groups: vec![GroupInfo { name: "base".into(), columns: vec![0, 0] }],
        fine: None,
        crs: None,
        sources: vec![],
    };
    let page = HierarchyPage::encode(&[], vec![0], &lattice).expect("an empty page");
    let mut bytes = Boot::encode(&manifest, &page, 0, tail as u64).expect("a sound manifest");
    let mut state = u32::from(seed) + 1;
    bytes.extend((0..tail).map(|_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    }));
    bytes
}

/// A server over a temporary folder.
pub struct Site {
    pub folder: tempfile::TempDir,
    pub server: RunningServer,
    client: reqwest::Client,
}

impl Site {
    pub fn new() -> Self {
        Self::configured(|_| {})
    }

    pub fn configured(change: impl FnOnce(&mut ServeConfig)) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut config = ServeConfig::new(folder.path(), SocketAddr::from(([127, 0, 0, 1], 0)));
        change(&mut config);
        let server = spawn(config).expect("port 0 is free");
        // Built together with the client, reqwest has TLS and asks for a provider, used or not.
        let _ = rustls::crypto::ring::default_provider().install_default();
        Self { folder, server, client: reqwest::Client::new() }
    }

    /// With one dataset `a.lods` of about 700 KB, which is several pieces; returns its bytes.
    pub fn with_dataset() -> (Self, Vec<u8>) {
        let site = Self::new();
        let bytes = dataset(1, 700_000);
        site.put("a.lods", &bytes);
        (site, bytes)
    }

    pub fn put(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("the folder is writable");
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub async fn send(&self, method: HttpMethod, path: &str, fields: &[(&str, &str)]) -> Response {
        let mut request = self.client.request(method, format!("{}{path}", self.server.url()));
        for (name, value) in fields {
            request = request.header(*name, *value);
        }
        request.send().await.expect("the server answers")
    }

    pub async fn get(&self, path: &str, fields: &[(&str, &str)]) -> Response {
        self.send(HttpMethod::GET, path, fields).await
    }

    pub async fn json(&self, path: &str) -> serde_json::Value {
        let text = self.get(path, &[]).await.text().await.expect("a body");
        serde_json::from_str(&text).expect("JSON")
    }
}

/// A field's value; nothing where it is absent.
pub fn field<'a>(headers: &'a HeaderMap, name: &str) -> &'a str {
    headers.get(name).map_or("", |value| value.to_str().expect("text"))
}
