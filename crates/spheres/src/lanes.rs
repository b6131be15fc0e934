//! Arrays of numbers that begin on a line of cache, so that no vector of sixteen straddles two.

use std::ops::{Deref, DerefMut};

use bytemuck::{Pod, Zeroable};

use crate::packet::LANES;

/// Sixteen numbers, as one vector.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Sixteen([u32; LANES]);

/// A row of sixteens of 32-bit numbers: of f32 or u32.
#[derive(Clone, Debug)]
pub(crate) struct Lanes<T> {
    sixteens: Vec<Sixteen>,
    number: std::marker::PhantomData<T>,
}

impl<T: Pod> Lanes<T> {
    /// `count` times `value`; `count` is a multiple of [`LANES`].
    pub fn new(value: T, count: usize) -> Self {
        let mut lanes = Self { sixteens: Vec::new(), number: std::marker::PhantomData };
        lanes.resize(count, value);
        lanes
    }

    /// Makes it at least `count` long, in whole sixteens; what is new is `value`.
    pub fn resize(&mut self, count: usize, value: T) {
        let before = self.sixteens.len() * LANES;
        if before < count {
            self.sixteens.resize(count.div_ceil(LANES), Sixteen::zeroed());
            self[before..].fill(value);
        }
    }
}

impl<T: Pod> Deref for Lanes<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(&self.sixteens)
    }
}

impl<T: Pod> DerefMut for Lanes<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(&mut self.sixteens)
    }
}
