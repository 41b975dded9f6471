//! How fast simulated scans are made: `cargo run --release -p lodestream-preprocess --example
//! sim_rate -- "sim:courtyard?points=10M"`.

use std::time::Instant;

use lodestream_preprocess::{Result, readers};
use xxhash_rust::xxh3::Xxh3;

fn main() -> Result<()> {
    let spec = std::env::args().nth(1).unwrap_or_else(|| "sim:courtyard?points=10M&seed=1".into());
    let start = Instant::now();
    let (mut points, mut first, mut hash) = (0, None, Xxh3::new());
    readers::sim::open(&spec)?.read(&mut |block| {
        first.get_or_insert_with(|| start.elapsed());
        points += block.positions.len();
        hash.update(&block.attributes);
        Ok(())
    })?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{spec}: {points} points in {seconds:.3} s, {:.2} M points/s, first block after {:.3} s, \
         attributes hash to {:032x}",
        points as f64 / seconds / 1e6,
        first.unwrap_or_default().as_secs_f64(),
        hash.digest128()
    );
    Ok(())
}
