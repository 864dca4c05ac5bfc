//! Cameras: pixels to rays.
//!
//! A pixel is first mapped to two numbers, right and up of the picture's middle: slopes for a perspective camera, lengths
//! for an orthographic one, angles for a spherical one. The mapping of each axis is monotone in `f32` too, so those of a
//! tile's corners bound those of every sample in it; [`Camera::outermost`] makes rays of them.

use crate::filter::{Filter, sample_offset};
use crate::id;
use crate::lens::Lens;
use crate::stratify::{permuted, stratified};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// How a camera makes rays of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Projection {
    /// Rays diverge from the eye, or from a lens around it; straight lines stay straight.
    #[default]
    Perspective = 0,
    /// Rays are parallel: things are as large far away as near by.
    Orthographic = 1,
    /// Rays go all around the eye: columns are longitudes, 360 degrees of them from behind by way of the left, and rows are
    /// latitudes, 180 degrees from straight up to straight down (equirectangular). The picture's middle is what the camera
    /// looks at.
    Spherical = 2,
}

impl Projection {
    /// The projections' names, as [`Projection::parse`] reads them.
    pub const NAMES: [&'static str; 3] = ["perspective", "orthographic", "spherical"];

    /// The projection of this name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::from_u32(Self::NAMES.iter().position(|known| *known == name)? as u32)
    }

    /// What [`Projection::parse`] reads.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The projection whose number (`as u32`) this is.
    #[must_use]
    pub const fn from_u32(number: u32) -> Option<Self> {
        match number {
            0 => Some(Self::Perspective),
            1 => Some(Self::Orthographic),
            2 => Some(Self::Spherical),
            _ => None,
        }
    }
}

/// A camera. Row 0 is the picture's top, column 0 its left edge. Pixels are square, but for a spherical camera's whose
/// picture is not twice as wide as high.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Camera {
    eye: [f32; 3],
    hither: f32,
    right: [f32; 3],
    /// From a pixel to the one to its right: slope, length or angle.
    pixel_across: f32,
    up: [f32; 3],
    width: u32,
    forward: [f32; 3],
    height: u32,
    lens: Lens,
    /// From a pixel to the one below: the same but for a spherical camera.
    pixel_down: f32,
    /// A [`Projection`].
    projection: u32,
}

const _: () = assert!(core::mem::size_of::<Camera>() == 88);

/// A primary ray. It stands for a disc of radius `width + t * spread` at distance `t`: what its pixel covers there (the wider
/// way across), seen from the point of the lens that it starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// The eye, a point of the lens, or of the plane through the eye for an orthographic camera.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// Distance from the origin at which the ray begins to see: where it crosses the hither plane (sphere, for a spherical
    /// camera).
    pub t_min: f32,
    /// Half a pixel's side where the ray starts: 0 unless the camera is orthographic.
    pub width: f32,
    /// Tangent of half the angle that the pixel takes up, seen from the origin: 0 for an orthographic camera. For a
    /// spherical camera it is that angle in radians, which hardly differs.
    pub spread: f32,
}

/// Why a camera cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraError {
    /// A coordinate is not finite.
    NotFinite,
    /// The eye is where it looks.
    NoView,
    /// Up is zero or lies along the view (within 1e-6 rad).
    UpAlongView,
    /// The field of view is not above 0 and below 180 degrees.
    FieldOfView,
    /// An orthographic camera's height is not above 0, or so large that places in the picture are not finite.
    Height,
    /// The hither distance is negative or not finite.
    Hither,
    /// The picture has no pixels, or more than 2^32.
    Size,
    /// The lens's radius is not 0 or more, or more than 10,000 times the distance of what is in focus, or this is not above 0.
    Lens,
    /// The lens has 1, 2 or more than [`Lens::BLADES_MAX`] blades, or their rotation is not finite.
    Blades,
    /// A lens before a camera that is not perspective.
    Lensless,
}

impl core::fmt::Display for CameraError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a camera coordinate is not a finite number",
            Self::NoView => "the camera's eye and target are the same point",
            Self::UpAlongView => "the camera's up vector is zero or parallel to its view",
            Self::FieldOfView => "the camera's field of view must be more than 0 and less than 180 degrees",
            Self::Height => "the height of an orthographic camera's picture must be more than 0, and finite",
            Self::Hither => "the camera's hither distance must be 0 or more",
            Self::Size => "the picture must have at least one pixel and at most 2^32",
            Self::Lens => {
                "the lens's radius must be 0 or more, and at most 10,000 times its focus, which must be more than 0"
            }
            Self::Blades => "a lens has 3 to 16 blades, or 0 if it is round",
            Self::Lensless => "only a perspective camera has a lens",
        })
    }
}

impl core::error::Error for CameraError {}

/// Where a camera stands and what it sees, whatever its projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Where it is.
    pub eye: Vec3,
    /// What it looks at.
    pub target: Vec3,
    /// What points up in the picture.
    pub up: Vec3,
    /// Distance along the view axis (all around, for a spherical camera) from which on things are seen.
    pub hither: f32,
    /// Columns and rows, pixels.
    pub size: [u32; 2],
}

