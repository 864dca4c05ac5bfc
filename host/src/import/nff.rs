//! NFF, Eric Haines' Neutral File Format (version 3.1, from the Standard Procedural Databases), complete.
//!
//! `v` a view, `b` the background, `l` a light, `f` a fill (material) for what follows, `c` a cone or cylinder, `s` a
//! sphere, `p` a polygon, `pp` a polygon with normals, `#` a comment. As in the programs that read it with `scanf`,
//! line ends are blanks like any other. The keywords of the extended NFF (ENFF) and of WorldToolKit's format, which
//! has the same name, are refused.
//!
//! - `angle` is the angle of the picture's height. Rays start at `hither`, a distance along the view axis.
//! - A light without a colour has `1 / sqrt(number of lights)` in each channel. No light falls off with distance.
//! - The `n`-th different fill is the material `fn`, so that a scene file can replace it. What stands before any fill
//!   has the default grey.
//! - A negative radius (both of a cone) means that only the inside is visible; it is taken as positive, and warned of.
//! - Polygons of one material become one mesh, patches of it another. Those without area are dropped and counted.
//! - A corner of a patch whose normal is zero takes the polygon's.

use super::error::{ImportError, Warnings, quote};
use super::lines::Lines;
use super::meshes::Meshes;
use super::polygon::{CORNERS_MAX, Polygons};
use super::{COORDINATE_MAX, mtl, open, validate};
use crate::model::{CameraSpec, Cone, Model, NamedMaterial, Sphere};
use crate::nff_material::nff_material;
use hybray_shading::{Light, LightKind};
use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;

/// Lights that a file may have.
const LIGHTS_MAX: usize = 65_535;

/// Reads an NFF file.
pub(crate) fn load(path: &Path) -> Result<Model, ImportError> {
    let file = path.display().to_string();
    let reader = open(path).map_err(|e| e.into_error(&file))?;
    read(reader, &file)
}

/// Words of a file, with a look at the next one.
struct Words<R> {
    lines: Lines<R>,
    line: String,
    /// The next word is in `line[at..end]`; none if both are the line's length.
    at: usize,
    end: usize,
}

impl<R: BufRead> Words<R> {
    /// The next word, which stays; `None` at the end of the file.
    fn peek(&mut self) -> Result<Option<&str>, ImportError> {
        while self.at == self.end {
            let rest = &self.line[self.end..];
            let trimmed = rest.trim_start();
            if trimmed.is_empty() || trimmed.starts_with('#') {
                let Some(line) = self.lines.next()? else { return Ok(None) };
                self.line.clear();
                self.line.push_str(line);
                (self.at, self.end) = (0, 0);
                continue;
            }
            self.at = self.end + rest.len() - trimmed.len();
            let length = trimmed.find(|c: char| c.is_whitespace() || c == '#').unwrap_or(trimmed.len());
            self.end = self.at + length;
        }
        Ok(Some(&self.line[self.at..self.end]))
    }

    fn skip(&mut self) {
        self.at = self.end;
    }

    fn number_is_next(&mut self) -> Result<bool, ImportError> {
        Ok(self.peek()?.is_some_and(|word| !word.starts_with(|c: char| c.is_ascii_alphabetic())))
    }

    /// A finite number of magnitude up to [`COORDINATE_MAX`]; `what` says of what it is part.
    fn number(&mut self, what: &str) -> Result<f32, ImportError> {
        let Some(word) = self.peek()? else {
            let problem = format!("the file ends in the middle of {what}");
            return Err(self.lines.error(problem, "check that the file is whole"));
        };
        let value = word.parse::<f32>();
        match value {
            Ok(value) if value.abs() <= COORDINATE_MAX => {
                self.skip();
                Ok(value)
            }
            Ok(_) => {
                let problem = format!("{} in {what} is too large or no number", quote(word));
                Err(self.lines.error(problem, "keep within 2^100"))
            }
            Err(_) => {
                let problem = format!("{} where a number of {what} should stand", quote(word));
                Err(self.lines.error(problem, "check how many numbers the statement has"))
            }
        }
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f32; N], ImportError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.number(what)?;
        }
        Ok(values)
    }

    fn whole(&mut self, what: &str, least: usize, most: usize) -> Result<usize, ImportError> {
        let word = self.peek()?.unwrap_or("").to_owned();
        match word.parse::<usize>() {
            Ok(value) if (least..=most).contains(&value) => {
                self.skip();
                Ok(value)
            }
            _ => {
                let problem = format!("{} where {what} should stand", quote(&word));
                Err(self.lines.error(problem, format!("give a whole number from {least} to {most}")))
            }
        }
    }

    fn not_negative<const N: usize>(&mut self, what: &str) -> Result<[f32; N], ImportError> {
        let values = self.numbers(what)?;
        match values.iter().find(|v| **v < 0.0) {
            None => Ok(values),
            Some(v) => Err(self.lines.error(format!("{v} in {what}"), "give numbers of 0 and up")),
        }
    }
}

