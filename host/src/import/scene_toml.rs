//! Hybray's scene file: brings files together and gives cameras, lights, materials and settings, in TOML.
//!
//! `docs/SCENE.md` describes it for who writes one; the example there is parsed by a test here. What this file says
//! goes before what the included files say: cameras, lights, background and settings of theirs count only where it
//! gives none, and a material of a name that it defines is its own. A scene file cannot include another, so that
//! nothing can go in circles.

mod tables;

use super::environment::Surroundings;
use super::error::{ImportError, did_you_mean, near, quote};
use super::meshes::Meshes;
use super::polygon::Polygons;
use super::toml_values::{Maybe, Source};
use super::transform::Transform;
use super::{Format, MODELS, builtin_model, mtl, open, validate};
use crate::model::{CameraSpec, Cone, Model, NamedMaterial, Objects, Sphere};
use hybray_shading::{Environment, Highlight, Light, LightKind, Map, Maps, Material, Projection, Sky};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::ops::Range;
use std::path::Path;
use tables::*;
use toml::Spanned;

/// A scene file may be this long (16 MiB): triangles in their thousands belong into an included file.
const FILE_BYTES_MAX: u64 = 1 << 24;

/// Reads a scene file and what it includes.
pub(crate) fn load(path: &Path) -> Result<Model, ImportError> {
    let (text, file) = text_of(path)?;
    read(&text, &file, path.parent().unwrap_or(Path::new("")))
}

/// Reads a file of `[[camera]]` tables alone. Each has a name of its own that can be part of a file's.
///
/// # Errors
/// What is wrong, and where.
pub(crate) fn load_cameras(path: &Path) -> Result<Vec<CameraSpec>, ImportError> {
    let (text, file) = text_of(path)?;
    read_cameras(&text, &file)
}

/// The same from text.
pub(super) fn read_cameras(text: &str, file: &str) -> Result<Vec<CameraSpec>, ImportError> {
    let source = Source { file, text };
    let tables: CamerasFile = parse(&source, "see docs/SCENE.md for [[camera]] tables")?;
    for table in &tables.camera {
        let Some(name) = &table.get_ref().name else {
            return Err(source.error(table.span(), "a camera has no `name`", "give one, for example name = \"front\""));
        };
        let plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
        if !name.get_ref().chars().all(plain) || name.get_ref().len() > NAME_BYTES_MAX {
            let problem = format!("{} cannot be part of a file's name", quote(name.get_ref()));
            let remedy = "use up to 100 letters, digits, dots, spaces, - and _";
            return Err(source.error(name.span(), problem, remedy));
        }
    }
    let builder = Builder::new(source, Path::new(""));
    let cameras = builder.cameras(&tables.camera)?;
    if cameras.is_empty() {
        return Err(ImportError::new(file, "no cameras", "add a table [[camera]] with name, eye and target"));
    }
    Ok(cameras)
}

/// Bytes of a camera's name that goes into a file's.
const NAME_BYTES_MAX: usize = 100;

fn parse<T: serde::de::DeserializeOwned>(source: &Source<'_>, remedy: &str) -> Result<T, ImportError> {
    toml::from_str(source.text).map_err(|error| match error.span() {
        Some(span) => source.error(span, error.message().trim(), remedy),
        None => ImportError::new(source.file, error.message().trim(), remedy),
    })
}

/// A file's text, and what errors call it.
fn text_of(path: &Path) -> Result<(String, String), ImportError> {
    let file = path.display().to_string();
    let reader = open(path).map_err(|e| e.into_error(&file))?;
    let mut bytes = Vec::new();
    if let Err(error) = reader.take(FILE_BYTES_MAX + 1).read_to_end(&mut bytes) {
        return Err(ImportError::new(&file, format!("cannot be read ({error})"), "check the disk and the file"));
    }
    if bytes.len() as u64 > FILE_BYTES_MAX {
        let remedy = "put primitives into a model's file and include that";
        return Err(ImportError::new(&file, "a scene file of more than 16 MiB", remedy));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let good = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..good].iter().filter(|&&b| b == b'\n').count() as u64 + 1;
        ImportError::at(&file, line, "not UTF-8 text", "save the file as UTF-8")
    })?;
    Ok((text, file))
}

