//! A picture that is being traced, as a node sees it.

use super::DEPTH_MAX;
use crate::film::Step;
use hybray_shading::{Camera, CameraError, Filter, Lens, Pose, Projection};
use hybray_tracer::Layer;
use hybray_wire::{Frame, TileMap};

/// What a node makes of a [`Frame`].
pub(crate) struct Picture {
    pub frame: Frame,
    pub map: TileMap,
    pub camera: Camera,
    pub filter: Filter,
    pub step: Step,
    pub layer: Layer,
}

impl Picture {
    pub fn new(frame: Frame) -> Option<Self> {
        let sound = frame.half <= 2 && frame.drawn_samples() > 0 && (1..=DEPTH_MAX as u8).contains(&frame.depth_max);
        Some(Self {
            frame,
            map: TileMap::new(frame.width, frame.height).filter(|_| sound)?,
            camera: camera(&frame).ok()?,
            filter: Filter::from_u32(u32::from(frame.filter))?,
            step: Step::new(frame.step_log2),
            layer: Layer::from_u8(frame.layer)?,
        })
    }
}

/// The camera of a picture.
///
/// # Errors
/// See [`CameraError`]: [`CameraError::Lensless`] also where there is no such projection.
pub fn camera(frame: &Frame) -> Result<Camera, CameraError> {
    let Frame { eye, target, up, hither, width, height, fov_y_degrees, optics, .. } = *frame;
    let pose = Pose { eye: eye.into(), target: target.into(), up: up.into(), hither, size: [width, height] };
    let (radius, focus, rotation_degrees) = (optics.radius, optics.focus, optics.rotation_degrees);
    match Projection::from_u32(u32::from(optics.projection)) {
        Some(Projection::Perspective) => {
            let lens = Lens { radius, focus, blades: u32::from(optics.blades), rotation_degrees };
            Camera::perspective(&pose, fov_y_degrees, lens)
        }
        Some(Projection::Orthographic) if radius == 0.0 => Camera::orthographic(&pose, optics.height),
        Some(Projection::Spherical) if radius == 0.0 => Camera::spherical(&pose),
        _ => Err(CameraError::Lensless),
    }
}

/// Whether nodes can draw this picture: it has pixels, samples, a depth of 1 to 64, a filter, a layer, and a camera that looks
/// somewhere. Ask before it begins: a node passes over what it cannot draw, and its tiles would be waited for.
#[must_use]
pub fn can_draw(frame: &Frame) -> bool {
    Picture::new(*frame).is_some()
}
