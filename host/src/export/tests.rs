use std::fs;

use hybray_shading::{Highlight, Light, LightKind, Material};

use super::*;
use crate::model::{Cone, NamedMaterial, Sphere};
use crate::picture::pending::tests::Scratch;

pub(crate) fn camera() -> CameraSpec {
    CameraSpec {
        name: String::new(),
        eye: [2.0, -6.0, 3.0],
        target: [0.25, 0.5, 0.5],
        up: [0.0, 0.125, 1.0],
        fov_y_degrees: 40.0,
        hither: 0.0,
        size: Some([160, 120]),
        ..CameraSpec::default()
    }
}

/// Numbers that are awkward as text: many digits, very small, very large, the smallest of all, and minus nothing.
const AWKWARD: [f32; 8] = [0.1, -1.0 / 3.0, 1.234_567_9e-9, 3.0e20, f32::from_bits(1), -0.0, 16_777_217.0, 1e-38];

/// Something of everything, with awkward coordinates.
pub(crate) fn model() -> Model {
    let point = |i: usize| std::array::from_fn(|k| AWKWARD[(3 * i + k) % AWKWARD.len()]);
    let plain = Mesh {
        name: "a b".to_owned(),
        positions: (0..4).map(point).collect(),
        triangles: vec![[0, 1, 2], [2, 1, 3]],
        material: 1,
        ..Mesh::default()
    };
    let smooth = Mesh {
        normals: vec![[0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        triangles: vec![[3, 2, 1]],
        material: 0,
        ..plain.clone()
    };
    let named = |name: &str, material| NamedMaterial { name: name.to_owned(), material, ..Default::default() };
    let nff = Material {
        diffuse: [0.1, 0.2, 0.3],
        specular: [0.4; 3],
        mirror: [0.4; 3],
        exponent: 12.5,
        highlight: Highlight::Phong as u32,
        ..Material::MATT
    };
    Model {
        meshes: vec![plain, Mesh::default(), smooth],
        spheres: vec![
            Sphere { centre: point(1), radius: 0.1, material: 0 },
            Sphere { centre: [1.0, 2.0, 3.0], radius: 2.0, material: 0 },
        ],
        cones: vec![
            Cone { base: [0.0; 3], base_radius: 0.5, apex: [0.0, 0.0, 0.7], apex_radius: 0.0, material: 1 },
            Cone { base: [1.0; 3], base_radius: 0.3, apex: [2.0; 3], apex_radius: 0.3, material: 1 },
        ],
        materials: vec![
            named("x y", nff),
            named("", Material { transmission: [0.25; 3], ior: 1.5, ..Material::MATT }),
            named("x_y", Material::MATT),
        ],
        lights: vec![
            Light { position: point(2), colour: [1.0, 0.5, 0.25], ..Light::default() },
            Light { position: [0.0, 0.0, 9.0], colour: [0.1; 3], ..Light::default() },
        ],
        background: [0.078, 0.361, 0.753],
        ..Model::default()
    }
}

/// Exports to a file of this extension; gives back the warnings, the text and, of `.obj`, the library.
fn text_of(model: &Model, extension: &str) -> (Vec<String>, String, String) {
    let scratch = Scratch::new(&format!("export-{extension}-{:p}", model));
    let path = scratch.0.join(format!("scene.{extension}"));
    let warnings = export(model, &camera(), &path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let library = fs::read_to_string(path.with_extension("mtl")).unwrap_or_default();
    assert_eq!(scratch.names().len(), if extension == "obj" { 2 } else { 1 });
    (warnings, text, library)
}

fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> Vec<f32> {
    words.map(|w| w.parse().unwrap_or_else(|_| panic!("`{w}`"))).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// A reader of NFF as the format's description has it: one entity after another, numbers between blanks.
fn reread_nff(text: &str) -> (Model, CameraSpec) {
    let mut model = Model::default();
    let mut view = camera();
    let mut lines = text.lines();
    let three = |v: &[f32]| [v[0], v[1], v[2]];
    while let Some(line) = lines.next() {
        let mut words = line.split_whitespace();
        let kind = words.next().unwrap();
        if kind == "v" {
            let mut field = |name: &str| {
                let mut words = lines.next().unwrap().split_whitespace();
                assert_eq!(words.next(), Some(name));
                numbers(words)
            };
            view.eye = three(&field("from"));
            view.target = three(&field("at"));
            view.up = three(&field("up"));
            view.fov_y_degrees = field("angle")[0];
            view.hither = field("hither")[0];
            let size = field("resolution");
            view.size = Some([size[0] as u32, size[1] as u32]);
            continue;
        }
        let v = numbers(words);
        let mut more = || numbers(lines.next().unwrap().split_whitespace());
        let material = (model.materials.len() as u16).wrapping_sub(1);
        match kind {
            "b" => model.background = three(&v),
            "l" => model.lights.push(Light { position: three(&v), colour: three(&v[3..]), ..Light::default() }),
            "f" => {
                assert_eq!(v.len(), 8);
                let rgb = three(&v);
                let material = crate::nff_material::nff_material(rgb, v[3], v[4], v[5], v[6], v[7]);
                model.materials.push(NamedMaterial { material, ..Default::default() });
            }
            "s" => model.spheres.push(Sphere { centre: three(&v), radius: v[3], material }),
            "c" => {
                let (base, apex) = (more(), more());
                model.cones.push(Cone {
                    base: three(&base),
                    base_radius: base[3],
                    apex: three(&apex),
                    apex_radius: apex[3],
                    material,
                });
            }
            "p" | "pp" => {
                assert_eq!(v, [3.0]);
                let corners = [more(), more(), more()];
                assert!(corners.iter().all(|c| c.len() == if kind == "p" { 3 } else { 6 }));
                model.meshes.push(Mesh {
                    positions: corners.iter().map(|c| three(c)).collect(),
                    normals: corners.iter().filter_map(|c| c.get(3..)).filter(|n| !n.is_empty()).map(three).collect(),
                    triangles: vec![[0, 1, 2]],
                    material,
                    ..Mesh::default()
                });
            }
            other => panic!("{other}"),
        }
    }
    (model, view)
}

/// Every triangle's corners, bit for bit, with its corners' normals and material.
fn triangles(model: &Model) -> Vec<(Vec<u32>, Material)> {
    let mut all = Vec::new();
    for mesh in &model.meshes {
        for triangle in &mesh.triangles {
            let mut corners = Vec::new();
            for &v in triangle {
                corners.extend(bits(&mesh.positions[v as usize]));
                corners.extend(mesh.normals.get(v as usize).map_or(vec![], |n| bits(n)));
            }
            all.push((corners, model.materials[mesh.material as usize].material));
        }
    }
    all
}

#[test]
fn nff_reads_back_exactly() {
    let model = model();
    let (warnings, text, _) = text_of(&model, "nff");
    assert_eq!(warnings, [] as [&str; 0]);
    assert!(
        !text.contains(['e', 'E'])
            || !text.lines().any(|l| l.starts_with(|c: char| c.is_ascii_digit()) && l.contains('e'))
    );
    let (back, view) = reread_nff(&text);
    assert_eq!(view, camera());
    assert_eq!(back.background, model.background);
    assert_eq!(back.lights, model.lights);
    assert_eq!(triangles(&back), triangles(&model));
    let material = |model: &Model, index: u16| model.materials[index as usize].material;
    for (a, b) in back.spheres.iter().zip(&model.spheres) {
        assert_eq!((bits(&a.centre), a.radius.to_bits()), (bits(&b.centre), b.radius.to_bits()));
        assert_eq!(material(&back, a.material), material(&model, b.material));
    }
    for (a, b) in back.cones.iter().zip(&model.cones) {
        assert_eq!(Cone { material: 1, ..*a }, *b);
        assert_eq!(material(&back, a.material), material(&model, b.material));
    }
    assert_eq!((back.spheres.len(), back.cones.len()), (2, 2));
}

/// A reader of OBJ's `v`, `vn` and `f`: corners and normals of every triangle, and the material's name.
fn reread_obj(text: &str) -> Vec<(Vec<f32>, String)> {
    let (mut v, mut vn, mut name, mut all) = (vec![], vec![], String::new(), vec![]);
    for line in text.lines() {
        let (kind, rest) = line.split_once(' ').unwrap();
        match kind {
            "v" => v.push(numbers(rest.split(' '))),
            "vn" => vn.push(numbers(rest.split(' '))),
            "usemtl" => name = rest.to_owned(),
            "f" => {
                let mut corners = Vec::new();
                for corner in rest.split(' ') {
                    let mut indices = corner.split("//").map(|i| i.parse::<usize>().unwrap() - 1);
                    corners.extend(&v[indices.next().unwrap()]);
                    corners.extend(indices.next().map_or(&[][..], |n| &vn[n]));
                }
                all.push((corners, name.clone()));
            }
            "o" | "mtllib" => {}
            other => panic!("{other}"),
        }
    }
    all
}

#[test]
fn obj_reads_back_exactly() {
    let model = model();
    let (warnings, text, library) = text_of(&model, "obj");
    assert!(text.starts_with("mtllib scene.mtl\n"));
    let back = reread_obj(&text);
    let names = ["x_y", "material_1", "x_y_2"];
    let library_names: Vec<_> = library.lines().filter_map(|l| l.strip_prefix("newmtl ")).collect();
    assert_eq!(library_names, names);
    let expected = triangles(&model);
    for ((corners, name), (expected, material)) in back.iter().zip(&expected) {
        assert_eq!(bits(corners), *expected);
        let index = names.iter().position(|n| n == name).unwrap();
        assert_eq!(model.materials[index].material, *material);
    }
    // Spheres and cones: every corner lies on the surface and has the normal of its place.
    let n = 64;
    let curved = &back[expected.len()..];
    assert_eq!(curved.len(), 2 * n * (n - 2) + n + 2 * n);
    for (corners, name) in &curved[n * (n - 2)..2 * n * (n - 2)] {
        assert_eq!(name, "x_y");
        for corner in corners.chunks(6) {
            for k in 0..3 {
                let expected = model.spheres[1].centre[k] + 2.0 * corner[3 + k];
                assert!((corner[k] - expected).abs() < 1e-6);
            }
        }
    }
    for (corners, name) in &curved[2 * n * (n - 2)..2 * n * (n - 2) + n] {
        assert_eq!(name, "material_1");
        for c in corners.chunks(6) {
            let radius = (c[0] * c[0] + c[1] * c[1]).sqrt();
            assert!((radius - 0.5 * (1.0 - c[2] / 0.7)).abs() < 1e-6);
        }
    }
    assert!(warnings.iter().any(|w| w.starts_with("2 spheres and 2 cones (64 segments")), "{warnings:?}");
}

#[test]
fn materials_as_mtl_says_them() {
    fn check(material: Material, expected: &[&str], warnings: usize) {
        let mut model = Model::default();
        model.add_material("m", material);
        let (told, _, library) = text_of(&model, "obj");
        for line in expected {
            assert!(library.lines().any(|l| l == *line), "{line} in {library}");
        }
        // One is always there: that OBJ has no camera.
        assert_eq!(told.len(), 1 + warnings, "{told:?}");
    }
    let blinn =
        Material { specular: [0.5, 0.25, 0.0], exponent: 20.0, highlight: Highlight::Blinn as u32, ..Material::MATT };
    check(Material::MATT, &["newmtl m", "Kd 0.75 0.75 0.75", "Ks 0 0 0", "illum 1"], 0);
    check(blinn, &["Ks 0.5 0.25 0", "Ns 20", "illum 2"], 0);
    check(Material { highlight: Highlight::Phong as u32, ..blinn }, &["Ns 80", "illum 2"], 1);
    check(Material { mirror: blinn.specular, ..blinn }, &["Ks 0.5 0.25 0", "Ns 20", "illum 3"], 0);
    check(Material { mirror: [0.5; 3], ..blinn }, &["Ks 0.5 0.5 0.5", "illum 3"], 1);
    check(Material { mirror: [0.5; 3], ..Material::MATT }, &["Ks 0.5 0.5 0.5", "Ns 0", "illum 3"], 0);
    let glass = Material { transmission: [0.5, 0.75, 1.0], ior: 1.5, ..Material::MATT };
    check(glass, &["Tf 0.5 0.75 1", "d 0.25", "Ni 1.5", "illum 6"], 0);
    check(Material { flags: Material::FRESNEL, ..glass }, &["Ks 0 0 0", "illum 7"], 0);
    check(Material { flags: Material::FRESNEL, mirror: [0.1; 3], ..glass }, &["illum 7"], 1);
    check(Material { emission: [1.0, 2.0, 3.0], ambient: [0.1; 3], ..glass }, &["Ke 1 2 3", "Ka 0.1 0.1 0.1"], 0);
}

#[test]
fn what_nff_cannot_say() {
    fn check(change: impl Fn(&mut Model), expected: &[&str]) {
        let mut model = model();
        change(&mut model);
        let (warnings, text, _) = text_of(&model, "nff");
        reread_nff(&text);
        assert_eq!(warnings, expected);
    }
    check(
        |m| m.lights[1].kind = LightKind::Spot as u32,
        &["light 2: a spot becomes a point that shines all around in NFF"],
    );
    check(|m| m.lights[0].flags = Light::FALLOFF, &["light 1: light does not fall with distance in NFF"]);
    check(
        |m| m.lights.iter_mut().for_each(|l| l.kind = LightKind::Sphere as u32),
        &["light 1 and 1 other: a light with an area becomes a point in NFF"],
    );
    check(|m| m.ambient = [0.1; 3], &["the scene: NFF has no ambient light"]);
    check(|m| m.lights.clear(), &["the scene: the scene has no lights, so none are written"]);
    check(
        |m| m.materials[1].material.emission = [1.0; 3],
        &["material 1 and 1 other: NFF surfaces send out no light of their own"],
    );
    check(
        |m| m.materials[0].material.mirror = [0.5, 0.4, 0.3],
        &[
            "material `x y`: highlight and mirror are one number in NFF; the mirror's is written",
            "material `x y`: mirror and transmission have no colour in NFF",
        ],
    );
}

#[test]
fn directional_light_becomes_a_far_point() {
    let mut model = Model::default();
    model.add_material("m", Material::MATT);
    model.spheres.push(Sphere { centre: [10.0, 0.0, 0.0], radius: 1.0, material: 0 });
    let axis = [0.0, 0.6, -0.8];
    model.lights.push(Light { kind: LightKind::Directional as u32, axis, colour: [1.0; 3], ..Light::default() });
    let (back, _) = reread_nff(&text_of(&model, "nff").1);
    let [x, y, z] = back.lights[0].position;
    let distance = (y * y + z * z).sqrt();
    assert!(x == 10.0 && distance > 3000.0 && (y / distance + 0.6).abs() < 1e-6 && z > 0.0);
}

#[test]
fn broken_models_are_refused() {
    fn check(change: impl Fn(&mut Model, &mut CameraSpec), part: &str) {
        let scratch = Scratch::new("export-broken");
        let (mut model, mut camera) = (model(), camera());
        change(&mut model, &mut camera);
        for name in ["a.nff", "a.obj", "a.pov"] {
            let error = export(&model, &camera, &scratch.0.join(name)).unwrap_err();
            assert!(matches!(error, ExportError::Model(_)) && error.to_string().contains(part), "{error}");
        }
        assert!(scratch.names().is_empty());
    }
    check(|m, _| m.meshes[0].triangles[1][2] = 4, "mesh 0 `a b` has a triangle of a vertex that is not there");
    check(|m, _| m.meshes[2].normals.truncate(3), "3 normals for 4 vertices");
    check(|m, _| m.meshes[0].positions[3][0] = f32::NAN, "mesh 0");
    check(|m, _| m.meshes[2].normals[3][0] = f32::INFINITY, "mesh 2");
    check(|m, _| m.spheres[1].radius = f32::NAN, "sphere 1");
    check(|m, _| m.cones[1].apex[2] = f32::NAN, "cone 1");
    check(|m, _| m.cones[0].material = 3, "material that is not there");
    check(|m, _| m.materials[2].material.ior = f32::NAN, "material 2 `x_y`");
    check(|m, _| m.lights[1].colour[1] = f32::NAN, "light 1");
    check(|_, c| c.eye[0] = f32::NAN, "camera");
    check(|m, _| m.background[0] = f32::NAN, "background");
}

#[test]
fn extensions() {
    let scratch = Scratch::new("export-extensions");
    for name in ["a.dae", "a", ".obj", "nff"] {
        let error = export(&model(), &camera(), &scratch.0.join(name)).unwrap_err();
        assert!(matches!(error, ExportError::Extension { .. }));
        assert!([".nff", ".obj", ".pov"].iter().all(|e| error.to_string().contains(e)));
    }
    let error = export(&model(), &camera(), &scratch.0.join("missing/a.nff")).unwrap_err();
    assert!(matches!(error, ExportError::Write { .. }));
    export(&model(), &camera(), &scratch.0.join("A.NFF")).unwrap();
    assert_eq!(scratch.names(), ["A.NFF"]);
}

#[test]
fn an_empty_scene_is_a_scene() {
    for extension in ["nff", "obj", "pov"] {
        text_of(&Model::default(), extension);
    }
}
