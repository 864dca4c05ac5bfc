//! A material as POV-Ray texture layers.
//!
//! One POV-Ray layer has one colour, the pigment, which colours the diffuse, ambient and emitted light and filters what
//! comes through; its highlight is white. What our materials can say beyond that takes layers. POV-Ray 3.7 adds the
//! layers up from the top, and everything below a layer, highlights included, is multiplied by
//! `rgb * filter + transmit` of that layer's pigment, while its own diffuse light is multiplied by
//! `1 - filter - transmit`. So:
//!
//! 1. diffuse, ambient and emitted light: the colour doubled, `transmit 0.5`; what is below is halved;
//! 2. for a coloured highlight, a pure filter of that colour (doubled);
//! 3. a white highlight, whose filter makes up for what the filters above took, times the transmission.
//!
//! Mirrors are added from any layer without being filtered; the last one has them.

use std::fmt;

use hybray_shading::{Highlight, Material};

use super::{Angled, Short};

/// Least reflectance of a channel that has ambient or emitted light, which POV-Ray says as a multiple of it.
const REFLECTANCE_MIN: f64 = 1e-6;

/// How much the filter of a coloured highlight is raised above it, so that POV-Ray never takes the layers below for
/// hidden.
const RAISED: f64 = 16.0;

/// The layers, the top one last, which is POV-Ray's order.
pub(super) fn texture(m: &Material, exposure: f64) -> String {
    let mut layers = Vec::new();
    let surface = Lit::new(m, exposure);
    let strength = if m.highlight == Highlight::None as u32 { [0.0; 3] } else { m.specular.map(f64::from) };
    let strongest = strength[0].max(strength[1]).max(strength[2]);
    let coloured = strength.iter().any(|&c| c != strongest);
    let transmission = m.transmission.map(f64::from);
    let mirror = Mirror(m);
    if !coloured && !m.transmits() {
        let shine = Shine(m, strongest);
        layers.push(layer(surface.pigment, "", format_args!("{surface}{shine}{mirror}")));
    } else {
        let shine = Shine(m, if coloured { 0.0 } else { strongest });
        let doubled = surface.pigment.map(|c| 2.0 * c);
        layers.push(layer(doubled, " transmit 0.5", format_args!("{surface}{shine}")));
        if coloured {
            // A channel without highlight is left with a millionth of it, because the layer below undoes the filter.
            let filter = strength.map(|c| RAISED * (c / strongest).max(1e-6));
            layers.push(layer(filter.map(|c| 2.0 * c), " filter 1", format_args!("{UNLIT}")));
            let undo = std::array::from_fn(|c| transmission[c] / filter[c]);
            let shine = Shine(m, strongest / RAISED);
            // Black without filter for a surface that lets nothing through: POV-Ray's shadow rays end there at once.
            let through = if m.transmits() { " filter 1" } else { "" };
            layers.push(layer(undo, through, format_args!("{UNLIT}{shine}{mirror}")));
        } else {
            let undo = transmission.map(|c| 2.0 * c);
            layers.push(layer(undo, " filter 1", format_args!("{UNLIT}{mirror}")));
        }
    }
    layers.reverse();
    layers.concat()
}

fn layer(pigment: [f64; 3], through: &str, finish: fmt::Arguments<'_>) -> String {
    let pigment = Angled(pigment);
    format!("texture {{ pigment {{ color rgb {pigment}{through} }} finish {{ {finish} }} }}\n")
}

/// The finish of a layer that only filters, shines or mirrors.
const UNLIT: &str = "ambient 0 diffuse 0";

/// Diffuse, ambient and emitted light.
struct Lit {
    pigment: [f64; 3],
    ambient: [f64; 3],
    emission: [f64; 3],
}

impl Lit {
    fn new(m: &Material, exposure: f64) -> Self {
        let ambient = m.ambient.map(f64::from);
        let emission = Angled::times(m.emission, exposure).0;
        let pigment = std::array::from_fn(|c| {
            let diffuse = f64::from(m.diffuse[c]);
            let shows = ambient[c] != 0.0 || emission[c] != 0.0;
            if shows { diffuse.max(REFLECTANCE_MIN) } else { diffuse }
        });
        // POV-Ray multiplies both by the pigment.
        let over = |light: [f64; 3]| std::array::from_fn(|c| if light[c] == 0.0 { 0.0 } else { light[c] / pigment[c] });
        Self { pigment, ambient: over(ambient), emission: over(emission) }
    }
}

impl fmt::Display for Lit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ambient rgb {} diffuse 1", Angled(self.ambient))?;
        if self.emission != [0.0; 3] {
            write!(f, " emission rgb {}", Angled(self.emission))?;
        }
        Ok(())
    }
}

/// A white highlight of the material's shape and the given strength.
struct Shine<'a>(&'a Material, f64);

impl fmt::Display for Shine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(m, strength) = *self;
        let exponent = f64::from(m.exponent).max(0.0);
        let strength = Short(strength);
        match m.highlight {
            _ if strength.0 == 0.0 => Ok(()),
            kind if kind == Highlight::Blinn as u32 => {
                // POV-Ray's `specular` takes one over the exponent, and no exponent of 0.
                let roughness = if exponent > 0.0 { 1.0 / exponent } else { 1e30 };
                write!(f, " specular {strength} roughness {}", Short(roughness))
            }
            _ => write!(f, " phong {strength} phong_size {}", Short(exponent)),
        }
    }
}

/// The weight of the mirrored ray.
struct Mirror<'a>(&'a Material);

impl fmt::Display for Mirror<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let m = self.0;
        if m.flags & Material::FRESNEL != 0 && m.transmits() {
            // From the mirror's weight alone to all that leaves; `conserve_energy` takes it from the refracted ray.
            let most: [f64; 3] = std::array::from_fn(|c| f64::from(m.mirror[c]) + f64::from(m.transmission[c]));
            let least = Angled::times(m.mirror, 1.0);
            write!(f, " reflection {{ rgb {least}, rgb {} fresnel on }} conserve_energy", Angled(most))
        } else if m.mirror != [0.0; 3] {
            write!(f, " reflection {{ rgb {} }}", Angled::times(m.mirror, 1.0))
        } else {
            Ok(())
        }
    }
}
