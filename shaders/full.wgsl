// One triangle over the whole picture; instances tell runs of chunks apart.

struct Full {
    @builtin(position) clip: vec4<f32>,
}

@vertex
fn full(@builtin(vertex_index) vertex: u32) -> Full {
    return Full(vec4(f32(vertex & 1u) * 4.0 - 1.0, f32(vertex >> 1u) * 4.0 - 1.0, 0.5, 1.0));
}
