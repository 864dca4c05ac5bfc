//! glTF files, whole and broken.

use super::super::testing::{Choices, Folder};
use super::*;
use hybray_shading::Material;
use serde_json::{Value, json};

/// A quad of two triangles in the plane z = 0, seen from +z; a fourth corner that only the sparse part has; bytes.
fn bytes() -> Vec<u8> {
    let floats: [f32; 24] = [
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, // positions
        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, // normals
    ];
    let sparse: [f32; 3] = [1.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = floats.iter().chain(&sparse).flat_map(|x| x.to_le_bytes()).collect();
    // The index of the sparse corner; those of the triangles.
    bytes.extend([3, 0, 1, 2, 2, 1, 3]);
    bytes
}

fn scene() -> Value {
    let uri: String = bytes().iter().map(|b| format!("%{b:02x}")).collect();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let view = |offset: usize, length: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_transmission", "KHR_materials_ior"],
        "extensionsRequired": ["KHR_lights_punctual"],
        "buffers": [{"byteLength": 115, "uri": format!("data:application/octet-stream,{uri}")}],
        "bufferViews": [view(0, 48), view(48, 48), view(96, 12), view(108, 1), view(109, 6)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
                "count": 1, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 2}}},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 4, "componentType": 5121, "count": 6, "type": "SCALAR"},
        ],
        "materials": [
            {"name": "metal", "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.5, 0.25, 1.0], "roughnessFactor": 0.0}},
            {"name": "glass", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
             "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.33}}},
            {"name": "cut", "alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]}},
        ],
        "meshes": [
            {"name": "quad", "primitives": [
                {"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0},
                {"attributes": {"POSITION": 0}, "mode": 5, "material": 1},
                {"attributes": {"POSITION": 0}, "mode": 6, "material": 2},
                {"attributes": {"POSITION": 0}, "mode": 0},
            ]},
        ],
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1.5, "zfar": 9, "znear": 0.1}},
        ],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "intensity": 100, "color": [1, 0.5, 0]},
            {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}},
            {"type": "directional"},
        ]}},
        // The second is the first's child, mirrored; the third uses the mesh again.
        "nodes": [
            {"translation": [10, 0, 0], "scale": [2, 2, 2], "children": [1, 3, 4]},
            {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
            {"mesh": 0, "rotation": [0.0, half, 0.0, half]},
            {"camera": 0, "name": "eye"},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"camera": 1, "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 2}}},
        ],
        "scenes": [{"nodes": [0, 2, 5, 6]}],
    })
}

fn load_scene(scene: &Value) -> Result<Model, String> {
    read(scene.to_string().as_bytes(), "a.gltf", Path::new("")).map_err(|e| e.to_string())
}