/// The same from text; `folder` is where included files are looked for.
pub(super) fn read(text: &str, file: &str, folder: &Path) -> Result<Model, ImportError> {
    let source = Source { file, text };
    let scene: SceneFile = parse(&source, "see docs/SCENE.md for what a scene file holds")?;
    let mut builder = Builder::new(source, folder);
    for (name, table) in &scene.material {
        let material = builder.material(table)?;
        builder.own.insert(name.clone(), material);
    }
    for table in &scene.include {
        builder.include(table)?;
    }
    builder.primitives(&scene)?;
    builder.own_settings(&scene)?;
    Ok(builder.model)
}

struct Builder<'a> {
    source: Source<'a>,
    folder: &'a Path,
    /// Materials that this file defines.
    own: BTreeMap<String, Material>,
    /// Where those that are used stand in the model.
    indices: BTreeMap<String, u16>,
    model: Model,
}

impl<'a> Builder<'a> {
    fn new(source: Source<'a>, folder: &'a Path) -> Self {
        Self { source, folder, own: BTreeMap::new(), indices: BTreeMap::new(), model: Model::default() }
    }

    fn include(&mut self, table: &Spanned<IncludeTable>) -> Result<(), ImportError> {
        let (span, table) = (table.span(), table.get_ref());
        let file = self.source.needed(&table.file, "file", &span, "\"bunny.obj\"")?;
        let transform = self.transform(table)?;
        let mut other = self.included(file)?;
        transform.apply(&mut other);

        let map = self.materials_of(&mut other, table, file.get_ref())?;
        let moved = |index: u16| map.get(usize::from(index)).copied().unwrap_or(0);
        other.meshes.iter_mut().for_each(|m| m.material = moved(m.material));
        other.spheres.iter_mut().for_each(|s| s.material = moved(s.material));
        other.cones.iter_mut().for_each(|c| c.material = moved(c.material));

        let model = &mut self.model;
        model.meshes.append(&mut other.meshes);
        model.spheres.append(&mut other.spheres);
        model.cones.append(&mut other.cones);
        model.lights.append(&mut other.lights);
        model.cameras.append(&mut other.cameras);
        model.warnings.append(&mut other.warnings);
        for (mine, theirs) in [(&mut model.background, other.background), (&mut model.ambient, other.ambient)] {
            if *mine == [0.0; 3] {
                *mine = theirs;
            }
        }
        let (mine, theirs) = (&mut model.settings, other.settings);
        mine.size = mine.size.or(theirs.size);
        mine.spp = mine.spp.or(theirs.spp);
        mine.depth = mine.depth.or(theirs.depth);
        mine.cutoff = mine.cutoff.or(theirs.cutoff);
        mine.filter = mine.filter.take().or(theirs.filter);
        mine.exposure = mine.exposure.or(theirs.exposure);
        mine.seed = mine.seed.or(theirs.seed);
        let Objects { polygons, spheres, cones, cylinders } = other.objects;
        model.objects.polygons += polygons;
        model.objects.spheres += spheres;
        model.objects.cones += cones;
        model.objects.cylinders += cylinders;
        Ok(())
    }

    /// The model that a name or path stands for.
    fn included(&self, file: &Spanned<String>) -> Result<Model, ImportError> {
        let name = file.get_ref().as_str();
        let fail = |problem: String, remedy: &str| Err(self.source.error(file.span(), problem, remedy));
        match builtin_model(name) {
            Ok(Some(model)) => return Ok(model),
            Ok(None) => {}
            Err(error) => return fail(format!("{}: {}", quote(name), error.problem()), error.remedy()),
        }
        let path = self.folder.join(name);
        let format = Format::of(&path);
        if matches!(format, Some(Format::Toml)) {
            return fail(format!("{} is a scene file, and they do not nest", quote(name)), "include what it includes");
        }
        // Opened once here for the message: a file that is not there is this line's fault.
        if let Err(opened) = open(&path) {
            let (problem, remedy) = opened.complaint();
            return fail(format!("{}: {problem}", quote(name)), &remedy);
        }
        match format {
            Some(Format::Model(read)) => read(&path),
            _ => fail(format!("{} is no model", quote(name)), &format!("include {MODELS}, or a built-in scene")),
        }
    }

