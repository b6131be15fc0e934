//! Columns as bits (Zirr & Dachsbacher 2015, §3.1): one for each layer of depth, set if a sphere overlaps
//! it. A second word for every 64 words says which of them are not zero.
//!
//! Spans are found by words and bit counts (§4.4): successive set layers i < j are one span if what is
//! empty between them, d_j − d_{i+1} in depth, is no longer than the gap. For each word of a column there
//! is a number of layers that is surely no longer; only beyond it is the length taken.
//!
//! Of a sphere all layers are marked, or only the first, the last, and as many between as leave nothing
//! longer than the gap ([`Marks::Surface`]). Spans are the same.

use fearless_simd::{Simd, prelude::*};

use crate::Marks;
use crate::compress::{Span, TileSpans};
use crate::items::{BLOCK, LANES};
use crate::layers::Layers;
use crate::splat::Columns;
use crate::tile::{Lanes, Stretch, TileRays};

/// The columns of a tile.
#[derive(Debug)]
pub(crate) struct BitColumns<'a> {
    layers: &'a Layers,
    marks: Marks,
    /// In world units.
    gap: f32,
    /// Words of a column, and words that say which of them are not zero.
    words: usize,
    summary_words: usize,
    /// Column after column; all zero between tiles.
    bits: Vec<u64>,
    summary: Vec<u64>,
    /// (g / |direction|)² of each column.
    gap2: Vec<Lanes>,
    /// For each word of a column, how many empty layers before one of its layers are surely no gap.
    bridged: Vec<u32>,
}

impl<'a> BitColumns<'a> {
    pub fn new(layers: &'a Layers, marks: Marks, gap: f32) -> Self {
        let words = layers.len().div_ceil(64);
        let summary_words = words.div_ceil(64);
        let (bits, summary) = (Vec::new(), Vec::new());
        let (gap2, bridged) = (Vec::new(), Vec::new());
        Self { layers, marks, gap, words, summary_words, bits, summary, gap2, bridged }
    }

    /// Pixels along the edge of the largest tile whose bits take no more than `bytes`.
    pub fn largest_tile(layers: &Layers, bytes: usize) -> u32 {
        let columns = bytes / layers.len().div_ceil(8);
        (columns.isqrt() as u32 / BLOCK * BLOCK).max(BLOCK)
    }

    /// Whether what is empty from layer `from` to before layer `to` is no gap in a column.
    #[inline(always)]
    fn is_bridged(&self, from: usize, to: usize, gap2: f32) -> bool {
        if to - from <= self.bridged[to / 64] as usize {
            return true;
        }
        let empty = self.layers.starts[to] - self.layers.starts[from];
        empty * empty <= gap2
    }

    /// Numbers of layers that are surely bridged. Layers are thickest at the far end of a word, and none
    /// before is thicker.
    fn bridge(&mut self) {
        let least = self.gap2.iter().flat_map(|l| l.0).fold(f32::INFINITY, f32::min);
        let starts = &self.layers.starts;
        self.bridged.clear();
        self.bridged.extend((0..self.words).map(|word| {
            let last = (64 * word + 63).min(self.layers.len() - 1);
            let first = (64 * word).saturating_sub(1);
            let differences = starts[first..=last + 1].windows(2).map(|w| w[1] - w[0]);
            let thickest = differences.fold(0.0, f32::max);
            // Less, for rounding.
            (0.999 * least.sqrt() / thickest) as u32
        }));
    }

    /// Marks layers `first` to `last` of a column.
    #[inline(always)]
    fn mark(&mut self, column: usize, (first, last): (usize, usize)) {
        let bits = &mut self.bits[column * self.words..][..self.words];
        let summary = &mut self.summary[column * self.summary_words..][..self.summary_words];
        let (from, to) = (first / 64, last / 64);
        for word in from..=to {
            let mut mask = u64::MAX;
            if word == from {
                mask &= u64::MAX << (first % 64);
            }
            if word == to {
                mask &= u64::MAX >> (63 - last % 64);
            }
            bits[word] |= mask;
            summary[word / 64] |= 1 << (word % 64);
        }
    }