fn glb(scene: &Value) -> Vec<u8> {
    let mut scene = scene.clone();
    scene["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let (mut text, mut data) = (scene.to_string().into_bytes(), bytes());
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    for number in [2, 12 + 8 + text.len() + 8 + data.len(), text.len()] {
        out.extend((number as u32).to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(text);
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(data);
    out
}

#[test]
fn nodes_place_and_mirror_what_is_in_them() {
    let model = load_scene(&scene()).expect("reads");
    let corners = |mesh: &Mesh| -> Vec<[f32; 3]> {
        mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize].map(|c| (c * 1e5).round() / 1e5)).collect()
    };
    let [mirrored, strip, turned, _] = &model.meshes[..] else { panic!("{} meshes", model.meshes.len()) };
    let (o, x, y, xy) = ([10.0, 0.0, 0.0], [8.0, 0.0, 0.0], [10.0, 2.0, 0.0], [8.0, 2.0, 0.0]);
    assert_eq!(corners(mirrored), [o, y, x, y, xy, x]);
    assert_eq!(corners(strip), [o, y, x, y, xy, x]);
    // A quarter turn around y takes x to -z, and z to x.
    let (o, x, y, xy) = ([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0.0, 1.0, -1.0]);
    assert_eq!(corners(turned), [o, x, y, y, x, xy]);
    for mesh in [mirrored, turned] {
        for triangle in &mesh.triangles {
            let own = super::super::polygon::newell(&triangle.map(|i| mesh.positions[i as usize]));
            let normal = mesh.normals[triangle[0] as usize].map(f64::from);
            assert!(dot(unit(own).expect("area"), normal) > 0.99, "{own:?} {normal:?}");
        }
    }
    assert_eq!(model.objects.polygons, 8);
    assert_eq!(
        model.warnings,
        [
            "a.gltf: lines and points are not drawn (2 times, here first)",
            "a.gltf: meshes that are used more than once are stored for each use: 2.0 times the triangles",
        ]
    );
}

#[test]
fn materials_cameras_and_lights() {
    let model = load_scene(&scene()).expect("reads");
    let names: Vec<&str> = model.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["metal", "glass"]);
    let [metal, glass] = [0, 1].map(|i| model.materials[i].material);
    assert_eq!((metal.mirror, metal.diffuse), ([1.0; 3], [1.0, 0.5, 0.25]));
    assert_eq!((glass.transmission, glass.ior, glass.flags), ([1.0; 3], 1.33, Material::PHYSICAL));
    let camera = &model.cameras[0];
    assert_eq!((camera.name.as_str(), camera.eye, camera.up), ("eye", [10.0, 0.0, 0.0], [0.0, 1.0, 0.0]));
    assert_eq!(camera.target, [10.0, 0.0, -10.0]);
    assert!((camera.fov_y_degrees - 0.5f32.to_degrees()).abs() < 1e-5);
    assert_eq!((camera.projection, camera.height), (shading::Projection::Perspective, None));
    // `ymag` is half of what is seen.
    let flat = &model.cameras[1];
    assert_eq!(
        (flat.name.as_str(), flat.projection, flat.height),
        ("camera 1", shading::Projection::Orthographic, Some(3.0))
    );
    let [spot, point, sun] = &model.lights[..] else { panic!("{} lights", model.lights.len()) };
    let pi = std::f32::consts::PI;
    assert_eq!((point.kind(), point.flags, point.colour), (LightKind::Point, 1, [100.0 / pi, 50.0 / pi, 0.0]));
    assert_eq!((spot.kind(), spot.position, spot.axis), (LightKind::Spot, [10.0, 0.0, 0.0], [0.0, 0.0, -1.0]));
    assert!((spot.cos_inner - 0.1f32.cos()).abs() < 1e-6 && (spot.cos_outer - 0.2f32.cos()).abs() < 1e-6);
    assert_eq!((sun.kind(), sun.flags, sun.axis), (LightKind::Directional, 0, [0.0, 0.0, -1.0]));
}

#[test]
fn a_glb_is_the_same_scene() {
    let expected = load_scene(&scene()).expect("reads");
    let mut bytes = glb(&scene());
    // What stands after the length that the header gives is not of the file.
    bytes.extend(b"more");
    let model = read(&bytes, "a.gltf", Path::new("")).expect("reads");
    assert_eq!(format!("{model:?}"), format!("{expected:?}"));
}

#[test]
fn buffers_beside_the_file() {
    let folder = Folder::new(&[]);
    folder.write("a b.bin", &bytes());
    let mut scene = scene();
    scene["buffers"][0]["uri"] = json!("a%20b.bin");
    folder.write("a.gltf", scene.to_string().as_bytes());
    let model = load(&folder.path().join("a.gltf")).expect("reads");
    assert_eq!(model.meshes.len(), 4);
    scene["buffers"][0]["uri"] = json!("b.bin");
    folder.write("a.gltf", scene.to_string().as_bytes());
    let error = load(&folder.path().join("a.gltf")).expect_err("nothing there").to_string();
    assert!(error.ends_with("b.bin: there is no such file; check the path"), "{error}");
}