    fn transform(&self, table: &IncludeTable) -> Result<Transform, ImportError> {
        let mut t = Transform::IDENTITY;
        let source = &self.source;
        if let Some(scale) = &table.scale {
            t.scale = f64::from(source.number(scale, "scale", |s| s > 0.0, "more than 0, for example 2.5")?);
        }
        if let Some(shift) = &table.translate {
            t.shift = source.numbers(shift, "translate", "[1, 0, 2.5]")?.map(f64::from);
        }
        if let Some(rotate) = &table.rotate {
            let (span, rotate) = (rotate.span(), rotate.get_ref());
            let axis = source.needed(&rotate.axis, "axis", &span, "[0, 1, 0]")?;
            let degrees = source.needed(&rotate.degrees, "degrees", &span, "90")?;
            let vector = source.numbers(axis, "axis", "[0, 1, 0]")?.map(f64::from);
            source.number(degrees, "degrees", |d| d.abs() <= 36_000.0, "-36000 to 36000, for example 90")?;
            let turn = Transform::turned(vector, *degrees.get_ref());
            let missing = || source.error(axis.span(), "`axis` has no length", "give it as axis = [0, 1, 0]");
            t.turn = turn.ok_or_else(missing)?;
        }
        Ok(t)
    }

    /// For each material of an included model its index in this one.
    fn materials_of(&mut self, other: &mut Model, table: &IncludeTable, file: &str) -> Result<Vec<u16>, ImportError> {
        if let (Some(one), Some(_)) = (&table.material, &table.materials) {
            let remedy = "keep the one that you mean";
            return Err(self.source.error(one.span(), "both `material` and `materials` are given", remedy));
        }
        let mut renamed: BTreeMap<&str, u16> = BTreeMap::new();
        for (old, new) in table.materials.iter().flat_map(|m| m.get_ref()) {
            let names = || other.materials.iter().map(|m| m.name.as_str());
            if !names().any(|name| name == old) {
                let remedy = did_you_mean(&near(old, names()), "leave the entry out");
                let problem = format!("{} has no material {}", quote(file), quote(old));
                return Err(self.source.error(new.span(), problem, remedy));
            }
            renamed.insert(old, self.own_material(new)?);
        }
        let all = table.material.as_ref().map(|name| self.own_material(name)).transpose()?;
        let mut map = Vec::with_capacity(other.materials.len());
        let textures: Vec<u32> =
            std::mem::take(&mut other.textures).into_iter().map(|t| self.model.add_texture(t)).collect();
        let uses: Vec<u16> = std::mem::take(&mut other.uses)
            .into_iter()
            .map(|map| {
                let texture = textures.get(map.texture as usize).copied().unwrap_or(u32::MAX);
                self.model.add_use(Map { texture, ..map })
            })
            .collect();
        if self.model.sky == Sky::EMPTY && other.sky != Sky::EMPTY {
            let texture = textures.get(other.sky.texture as usize).copied().unwrap_or(Sky::NONE);
            self.model.sky = Sky { texture, ..other.sky };
            (self.model.cells, self.model.cuts) = (std::mem::take(&mut other.cells), std::mem::take(&mut other.cuts));
        }
        for NamedMaterial { name, material, mut maps } in std::mem::take(&mut other.materials) {
            for map in &mut maps.maps {
                *map = uses.get(usize::from(*map)).copied().unwrap_or(Maps::NONE);
            }
            let index = match all.or_else(|| renamed.get(name.as_str()).copied()) {
                Some(index) => index,
                None if self.own.contains_key(&name) => self.named(&name)?,
                None => self.push(name, material, maps)?,
            };
            map.push(index);
        }
        Ok(map)
    }

