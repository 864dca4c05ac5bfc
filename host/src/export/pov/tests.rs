//! POV-Ray's pictures of exported scenes against a ray tracer of a hundred lines that follows our shading model, in
//! f64 and by testing everything. Skipped where POV-Ray is not installed.

use std::process::Command;

use hybray_shading::Highlight;

use super::super::{export, tests};
use super::*;
use crate::model::{Cone, Sphere};
use crate::picture::encode_srgb16;
use crate::picture::pending::tests::Scratch;
use tests::camera;

type V = [f64; 3];

fn add(a: V, b: V, t: f64) -> V {
    std::array::from_fn(|i| a[i] + t * b[i])
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: V) -> V {
    let norm = dot(a, a).sqrt();
    a.map(|c| c / norm)
}

fn wide(a: [f32; 3]) -> V {
    a.map(f64::from)
}

struct Hit {
    t: f64,
    normal: V,
    material: usize,
}

/// The nearest hit beyond a distance that is tiny for these scenes.
fn nearest(model: &Model, size: f64, from: V, direction: V) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    let mut offer = |t: f64, normal: V, material: u16| {
        if t > 1e-6 * size && best.as_ref().is_none_or(|b| t < b.t) {
            best = Some(Hit { t, normal: unit(normal), material: material.into() });
        }
    };
    for mesh in &model.meshes {
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| wide(mesh.positions[v as usize]));
            let (u, v) = (add(b, a, -1.0), add(c, a, -1.0));
            let n = cross(u, v);
            let distance = dot(n, add(a, from, -1.0)) / dot(n, direction);
            let q = add(add(from, direction, distance), a, -1.0);
            let (beta, gamma) = (dot(cross(q, v), n) / dot(n, n), dot(cross(u, q), n) / dot(n, n));
            if beta >= 0.0 && gamma >= 0.0 && beta + gamma <= 1.0 {
                let [x, y, z] = t.map(|v| mesh.normals.get(v as usize).map_or(n, |&n| wide(n)));
                let smooth = std::array::from_fn(|i| (1.0 - beta - gamma) * x[i] + beta * y[i] + gamma * z[i]);
                offer(distance, smooth, mesh.material);
            }
        }
    }
    for s in &model.spheres {
        let (c, r) = (wide(s.centre), f64::from(s.radius));
        let o = add(from, c, -1.0);
        let (b, q) = (dot(o, direction), dot(o, o) - r * r);
        if b * b > q {
            for t in [-b - (b * b - q).sqrt(), -b + (b * b - q).sqrt()] {
                offer(t, add(o, direction, t), s.material);
            }
        }
    }
    for c in &model.cones {
        // |p - (p.a) a| = r + k (p.a), with p from the base and a the unit axis.
        let along = add(wide(c.apex), wide(c.base), -1.0);
        let (length, axis) = (dot(along, along).sqrt(), unit(along));
        let r = f64::from(c.base_radius);
        let k = (f64::from(c.apex_radius) - r) / length;
        let p = add(from, wide(c.base), -1.0);
        let (pa, da) = (dot(p, axis), dot(direction, axis));
        let (p0, d0) = (add(p, axis, -pa), add(direction, axis, -da));
        let qa = dot(d0, d0) - k * k * da * da;
        let qb = dot(p0, d0) - k * da * (r + k * pa);
        let qc = dot(p0, p0) - (r + k * pa) * (r + k * pa);
        if qb * qb > qa * qc {
            for sign in [-1.0, 1.0] {
                let t = (-qb + sign * (qb * qb - qa * qc).sqrt()) / qa;
                let height = pa + t * da;
                if (0.0..=length).contains(&height) {
                    let out = unit(add(p0, d0, t));
                    offer(t, add(out, axis, -k), c.material);
                }
            }
        }
    }
    best
}

/// Whitted's model as `hybray_shading::spawn` has it.
struct Tracer<'a> {
    model: &'a Model,
    size: f64,
}

