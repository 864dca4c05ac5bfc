//! A thin lens: a round or many-sided opening, and the distance of what is sharp.

use crate::CameraError;
use bytemuck::{Pod, Zeroable};

/// An opening around the eye, across the view. Whatever lies in the plane at the distance `focus` is sharp; a point at the
/// distance `d` becomes a spot as wide as `2 radius |d - focus| / d` at that plane (Potmesil and Chakravarty, *A Lens and
/// Aperture Camera Model for Synthetic Image Generation*, 1981), of the opening's shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Lens {
    /// Of the circle that the opening fills or that its corners lie on; 0 for a pinhole.
    pub radius: f32,
    /// Distance along the view axis of what is sharp; not looked at if there is no opening.
    pub focus: f32,
    /// Sides of the opening, 3 to 16; 0 if it is round.
    pub blades: u32,
    /// How far the opening is turned counterclockwise, as the camera sees; at 0 a corner is on the right.
    pub rotation_degrees: f32,
}

impl Lens {
    /// None: everything is sharp.
    pub const PINHOLE: Self = Self { radius: 0.0, focus: 1.0, blades: 0, rotation_degrees: 0.0 };
    /// Sides at most.
    pub const BLADES_MAX: u32 = 16;

    /// Whether there can be such a lens.
    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let Self { radius, focus, blades, rotation_degrees } = *self;
        if !(radius == 0.0 || radius > 0.0 && focus > 0.0 && focus.is_finite() && radius / focus <= 10_000.0) {
            return Err(CameraError::Lens);
        }
        if !(blades == 0 || (3..=Self::BLADES_MAX).contains(&blades)) || !rotation_degrees.is_finite() {
            return Err(CameraError::Blades);
        }
        Ok(())
    }

    /// The point of the opening, right and up of its middle, for a point of the unit square. Equal areas become equal
    /// areas, so that it is uniform if `u` is, and even if `u` is. Round: the concentric map of Shirley and Chiu, *A Low
    /// Distortion Map Between Disk and Square*, 1997.
    #[must_use]
    pub fn point(&self, u: [f32; 2]) -> [f32; 2] {
        let [x, y] = if self.blades == 0 { concentric(u) } else { self.polygon(u) };
        [self.radius * x, self.radius * y]
    }

    /// Of the opening with corners on the unit circle: of one of its triangles with the middle.
    fn polygon(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        use core::f32::consts::{PI, TAU};
        let sides = self.blades as f32;
        let place = u * sides;
        let side = (place as u32).min(self.blades - 1) as f32;
        let corner = |number: f32| {
            let (sine, cosine) = libm::sincosf(TAU * (number / sides) + self.rotation_degrees % 360.0 * (PI / 180.0));
            [cosine, sine]
        };
        let (a, b) = (corner(side), corner(side + 1.0));
        // The area of a triangle goes with the square of its size.
        let (size, along) = (libm::sqrtf(v), place - side);
        [0, 1].map(|i| size * (a[i] * (1.0 - along) + b[i] * along))
    }
}

/// Of the unit disc.
fn concentric(u: [f32; 2]) -> [f32; 2] {
    use core::f32::consts::FRAC_PI_4;
    let [a, b] = u.map(|u| 2.0 * u - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0; 2];
    }
    let (radius, sine, cosine) = if a.abs() > b.abs() {
        let (sine, cosine) = libm::sincosf(FRAC_PI_4 * (b / a));
        (a, sine, cosine)
    } else {
        let (cosine, sine) = libm::sincosf(FRAC_PI_4 * (a / b));
        (b, sine, cosine)
    };
    [radius * cosine, radius * sine]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(blades: u32, rotation_degrees: f32) -> Lens {
        Lens { radius: 1.0, focus: 1.0, blades, rotation_degrees }
    }

    /// Where `point` lies in the opening, as two numbers that are uniform and independent if it is, by polar formulas in `f64`.
    fn back(lens: Lens, point: [f32; 2]) -> [f64; 2] {
        let [x, y] = point.map(f64::from);
        let angle = (libm::atan2(y, x).to_degrees() - f64::from(lens.rotation_degrees)).rem_euclid(360.0);
        let radius = libm::sqrt(x * x + y * y);
        if lens.blades == 0 {
            return [angle / 360.0, radius * radius];
        }
        // Along the side, and from the middle to the side's own distance.
        let sides = f64::from(lens.blades);
        let (side, half) = (libm::floor(angle / 360.0 * sides), 180.0 / sides);
        let from_normal = (angle - (2.0 * side + 1.0) * half).to_radians();
        let (apothem, half) = (libm::cos(half.to_radians()), half.to_radians());
        let along = 0.5 + 0.5 * libm::tan(from_normal) / libm::tan(half);
        let out = radius * libm::cos(from_normal) / apothem;
        [(side + along) / sides, out * out]
    }

    /// Chi-square over 16 x 16 bins: 255 degrees of freedom, mean 255, deviation 22.6; the bound is five deviations away.
    #[test]
    fn openings_are_covered_evenly() {
        for (blades, rotation) in
            [(0, 0.0), (3, 0.0), (3, 17.0), (4, 45.0), (5, -100.0), (6, 400.0), (9, 3.0), (16, 11.0)]
        {
            let lens = lens(blades, rotation);
            let (mut bins, count) = ([0u32; 256], 200_000);
            for i in 0..count {
                let [u, v] = back(lens, lens.point(crate::id::unit_pair(77, i)));
                assert!((-1e-5..1.00001).contains(&u) && (0.0..1.00001).contains(&v), "{lens:?}: outside, {u} {v}");
                bins[(u * 16.0).clamp(0.0, 15.0) as usize * 16 + (v * 16.0).clamp(0.0, 15.0) as usize] += 1;
            }
            let expected = f64::from(count) / 256.0;
            let chi: f64 = bins.iter().map(|&n| (f64::from(n) - expected) * (f64::from(n) - expected) / expected).sum();
            assert!(chi < 368.0, "{lens:?}: chi-square {chi}");
        }
    }

    #[test]
    fn corners_and_edges_of_the_square() {
        let last = 1.0 - 1.0 / 16_777_216.0;
        let near = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6;
        let root = core::f32::consts::FRAC_1_SQRT_2;
        for (u, expected) in [
            ([0.5, 0.5], [0.0, 0.0]),
            ([last, 0.5], [1.0, 0.0]),
            ([0.5, 0.0], [0.0, -1.0]),
            ([0.0, 0.0], [-root, -root]),
            ([0.0, last], [-root, root]),
            ([0.25, 0.5], [-0.5, 0.0]),
        ] {
            assert!(near(lens(0, 30.0).point(u), expected), "{u:?}: {:?}", lens(0, 30.0).point(u));
        }
        // The first corner is on the right, the others follow counterclockwise; `rotation_degrees` turns them so, too.
        for (rotation, u, expected) in [
            (0.0, [0.0, last], [1.0, 0.0]),
            (0.0, [0.25, last], [0.0, 1.0]),
            (0.0, [last, last], [1.0, 0.0]),
            (0.0, [0.125, last], [0.5, 0.5]),
            (0.0, [0.3, 0.0], [0.0, 0.0]),
            (45.0, [0.0, last], [root, root]),
            (-90.0, [0.0, last], [0.0, -1.0]),
        ] {
            assert!(near(lens(4, rotation).point(u), expected), "{u:?}: {:?}", lens(4, rotation).point(u));
        }
        let point = Lens { radius: 2.5, ..lens(0, 0.0) }.point([last, 0.5]);
        assert!(near(point, [2.5, 0.0]), "{point:?}");
    }
}
