//! Cuts by planes: which spheres they leave, and which part of a ray.
//!
//! Chaudhari, *Real-Time Cross-Sectioning of Dynamic Particle Systems*, §3.1: a plane by a point p and a
//! normal n. Here it keeps the half-space
//!
//! > h(x) = n·x − n·p ≥ 0
//!
//! A [`Clip`] keeps what all of its clauses keep, a [`Clause`] what any of its faces keeps: every
//! combination of half-spaces by intersection and union can be written so. On a ray, a clause leaves
//! out at most one gap, as the half-lines that it does not keep overlap in one interval.

use glam::{DVec3, Vec3};

/// A plane, and the half-space that it keeps: h(x) = normal·x − offset ≥ 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit vector towards what is kept.
    pub normal: Vec3,
    /// normal·p for any point p of the plane, about the grid's origin.
    pub offset: f32,
}

impl Plane {
    /// The plane through `point`, given about the grid's origin; `None` where the normal has no length,
    /// or a number is not finite.
    pub fn new(point: DVec3, normal: DVec3) -> Option<Self> {
        let normal = normal.try_normalize()?.as_vec3();
        // By the normal as it is kept, so that the plane goes through its point.
        let offset = normal.as_dvec3().dot(point) as f32;
        offset.is_finite().then_some(Self { normal, offset })
    }

    /// h(x): how far `x` lies from the plane, on the kept side above 0.
    #[inline(always)]
    pub fn height(&self, x: Vec3) -> f32 {
        self.rise(x) - self.offset
    }

    /// normal·x, by exact fused multiply-adds: all that walk rays do the same, so that all agree bit for
    /// bit. It does not fall as x goes with the normal along an axis, rounding included.
    #[inline(always)]
    pub fn rise(&self, x: Vec3) -> f32 {
        x.z.mul_add(self.normal.z, x.y.mul_add(self.normal.y, x.x * self.normal.x))
    }

    /// Least and greatest height in the box `low..high`; no computed height of a point in it lies outside.
    #[inline(always)]
    pub fn heights(&self, low: Vec3, high: Vec3) -> (f32, f32) {
        let up = self.normal.cmpge(Vec3::ZERO);
        (self.height(Vec3::select(up, low, high)), self.height(Vec3::select(up, high, low)))
    }
}

/// How a plane cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Spheres stay whole, or go whole, by their centre.
    Center,
    /// Spheres are cut, and closed with flat caps.
    Caps,
    /// Spheres are cut and left open: hollow shells.
    Open,
}

/// One plane of a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Where.
    pub plane: Plane,
    /// How.
    pub cut: Cut,
    /// Whose it is: a number for the caller, such as the section's place in the scene.
    pub owner: u16,
}

impl Face {
    /// Whether the face keeps a sphere: its centre, or, of an exact cut, any of its inside.
    #[inline(always)]
    pub fn keeps(&self, center: Vec3, radius: f32) -> bool {
        self.keeps_at(self.plane.height(center), radius)
    }

    #[inline(always)]
    fn keeps_at(&self, height: f32, radius: f32) -> bool {
        if self.cut == Cut::Center { height >= 0.0 } else { height + radius > 0.0 }
    }
}

/// What a part of space is to a clause or a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// All spheres in it go.
    Gone,
    /// All are kept, the exact cuts of some perhaps through their inside.
    Kept,
    /// Each has to be asked.
    Mixed,
}

/// Faces that keep what any of them keeps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clause {
    /// The faces: all cut by centre, or none does.
    pub faces: Vec<Face>,
}

impl Clause {
    /// Whether the clause keeps a sphere.
    #[inline(always)]
    pub fn keeps(&self, center: Vec3, radius: f32) -> bool {
        self.faces.iter().any(|face| face.keeps(center, radius))
    }

    /// The fate of spheres with centres in the box `low..high` and radii in `radii`, least and greatest.
    pub fn fate(&self, (low, high): (Vec3, Vec3), radii: (f32, f32)) -> Fate {
        let mut fate = Fate::Gone;
        for face in &self.faces {
            let (least, greatest) = face.plane.heights(low, high);
            if face.keeps_at(least, radii.0) {
                return Fate::Kept;
            }
            if face.keeps_at(greatest, radii.1) {
                fate = Fate::Mixed;
            }
        }
        fate
    }

