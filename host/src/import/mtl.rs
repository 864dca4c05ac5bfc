//! MTL, OBJ's material files, through `tobj` behind a guard.
//!
//! `tobj` panics where a colour has fewer than three numbers and takes NaN for a number. So each statement is checked
//! first, and what `tobj` gets to parse is the file with every number in range, `Kd 0.5` written out as
//! `Kd 0.5 0.5 0.5`, without pictures ([`super::mtl_maps`]), and without what is not honoured (sheen, coats), which is warned of.
//!
//! | `illum` | in Hybray |
//! |---|---|
//! | 0 | the same from everywhere: `Kd` (with `Ke`) is emission, nothing else |
//! | 1 | diffuse `Kd`, ambient `Ka` |
//! | 2, 10 | 1 and Blinn's highlight `Ks` with exponent `Ns` (10, a catcher of shadows, is warned of) |
//! | 3, 8 | 2 and a mirror of weight `Ks` |
//! | 4, 9 | 3 and glass that does not bend light: transmission, index 1 |
//! | 5 | 3 with Fresnel |
//! | 6 | 3 and glass of index `Ni` |
//! | 7 | 6 with Fresnel, which then gives the mirror its whole weight, in place of `Ks` |
//!
//! 8 and 9 are 3 and 4 for renderers that trace no rays, so here they are the same. Without `illum` it is 2 where `Ks`
//! is given and 1 where not. A highlight needs `Ks` and `Ns` above 0.
//!
//! Transmission of glass (4, 6, 7, 9) is `Tf` where given, else `1 - d` where `d` (or `Tr = 1 - d`) is given, else 1.
//! In the others `d` below 1 dissolves the surface: light passes straight on with weight `1 - d`, all else is
//! multiplied by `d`, and `Tf` means nothing, because exporters write it for opaque surfaces. Without `Kd` a surface is
//! the default's grey; without `Ka` it reflects ambient light as it does direct light. Numbers are taken as linear.
//!
//! Where roughness `Pr` or metalness `Pm` is given, those go before `Ks`, `Ns` and `Ka`: the base colour is `Kd`, `illum` says only whether
//! it is glass, and `Ni` and `d` mean what they do. Without `Pr` the roughness is that of `Ns`.

use super::error::{ImportError, Warnings, quote};
use super::guarded;
use super::lines::{Lines, without_comment};
use super::mtl_maps::Named;
use super::physical::Physical;
use hybray_shading::{Highlight, Maps, Material};
use std::fmt::Write as _;
use std::io::BufRead;

/// A material file may be this long (16 MiB): it is held in memory twice while it is read.
const FILE_BYTES_MAX: usize = 1 << 24;

/// The grey of a surface that no material is said of.
pub(crate) const DEFAULT: Material = Material { ambient: Material::MATT.diffuse, ..Material::MATT };

/// A material, its name, and what it takes from textures: first without pictures, which stand beside it.
pub(crate) type Described = (String, (Material, Maps), Vec<Named>);

/// The materials of a file in its order, names as they stand there. A name that comes twice stands twice: the last
/// one is meant.
pub(crate) fn read(reader: impl BufRead, file: &str, warnings: &mut Warnings) -> Result<Vec<Described>, ImportError> {
    let (checked, named) = check(Lines::new(reader, file, true), warnings)?;
    let parsed = guarded(|| tobj::load_mtl_buf(&mut checked.as_bytes()));
    match parsed {
        Some(Ok((materials, _))) => {
            let named = named.into_iter().chain(std::iter::repeat(Vec::new()));
            Ok(materials.into_iter().zip(named).map(|(m, named)| (m.name.clone(), material(&m), named)).collect())
        }
        Some(Err(error)) => Err(ImportError::new(file, format!("not a material file ({error})"), "export it again")),
        None => Err(ImportError::new(file, "the MTL parser failed on this file", "export it again")),
    }
}

