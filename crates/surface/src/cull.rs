//! Full, empty and boundary cells (Zirr & Dachsbacher 2015, §3.1 and §4.3).
//!
//! A lattice of cubes of edge L lies over the particles, with a bit for each. A cell is
//!
//! - *full*, if it holds a particle ([`Cull::Occupancy`]) or at least so many ([`Cull::Count`]),
//! - *inner*, if it is full and so are all 26 around it,
//! - *deep*, if it is inner and so are all 26 around it.
//!
//! Inner cells are liquid throughout, by definition: the liquid is the union of the spheres and of the
//! inner cells. A particle is left out if its sphere lies within inner cells. Then the union is the same
//! with and without it, and so are all spans: their ends are ends of other spheres or faces of inner
//! cells, and what is empty along a ray is empty either way.
//!
//! The sphere of radius R of a particle lies within inner cells where its cell is deep and R ≤ L; and also
//! where R ≤ L/2 and the seven cells around the corner of its cell that is nearest to it are inner.
//!
//! The inner cells are drawn as cubes, in a few sizes: 2ⁿ cells along each edge, all inner.
//!
//! A cell is *sparse* if it holds a particle and, with the 26 around it, no more than [`FEW`] cells do: what
//! lies there is spray, a drop by itself.
//!
//! Cells at the lattice's border count as empty, so that whatever lies beyond changes nothing.

use std::sync::atomic::{AtomicUsize, Ordering};

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{BATCH, Places, Radii, Rows, of_points};
use rayon::prelude::*;

use crate::source::{Gathered, Piece, Source, Survey, drawable};
use crate::{Cull, Params, Spray};

/// Most cells: 32 MiB of bits. A box that needs more, since it is nearly empty, has no inner cells.
const MOST_CELLS: f64 = (1u64 << 28) as f64;
/// Cells with particles around a drop, its own among them. Over a sheet there are nine, along an edge six.
const FEW: u32 = 5;
/// Bytes that the threads' own copies of the bits may need together.
const COPIES_BYTES: usize = 1 << 26;
/// Sizes of cubes: up to 16 cells along an edge.
const SIZES: u32 = 5;
/// What rounding may move a particle, in cells: a sphere that lies within cells by more than that does.
const SLACK: f32 = 0.01;

/// Rows of bits over a box of cells, x fastest; each row begins a word.
#[derive(Clone, Debug, Default)]
struct Bits {
    /// Words in a row.
    words: usize,
    rows: usize,
    planes: usize,
    bits: Vec<u64>,
}

/// The lattice of cells and what is known of them.
#[derive(Debug)]
pub(crate) struct Cells {
    /// The corner of the first cell.
    pub low: Vec3,
    /// The edge L of a cell.
    pub edge: f32,
    /// Cells along each axis, the empty border among them.
    pub dims: [u32; 3],
    places: Places,
    inner: Bits,
    deep: Bits,
    /// Cells that hold particles, as all around them do; none where these are the inner ones.
    among: Option<Bits>,
    /// None where spray is as everything else.
    sparse: Option<Bits>,
}

/// Cubes of inner cells: place of the first cell along x, y, z, and cells along an edge.
pub(crate) type Cube = [f32; 4];

impl Cells {
    /// Finds the cells of `source`; `None` where there can be none, or too many.
    pub fn new(
        source: &Source<'_>,
        survey: &Survey,
        params: &Params,
        level: Level,
    ) -> Option<Self> {
        let tells_spray = params.spray != Spray::Liquid;
        let asked = params.cull != Cull::Off || tells_spray || params.fit;
        if !asked || survey.count == 0 {
            return None;
        }
        let edge = params.cell * survey.mean_radius;
        let extent = (survey.high - survey.low) / edge;
        let [x, y, z] = extent.to_array().map(|e| f64::from(e) + 3.0);
        let cells = (x / 64.0).ceil() * 64.0 * y * z;
        // Counts take a byte for each cell.
        let most = if params.cull == Cull::Occupancy { MOST_CELLS } else { MOST_CELLS / 8.0 };
        if !drawable(edge) || !cells.is_finite() || cells > most {
            return None;
        }
        // A border all around.
        let [x, y, z] = extent.to_array().map(|e| e as u32 + 3);
        let dims = [x.div_ceil(64) * 64, y, z];
        let low = survey.low - edge;
        let places = Places::new(low, edge, dims);
        let lattice = Lattice { places, dims, filling: 0.5 * survey.mean_radius };
        let by_occupancy = params.cull == Cull::Occupancy;
        let occupied =
            (tells_spray || params.fit || by_occupancy).then(|| lattice.occupy(source, level));
        let sparse = occupied.as_ref().filter(|_| tells_spray).map(Bits::sparse);
        let surrounded = |mut full: Bits| {
            full.clear_border(x as usize);
            full.eroded()
        };
        let among = occupied.clone().filter(|_| params.fit && !by_occupancy).map(surrounded);
        let full = match params.cull {
            Cull::Count(least) => Some(lattice.count(source, least.clamp(1, 255) as u8, level)),
            Cull::Occupancy => occupied,
            Cull::Off => None,
        };
        let (mut inner, mut deep) = (Bits::default(), Bits::default());
        if let Some(full) = full {
            inner = surrounded(full);
            deep = inner.eroded();
        }
        Some(Self { low, edge, dims, places, inner, deep, among, sparse })
    }