impl Tracer<'_> {
    fn trace(&self, from: V, direction: V, depth: u32, inside: Option<usize>) -> V {
        let Some(hit) = nearest(self.model, self.size, from, direction) else {
            return wide(self.model.background);
        };
        let m = &self.model.materials[hit.material].material;
        let point = add(from, direction, hit.t);
        let normal = if dot(hit.normal, direction) > 0.0 { hit.normal.map(|c| -c) } else { hit.normal };
        let cosine = -dot(normal, direction);
        let mirrored = unit(add(direction, normal, 2.0 * cosine));
        let mut sum: V = std::array::from_fn(|c| {
            f64::from(m.emission[c]) + f64::from(m.ambient[c]) * f64::from(self.model.ambient[c])
        });
        for light in &self.model.lights {
            let arrives = self.light(light, point, normal, mirrored, direction, m);
            sum = add(sum, arrives, 1.0);
        }
        if depth == 1 {
            return sum;
        }
        let ior = f64::from(m.ior);
        let (eta, beyond) = if inside == Some(hit.material) { (ior, None) } else { (1.0 / ior, Some(hit.material)) };
        let square = 1.0 - eta * eta * (1.0 - cosine * cosine);
        let out = square.max(0.0).sqrt();
        let (s, p) = ((eta * cosine - out) / (eta * cosine + out), (cosine - eta * out) / (cosine + eta * out));
        let share = match square > 0.0 {
            false => 1.0,
            true if m.flags & Material::FRESNEL != 0 => 0.5 * (s * s + p * p),
            true => 0.0,
        };
        let part = |weight: V, seen: V| std::array::from_fn(|c| weight[c] * seen[c]);
        let (mirror, through) = (wide(m.mirror), wide(m.transmission));
        if m.mirrors() || m.transmits() {
            let share = if m.transmits() { share } else { 0.0 };
            let seen = self.trace(point, mirrored, depth - 1, inside);
            sum = add(sum, part(add(mirror, through, share), seen), 1.0);
        }
        if m.transmits() && square > 0.0 {
            let bent = add(direction.map(|c| c * eta), normal, eta * cosine - out);
            let seen = self.trace(point, unit(bent), depth - 1, beyond);
            sum = add(sum, part(through.map(|c| c * (1.0 - share)), seen), 1.0);
        }
        sum
    }

    /// What one light shows; an area light by 16 x 16 points.
    fn light(&self, light: &Light, point: V, normal: V, mirrored: V, direction: V, m: &Material) -> V {
        let mut sum = [0.0; 3];
        let n = if light.kind == LightKind::Rectangle as u32 { 16 } else { 1 };
        let (u, v) = (wide(light.u), wide(light.v));
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            let position = match n {
                1 => wide(light.position),
                _ => add(add(wide(light.position), u, at(i)), v, at(j)),
            };
            let path = add(position, point, -1.0);
            let (mut way, mut far) = (unit(path), dot(path, path).sqrt());
            let off_axis = -dot(way, wide(light.axis));
            let mut strength = 1.0 / f64::from(n * n);
            if light.flags & Light::FALLOFF != 0 {
                strength /= far * far;
            }
            if light.kind == LightKind::Directional as u32 {
                (way, far) = (wide(light.axis).map(|c| -c), f64::INFINITY);
            }
            if light.kind == LightKind::Spot as u32 {
                let (inner, outer) = (f64::from(light.cos_inner), f64::from(light.cos_outer));
                let s = ((off_axis - outer) / (inner - outer)).clamp(0.0, 1.0);
                strength *= s * s * (3.0 - 2.0 * s);
            }
            if light.kind == LightKind::Rectangle as u32 {
                strength *= (-dot(way, unit(cross(u, v)))).max(0.0);
            }
            let cosine = dot(normal, way);
            if cosine <= 0.0 || strength <= 0.0 {
                continue;
            }
            let exponent = f64::from(m.exponent);
            let highlight = match m.highlight {
                kind if kind == Highlight::Phong as u32 => libm::pow(dot(mirrored, way).max(0.0), exponent),
                kind if kind == Highlight::Blinn as u32 => {
                    libm::pow(dot(normal, unit(add(way, direction, -1.0))).max(0.0), exponent)
                }
                _ => 0.0,
            };
            let clear = self.clear(point, way, far);
            for c in 0..3 {
                let surface = f64::from(m.diffuse[c]) * cosine + f64::from(m.specular[c]) * highlight;
                sum[c] += f64::from(light.colour[c]) * strength * surface * clear[c];
            }
        }
        sum
    }

    /// What is left of light on its way.
    fn clear(&self, mut from: V, way: V, mut far: f64) -> V {
        let mut left = [1.0; 3];
        while let Some(hit) = nearest(self.model, self.size, from, way).filter(|h| h.t < far) {
            let through = wide(self.model.materials[hit.material].material.transmission);
            left = std::array::from_fn(|c| left[c] * through[c]);
            if left == [0.0; 3] {
                break;
            }
            (from, far) = (add(from, way, hit.t), far - hit.t);
        }
        left
    }

    /// Red, green and blue of every pixel, row after row from the top.
    fn picture(&self, camera: &CameraSpec, width: u32, height: u32) -> Vec<f64> {
        let forward = unit(add(wide(camera.target), wide(camera.eye), -1.0));
        let right = unit(cross(forward, wide(camera.up)));
        let up = cross(right, forward);
        let half = libm::tan(f64::from(camera.fov_y_degrees).to_radians() / 2.0);
        let depth = self.model.settings.depth.unwrap_or(DEFAULT_DEPTH);
        let mut all = Vec::new();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            // Of the picture's height.
            let across = (f64::from(x) + 0.5 - f64::from(width) / 2.0) / f64::from(height);
            let above = 0.5 - (f64::from(y) + 0.5) / f64::from(height);
            let from = |right_by: f64, up_by: f64, start: V| add(add(start, right, right_by), up, up_by);
            let eye = wide(camera.eye);
            let (origin, direction) = match camera.projection {
                Projection::Perspective => (eye, from(2.0 * half * across, 2.0 * half * above, forward)),
                Projection::Orthographic => {
                    let size = f64::from(camera.picture_height());
                    (from(size * across, size * above, eye), forward)
                }
                Projection::Spherical => {
                    let turn = std::f64::consts::TAU * across * f64::from(height) / f64::from(width);
                    let rise = std::f64::consts::PI * above;
                    let level = libm::cos(rise);
                    let ahead = forward.map(|c| c * level * libm::cos(turn));
                    (eye, from(level * libm::sin(turn), libm::sin(rise), ahead))
                }
            };
            all.extend(self.trace(origin, unit(direction), depth, None));
        }
        all
    }
}

