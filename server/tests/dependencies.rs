//! What a deployment installs must not bring graphics along.

use std::process::Command;

#[test]
fn no_graphics_crate_is_in_the_dependency_tree() {
    let arguments = "tree --package lodestream-server --edges normal,build --prefix none \
                     --format {p} --locked --offline";
    let output = Command::new(env!("CARGO"))
        .args(arguments.split_whitespace())
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs: it runs this test");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo tree failed: {errors}");
    let tree = String::from_utf8_lossy(&output.stdout);
    let names: Vec<_> = tree.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(names.contains(&"axum"), "this is not the server's tree: {tree}");
    let banned = |name: &&str| {
        ["ash", "naga", "winit", "metal", "lodestream-client", "lodestream-shaders"].contains(name)
            || ["wgpu", "egui", "objc2-metal"].iter().any(|prefix| name.starts_with(prefix))
    };
    let found: Vec<_> = names.into_iter().filter(banned).collect();
    assert!(found.is_empty(), "graphics crates in lodestream-server: {found:?}");
}
