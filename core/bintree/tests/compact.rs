//! Compact pages beside full ones: the same primitives to the bit, boxes around theirs, and fewer bytes.

mod common;

use common::scenes::{mixed, table};
use common::{Built, Random, Rule, Shape, Shapes, build, build_compact, checked};
use hybray_bintree::sah;
use hybray_bintree::walk::{Counts, Stack, nearest, occluded};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Ray, Triangle, Vec3};
use hybray_scene::{Child, Kind, PageForm, PageView, Slot};
use std::collections::BTreeMap;

fn rule() -> Rule {
    Rule::Sah(sah::Settings::default())
}

/// A triangle's corners, normals and material, as numbers.
type Record = ([[u32; 3]; 3], Option<[u32; 3]>, u16);

fn triangles(views: &[PageView<'_>]) -> BTreeMap<u32, Record> {
    let lanes = views.iter().flat_map(|view| (0..view.body.triangle_lanes()).map(move |number| (view, number)));
    let record = |(view, number): (&PageView<'_>, usize)| {
        let corners = view.body.triangle(number).v.map(|v| v.to_array().map(f32::to_bits));
        let material = view.material(Slot::new(Kind::Triangle, number));
        (view.body.triangle_id(number), (corners, view.body.normals(number), material))
    };
    lanes.map(record).collect()
}

fn forms(built: &Built) -> Vec<PageForm> {
    built.views().iter().map(|view| view.body.form()).collect()
}

#[test]
fn the_same_primitives() {
    // Corners that triangles share, but not their normals.
    let creased = ("creased", Shapes { all: mesh(12), materials: 3, smooth: true });
    for (name, shapes) in table().into_iter().chain([creased]) {
        let (full, compact) = (build(&shapes, rule(), 4096).unwrap(), build_compact(&shapes, rule(), 4096).unwrap());
        assert!(forms(&full).iter().all(|&form| form == PageForm::Full), "{name}");
        assert!(forms(&compact).iter().all(|&form| form == PageForm::Compact), "{name}");
        let (full, compact) = (full.views(), compact.views());
        // A page without a smooth triangle has no normals, and pages are cut elsewhere.
        let plain = |mut all: BTreeMap<u32, Record>| {
            all.values_mut().for_each(|record| record.1 = record.1.filter(|normals| normals[0] != u32::MAX));
            all
        };
        assert_eq!(plain(triangles(&full)), plain(triangles(&compact)), "{name}");
        assert!(compact.len() <= full.len(), "{name}");
    }
}

/// One page each, so that the nodes are those of one tree.
#[test]
fn boxes_are_around_those_of_the_full_form() {
    for (name, shapes) in table() {
        let (full, compact) =
            (build(&shapes, rule(), 65_536).unwrap(), build_compact(&shapes, rule(), 65_536).unwrap());
        let (full, compact) = (full.views(), compact.views());
        let ([full], [compact]) = (&full[..], &compact[..]) else { continue };
        assert_eq!(full.body.nodes().len(), compact.body.nodes().len(), "{name}");
        for (index, (full, compact)) in full.body.nodes().zip(compact.body.nodes()).enumerate() {
            assert_eq!(full.child, compact.child, "{name}");
            for (slot, child) in full.children() {
                let (tight, loose) = (full.aabb(slot), compact.aabb(slot));
                assert!(loose.contains(&tight), "{name} {index} {slot} {child:?}: {loose:?} {tight:?}");
                // By less than two steps of 255 on each side, or what a float of that size cannot tell.
                let bounds = full.bounds();
                let slack = (bounds.hi - bounds.lo) * (4.0 / 255.0)
                    + Vec3::splat(4.0 * f32::EPSILON * bounds.magnitude() + 4.0 * f32::MIN_POSITIVE);
                assert!((loose.hi - tight.hi).cmple(slack).all() && (tight.lo - loose.lo).cmple(slack).all(), "{name}");
            }
        }
    }
}

/// A closed surface of squares: each vertex in six triangles.
fn mesh(side: usize) -> Vec<Shape> {
    let corner = |i: usize, j: usize| {
        let (x, y) = (i as f32 / side as f32, j as f32 / side as f32);
        Vec3::new(x, y, 0.1 * (12.0 * x).sin() * (9.0 * y).cos())
    };
    let square = |k: usize| {
        let (i, j) = (k % side, k / side);
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]].map(|v| Shape::Triangle(Triangle { v }))
    };
    (0..side * side).flat_map(square).collect()
}

