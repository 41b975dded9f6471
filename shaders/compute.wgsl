// Compute path: a workgroup is a chunk of records; each invocation offers one splat to the pixels
// that it covers. The nearest wins; of equally near ones, the first drawn.
//
// Fixed-function rasterisers set up triangles one after the other, which for splats of a few pixels
// is all the cost. (As in Schütz et al. 2021, Rendering Point Clouds with Compute Shaders)

// Consecutive chunks that lie in the bound page.
struct Run {
    first: u32,
    end: u32,
    // Workgroups in a row of the dispatch, which is two-dimensional: one dimension has at most 65535.
    row: u32,
    // Where two passes are needed: which it is.
    pass_index: u32,
}

@group(2) @binding(0) var<uniform> run: Run;

// Invocations of a workgroup: each takes several points, so that what is known of the node is read
// once for all of them.
const INVOCATIONS = 32u;

@compute @workgroup_size(INVOCATIONS)
fn rasterise(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let chunk_index = run.first + group.y * run.row + group.x;
    if chunk_index >= run.end {
        return;
    }
    let chunk = chunks[chunk_index];
    let node = nodes[chunk.node];
    for (var index = local; index < chunk.points; index += INVOCATIONS) {
        let surfel = surfel_at(chunk, node, index);
        if !surfel.visible {
            continue;
        }
        let shape = shape_of_surfel(node, surfel);
        // Owners count down, so that of equal depths the first drawn is the greatest.
        cover(shape, 0xffffffffu - (chunk_index * CHUNK_POINTS + index));
    }
}
