// From what the compute path found to the picture: looks up the colours of the points that are seen,
// of one run of chunks at a time.

struct Run {
    first: u32,
    end: u32,
    row: u32,
    pass_index: u32,
}

@group(2) @binding(0) var<uniform> run: Run;

struct Fragment {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Full) -> Fragment {
    let at = vec2<u32>(in.clip.xy);
    let pixel = found(at.y * u32(2.0 * camera.half_size_px.x) + at.x);
    let point = 0xffffffffu - pixel.y;
    let chunk_index = point / CHUNK_POINTS;
    // An owner of 0 is nobody: no run has so many chunks.
    if chunk_index < run.first || chunk_index >= run.end {
        discard;
    }
    let chunk = chunks[chunk_index];
    let node = nodes[chunk.node];
    let record = record_at(chunk, node.position_bits, point % CHUNK_POINTS);
    let position = read_position(record);
    let color = shaded_color(node, record, position, view_from_record(node, position));
    return Fragment(color, bitcast<f32>(pixel.x));
}
