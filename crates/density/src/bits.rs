//! Bits of all cells, 64 along x to a word.

use rayon::prelude::*;

/// Bits of a box of cells; those beyond its end along x are 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Bits {
    /// Words in a row.
    pub words: usize,
    /// Rows along y, and planes along z.
    pub rows: [usize; 2],
    pub bits: Vec<u64>,
}

impl Bits {
    /// Makes them as many as a box of cells has, with any values.
    pub fn resize(&mut self, [nx, ny, nz]: [usize; 3]) {
        self.words = nx.div_ceil(64);
        self.rows = [ny, nz];
        self.bits.resize(self.words * ny * nz, 0);
    }

    /// Words in a plane.
    pub fn plane(&self) -> usize {
        self.words * self.rows[0]
    }

    /// Sets a bit.
    pub fn set(&mut self, [x, y, z]: [usize; 3]) {
        self.bits[(z * self.rows[0] + y) * self.words + x / 64] |= 1 << (x % 64);
    }

    /// Whether a bit is set.
    #[inline(always)]
    pub fn get(&self, [x, y, z]: [usize; 3]) -> bool {
        self.bits[(z * self.rows[0] + y) * self.words + x / 64] >> (x % 64) & 1 == 1
    }

    /// Sets all within a cube of `half` cells around cells of `from` of which all within less are set
    /// already, but for one in `half`: itself and the cells `half` away. `flat` is for use meanwhile.
    pub fn spread(&mut self, from: &Self, half: usize, flat: &mut Self) {
        let (words, plane, [ny, nz]) = (from.words, from.plane(), from.rows);
        for to in [&mut *self, &mut *flat] {
            (to.words, to.rows) = (words, from.rows);
            to.bits.resize(from.bits.len(), 0);
        }
        // Along x and y.
        let planes = flat.bits.par_chunks_mut(plane).zip(from.bits.par_chunks(plane));
        planes.for_each(|(to, from)| {
            to.fill(0);
            for (y, row) in from.chunks_exact(words).enumerate() {
                let rows = [y.checked_sub(half), Some(y), Some(y + half).filter(|y| *y < ny)];
                for near in rows.into_iter().flatten() {
                    let to = &mut to[near * words..(near + 1) * words];
                    for (word, to) in to.iter_mut().enumerate() {
                        *to |= spread_word(row, word, half);
                    }
                }
            }
        });
        // Along z.
        let flat = &flat.bits;
        self.bits.par_chunks_mut(plane).enumerate().for_each(|(z, to)| {
            to.copy_from_slice(&flat[z * plane..(z + 1) * plane]);
            let near = [z.checked_sub(half), Some(z + half).filter(|z| *z < nz)];
            for z in near.into_iter().flatten() {
                let from = &flat[z * plane..(z + 1) * plane];
                to.iter_mut().zip(from).for_each(|(to, from)| *to |= from);
            }
        });
    }

    /// The least and the greatest cell that is set; none if none is.
    pub fn bounds(&self) -> Option<[[usize; 3]; 2]> {
        let mut found: Option<[[usize; 3]; 2]> = None;
        for (row, words) in self.bits.chunks_exact(self.words.max(1)).enumerate() {
            let Some(first) = words.iter().position(|w| *w != 0) else { continue };
            let last = words.iter().rposition(|w| *w != 0).unwrap_or(first);
            let low = first * 64 + words[first].trailing_zeros() as usize;
            let high = last * 64 + 63 - words[last].leading_zeros() as usize;
            let [y, z] = [row % self.rows[0], row / self.rows[0]];
            let [a, b] = found.unwrap_or([[low, y, z], [high, y, z]]);
            found = Some([
                [a[0].min(low), a[1].min(y), a[2].min(z)],
                [b[0].max(high), b[1].max(y), b[2].max(z)],
            ]);
        }
        found
    }
}

/// A word of a row, with what lies `half` bits before and behind.
#[inline(always)]
fn spread_word(row: &[u64], word: usize, half: usize) -> u64 {
    let here = row[word];
    let before = if word > 0 { row[word - 1] } else { 0 };
    let after = row.get(word + 1).copied().unwrap_or(0);
    here | here << half | before >> (64 - half) | here >> half | after << (64 - half)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_reaches_as_far_as_it_says() {
        let dims = [130, 9, 7];
        let mut bits = Bits::default();
        bits.resize(dims);
        let set = [[0, 0, 0], [64, 4, 3], [129, 8, 6]];
        set.iter().for_each(|cell| bits.set(*cell));
        let (mut one, mut three, mut flat) = (Bits::default(), Bits::default(), Bits::default());
        one.spread(&bits, 1, &mut flat);
        three.spread(&one, 2, &mut flat);
        for (bits, reach) in [(&one, 1), (&three, 3)] {
            for z in 0..dims[2] {
                for y in 0..dims[1] {
                    for x in 0..dims[0] {
                        let word = bits.bits[(z * dims[1] + y) * bits.words + x / 64];
                        let near = |c: &[usize; 3]| {
                            let d = [x.abs_diff(c[0]), y.abs_diff(c[1]), z.abs_diff(c[2])];
                            d.iter().all(|d| *d <= reach)
                        };
                        assert_eq!(word >> (x % 64) & 1 == 1, set.iter().any(near), "{x} {y} {z}");
                    }
                }
            }
        }
        assert_eq!(bits.bounds(), Some([[0, 0, 0], [129, 8, 6]]));
    }
}