/// The statements that are honoured, one a line, with every number checked; and the pictures of each material.
fn check<R: BufRead>(mut lines: Lines<R>, warnings: &mut Warnings) -> Result<(String, Vec<Vec<Named>>), ImportError> {
    let mut out = String::new();
    let mut pictures: Vec<Vec<Named>> = Vec::new();
    let mut named = false;
    while let Some(line) = lines.next()? {
        let line = without_comment(line).trim().to_owned();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        let rest = rest.trim();
        if out.len() + line.len() > FILE_BYTES_MAX {
            return Err(lines.error("a material file of more than 16 MiB", "take out what no face uses"));
        }
        if key == "newmtl" {
            if rest.is_empty() {
                return Err(lines.error("`newmtl` without a name", "give the material a name"));
            }
            named = true;
            pictures.push(Vec::new());
            let _ = writeln!(out, "newmtl {rest}");
            continue;
        }
        let number = lines.number();
        let mut honoured = true;
        match key {
            "" => continue,
            _ if !named => warnings.add(number, "what stands before the first `newmtl` is not used"),
            "Ka" | "Kd" | "Ks" | "Ke" | "Tf" if rest.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                let text = format!("{key} as {} is not used", quote(rest.split_whitespace().next().unwrap_or("")));
                // NaN and infinity begin with a letter too.
                if rest.parse::<f64>().is_ok() || !(rest.starts_with("spectral") || rest.starts_with("xyz")) {
                    return Err(lines.error(format!("{key} {} is no colour", quote(rest)), "give it as `r g b`"));
                }
                warnings.add(number, &text);
            }
            "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => {
                let c = numbers(&lines, key, rest, |c| c >= 0.0, "numbers of 0 and up")?;
                let [r, g, b] = match c[..] {
                    [grey] => [grey; 3],
                    [r, g, b] => [r, g, b],
                    _ => return Err(lines.error(format!("{key} has {} numbers", c.len()), "give it as `r g b`")),
                };
                let _ = writeln!(out, "{key} {r} {g} {b}");
            }
            "Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm" => {
                let rest = match rest.strip_prefix("-halo") {
                    Some(rest) if key == "d" => {
                        warnings.add(number, "`d -halo` is taken as `d`");
                        rest
                    }
                    _ => rest,
                };
                let (within, range): (fn(f32) -> bool, _) = match key {
                    "d" | "Tr" | "Pr" | "Pm" => (|c| (0.0..=1.0).contains(&c), "a number from 0 to 1"),
                    _ => (|c| c >= 0.0, "a number of 0 and up"),
                };
                let first = rest.split_whitespace().next().unwrap_or("");
                let value = numbers(&lines, key, first, within, range)?;
                let Some(&value) = value.first() else {
                    return Err(lines.error(format!("{key} has no number"), format!("give {range}")));
                };
                if key == "Ni" && value == 0.0 {
                    warnings.add(number, "Ni 0 is taken as 1");
                } else {
                    let _ = writeln!(out, "{key} {value}");
                }
            }
            "illum" => {
                let model = rest.split_whitespace().next().and_then(|m| m.parse::<u8>().ok());
                let Some(model @ 0..=10) = model else {
                    return Err(lines.error(format!("illum {} is not known", quote(rest)), "give 0 to 10"));
                };
                if model == 10 {
                    warnings.add(number, "illum 10 (a catcher of shadows) is taken as 2");
                }
                let _ = writeln!(out, "illum {model}");
            }
            "sharpness" => {}
            _ => match (Named::parse(key, rest), pictures.last_mut()) {
                (Some(Ok(picture)), Some(pictures)) => pictures.push(picture),
                (Some(Err(problem)), _) => warnings.add(number, &format!("{problem}: it is not used")),
                _ => honoured = false,
            },
        }
        if !honoured {
            let lower = key.to_ascii_lowercase();
            let texture = lower.starts_with("map_") || ["bump", "disp", "decal", "refl", "norm"].contains(&&*lower);
            let physical = ["ps", "pc", "pcr", "aniso", "anisor"].contains(&&*lower);
            let what = match (texture, physical) {
                (true, _) => "a texture, is not used",
                (_, true) => "of physically based shading, is not used",
                _ => "is not known here and not used",
            };
            warnings.add(number, &format!("{}, {what}", quote(key)));
        }
    }
    Ok((out, pictures))
}