    /// How many cells there are, and how many are inner.
    pub fn counts(&self) -> (usize, usize) {
        let inner = self.inner.bits.par_iter().map(|w| w.count_ones() as usize).sum();
        (self.inner.bits.len() * 64, inner)
    }

    /// Bytes it holds.
    pub fn bytes(&self) -> usize {
        let some = self.sparse.iter().chain(&self.among).map(|s| s.bits.len()).sum::<usize>();
        (self.inner.bits.len() + self.deep.bits.len() + some) * 8
    }

    /// The inner cells as cubes, each cell in one.
    pub fn cubes(&self) -> Vec<Cube> {
        if self.inner.bits.is_empty() {
            return Vec::new();
        }
        let mut sizes = vec![self.inner.clone()];
        while let Some(last) = sizes.last()
            && sizes.len() < SIZES as usize
        {
            let next = last.halved();
            sizes.push(next);
        }
        let mut cubes = Vec::new();
        for (n, bits) in sizes.iter().enumerate() {
            bits.list(sizes.get(n + 1), (1 << n) as f32, &mut cubes);
        }
        cubes
    }

    /// The cell of a point.
    pub fn cell(&self, p: [f32; 3]) -> u32 {
        self.places.of(p)
    }

    /// Constants of [`of_points`] for its places.
    pub fn rows(&self) -> Rows {
        self.places.in_rows()
    }

    /// Whether a cell is sparse.
    #[inline(always)]
    pub fn is_sparse(&self, cell: u32) -> bool {
        self.sparse.as_ref().is_some_and(|sparse| sparse.get(cell))
    }

    /// Whether a sphere of this radius lies within inner cells if its centre's cell is deep.
    pub fn deep_covers(&self, radius: f32) -> bool {
        radius <= (1.0 - SLACK) * self.edge
    }

    /// Whether a cell and all around it hold particles, whatever the rule of culling.
    pub fn is_among(&self, cell: u32) -> bool {
        self.among.as_ref().unwrap_or(&self.inner).get(cell)
    }

    /// Whether a cell is deep.
    #[inline(always)]
    pub fn is_deep(&self, cell: u32) -> bool {
        self.deep.get(cell)
    }

    /// Whether a sphere with its centre `p` in cell number `cell` lies within inner cells.
    #[inline(always)]
    pub fn covers(&self, cell: u32, p: [f32; 3], radius: f32) -> bool {
        if !self.inner.get(cell) {
            return false;
        }
        self.deep.get(cell) && self.deep_covers(radius)
            || radius <= (0.5 - SLACK) * self.edge && self.corner_is_inner(p)
    }

    /// Whether the eight cells around the corner nearest to `p` of its cell are inner.
    fn corner_is_inner(&self, p: [f32; 3]) -> bool {
        let from = |axis: usize| {
            // Inner cells are never at the border.
            let at = (p[axis] - self.low[axis]) / self.edge - 0.5;
            at as usize
        };
        let (x, y, z) = (from(0), from(1), from(2));
        [(y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)].iter().all(|(y, z)| {
            let row = self.inner.row(*y, *z);
            let bit = |x: usize| row.get(x / 64).is_some_and(|w| w >> (x % 64) & 1 == 1);
            bit(x) && bit(x + 1)
        })
    }
}

/// The lattice while it is filled.
struct Lattice {
    places: Places,
    dims: [u32; 3],
    /// Smaller spheres do not fill a cell.
    filling: f32,
}

