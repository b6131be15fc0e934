//! The second sort: the particles of a bucket by block, and those of a block by cell.
//!
//! Both are counting sorts, stable, and run in cache: by block from the array to a scratch memory, by
//! cell from there back to the same places. In between, the cells of a block are chosen by the
//! particles it has.

use fearless_simd::{Level, dispatch};

use crate::cells::most_cells;
use crate::places::{Places, bounds_of_particles, number};
use crate::{Block, Lattice, Params, Particle, Radii};

/// Cells with more particles than this are searched for coinciding ones.
const CROWDED_CELL: usize = 64;

/// What all buckets share.
#[derive(Clone, Copy)]
pub(crate) struct Rules<'a> {
    pub lattice: &'a Lattice,
    pub places: Places,
    pub params: Params,
    /// In the file's order.
    pub radii: Radii<&'a [f32]>,
    pub level: Level,
}

/// A bucket at work.
pub(crate) struct Bucket<'a> {
    /// The number of its first block.
    pub first_block: usize,
    pub blocks: &'a mut [Block],
    /// The slot of its first particle.
    pub first: usize,
    pub particles: &'a mut [Particle],
    /// Empty where all radii are equal.
    pub radii: &'a mut [f32],
    /// The number of its first cell.
    pub first_cell: usize,
    /// First particle of each cell; as long as [`Rules::most_cells`] says.
    pub starts: &'a mut [u32],
}

/// Memory for the sort of one bucket, for one after the other.
#[derive(Default)]
pub(crate) struct Scratch {
    particles: Vec<Particle>,
    radii: Vec<f32>,
    /// The block of each particle, then its cell.
    numbers: Vec<u32>,
    /// Where the next particle of each block, then of each cell, goes.
    next: Vec<u32>,
    /// First particle of each block, counted from the bucket's.
    block_starts: Vec<u32>,
}

impl Bucket<'_> {
    /// Sorts the bucket. Gives the blocks in which particles coincide.
    pub fn sort(mut self, rules: &Rules<'_>, scratch: &mut Scratch) -> Vec<u32> {
        self.sort_by_block(rules, scratch);
        self.choose_cells(rules, scratch);
        self.sort_by_cell(rules, scratch)
    }

    /// Sorts by block into the scratch memory.
    fn sort_by_block(&mut self, rules: &Rules<'_>, scratch: &mut Scratch) {
        let (first_block, particles) = (self.first_block as u32, &*self.particles);
        let numbers = first_of(&mut scratch.numbers, particles.len());
        dispatch!(rules.level, simd => number(simd, &rules.places, particles, first_block, numbers));
        scratch.block_starts.clear();
        scratch.block_starts.resize(self.blocks.len() + 1, 0);
        let starts = &mut scratch.block_starts[..];
        for number in &*numbers {
            starts[*number as usize + 1] += 1;
        }
        for b in 0..self.blocks.len() {
            starts[b + 1] += starts[b];
        }
        scratch.next.clear();
        scratch.next.extend_from_slice(starts);
        place(
            particles,
            numbers,
            &mut scratch.next,
            first_of(&mut scratch.particles, particles.len()),
        );
        if !self.radii.is_empty() {
            scratch.next.copy_from_slice(starts);
            let radii = first_of(&mut scratch.radii, self.radii.len());
            place(self.radii, numbers, &mut scratch.next, radii);
        }
    }

    /// Tells each block its particles, and chooses its cells.
    fn choose_cells(&mut self, rules: &Rules<'_>, scratch: &Scratch) {
        let cell_edge = rules.lattice.edge / rules.params.block_cells.max(1) as f32;
        let mut cells = 0;
        for (b, block) in self.blocks.iter_mut().enumerate() {
            let corner = rules.lattice.corner(rules.lattice.block_at(self.first_block + b));
            let range = scratch.block_starts[b] as usize..scratch.block_starts[b + 1] as usize;
            *block = Block::empty(corner, cell_edge);
            block.first = (self.first + range.start) as u32;
            block.first_cell = (self.first_cell + cells) as u32;
            if range.is_empty() {
                continue;
            }
            let particles = &scratch.particles[range.clone()];
            (block.low, block.high) =
                dispatch!(rules.level, simd => bounds_of_particles(simd, particles));
            (block.least_radius, block.greatest_radius) = match rules.radii {
                Radii::Uniform(r) => (r, r),
                Radii::Each(_) => range_of(&scratch.radii[range.clone()]),
            };
            // What the blocks before have left over may be used up.
            let most = most_cells(range.end, b + 1, rules.params) - cells;
            block.divide((range.len(), most), rules.params, f64::from(rules.lattice.edge));
            cells += block.cells.iter().product::<u32>() as usize;
        }
    }

    /// Sorts the particles of each block by cell, back to their array.
    fn sort_by_cell(&mut self, rules: &Rules<'_>, scratch: &mut Scratch) -> Vec<u32> {
        let mut crowded = Vec::new();
        let end_of_all = (self.first + self.particles.len()) as u32;
        let mut used = 0;
        for (b, block) in self.blocks.iter().enumerate().filter(|(_, b)| b.cells[0] > 0) {
            let range = scratch.block_starts[b] as usize..scratch.block_starts[b + 1] as usize;
            let cells = block.cells.iter().product::<u32>() as usize;
            let starts = &mut self.starts[used..used + cells];
            used += cells;
            let from = &scratch.particles[range.clone()];
            let numbers = &mut scratch.numbers[..from.len()];
            let places = Places::of_cells(block);
            dispatch!(rules.level, simd => number(simd, &places, from, 0, numbers));
            let next = &mut scratch.next;
            next.clear();
            next.resize(cells, 0);
            numbers.iter().for_each(|number| next[*number as usize] += 1);
            let (mut sum, mut fullest) = (0, 0);
            for (next, start) in next.iter_mut().zip(&mut *starts) {
                *start = block.first + sum;
                let count = std::mem::replace(next, sum);
                sum += count;
                fullest = fullest.max(count);
            }
            let to = &mut self.particles[range.clone()];
            place(from, numbers, next, to);
            let radii =
                if self.radii.is_empty() { &mut [] } else { &mut self.radii[range.clone()] };
            if !radii.is_empty() {
                next.iter_mut().zip(&*starts).for_each(|(next, start)| *next = start - block.first);
                place(&scratch.radii[range], numbers, next, radii);
            }
            if fullest as usize > CROWDED_CELL
                && sort_crowded((to, radii), (starts, block.first), rules.radii)
            {
                crowded.push((self.first_block + b) as u32);
            }
        }
        // What is left over are empty cells of no block.
        self.starts[used..].fill(end_of_all);
        crowded
    }
}