impl Pose {
    /// A camera without a projection. The axes are right-handed: right is forward x up.
    fn camera(&self) -> Result<Camera, CameraError> {
        let Self { eye, target, up, hither, size: [width, height] } = *self;
        if ![eye, target, up].iter().all(|v| v.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        if width == 0 || height == 0 || u64::from(width) * u64::from(height) > 1 << 32 {
            return Err(CameraError::Size);
        }
        if !(hither >= 0.0 && hither.is_finite()) {
            return Err(CameraError::Hither);
        }
        // In f64, where no square of an f32 overflows or vanishes; the axes are rounded once.
        let wide = |v: Vec3| DVec3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z));
        let unit = |v: DVec3| v / libm::sqrt(v.dot(v));
        let view = wide(target) - wide(eye);
        if view == DVec3::ZERO {
            return Err(CameraError::NoView);
        }
        if up == Vec3::ZERO {
            return Err(CameraError::UpAlongView);
        }
        let forward = unit(view);
        let side = forward.cross(unit(wide(up)));
        if side.dot(side) < 1e-12 {
            return Err(CameraError::UpAlongView);
        }
        let right = unit(side);
        let up = right.cross(forward);
        let narrow = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32];
        Ok(Camera {
            eye: eye.to_array(),
            hither,
            right: narrow(right),
            up: narrow(up),
            width,
            forward: narrow(forward),
            height,
            ..Camera::default()
        })
    }
}

impl Camera {
    /// A pinhole camera at `eye` that looks at `target`, with `up` pointing up in the picture: [`Camera::perspective`] in one
    /// line.
    ///
    /// # Errors
    /// See [`CameraError`].
    pub fn look(
        eye: Vec3,
        target: Vec3,
        up: Vec3,
        fov_y_degrees: f32,
        hither: f32,
        width: u32,
        height: u32,
    ) -> Result<Self, CameraError> {
        Self::perspective(&Pose { eye, target, up, hither, size: [width, height] }, fov_y_degrees, Lens::PINHOLE)
    }

    /// A camera with a thin lens, or none. `fov_y_degrees` is the angle between the picture's top and bottom edge.
    ///
    /// # Errors
    /// See [`CameraError`].
    pub fn perspective(pose: &Pose, fov_y_degrees: f32, lens: Lens) -> Result<Self, CameraError> {
        let camera = pose.camera()?;
        let half_height = libm::tan(f64::from(fov_y_degrees) * (core::f64::consts::PI / 360.0));
        let pixel_slope = (2.0 * half_height / f64::from(camera.height)) as f32;
        if !(fov_y_degrees > 0.0 && fov_y_degrees < 180.0 && pixel_slope > 0.0) {
            return Err(CameraError::FieldOfView);
        }
        lens.check()?;
        if !(camera.eye().abs() + Vec3::splat(2.0 * lens.radius)).is_finite() {
            return Err(CameraError::Lens);
        }
        Ok(Self { pixel_across: pixel_slope, pixel_down: pixel_slope, lens, ..camera })
    }

    /// A camera of parallel rays, whose picture shows `height` (a length) from top to bottom. They start from the plane
    /// through the eye.
    ///
    /// # Errors
    /// See [`CameraError`].
    pub fn orthographic(pose: &Pose, height: f32) -> Result<Self, CameraError> {
        let camera = pose.camera()?;
        let pixel = (f64::from(height) / f64::from(camera.height)) as f32;
        // Any place in the picture, or a pixel beside it.
        let reach = pixel * (camera.width as f32 + camera.height as f32 + 4.0);
        if !(pixel > 0.0 && (camera.eye().abs() + Vec3::splat(reach)).is_finite()) {
            return Err(CameraError::Height);
        }
        Ok(Self { pixel_across: pixel, pixel_down: pixel, projection: Projection::Orthographic as u32, ..camera })
    }

    /// A camera that sees all around.
    ///
    /// # Errors
    /// See [`CameraError`].
    pub fn spherical(pose: &Pose) -> Result<Self, CameraError> {
        let camera = pose.camera()?;
        let pixel_across = (core::f64::consts::TAU / f64::from(camera.width)) as f32;
        let pixel_down = (core::f64::consts::PI / f64::from(camera.height)) as f32;
        Ok(Self { pixel_across, pixel_down, projection: Projection::Spherical as u32, ..camera })
    }

    /// The ray of one of a pixel's `spp` samples: where `filter` puts it ([`sample_offset`]), and through its own point of the
    /// lens. Points of the lens are stratified as offsets are, in another order, so that the two have nothing to do with
    /// each other; a single sample goes through any point of the lens, and the middle of the pixel.
    #[inline]
    #[must_use]
    pub fn sample(&self, filter: Filter, seed: u64, [x, y]: [u32; 2], sample: u32, spp: u32) -> CameraRay {
        // Wrapping: a picture of 2^32 pixels has as many numbers as there are, and what lies beyond is not asked for.
        let pixel_id = id::pixel_id(seed, y.wrapping_mul(self.width).wrapping_add(x));
        let offset = sample_offset(filter, pixel_id, sample, spp);
        if self.lens.radius > 0.0 {
            self.through_lens([x, y], offset, pixel_id, sample, spp)
        } else {
            self.ray(x, y, offset)
        }
    }

