//! Up to k spans of each pixel, and what is empty in the last (Zirr & Dachsbacher 2015, §3.1, Fig. 8).
//!
//! A pixel with n > k spans stores the first k − 1, and one from the entry of the k-th to the exit of the
//! last. Its true number and the empty length inside are kept, so that absorption stays right.

use rayon::prelude::*;

use crate::items::{BLOCK, Tiles};
use crate::{Extended, Spans, View};

/// Entry and exit of a span.
pub(crate) type Span = [f32; 2];

/// The spans of a tile, pixels row by row.
#[derive(Debug, Default)]
pub(crate) struct TileSpans {
    /// How many spans each pixel stores.
    pub counts: Vec<u16>,
    pub depths: Vec<f32>,
    /// Pixels are those of the picture.
    pub extended: Vec<Extended>,
    /// The particle of each surface; empty if they are not asked for.
    pub particles: Vec<u32>,
}

impl TileSpans {
    /// Room for so many pixels and spans.
    pub fn with_capacity(pixels: usize, spans: usize, particles: bool) -> Self {
        Self {
            counts: Vec::with_capacity(pixels),
            depths: Vec::with_capacity(2 * spans),
            extended: Vec::new(),
            particles: Vec::with_capacity(if particles { 2 * spans } else { 0 }),
        }
    }

    /// Adds a pixel with these spans, of which it stores at most `most`.
    #[inline(always)]
    pub fn add(&mut self, (pixel, most): (u32, usize), spans: &[Span], particles: &[[u32; 2]]) {
        if spans.len() <= most {
            self.counts.push(spans.len() as u16);
            self.depths.extend_from_slice(spans.as_flattened());
            self.particles.extend_from_slice(particles.as_flattened());
        } else {
            self.add_more((pixel, most), spans, particles);
        }
    }

    /// Adds a pixel with more spans than it stores.
    fn add_more(&mut self, (pixel, most): (u32, usize), spans: &[Span], particles: &[[u32; 2]]) {
        self.counts.push(most as u16);
        self.depths.extend_from_slice(spans[..most].as_flattened());
        self.particles.extend_from_slice(particles[..most.min(particles.len())].as_flattened());
        if let (Some(exit), Some(last)) = (self.depths.last_mut(), spans.last()) {
            *exit = last[1];
        }
        if let (Some(exit), Some(last)) = (self.particles.last_mut(), particles.last()) {
            *exit = last[1];
        }
        let gaps = spans[most - 1..].windows(2).map(|pair| pair[1][0] - pair[0][1]);
        let empty = gaps.map(f64::from).sum::<f64>() as f32;
        self.extended.push(Extended { pixel, count: spans.len() as u32, empty });
    }

    pub fn bytes(&self) -> usize {
        self.counts.len() * 2 + (self.depths.len() + self.particles.len()) * 4
    }
}

/// Puts the spans of all tiles together.
pub(crate) fn assemble(view: &View, tiles: &Tiles, parts: &[TileSpans]) -> Spans {
    let across = tiles.across.max(1) as usize;
    let total: usize = parts.iter().map(|part| part.depths.len()).sum();
    let with_particles = parts.iter().any(|part| !part.particles.is_empty());
    let mut spans = Spans {
        size: view.size,
        near: view.near,
        far: view.far,
        starts: vec![0; view.pixels() + 1],
        depths: vec![0.0; total],
        extended: Vec::new(),
        particles: vec![0; if with_particles { total } else { 0 }],
    };
    if let Some(last) = spans.starts.last_mut() {
        *last = (total / 2) as u32;
    }
    let band_pixels = (tiles.side * BLOCK) as usize * view.size.0 as usize;
    let (mut depths, mut particles) = (&mut spans.depths[..], &mut spans.particles[..]);
    let mut bands = Vec::new();
    let mut first = 0;
    let starts = spans.starts[..view.pixels()].chunks_mut(band_pixels.max(1));
    for (starts, parts) in starts.zip(parts.chunks(across)) {
        let count: usize = parts.iter().map(|part| part.depths.len()).sum();
        let (own, rest) = std::mem::take(&mut depths).split_at_mut(count);
        depths = rest;
        let of_particles = if with_particles { count } else { 0 };
        let (own_particles, rest) = std::mem::take(&mut particles).split_at_mut(of_particles);
        particles = rest;
        bands.push(Band { parts, starts, depths: own, particles: own_particles, first });
        first += (count / 2) as u32;
    }
    let extended: Vec<Vec<Extended>> =
        bands.into_par_iter().map(|band| band.assemble(view.size.0 as usize)).collect();
    spans.extended = extended.concat();
    spans
}

/// A row of tiles.
struct Band<'a> {
    parts: &'a [TileSpans],
    starts: &'a mut [u32],
    depths: &'a mut [f32],
    particles: &'a mut [u32],
    /// Its first span.
    first: u32,
}

impl Band<'_> {
    /// Gives the pixels that had more spans than they store.
    fn assemble(self, width: usize) -> Vec<Extended> {
        let rows = self.starts.len() / width.max(1);
        let tile = self.parts[0].counts.len() / rows.max(1);
        // Where the next pixel and the next surface of each tile are.
        let mut next = vec![(0, 0); self.parts.len()];
        let (mut span, mut at) = (self.first, 0);
        for row in self.starts.chunks_mut(width.max(1)) {
            for ((part, next), starts) in
                self.parts.iter().zip(&mut next).zip(row.chunks_mut(tile.max(1)))
            {
                let before = span;
                let counts = &part.counts[next.0..next.0 + starts.len()];
                for (start, count) in starts.iter_mut().zip(counts) {
                    *start = span;
                    span += u32::from(*count);
                }
                let from = next.1..next.1 + 2 * (span - before) as usize;
                *next = (next.0 + starts.len(), from.end);
                let to = at..at + from.len();
                at = to.end;
                self.depths[to.clone()].copy_from_slice(&part.depths[from.clone()]);
                if !self.particles.is_empty() {
                    self.particles[to].copy_from_slice(&part.particles[from]);
                }
            }
        }
        let mut extended: Vec<Extended> =
            self.parts.iter().flat_map(|part| &part.extended).copied().collect();
        extended.sort_unstable_by_key(|e| e.pixel);
        extended
    }
}