/// Puts each of `from` at the next place of its number.
fn place<T: Copy>(from: &[T], numbers: &[u32], next: &mut [u32], to: &mut [T]) {
    for (value, number) in from.iter().zip(numbers) {
        let next = &mut next[*number as usize];
        to[*next as usize] = *value;
        *next += 1;
    }
}

/// The first `len` elements of a memory that grows as needed; they hold any value.
fn first_of<T: bytemuck::Zeroable + Clone>(memory: &mut Vec<T>, len: usize) -> &mut [T] {
    if memory.len() < len {
        memory.resize(len, T::zeroed());
    }
    &mut memory[..len]
}

fn range_of(radii: &[f32]) -> (f32, f32) {
    radii.iter().fold((f32::INFINITY, 0.0), |(low, high), r| (low.min(*r), high.max(*r)))
}

/// Brings equal spheres of crowded cells side by side, the lower index first. Gives whether some
/// coincide.
fn sort_crowded(
    (particles, sorted_radii): (&mut [Particle], &mut [f32]),
    (starts, first): (&[u32], u32),
    radii: Radii<&[f32]>,
) -> bool {
    let radius = |p: &Particle| match radii {
        Radii::Uniform(_) => 0.0,
        Radii::Each(each) => each[p.index as usize],
    };
    let mut coincide = false;
    for c in 0..starts.len() {
        let start = (starts[c] - first) as usize;
        let end = starts.get(c + 1).map_or(particles.len(), |s| (s - first) as usize);
        let cell = &mut particles[start..end];
        if cell.len() > CROWDED_CELL {
            cell.sort_unstable_by_key(|p| {
                (p.center.map(f32::to_bits), radius(p).to_bits(), p.index)
            });
            coincide |= cell.windows(2).any(|w| w[0].center == w[1].center);
            if !sorted_radii.is_empty() {
                let places = sorted_radii[start..end].iter_mut();
                places.zip(&*cell).for_each(|(place, particle)| *place = radius(particle));
            }
        }
    }
    coincide
}
