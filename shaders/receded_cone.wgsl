// Depth of a cone. (Fraiss 2017, listing 3.6)

fn receded(r_squared: f32) -> f32 {
    return sqrt(r_squared);
}