    /// Marks the first and the last layer, and as many between as keep gaps bridged.
    fn mark_surface(&mut self, column: usize, (first, last): (usize, usize), gap2: f32) {
        self.mark(column, (last, last));
        let gap = gap2.sqrt();
        let mut layer = first;
        while layer < last {
            self.mark(column, (layer, layer));
            let mut next = self.layers.of(self.layers.starts[layer + 1] + gap);
            while next > layer + 1 && !self.is_bridged(layer + 1, next, gap2) {
                next -= 1;
            }
            layer = next.max(layer + 1);
        }
    }

    /// The spans of a column, whose bits are cleared.
    fn scan(&mut self, column: usize, gap2: f32, spans: &mut Vec<Span>) {
        spans.clear();
        let starts = &self.layers.starts;
        // Where the span begins, and the first layer after its last.
        let mut open: Option<(usize, usize)> = None;
        for part in 0..self.summary_words {
            let mut words = std::mem::take(&mut self.summary[column * self.summary_words + part]);
            while words != 0 {
                let word = 64 * part + words.trailing_zeros() as usize;
                words &= words - 1;
                let mut bits = std::mem::take(&mut self.bits[column * self.words + word]);
                while bits != 0 {
                    let bit = bits.trailing_zeros();
                    let run = (bits >> bit).trailing_ones();
                    bits &= u64::MAX.checked_shl(bit + run).unwrap_or(0);
                    let first = 64 * word + bit as usize;
                    let end = first + run as usize;
                    open = match open {
                        Some((begin, until)) if self.is_bridged(until, first, gap2) => {
                            Some((begin, end))
                        }
                        Some((begin, until)) => {
                            spans.push([starts[begin], starts[until]]);
                            Some((first, end))
                        }
                        None => Some((first, end)),
                    };
                }
            }
        }
        spans.extend(open.map(|(begin, until)| [starts[begin], starts[until]]));
    }

    /// Ends the tile: its spans, at most `most` of each pixel.
    pub fn finish(&mut self, rays: &TileRays, width: u32, most: usize) -> TileSpans {
        let (mut spans, mut list) = (TileSpans::default(), Vec::new());
        for y in 0..rays.pixels.1 {
            for x in 0..rays.pixels.0 {
                let block = (y / BLOCK) as usize * rays.side + (x / BLOCK) as usize;
                let lane = (y % BLOCK * BLOCK + x % BLOCK) as usize;
                self.scan(block * LANES + lane, self.gap2[block].0[lane], &mut list);
                let pixel = (rays.corner.1 + y) * width + rays.corner.0 + x;
                spans.add((pixel, most), &list, &[]);
            }
        }
        spans
    }
}

impl Columns for BitColumns<'_> {
    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, rays: &TileRays) {
        let columns = rays.side * rays.side * LANES;
        self.bits.clear();
        self.bits.resize(columns * self.words, 0);
        self.summary.clear();
        self.summary.resize(columns * self.summary_words, 0);
        self.gap2.clear();
        let square = self.gap * self.gap;
        for inverse_q in &rays.inverse_q {
            let mut gap2 = Lanes([0.0; LANES]);
            (inverse_q.load(simd) * square).store_slice(&mut gap2.0);
            self.gap2.push(gap2);
        }
        self.bridge();
    }

    #[inline(always)]
    fn put_core<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>) {
        self.put(simd, block, new, 0);
    }

    fn settle(&mut self) {}

    #[inline(always)]
    fn end<S: Simd>(&mut self, _: S) {}

    #[inline(always)]
    fn reach<S: Simd>(&mut self, _: S, _: usize, _: f32) {}

    #[inline(always)]
    fn put<S: Simd>(&mut self, _: S, block: usize, new: &Stretch<S>, _: u32) {
        let (mut entry, mut exit) = ([0.0; LANES], [0.0; LANES]);
        new.entry.store_slice(&mut entry);
        new.exit.store_slice(&mut exit);
        let mut hit = new.hit.to_bitmask();
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize % LANES;
            hit &= hit - 1;
            let layers = (self.layers.of(entry[lane]), self.layers.of(exit[lane]));
            let column = block * LANES + lane;
            match self.marks {
                Marks::Whole => self.mark(column, layers),
                Marks::Surface => self.mark_surface(column, layers, self.gap2[block].0[lane]),
            }
        }
    }
}