/// Runs POV-Ray; 16-bit sRGB values, or nothing where it is not installed.
fn povray(model: &Model, camera: &CameraSpec, name: &str, width: u32, height: u32) -> Option<Vec<u16>> {
    let scratch = Scratch::new(&format!("pov-{name}"));
    let scene = scratch.0.join("scene.pov");
    let picture = scratch.0.join("scene.png");
    export(model, camera, &scene).unwrap();
    let option = |letter: &str, path: &std::path::Path| format!("{letter}{}", path.display());
    let run = Command::new("povray")
        .args([option("+I", &scene), option("+O", &picture), format!("+W{width}"), format!("+H{height}")])
        .args(["+FN16", "-D", "-A", "+WT1"])
        .env("HOME", &scratch.0)
        .output();
    let run = match run {
        Ok(run) => run,
        Err(error) => {
            eprintln!("skipped: POV-Ray does not run: {error}");
            return None;
        }
    };
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    if let Ok(keep) = std::env::var("HYBRAY_KEEP_PICTURES") {
        std::fs::copy(&picture, std::path::Path::new(&keep).join(format!("{name}.png"))).unwrap();
        std::fs::copy(&scene, std::path::Path::new(&keep).join(format!("{name}.pov"))).unwrap();
    }
    let file = std::io::BufReader::new(std::fs::File::open(&picture).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Sixteen));
    Some(bytes.chunks(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect())
}