/// The same from any reader.
pub(super) fn read<R: BufRead>(reader: R, file: &str) -> Result<Model, ImportError> {
    let lines = Lines::new(reader, file, false);
    let mut words = Words { lines, line: String::new(), at: 0, end: 0 };
    let mut model = Model::default();
    let mut warnings = Warnings::default();
    let (mut meshes, mut polygons) = (Meshes::default(), Polygons::new());
    let mut fills: BTreeMap<[u32; 8], u16> = BTreeMap::new();
    let mut fill: Option<u16> = None;
    // Lights that take the default colour.
    let mut plain: Vec<usize> = Vec::new();
    let (mut corners, mut normals) = (Vec::new(), Vec::new());
    let mut dropped = 0u64;

    while let Some(word) = words.peek()? {
        let word = word.to_owned();
        let line = words.lines.number();
        words.skip();
        match word.as_str() {
            "v" => {
                let camera = view(&mut words, &mut warnings, model.cameras.len())?;
                model.cameras.push(camera);
            }
            "b" => model.background = words.not_negative("`b` (background: r g b)")?,
            "l" => {
                let position = words.numbers("`l` (light: x y z [r g b])")?;
                let mut light = Light { position, kind: LightKind::Point as u32, samples: 1, ..Light::default() };
                if words.number_is_next()? {
                    light.colour = words.not_negative("`l` (light: x y z r g b)")?;
                } else {
                    plain.push(model.lights.len());
                }
                if model.lights.len() == LIGHTS_MAX {
                    return Err(words.lines.error(format!("more than {LIGHTS_MAX} lights"), "use fewer lights"));
                }
                model.lights.push(light);
            }
            "f" => {
                let values: [f32; 8] = words.not_negative("`f` (fill: r g b Kd Ks Shine T ior)")?;
                let [r, g, b, kd, ks, shine, t, ior] = values;
                let next = model.materials.len();
                let index = *fills.entry(values.map(f32::to_bits)).or_insert(u16::try_from(next).unwrap_or(u16::MAX));
                if index == u16::MAX {
                    return Err(words.lines.error("more than 65,535 different fills", "use fewer"));
                }
                if usize::from(index) == next {
                    let material = nff_material([r, g, b], kd, ks, shine, t, ior);
                    model.materials.push(NamedMaterial {
                        name: format!("f{}", fills.len()),
                        material,
                        ..Default::default()
                    });
                }
                fill = Some(index);
            }
            "c" | "s" | "p" | "pp" => {
                let material = match fill {
                    Some(index) => index,
                    None => {
                        warnings.add(line, "objects before the first `f` have the default grey");
                        // The only material of which this can be the first: nothing else adds one before a fill.
                        let index = model.add_material("default", mtl::DEFAULT);
                        fill = Some(index);
                        index
                    }
                };
                match word.as_str() {
                    "s" => {
                        let [x, y, z, radius] = words.numbers("`s` (sphere: x y z radius)")?;
                        let sphere = Sphere { centre: [x, y, z], radius: radius.abs(), material };
                        validate::sphere(&sphere).map_err(|(p, r)| ImportError::at(file, line, p, r))?;
                        if radius < 0.0 {
                            warnings.add(line, INSIDE_OUT);
                        }
                        model.spheres.push(sphere);
                        model.objects.spheres += 1;
                    }
                    "c" => {
                        let cone = cone(&mut words, line, material, &mut warnings)?;
                        if cone.base_radius == cone.apex_radius {
                            model.objects.cylinders += 1;
                        } else {
                            model.objects.cones += 1;
                        }
                        model.cones.push(cone);
                    }
                    _ => {
                        let count = words.whole("the number of corners of a polygon", 3, CORNERS_MAX)?;
                        corners.clear();
                        normals.clear();
                        for _ in 0..count {
                            corners.push(words.numbers::<3>("a polygon's corner (x y z)")?);
                            if word == "pp" {
                                normals.push(words.numbers::<3>("a patch's normal (x y z)")?);
                            }
                        }
                        let made = meshes.add_polygon(&mut polygons, material, &corners, &normals);
                        dropped += u64::from(made == 0);
                        model.objects.polygons += 1;
                    }
                }
            }
            "nff" => {
                let remedy = "this importer reads Eric Haines' NFF: convert the file to OBJ";
                return Err(ImportError::at(file, line, "this is WorldToolKit's NFF, another format", remedy));
            }
            _ => {
                let problem = format!("{} is no statement of NFF", quote(&word));
                let remedy = "NFF has v, b, l, f, c, s, p, pp and #: check the numbers before this";
                return Err(ImportError::at(file, line, problem, remedy));
            }
        }
    }

    let share = (1.0 / (model.lights.len() as f64).sqrt()) as f32;
    for at in plain {
        if let Some(light) = model.lights.get_mut(at) {
            light.colour = [share; 3];
        }
    }
    model.meshes = meshes.finish();
    model.warnings.extend(warnings.lines(file));
    if dropped > 0 {
        let all = model.objects.polygons;
        model.warnings.push(format!("{file}: {dropped} of {all} polygons have no area and are left out"));
    }
    Ok(model)
}