#[test]
fn what_is_wrong_is_said() {
    let check = |change: &dyn Fn(&mut Value), expected: &str| {
        let mut scene = scene();
        change(&mut scene);
        let error = load_scene(&scene).expect_err(expected);
        assert!(error.starts_with(&format!("a.gltf: {expected}")), "{error}");
    };
    let first = |s: &mut Value| (s["asset"]["version"], s["meshes"]) = (json!("1.0"), json!({}));
    check(&first, "glTF 1.0, and only 2.0 can be read;");
    check(
        &|s| s["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
        "cannot be read without the extension `KHR_draco",
    );
    check(&|s| s["nodes"][3]["children"] = json!([0]), "node 0 has more than one parent");
    check(&|s| s["nodes"][1]["mesh"] = json!(7), "nodes[1].mesh is wrong");
    check(&|s| s["accessors"][1]["count"] = json!(5), "mesh 0 (`quad`), accessor 1: its 5 values do not lie");
    check(&|s| s["accessors"][1]["count"] = json!(3), "mesh 0 (`quad`) has 3 normals for 4 positions");
    check(
        &|s| s["accessors"][1]["byteOffset"] = json!(u64::MAX),
        "mesh 0 (`quad`), accessor 1: its 4 values do not lie",
    );
    check(&|s| s["accessors"][0]["sparse"]["count"] = json!(2), "mesh 0 (`quad`), accessor 0: its 2 sparse values");
    check(&|s| s["accessors"][1]["componentType"] = json!(5122), "mesh 0 (`quad`), accessor 1: Vec3 of I16 is not");
    let again = |s: &mut Value| {
        s["accessors"][0] = json!({"componentType": 5126, "count": 1 << 20, "type": "VEC3", "sparse": {
            "count": 1, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 2}}});
        let primitive = json!({"attributes": {"POSITION": 0}, "indices": 2});
        s["meshes"][0]["primitives"] = json!(vec![primitive; 1000]);
    };
    check(&again, "mesh 0 (`quad`) and what comes before it make more than 67108864 corners of the same bytes");
    let fewer = |s: &mut Value| (0..2).for_each(|i| s["accessors"][i]["count"] = json!(3));
    check(&fewer, "mesh 0 (`quad`) names vertex 3 of 3");
    let error = read(&glb(&scene())[..300], "a.glb", Path::new("")).expect_err("cut").to_string();
    assert!(error.starts_with("a.glb: a GLB of ") && error.contains(" bytes, of which 300 are there;"), "{error}");
    for length in [0, 11, 12, 19, u32::MAX] {
        let mut bytes = glb(&scene());
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        read(&bytes, "a.glb", Path::new("")).expect_err("no such length");
    }
}

#[test]
fn broken_files_end_in_an_error_or_a_model() {
    let (mut choices, mut read_, mut refused) = (Choices(9), 0, 0);
    for round in 0..3000 {
        let mut bytes = if round % 2 == 0 { glb(&scene()) } else { scene().to_string().into_bytes() };
        for _ in 0..1 + choices.below(3) {
            let at = choices.below(bytes.len());
            match choices.below(8) {
                0 => bytes.truncate(at.max(1)),
                1..4 => bytes[at] = b"0123456789-.,e[]"[choices.below(16)],
                _ => bytes[at] ^= 1 << choices.below(8),
            }
        }
        match read(&bytes, "a.glb", Path::new("")) {
            Ok(model) => {
                let within = |m: &Mesh| m.triangles.iter().flatten().all(|&i| (i as usize) < m.positions.len());
                assert!(model.meshes.iter().all(within));
                read_ += 1;
            }
            Err(error) => {
                assert_eq!(error.to_string().lines().count(), 1, "{error}");
                refused += 1;
            }
        }
    }
    assert!(read_ > 300 && refused > 300, "{read_} {refused}");
}