/// Renders both ways. At most `outliers` pixels in a thousand may differ by more than `slack` of 255, and not all may
/// be of one colour. Outliers are pixels at edges, where one ray more or less grazes something.
fn check(name: &str, model: &Model, camera: &CameraSpec, slack: f64, outliers: usize) {
    let (width, height) = (96, 64);
    let Some(theirs) = povray(model, camera, name, width, height) else { return };
    let size = extent(model).1;
    let ours = Tracer { model, size }.picture(camera, width, height);
    let exposure = f64::from(model.settings.exposure.unwrap_or(1.0));
    let mut bad = Vec::new();
    for (i, (theirs, ours)) in theirs.chunks(3).zip(ours.chunks(3)).enumerate() {
        let worst = (0..3)
            .map(|c| f64::from(theirs[c].abs_diff(encode_srgb16((ours[c] * exposure) as f32))) / 257.0)
            .fold(0.0, f64::max);
        if worst > slack {
            bad.push((i % width as usize, i / width as usize, worst));
        }
    }
    let pixels = (width * height) as usize;
    assert_eq!(theirs.len(), 3 * pixels);
    assert!(theirs.chunks(3).any(|p| p != &theirs[..3]), "{name}: a picture of nothing");
    eprintln!("{name}: {} of {pixels} pixels differ", bad.len());
    assert!(bad.len() * 1000 <= outliers * pixels, "{name}: {} of {pixels}: {bad:?}", bad.len());
}

/// A grey floor, a matt sphere and a white light: what the tests add to.
fn still_life() -> Model {
    let mut model = Model::default();
    model.add_material("floor", Material { diffuse: [0.5, 0.5, 0.4], ..Material::MATT });
    model.add_material("red", Material { diffuse: [0.8, 0.2, 0.1], ..Material::MATT });
    model.meshes.push(Mesh {
        positions: vec![[-4.0, -4.0, 0.0], [4.0, -4.0, 0.0], [4.0, 4.0, 0.0], [-4.0, 4.0, 0.5]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    });
    model.spheres.push(Sphere { centre: [-1.0, 0.5, 1.0], radius: 0.8, material: 1 });
    model.lights.push(Light { position: [3.0, -4.0, 6.0], colour: [0.9, 0.8, 0.7], ..Light::default() });
    model.background = [0.1, 0.2, 0.4];
    model
}

/// Puts a sphere of this material in front.
fn with(material: Material) -> Model {
    let mut model = still_life();
    let material = model.add_material("tried", material);
    model.spheres.push(Sphere { centre: [0.9, -0.5, 0.9], radius: 0.9, material });
    model
}

#[test]
fn projections() {
    let orthographic = CameraSpec { projection: Projection::Orthographic, height: Some(5.0), ..camera() };
    check("orthographic", &still_life(), &orthographic, 1.5, 8);
    // Not level, and not from the middle.
    let spherical = CameraSpec { projection: Projection::Spherical, eye: [1.5, -1.0, 1.7], ..camera() };
    check("spherical", &still_life(), &spherical, 1.5, 8);
}

/// A small bright sphere that is twice as far away as what is in focus: its spot is as wide as the thin lens's circle of
/// confusion and itself.
#[test]
fn a_lens_blurs_as_much() {
    let mut model = Model::default();
    let material =
        model.add_material("bright", Material { emission: [1000.0; 3], diffuse: [0.0; 3], ..Material::MATT });
    model.spheres.push(Sphere { centre: [0.0, 0.0, -4.0], radius: 0.01, material });
    let (eye, target, up) = ([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]);
    let lens = CameraSpec { aperture: 0.05, focus: Some(2.0), fov_y_degrees: 20.0, eye, target, up, ..camera() };
    let side = 160;
    let Some(picture) = povray(&model, &lens, "lens", side, side) else { return };
    let lit = picture.chunks(3).filter(|pixel| pixel[0] > 10_000).count();
    let diameter = 2.0 * (lit as f64 / std::f64::consts::PI).sqrt();
    let pixel = 2.0 * libm::tan(10f64.to_radians()) / f64::from(side);
    let expected = (2.0 * 0.05 * (4.0 - 2.0) / 4.0 / 2.0 + 2.0 * 0.01 / 4.0) / pixel;
    assert!((diameter - expected).abs() < 1.0, "{diameter} pixels, and should be {expected}");
}

#[test]
fn geometry() {
    let mut model = still_life();
    let green = model.add_material("green", Material { diffuse: [0.1, 0.7, 0.2], ..Material::MATT });
    let (base, apex) = ([0.8, -1.0, 0.2], [1.4, -0.6, 1.5]);
    model.cones.push(Cone { base, base_radius: 0.7, apex, apex_radius: 0.2, material: green });
    model.cones.push(Cone {
        base_radius: 0.3,
        apex_radius: 0.3,
        base: [0.0, 2.0, 0.0],
        apex: [0.2, 2.0, 3.0],
        material: 1,
    });
    model.cones.push(Cone {
        base_radius: 0.0,
        apex_radius: 0.6,
        base: [2.5, 1.0, 0.1],
        apex: [2.5, 1.0, 1.0],
        material: 1,
    });
    // A saddle with the normals of a dome, wound the wrong way round, and a triangle without an area.
    model.meshes.push(Mesh {
        positions: vec![[-1.0, -2.0, 0.4], [0.0, -2.5, 0.5], [0.2, -1.6, 0.4], [-0.8, -1.4, 0.6]],
        normals: vec![[-0.6, 0.0, 0.8], [0.0, -0.6, 0.8], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]],
        triangles: vec![[0, 2, 1], [0, 3, 2], [1, 1, 2]],
        material: green,
        ..Mesh::default()
    });
    check("geometry", &model, &camera(), 1.0, 6);
}