    /// Index of a material that this file must define.
    fn own_material(&mut self, name: &Spanned<String>) -> Result<u16, ImportError> {
        if !self.own.contains_key(name.get_ref()) {
            let near = near(name.get_ref(), self.own.keys().map(String::as_str));
            let remedy = did_you_mean(&near, &format!("add a table [material.{}]", name.get_ref()));
            let problem = format!("there is no material {}", quote(name.get_ref()));
            return Err(self.source.error(name.span(), problem, remedy));
        }
        self.named(name.get_ref())
    }

    /// Index of a material of this file, or of the default grey.
    fn named(&mut self, name: &str) -> Result<u16, ImportError> {
        if let Some(&index) = self.indices.get(name) {
            return Ok(index);
        }
        let material = self.own.get(name).copied().unwrap_or(mtl::DEFAULT);
        let index = self.push(name.to_owned(), material, Maps::EMPTY)?;
        self.indices.insert(name.to_owned(), index);
        Ok(index)
    }

    fn push(&mut self, name: String, material: Material, maps: Maps) -> Result<u16, ImportError> {
        let index = u16::try_from(self.model.materials.len()).unwrap_or(u16::MAX);
        if index == u16::MAX {
            return Err(ImportError::new(self.source.file, "more than 65,535 materials", "use fewer materials"));
        }
        self.model.materials.push(NamedMaterial { name, material, maps });
        Ok(index)
    }

    fn primitive_material(&mut self, name: &Maybe<String>) -> Result<u16, ImportError> {
        match name {
            Some(name) => self.own_material(name),
            None => self.named("default"),
        }
    }

    fn primitives(&mut self, scene: &SceneFile) -> Result<(), ImportError> {
        for table in &scene.sphere {
            let (span, table) = (table.span(), table.get_ref());
            let material = self.primitive_material(&table.material)?;
            let radius = self.source.needed(&table.radius, "radius", &span, "1")?;
            let radius = self.source.number(radius, "radius", |r| r > 0.0, "more than 0, for example 1")?;
            let sphere = Sphere { centre: self.point(&table.centre, "centre", &span)?, radius, material };
            validate::sphere(&sphere).map_err(|(p, r)| self.source.error(span, p, r))?;
            self.model.spheres.push(sphere);
            self.model.objects.spheres += 1;
        }
        for table in &scene.cone {
            let (span, table) = (table.span(), table.get_ref());
            let material = self.primitive_material(&table.material)?;
            let radius = |value, key| {
                let value = self.source.needed(value, key, &span, "1")?;
                self.source.number(value, key, |r| r >= 0.0, "0 and up, for example 1")
            };
            let base_radius = radius(&table.base_radius, "base_radius")?;
            let apex_radius = radius(&table.apex_radius, "apex_radius")?;
            let base = self.point(&table.base, "base", &span)?;
            let apex = self.point(&table.apex, "apex", &span)?;
            let cone = Cone { base, base_radius, apex, apex_radius, material };
            validate::cone(&cone).map_err(|(p, r)| self.source.error(span, p, r))?;
            self.model.cones.push(cone);
            if base_radius == apex_radius {
                self.model.objects.cylinders += 1;
            } else {
                self.model.objects.cones += 1;
            }
        }
        let (mut meshes, mut polygons) = (Meshes::default(), Polygons::new());
        for table in &scene.triangle {
            let (span, table) = (table.span(), table.get_ref());
            let material = self.primitive_material(&table.material)?;
            let corners = [
                self.point(&table.a, "a", &span)?,
                self.point(&table.b, "b", &span)?,
                self.point(&table.c, "c", &span)?,
            ];
            let mut normals = Vec::new();
            if let Some(given) = &table.normals {
                for normal in given.get_ref() {
                    let normal = Spanned::new(given.span(), normal.clone());
                    normals.push(self.source.numbers(&normal, "normals", "[[0, 0, 1], [0, 0, 1], [0, 0, 1]]")?);
                }
                if normals.len() != 3 {
                    let problem = format!("`normals` has {} of them", normals.len());
                    return Err(self.source.error(given.span(), problem, "give one for each of a, b and c"));
                }
            }
            if meshes.add_polygon(&mut polygons, material, &corners, &normals) == 0 {
                return Err(self.source.error(span, "the triangle has no area", "move one of its corners"));
            }
            self.model.objects.polygons += 1;
        }
        self.model.meshes.extend(meshes.finish());
        Ok(())
    }

