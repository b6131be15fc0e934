//! A picture as its renderer leaves it: colour and the layers beside it.

use std::hash::Hasher;
use std::sync::Arc;

use crate::{FrameError, Result};

/// A picture of `width` × `height` pixels, row 0 on top, rows one after the other.
///
/// # Invariants
///
/// `color` and every layer hold exactly `width · height` pixels; no layer is there twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    width: usize,
    height: usize,
    color: Vec<[f32; 4]>,
    /// Shared by the frame and its copies, which differ in colour.
    layers: Arc<Vec<Layer>>,
}

/// What is known of each pixel besides its colour, from the one ray through its centre.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer {
    /// Distance along the ray in world units, +∞ where nothing.
    Depth(Vec<f32>),
    /// Surface normal in world coordinates, towards the viewer; zero where nothing.
    Normal(Vec<[f32; 3]>),
    /// Index of the particle in its file's own order, −1 where nothing.
    Id(Vec<i64>),
    /// Index of the system of particles that `Id` counts in.
    System(Vec<u16>),
    /// Number of stretches of liquid along the ray, however many were stored.
    SpanCount(Vec<u32>),
    /// Length inside the liquid along the ray in world units.
    Thickness(Vec<f32>),
}

/// The values of a layer as the encoders see them: `width · height` pixels of one type.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// One number a pixel.
    F32(&'a [f32]),
    /// Three numbers a pixel.
    F32x3(&'a [[f32; 3]]),
    /// Four numbers a pixel.
    F32x4(&'a [[f32; 4]]),
    /// One signed index a pixel.
    I64(&'a [i64]),
    /// One small index a pixel.
    U16(&'a [u16]),
    /// One count a pixel.
    U32(&'a [u32]),
}

impl Layer {
    /// The layer's name in every file format.
    pub fn name(&self) -> &'static str {
        match self {
            Layer::Depth(_) => "depth",
            Layer::Normal(_) => "normal",
            Layer::Id(_) => "id",
            Layer::System(_) => "system",
            Layer::SpanCount(_) => "span_count",
            Layer::Thickness(_) => "thickness",
        }
    }

    /// The layer's values.
    pub fn values(&self) -> Values<'_> {
        match self {
            Layer::Depth(v) | Layer::Thickness(v) => Values::F32(v),
            Layer::Normal(v) => Values::F32x3(v),
            Layer::Id(v) => Values::I64(v),
            Layer::System(v) => Values::U16(v),
            Layer::SpanCount(v) => Values::U32(v),
        }
    }
}

impl Values<'_> {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        match self {
            Values::F32(v) => v.len(),
            Values::F32x3(v) => v.len(),
            Values::F32x4(v) => v.len(),
            Values::I64(v) => v.len(),
            Values::U16(v) => v.len(),
            Values::U32(v) => v.len(),
        }
    }
}

impl Frame {
    /// A frame of the given linear, premultiplied RGBA colours.
    ///
    /// # Errors
    ///
    /// If `color` does not hold `width · height` pixels.
    pub fn new(width: usize, height: usize, color: Vec<[f32; 4]>) -> Result<Frame> {
        check_size(width, height, "color", color.len())?;
        Ok(Frame { width, height, color, layers: Arc::default() })
    }

    /// The same frame with `layer`, in place of the one of that name if there was one.
    ///
    /// # Errors
    ///
    /// If the layer does not hold `width · height` pixels.
    pub fn with(mut self, layer: Layer) -> Result<Frame> {
        check_size(self.width, self.height, layer.name(), layer.values().pixels())?;
        let layers = Arc::make_mut(&mut self.layers);
        match layers.iter_mut().find(|l| l.name() == layer.name()) {
            Some(old) => *old = layer,
            None => layers.push(layer),
        }
        Ok(self)
    }