#[test]
fn a_camera_elsewhere_and_upside_down() {
    let model = still_life();
    let view = CameraSpec { eye: [-7.0, 5.0, 2.0], up: [0.3, 0.2, -1.0], fov_y_degrees: 75.0, ..camera() };
    check("camera", &model, &view, 1.0, 6);
}

#[test]
fn tiny_and_huge_scenes() {
    for (name, scale) in [("tiny", 1e-5f32), ("huge", 1e7)] {
        let mut model = with(Material { mirror: [0.3; 3], ..Material::MATT });
        let grow = |v: &mut [f32; 3]| *v = v.map(|c| c * scale);
        model.meshes.iter_mut().flat_map(|m| &mut m.positions).for_each(grow);
        model.lights.iter_mut().for_each(|l| grow(&mut l.position));
        model.spheres.iter_mut().for_each(|s| (grow(&mut s.centre), s.radius *= scale).1);
        model.lights[0].flags = Light::FALLOFF;
        model.lights[0].colour = [50.0 * scale * scale; 3];
        let mut view = camera();
        grow(&mut view.eye);
        grow(&mut view.target);
        check(name, &model, &view, 1.0, 6);
    }
}

#[test]
fn highlights() {
    let shiny = |highlight: Highlight, specular, exponent| Material {
        diffuse: [0.2, 0.3, 0.5],
        specular,
        exponent,
        highlight: highlight as u32,
        ..Material::MATT
    };
    check("phong", &with(shiny(Highlight::Phong, [0.5; 3], 12.5)), &camera(), 1.0, 6);
    check("phong-wide", &with(shiny(Highlight::Phong, [0.3; 3], 1.0)), &camera(), 1.0, 6);
    check("phong-coloured", &with(shiny(Highlight::Phong, [0.7, 0.4, 0.2], 8.0)), &camera(), 1.0, 6);
    check("phong-blue", &with(shiny(Highlight::Phong, [0.0, 0.0, 0.9], 8.0)), &camera(), 1.0, 6);
    check("blinn", &with(shiny(Highlight::Blinn, [0.5; 3], 40.0)), &camera(), 1.0, 6);
    check("blinn-coloured", &with(shiny(Highlight::Blinn, [0.2, 0.4, 0.9], 20.0)), &camera(), 1.0, 6);
}