    /// Whether its faces cut through spheres.
    pub fn is_exact(&self) -> bool {
        self.faces.iter().any(|face| face.cut != Cut::Center)
    }

    /// The part of a ray that it leaves out.
    fn gap(&self, origin: Vec3, direction: Vec3) -> Option<Gap> {
        let mut gap = Gap { low: f32::NEG_INFINITY, high: f32::INFINITY, ends: (None, None) };
        for (i, face) in self.faces.iter().enumerate() {
            let (height, slope) = (face.plane.height(origin), face.plane.rise(direction));
            let at = -height / slope;
            if slope > 0.0 && at < gap.high {
                (gap.high, gap.ends.1) = (at, Some(i));
            } else if slope < 0.0 && at > gap.low {
                (gap.low, gap.ends.0) = (at, Some(i));
            } else if slope == 0.0 && height >= 0.0 {
                return None;
            }
        }
        (gap.low < gap.high).then_some(gap)
    }
}

/// What a clause leaves out of a ray: all between two distances, and which faces are there.
#[derive(Clone, Copy)]
struct Gap {
    low: f32,
    high: f32,
    ends: (Option<usize>, Option<usize>),
}

/// A part of a ray that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Distance where it begins.
    pub begin: f32,
    /// Distance where it ends; above `begin`.
    pub end: f32,
    /// The face that the ray comes in through; `None` where the stretch begins because the ray does.
    pub enters: Option<Face>,
    /// The face that it goes out through; `None` where it ends because the ray does.
    pub leaves: Option<Face>,
}

/// What is kept: what all clauses keep. Without clauses, everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    /// The clauses.
    pub clauses: Vec<Clause>,
}

impl Clip {
    /// Whether it keeps everything.
    pub fn is_empty(&self) -> bool {
        self.clauses.is_empty()
    }

    /// Whether a sphere counts as visible: every clause keeps it.
    #[inline(always)]
    pub fn keeps(&self, center: Vec3, radius: f32) -> bool {
        self.clauses.iter().all(|clause| clause.keeps(center, radius))
    }

    /// The fate of spheres with centres in the box `low..high` and radii in `radii`, least and greatest.
    pub fn fate(&self, bounds: (Vec3, Vec3), radii: (f32, f32)) -> Fate {
        let mut fate = Fate::Kept;
        for clause in &self.clauses {
            match clause.fate(bounds, radii) {
                Fate::Gone => return Fate::Gone,
                Fate::Mixed => fate = Fate::Mixed,
                Fate::Kept => {}
            }
        }
        fate
    }

    /// The clauses that cut through spheres: those that rays ask.
    pub fn exact(&self) -> Self {
        let exact = self.clauses.iter().filter(|clause| clause.is_exact());
        Self { clauses: exact.cloned().collect() }
    }

    /// The same for particles that make a liquid, which is cut where rays pass: they go by their centres, and by exact
    /// cuts only those that lie more than `margin` beyond.
    pub fn of_liquid(&self, margin: f32) -> Self {
        let mut clip = self.clone();
        for face in clip.clauses.iter_mut().flat_map(|clause| &mut clause.faces) {
            if face.cut != Cut::Center {
                face.cut = Cut::Center;
                face.plane.offset -= margin;
            }
        }
        clip
    }

    /// All faces, clause by clause.
    pub fn faces(&self) -> impl Iterator<Item = &Face> {
        self.clauses.iter().flat_map(|clause| &clause.faces)
    }

