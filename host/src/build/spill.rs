//! A file without a name that keeps objects by voxel until their trees are built.

use super::objects::Object;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Bytes of all buffers together, about.
const BUFFERS: usize = 32 << 20;
/// Objects that wait for one voxel: at least, and at most.
const BUFFER: [usize; 2] = [16, 4096];

/// Objects by voxel, each voxel's in the order in which they came.
pub(super) struct Spill {
    file: File,
    bytes: u64,
    waiting: Vec<Vec<Object>>,
    /// Objects that wait for one voxel at most.
    limit: usize,
    /// Where each voxel's objects stand in the file: offset and count.
    pieces: Vec<Vec<(u64, usize)>>,
}

impl Spill {
    /// An empty one in `folder`.
    ///
    /// # Errors
    /// What the system says.
    pub fn new(folder: &Path, voxels: u32) -> io::Result<Self> {
        let voxels = voxels as usize;
        let limit = (BUFFERS / size_of::<Object>() / voxels.max(1)).clamp(BUFFER[0], BUFFER[1]);
        Ok(Self {
            file: tempfile::tempfile_in(folder)?,
            bytes: 0,
            waiting: vec![Vec::new(); voxels],
            limit,
            pieces: vec![Vec::new(); voxels],
        })
    }

    /// Adds an object to a voxel.
    ///
    /// # Errors
    /// What the system says.
    pub fn push(&mut self, voxel: u32, object: &Object) -> io::Result<()> {
        let waiting = &mut self.waiting[voxel as usize];
        waiting.push(*object);
        if waiting.len() < self.limit {
            return Ok(());
        }
        self.write(voxel as usize)
    }

    fn write(&mut self, voxel: usize) -> io::Result<()> {
        let waiting = &mut self.waiting[voxel];
        let bytes: &[u8] = bytemuck::cast_slice(waiting);
        self.file.write_all(bytes)?;
        self.pieces[voxel].push((self.bytes, waiting.len()));
        self.bytes += bytes.len() as u64;
        waiting.clear();
        Ok(())
    }

    /// The objects of a voxel; they are asked for once, after all are in.
    ///
    /// # Errors
    /// What the system says.
    pub fn take(&mut self, voxel: u32) -> io::Result<Vec<Object>> {
        let waiting = std::mem::take(&mut self.waiting[voxel as usize]);
        let pieces = std::mem::take(&mut self.pieces[voxel as usize]);
        let mut objects = Vec::with_capacity(pieces.iter().map(|piece| piece.1).sum::<usize>() + waiting.len());
        for (offset, count) in pieces {
            let from = objects.len();
            objects.resize(from + count, bytemuck::Zeroable::zeroed());
            self.file.seek(SeekFrom::Start(offset))?;
            self.file.read_exact(bytemuck::cast_slice_mut(&mut objects[from..]))?;
        }
        objects.extend_from_slice(&waiting);
        Ok(objects)
    }
}
