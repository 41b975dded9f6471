// Depth of a paraboloid. (Fraiss 2017, listing 3.6)

fn receded(r_squared: f32) -> f32 {
    return r_squared;
}
