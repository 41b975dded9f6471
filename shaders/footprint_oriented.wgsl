// Footprint: an ellipse in space, c + a u + b v with a² + b² <= 1, seen in perspective: a pixel is
// covered where its ray meets it, and where it holds the centre.
//
// All is relative to the centre's own place on the picture, in pixels with y up, so that nothing
// cancels however small or far the ellipse is. With d the pixel's offset, U and V the half axes'
// offsets there, and s, t how fast their distance grows (per distance of the centre; 0 in an
// orthographic view): a (U - d s) + b (V - d t) = d.

// No part of it is farther from its centre on the picture.
const LARGEST_SPLAT_PX = 1024.0;

struct Shape {
    center_px: vec2<f32>,
    // U, then V.
    axes_px: vec4<f32>,
    // s, t.
    slopes: vec2<f32>,
    // Growth of the distance along u and v, world units.
    rise: vec2<f32>,
    // Of the centre, with the depth's bias.
    distance: f32,
    world_radius: f32,
}

fn shape_of(place: Place, size: f32, axes: mat2x3<f32>) -> Shape {
    let center_slope = select(vec2(0.0), place.view.xy / place.view.z, camera.perspective > 0.5);
    let u = (axes[0].xy - center_slope * axes[0].z) * place.scale;
    let v = (axes[1].xy - center_slope * axes[1].z) * place.scale;
    let rise = vec2(axes[0].z, axes[1].z);
    let slopes = select(vec2(0.0), rise / place.view.z, camera.perspective > 0.5);
    let distance = place.view.z + camera.depth_bias;
    return Shape(place.center_px, vec4(u, v), slopes, rise, distance, 0.5 * size / place.scale);
}

// The ellipse's extent along one axis of the picture, from its offsets U and V along it: the roots
// of q t² - 2 p t + m = 0. (Sigg et al. 2006, in the frame of the centre)
fn extent(offsets: vec2<f32>, slopes: vec2<f32>) -> vec2<f32> {
    let q = dot(slopes, slopes) - 1.0;
    let p = dot(offsets, slopes);
    let root = sqrt(max(p * p - q * dot(offsets, offsets), 0.0));
    // Where it reaches behind the eye there is no end to it but the largest splat's.
    let found = select(vec2(-1e9, 1e9), vec2(p + root, p - root) / q, q < -1e-4);
    // The pixel that holds the centre too.
    let reach = LARGEST_SPLAT_PX;
    return vec2(clamp(found.x, -reach, -0.5), clamp(found.y, 0.5, reach));
}

fn box_of(shape: Shape) -> vec4<f32> {
    let x = extent(shape.axes_px.xz, shape.slopes);
    let y = extent(shape.axes_px.yw, shape.slopes);
    return vec4(shape.center_px.x + x.x, shape.center_px.y - y.y, shape.center_px.x + x.y, shape.center_px.y - y.x);
}

fn hit(shape: Shape, px: vec2<f32>) -> Hit {
    let offset = vec2(px.x - shape.center_px.x, shape.center_px.y - px.y);
    let u = shape.axes_px.xy - offset * shape.slopes.x;
    let v = shape.axes_px.zw - offset * shape.slopes.y;
    let determinant = u.x * v.y - u.y * v.x;
    let place = vec2(offset.x * v.y - offset.y * v.x, u.x * offset.y - u.y * offset.x) / determinant;
    let r_squared = dot(place, place);
    let distance = shape.distance + dot(place, shape.rise);
    // Written so that NaN is no hit.
    if determinant != 0.0 && r_squared <= 1.0 && distance >= camera.near {
        return Hit(true, camera.near / distance, r_squared);
    }
    return Hit(all(floor(px) == floor(shape.center_px)), camera.near / shape.distance, 1.0);
}
