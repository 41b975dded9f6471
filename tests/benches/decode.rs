//! Points per second that one core decodes, per column group, and bytes per point
//!
//! `./dev bench decode [INPUT] [--runs N]`. INPUT is a dataset or anything that `lodestream build`
//! takes; without one, a simulated courtyard of 2 million points. The file is in memory; every node
//! is decoded, checksums included, as a client does it.

use std::{
    env,
    error::Error,
    fs,
    hint::black_box,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use lodestream_protocol::{Dataset, Node, decode_group};
use lodestream_tests::{Options, median, program};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let Options { input, runs } = Options::parse("sim:courtyard?points=2M&seed=1")?;
    let dataset = if Path::new(&input).extension().is_some_and(|e| e == "lods") {
        PathBuf::from(&input)
    } else {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let dataset = folder.join("bench_decode.lods");
        let mut build = Command::new(program("lodestream")?);
        let status = build.arg("build").arg(&input).arg("-o").arg(&dataset).status()?;
        status.success().then_some(dataset).ok_or("the build failed")?
    };
    let file = fs::read(&dataset)?;
    let dataset = Dataset::open(file.clone())?;
    let manifest = dataset.manifest();
    let nodes = dataset.hierarchy()?;
    println!("{} points in {} nodes, {runs} runs\n", manifest.points, nodes.len());
    println!("| group | columns | bytes/point | M points/s | M values/s | MB/s out |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (group, info) in manifest.groups.iter().enumerate() {
        let payloads: Vec<(&Node, &[u8])> = nodes
            .iter()
            .map(|node| {
                let payload = node.payloads.get(group).ok_or("a node lacks a payload")?;
                let start = usize::try_from(payload.offset)?;
                let bytes = file.get(start..start + payload.bytes as usize);
                Ok((node, bytes.ok_or("a payload lies outside of the file")?))
            })
            .collect::<Result<_>>()?;
        let mut seconds = Vec::with_capacity(runs);
        for _ in 0..runs {
            let start = Instant::now();
            for (node, payload) in &payloads {
                black_box(decode_group(manifest, group, node, payload)?);
            }
            seconds.push(start.elapsed().as_secs_f64());
        }
        let (columns, values, bytes) = manifest.columns_of(group).fold(
            if group == 0 { (vec!["position"], 3, 12) } else { (vec![], 0, 0) },
            |(mut names, values, bytes), a| {
                names.push(&a.name);
                (names, values + usize::from(a.components), bytes + a.value_bytes())
            },
        );
        let points = manifest.points as f64;
        let millions_per_second = points / median(&mut seconds) / 1e6;
        println!(
            "| {} | {} | {:.2} | {millions_per_second:.1} | {:.0} | {:.0} |",
            info.name,
            columns.join(" "),
            info.bytes() as f64 / points,
            millions_per_second * values as f64,
            millions_per_second * bytes as f64,
        );
    }
    Ok(())
}