    /// The sample's ray through its point of the lens.
    #[inline(never)]
    fn through_lens(&self, [x, y]: [u32; 2], offset: [f32; 2], pixel_id: u64, sample: u32, spp: u32) -> CameraRay {
        let turn = permuted(sample, spp, id::child_id(pixel_id, 1));
        let u = stratified(id::child_id(pixel_id, 0), turn, spp);
        self.ray_through(self.place(x, y, offset), self.lens.point(u))
    }

    /// The ray through a pixel, and the middle of the lens. `offset` is in pixels from the pixel's centre: right, and down.
    #[inline]
    #[must_use]
    pub fn ray(&self, x: u32, y: u32, offset: [f32; 2]) -> CameraRay {
        let place = self.place(x, y, offset);
        match self.projection {
            0 => self.ray_to(self.eye(), place),
            1 => self.parallel(place),
            _ => self.around(place),
        }
    }

    /// Rays around those of the pixels from `first` (column, row) to `last`, with any offset from 0 to 1 and from anywhere
    /// on the lens: four planes around these contain the others. 16 with a lens, 6 if the camera is spherical, else 4; none
    /// where a spherical camera's pixels are half a circle or more, since no planes contain those.
    pub fn outermost(&self, first: [u32; 2], last: [u32; 2]) -> impl Iterator<Item = CameraRay> + Clone + use<> {
        let camera = *self;
        let low = self.place(first[0], first[1], [0.0; 2]);
        let high = self.place(last[0], last[1], [1.0; 2]);
        let wide = high[0] - low[0];
        let count = match self.projection {
            0 if self.lens.radius > 0.0 => 16,
            0 | 1 => 4,
            _ if wide < core::f32::consts::PI => 6,
            _ => 0,
        };
        (0..count).map(move |i: u32| {
            let end = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
            let corner = [end(0, low[0], high[0]), end(1, low[1], high[1])];
            let radius = camera.lens.radius;
            match camera.projection {
                0 if radius > 0.0 => camera.ray_through(corner, [end(2, -radius, radius), end(3, -radius, radius)]),
                0 => camera.ray_to(camera.eye(), corner),
                1 => camera.parallel(corner),
                _ if i < 4 => camera.around(corner),
                _ => {
                    // A parallel is no straight line: it lies between the great circle through its ends and those that touch
                    // it there, which meet here.
                    let latitude = end(0, low[1], high[1]);
                    let meet = libm::atanf(libm::tanf(latitude) * libm::cosf(0.5 * wide));
                    camera.around([0.5 * (low[0] + high[0]), meet])
                }
            }
        })
    }

    /// A point of the picture, right and up of its middle: slopes, lengths, or longitude and latitude. Grows with `x` and
    /// with `offset[0]`, falls with `y` and with `offset[1]`, in rounded arithmetic too.
    #[inline]
    fn place(&self, x: u32, y: u32, offset: [f32; 2]) -> [f32; 2] {
        let right = from_middle(x, self.width) + offset[0];
        let down = from_middle(y, self.height) + offset[1];
        [right * self.pixel_across, -(down * self.pixel_down)]
    }

    /// From `origin`, as far right and up as this for each unit forward.
    #[inline]
    fn ray_to(&self, origin: Vec3, [across, above]: [f32; 2]) -> CameraRay {
        let (right, up, forward) = self.axes();
        let along = forward + right * across + up * above;
        let length = libm::sqrtf(along.dot(along));
        CameraRay {
            origin,
            direction: along / length,
            t_min: self.hither * length,
            width: 0.0,
            spread: 0.5 * self.pixel_across / length,
        }
    }

    /// Half the width of what a primary ray along `direction` (unit) stands for: where it starts, and what is added with each unit
    /// of its way, as [`CameraRay::width`] and [`CameraRay::spread`].
    #[must_use]
    pub fn footprint(&self, direction: Vec3) -> [f32; 2] {
        let (_, up, forward) = self.axes();
        match self.projection {
            0 => [0.0, 0.5 * self.pixel_across * direction.dot(forward)],
            1 => [0.5 * self.pixel_across, 0.0],
            _ => {
                let sine = direction.dot(up);
                let across = self.pixel_across * libm::sqrtf((1.0 - sine * sine).max(0.0));
                [0.0, 0.5 * if across > self.pixel_down { across } else { self.pixel_down }]
            }
        }
    }

    /// Through a point of the lens, right and up of its middle, to where the ray through the middle is in focus.
    fn ray_through(&self, [across, above]: [f32; 2], [right, up]: [f32; 2]) -> CameraRay {
        let (x, y, _) = self.axes();
        let focus = self.lens.focus;
        self.ray_to(self.eye() + x * right + y * up, [across - right / focus, above - up / focus])
    }