    fn point(&self, value: &Maybe<Vec<f64>>, key: &str, table: &Range<usize>) -> Result<[f32; 3], ImportError> {
        let value = self.source.needed(value, key, table, "[0, 0, 0]")?;
        self.source.numbers(value, key, "[0, 0, 0]")
    }

    /// Cameras, lights, background and settings of this file, in place of the included ones.
    fn own_settings(&mut self, scene: &SceneFile) -> Result<(), ImportError> {
        let cameras = self.cameras(&scene.camera)?;
        if !cameras.is_empty() {
            self.model.cameras = cameras;
        }
        if !scene.light.is_empty() {
            self.model.lights.clear();
        }
        for table in &scene.light {
            let light = self.light(table)?;
            self.model.lights.push(light);
        }
        if let Some(table) = &scene.background {
            self.model.background = self.source.colour_or(&table.colour, "colour", self.model.background)?;
            self.model.ambient = self.source.colour_or(&table.ambient, "ambient", self.model.ambient)?;
        }
        if let Some(table) = &scene.environment {
            self.environment(table)?;
        }
        if let Some(table) = &scene.settings {
            self.settings(table)?;
        }
        Ok(())
    }

    /// What is all around, in place of what included files say.
    fn environment(&mut self, table: &Spanned<EnvironmentTable>) -> Result<(), ImportError> {
        let (span, table) = (table.span(), table.get_ref());
        let (source, usual) = (&self.source, Surroundings::default());
        let map = source.needed(&table.map, "map", &span, "\"sky.hdr\"")?;
        let strength = source.number_or(&table.strength, "strength", 1.0, |s| s >= 0.0, "0 and up, for example 1")?;
        let degrees = |d: f32| d.abs() <= 36_000.0;
        let recipe = "-36000 to 36000, for example 90";
        let up = match &table.up {
            Some(up) => {
                let vector = source.numbers(up, "up", "[0, 1, 0]")?.map(f64::from);
                let missing = || source.error(up.span(), "`up` has no length", "give it as up = [0, 1, 0]");
                super::unit(vector).ok_or_else(missing)?
            }
            None => usual.up,
        };
        let whole = |value: &Maybe<i64>, key, most: usize, usual: u16| match value {
            Some(value) => Ok(source.whole(value, key, i64::from(key == "cells")..most as i64 + 1, "64")? as u16),
            None => Ok(usual),
        };
        let surroundings = Surroundings {
            colour: source.colour_or(&table.colour, "colour", [1.0; 3])?.map(|c| c * strength),
            rotation_degrees: source.number_or(&table.rotation, "rotation", 0.0, degrees, recipe)?.into(),
            up,
            samples: whole(&table.samples, "samples", u16::MAX.into(), usual.samples)?,
            cells: whole(&table.cells, "cells", Environment::CELLS_MAX, usual.cells)?,
            seen: table.seen.as_ref().is_none_or(|seen| *seen.get_ref()),
        };
        let path = self.folder.join(map.get_ref());
        surroundings.give(&mut self.model, &path).map_err(|error| {
            source.error(map.span(), format!("{}: {}", quote(map.get_ref()), error.problem()), error.remedy())
        })
    }

