use super::super::testing::Folder;
use super::*;

fn import(text: &str) -> Result<Model, String> {
    let folder = Folder::new(&[
        ("two.obj", "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl blue\nf 3 2 1\n"),
        ("two.mtl", "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n"),
        ("ball.nff", "b 0.5 0.5 0.5\nv from 0 0 9 at 0 0 0 up 0 1 0 angle 30\nl 1 2 3\nf 1 1 1 1 0 0 0 1\ns 1 0 0 1\n"),
        ("bad.obj", "v 0 0 0\nf 1 2 3\n"),
        ("other.toml", ""),
        // Two texels of 1/8.
        ("sky.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n@@@\x7f@@@\x7f"),
    ]);
    let model = read(text, "s.toml", folder.path()).map_err(|e| e.to_string())?;
    assert_eq!(validate::validate(&model), Ok(()));
    Ok(model)
}

/// The example of the documentation says what its text says.
#[test]
fn the_documented_example() {
    let page = include_str!("../../../../docs/SCENE.md");
    let text = page.split("```").find_map(|part| part.strip_prefix("toml\n")).expect("an example");
    let m = import(text).expect("reads");
    assert!(m.warnings.is_empty(), "{:?}", m.warnings);
    assert_eq!(
        m.settings,
        crate::model::Settings {
            size: Some([640, 480]),
            spp: Some(16),
            depth: Some(5),
            cutoff: Some(0.005),
            filter: Some("tent".to_owned()),
            exposure: Some(1.0),
            seed: Some(1),
        }
    );
    assert_eq!(m.ambient, [0.05; 3]);
    let cameras: Vec<_> = m.cameras.iter().map(|c| (c.name.as_str(), c.eye, c.fov_y_degrees, c.size)).collect();
    let expected = [("front", [0.0, 2.0, 8.0], 40.0, None), ("above", [0.0, 12.0, 0.5], 40.0, Some([400, 400]))];
    assert_eq!(cameras, expected);
    let lights: Vec<_> = m.lights.iter().map(|l| (l.kind, l.samples, l.flags)).collect();
    assert_eq!(lights, [(1, 1, 0), (4, 16, Light::FALLOFF)]);
    // spd:balls:2 has 91 spheres and a square; one sphere, cone and triangle are the file's own.
    assert_eq!((m.spheres.len(), m.cones.len(), m.objects.polygons), (92, 1, 2));
    assert_eq!(m.materials[usize::from(m.spheres[91].material)].name, "glass");
}

#[test]
fn what_each_light_becomes() {
    let check = |text: &str, expected: Light| {
        let m = import(&format!("[[light]]\n{text}")).expect(text);
        assert_eq!(m.lights, [expected], "{text}");
    };
    let light = |kind: LightKind| Light { colour: [1.0; 3], kind: kind as u32, samples: 1, ..Light::default() };
    let position = [1.0, 2.0, 3.0];
    check("kind = 'point'\nposition = [1, 2, 3]", Light { position, ..light(LightKind::Point) });
    check("kind = 'directional'\naxis = [0, -3, 0]", Light { axis: [0.0, -1.0, 0.0], ..light(LightKind::Directional) });
    check(
        "kind = 'spot'\nposition = [1, 2, 3]\naxis = [0, 0, 2]\nangles = [0, 90]\ncolour = [1, 0.5, 0]\nstrength = 2",
        Light {
            position,
            axis: [0.0, 0.0, 1.0],
            cos_inner: 1.0,
            cos_outer: libm::cos(std::f64::consts::FRAC_PI_2) as f32,
            colour: [2.0, 1.0, 0.0],
            ..light(LightKind::Spot)
        },
    );
    check(
        "kind = 'sphere'\nposition = [1, 2, 3]\nradius = 0.5\nfalloff = true\nsamples = 4",
        Light { position, radius: 0.5, flags: Light::FALLOFF, samples: 4, ..light(LightKind::Sphere) },
    );
    check(
        "kind = 'rectangle'\nposition = [1, 2, 3]\nu = [1, 0, 0]\nv = [0, 1, 0]",
        Light { position, u: [1.0, 0.0, 0.0], v: [0.0, 1.0, 0.0], samples: 16, ..light(LightKind::Rectangle) },
    );
}

