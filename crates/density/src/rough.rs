//! The rough field: what is saturated for certain, from how full cells are.
//!
//! Yasuda et al. 2009, §4.2.1, saturate every voxel whose cell of the simulation's grid holds a particle. At
//! the edge of the liquid this moves the surface, as a voxel there has less density than that in truth.
//! Read here so that the picture stays what it is: a cell, about two particles wide, is full if its
//! particles' volume fills a good part of it, and saturated if it and the 26 around it are full. Particles
//! in *cores*, whose whole reach is saturated, need not be visited at all.

use std::ops::Range;

use motes_grid::Radii;
use rayon::prelude::*;

use crate::bins::Tiles;
use crate::fine::Desk;
use crate::lattice::Lattice;
use crate::params::Particles;

/// The part of a cell that particles fill where it is full. On a lattice, which may meet a cell with half
/// as many particles as fit, it is 0.5.
const FULL: f32 = 0.4;

/// Voxels along a cell's edge at the most.
const MOST_WIDE: f32 = 64.0;
/// Planes of cells that are worth a thread.
const MIN_PLANES: usize = 32;
/// Voxels at the rim of what is saturated that are not: the surface may go through a full cell.
const MARGIN: usize = 1;

/// Cells of the rough field.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rough {
    /// Voxels along a cell's edge: a power of two.
    pub edge: usize,
    /// Cells along each axis.
    dims: [usize; 3],
    /// Volume of the particles in each cell, in voxels; tile by tile.
    volumes: Vec<f32>,
    /// Whether a cell is saturated, x fastest.
    saturated: Vec<u8>,
    /// Whether all is that a particle in it can reach.
    core: Vec<u8>,
    spare: Vec<u8>,
}

/// Voxels along the edge of a cell that is about two particles wide.
pub(crate) fn edge(radius: f32, voxel: f32) -> usize {
    // A hair less, as the default voxel is exactly half a cell.
    let wide = (4.0 * radius / voxel * 0.999).ceil().clamp(1.0, MOST_WIDE);
    (wide as usize).next_power_of_two()
}

