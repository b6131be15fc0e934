//! Layers of depth (Zirr & Dachsbacher 2015, §4.2).
//!
//! A surface that differs from the next pixel's by one layer bends by the angle α:
//!
//! > K = 2·tan(θ/2)/R_y · tan α,  dᵢ = (1 + K)ⁱ·d₀
//!
//! with the vertical field of view θ, the height of the picture R_y and the near plane d₀. (The paper
//! writes arctan α for the second tangent, which is a slip.) Where that needs more layers than there may
//! be, K is (far/near)^(1/layers) − 1. Orthographic pixels have one size w at all depths, and so have
//! their layers: dᵢ = d₀ + i·w·tan α.

use motes_scene::Projection;

use crate::{Bits, View};

/// Most layers of all: 128 KiB of bits for a column.
const MOST_LAYERS: u32 = 1 << 20;

/// Boundaries of layers between near and far.
#[derive(Debug)]
pub(crate) struct Layers {
    /// Where each layer begins, and the end of the last.
    pub starts: Vec<f32>,
    /// Thickness of a layer: by depth in perspective (K), in world units orthographic.
    pub step: f64,
    /// Whether the angle asked for needed more layers than there may be.
    pub coarsened: bool,
    guess: Guess,
}

/// Where to look for the layer of a depth.
#[derive(Debug)]
enum Guess {
    /// By the bits of the depth, which are nearly its logarithm: the first layer for each value of
    /// bits/2^shift − first.
    Logarithm { first: u32, shift: u32, layer: Vec<u32> },
    /// By the depth itself.
    Linear { low: f32, per_depth: f32 },
}

impl Layers {
    /// The layers of a view. `view.near` is above zero in perspective.
    pub fn new(view: &View, bits: &Bits) -> Self {
        let most = f64::from(bits.layers.clamp(1, MOST_LAYERS));
        let (near, far) = (f64::from(view.near), f64::from(view.far));
        let angle = f64::from(bits.angle).to_radians().tan() * f64::from(view.rays.pixel);
        let perspective = view.rays.projection == Projection::Perspective;
        let whole = if perspective { (far / near).ln() } else { far - near };
        let needed = (whole / if perspective { angle.ln_1p() } else { angle }).ceil();
        let coarsened = needed.is_nan() || needed > most;
        let count = if coarsened { most } else { needed.max(1.0) };
        let each = whole / count;
        let step = match (coarsened, perspective) {
            (false, _) => angle,
            (true, true) => each.exp_m1(),
            (true, false) => each,
        };
        let start = |i: usize| match i as f64 * if perspective { step.ln_1p() } else { step } {
            along if along >= whole || i == count as usize => view.far,
            along if perspective => (near * along.exp()) as f32,
            along => (near + along) as f32,
        };
        let starts: Vec<f32> = (0..=count as usize).map(start).collect();
        let guess = if perspective {
            Guess::logarithm(&starts)
        } else {
            Guess::Linear { low: view.near, per_depth: (1.0 / step) as f32 }
        };
        Self { starts, step, coarsened, guess }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The layer of a depth between near and far: the last that begins no later.
    #[inline(always)]
    pub fn of(&self, depth: f32) -> usize {
        let last = self.len() - 1;
        let mut layer = self.guess.of(depth).min(last);
        while layer < last && self.starts[layer + 1] <= depth {
            layer += 1;
        }
        while layer > 0 && self.starts[layer] > depth {
            layer -= 1;
        }
        layer
    }
}

impl Guess {
    fn logarithm(starts: &[f32]) -> Self {
        let bits = |depth: f32| depth.max(f32::MIN_POSITIVE).to_bits();
        let first = bits(starts[0]);
        let last = bits(starts[starts.len() - 1]).max(first);
        let shift = ((last - first) as usize / starts.len()).max(1).ilog2();
        let first = first >> shift;
        let mut at = 0;
        let layer = (first..=last >> shift).map(|value| {
            while at + 2 < starts.len() && bits(starts[at + 1]) <= value << shift {
                at += 1;
            }
            at as u32
        });
        Self::Logarithm { first, shift, layer: layer.collect() }
    }

    #[inline(always)]
    fn of(&self, depth: f32) -> usize {
        match self {
            Self::Logarithm { first, shift, layer } => {
                let value = (depth.to_bits() >> shift).saturating_sub(*first) as usize;
                layer[value.min(layer.len() - 1)] as usize
            }
            Self::Linear { low, per_depth } => ((depth - low) * per_depth) as usize,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth_tests::rays;

    fn view() -> View {
        View { rays: rays((1920, 1080), 45.0), size: (1920, 1080), near: 0.1, far: 10.0 }
    }

    #[test]
    fn layers_are_as_thick_as_the_angle_says() {
        let layers = Layers::new(&view(), &Bits { layers: 1 << 20, ..Bits::default() });
        let k = 2.0 * (22.5_f64.to_radians()).tan() / 1080.0 * 14_f64.to_radians().tan();
        assert!((layers.step / k - 1.0).abs() < 1e-6 && !layers.coarsened);
        // ln 100 / ln(1 + K)
        assert_eq!(layers.len(), 24_082);
        for i in [0, 1000, 20_000] {
            let thick = layers.starts[i + 1] / layers.starts[i] - 1.0;
            assert!((f64::from(thick) / k - 1.0).abs() < 1e-3);
        }
        assert_eq!((layers.starts[0], layers.starts[layers.len()]), (0.1, 10.0));
    }

    #[test]
    fn too_few_layers_are_farther_apart() {
        let layers = Layers::new(&view(), &Bits::default());
        assert!(layers.coarsened);
        assert_eq!(layers.len(), 16_384);
        assert!((layers.step - (100_f64.powf(1.0 / 16_384.0) - 1.0)).abs() < 1e-8);
    }

    #[test]
    fn every_depth_is_in_its_layer() {
        let flat = motes_scene::Rays { projection: Projection::Orthographic, ..view().rays };
        for view in [view(), View { rays: flat, near: -1.0, ..view() }] {
            for bits in [Bits::default(), Bits { layers: 3, ..Bits::default() }] {
                let layers = Layers::new(&view, &bits);
                for i in 0..10_000 {
                    let depth = view.near + (view.far - view.near) * i as f32 / 10_000.0;
                    let layer = layers.of(depth);
                    assert!(layers.starts[layer] <= depth && depth < layers.starts[layer + 1]);
                }
                assert_eq!(layers.of(view.far), layers.len() - 1);
            }
        }
    }
}
