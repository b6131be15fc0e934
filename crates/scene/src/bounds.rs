//! A box around what is visible.

use glam::DVec3;

/// An axis-aligned box in world coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The least corner.
    pub min: DVec3,
    /// The greatest corner.
    pub max: DVec3,
}

impl Bounds {
    /// A box of two corners, in any order.
    pub fn new(a: DVec3, b: DVec3) -> Self {
        Self { min: a.min(b), max: a.max(b) }
    }

    /// The box around spheres, `None` without any.
    pub fn of_spheres(spheres: impl IntoIterator<Item = (DVec3, f64)>) -> Option<Self> {
        spheres
            .into_iter()
            .map(|(center, radius)| Self { min: center - radius, max: center + radius })
            .reduce(Self::union)
    }

    /// The box around both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The centre.
    pub fn center(&self) -> DVec3 {
        self.min.midpoint(self.max)
    }

    /// The length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).length()
    }

    /// The eight corners; the bits of the index choose `max` for x, y, z.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, axis: usize| {
                if i >> bit & 1 == 1 { self.max[axis] } else { self.min[axis] }
            };
            DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
        })
    }
}