    /// Puts the parts of a ray that are kept into `stretches`, nearest first: those of the distances from
    /// `range.0` to `range.1` that no clause leaves out, at most one more than there are clauses.
    ///
    /// A ray in a face's plane lies in its half-space. Faces that a ray meets at the same distance count
    /// as met in their order.
    pub fn stretches(
        &self,
        (origin, direction): (Vec3, Vec3),
        range: (f32, f32),
        stretches: &mut Vec<Stretch>,
    ) {
        stretches.clear();
        let gaps = || {
            let of = |clause: &'_ Clause| clause.gap(origin, direction);
            self.clauses.iter().filter_map(move |clause| Some((clause, of(clause)?)))
        };
        let (mut begin, mut enters) = (range.0, None);
        loop {
            // Out of all gaps, one after another.
            while let Some((clause, gap)) = gaps().find(|(_, g)| g.low <= begin && begin < g.high) {
                (begin, enters) = (gap.high, gap.ends.1.map(|i| clause.faces[i]));
            }
            if begin >= range.1 {
                return;
            }
            let (mut end, mut leaves) = (range.1, None);
            for (clause, gap) in gaps().filter(|(_, gap)| gap.low > begin) {
                if gap.low < end {
                    (end, leaves) = (gap.low, gap.ends.0.map(|i| clause.faces[i]));
                }
            }
            stretches.push(Stretch { begin, end, enters, leaves });
            if end >= range.1 {
                return;
            }
            begin = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(point: [f64; 3], normal: [f64; 3], owner: u16) -> Face {
        let plane = Plane::new(point.into(), normal.into()).unwrap();
        Face { plane, cut: Cut::Caps, owner }
    }

    fn clause(faces: &[Face]) -> Clause {
        Clause { faces: faces.to_vec() }
    }

    fn along_x(clip: &Clip, y: f32) -> Vec<(f32, f32, Option<u16>, Option<u16>)> {
        let mut all = Vec::new();
        clip.stretches((Vec3::new(-10.0, y, 0.0), Vec3::X), (0.0, f32::INFINITY), &mut all);
        let owner = |face: Option<Face>| face.map(|f| f.owner);
        all.iter().map(|s| (s.begin, s.end, owner(s.enters), owner(s.leaves))).collect()
    }

    #[test]
    fn a_slab_is_one_stretch_and_its_outside_two() {
        let (low, high) =
            (face([-1.0, 0.0, 0.0], [2.0, 0.0, 0.0], 0), face([1.0; 3], [-1.0, 0.0, 0.0], 1));
        let slab = Clip { clauses: vec![clause(&[low]), clause(&[high])] };
        assert_eq!(along_x(&slab, 0.0), [(9.0, 11.0, Some(0), Some(1))]);
        let (below, above) =
            (face([-1.0; 3], [-1.0, 0.0, 0.0], 2), face([1.0; 3], [1.0, 0.0, 0.0], 3));
        let outside = Clip { clauses: vec![clause(&[below, above])] };
        let infinity = f32::INFINITY;
        let expected = [(0.0, 9.0, None, Some(2)), (11.0, infinity, Some(3), None)];
        assert_eq!(along_x(&outside, 0.0), expected);
        let none = Clip { clauses: [slab.clauses, outside.clauses].concat() };
        assert_eq!(along_x(&none, 0.0), []);
        assert_eq!(along_x(&Clip::default(), 0.0), [(0.0, infinity, None, None)]);
    }

    #[test]
    fn a_ray_in_the_plane_is_kept_and_one_beside_it_is_not() {
        let floor = Clip { clauses: vec![clause(&[face([0.0; 3], [0.0, 1.0, 0.0], 0)])] };
        assert_eq!(along_x(&floor, 0.0).len(), 1);
        assert_eq!(along_x(&floor, 1e-30).len(), 1);
        assert_eq!(along_x(&floor, -1e-30).len(), 0);
    }

    #[test]
    fn planes_need_a_normal_and_finite_numbers() {
        let plane = |p: [f64; 3], n: [f64; 3]| Plane::new(p.into(), n.into());
        assert_eq!(plane([0.0; 3], [0.0; 3]), None);
        assert_eq!(plane([f64::INFINITY, 0.0, 0.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(plane([f64::NAN; 3], [1.0, 0.0, 0.0]), None);
        assert_eq!(plane([0.0; 3], [f64::NAN, 1.0, 0.0]), None);
        let far = plane([1e6, 2.0, 3.0], [0.0, 0.0, 1e-9]).unwrap();
        assert_eq!((far.normal, far.offset), (Vec3::Z, 3.0));
    }
}