#[test]
fn mirrors_and_glass() {
    let base = Material {
        diffuse: [0.1, 0.2, 0.1],
        specular: [0.4; 3],
        exponent: 20.0,
        highlight: Highlight::Phong as u32,
        ..Material::MATT
    };
    let coloured = Material { specular: [0.6, 0.2, 0.0], ..base };
    check("mirror", &with(Material { mirror: [0.9, 0.6, 0.3], ..base }), &camera(), 1.0, 8);
    check("mirror-coloured", &with(Material { mirror: [0.4; 3], ..coloured }), &camera(), 1.0, 8);
    let clear = Material { transmission: [0.9, 0.5, 0.3], ..base };
    check("unbent", &with(clear), &camera(), 1.0, 8);
    check("unbent-coloured", &with(Material { transmission: [0.9, 0.5, 0.3], ..coloured }), &camera(), 1.0, 8);
    check("glass", &with(Material { ior: 1.5, ..clear }), &camera(), 1.0, 8);
    let glass = Material { diffuse: [0.0; 3], transmission: [1.0; 3], ior: 1.5, flags: Material::FRESNEL, ..base };
    check("fresnel", &with(glass), &camera(), 1.0, 8);
    let dim = Material { diffuse: [0.0; 3], ambient: [0.5, 0.25, 0.0], emission: [0.0, 0.1, 0.2], ..clear };
    let mut model = with(dim);
    model.ambient = [0.6, 0.4, 0.2];
    check("ambient", &model, &camera(), 1.0, 8);
}

#[test]
fn ray_depth_and_cutoff() {
    for depth in [1, 2, 3] {
        let mut model = with(Material { mirror: [0.9; 3], ..Material::MATT });
        model.materials[1].material.mirror = [0.8; 3];
        model.settings.depth = Some(depth);
        check(&format!("depth-{depth}"), &model, &camera(), 1.0, 8);
    }
    let mut model = with(Material { mirror: [0.5; 3], ..Material::MATT });
    model.materials[1].material.mirror = [0.5; 3];
    model.settings.cutoff = Some(0.3);
    model.settings.exposure = Some(1.5);
    // One mirror has a weight of 0.5, two have 0.25: that is the picture at depth 2.
    let mut shallow = model.clone();
    shallow.settings.depth = Some(2);
    let Some(theirs) = povray(&model, &camera(), "cutoff", 96, 64) else { return };
    assert_eq!(Some(theirs), povray(&shallow, &camera(), "cutoff-2", 96, 64));
    check("exposure", &shallow, &camera(), 1.0, 8);
}

/// A closed box of glass in two meshes, three sides each.
#[test]
fn glass_in_two_meshes() {
    let mut model = still_life();
    let glass = Material { diffuse: [0.0; 3], transmission: [1.0; 3], ior: 1.3, ..Material::MATT };
    let material = model.add_material("glass", glass);
    let corner = |i: u32| [0.3 + 0.9 * (i & 1) as f32, -1.5 + 0.8 * (i >> 1 & 1) as f32, 0.4 + (i >> 2) as f32];
    let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let half = |sides: [[u32; 4]; 3]| Mesh {
        positions: positions.clone(),
        triangles: sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        material,
        ..Mesh::default()
    };
    model.meshes.push(half([[0, 2, 3, 1], [0, 1, 5, 4], [0, 4, 6, 2]]));
    model.meshes.push(half([[4, 5, 7, 6], [2, 6, 7, 3], [1, 3, 7, 5]]));
    check("box", &model, &camera(), 1.0, 12);
}