    /// Forward, from so far right and up of the eye.
    #[inline(never)]
    fn parallel(&self, [across, above]: [f32; 2]) -> CameraRay {
        let (right, up, forward) = self.axes();
        CameraRay {
            origin: self.eye() + right * across + up * above,
            direction: forward,
            t_min: self.hither,
            width: 0.5 * self.pixel_across,
            spread: 0.0,
        }
    }

    /// Towards a longitude, right of forward, and a latitude, radians. Beyond a pole it comes down on the other side.
    #[inline(never)]
    fn around(&self, [longitude, latitude]: [f32; 2]) -> CameraRay {
        let (right, up, forward) = self.axes();
        let (sine, cosine) = libm::sincosf(latitude);
        let (aside, ahead) = libm::sincosf(longitude);
        let along = forward * (cosine * ahead) + right * (cosine * aside) + up * sine;
        let across = self.pixel_across * cosine.abs();
        CameraRay {
            origin: self.eye(),
            direction: along / libm::sqrtf(along.dot(along)),
            t_min: self.hither,
            width: 0.0,
            spread: 0.5 * if across > self.pixel_down { across } else { self.pixel_down },
        }
    }

    /// Unit vectors: right, up, forward.
    #[must_use]
    pub fn axes(&self) -> (Vec3, Vec3, Vec3) {
        (Vec3::from(self.right), Vec3::from(self.up), Vec3::from(self.forward))
    }

    fn eye(&self) -> Vec3 {
        Vec3::from(self.eye)
    }
}