const INSIDE_OUT: &str = "a negative radius (only the inside is visible) is taken as positive, seen from both sides";

fn cone<R: BufRead>(
    words: &mut Words<R>,
    line: u64,
    material: u16,
    warnings: &mut Warnings,
) -> Result<Cone, ImportError> {
    let [bx, by, bz, base, ax, ay, az, apex] = words.numbers("`c` (cone: base x y z radius, apex x y z radius)")?;
    if base < 0.0 || apex < 0.0 {
        if base > 0.0 || apex > 0.0 {
            let problem = "a cone with one negative radius";
            return Err(ImportError::at(words.lines.file(), line, problem, "give both radii the same sign"));
        }
        warnings.add(line, INSIDE_OUT);
    }
    let (base_radius, apex_radius) = (base.abs(), apex.abs());
    let cone = Cone { base: [bx, by, bz], base_radius, apex: [ax, ay, az], apex_radius, material };
    validate::cone(&cone).map_err(|(p, r)| ImportError::at(words.lines.file(), line, p, r))?;
    Ok(cone)
}

fn view<R: BufRead>(words: &mut Words<R>, warnings: &mut Warnings, views: usize) -> Result<CameraSpec, ImportError> {
    let line = words.lines.number();
    let (mut eye, mut target, mut up, mut angle) = (None, None, None, None);
    let (mut hither, mut size) = (0.0, None);
    loop {
        let key = words.peek()?.unwrap_or("").to_owned();
        if !["from", "at", "up", "angle", "hither", "yon", "resolution"].contains(&key.as_str()) {
            break;
        }
        words.skip();
        match key.as_str() {
            "from" => eye = Some(words.numbers("`from` (x y z)")?),
            "at" => target = Some(words.numbers("`at` (x y z)")?),
            "up" => up = Some(words.numbers("`up` (x y z)")?),
            "angle" => angle = Some(words.number("`angle` (degrees)")?),
            "hither" => [hither] = words.not_negative("`hither` (a distance)")?,
            "yon" => {
                warnings.add(words.lines.number(), "`yon` is not used");
                words.number("`yon` (a distance)")?;
            }
            _ => {
                let pixels =
                    |words: &mut Words<R>| words.whole("`resolution` in pixels", 1, validate::SIZE_MAX as usize);
                size = Some([pixels(words)? as u32, pixels(words)? as u32]);
            }
        }
    }
    let (Some(eye), Some(target), Some(up), Some(fov_y_degrees)) = (eye, target, up, angle) else {
        let missing = [("from", eye.is_none()), ("at", target.is_none()), ("up", up.is_none()), ("angle", true)];
        let name = missing.iter().find(|m| m.1).map_or("", |m| m.0);
        let problem = format!("`v` without `{name}`");
        return Err(ImportError::at(words.lines.file(), line, problem, "give from, at, up, angle, hither, resolution"));
    };
    let name = if views == 0 { "view".to_owned() } else { format!("view{}", views + 1) };
    let camera = CameraSpec { name, eye, target, up, fov_y_degrees, hither, size, ..CameraSpec::default() };
    validate::camera(&camera).map_err(|(p, r)| ImportError::at(words.lines.file(), line, p, r))?;
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_shading::Material;

    fn import(text: &[u8]) -> Result<Model, String> {
        let model = read(text, "t.nff").map_err(|e| e.to_string())?;
        assert_eq!(validate::validate(&model), Ok(()));
        Ok(model)
    }

    const WHOLE: &str = "# a scene with everything
v
from 2.1 1.3 1.7 # the eye
at 0 0 0
up 0 0 1
angle 45
hither 0.01
resolution 512 256
b 0.078 0.361 0.753
l 4 3 2
l 1 -4 4 1 0.5 0
f 1 0.75 0.33 1 0 0 0 0
p 4
12 12 -0.5
-12 12 -0.5
-12 -12 -0.5
12 -12 -0.5
f 1 0.9 0.7 0.5 0.5 3.0827 0 1
s 0 0 0 0.5
c 0 0 0 1 0 0 5 1
c 0 0 0 1
0 0 5 0
pp 3
0 0 0 0 0 2
1 0 0 0 3 4
0 1 0 0 0 0
f 1 0.75 0.33 1 0 0 0 0
p 5 0 0 0 4 0 0 4 4 0 1 1 0 0 4 0
";

    #[test]
    fn everything() {
        let check = |text: &str| {
            let m = import(text.as_bytes()).expect("reads");
            assert_eq!(m.warnings, [""; 0]);
            assert_eq!(
                m.cameras,
                [CameraSpec {
                    name: "view".to_owned(),
                    eye: [2.1, 1.3, 1.7],
                    target: [0.0; 3],
                    up: [0.0, 0.0, 1.0],
                    fov_y_degrees: 45.0,
                    hither: 0.01,
                    size: Some([512, 256]),
                    ..CameraSpec::default()
                }]
            );
            assert_eq!(m.background, [0.078, 0.361, 0.753]);
            let lights: Vec<_> = m.lights.iter().map(|l| (l.kind, l.position, l.colour, l.flags)).collect();
            let share = std::f32::consts::FRAC_1_SQRT_2;
            assert_eq!(lights, [(0, [4.0, 3.0, 2.0], [share; 3], 0), (0, [1.0, -4.0, 4.0], [1.0, 0.5, 0.0], 0)]);
            let names: Vec<&str> = m.materials.iter().map(|m| m.name.as_str()).collect();
            assert_eq!(names, ["f1", "f2"]);
            assert_eq!(m.materials[1].material, nff_material([1.0, 0.9, 0.7], 0.5, 0.5, 3.0827, 0.0, 1.0));
            assert_eq!(m.spheres, [Sphere { centre: [0.0; 3], radius: 0.5, material: 1 }]);
            let (base, apex) = ([0.0; 3], [0.0, 0.0, 5.0]);
            let cylinder = Cone { base, base_radius: 1.0, apex, apex_radius: 1.0, material: 1 };
            assert_eq!(m.cones, [cylinder, Cone { apex_radius: 0.0, ..cylinder }]);
            let o = m.objects;
            assert_eq!((o.polygons, o.spheres, o.cones, o.cylinders), (3, 1, 1, 1));
            // The square's two triangles and the concave pentagon's three are of one material.
            let meshes: Vec<_> = m.meshes.iter().map(|m| (m.material, m.triangles.len(), m.normals.len())).collect();
            assert_eq!(meshes, [(0, 5, 0), (1, 1, 3)]);
            assert_eq!(m.meshes[1].normals, [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]]);
            let area: f64 = m.meshes[0].triangles[2..]
                .iter()
                .map(|t| super::super::polygon::newell(&t.map(|i| m.meshes[0].positions[i as usize]))[2] / 2.0)
                .sum();
            assert_eq!(area, 10.0);
        };
        check(WHOLE);
        check(&WHOLE.replace('\n', "\r\n"));
        check(WHOLE.trim_end());
        // Line ends are blanks.
        check(&WHOLE.replace("# a scene with everything\n", "").replace(" # the eye", "").replace('\n', " "));
        check(&WHOLE.replace(' ', "\n").replace("#\na\nscene\nwith\neverything\n", "").replace("#\nthe\neye\n", ""));
    }

    #[test]
    fn small_things() {
        let model = import(b"s 0 0 0 -2 l 1 2 3").expect("reads");
        assert_eq!(model.spheres[0].radius, 2.0);
        assert_eq!(model.materials[0].material.diffuse, Material::MATT.diffuse);
        assert_eq!(model.lights[0].colour, [1.0; 3]);
        assert_eq!(
            model.warnings,
            ["t.nff:1: objects before the first `f` have the default grey", &format!("t.nff:1: {INSIDE_OUT}"),]
        );
        let model = import(b"f 1 1 1 1 0 0 0 1\np 3 0 0 0 1 1 1 2 2 2\ns 0 0 0 1").expect("reads");
        assert_eq!((model.meshes.len(), model.objects.polygons), (0, 1));
        assert_eq!(model.warnings, ["t.nff: 1 of 1 polygons have no area and are left out"]);
        assert_eq!(import(b"# nothing").expect("reads").primitives(), 0);
        let model = import(b"s 0 0 0 1 f 1 0 0 1 0 0 0 1 s 0 0 0 1").expect("reads");
        assert_eq!(model.spheres.iter().map(|s| s.material).collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn bad_statements_are_errors_that_name_their_line() {
        let check = |text: &str, expected: &str| {
            let error = import(format!("f 1 1 1 1 0 0 0 1\n{text}").as_bytes()).expect_err(text);
            assert!(error.starts_with(&format!("t.nff:{expected}")), "{text}: {error}");
        };
        check("s 0 0 0 0", "2: the sphere's radius is 0");
        check("s 0 0 0", "3: the file ends in the middle of `s`");
        check("s 0 0 0 x", "2: `x` where a number of `s`");
        check("s 0 0\n\n0 nan", "4: `nan` in `s` (sphere: x y z radius) is too large or no number");
        check("s 0 0 0 1e39", "2: `1e39` in `s`");
        check("s 0 0 1e9 1", "2: a radius of 1 around");
        check("s 0 0 0 1 2", "2: `2` is no statement of NFF");
        check("c 0 0 0 1 0 0 0 1", "2: the cone's two ends are the same point");
        check("c 0 0 0 0 0 0 1 0", "2: both radii of the cone are 0");
        check("c 0 0 0 -1 0 0 1 1", "2: a cone with one negative radius");
        check("p 2 0 0 0 1 1 1", "2: `2` where the number of corners");
        check("p 4000000000 0 0 0", "2: `4000000000` where the number of corners");
        check("p -3", "2: `-3` where");
        check("p 3 0 0 0 1 0 0 0 1 s", "2: `s` where a number of a polygon's corner");
        check("pp 3 0 0 0 0 0 1", "3: the file ends in the middle of a polygon's corner");
        check("l 0 0", "3: the file ends");
        check("l 0 0 0 1 1", "3: the file ends");
        check("l 0 0 0 1 1 -1", "2: -1 in `l`");
        check("b 0 0 -0.5", "2: -0.5 in `b`");
        check("f 1 1 1 -1 0 0 0 1", "2: -1 in `f`");
        check("v\nfrom 0 0 0\nat 0 0 1\nup 0 1 0", "2: `v` without `angle`");
        check("v\nat 0 0 1", "2: `v` without `from`");
        check("v from 0 0 0 at 0 0 0 up 0 1 0 angle 45", "2: the camera looks at the point");
        check("v from 0 0 0 at 0 0 1 up 0 0 1 angle 45", "2: the camera's up points along");
        check("v from 0 0 0 at 0 0 1 up 0 1 0 angle 180", "2: the camera's angle is 180");
        check("v from 0 0 0 at 0 0 1 up 0 1 0 angle 45 resolution 0 5", "2: `0` where `resolution`");
        check("v from 0 0 0 at 0 0 1 up 0 1 0 angle 45 hither -1", "2: -1 in `hither`");
        check("tpp 3", "2: `tpp` is no statement of NFF");
        check("nff", "2: this is WorldToolKit's NFF");
        assert!(import(b"s 0 0 0 1\n\xff").expect_err("refused").starts_with("t.nff:2: not UTF-8"));
    }
}