#[test]
fn a_mesh_takes_few_bytes() {
    for (page_bytes, most) in [(65_536, 30.0), (4096, 36.0)] {
        let shapes = Shapes::new(mesh(100));
        let [full, compact] = [build, build_compact].map(|build| build(&shapes, rule(), page_bytes).unwrap());
        let bytes = |built: &Built| {
            let pages: u32 = built.entries.iter().map(|entry| entry.bytes).sum();
            (pages as usize + 224 * built.nodes.len() + 8 * built.entries.len()) as f64 / shapes.all.len() as f64
        };
        let (full, compact) = (bytes(&full), bytes(&compact));
        eprintln!("pages of {page_bytes}: {full:.1} and {compact:.1} bytes a triangle");
        assert!(compact < most && compact < 0.55 * full, "{full} {compact}");
    }
}

/// Far beyond the internal unit, where only the full form's walk is there to compare with; and beyond what steps can hold.
#[test]
fn extremes_are_walked_alike() {
    let mut random = Random(8);
    for (scale, compact_pages) in [(1e30, true), (1e-30, true), (1e-38, true), (1e-42, true), (2.2e38, false)] {
        let shapes = Shapes::new(mixed(300, 21).into_iter().map(|shape| shape.scaled(scale)).collect());
        let (full, compact) = (build(&shapes, rule(), 8192).unwrap(), build_compact(&shapes, rule(), 8192).unwrap());
        assert_eq!(forms(&compact).iter().all(|&form| form == PageForm::Compact), compact_pages, "{scale:e}");
        let (full_views, compact_views) = (full.views(), compact.views());
        let scenes = [full.resident(&full_views), compact.resident(&compact_views)];
        if compact_pages {
            checked(&scenes[1], shapes.all.len()).unwrap_or_else(|fault| panic!("{scale:e}: {fault}"));
        }
        let mut hits = 0;
        for kernels in Kernels::available() {
            for _ in 0..300 {
                let origin = random.vec() * (2.0 * scale);
                let ray = Ray { origin, direction: random.vec(), t_min: 0.0, t_max: f32::INFINITY };
                let (stack, counts) = (&mut Stack::new(), &mut Counts::default());
                let [a, b] = scenes.each_ref().map(|scene| nearest(kernels, scene, &ray, stack, counts).candidate);
                assert_eq!(a, b, "{scale:e} {kernels:?} {ray:?}");
                let [c, d] = scenes.each_ref().map(|scene| occluded(kernels, scene, &ray, stack, counts));
                assert_eq!((c, d), (a.is_hit(), a.is_hit()), "{scale:e} {kernels:?} {ray:?}");
                hits += usize::from(a.is_hit());
            }
        }
        assert!(hits > 20 || !(1e-37..=1e37).contains(&scale), "{scale:e}: {hits}");
    }
}

#[test]
fn every_leaf_is_led_to_once() {
    let shapes = Shapes::new(mesh(60));
    let built = build_compact(&shapes, rule(), 65_536).unwrap();
    for view in built.views() {
        let mut tested = vec![0; view.body.triangle_lanes() / 4];
        for node in view.body.nodes() {
            for (_, child) in node.children() {
                if let Child::Leaf { kind: Kind::Triangle, start, count } = child {
                    (start..start + count).for_each(|block| tested[block as usize] += 1);
                }
            }
        }
        assert!(tested.iter().all(|&n| n == 1));
    }
}