/// Distance of a pixel's centre from the middle of its row or column, pixels; exact up to 2^24 pixels.
fn from_middle(index: u32, count: u32) -> f32 {
    0.5 * (2 * i64::from(index) + 1 - i64::from(count)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    fn camera() -> Camera {
        Camera::look(Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, -7.0), Vec3::Y, 90.0, 0.5, 4, 2).unwrap()
    }

    #[test]
    fn corners_of_a_picture() {
        // 90 degrees over two rows: the picture spans slopes of 1 up and down, 2 left and right.
        let camera = camera();
        assert_eq!(camera.axes(), (Vec3::X, Vec3::Y, Vec3::NEG_Z));
        assert_eq!(camera.place(0, 0, [-0.5, -0.5]), [-2.0, 1.0]);
        assert_eq!(camera.place(3, 1, [0.5, 0.5]), [2.0, -1.0]);
        assert_eq!(camera.place(0, 0, [0.0, 0.0]), [-1.5, 0.5]);
        assert_eq!(camera.place(2, 1, [-0.5, -0.5]), [0.0, 0.0]);
        let centre = camera.ray(2, 1, [-0.5, -0.5]);
        assert_eq!(centre.origin, Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(centre.direction, Vec3::NEG_Z);
        assert_eq!(centre.t_min, 0.5);
        assert_eq!(centre.spread, 0.5);
    }

    #[test]
    fn rays_are_unit_and_start_on_the_hither_plane() {
        let camera =
            Camera::look(Vec3::new(3.0, -1.0, 2.0), Vec3::new(-5.0, 4.0, 1.0), Vec3::Z, 37.0, 1.25, 64, 48).unwrap();
        let (right, up, forward) = camera.axes();
        assert!((right.cross(up) + forward).abs().max_element() < 1e-6, "right x up points at the viewer");
        assert!(up.z > 0.9);
        let half = libm::tan(37.0 / 360.0 * core::f64::consts::PI);
        for y in 0..48 {
            for x in 0..64 {
                let ray = camera.ray(x, y, [0.25, -0.5]);
                let wide = |v: Vec3| v.to_array().map(f64::from);
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let d = wide(ray.direction);
                assert!((dot(d, d) - 1.0).abs() < 3e-7);
                let cosine = dot(d, wide(forward));
                assert!((f64::from(ray.t_min) * cosine - 1.25).abs() < 1e-6);
                // Slopes from the definition: the picture's edges are `half` away in y, and pixels are square.
                let expected_x = (f64::from(x) + 0.75 - 32.0) / 24.0 * half;
                let expected_y = (24.0 - f64::from(y)) / 24.0 * half;
                assert!((dot(d, wide(right)) / cosine - expected_x).abs() < 1e-6, "{x} {y}");
                assert!((dot(d, wide(up)) / cosine - expected_y).abs() < 1e-6, "{x} {y}");
            }
        }
    }

    #[test]
    fn spread_covers_half_a_pixel() {
        let camera = Camera::look(Vec3::ZERO, Vec3::X, Vec3::Z, 60.0, 0.0, 100, 80).unwrap();
        for (x, y) in [(0, 0), (50, 40), (99, 3), (10, 79)] {
            let middle = camera.ray(x, y, [0.0; 2]);
            for offset in [[0.5, 0.0], [0.0, 0.5], [-0.5, 0.0], [0.0, -0.5]] {
                let d = camera.ray(x, y, offset).direction;
                let tangent = d.cross(middle.direction).dot(d.cross(middle.direction)).sqrt() / d.dot(middle.direction);
                assert!(tangent < middle.spread * 1.01 && tangent > middle.spread * 0.6, "{tangent} {middle:?}");
            }
        }
    }

    #[test]
    fn corner_slopes_bound_all_samples() {
        let camera = Camera::look(Vec3::ZERO, Vec3::X, Vec3::Z, 51.3, 0.0, 1000, 700).unwrap();
        for tile in 0..50u32 {
            let (x0, y0) = (tile * 19, tile * 13);
            let low = camera.place(x0, y0 + 7, [-1.5, 1.5]);
            let high = camera.place(x0 + 7, y0, [1.5, -1.5]);
            for i in 0..2000u32 {
                let [u, v] = crate::id::unit_pair(5, i);
                let slope = camera.place(x0 + i % 8, y0 + i / 8 % 8, [3.0 * u - 1.5, 3.0 * v - 1.5]);
                assert!((0..2).all(|a| low[a] <= slope[a] && slope[a] <= high[a]), "{low:?} {slope:?} {high:?}");
            }
        }
    }

    fn check_error(change: impl Fn(&mut (Vec3, Vec3, Vec3, f32, f32, u32, u32)), expected: CameraError) {
        let mut a = (Vec3::ZERO, Vec3::X, Vec3::Z, 45.0, 0.0, 16, 16);
        assert!(Camera::look(a.0, a.1, a.2, a.3, a.4, a.5, a.6).is_ok());
        change(&mut a);
        assert_eq!(Camera::look(a.0, a.1, a.2, a.3, a.4, a.5, a.6), Err(expected));
        assert!(!expected.to_string().is_empty());
    }

    #[test]
    fn bad_cameras_are_refused() {
        check_error(|a| a.1 = a.0, CameraError::NoView);
        check_error(|a| a.2 = Vec3::X * -3.0, CameraError::UpAlongView);
        check_error(|a| a.2 = Vec3::new(1.0, 1e-8, 0.0), CameraError::UpAlongView);
        check_error(|a| a.2 = Vec3::ZERO, CameraError::UpAlongView);
        check_error(|a| a.3 = 0.0, CameraError::FieldOfView);
        check_error(|a| a.3 = -10.0, CameraError::FieldOfView);
        check_error(|a| a.3 = 180.0, CameraError::FieldOfView);
        check_error(|a| a.3 = 190.0, CameraError::FieldOfView);
        check_error(|a| a.3 = f32::NAN, CameraError::FieldOfView);
        check_error(|a| a.3 = 1e-45, CameraError::FieldOfView);
        check_error(|a| a.4 = -1.0, CameraError::Hither);
        check_error(|a| a.4 = f32::INFINITY, CameraError::Hither);
        check_error(|a| a.5 = 0, CameraError::Size);
        check_error(|a| a.6 = 0, CameraError::Size);
        check_error(|a| (a.5, a.6) = (65_537, 65_537), CameraError::Size);
        check_error(|a| a.0.y = f32::NAN, CameraError::NotFinite);
        check_error(|a| a.2.y = f32::INFINITY, CameraError::NotFinite);
    }

    #[test]
    fn extreme_cameras_give_unit_rays() {
        for (eye, target, fov, width) in [
            (Vec3::splat(1e38), Vec3::splat(-1e38), 45.0, 16),
            (Vec3::ZERO, Vec3::new(1e-44, 0.0, 0.0), 45.0, 16),
            (Vec3::ZERO, Vec3::X, 179.999, 1 << 20),
            (Vec3::ZERO, Vec3::X, 1e-30, 16),
        ] {
            let camera = Camera::look(eye, target, Vec3::Z, fov, 0.0, width, 16).unwrap();
            let d = camera.ray(0, 0, [0.0; 2]).direction;
            assert!((d.dot(d) - 1.0).abs() < 1e-6, "{eye} {target} {fov}: {d}");
        }
        // Lenses and parallel rays at the edge of what is allowed.
        let pose = Pose { eye: Vec3::splat(1e38), ..pose([1 << 16, 16]) };
        let lens = Lens { radius: 1e38, focus: 1e34, blades: 5, rotation_degrees: 1e30 };
        let camera = Camera::perspective(&pose, 179.999, lens).unwrap();
        let parallel = Camera::orthographic(&pose, 1e34).unwrap();
        let tiny = Camera::perspective(&pose, 1e-30, Lens { radius: 1e-40, focus: 1e-40, ..lens }).unwrap();
        let around = Camera::spherical(&Pose { size: [1, 1], ..pose }).unwrap();
        for sample in 0..64 {
            for camera in [camera, parallel, tiny, around] {
                let ray = camera.sample(Filter::Gaussian, 3, [0, 15], sample, 64);
                let d = ray.direction;
                assert!((d.dot(d) - 1.0).abs() < 1e-6 && ray.origin.is_finite(), "{camera:?}: {ray:?}");
                assert!(ray.t_min >= 0.0 && ray.width >= 0.0 && ray.spread >= 0.0, "{camera:?}: {ray:?}");
            }
        }
    }

    fn pose(size: [u32; 2]) -> Pose {
        Pose { eye: Vec3::new(0.3, -4.0, 1.5), target: Vec3::new(-1.0, 2.0, 0.5), up: Vec3::Z, hither: 0.25, size }
    }

    fn wide(v: Vec3) -> DVec3 {
        v.as_dvec3()
    }

    /// The axes of a pose by its definition, in `f64`.
    fn axes(pose: &Pose) -> [DVec3; 3] {
        let forward = (wide(pose.target) - wide(pose.eye)).normalize();
        let right = forward.cross(wide(pose.up)).normalize();
        [right, right.cross(forward), forward]
    }

    #[test]
    fn orthographic_rays_are_parallel_and_a_pixel_apart() {
        let pose = pose([30, 20]);
        let camera = Camera::orthographic(&pose, 4.0).unwrap();
        let [right, up, forward] = axes(&pose);
        for (x, y) in (0..30).flat_map(|x| (0..20).map(move |y| (x, y))) {
            let ray = camera.ray(x, y, [0.0; 2]);
            assert!((wide(ray.direction) - forward).length() < 1e-7);
            let place = right * ((f64::from(x) + 0.5) * 0.2 - 3.0) + up * (2.0 - (f64::from(y) + 0.5) * 0.2);
            assert!((wide(ray.origin) - wide(pose.eye) - place).length() < 1e-6, "{x} {y}: {ray:?}");
            assert_eq!((ray.direction, ray.t_min), (camera.ray(0, 0, [0.5; 2]).direction, 0.25));
            assert_eq!((ray.width, ray.spread), (0.1, 0.0), "half a pixel, everywhere");
        }
        // Where axes and sizes are exact, so are rays.
        let exact = Pose { eye: Vec3::new(0.5, 1.0, 8.0), target: Vec3::new(0.5, 1.0, 0.0), up: Vec3::Y, ..pose };
        let camera = Camera::orthographic(&Pose { size: [8, 4], ..exact }, 1.0).unwrap();
        assert_eq!(camera.ray(0, 0, [0.0; 2]).origin, Vec3::new(-0.375, 1.375, 8.0));
        assert_eq!(camera.ray(7, 3, [0.0; 2]).origin, Vec3::new(1.375, 0.625, 8.0));
        assert_eq!(camera.ray(4, 2, [-0.5; 2]).origin, exact.eye);
    }

    #[test]
    fn spherical_rays_go_all_around() {
        let pose = pose([64, 32]);
        let camera = Camera::spherical(&pose).unwrap();
        let [right, up, forward] = axes(&pose);
        for (x, y) in (0..64).flat_map(|x| (0..32).map(move |y| (x, y))) {
            for offset in [[0.0, 0.0], [0.5, -0.5], [-1.0, 1.5]] {
                let ray = camera.ray(x, y, offset);
                let longitude = (f64::from(x) + 0.5 + f64::from(offset[0]) - 32.0) / 64.0 * core::f64::consts::TAU;
                let latitude = (16.0 - f64::from(y) - 0.5 - f64::from(offset[1])) / 32.0 * core::f64::consts::PI;
                let level = forward * libm::cos(longitude) + right * libm::sin(longitude);
                let expected = level * libm::cos(latitude) + up * libm::sin(latitude);
                assert!((wide(ray.direction) - expected).length() < 1e-6, "{x} {y} {offset:?}: {ray:?}");
                assert!((ray.direction.length() - 1.0).abs() < 3e-7);
                assert_eq!((ray.origin, ray.t_min, ray.width), (pose.eye, 0.25, 0.0));
            }
        }
        // A pixel is as wide as high in a picture of this shape, but for where longitudes meet.
        let half = core::f32::consts::PI / 64.0;
        assert!((0..32).all(|y| (camera.ray(5, y, [0.0; 2]).spread - half).abs() < 1e-7));
        let narrow = Camera::spherical(&Pose { size: [16, 32], ..pose }).unwrap();
        let (level, pole) = (narrow.ray(5, 16, [0.0; 2]).spread, narrow.ray(5, 0, [0.0; 2]).spread);
        assert!((level - 4.0 * half).abs() < 0.01 * half && (pole - half).abs() < 1e-7, "{level} {pole}");
    }

    /// Two thin-lens facts: whatever the point of the lens, the ray meets what the pinhole's ray meets at the distance of
    /// focus; and at another distance d its rays fill a spot of the radius |d - focus| / focus times the lens's.
    #[test]
    fn lens_rays_meet_in_focus_and_spread_beside_it() {
        let pose = pose([40, 30]);
        let lens = Lens { radius: 0.2, focus: 5.0, blades: 0, rotation_degrees: 0.0 };
        let (pinhole, camera) =
            (Camera::perspective(&pose, 40.0, Lens::PINHOLE).unwrap(), Camera::perspective(&pose, 40.0, lens).unwrap());
        let [right, up, forward] = axes(&pose);
        let at = |ray: &CameraRay, depth: f64| {
            let (o, d) = (wide(ray.origin) - wide(pose.eye), wide(ray.direction));
            let p = o + d * ((depth - o.dot(forward)) / d.dot(forward));
            [p.dot(right), p.dot(up)]
        };
        let spp = 256;
        for (x, y) in [(0, 0), (20, 15), (39, 3)] {
            for depth in [2.0f64, 5.0, 12.0] {
                let blur = (depth - 5.0).abs() / 5.0 * 0.2;
                let (mut largest, mut square, mut middle) = (0.0f64, 0.0, [0.0; 2]);
                for sample in 0..spp {
                    let key = id::pixel_id(9, y * 40 + x);
                    let offset = sample_offset(Filter::Box, key, sample, spp);
                    let ray = camera.sample(Filter::Box, 9, [x, y], sample, spp);
                    let through = pinhole.ray(x, y, offset);
                    let off = wide(ray.origin) - wide(pose.eye);
                    assert!(off.dot(forward).abs() < 1e-6 && off.length() < 0.2000001);
                    assert!((ray.direction.length() - 1.0).abs() < 3e-7 && ray.width == 0.0);
                    let cosine = wide(ray.direction).dot(forward);
                    assert!((f64::from(ray.t_min) * cosine - 0.25).abs() < 1e-6);
                    // Half a pixel at focus, seen from there.
                    let pixel = 5.0 * libm::tan(20f64.to_radians()) / 30.0;
                    assert!((f64::from(ray.spread) * 5.0 / cosine - pixel).abs() < 1e-6);
                    let (a, b) = (at(&ray, depth), at(&through, depth));
                    let [h, v] = [a[0] - b[0], a[1] - b[1]];
                    largest = largest.max(libm::sqrt(h * h + v * v));
                    square += h * h + v * v;
                    middle = [middle[0] + h, middle[1] + v];
                }
                // A disc's mean square is half of its radius's.
                let n = f64::from(spp);
                assert!(largest <= blur + 1e-5 && largest >= 0.95 * blur, "{x} {y}, {depth}: {largest} of {blur}");
                assert!((square / n - 0.5 * blur * blur).abs() <= 0.02 * blur * blur + 1e-10, "{depth}: {square}");
                assert!(middle.iter().all(|m| (m / n).abs() <= 0.02 * blur + 1e-5), "{depth}: {middle:?}");
            }
        }
    }

    /// Where a sample lies in its pixel says nothing of where it lies on the lens, and a pixel's samples cover both.
    #[test]
    fn places_in_the_pixel_and_on_the_lens_are_independent() {
        let pose = pose([64, 64]);
        let lens = Lens { radius: 0.5, focus: 3.0, blades: 0, rotation_degrees: 0.0 };
        let camera = Camera::perspective(&pose, 40.0, lens).unwrap();
        let (right, up, _) = camera.axes();
        for spp in [2u32, 4, 9, 16] {
            let (mut bins, mut count) = ([[0u32; 16]; 4], 0);
            for pixel in 0..4096 {
                for sample in 0..spp {
                    let offset = sample_offset(Filter::Box, id::pixel_id(0, pixel), sample, spp);
                    let ray = camera.sample(Filter::Box, 0, [pixel % 64, pixel / 64], sample, spp);
                    let on_lens = ray.origin - pose.eye;
                    let place = [on_lens.dot(right), on_lens.dot(up)];
                    for (pair, bins) in bins.iter_mut().enumerate() {
                        let quarter = |v: f32| (v * 4.0).clamp(0.0, 3.0) as usize;
                        // Halves and quarters of a disc by area are enough to see a pattern: by sign and by size.
                        let lens_bin = usize::from(place[pair & 1] > 0.0) * 2
                            + usize::from(place[pair & 1].abs() > 0.5 * 0.403_972_75);
                        bins[quarter(offset[pair >> 1] + 0.5) * 4 + lens_bin] += 1;
                    }
                    count += 1;
                }
            }
            // A strip beyond 0.40397 of a disc's radius is a quarter of it. 9 degrees of freedom beyond the margins' six:
            // 15 in all; a deviation is 5.5.
            let expected = f64::from(count) / 16.0;
            for bins in bins {
                let chi: f64 = bins.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
                assert!(chi < 45.0, "{spp}: {chi} {bins:?}");
            }
        }
    }

    /// Every sample of a tile lies between the planes around its outermost rays.
    #[test]
    fn outermost_rays_contain_the_samples_of_a_tile() {
        let lens = Lens { radius: 0.3, focus: 4.0, blades: 5, rotation_degrees: 12.0 };
        let pose = pose([200, 100]);
        let pinhole = Camera::perspective(&pose, 80.0, Lens::PINHOLE).unwrap();
        let cameras = [
            (pinhole, 4),
            (Camera::perspective(&pose, 80.0, lens).unwrap(), 16),
            (Camera::orthographic(&pose, 3.0).unwrap(), 4),
            (Camera::spherical(&pose).unwrap(), 6),
        ];
        for (camera, rays) in cameras {
            let mut none = 0;
            for [x, y, side] in (0..400u32).map(|i| [i * 37 % 180, i * 53 % 90, 4 + i % 13]) {
                let last = [(x + side).min(199), (y + side).min(99)];
                let outermost = camera.outermost([x, y], last);
                assert_eq!(outermost.clone().count(), rays);
                let ray = |seen: CameraRay| hybray_geometry::Ray {
                    origin: seen.origin,
                    direction: seen.direction,
                    t_min: seen.t_min,
                    t_max: f32::INFINITY,
                };
                let Some(bundle) = hybray_geometry::Bundle::around(outermost.map(ray), 64.0) else {
                    none += 1;
                    continue;
                };
                for i in 0..200u32 {
                    let [u, v] = id::unit_pair(5, i);
                    let [x, y] = [x + i % (last[0] - x + 1), y + i / 7 % (last[1] - y + 1)];
                    let mut seen = camera.ray(x, y, [u, v]);
                    if camera.lens.radius > 0.0 {
                        seen = camera.ray_through(camera.place(x, y, [u, v]), camera.lens.point(id::unit_pair(6, i)));
                    }
                    for t in [0.25, 1.0, 8.0, 60.0] {
                        let p = seen.origin + seen.direction * t;
                        let aabb = hybray_geometry::Aabb { lo: p, hi: p };
                        assert!(bundle.meets_box(&aabb), "{camera:?} {x} {y} {u} {v} {t}");
                    }
                }
            }
            // Near a pole a few pixels are most of the way around.
            assert!(none < 400 * usize::from(rays == 6) / 10 + 1, "{camera:?}: {none}");
        }
        let around = Camera::spherical(&Pose { size: [16, 8], ..pose }).unwrap();
        assert_eq!(around.outermost([0, 0], [7, 7]).count(), 0, "half a circle, and a pixel");
        assert_eq!(around.outermost([0, 0], [6, 7]).count(), 6);
    }

    /// What a ray stands for is found again by its direction.
    #[test]
    fn footprints_are_those_of_rays() {
        let pose = pose([30, 40]);
        let lens = Lens { radius: 0.3, focus: 4.0, blades: 5, rotation_degrees: 12.0 };
        let perspective = Camera::perspective(&pose, 80.0, lens).unwrap();
        for camera in [perspective, Camera::orthographic(&pose, 3.0).unwrap(), Camera::spherical(&pose).unwrap()] {
            for (x, y) in (0..30).flat_map(|x| (0..40).map(move |y| (x, y))) {
                let ray = camera.sample(Filter::Tent, 4, [x, y], 1, 3);
                let [width, spread] = camera.footprint(ray.direction);
                assert_eq!(width, ray.width);
                assert!((spread - ray.spread).abs() <= 1e-4 * ray.spread, "{camera:?} {x} {y}: {spread} {ray:?}");
            }
        }
    }

    #[test]
    fn bad_lenses_and_projections_are_refused() {
        let lens = Lens { radius: 0.1, focus: 2.0, blades: 6, rotation_degrees: 30.0 };
        let check = |lens: Lens, expected: Result<(), CameraError>| {
            assert_eq!(Camera::perspective(&pose([4, 4]), 40.0, lens).map(|_| ()), expected, "{lens:?}");
        };
        check(lens, Ok(()));
        check(Lens { radius: 0.0, focus: 0.0, ..lens }, Ok(()));
        for (radius, focus) in [
            (-0.1, 2.0),
            (f32::NAN, 2.0),
            (f32::INFINITY, 2.0),
            (0.1, 0.0),
            (0.1, -2.0),
            (0.1, f32::NAN),
            (0.1, f32::INFINITY),
            (1.1, 1e-4),
            (3e38, 3e38),
        ] {
            check(Lens { radius, focus, ..lens }, Err(CameraError::Lens));
        }
        for blades in [1, 2, 17, u32::MAX] {
            check(Lens { blades, ..lens }, Err(CameraError::Blades));
        }
        for rotation_degrees in [f32::NAN, f32::INFINITY] {
            check(Lens { rotation_degrees, ..lens }, Err(CameraError::Blades));
        }
        for height in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-45, 3e38] {
            let camera = Camera::orthographic(&pose([4, 4]), height);
            assert_eq!(camera, Err(CameraError::Height), "{height}");
        }
        assert_eq!(Camera::spherical(&pose([0, 4])), Err(CameraError::Size));
        assert_eq!(Projection::from_u32(3), None);
        assert_eq!(Projection::parse("fisheye"), None);
        for projection in [Projection::Perspective, Projection::Orthographic, Projection::Spherical] {
            assert_eq!(Projection::from_u32(projection as u32), Some(projection));
            assert_eq!(Projection::parse(projection.name()), Some(projection));
        }
    }
}