    fn settings(&mut self, table: &SettingsTable) -> Result<(), ImportError> {
        let (source, settings) = (&self.source, &mut self.model.settings);
        if let Some(size) = &table.size {
            settings.size = Some(source.size(size, "size")?);
        }
        if let Some(spp) = &table.spp {
            settings.spp = Some(source.whole(spp, "spp", 1..65_536, "16")? as u32);
        }
        if let Some(depth) = &table.depth {
            settings.depth = Some(source.whole(depth, "depth", 1..65, "5")? as u32);
        }
        if let Some(cutoff) = &table.cutoff {
            let allowed = |c: f32| (0.0..=1.0).contains(&c);
            settings.cutoff = Some(source.number(cutoff, "cutoff", allowed, "0 to 1, for example 0.005")?);
        }
        if let Some(filter) = &table.filter {
            let names = ["box", "tent", "gaussian"];
            settings.filter = Some(one_of(source, filter, "filter", &names)?.to_owned());
        }
        if let Some(exposure) = &table.exposure {
            settings.exposure = Some(source.number(exposure, "exposure", |e| e > 0.0, "more than 0, for example 1")?);
        }
        if let Some(seed) = &table.seed {
            settings.seed = Some(source.whole(seed, "seed", 0..i64::MAX, "1")?);
        }
        Ok(())
    }

    fn cameras(&self, tables: &[Spanned<CameraTable>]) -> Result<Vec<CameraSpec>, ImportError> {
        let mut names = BTreeSet::new();
        let mut cameras = Vec::with_capacity(tables.len());
        for table in tables {
            let camera = self.camera(table, cameras.len())?;
            if !names.insert(camera.name.clone()) {
                let problem = format!("two cameras are called {}", quote(&camera.name));
                return Err(self.source.error(table.span(), problem, "give each its own `name`"));
            }
            cameras.push(camera);
        }
        Ok(cameras)
    }

    fn camera(&self, table: &Spanned<CameraTable>, count: usize) -> Result<CameraSpec, ImportError> {
        let (span, table) = (table.span(), table.get_ref());
        let source = &self.source;
        let name = match &table.name {
            Some(name) if name.get_ref().trim().is_empty() => {
                return Err(source.error(name.span(), "`name` is empty", "give one, for example \"front\""));
            }
            Some(name) => name.get_ref().clone(),
            None => format!("camera{}", count + 1),
        };
        let up = match &table.up {
            Some(up) => source.numbers(up, "up", "[0, 1, 0]")?,
            None => [0.0, 1.0, 0.0],
        };
        let projection = match &table.projection {
            Some(given) => {
                let name = one_of(source, given, "projection", &Projection::NAMES)?;
                Projection::parse(name).unwrap_or_default()
            }
            None => Projection::Perspective,
        };
        // Keys that say something of some projections only; given to others, the file means something else.
        let (is_lens, is_flat) = (projection == Projection::Perspective, projection == Projection::Orthographic);
        for (key, at, fits) in [
            ("fov", table.fov.as_ref().map(Spanned::span), is_lens),
            ("height", table.height.as_ref().map(Spanned::span), is_flat),
            ("aperture", table.aperture.as_ref().map(Spanned::span), is_lens),
            ("focus", table.focus.as_ref().map(Spanned::span), is_lens),
            ("blades", table.blades.as_ref().map(Spanned::span), is_lens),
            ("blade_rotation", table.blade_rotation.as_ref().map(Spanned::span), is_lens),
        ] {
            if let (Some(at), false) = (at, fits) {
                let problem = format!("`{key}` means nothing for a camera that is {}", projection.name());
                return Err(source.error(at, problem, "leave it out, or choose another projection"));
            }
        }
        let blades = match &table.blades {
            Some(given) => match source.whole(given, "blades", 0..17, "6")? {
                1 | 2 => {
                    let recipe = "give 3 to 16, or 0 for a round opening";
                    return Err(source.error(given.span(), "an opening of 1 or 2 blades is none", recipe));
                }
                blades => blades as u8,
            },
            None => 0,
        };
        let length = |given: &Maybe<f64>, key| {
            let given = given.as_ref();
            given.map(|given| source.number(given, key, |l| l > 0.0, "more than 0, for example 2")).transpose()
        };
        let angle = |a: f32| a > 0.0 && a < 180.0;
        let camera = CameraSpec {
            name,
            eye: self.point(&table.eye, "eye", &span)?,
            target: self.point(&table.target, "target", &span)?,
            up,
            fov_y_degrees: source.number_or(
                &table.fov,
                "fov",
                40.0,
                angle,
                "more than 0 and less than 180 degrees, for example 40",
            )?,
            hither: source.number_or(&table.hither, "hither", 0.0, |h| h >= 0.0, "0 and up")?,
            size: table.size.as_ref().map(|s| source.size(s, "size")).transpose()?,
            projection,
            height: length(&table.height, "height")?,
            aperture: source.number_or(&table.aperture, "aperture", 0.0, |a| a >= 0.0, "0 and up, for example 0.05")?,
            focus: length(&table.focus, "focus")?,
            blades,
            blade_rotation_degrees: source.number_or(
                &table.blade_rotation,
                "blade_rotation",
                0.0,
                |_| true,
                "degrees, for example 15",
            )?,
        };
        validate::camera(&camera).map_err(|(p, r)| source.error(span, p, r))?;
        Ok(camera)
    }