#[test]
fn what_each_material_becomes() {
    let check = |text: &str, expected: Material| {
        let text = format!("[material.m]\n{text}\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'm'");
        let m = import(&text).expect(&text);
        assert_eq!((m.materials.len(), m.materials[0].material), (1, expected), "{text}");
    };
    let black = Material { diffuse: [0.0; 3], ambient: [0.0; 3], ..mtl::DEFAULT };
    check("", mtl::DEFAULT);
    check("diffuse = 0.5\nambient = '#ffffff'", Material { diffuse: [0.5; 3], ambient: [1.0; 3], ..mtl::DEFAULT });
    check("mirror = [1, 0, 0]", Material { mirror: [1.0, 0.0, 0.0], ..black });
    check("emission = 3", Material { emission: [3.0; 3], ..black });
    let glass = Material { transmission: [0.9; 3], ior: 1.5, ..black };
    check("transmission = 0.9", glass);
    check("transmission = 0.9\nior = 2\nfresnel = true", Material { ior: 2.0, flags: Material::FRESNEL, ..glass });
    let (specular, highlight) = ([0.5; 3], Highlight::Blinn as u32);
    check("specular = 0.5", Material { specular, exponent: 50.0, highlight, ..mtl::DEFAULT });
    let highlight = Highlight::Phong as u32;
    check(
        "specular = 0.5\nexponent = 9\nhighlight = 'phong'",
        Material { specular, exponent: 9.0, highlight, ..mtl::DEFAULT },
    );
}

