//! Hundreds of clouds at once.

use std::{
    net::{Ipv4Addr, SocketAddr},
    path::Path,
};

use lodestream_client::{
    camera::Camera,
    engine::{Engine, EngineConfig, View},
    source::Source,
};
use lodestream_server::{ServeConfig, spawn};

use crate::{
    common::{
        dataset::{Recipe, dataset},
        host::Host,
    },
    picture::{LONG, config, file_source, picture},
};

const CLOUDS: usize = 300;

/// Small clouds side by side.
fn recipe(number: usize) -> Recipe {
    let place = [(number % 20) as f64, (number / 20) as f64, 0.0].map(|c| 70.0 * c);
    Recipe { seed: number as u64, levels: 2, node_points: 100, corner: place, ..Recipe::default() }
}

/// All of them.
fn view() -> View {
    let camera = Camera::overview([0.0; 3].into(), [1400.0, 1050.0, 66.0].into(), 1.5);
    View { camera, size_px: [960, 640] }
}

fn settled(sources: Vec<Source>, config: &EngineConfig) -> crate::picture::Picture {
    let engine = Engine::start(sources, config.clone()).expect("starts");
    engine.set_view(view());
    assert_eq!(engine.wait_open(LONG).expect("all open").len(), CLOUDS);
    let plan = engine.wait_settled(LONG).expect("settles");
    assert!(plan.points <= config.point_budget && plan.clouds.len() == CLOUDS);
    picture(&plan)
}

#[test]
fn hundreds_of_clouds_open_and_share_one_budget_from_files_and_from_a_server() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let name = |number| format!("cloud{number:03}");
    let path = |number| folder.path().join(name(number)).with_extension("lods");
    for number in 0..CLOUDS {
        std::fs::write(path(number), dataset(recipe(number))).expect("written");
    }
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = spawn(ServeConfig::new(folder.path(), address)).expect("serving");
    let files = || (0..CLOUDS).map(|number| file_source(Path::new(&path(number)))).collect();
    let served = || {
        let urls = (0..CLOUDS).map(|number| format!("{}/{}", server.url(), name(number)));
        urls.map(|url| Source::parse(&url).expect("a URL")).collect()
    };
    for point_budget in [20_000, u64::MAX] {
        let config = EngineConfig { point_budget, ..config() };
        let of_files = settled(files(), &config);
        let clouds: std::collections::BTreeSet<_> =
            of_files.keys().map(|&(cloud, _)| cloud).collect();
        assert!(clouds.len() > 200, "{} clouds are seen", clouds.len());
        assert!(of_files == settled(served(), &config), "another picture at {point_budget}");
    }
}

#[test]
fn hundreds_of_clouds_of_one_host_share_few_connections() {
    let host = Host::good(dataset(recipe(0)));
    let address = host.url().replace("dataset.lods", "");
    let sources = (0..CLOUDS).map(|n| Source::parse(&format!("{address}{n}.lods")).expect("a URL"));
    let engine = Engine::start(sources.collect(), config()).expect("starts");
    engine.set_view(view());
    engine.wait_settled(LONG).expect("settles");
    // Six that open, and as many that fetch.
    let most = host.most_connections();
    assert!(most <= 12, "{most} connections");
}