impl Lattice {
    fn words(&self) -> usize {
        self.dims.iter().map(|d| *d as usize).product::<usize>() / 64
    }

    fn bits(&self, bits: Vec<u64>) -> Bits {
        let [x, y, z] = self.dims.map(|d| d as usize);
        Bits { words: x / 64, rows: y, planes: z, bits }
    }

    /// Fills one copy per worker with `fill`, chunk by chunk.
    fn copies<T: Clone + Default + Send>(
        &self,
        source: &Source<'_>,
        len: usize,
        fill: impl Fn(&Piece<'_>, &mut [T]) + Sync,
    ) -> Vec<Vec<T>> {
        let most = (COPIES_BYTES / (len * size_of::<T>()).max(1)).max(1);
        let workers = rayon::current_num_threads().min(most).min(source.chunks().max(1));
        let next = AtomicUsize::new(0);
        (0..workers)
            .into_par_iter()
            .with_max_len(1)
            .map(|_| {
                let (mut copy, mut memory) = (vec![T::default(); len], Gathered::default());
                loop {
                    let chunk = next.fetch_add(1, Ordering::Relaxed);
                    if chunk >= source.chunks() {
                        return copy;
                    }
                    fill(&source.piece(chunk, &mut memory), &mut copy);
                }
            })
            .collect()
    }

    /// The cells that hold a particle.
    fn occupy(&self, source: &Source<'_>, level: Level) -> Bits {
        let least = self.filling / source.radius_scale();
        let copies = self.copies(source, self.words(), |piece, bits| {
            dispatch!(level, simd => occupy(simd, &self.places, (piece, least), bits));
        });
        let mut copies = copies.into_iter();
        let mut all = copies.next().unwrap_or_default();
        for copy in copies {
            let parts = all.par_chunks_mut(1 << 14).zip(copy.par_chunks(1 << 14));
            parts.for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(a, b)| *a |= b));
        }
        self.bits(all)
    }

    /// The cells that hold `full` particles or more.
    fn count(&self, source: &Source<'_>, full: u8, level: Level) -> Bits {
        let least = self.filling / source.radius_scale();
        let copies = self.copies(source, self.words() * 64, |piece, counts: &mut [u8]| {
            let mut one = |cell: u32| {
                let count = &mut counts[cell as usize];
                *count = count.saturating_add(1);
            };
            dispatch!(level, simd => each_cell(simd, &self.places, (piece, least), &mut one));
        });
        let word = |w: usize| {
            (0..64).fold(0u64, |word, bit| {
                let sum = copies.iter().map(|c| u32::from(c[64 * w + bit])).sum::<u32>();
                word | u64::from(sum >= u32::from(full)) << bit
            })
        };
        self.bits((0..self.words()).into_par_iter().map(word).collect())
    }
}

