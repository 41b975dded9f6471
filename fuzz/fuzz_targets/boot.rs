//! Header, manifest and root page: as they come, and behind a sound header.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lodestream_fuzz::BootInput;
use lodestream_protocol::{Boot, Dataset, Header, Manifest};

fuzz_target!(|data: &[u8]| {
    let _ = Header::parse(data);
    let Some(sealed) = BootInput::parse(data).and_then(|input| input.seal()) else { return };
    let Ok(boot) = Boot::parse(&sealed) else { return };
    let json = boot.manifest.to_json().expect("a parsed manifest can be written");
    assert_eq!(Manifest::parse(&json).expect("and read again"), boot.manifest);
    // What every client asks of a manifest.
    let _ = boot.manifest.bounds_world();
    let _ = (0..=u8::MAX).map(|level| boot.manifest.spacing_world(level)).sum::<f64>();
    // What every reader does next; the file ends here, so each payload is refused.
    let dataset = Dataset::open(sealed).expect("the boot block was sound");
    if let Ok(nodes) = dataset.hierarchy() {
        for node in nodes.iter().take(64) {
            let _ = dataset.read_node(node, &[]);
        }
    }
});
