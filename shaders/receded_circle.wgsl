// Depth of a circle: that of its centre.

fn receded(r_squared: f32) -> f32 {
    return 0.0;
}