    /// The colours, and the layers that no copy shares.
    pub fn into_parts(self) -> (Vec<[f32; 4]>, Vec<Layer>) {
        (self.color, Arc::try_unwrap(self.layers).unwrap_or_default())
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Linear, premultiplied RGBA of every pixel.
    pub fn color(&self) -> &[[f32; 4]] {
        &self.color
    }

    /// The colours, to be changed in place.
    pub fn color_mut(&mut self) -> &mut [[f32; 4]] {
        &mut self.color
    }

    /// The colours, to be changed in place, and the layers.
    pub(crate) fn color_and_layers(&mut self) -> (&mut [[f32; 4]], &[Layer]) {
        (&mut self.color, &self.layers)
    }

    /// The layers besides colour, in the order they were added.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Colour and layers under their names, as the files have them.
    pub fn named_values(&self) -> impl Iterator<Item = (&'static str, Values<'_>)> {
        let layers = self.layers.iter().map(|layer| (layer.name(), layer.values()));
        std::iter::once(("color", Values::F32x4(&self.color))).chain(layers)
    }

    /// Distance along the ray in world units, +∞ where nothing, if it was recorded.
    pub fn depth(&self) -> Option<&[f32]> {
        self.layers.iter().find_map(|l| if let Layer::Depth(v) = l { Some(&v[..]) } else { None })
    }

    /// Normals in world coordinates, if they were recorded.
    pub fn normal(&self) -> Option<&[[f32; 3]]> {
        self.layers.iter().find_map(|l| if let Layer::Normal(v) = l { Some(&v[..]) } else { None })
    }

    /// Particle indices, −1 where nothing, if they were recorded.
    pub fn id(&self) -> Option<&[i64]> {
        self.layers.iter().find_map(|l| if let Layer::Id(v) = l { Some(&v[..]) } else { None })
    }

    /// Indices of the systems, if they were recorded.
    pub fn system(&self) -> Option<&[u16]> {
        self.layers.iter().find_map(|l| if let Layer::System(v) = l { Some(&v[..]) } else { None })
    }

    /// XXH3-64 (seed 0) of width and height as little-endian u64 and then the bits of all colours.
    ///
    /// Pictures with equal hashes have, in all likelihood, the same bits.
    pub fn hash(&self) -> u64 {
        let mut hasher = twox_hash::XxHash3_64::with_seed(0);
        hasher.write(&(self.width as u64).to_le_bytes());
        hasher.write(&(self.height as u64).to_le_bytes());
        hasher.write(&le_bytes(&self.color));
        hasher.finish()
    }
}

fn check_size(width: usize, height: usize, layer: &'static str, found: usize) -> Result<()> {
    if width.checked_mul(height) == Some(found) {
        return Ok(());
    }
    Err(FrameError::LayerSize { layer, width, height, found })
}

/// The bytes of `values` with the least significant first, borrowed where the machine has them so.
pub(crate) fn le_bytes<T: bytemuck::NoUninit>(values: &[T]) -> std::borrow::Cow<'_, [u8]> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    if cfg!(target_endian = "little") {
        return bytes.into();
    }
    let scalar = match size_of::<T>() {
        size @ (2 | 8) => size,
        _ => 4,
    };
    bytes.chunks(scalar).flat_map(|word| word.iter().rev().copied()).collect::<Vec<u8>>().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layer_of_another_size_is_refused() {
        assert!(Frame::new(2, 2, vec![[0.0; 4]; 3]).is_err());
        let frame = Frame::new(2, 2, vec![[0.0; 4]; 4]).unwrap();
        let message = frame.with(Layer::Depth(vec![0.0; 5])).unwrap_err().to_string();
        assert_eq!(message, "layer `depth` of a 2×2 frame holds 5 pixels");
        assert!(Frame::new(usize::MAX, 2, Vec::new()).is_err());
    }

    #[test]
    fn a_layer_is_there_once() {
        let frame = Frame::new(1, 1, vec![[0.0; 4]]).unwrap();
        let frame = frame.with(Layer::Depth(vec![1.0])).unwrap();
        let frame = frame.with(Layer::Depth(vec![2.0])).unwrap();
        assert_eq!(frame.depth(), Some(&[2.0][..]));
        assert_eq!(frame.layers().len(), 1);
    }

    #[test]
    fn the_hash_tells_size_and_single_bits() {
        let picture = |w, h| Frame::new(w, h, vec![[0.25; 4]; 6]).unwrap();
        assert_eq!(picture(2, 3).hash(), picture(2, 3).hash());
        assert_ne!(picture(2, 3).hash(), picture(3, 2).hash());
        let mut changed = picture(2, 3);
        changed.color_mut()[5][3] = f32::from_bits(0.25_f32.to_bits() + 1);
        assert_ne!(changed.hash(), picture(2, 3).hash());
    }

    #[test]
    fn the_hash_stays_the_same_over_versions() {
        // XXH3-64 of sixteen zero bytes, from the reference implementation's Python binding.
        assert_eq!(Frame::new(0, 0, Vec::new()).unwrap().hash(), 0xd0a6_6a65_c752_8968);
    }
}