/// The numbers of `text`, at most four of them, each finite and `within`.
fn numbers<R: BufRead>(
    lines: &Lines<R>,
    key: &str,
    text: &str,
    within: fn(f32) -> bool,
    range: &str,
) -> Result<Vec<f32>, ImportError> {
    text.split_whitespace()
        .take(4)
        .map(|word| match word.parse::<f32>() {
            Ok(value) if value.is_finite() && within(value) => Ok(value),
            _ => Err(lines.error(format!("{key} {} is not allowed", quote(word)), format!("give {range}"))),
        })
        .collect()
}

/// The table of the module's page.
fn material(m: &tobj::Material) -> (Material, Maps) {
    let extra = |key: &str| {
        let text = m.unknown_param.get(key)?;
        let mut numbers = text.split_whitespace().map_while(|word| word.parse::<f32>().ok());
        let first = numbers.next()?;
        Some([first, numbers.next().unwrap_or(first), numbers.next().unwrap_or(first)])
    };
    let specular = m.specular.unwrap_or_default();
    let illum = m.illumination_model.unwrap_or(if m.specular.is_some() { 2 } else { 1 });
    let diffuse = m.diffuse.unwrap_or(DEFAULT.diffuse);
    let emission = m.emissive.unwrap_or_default();
    let opacity = m.dissolve.or_else(|| extra("Tr").map(|t| 1.0 - t[0]));
    if illum == 0 {
        let emission = [0, 1, 2].map(|i| emission[i] + diffuse[i]);
        return (Material { diffuse: [0.0; 3], ambient: [0.0; 3], emission, ..Material::MATT }, Maps::EMPTY);
    }
    let exponent = m.shininess.unwrap_or(0.0);
    let glass = matches!(illum, 4 | 6 | 7 | 9);
    let (metal, rough) = (extra("Pm"), extra("Pr"));
    if metal.is_some() || rough.is_some() {
        let rest = opacity.unwrap_or(if glass { 0.0 } else { 1.0 });
        return Physical {
            base: diffuse,
            metal: metal.map_or(0.0, |m| m[0]),
            // Of an exponent: see `Physical::material`, the other way round.
            rough: rough.map_or_else(|| libm::sqrtf(libm::sqrtf(2.0 / (exponent + 2.0))), |r| r[0]),
            through: if glass { 1.0 - rest } else { 0.0 },
            ior: m.optical_density.unwrap_or(1.5),
            seen: if glass { 1.0 } else { rest },
            emission,
            absorption: [0.0; 3],
        }
        .material();
    }
    let shines = illum >= 2 && exponent > 0.0 && specular.iter().any(|&c| c > 0.0);
    let transmission = match opacity {
        _ if glass && extra("Tf").is_some() => extra("Tf").unwrap_or_default(),
        Some(d) => [1.0 - d; 3],
        None => [if glass { 1.0 } else { 0.0 }; 3],
    };
    let rest = if glass { 1.0 } else { opacity.unwrap_or(1.0) };
    let mirror = if matches!(illum, 3..=6 | 8 | 9) { specular } else { [0.0; 3] };
    let material = Material {
        diffuse: diffuse.map(|c| c * rest),
        ambient: m.ambient.unwrap_or(diffuse).map(|c| c * rest),
        emission: emission.map(|c| c * rest),
        specular: if shines { specular.map(|c| c * rest) } else { [0.0; 3] },
        mirror: mirror.map(|c| c * rest),
        transmission,
        exponent: if shines { exponent } else { 0.0 },
        ior: if matches!(illum, 5..=7) { m.optical_density.unwrap_or(1.0) } else { 1.0 },
        highlight: if shines { Highlight::Blinn } else { Highlight::None } as u32,
        flags: if matches!(illum, 5 | 7) { Material::FRESNEL } else { 0 },
    };
    (material, Maps::EMPTY)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Parsed = (Vec<Described>, Vec<String>);

    fn parse(text: &str) -> Result<Parsed, String> {
        let mut warnings = Warnings::default();
        let found = read(text.as_bytes(), "m.mtl", &mut warnings).map_err(|e| e.to_string())?;
        Ok((found, warnings.lines("m.mtl").collect()))
    }

    fn one(body: &str) -> Material {
        let (found, warnings) = parse(&format!("newmtl a\n{body}")).expect(body);
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(found.len(), 1);
        found[0].1.0
    }

    const PLAIN: Material = Material { diffuse: [0.5, 0.25, 1.0], ambient: [0.5, 0.25, 1.0], ..Material::MATT };
    const SHINY: Material =
        Material { specular: [0.5; 3], exponent: 10.0, highlight: Highlight::Blinn as u32, ..PLAIN };

    #[test]
    fn every_illumination_model() {
        let glass = Material { mirror: [0.5; 3], transmission: [1.0; 3], ..SHINY };
        let check = |illum: u8, expected: Material| {
            let body = format!("Kd 0.5 0.25 1\nKs 0.5\nNs 10\nNi 1.5\nillum {illum}");
            assert_eq!(one(&body), expected, "illum {illum}");
        };
        check(0, Material { diffuse: [0.0; 3], ambient: [0.0; 3], emission: PLAIN.diffuse, ..Material::MATT });
        check(1, PLAIN);
        check(2, SHINY);
        check(3, Material { mirror: [0.5; 3], ..SHINY });
        check(4, glass);
        check(5, Material { mirror: [0.5; 3], ior: 1.5, flags: Material::FRESNEL, ..SHINY });
        check(6, Material { ior: 1.5, ..glass });
        check(7, Material { mirror: [0.0; 3], ior: 1.5, flags: Material::FRESNEL, ..glass });
        check(8, Material { mirror: [0.5; 3], ..SHINY });
        check(9, glass);
    }

    #[test]
    fn fields() {
        let check = |body: &str, expected: Material| assert_eq!(one(body), expected, "{body}");
        check("", DEFAULT);
        check("Kd 0.5 0.25 1", PLAIN);
        check("Kd 0.5 0.25 1\nKa 0 0 0", Material { ambient: [0.0; 3], ..PLAIN });
        check("  Kd\t0.5 0.25  1 # blue", PLAIN);
        check("Kd 0.5 0.25 \\\n 1", PLAIN);
        check("Kd 0.5 0.25 1\nKs 0.5\nNs 10", SHINY);
        check("Kd 0.5 0.25 1\nKs 0.5\nNs 0", PLAIN);
        check("Kd 0.5 0.25 1\nKs 0 0 0\nNs 9", PLAIN);
        check("Kd 0.5 0.25 1\nKs 0.5\nNs 10\nillum 1", PLAIN);
        check("Kd 0.5 0.25 1\nKe 3 2 1", Material { emission: [3.0, 2.0, 1.0], ..PLAIN });
        check("Kd 0.5 0.25 1\nTf 1 1 1\nillum 2", PLAIN);
        let half = Material { diffuse: [0.25, 0.125, 0.5], ambient: [0.25, 0.125, 0.5], ..PLAIN };
        check("Kd 0.5 0.25 1\nd 0.5", Material { transmission: [0.5; 3], ..half });
        check("Kd 0.5 0.25 1\nTr 0.5", Material { transmission: [0.5; 3], ..half });
        check("Kd 0.5 0.25 1\nd 1\nTr 1", PLAIN);
        let glass = Material { ior: 1.5, ..PLAIN };
        check("Kd 0.5 0.25 1\nNi 1.5\nillum 6\nd 0.25", Material { transmission: [0.75; 3], ..glass });
        check("Kd 0.5 0.25 1\nNi 1.5\nillum 6\nTf 0.1 0.2 0.3", Material { transmission: [0.1, 0.2, 0.3], ..glass });
        check("Kd 0.5 0.25 1\nNi 1.5\nillum 6\nTf 0.1\nd 0.5", Material { transmission: [0.1; 3], ..glass });
    }

    #[test]
    fn roughness_and_metalness_go_before_the_older_fields() {
        let physical = Material { flags: Material::PHYSICAL, ambient: [0.0; 3], ior: 1.5, ..Material::MATT };
        let metal = one("Kd 1 0.5 0\nKs 1\nNs 500\nPr 0\nPm 1\nillum 2");
        assert_eq!(metal, Material { diffuse: [1.0, 0.5, 0.0], mirror: [1.0; 3], ..physical });
        let matt = one("Kd 0.5\nKs 1\nNs 500\nPr 1\nillum 2");
        assert_eq!(matt, Material { diffuse: [0.5; 3], exponent: 1.0, ..physical });
        // The width of a highlight of that exponent: 2 over it and 2 more is the fourth power of the roughness.
        let shiny = one("Kd 0.5\nNs 30\nPm 0.25");
        assert!((shiny.exponent - 0.5).abs() < 1e-6, "{}", shiny.exponent);
        let glass = one("Kd 1\nNi 1.3\nPr 0\nillum 7");
        assert_eq!(glass, Material { diffuse: [1.0; 3], transmission: [1.0; 3], ior: 1.3, ..physical });
        let half = one("Kd 1\nPr 1\nd 0.5");
        assert_eq!((half.diffuse, half.flags & Material::BLEND), ([1.0; 3], Material::BLEND));
        let error = parse("newmtl a\n\nPr 1.5").expect_err("too rough");
        assert_eq!(error, "m.mtl:3: Pr `1.5` is not allowed; give a number from 0 to 1");
    }

    #[test]
    fn names_and_order() {
        let (found, _) = parse("newmtl red one\nnewmtl b\r\nKd 1 0 0\nnewmtl b").expect("reads");
        let names: Vec<&str> = found.iter().map(|(n, _, _)| n.as_str()).collect();
        assert_eq!(names, ["red one", "b", "b"]);
        assert_eq!(found[1].1.0.diffuse, [1.0, 0.0, 0.0]);
        assert_eq!(parse("").expect("reads").0, []);
    }

    #[test]
    fn what_is_not_honoured_is_warned_of_once() {
        let body = "Kd 1 1 1\nnewmtl a\nmap_Ka a.png\nmap_Kd\nPs 0.5\ndisp x\nfoo 1\nd -halo 1\nKd spectral a.rfl\nNi 0\nillum 10";
        let (_, warnings) = parse(body).expect("reads");
        assert_eq!(
            warnings,
            [
                "m.mtl:1: what stands before the first `newmtl` is not used",
                "m.mtl:3: `map_Ka`, a texture, is not used",
                "m.mtl:4: `map_Kd`: no file is named: it is not used",
                "m.mtl:5: `Ps`, of physically based shading, is not used",
                "m.mtl:6: `disp`, a texture, is not used",
                "m.mtl:7: `foo`, is not known here and not used",
                "m.mtl:8: `d -halo` is taken as `d`",
                "m.mtl:9: Kd as `spectral` is not used",
                "m.mtl:10: Ni 0 is taken as 1",
                "m.mtl:11: illum 10 (a catcher of shadows) is taken as 2",
            ]
        );
    }

    #[test]
    fn bad_values_name_their_line() {
        let check = |body: &str, expected: &str| {
            let error = parse(&format!("newmtl a\n\n{body}")).expect_err(body);
            assert_eq!(error, format!("m.mtl:3: {expected}"));
        };
        check("Kd 1 1", "Kd has 2 numbers; give it as `r g b`");
        check("Kd", "Kd has 0 numbers; give it as `r g b`");
        check("Kd 1 x 1", "Kd `x` is not allowed; give numbers of 0 and up");
        check("Kd -1 0 0", "Kd `-1` is not allowed; give numbers of 0 and up");
        check("Kd nan", "Kd `nan` is no colour; give it as `r g b`");
        check("Kd 1 1 nan", "Kd `nan` is not allowed; give numbers of 0 and up");
        check("Kd 1e99 0 0", "Kd `1e99` is not allowed; give numbers of 0 and up");
        check("Ns", "Ns has no number; give a number of 0 and up");
        check("Ns -1", "Ns `-1` is not allowed; give a number of 0 and up");
        check("d 1.5", "d `1.5` is not allowed; give a number from 0 to 1");
        check("illum 11", "illum `11` is not known; give 0 to 10");
        check("illum", "illum `` is not known; give 0 to 10");
        check("newmtl", "`newmtl` without a name; give the material a name");
        assert!(parse("newmtl \u{fffd}\nKd 1").is_ok());
    }
}
