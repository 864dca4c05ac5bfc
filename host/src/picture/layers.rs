//! Channels of an EXR beside red, green and blue.

use super::Picture;
use exr::prelude::{AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes};
use exr::prelude::{LineOrder, SmallVec, WritableImage};
use std::io::{self, Seek, Write};

/// A channel, and what it is called in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name, such as `albedo.R`.
    pub name: &'static str,
    /// A value for each pixel, row after row from the top.
    pub values: Values,
}

/// Values of a channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// 32-bit floats.
    Float(Vec<f32>),
    /// 32-bit whole numbers.
    Whole(Vec<u32>),
}

impl Values {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Float(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Writes `picture` and `channels`, all in one part, as readers of one picture and of many layers expect it.
pub(super) fn exr(picture: &Picture, channels: &[Channel], to: &mut (impl Write + Seek)) -> io::Result<()> {
    let light = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| {
        AnyChannel::new(name, FlatSamples::F32(picture.rgb.iter().skip(c).step_by(3).copied().collect()))
    });
    let more = channels.iter().map(|channel| match &channel.values {
        Values::Float(values) => AnyChannel::new(channel.name, FlatSamples::F32(values.clone())),
        Values::Whole(values) => AnyChannel::new(channel.name, FlatSamples::U32(values.clone())),
    });
    let all: SmallVec<[_; 4]> = light.chain(more).collect();
    let encoding =
        Encoding { compression: Compression::ZIP16, line_order: LineOrder::Increasing, ..Encoding::default() };
    let size = (picture.width as usize, picture.height as usize);
    Image::from_layer(Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(all)))
        .write()
        .non_parallel()
        .to_buffered(to)
        .map_err(|error| match error {
            exr::error::Error::Io(error) => error,
            other => io::Error::other(other),
        })
}