#[test]
fn what_is_all_around() {
    let usual = import("[environment]\nmap = 'sky.hdr'\n").expect("reads");
    assert_eq!((usual.sky.colour, usual.sky.samples, usual.sky.flags, usual.sky.texture), ([1.0; 3], 16, 0, 0));
    assert_eq!((usual.cells.len(), usual.textures.len(), usual.lights.len()), (2, 1, 0));
    assert_eq!(hybray_shading::from_shared_exponent(u32::from_le_bytes(usual.textures[0].image.get(0, 0))), [0.125; 3]);
    let more = "[environment]\nmap = 'sky.hdr'\nstrength = 2\ncolour = [1, 0.5, 0]\nrotation = 90\nup = [0, 0, 3]\nsamples = 4\ncells = 1\nseen = false\n";
    let sky = import(more).expect("reads").sky;
    assert_eq!((sky.colour, sky.samples, sky.flags), ([2.0, 1.0, 0.0], 4, Sky::HIDDEN));
    assert_eq!(sky.axes, [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let dark = import("[environment]\nmap = 'sky.hdr'\nstrength = 0\n").expect("reads");
    assert_eq!((dark.sky.samples, dark.cells.len(), dark.cuts.len()), (0, 0, 0));
    // One gallery inside another has the outer's sky, or brings its own, turned with it.
    let turned = "[[include]]\nfile = 'gallery:8'\nrotate = { axis = [0, 1, 0], degrees = 70 }\n";
    let own = import(turned).expect("reads");
    let [x, _, z] = own.sky.axes[0].map(f64::from);
    assert!((x - 0.0).abs() < 1e-6 && (z + 1.0).abs() < 1e-6, "20 and 70 degrees: {x} {z}");
    assert!(own.cells.len() > 2 && own.textures[own.sky.texture as usize].name == "sky");
    let both = import(&format!("[environment]\nmap = 'sky.hdr'\n{turned}")).expect("reads");
    assert_eq!((both.sky.axes[0], both.cells.len()), ([1.0, 0.0, 0.0], 2));
}

#[test]
fn includes_move_and_bring_their_own() {
    let m = import("[[include]]\nfile = 'ball.nff'\ntranslate = [0, 10, 0]\nscale = 2\nrotate = { axis = [0, 0, 1], degrees = 90 }")
        .expect("reads");
    assert_eq!((m.spheres[0].centre, m.spheres[0].radius), ([0.0, 12.0, 0.0], 2.0));
    assert_eq!((m.cameras[0].eye, m.cameras[0].name.as_str()), ([0.0, 10.0, 18.0], "view"));
    assert_eq!(m.lights[0].position, [-4.0, 12.0, 6.0]);
    assert_eq!(m.background, [0.5; 3]);
    assert_eq!(m.objects.spheres, 1);

    let own = "[background]\ncolour = 0.25\n[[camera]]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n[[light]]\nkind = 'directional'\naxis = [0, -1, 0]\n";
    let m = import(&format!("{own}[[include]]\nfile = 'ball.nff'\n")).expect("reads");
    assert_eq!((m.background, m.cameras.len(), m.lights.len()), ([0.25; 3], 1, 1));
    assert_eq!(m.cameras[0].name, "camera1");

    let lens = "[[camera]]\neye = [0, 0, 3]\ntarget = [0, 4, 0]\naperture = 0.25\nblades = 7\nblade_rotation = -20\n";
    let flat = "[[camera]]\neye = [0, 0, 3]\ntarget = [0, 4, 0]\nprojection = 'orthographic'\n";
    let around = "[[camera]]\neye = [0, 0, 3]\ntarget = [0, 4, 0]\nprojection = 'spherical'\n";
    let text = format!("{lens}{lens}focus = 2\n{flat}{flat}height = 7\n{around}[[include]]\nfile = 'ball.nff'\n");
    let cameras = import(&text).expect("reads").cameras;
    let lens = |c: &CameraSpec| (c.aperture, c.focus_distance(), c.blades, c.blade_rotation_degrees);
    assert_eq!(lens(&cameras[0]), (0.25, 5.0, 7, -20.0), "what it looks at is sharp");
    assert_eq!(lens(&cameras[1]), (0.25, 2.0, 7, -20.0));
    let projections = [0, 1, 1, 2].map(|number| Projection::from_u32(number).expect("one of three"));
    assert!(cameras[1..].iter().zip(projections).all(|(camera, expected)| camera.projection == expected));
    // As much as is seen at the distance 5 within 40 degrees.
    assert!((cameras[2].picture_height() - 10.0 * 20f32.to_radians().tan()).abs() < 1e-5);
    assert_eq!(cameras[3].picture_height(), 7.0);
}

#[test]
fn materials_of_includes() {
    let check = |text: &str, expected: &[(&str, [f32; 3])]| {
        let m = import(text).expect(text);
        let found: Vec<_> = m
            .meshes
            .iter()
            .map(|mesh| &m.materials[usize::from(mesh.material)])
            .map(|m| (m.name.as_str(), m.material.diffuse))
            .collect();
        assert_eq!(found, expected, "{text}");
    };
    let (red, blue, green) = (("red", [1.0, 0.0, 0.0]), ("blue", [0.0, 0.0, 1.0]), ("green", [0.0, 1.0, 0.0]));
    let file = "[[include]]\nfile = 'two.obj'\n";
    let own = "[material.green]\ndiffuse = [0, 1, 0]\n";
    check(file, &[red, blue]);
    check(&format!("{own}{file}material = 'green'"), &[green, green]);
    check(&format!("{own}{file}materials = {{ red = 'green' }}"), &[green, blue]);
    check(&format!("[material.blue]\ndiffuse = 0.5\n{file}"), &[red, ("blue", [0.5; 3])]);
    check(&format!("{file}{file}"), &[red, blue, red, blue]);
}

#[test]
fn mistakes_name_their_line() {
    let check = |text: &str, expected: &str| {
        let error = import(text).expect_err(text);
        assert!(error.starts_with(&format!("s.toml:{expected}")), "{text}\n{error}");
        assert!(!error.contains('\n'), "{error}");
    };
    check("a = ", "1: ");
    check("\n[settings", "2: ");
    check("\ncolor = 1", "2: unknown field `color`");
    check("[settings]\nsizes = [1, 2]", "2: unknown field `sizes`");
    check("[settings]\n\nsize = [1]", "3: `size` is [1]; give width and height from 1 to 32768");
    check("[settings]\nsize = [0, 5]", "2: `size` is [0, 5]");
    check("[settings]\nsize = 'x'", "2: invalid type: string");
    check("[settings]\nspp = 0", "2: `spp` is 0; give 1 to 65535, for example 16");
    check("[settings]\nspp = 1.5", "2: invalid type: float");
    check("[settings]\ndepth = 65", "2: `depth` is 65; give 1 to 64, for example 5");
    check("[settings]\ncutoff = nan", "2: `cutoff` is NaN; give 0 to 1");
    check("[settings]\nfilter = 'Box'", "2: `filter` is `Box`; give one of \"box\", \"tent\", \"gaussian\"");
    check("[settings]\nexposure = 0", "2: `exposure` is 0");
    check("[settings]\nseed = -1", "2: `seed` is -1");
    check("[environment]\nsamples = 4", "1: `map` is missing; add map = \"sky.hdr\"");
    check("[environment]\nmap = 'no.hdr'", "2: `no.hdr`: there is no such file");
    check("[environment]\nmap = 'two.obj'", "2: `two.obj`: neither PNG");
    check("[environment]\nmap = 'sky.hdr'\ncells = 0", "3: `cells` is 0; give 1 to 16384");
    check("[environment]\nmap = 'sky.hdr'\nup = [0, 0, 0]", "3: `up` has no length");
    check("[environment]\nmap = 'sky.hdr'\nstrength = -1", "3: `strength` is -1; give 0 and up");
    check("[environment]\nmap = 'sky.hdr'\nrotation = inf", "3: `rotation` is inf");
    check("[background]\ncolour = [1, 2]", "2: `colour` has 2 numbers");
    check("[background]\ncolour = [1, 2, 3, 4]", "2: `colour` has 4 numbers");
    check("[background]\ncolour = '#12345'", "2: `colour` is `#12345`");
    check("[background]\ncolour = [0, 0, -1]", "2: `colour` is [0.0, 0.0, -1.0]; give numbers of 0 and up");
    check("[background]\nambient = inf", "2: `ambient` is [inf, inf, inf]");
    check("[background]\nambient = true", "2: invalid type: boolean `true`, expected a colour");
    check("\n[[camera]]\neye = [0, 0, 1]", "2: `target` is missing; add target = [0, 0, 0]");
    let camera = "[[camera]]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n";
    check(&format!("{camera}fov = 180"), "4: `fov` is 180; give more than 0 and less than 180");
    check(&format!("{camera}fov = 1e-60"), "4: `fov` is");
    check(&format!("{camera}up = [0, 0, 2]"), "1: the camera's up points along its view");
    check(&format!("{camera}hither = -1"), "4: `hither` is -1");
    check(&format!("{camera}name = 'a'\n{camera}name = 'a'"), "5: two cameras are called `a`");
    check(&format!("{camera}name = ''"), "4: `name` is empty");
    check("[[camera]]\neye = [0, 0]\ntarget = [0, 0, 0]", "2: `eye` has 2 numbers");
    check(&format!("{camera}projection = 'fisheye'"), "4: `projection` is `fisheye`; give one of \"perspective\", ");
    check(&format!("{camera}height = 2"), "4: `height` means nothing for a camera that is perspective; leave it out");
    for key in ["fov = 40", "aperture = 0.1", "focus = 2", "blades = 5", "blade_rotation = 5"] {
        let (name, _) = key.split_once(' ').expect("a key");
        let problem = format!("5: `{name}` means nothing for a camera that is");
        check(&format!("{camera}projection = 'spherical'\n{key}"), &problem);
        check(&format!("{camera}projection = 'orthographic'\n{key}"), &problem);
    }
    check(&format!("{camera}projection = 'orthographic'\nheight = 0"), "5: `height` is 0; give more than 0");
    check(&format!("{camera}aperture = -1"), "4: `aperture` is -1; give 0 and up");
    check(&format!("{camera}aperture = 5000"), "1: the camera's aperture is 5000 and its focus 1");
    check(&format!("{camera}focus = 0"), "4: `focus` is 0; give more than 0");
    check(&format!("{camera}blades = 2"), "4: an opening of 1 or 2 blades is none; give 3 to 16, or 0");
    check(&format!("{camera}blades = 17"), "4: `blades` is 17; give 0 to 16");
    check("[[camera]]\neye = [0, 0, 1e31]\ntarget = [0, 0, 0]", "2: `eye` holds 1");
    check("[[light]]", "1: `kind` is missing");
    check("[[light]]\nkind = 'sun'", "2: `kind` is `sun`; give one of");
    check("[[light]]\nkind = 'point'", "1: `position` is missing");
    check("[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nradius = 1", "4: `radius` means nothing for a point light");
    check("[[light]]\nkind = 'directional'\naxis = [0, 0, 0]", "3: `axis` has no length");
    check(
        "[[light]]\nkind = 'spot'\nposition = [0, 0, 0]\naxis = [0, 0, 1]\nangles = [30, 20]",
        "5: `angles` is [30, 20]",
    );
    check("[[light]]\nkind = 'rectangle'\nposition = [0, 0, 0]\nu = [1, 0, 0]\nv = [2, 0, 0]", "1: the light's edges");
    check("[[light]]\nkind = 'sphere'\nposition = [0, 0, 0]\nradius = 0", "4: `radius` is 0");
    check("[[light]]\nkind = 'sphere'\nposition = [0, 0, 0]\nradius = 1\nsamples = 70000", "5: `samples` is 70000");
    check("[material.m]\nior = 0", "2: `ior` is 0; give more than 0, for example 1.5");
    check("[material.m]\nhighlight = 'x'", "2: `highlight` is `x`");
    check("[material.m]\nmirror = -1", "2: `mirror` is [-1.0, -1.0, -1.0]");
    check("[[include]]", "1: `file` is missing");
    check("\n[[include]]\nfile = 'twoo.obj'", "3: `twoo.obj`: there is no such file; did you mean `two.obj`?");
    check("[[include]]\nfile = 'x.stl'", "2: `x.stl`: there is no such file");
    check("[[include]]\nfile = 'other.toml'", "2: `other.toml` is a scene file, and they do not nest");
    check("[[include]]\nfile = '.'", "2: `.`: a folder, not a file");
    check("[[include]]\nfile = 'two.mtl'", "2: `two.mtl` is no model;");
    check("[[include]]\nfile = 'spd:bals'", "2: `spd:bals`: there is no built-in scene");
    let two = "[[include]]\nfile = 'two.obj'\n";
    check(&format!("{two}scale = 0"), "3: `scale` is 0");
    check(&format!("{two}scale = -1"), "3: `scale` is -1");
    check(&format!("{two}rotate = {{ axis = [0, 0, 0], degrees = 1 }}"), "3: `axis` has no length");
    check(&format!("{two}rotate = {{ degrees = 1 }}"), "3: `axis` is missing");
    check(&format!("{two}material = 'x'"), "3: there is no material `x`; add a table [material.x]");
    check(&format!("[material.gold]\n{two}material = 'glod'"), "4: there is no material `glod`; did you mean `gold`?");
    check(
        &format!("[material.m]\n{two}materials = {{ rad = 'm' }}"),
        "4: `two.obj` has no material `rad`; did you mean `red`?",
    );
    check(&format!("[material.m]\n{two}material = 'm'\nmaterials = {{}}"), "4: both `material` and `materials`");
    check("[[sphere]]\ncentre = [0, 0, 0]\nradius = 0", "3: `radius` is 0");
    check("[[sphere]]\ncentre = [1e9, 0, 0]\nradius = 1", "1: a radius of 1 around");
    check("[[cone]]\nbase = [0, 0, 0]\nbase_radius = 1\napex = [0, 0, 0]\napex_radius = 1", "1: the cone's two ends");
    check("[[triangle]]\na = [0, 0, 0]\nb = [1, 1, 1]\nc = [2, 2, 2]", "1: the triangle has no area");
    check(
        "[[triangle]]\na = [0, 0, 0]\nb = [1, 0, 0]\nc = [0, 2, 2]\nnormals = [[0, 0, 1]]",
        "5: `normals` has 1 of them",
    );
    // A mistake in an included file is told of there.
    let error = import("[[include]]\nfile = 'bad.obj'").expect_err("refused");
    assert!(error.contains("bad.obj:2: index 2 in `2`"), "{error}");
}
