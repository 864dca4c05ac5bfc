//! Embree in robust mode, where its header was found: single rays, packets of 16, streams of 256.
//!
//! The one module of this crate that is not safe Rust: it calls `embree.c`, which stands beside it.
#![allow(unsafe_code)]

use std::ffi::c_void;
use std::ptr::NonNull;
use std::rc::Rc;

use hybray::build::Source;
use hybray_bintree::cut::Primitives;
use hybray_geometry::Ray;
use hybray_scene::Kind as Primitive;

use crate::engine::{Answer, Built, Counts, Engine, Kind};

/// A ray as `embree.c` has it.
#[derive(Clone, Copy)]
#[repr(C)]
struct PlainRay {
    origin: [f32; 3],
    direction: [f32; 3],
    t_min: f32,
    t_max: f32,
}

unsafe extern "C" {
    fn hybray_embree_new(
        vertices: *const f32,
        vertex_count: usize,
        indices: *const u32,
        triangles: usize,
        spheres: *const f32,
        sphere_count: usize,
    ) -> *mut c_void;
    fn hybray_embree_free(tree: *mut c_void);
    fn hybray_embree_kept(tree: *const c_void) -> i64;
    fn hybray_embree_peak(tree: *const c_void) -> i64;
    fn hybray_embree_version() -> u32;
    fn hybray_embree_nearest(tree: *const c_void, rays: *const PlainRay, out: *mut Answer, count: usize);
    fn hybray_embree_occluded(tree: *const c_void, rays: *const PlainRay, out: *mut Answer, count: usize);
    fn hybray_embree_nearest16(t: *const c_void, rays: *const PlainRay, out: *mut Answer, count: usize, coherent: bool);
    fn hybray_embree_occluded16(
        t: *const c_void,
        rays: *const PlainRay,
        out: *mut Answer,
        count: usize,
        coherent: bool,
    );
    fn hybray_embree_nearest_stream(
        tree: *const c_void,
        rays: *const PlainRay,
        out: *mut Answer,
        count: usize,
        coherent: bool,
    );
    fn hybray_embree_occluded_stream(
        tree: *const c_void,
        rays: *const PlainRay,
        out: *mut Answer,
        count: usize,
        coherent: bool,
    );
}

/// Embree's version, as 31305 is 3.13.5.
pub fn version() -> u32 {
    // SAFETY: it returns a constant.
    unsafe { hybray_embree_version() }
}

/// A scene's primitives as Embree takes them.
#[derive(Default)]
pub struct Given {
    vertices: Vec<f32>,
    indices: Vec<u32>,
    spheres: Vec<[f32; 4]>,
}

impl Given {
    /// All primitives of a scene without cones; the triangles' ids come before the spheres'.
    pub fn new(source: &Source<'_>) -> Self {
        let mut given = Self::default();
        for id in 0..source.len() {
            if source.aabb(id).0 == Primitive::Triangle {
                given.vertices.extend(source.triangle(id).v.iter().flat_map(|v| v.to_array()));
                given.indices.extend([3 * id, 3 * id + 1, 3 * id + 2]);
            } else {
                let sphere = source.sphere(id);
                let [x, y, z] = sphere.centre.to_array();
                given.spheres.push([x, y, z, sphere.radius]);
            }
        }
        // Embree loads four floats for each vertex.
        given.vertices.push(0.0);
        given
    }
}

/// A committed scene.
struct Tree {
    tree: NonNull<c_void>,
    /// Embree refers to it.
    _given: Rc<Given>,
}

impl Drop for Tree {
    fn drop(&mut self) {
        // SAFETY: it came from `hybray_embree_new`, and nobody has it any more.
        unsafe { hybray_embree_free(self.tree.as_ptr()) }
    }
}

/// How rays are given.
#[derive(Clone, Copy)]
enum Form {
    Single,
    Packets,
    Streams,
}

/// One form over a shared tree.
struct Embree {
    tree: Rc<Tree>,
    form: Form,
}

/// Builds a tree and returns the three forms that trace in it. `None` if there is no device.
pub fn build(given: &Rc<Given>) -> Option<(Vec<Box<dyn Engine>>, Built)> {
    let (tree, mut built) = Built::of("embree", || {
        // SAFETY: the pointers are those of slices with the lengths beside them, three indices a triangle, each below
        // the number of vertices, with one float more than there are vertices; `Tree` keeps them alive, and a vector's
        // heap block does not move when its owner does.
        let tree = unsafe {
            hybray_embree_new(
                given.vertices.as_ptr(),
                given.vertices.len() / 3,
                given.indices.as_ptr(),
                given.indices.len() / 3,
                given.spheres.as_ptr().cast(),
                given.spheres.len(),
            )
        };
        NonNull::new(tree).map(|tree| Tree { tree, _given: Rc::clone(given) })
    });
    let tree = Rc::new(tree?);
    // SAFETY: the tree lives.
    let bytes = unsafe { [hybray_embree_kept(tree.tree.as_ptr()), hybray_embree_peak(tree.tree.as_ptr())] };
    [built.kept_bytes, built.peak_bytes] = bytes.map(|bytes| bytes.max(0) as u64);
    let forms = [Form::Single, Form::Packets, Form::Streams];
    let engine = |form| Box::new(Embree { tree: Rc::clone(&tree), form }) as Box<dyn Engine>;
    Some((forms.map(engine).into(), built))
}

impl Engine for Embree {
    fn name(&self) -> &'static str {
        match self.form {
            Form::Single => "embree single",
            Form::Packets => "embree packets",
            Form::Streams => "embree streams",
        }
    }

    fn trace(&mut self, kind: Kind, rays: &[Ray], out: &mut [Answer]) -> bool {
        assert_eq!(rays.len(), out.len());
        let (tree, coherent) = (self.tree.tree.as_ptr(), kind.is_coherent());
        let mut plain = [PlainRay { origin: [0.0; 3], direction: [0.0; 3], t_min: 0.0, t_max: 0.0 }; BLOCK];
        for (rays, out) in rays.chunks(BLOCK).zip(out.chunks_mut(BLOCK)) {
            for (plain, ray) in plain.iter_mut().zip(rays) {
                *plain = PlainRay {
                    origin: ray.origin.to_array(),
                    direction: ray.direction.to_array(),
                    t_min: ray.t_min,
                    t_max: ray.t_max,
                };
            }
            let (from, to, count) = (plain.as_ptr(), out.as_mut_ptr(), out.len());
            // SAFETY: the tree lives; `from` has at least as many rays as `to` has answers, `count`.
            unsafe {
                match (self.form, kind.is_any()) {
                    (Form::Single, false) => hybray_embree_nearest(tree, from, to, count),
                    (Form::Single, true) => hybray_embree_occluded(tree, from, to, count),
                    (Form::Packets, false) => hybray_embree_nearest16(tree, from, to, count, coherent),
                    (Form::Packets, true) => hybray_embree_occluded16(tree, from, to, count, coherent),
                    (Form::Streams, false) => hybray_embree_nearest_stream(tree, from, to, count, coherent),
                    (Form::Streams, true) => hybray_embree_occluded_stream(tree, from, to, count, coherent),
                }
            }
        }
        true
    }

    /// Embree does not tell.
    fn counts(&mut self, _: Kind, _: &[Ray]) -> Option<Counts> {
        None
    }
}

/// Rays that are given over at once: few enough to stay near.
const BLOCK: usize = 256;