    fn light(&self, table: &Spanned<LightTable>) -> Result<Light, ImportError> {
        let (span, table) = (table.span(), table.get_ref());
        let source = &self.source;
        let kinds = ["point", "directional", "spot", "sphere", "rectangle"];
        let kind = source.needed(&table.kind, "kind", &span, "\"point\"")?;
        let name = one_of(source, kind, "kind", &kinds)?;

        // Keys that say something of some kinds only; where they are given to others, the file means something else.
        let given = [
            ("position", table.position.as_ref().map(Spanned::span), name != "directional"),
            ("axis", table.axis.as_ref().map(Spanned::span), name == "directional" || name == "spot"),
            ("angles", table.angles.as_ref().map(Spanned::span), name == "spot"),
            ("radius", table.radius.as_ref().map(Spanned::span), name == "sphere"),
            ("u", table.u.as_ref().map(Spanned::span), name == "rectangle"),
            ("v", table.v.as_ref().map(Spanned::span), name == "rectangle"),
            ("falloff", table.falloff.as_ref().map(Spanned::span), name != "directional"),
            ("samples", table.samples.as_ref().map(Spanned::span), name == "sphere" || name == "rectangle"),
        ];
        for (key, at, fits) in given {
            if let (Some(at), false) = (at, fits) {
                let problem = format!("`{key}` means nothing for a {name} light");
                return Err(source.error(at, problem, "leave it out, or choose another kind"));
            }
        }

        let strength = source.number_or(&table.strength, "strength", 1.0, |s| s >= 0.0, "0 and up, for example 1")?;
        let colour = source.colour_or(&table.colour, "colour", [1.0; 3])?.map(|c| c * strength);
        let falls = table.falloff.as_ref().is_some_and(|f| *f.get_ref());
        let flags = if falls { Light::FALLOFF } else { 0 };
        let mut light = Light { colour, flags, samples: 1, ..Light::default() };
        if name != "directional" {
            light.position = self.point(&table.position, "position", &span)?;
        }
        if name == "directional" || name == "spot" {
            let axis = source.needed(&table.axis, "axis", &span, "[0, -1, 0]")?;
            let vector: [f32; 3] = source.numbers(axis, "axis", "[0, -1, 0]")?;
            let unit = super::unit(vector.map(f64::from));
            let missing = || source.error(axis.span(), "`axis` has no length", "give it as axis = [0, -1, 0]");
            light.axis = unit.ok_or_else(missing)?.map(|c| c as f32);
        }
        match name {
            "point" => light.kind = LightKind::Point as u32,
            "directional" => light.kind = LightKind::Directional as u32,
            "spot" => {
                light.kind = LightKind::Spot as u32;
                let angles = source.needed(&table.angles, "angles", &span, "[20, 30]")?;
                let [inner, outer]: [f32; 2] = source.numbers(angles, "angles", "[20, 30]")?;
                if !(0.0 <= inner && inner <= outer && outer <= 180.0) {
                    let remedy = "give degrees from the axis, full light first: angles = [20, 30]";
                    return Err(source.error(angles.span(), format!("`angles` is [{inner}, {outer}]"), remedy));
                }
                let cosine = |degrees: f32| libm::cos(f64::from(degrees) * (std::f64::consts::PI / 180.0)) as f32;
                (light.cos_inner, light.cos_outer) = (cosine(inner), cosine(outer));
            }
            "sphere" => {
                light.kind = LightKind::Sphere as u32;
                let radius = source.needed(&table.radius, "radius", &span, "1")?;
                light.radius = source.number(radius, "radius", |r| r > 0.0, "more than 0, for example 1")?;
            }
            _ => {
                light.kind = LightKind::Rectangle as u32;
                light.u = self.point(&table.u, "u", &span)?;
                light.v = self.point(&table.v, "v", &span)?;
            }
        }
        if name == "sphere" || name == "rectangle" {
            light.samples = match &table.samples {
                Some(samples) => source.whole(samples, "samples", 1..65_536, "16")? as u16,
                None => 16,
            };
        }
        validate::light(&light).map_err(|(p, r)| source.error(span, p, r))?;
        Ok(light)
    }

