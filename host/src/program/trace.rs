//! `hybray trace`: answers rays, as Radiance's `rtrace` does, through the pages and kernels that pictures are made with.

use super::args::TraceArgs;
use super::{End, prepare};
use anyhow::{Context, Result, bail};
use hybray_bintree::walk::{Counts, Stack, nearest};
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_scene::PAGE_BYTES_MAX;
use hybray_tracer::{Scene, surface_point};
use std::io::{BufRead, BufReader, BufWriter, Read, Write};

/// Characters of a ray's line at most.
const LINE_MAX: u64 = 4096;

/// What is said of a hit.
struct Answer {
    t: f32,
    primitive: u32,
    uv: [f32; 2],
    normal: Vec3,
}

struct Tracer<'a> {
    scene: Scene<'a>,
    args: &'a TraceArgs,
    /// A file unit is 2 to this power internal units.
    scale_log2: i32,
    stack: Stack,
    counts: Counts,
}

impl Tracer<'_> {
    /// `t` counts in the caller's directions, whose length is kept but for a power of two that brings it near the
    /// scene's: squares of very long or short ones would leave the range of `f32`.
    fn answer(&mut self, [ox, oy, oz, dx, dy, dz, t_min, t_max]: [f32; 8]) -> Option<Answer> {
        let direction = Vec3::new(dx, dy, dz);
        let exponent = libm::ilogbf(direction.abs().max_element());
        let shrink = |x: f32, by: i32| libm::ldexpf(x, by);
        let steps = exponent + self.scale_log2;
        let ray = Ray {
            origin: Vec3::new(ox, oy, oz) * libm::ldexpf(1.0, self.scale_log2),
            direction: Vec3::new(shrink(dx, -exponent), shrink(dy, -exponent), shrink(dz, -exponent)),
            t_min: shrink(t_min, steps),
            t_max: shrink(t_max, steps),
        };
        let hit = nearest(self.args.kernels.kernels(), &self.scene.resident, &ray, &mut self.stack, &mut self.counts);
        if !hit.candidate.is_hit() {
            return None;
        }
        let point = surface_point(&self.scene.resident.pages[hit.page as usize], &ray, &hit);
        Some(Answer {
            t: shrink(hit.candidate.t, -steps),
            primitive: hit.candidate.id,
            uv: point.uv,
            normal: point.normal,
        })
    }
}

pub(super) fn run(args: &TraceArgs) -> Result<End> {
    let (prepared, _) = prepare(&args.scene, &args.tree, None, PAGE_BYTES_MAX as u32)?;
    let pages = prepared.packed.open()?;
    let mut tracer = Tracer {
        scene: prepared.scene(&pages),
        args,
        scale_log2: prepared.packed.scale_log2,
        stack: Stack::new(),
        counts: Counts::default(),
    };
    let input = BufReader::new(std::io::stdin().lock());
    let mut output = BufWriter::new(std::io::stdout().lock());
    if args.binary { binary(&mut tracer, input, &mut output) } else { text(&mut tracer, input, &mut output) }?;
    output.flush()?;
    Ok(End::Done)
}

fn text(tracer: &mut Tracer<'_>, mut input: BufReader<impl Read>, output: &mut impl Write) -> Result<()> {
    let mut line = String::new();
    for number in 1u64.. {
        flush_for_who_waits(&input, output)?;
        line.clear();
        let read = input.by_ref().take(LINE_MAX).read_line(&mut line);
        if read.with_context(|| format!("standard input, line {number}: cannot be read as text"))? == 0 {
            break;
        }
        if !line.ends_with('\n') && line.len() as u64 == LINE_MAX {
            bail!("standard input, line {number}: longer than {LINE_MAX} characters; give one ray a line");
        }
        let words = line.split_whitespace();
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let numbers: Vec<f32> = words.map(str::parse).collect::<Result<_, _>>().ok().unwrap_or_default();
        let ray = match numbers[..] {
            [ox, oy, oz, dx, dy, dz] => [ox, oy, oz, dx, dy, dz, 0.0, f32::INFINITY],
            [ox, oy, oz, dx, dy, dz, t_min] => [ox, oy, oz, dx, dy, dz, t_min, f32::INFINITY],
            [ox, oy, oz, dx, dy, dz, t_min, t_max] => [ox, oy, oz, dx, dy, dz, t_min, t_max],
            _ => bail!("standard input, line {number}: give `ox oy oz dx dy dz [tmin tmax]`, all numbers"),
        };
        check(&ray).with_context(|| format!("standard input, line {number}"))?;
        match tracer.answer(ray) {
            Some(Answer { t, primitive, uv: [u, v], normal: n }) => {
                writeln!(output, "{t} {primitive} {u} {v} {} {} {}", n.x, n.y, n.z)?;
            }
            None => writeln!(output, "miss")?,
        }
    }
    Ok(())
}

/// Sends the answers so far before the next ray has to be waited for: who asks one at a time waits for each.
fn flush_for_who_waits(input: &BufReader<impl Read>, output: &mut impl Write) -> std::io::Result<()> {
    if input.buffer().is_empty() { output.flush() } else { Ok(()) }
}

fn binary(tracer: &mut Tracer<'_>, mut input: BufReader<impl Read>, output: &mut impl Write) -> Result<()> {
    for number in 1u64.. {
        flush_for_who_waits(&input, output)?;
        let mut bytes = [0; 32];
        let mut filled = 0;
        while filled < bytes.len() {
            let read = match input.read(&mut bytes[filled..]) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                read => read.context("standard input cannot be read")?,
            };
            match read {
                0 if filled == 0 => return Ok(()),
                0 => bail!("standard input ends within ray {number}: a ray is 32 bytes"),
                n => filled += n,
            }
        }
        let mut ray = [0.0; 8];
        for (value, bytes) in ray.iter_mut().zip(bytes.chunks_exact(4)) {
            *value = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        }
        check(&ray).with_context(|| format!("standard input, ray {number}"))?;
        let miss = Answer { t: f32::INFINITY, primitive: Candidate::NOTHING, uv: [0.0; 2], normal: Vec3::ZERO };
        let Answer { t, primitive, uv: [u, v], normal: n } = tracer.answer(ray).unwrap_or(miss);
        output.write_all(&t.to_le_bytes())?;
        output.write_all(&primitive.to_le_bytes())?;
        for value in [u, v, n.x, n.y, n.z] {
            output.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

fn check(&[ox, oy, oz, dx, dy, dz, t_min, t_max]: &[f32; 8]) -> Result<()> {
    if ![ox, oy, oz, dx, dy, dz].iter().all(|x| x.is_finite()) {
        bail!("origin and direction must be finite");
    }
    if [dx, dy, dz] == [0.0; 3] {
        bail!("the direction is zero");
    }
    if !(t_min >= 0.0 && t_min <= t_max) {
        bail!("tmin must be 0 or more, and tmax not less");
    }
    Ok(())
}