/// Sets the bits of the cells of particles with radius `least` or more.
#[simd]
fn occupy<S: Simd>(simd: S, places: &Places, (piece, least): (&Piece<'_>, f32), bits: &mut [u64]) {
    let mut set = |cell: u32| {
        if let Some(word) = bits.get_mut((cell / 64) as usize) {
            *word |= 1 << (cell % 64);
        }
    };
    each_cell_inline(simd, places, (piece, least), &mut set);
}

/// Tells `one` the cell of each particle with radius `least` or more.
#[simd]
fn each_cell<S: Simd, F: FnMut(u32)>(
    simd: S,
    places: &Places,
    (piece, least): (&Piece<'_>, f32),
    one: &mut F,
) {
    each_cell_inline(simd, places, (piece, least), one);
}

#[inline(always)]
fn each_cell_inline<S: Simd, F: FnMut(u32)>(
    simd: S,
    places: &Places,
    (piece, least): (&Piece<'_>, f32),
    one: &mut F,
) {
    let all = matches!(piece.radii, Radii::Uniform(_));
    let rows = places.in_rows();
    let batches = piece.positions.chunks_exact(BATCH);
    let rest = batches.remainder();
    for (b, batch) in batches.enumerate() {
        let cells = of_points(simd, &rows, batch);
        for (i, cell) in cells.into_iter().enumerate() {
            if all || piece.radius(b * BATCH + i) >= least {
                one(cell);
            }
        }
    }
    let first = piece.positions.len() - rest.len();
    for (i, p) in rest.iter().enumerate() {
        if piece.radius(first + i) >= least {
            one(places.of(*p));
        }
    }
}

impl Bits {
    #[inline(always)]
    fn get(&self, cell: u32) -> bool {
        self.bits.get((cell / 64) as usize).is_some_and(|w| w >> (cell % 64) & 1 == 1)
    }

    /// The words of a row; none beyond the box.
    fn row(&self, y: usize, z: usize) -> &[u64] {
        if y >= self.rows || z >= self.planes {
            return &[];
        }
        let at = (z * self.rows + y) * self.words;
        &self.bits[at..at + self.words]
    }

    /// Clears the cells at the border of a box of `x` cells along its rows.
    fn clear_border(&mut self, x: usize) {
        for z in 0..self.planes {
            for y in 0..self.rows {
                let at = (z * self.rows + y) * self.words;
                let row = &mut self.bits[at..at + self.words];
                if z == 0 || y == 0 || z + 1 == self.planes || y + 1 == self.rows {
                    row.fill(0);
                    continue;
                }
                row[0] &= !1;
                for (w, word) in row.iter_mut().enumerate().skip((x - 1) / 64) {
                    let kept = (x - 1).saturating_sub(64 * w).min(64);
                    *word &= if kept == 64 { u64::MAX } else { (1 << kept) - 1 };
                }
            }
        }
    }

    /// The cells that are set and whose 26 around are: three passes, one per axis.
    fn eroded(&self) -> Self {
        let plane = self.words * self.rows;
        let mut along_xy = self.clone();
        along_xy.bits.par_chunks_mut(plane).enumerate().for_each(|(z, to)| {
            let mut along_x = vec![0; plane];
            for y in 0..self.rows {
                erode_row(self.row(y, z), &mut along_x[y * self.words..(y + 1) * self.words]);
            }
            to.fill(0);
            for i in self.words..plane.saturating_sub(self.words) {
                to[i] = along_x[i - self.words] & along_x[i] & along_x[i + self.words];
            }
        });
        let mut eroded = self.clone();
        eroded.bits.par_chunks_mut(plane).enumerate().for_each(|(z, to)| {
            if z == 0 || z + 1 == self.planes {
                return to.fill(0);
            }
            let from = &along_xy.bits[(z - 1) * plane..(z + 2) * plane];
            for (i, to) in to.iter_mut().enumerate() {
                *to = from[i] & from[plane + i] & from[2 * plane + i];
            }
        });
        eroded
    }

    /// The set cells that have, with themselves, no more than [`FEW`] set cells around them.
    fn sparse(&self) -> Self {
        let plane = self.words * self.rows;
        let mut sparse = self.clone();
        sparse.bits.par_chunks_mut(plane).enumerate().for_each(|(z, to)| {
            for y in 0..self.rows {
                // Beyond the box, too, there is nothing.
                let near = |dy: usize, dz: usize| match (y + dy, z + dz) {
                    (0, _) | (_, 0) => &[][..],
                    (y, z) => self.row(y - 1, z - 1),
                };
                let rows = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|i| near(i % 3, i / 3));
                for (w, to) in to[y * self.words..(y + 1) * self.words].iter_mut().enumerate() {
                    *to &= few(&rows, w);
                }
            }
        });
        sparse
    }

    /// Cells of twice the edge, set where all eight are.
    fn halved(&self) -> Self {
        let [words, rows, planes] =
            [self.words.div_ceil(2), self.rows.div_ceil(2), self.planes.div_ceil(2)];
        let mut bits = vec![0; words * rows * planes];
        bits.par_chunks_mut(words).enumerate().for_each(|(row, to)| {
            let (y, z) = (2 * (row % rows), 2 * (row / rows));
            let four =
                [(y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)].map(|(y, z)| self.row(y, z));
            for w in 0..self.words {
                let all = four.iter().map(|r| r.get(w).copied().unwrap_or(0));
                let all = all.fold(u64::MAX, |a, b| a & b);
                to[w / 2] |= even_bits(all & all >> 1) << (32 * (w % 2));
            }
        });
        Self { words, rows, planes, bits }
    }

    /// Lists the set cells that are not in a set cell of `larger`, each `size` cells along an edge.
    fn list(&self, larger: Option<&Self>, size: f32, cubes: &mut Vec<Cube>) {
        for z in 0..self.planes {
            for y in 0..self.rows {
                let above = larger.map_or(&[][..], |larger| larger.row(y / 2, z / 2));
                for (w, word) in self.row(y, z).iter().enumerate() {
                    let taken = above.get(w / 2).map_or(0, |a| twice(a >> (32 * (w % 2))));
                    let mut left = word & !taken;
                    while left != 0 {
                        let x = 64 * w + left.trailing_zeros() as usize;
                        left &= left - 1;
                        cubes.push([x as f32 * size, y as f32 * size, z as f32 * size, size]);
                    }
                }
            }
        }
    }
}

/// Cells of a row that are set, as both beside them.
fn erode_row(from: &[u64], to: &mut [u64]) {
    for (w, to) in to.iter_mut().enumerate() {
        let before = if w > 0 { from[w - 1] >> 63 } else { 0 };
        let after = from.get(w + 1).map_or(0, |next| next << 63);
        *to = from[w] & (from[w] << 1 | before) & (from[w] >> 1 | after);
    }
}

/// The cells of word `w` around which no more than [`FEW`] of nine rows are set: all 64 are counted at once, in
/// binary, one word for each digit.
fn few(rows: &[&[u64]; 9], w: usize) -> u64 {
    let (mut ones, mut twos, mut fours, mut more) = (0, 0, 0, 0);
    for row in rows {
        let word = |w: usize| row.get(w).copied().unwrap_or(0);
        let own = word(w);
        let before = if w > 0 { word(w - 1) >> 63 } else { 0 };
        for bits in [own, own << 1 | before, own >> 1 | word(w + 1) << 63] {
            let carry = ones & bits;
            ones ^= bits;
            let carry_on = twos & carry;
            twos ^= carry;
            more |= fours & carry_on;
            fours ^= carry_on;
        }
    }
    // Six and seven are more, too.
    const { assert!(FEW == 5) };
    !(more | fours & twos)
}

/// Bits 0, 2, 4 … of a word, side by side.
fn even_bits(word: u64) -> u64 {
    let mut w = word & 0x5555_5555_5555_5555;
    w = (w | w >> 1) & 0x3333_3333_3333_3333;
    w = (w | w >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    w = (w | w >> 4) & 0x00ff_00ff_00ff_00ff;
    w = (w | w >> 8) & 0x0000_ffff_0000_ffff;
    (w | w >> 16) & 0xffff_ffff
}

/// Each of the lower 32 bits of a word, twice.
fn twice(word: u64) -> u64 {
    let mut w = word & 0xffff_ffff;
    w = (w | w << 16) & 0x0000_ffff_0000_ffff;
    w = (w | w << 8) & 0x00ff_00ff_00ff_00ff;
    w = (w | w << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    w = (w | w << 2) & 0x3333_3333_3333_3333;
    w = (w | w << 1) & 0x5555_5555_5555_5555;
    w | w << 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_cells_are_counted_one_by_one() {
        let (words, rows, planes) = (2, 5, 4);
        let mut random = 5_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            random >> 32
        };
        // An eighth to a quarter of all cells, so that numbers around the limit are frequent.
        let mut word = || (0..64).fold(0, |w, i| w | u64::from(next() % 6 == 0) << i);
        let bits = Bits {
            words,
            rows,
            planes,
            bits: (0..words * rows * planes).map(|_| word()).collect(),
        };
        let set = |x: usize, y: usize, z: usize| {
            bits.row(y, z).get(x / 64).is_some_and(|w| w >> (x % 64) & 1 == 1)
        };
        let sparse = bits.sparse();
        let mut found = 0;
        for (x, y, z) in
            (0..planes).flat_map(|z| (0..rows).flat_map(move |y| (0..128).map(move |x| (x, y, z))))
        {
            let mut count = 0;
            for (dx, dy, dz) in (0..27_usize).map(|i| (i % 3, i / 3 % 3, i / 9)) {
                let near = (x + dx).checked_sub(1).zip((y + dy).checked_sub(1));
                let near = near.zip((z + dz).checked_sub(1));
                count += u32::from(near.is_some_and(|((x, y), z)| set(x, y, z)));
            }
            let expected = set(x, y, z) && count <= FEW;
            let word = sparse.row(y, z)[x / 64];
            assert_eq!(word >> (x % 64) & 1 == 1, expected, "({x}, {y}, {z}): {count}");
            found += u32::from(expected);
        }
        assert!(found > 50, "{found}");
    }
}
