//! Memory for the pages of a scene, one after another.

use hybray_scene::Line;
use memmap2::MmapMut;

/// From so many bytes on, the system is asked for large pages of memory.
const LARGE: usize = 4 << 20;

/// Lines in memory that, where there are many of them, is mapped in large pieces: rays touch all over it, and would spend some
/// 5 % of their time (15 % with four million triangles) in looking up where it is.
pub(super) enum Area {
    Few(Vec<Line>),
    Many(MmapMut),
}

impl Area {
    /// Puts `chunks` one behind the other. Each is given back when it is copied, so that hardly more than one stands twice.
    pub(super) fn new(chunks: Vec<Vec<Line>>) -> Self {
        let bytes = size_of::<Line>() * chunks.iter().map(Vec::len).sum::<usize>();
        // Where the system has no such memory, the usual will do.
        let mapped = if bytes < LARGE { None } else { MmapMut::map_anon(bytes).ok() };
        let Some(mut mapped) = mapped else {
            let mut lines = Vec::with_capacity(bytes / size_of::<Line>());
            for chunk in chunks {
                lines.extend_from_slice(&chunk);
            }
            return Self::Few(lines);
        };
        #[cfg(target_os = "linux")]
        let _ = mapped.advise(memmap2::Advice::HugePage);
        let mut at = 0;
        for chunk in chunks {
            let chunk: &[u8] = bytemuck::cast_slice(&chunk);
            mapped[at..at + chunk.len()].copy_from_slice(chunk);
            at += chunk.len();
        }
        Self::Many(mapped)
    }

    pub(super) fn mapped_bytes(&self) -> u64 {
        match self {
            Self::Few(_) => 0,
            Self::Many(mapped) => mapped.len() as u64,
        }
    }

    /// All of them.
    pub(super) fn lines(&self) -> &[Line] {
        match self {
            Self::Few(lines) => lines,
            // A mapping begins at a page of the system.
            Self::Many(mapped) => bytemuck::cast_slice(mapped),
        }
    }
}