    fn material(&self, table: &MaterialTable) -> Result<Material, ImportError> {
        let source = &self.source;
        // A surface of which only a mirror or glass is said has no grey under it.
        let other = table.mirror.is_some() || table.transmission.is_some() || table.emission.is_some();
        let diffuse =
            source.colour_or(&table.diffuse, "diffuse", if other { [0.0; 3] } else { mtl::DEFAULT.diffuse })?;
        let specular = source.colour_or(&table.specular, "specular", [0.0; 3])?;
        let shines = specular.iter().any(|&c| c > 0.0);
        let exponent = source.number_or(
            &table.exponent,
            "exponent",
            if shines { 50.0 } else { 0.0 },
            |e| e >= 0.0,
            "0 and up, for example 50",
        )?;
        let highlight = match &table.highlight {
            None if shines => Highlight::Blinn,
            None => Highlight::None,
            Some(name) => match one_of(source, name, "highlight", &["none", "phong", "blinn"])? {
                "phong" => Highlight::Phong,
                "blinn" => Highlight::Blinn,
                _ => Highlight::None,
            },
        };
        let ior = if table.transmission.is_some() { 1.5 } else { 1.0 };
        let fresnel = table.fresnel.as_ref().is_some_and(|f| *f.get_ref());
        Ok(Material {
            diffuse,
            ambient: source.colour_or(&table.ambient, "ambient", diffuse)?,
            emission: source.colour_or(&table.emission, "emission", [0.0; 3])?,
            specular,
            mirror: source.colour_or(&table.mirror, "mirror", [0.0; 3])?,
            transmission: source.colour_or(&table.transmission, "transmission", [0.0; 3])?,
            exponent,
            ior: source.number_or(&table.ior, "ior", ior, |i| i > 0.0, "more than 0, for example 1.5")?,
            highlight: highlight as u32,
            flags: if fresnel { Material::FRESNEL } else { 0 },
        })
    }
}

/// The one of `names` that `value` is.
fn one_of<'n>(
    source: &Source<'_>,
    value: &Spanned<String>,
    key: &str,
    names: &[&'n str],
) -> Result<&'n str, ImportError> {
    if let Some(name) = names.iter().find(|name| *name == value.get_ref()) {
        return Ok(name);
    }
    let all: Vec<String> = names.iter().map(|n| format!("\"{n}\"")).collect();
    let remedy = format!("give one of {}", all.join(", "));
    Err(source.error(value.span(), format!("`{key}` is {}", quote(value.get_ref())), remedy))
}

#[cfg(test)]
mod tests;
