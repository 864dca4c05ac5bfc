//! The sphereflake without its ground, some of its levels of recursion diffuse.
//!
//! Source: the report's section 6.1 (the ten largest balls are not reflective), 6.4 with table 6.8 (reflectivity by
//! levels of recursion: at 1 the whole model is reflective, at 6 none of it) and 6.6 (66,430 spheres, one light).

use super::super::spd;
use super::{SIZE_1995, matt};
use crate::model::Model;

/// 7,381 spheres; those of the first `level - 1` of five levels of recursion, the largest, are diffuse. At level 3
/// these are the ten largest, as in the rest of the chapter.
pub fn balls(level: u32) -> Model {
    partly_diffuse(spd::balls_noground(4), level - 1)
}

/// 66,430 spheres and one light; those of the first `level - 1` of six levels of recursion are diffuse.
pub fn balls5(level: u32) -> Model {
    let mut model = spd::balls_noground(5);
    model.lights.truncate(1);
    model.lights[0].colour = [1.0; 3];
    partly_diffuse(model, level - 1)
}

fn partly_diffuse(mut model: Model, levels: u32) -> Model {
    model.cameras[0].size = Some(SIZE_1995);
    // What the floor of SPD's balls has of its colour.
    let share = 0.8;
    let diffuse = model.add_material("balls-diffuse", matt([1.0, 0.9, 0.7].map(|c| share * c)));
    // A level's radius is a third of the one before: halfway between two levels, nothing lies.
    let largest = model.spheres.iter().map(|s| s.radius).fold(0.0, f32::max);
    let least = largest * 2.0 / 3.0_f32.powi(levels as i32);
    model.spheres.iter_mut().filter(|s| s.radius > least).for_each(|s| s.material = diffuse);
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;
    use crate::model::Sphere;

    /// Diffuse spheres of a model, and whether all of them are larger than all others.
    fn diffuse(model: &Model) -> (usize, bool) {
        let (dull, bright): (Vec<&Sphere>, Vec<&Sphere>) =
            model.spheres.iter().partition(|s| !model.materials[usize::from(s.material)].material.mirrors());
        let least = dull.iter().map(|s| s.radius).fold(f32::INFINITY, f32::min);
        (dull.len(), bright.iter().all(|s| s.radius < least))
    }

    /// Spheres of the first `levels` levels: 1 + 9 + 81 + ...
    fn series(levels: u32) -> usize {
        (0..levels).map(|k| 9_usize.pow(k)).sum()
    }

    #[test]
    fn levels_are_those_of_the_table() {
        for (level, expected) in [(1, 0), (2, 1), (3, 10), (4, 91), (5, 820), (6, 7_381)] {
            let model = balls(level);
            checks::sound(&model);
            assert_eq!(diffuse(&model), (expected, true), "{level}");
            assert_eq!((expected, model.spheres.len(), model.lights.len()), (series(level - 1), 7_381, 3));
            assert_eq!((model.primitives(), model.cameras[0].size), (7_381, Some([256, 256])));
        }
    }

    #[test]
    fn large_model() {
        for level in [1, 3, 6, 7] {
            let model = balls5(level);
            checks::sound(&model);
            assert_eq!(diffuse(&model), (series(level - 1), true), "{level}");
            assert_eq!((model.primitives(), model.lights.len()), (66_430, 1));
        }
    }

    /// Where the spheres are does not change with the level.
    #[test]
    fn only_materials_differ() {
        let places = |level| balls(level).spheres.iter().map(|s| (s.centre, s.radius)).collect::<Vec<_>>();
        let plain: Vec<_> = spd::balls_noground(4).spheres.iter().map(|s| (s.centre, s.radius)).collect();
        assert!((1..=6).all(|level| places(level) == plain));
    }
}
