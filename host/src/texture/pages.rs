//! Textures as texel pages.

use super::{Image, Texture};
use hybray_scene::{Line, TexelHeader, lines_for, texel_square};
use hybray_shading::{Texture as Record, Wrap};
use rayon::prelude::*;

/// The table of textures, and their pages, the first of which gets the number `first`. Pages have `page_bytes` at most.
#[must_use]
pub fn pages(textures: &[Texture], page_bytes: usize, first: u32) -> (Vec<Record>, Vec<Vec<Line>>) {
    let tile = texel_square(page_bytes);
    let mut records = Vec::new();
    let mut all = Vec::new();
    for texture in textures {
        let levels = texture.levels();
        let mut record = Record {
            first: first + all.len() as u32,
            width: texture.image.width,
            height: texture.image.height,
            tile,
            levels: levels.len() as u8,
            format: texture.format as u8,
            wrap: texture.wrap.map(|wrap| wrap as u8),
            sampling: texture.sampling as u8,
            ..Record::default()
        };
        let before = all.len();
        for (level, image) in (0..).zip(&levels) {
            let [columns, rows] = record.squares(level);
            let squares = (0..columns * rows).into_par_iter();
            let squares = squares.map(|square| page(image, square % columns, square / columns, tile, texture.wrap));
            all.par_extend(squares);
        }
        record.pages = (all.len() - before) as u32;
        records.push(record);
    }
    (records, all)
}

/// One square of a level, with the texels around it.
fn page(image: &Image, column: u32, row: u32, tile: u16, wrap: [Wrap; 2]) -> Vec<Line> {
    let (left, top) = (column as usize * usize::from(tile), row as usize * usize::from(tile));
    let width = (usize::from(image.width) - left).min(tile.into());
    let height = (usize::from(image.height) - top).min(tile.into());
    let header = TexelHeader::new(width as u16, height as u16);
    let mut bytes = Vec::with_capacity(header.bytes as usize);
    bytes.extend_from_slice(bytemuck::bytes_of(&header));
    for y in -1..=height as i64 {
        let y = wrap[1].texel(top as i64 + y, image.height.into()) as usize;
        for x in -1..=width as i64 {
            let x = wrap[0].texel(left as i64 + x, image.width.into()) as usize;
            bytes.extend_from_slice(&image.get(x, y));
        }
    }
    let mut lines = vec![Line([0; 64]); lines_for(bytes.len())];
    let to: &mut [u8] = bytemuck::cast_slice_mut(&mut lines);
    to[..bytes.len()].copy_from_slice(&bytes);
    lines
}
