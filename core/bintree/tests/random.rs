//! Any small set of primitives, any rule, any room: sound trees, and the hits of brute force.

mod common;

use common::{Rule, Shape, Shapes, build, build_compact, rays, verify};
use hybray_bintree::{midpoint, sah};
use hybray_geometry::{Cone, Sphere, Triangle, Vec3};
use proptest::prelude::*;

/// Coordinates that collide, cancel and vanish.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        3 => -1.0f32..1.0,
        3 => (-4i8..=4).prop_map(|i| f32::from(i) * 0.25),
        1 => prop::sample::select(vec![0.0, -0.0, 1e-45, -1e-40, f32::MIN_POSITIVE, 1.0 - f32::EPSILON, 0.1, 1e-20]),
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

fn radius() -> impl Strategy<Value = f32> {
    prop_oneof![4 => 0.001f32..0.5, 1 => prop::sample::select(vec![f32::MIN_POSITIVE, 1e-30, 0.25, 1.0])]
}

fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![
        4 => [point(), point(), point()].prop_map(|v| Shape::Triangle(Triangle { v })),
        2 => (point(), radius()).prop_map(|(centre, radius)| Shape::Sphere(Sphere { centre, radius })),
        1 => (point(), point(), radius(), prop_oneof![Just(0.0), radius()])
            .prop_filter("a cone has a length", |(base, apex, ..)| (*base - *apex).length() > 1e-3)
            .prop_map(|(base, apex, base_radius, apex_radius)| {
                Shape::Cone(Cone { base, base_radius, apex, apex_radius })
            }),
    ]
}

fn rule() -> impl Strategy<Value = Rule> {
    let area = (1u32..80, 0.0f32..4.0, 1u32..20, 0u32..78).prop_map(|(leaf_max, node_cost, stop_at, depth)| {
        Rule::Sah(sah::Settings { leaf_max: leaf_max.min(64), node_cost, stop_at, depth })
    });
    let halves = (0u32..60, 0u32..20, 1usize..9)
        .prop_map(|(depth_max, objects_max, room)| Rule::Midpoint(midpoint::Settings { depth_max, objects_max }, room));
    prop_oneof![area, halves]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_few_primitives(
        all in prop::collection::vec(shape(), 1..60),
        repeated in 0usize..3,
        rule in rule(),
        page_bytes in 2048usize..9000,
        seed in any::<u64>(),
    ) {
        let mut all = all;
        for _ in 0..repeated {
            all.extend_from_within(..);
        }
        let count = all.len();
        let shapes = Shapes { all, materials: 2, smooth: true };
        let rays = rays(&shapes, 24, seed);
        for built in [build(&shapes, rule, page_bytes).unwrap(), build_compact(&shapes, rule, page_bytes).unwrap()] {
            verify("random", &built, count, &rays);
        }
    }
}
