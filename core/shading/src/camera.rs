//! A pinhole camera: pixels to rays.
//!
//! A pixel is first mapped to two slopes, how far right and up a ray goes for each unit forward. The mapping of each
//! axis is monotone in `f32` too, so the slopes at a tile's corners, with the pixel filter's radius as offset, bound
//! the slopes of every sample in it without any margin.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// A pinhole camera with square pixels. Row 0 is the picture's top, column 0 its left edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Camera {
    eye: [f32; 3],
    hither: f32,
    right: [f32; 3],
    pixel_slope: f32,
    up: [f32; 3],
    width: u32,
    forward: [f32; 3],
    height: u32,
}

const _: () = assert!(core::mem::size_of::<Camera>() == 64);

/// A primary ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// The eye.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// Distance from the eye at which the ray begins to see: where it crosses the hither plane.
    pub t_min: f32,
    /// Tangent of half the angle that the pixel takes up, seen from the eye (the wider way across): at distance `t`
    /// the ray stands for a disc of radius `t * spread`.
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
    /// The hither distance is negative or not finite.
    Hither,
    /// The picture has no pixels, or more than 2^32.
    Size,
}

impl core::fmt::Display for CameraError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a camera coordinate is not a finite number",
            Self::NoView => "the camera's eye and target are the same point",
            Self::UpAlongView => "the camera's up vector is zero or parallel to its view",
            Self::FieldOfView => "the camera's field of view must be more than 0 and less than 180 degrees",
            Self::Hither => "the camera's hither distance must be 0 or more",
            Self::Size => "the picture must have at least one pixel and at most 2^32",
        })
    }
}

impl core::error::Error for CameraError {}

impl Camera {
    /// A camera at `eye` that looks at `target`, with `up` pointing up in the picture.
    ///
    /// `fov_y_degrees` is the angle between the picture's top and bottom edge; `hither` the distance along the view
    /// axis from which on things are seen; `width` and `height` are in pixels. The axes are right-handed: right is
    /// forward x up.
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
        let half_height = libm::tan(f64::from(fov_y_degrees) * (core::f64::consts::PI / 360.0));
        let pixel_slope = (2.0 * half_height / f64::from(height)) as f32;
        if !(fov_y_degrees > 0.0 && fov_y_degrees < 180.0 && pixel_slope > 0.0) {
            return Err(CameraError::FieldOfView);
        }
        let narrow = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32];
        Ok(Self {
            eye: eye.to_array(),
            hither,
            right: narrow(right),
            pixel_slope,
            up: narrow(up),
            width,
            forward: narrow(forward),
            height,
        })
    }

    /// The ray through a pixel. `offset` is in pixels from the pixel's centre: right, and down.
    #[must_use]
    pub fn ray(&self, x: u32, y: u32, offset: [f32; 2]) -> CameraRay {
        let [across, above] = self.slope(x, y, offset);
        let (right, up, forward) = self.axes();
        let along = forward + right * across + up * above;
        let length = libm::sqrtf(along.dot(along));
        CameraRay {
            origin: self.eye(),
            direction: along / length,
            t_min: self.hither * length,
            spread: 0.5 * self.pixel_slope / length,
        }
    }

    /// Half the width of what a primary ray along `direction` (unit) stands for: where it starts, and what is added with each unit
    /// of its way, as [`CameraRay::spread`].
    #[must_use]
    pub fn footprint(&self, direction: Vec3) -> [f32; 2] {
        [0.0, 0.5 * self.pixel_slope * direction.dot(Vec3::from(self.forward))]
    }

    /// How far the ray through a pixel goes right and up for each unit forward. Grows with `x` and with `offset[0]`,
    /// falls with `y` and with `offset[1]`, in rounded arithmetic too.
    #[must_use]
    pub fn slope(&self, x: u32, y: u32, offset: [f32; 2]) -> [f32; 2] {
        let right = from_middle(x, self.width) + offset[0];
        let down = from_middle(y, self.height) + offset[1];
        [right * self.pixel_slope, -(down * self.pixel_slope)]
    }

    /// Slope from one pixel to the next.
    #[must_use]
    pub fn pixel_slope(&self) -> f32 {
        self.pixel_slope
    }

    /// Unit vectors: right, up, forward.
    #[must_use]
    pub fn axes(&self) -> (Vec3, Vec3, Vec3) {
        (Vec3::from(self.right), Vec3::from(self.up), Vec3::from(self.forward))
    }

    /// Where all rays start.
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        Vec3::from(self.eye)
    }

    /// Distance along the view axis from which on things are seen.
    #[must_use]
    pub fn hither(&self) -> f32 {
        self.hither
    }

    /// Width and height of the picture, pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
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
        assert_eq!(camera.slope(0, 0, [-0.5, -0.5]), [-2.0, 1.0]);
        assert_eq!(camera.slope(3, 1, [0.5, 0.5]), [2.0, -1.0]);
        assert_eq!(camera.slope(0, 0, [0.0, 0.0]), [-1.5, 0.5]);
        assert_eq!(camera.slope(2, 1, [-0.5, -0.5]), [0.0, 0.0]);
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
            let low = camera.slope(x0, y0 + 7, [-1.5, 1.5]);
            let high = camera.slope(x0 + 7, y0, [1.5, -1.5]);
            for i in 0..2000u32 {
                let [u, v] = crate::id::unit_pair(5, i);
                let slope = camera.slope(x0 + i % 8, y0 + i / 8 % 8, [3.0 * u - 1.5, 3.0 * v - 1.5]);
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
    }
}