impl Rough {
    /// Finds what is saturated; `reach` is the particles' greatest, in voxels.
    pub fn fill(
        &mut self,
        (desks, tiles, particles): (&[Desk], Tiles, &Particles<'_>),
        lattice: &Lattice,
        (edge, reach): (usize, f32),
    ) {
        self.edge = edge;
        self.dims = lattice.dims.map(|n| n.div_ceil(edge));
        self.sum((desks, tiles), particles, lattice);
        self.find_full(tiles);
        self.erode_saturated(1);
        self.core.clone_from(&self.saturated);
        std::mem::swap(&mut self.core, &mut self.saturated);
        self.erode_saturated(((reach + MARGIN as f32) / edge as f32).ceil() as usize);
        std::mem::swap(&mut self.core, &mut self.saturated);
    }

    /// Rows of cells along a tile's edge.
    fn rows(&self, tiles: Tiles) -> usize {
        tiles.edge / self.edge
    }

    /// Adds up volumes, each tile those of its own particles.
    fn sum(
        &mut self,
        (desks, tiles): (&[Desk], Tiles),
        particles: &Particles<'_>,
        lattice: &Lattice,
    ) {
        let (rows, [along, ..]) = (self.rows(tiles), self.dims);
        let shift = self.edge.trailing_zeros();
        let volume = |radius: f32| (2.0 * radius / lattice.voxel).powi(3);
        let same = volume(particles.radius(0));
        self.volumes.clear();
        self.volumes.resize(tiles.count() * rows * rows * along, 0.0);
        let of_tiles = self.volumes.par_chunks_mut(rows * rows * along);
        of_tiles.zip(desks).for_each(|(volumes, desk)| {
            for row in desk.rows() {
                let [y, z] = row.at.map(|v| (v % tiles.edge) >> shift);
                let volumes = &mut volumes[(z * rows + y) * along..][..along];
                for x in 0..row.len() {
                    let own = row.of(x);
                    if own.is_empty() {
                        continue;
                    }
                    volumes[x >> shift] += match particles.radii {
                        Radii::Uniform(_) => own.len() as f32 * same,
                        Radii::Each(all) => {
                            own.iter().map(|entry| volume(all[entry.index as usize])).sum()
                        }
                    };
                }
            }
        });
    }

    /// Full cells, for now as the saturated ones.
    fn find_full(&mut self, tiles: Tiles) {
        let (rows, [nx, ny, nz]) = (self.rows(tiles), self.dims);
        let full = FULL * (self.edge * self.edge * self.edge) as f32;
        self.saturated.clear();
        self.saturated.resize(nx * ny * nz, 0);
        let volumes = &self.volumes;
        self.saturated.par_chunks_mut(nx * ny).enumerate().for_each(|(z, plane)| {
            for (y, row) in plane.chunks_mut(nx).enumerate() {
                let tile = z / rows * tiles.dims[0] + y / rows;
                let from = ((tile * rows + z % rows) * rows + y % rows) * nx;
                for (cell, volume) in row.iter_mut().zip(&volumes[from..from + nx]) {
                    *cell = u8::from(*volume >= full);
                }
            }
        });
    }

    /// Leaves those whose neighbours within `times` cells are set, too. What is outside is not.
    fn erode_saturated(&mut self, times: usize) {
        let [nx, ny, nz] = self.dims;
        for _ in 0..times {
            // Along x and y, then along z.
            self.spare.resize(self.saturated.len(), 0);
            let from = &self.saturated;
            let planes = self.spare.par_chunks_mut(nx * ny).zip(from.par_chunks(nx * ny));
            planes.with_min_len(MIN_PLANES).for_each(|(to, from)| {
                to.fill(0);
                for y in 1..ny.saturating_sub(1) {
                    for x in 1..nx.saturating_sub(1) {
                        let three = |y: usize| {
                            let at = y * nx + x;
                            from[at - 1] & from[at] & from[at + 1]
                        };
                        to[y * nx + x] = three(y - 1) & three(y) & three(y + 1);
                    }
                }
            });
            let flat = &self.spare;
            let planes = self.saturated.par_chunks_mut(nx * ny).enumerate();
            planes.with_min_len(MIN_PLANES).for_each(|(z, to)| {
                if z == 0 || z + 1 >= nz {
                    return to.fill(0);
                }
                let plane = |z: usize| &flat[z * nx * ny..(z + 1) * nx * ny];
                let (below, here, above) = (plane(z - 1), plane(z), plane(z + 1));
                for (i, to) in to.iter_mut().enumerate() {
                    *to = below[i] & here[i] & above[i];
                }
            });
        }
    }

    /// Calls `visit` with each run of saturated voxels of a row.
    pub fn visit_row(&self, [y, z]: [usize; 2], mut visit: impl FnMut(Range<usize>)) {
        let [nx, ny, nz] = self.dims;
        let cell = |v: usize| v / self.edge;
        let (y0, z0) = (y.saturating_sub(MARGIN), z.saturating_sub(MARGIN));
        let (y1, z1) = (cell(y + MARGIN), cell(z + MARGIN));
        if y1 >= ny || z1 >= nz {
            return;
        }
        let row = |y: usize, z: usize| {
            let from = (z * ny + y) * nx;
            &self.saturated[from..from + nx]
        };
        let rows = [row(cell(y0), cell(z0)), row(cell(y0), z1), row(y1, cell(z0)), row(y1, z1)];
        let mut begin = None;
        for x in 0..=nx {
            let set = x < nx && rows.iter().all(|row| row[x] != 0);
            match (set, begin) {
                (true, None) => begin = Some(x),
                (false, Some(first)) => {
                    visit(first * self.edge + MARGIN..x * self.edge - MARGIN);
                    begin = None;
                }
                _ => {}
            }
        }
    }

    /// Whether all that particles in a cell of the field reach is saturated.
    #[inline(always)]
    pub fn is_core(&self, cell: [usize; 3]) -> bool {
        let [nx, ny, nz] = self.dims;
        let [x, y, z] = cell.map(|v| v >> self.edge.trailing_zeros());
        let inside = x < nx && y < ny && z < nz;
        inside && self.core[(z * ny + y) * nx + x] != 0
    }
}
