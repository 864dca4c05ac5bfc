//! A texel page: a rectangle of one level of a texture, with the texels around it, so that a bilinear look-up needs one
//! page (DESIGN section 5).

use crate::{HEADER_BYTES, PAGE_BYTES_MAX, PageError};
use bytemuck::{Pod, Zeroable};

/// First bytes of a texel page. `(width + 2) * (height + 2)` texels of four bytes follow, row by row, from the one to the
/// upper left of the rectangle on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TexelHeader {
    /// [`TexelHeader::MAGIC`].
    pub magic: u32,
    /// Bytes of the whole page, this header included.
    pub bytes: u32,
    /// Columns of the rectangle, without those around it.
    pub width: u16,
    /// Rows of the rectangle.
    pub height: u16,
    /// Zero.
    pub reserved: u32,
}

const TEXEL_HEADER_BYTES: usize = size_of::<TexelHeader>();
const _: () = assert!(TEXEL_HEADER_BYTES == 16 && TEXEL_HEADER_BYTES < HEADER_BYTES);

impl TexelHeader {
    /// "hyT" and the version of the format.
    pub const MAGIC: u32 = u32::from_le_bytes(*b"hyT\x01");

    /// That of a rectangle.
    #[must_use]
    pub const fn new(width: u16, height: u16) -> Self {
        Self { magic: Self::MAGIC, bytes: texel_page_bytes(width, height) as u32, width, height, reserved: 0 }
    }
}

/// Bytes of a page of so many texels, those around them not counted.
#[must_use]
pub const fn texel_page_bytes(width: u16, height: u16) -> usize {
    TEXEL_HEADER_BYTES + 4 * (width as usize + 2) * (height as usize + 2)
}

/// Columns and rows of the largest square that pages of so many bytes hold; at least 1.
#[must_use]
pub fn texel_square(page_bytes: usize) -> u16 {
    let fits = |side: &u16| texel_page_bytes(*side, *side) <= page_bytes.min(PAGE_BYTES_MAX);
    (1..=128).take_while(fits).last().unwrap_or(1)
}

/// A validated texel page, read in place.
#[derive(Clone, Copy, Debug)]
pub struct Texels<'a> {
    width: usize,
    height: usize,
    texels: &'a [[u8; 4]],
}

impl<'a> Texels<'a> {
    /// Validates a page: whatever the bytes, a look-up stays inside.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn parse(page: &'a [u8]) -> Result<Self, PageError> {
        let Some((header, _)) = page.split_at_checked(TEXEL_HEADER_BYTES) else {
            return Err(PageError::Short { bytes: page.len(), needed: TEXEL_HEADER_BYTES as u64 });
        };
        let header: TexelHeader = bytemuck::pod_read_unaligned(header);
        if header.magic != TexelHeader::MAGIC {
            return Err(PageError::Magic(header.magic));
        }
        if header.width == 0 || header.height == 0 {
            return Err(PageError::Header("a page without texels"));
        }
        let needed = texel_page_bytes(header.width, header.height);
        if needed != header.bytes as usize || needed > PAGE_BYTES_MAX {
            return Err(PageError::Header("its counts do not make its bytes, or exceed 64 KiB"));
        }
        if needed > page.len() {
            return Err(PageError::Short { bytes: page.len(), needed: needed as u64 });
        }
        Ok(Self::of_valid(page))
    }

    /// A page that [`Texels::parse`] has accepted since it was last written.
    ///
    /// # Panics
    /// If it has not, and its counts do not fit: nothing worse can come of it.
    #[must_use]
    pub fn of_valid(page: &'a [u8]) -> Self {
        let header: TexelHeader = bytemuck::pod_read_unaligned(&page[..TEXEL_HEADER_BYTES]);
        let texels = &page[TEXEL_HEADER_BYTES..texel_page_bytes(header.width, header.height)];
        Self { width: header.width.into(), height: header.height.into(), texels: texels.as_chunks().0 }
    }

    /// Columns and rows, those around the rectangle not counted.
    #[must_use]
    pub const fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Bytes of the page.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        TEXEL_HEADER_BYTES + size_of_val(self.texels)
    }

    /// The texel one column after and one row below the one in column `x` and row `y` of all: so 0 and 0 name the first of the
    /// rectangle, and what is beyond the texels around it is the last of them.
    #[must_use]
    #[inline]
    pub fn get(&self, x: i32, y: i32) -> [u8; 4] {
        let within = |at: i32, count: usize| (at.saturating_add(1).max(0) as usize).min(count + 1);
        self.texels[within(y, self.height) * (self.width + 2) + within(x, self.width)]
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    fn page(width: u16, height: u16) -> Vec<u8> {
        let mut page = bytemuck::bytes_of(&TexelHeader::new(width, height)).to_vec();
        for y in 0..height + 2 {
            page.extend((0..width + 2).flat_map(|x| [x as u8, y as u8, 0, 255]));
        }
        page
    }

    #[test]
    fn texels_stand_row_by_row_with_those_around_them() {
        let page = page(5, 3);
        assert_eq!(page.len(), texel_page_bytes(5, 3));
        let texels = Texels::parse(&page).unwrap();
        assert_eq!(texels.size(), [5, 3]);
        for (x, y) in [(0, 0), (4, 2), (-1, -1), (5, 3), (2, 1)] {
            assert_eq!(texels.get(x, y), [(x + 1) as u8, (y + 1) as u8, 0, 255]);
        }
        assert_eq!(texels.get(i32::MAX, i32::MIN), [6, 0, 0, 255]);
    }

    #[test]
    fn what_is_no_page_is_refused() {
        let good = page(5, 3);
        for cut in 0..good.len() {
            assert!(Texels::parse(&good[..cut]).is_err(), "{cut} bytes");
        }
        for at in 0..TEXEL_HEADER_BYTES - 4 {
            let mut bad = good.clone();
            bad[at] ^= 0x11;
            assert!(Texels::parse(&bad).is_err(), "byte {at}");
        }
        assert!(Texels::parse(&page(200, 200)).is_err(), "more than a page may have");
        assert!(Texels::parse(&page(0, 3)).is_err());
    }

    #[test]
    fn squares_fill_pages() {
        for bytes in [1024, 4096, 16_384, 65_536] {
            let side = texel_square(bytes);
            assert!(texel_page_bytes(side, side) <= bytes && texel_page_bytes(side + 1, side + 1) > bytes, "{bytes}");
        }
        assert_eq!(texel_square(0), 1);
    }
}