#[test]
fn lights() {
    let lit = |light: Light| {
        let mut model = with(Material { specular: [0.3; 3], exponent: 10.0, highlight: 1, ..Material::MATT });
        model.lights[0] = light;
        model
    };
    let white = Light { position: [2.0, -3.0, 4.0], colour: [0.9; 3], ..Light::default() };
    let bright = Light { colour: [15.0, 10.0, 5.0], flags: Light::FALLOFF, ..white };
    check("falloff", &lit(bright), &camera(), 1.0, 6);
    let axis = unit([-0.3, 0.5, -0.8]).map(|c| c as f32);
    check("directional", &lit(Light { kind: LightKind::Directional as u32, axis, ..white }), &camera(), 1.0, 6);
    let axis = unit([-2.0, 3.0, -4.0]).map(|c| c as f32);
    let spot = Light { kind: LightKind::Spot as u32, axis, cos_inner: 0.95, cos_outer: 0.85, ..white };
    check("spot", &lit(spot), &camera(), 1.0, 6);
    check(
        "spot-falloff",
        &lit(Light { kind: LightKind::Spot as u32, cos_inner: 0.9, cos_outer: 0.9, axis, ..bright }),
        &camera(),
        1.0,
        8,
    );
    let lamp = Light {
        kind: LightKind::Rectangle as u32,
        position: [1.0, -3.0, 3.0],
        u: [0.0, 1.5, 0.0],
        v: [2.0, 0.0, 0.5],
        samples: 200,
        ..bright
    };
    // POV-Ray's penumbra is its own, and takes random points in the lamp's cells: without shadows there is no slack.
    check("rectangle", &lit(lamp), &camera(), 25.0, 10);
    let bare = |light: Light| {
        let mut model = lit(light);
        model.spheres.clear();
        model
    };
    check("rectangle-bare", &bare(lamp), &camera(), 1.0, 6);
    check("rectangle-steady", &bare(Light { flags: 0, colour: [1.0; 3], ..lamp }), &camera(), 1.0, 6);
    check("rectangle-behind", &bare(Light { u: lamp.v, v: lamp.u, ..lamp }), &camera(), 1.0, 6);
    // A sphere above the horizon lights like a point.
    let ball = Light { kind: LightKind::Sphere as u32, radius: 1.0, samples: 16, ..bright };
    check("sphere-bare", &bare(ball), &camera(), 1.0, 6);
    check("sphere", &lit(Light { radius: 1e-3, ..ball }), &camera(), 1.0, 8);
}

#[test]
fn awkward_scenes_are_read() {
    fn read(name: &str, change: impl Fn(&mut Model)) {
        let mut model = with(Material { mirror: [0.5; 3], ..Material::MATT });
        change(&mut model);
        povray(&model, &camera(), name, 8, 8);
    }
    // All but the largest: POV-Ray does not tell the eye from the target in a scene of 10^20 units.
    let mut awkward = tests::model();
    let tame = |c: &mut f32| *c = c.clamp(-1e4, 1e4);
    awkward.meshes.iter_mut().flat_map(|m| m.positions.as_flattened_mut()).for_each(tame);
    awkward.spheres.iter_mut().flat_map(|s| &mut s.centre).for_each(tame);
    awkward.lights.iter_mut().flat_map(|l| &mut l.position).for_each(tame);
    povray(&awkward, &camera(), "awkward", 8, 8);
    read("nothing", |m| *m = Model::default());
    read("flat", |m| m.meshes[0].triangles = vec![[1, 1, 2]]);
    read("flat-glass", |m| {
        m.materials[0].material.transmission = [0.5; 3];
        m.meshes[0].triangles = vec![[1, 1, 2]];
        m.meshes.push(m.meshes[0].clone());
    });
    for (inner, outer) in [(1.0, 1.0), (1.0, -1.0), (-0.5, -0.9)] {
        let spot = Light { kind: LightKind::Spot as u32, axis: [0.0, 0.0, -1.0], ..Light::default() };
        read("spot-angles", |m| m.lights[0] = Light { cos_inner: inner, cos_outer: outer, ..spot });
    }
    for highlight in [Highlight::Phong, Highlight::Blinn] {
        for exponent in [0.0, 1e30] {
            let sharp = Material { specular: [0.5; 3], exponent, highlight: highlight as u32, ..Material::MATT };
            read("exponent", |m| m.materials[1].material = sharp);
        }
    }
    read("no-rectangle", |m| m.lights[0].kind = LightKind::Rectangle as u32);
    read("no-ball", |m| m.lights[0].kind = LightKind::Sphere as u32);
}
