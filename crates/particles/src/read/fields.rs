//! From named numbers to particles: which field is a position, a radius, a part of a vector.
//!
//! Formats whose files name their fields themselves (PLY vertices, NumPy records and archives) say
//! what there is as [`Slot`]s; a [`Table`] takes the rows and gives [`Particles`].

use super::lanes::{Lane, Scalar, append, append_positions, append_scaled};
use super::{Wanted, names};
use crate::{Column, Particles, PositionBuilder, Radius, Values};

/// One number per particle, by the file's own name.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    /// The field's name.
    pub(crate) name: String,
    /// Which component of how many, where the field is a vector in the file.
    pub(crate) component: Option<(usize, usize)>,
    pub(crate) scalar: Scalar,
}

/// What becomes of a column's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Conversion {
    Keep,
    /// Times this, as f32.
    Scale(f64),
    /// One minus this times the number: opacity to transparency.
    Opacity(f64),
}

#[derive(Clone, Debug)]
struct Planned {
    name: String,
    slots: Vec<usize>,
    conversion: Conversion,
}

/// What each slot is for.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    position: [Option<usize>; 3],
    position_scalars: [Scalar; 3],
    radius: Option<(usize, f64)>,
    columns: Vec<Planned>,
    scalars: Vec<Scalar>,
}

/// Names of fields that hold whole positions, the likelier first.
pub(crate) const POSITION_VECTORS: &[&str] =
    &["position", "positions", "pos", "coordinates", "coords", "coord", "xyz", "points", "x", "r"];

/// Radii by name, with the factor that makes them radii.
const RADII: &[(&str, f64)] =
    &[("radius", 1.0), ("radii", 1.0), ("rad", 1.0), ("r", 1.0), ("diameter", 0.5)];

/// The slots not yet given a purpose, searched by name whatever the case.
struct Open<'a> {
    slots: &'a [Slot],
    taken: Vec<bool>,
}

impl Open<'_> {
    /// The slot of the scalar field `name`.
    fn scalar(&self, name: &str) -> Option<usize> {
        self.slots.iter().enumerate().position(|(i, slot)| {
            !self.taken[i] && slot.component.is_none() && slot.name.eq_ignore_ascii_case(name)
        })
    }

    /// The slots of the vector field `name`, by component.
    fn vector(&self, name: &str) -> Option<Vec<usize>> {
        let first = self.slots.iter().enumerate().position(|(i, slot)| {
            let starts = matches!(slot.component, Some((0, of)) if of > 1);
            !self.taken[i] && starts && slot.name.eq_ignore_ascii_case(name)
        })?;
        let of = self.slots[first].component.map_or(1, |(_, of)| of);
        Some((first..(first + of).min(self.slots.len())).collect())
    }

    /// The slots of the scalar fields `x`, `y` and perhaps `z`.
    fn triple(&self, parts: &[&str; 3]) -> Option<Vec<usize>> {
        let mut found = vec![self.scalar(parts[0])?, self.scalar(parts[1])?];
        found.extend(self.scalar(parts[2]));
        Some(found)
    }

    fn take(&mut self, slots: &[usize]) {
        slots.iter().for_each(|slot| self.taken[*slot] = true);
    }
}

/// The factor that takes a colour or an opacity to 0–1.
fn full_scale(scalar: Scalar) -> f64 {
    match scalar {
        Scalar::U16 => 1.0 / 65535.0,
        s if s.is_float() => 1.0,
        _ => 1.0 / 255.0,
    }
}

impl Plan {
    /// Finds each slot's purpose; `None` where there are no positions.
    pub(crate) fn new(slots: &[Slot], wanted: &Wanted) -> Option<Self> {
        let mut open = Open { slots, taken: vec![false; slots.len()] };
        let found = open.triple(&["x", "y", "z"]).or_else(|| {
            let mut vectors = POSITION_VECTORS.iter().filter_map(|name| open.vector(name));
            vectors.find(|v| matches!(v.len(), 2..=3))
        })?;
        open.take(&found);
        let position = std::array::from_fn(|i| found.get(i).copied());
        let scalar_of = |i: usize| slots[found.get(i).copied().unwrap_or(found[0])].scalar;
        // Beside `g` and `b`, `r` is red.
        let is_red = open.scalar("g").is_some() && open.scalar("b").is_some();
        let radius = RADII
            .iter()
            .filter(|(name, _)| *name != "r" || !is_red)
            .find_map(|(name, factor)| Some((open.scalar(name)?, *factor)));
        open.taken.iter_mut().enumerate().for_each(|(i, taken)| {
            *taken |= radius.is_some_and(|(slot, _)| slot == i);
        });
        let mut columns = Vec::new();
        for group in groups(&open) {
            group.plan(&open, &mut columns);
        }
        plan_colours(&mut columns, slots);
        // The order of the file, whatever the order of discovery.
        columns.sort_by_key(|c| c.slots.first().copied());
        columns.retain(|c| wanted.wants(&c.name));
        Some(Self {
            position,
            position_scalars: std::array::from_fn(scalar_of),
            radius,
            columns,
            scalars: slots.iter().map(|s| s.scalar).collect(),
        })
    }
}

impl Plan {
    /// Whether slot `slot` is read at all.
    pub(crate) fn uses(&self, slot: usize) -> bool {
        self.position.contains(&Some(slot))
            || self.radius.is_some_and(|(radius, _)| radius == slot)
            || self.columns.iter().any(|c| c.slots.contains(&slot))
    }
}

impl Planned {
    fn keep(name: impl Into<String>, slots: Vec<usize>) -> Self {
        Self { name: name.into(), slots, conversion: Conversion::Keep }
    }
}

/// `Vel` and 1 for `Vel:1`.
fn numbered(name: &str) -> Option<(&str, usize)> {
    let (base, component) = name.rsplit_once(':')?;
    Some((base, component.parse().ok()?))
}

/// The standard name of a whole property, or the file's; positions and radii are no columns.
fn column_name(name: &str) -> &str {
    let standard = names::standard(name);
    standard.filter(|s| ![names::POSITION, names::RADIUS].contains(s)).unwrap_or(name)
}

/// Slots that may be the components of one column.
struct Group {
    name: String,
    /// Component and slot.
    parts: Vec<(usize, usize)>,
    /// Fields of their own, which stay so if components are missing.
    is_joined: bool,
}

/// The slots without a purpose yet, joined by the names of their columns.
fn groups(open: &Open<'_>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for i in (0..open.slots.len()).filter(|i| !open.taken[*i]) {
        let Slot { name, component, .. } = &open.slots[i];
        let joined = || {
            let standard = names::component(name).map(|(standard, c, _)| (standard, c));
            standard.or_else(|| numbered(name).map(|(base, c)| (column_name(base), c)))
        };
        let (name, component, is_joined) = match component {
            Some((c, _)) => (column_name(name), *c, false),
            None => match joined() {
                Some((standard, c)) => (standard, c, true),
                None => (column_name(name), 0, false),
            },
        };
        let open_group = groups.iter_mut().find(|group| {
            group.name == name
                && group.is_joined == is_joined
                && group.parts.iter().all(|(c, _)| *c != component)
        });
        match open_group {
            Some(group) => group.parts.push((component, i)),
            None => {
                groups.push(Group { name: name.into(), parts: vec![(component, i)], is_joined })
            }
        }
    }
    groups
}

impl Group {
    /// One column, or one for each slot where the parts make no vector.
    fn plan(mut self, open: &Open<'_>, columns: &mut Vec<Planned>) {
        self.parts.sort_unstable();
        let least = match (self.is_joined, self.name == names::COLOR) {
            (true, true) => 3,
            (true, false) => 2,
            _ => 1,
        };
        let in_order = self.parts.iter().enumerate().all(|(i, (c, _))| i == *c);
        let is_new = columns.iter().all(|column| column.name != self.name);
        let slots = self.parts.iter().map(|(_, slot)| *slot);
        if in_order && is_new && self.parts.len() >= least {
            return columns.push(Planned::keep(self.name, slots.collect()));
        }
        columns.extend(slots.map(|slot| Planned::keep(&open.slots[slot].name, vec![slot])));
    }
}

/// Colours to 0–1 unless they are bytes, opacity to transparency.
fn plan_colours(columns: &mut Vec<Planned>, slots: &[Slot]) {
    let Some(at) = columns.iter().position(|c| c.name == names::COLOR && c.slots.len() >= 3) else {
        return;
    };
    let scalar = slots[columns[at].slots[0]].scalar;
    if scalar != Scalar::U8 && !scalar.is_float() {
        columns[at].conversion = Conversion::Scale(full_scale(scalar));
    }
    if columns[at].slots.len() == 4 {
        let alpha = columns[at].slots.split_off(3);
        columns.push(Planned::keep("alpha", alpha));
    }
    // `alpha` is opacity only beside a colour: elsewhere it is a viscosity or an angle.
    let names = ["alpha", "diffuse_alpha", "a"];
    let alpha = columns.iter_mut().find(|c| c.slots.len() == 1 && names.contains(&c.name.as_str()));
    if let Some(alpha) = alpha {
        alpha.name = names::TRANSPARENCY.into();
        alpha.conversion = Conversion::Opacity(full_scale(slots[alpha.slots[0]].scalar));
    }
}

/// Positions in the precision that the file has.
enum Positions {
    Single(Vec<[f32; 3]>),
    Double(PositionBuilder),
}

/// Collects a frame from blocks of rows.
pub(crate) struct Table {
    plan: Plan,
    positions: Positions,
    radius: Vec<f32>,
    columns: Vec<Values>,
}

impl Table {
    /// An empty table.
    pub(crate) fn new(plan: Plan) -> Self {
        let exact = |s: &Scalar| s.bytes() < 4 || *s == Scalar::F32;
        let positions = match plan.position_scalars.iter().all(exact) {
            true => Positions::Single(Vec::new()),
            false => Positions::Double(PositionBuilder::default()),
        };
        let empty = |column: &Planned| match column.conversion {
            Conversion::Keep => plan.scalars[column.slots[0]].empty_values(),
            _ => Values::F32(Vec::new()),
        };
        let columns = plan.columns.iter().map(empty).collect();
        Self { positions, radius: Vec::new(), columns, plan }
    }

    /// Makes room for `rows` rows that are known to be there.
    pub(crate) fn reserve(&mut self, rows: usize) {
        if let Positions::Single(positions) = &mut self.positions {
            positions.reserve_exact(rows);
        }
        if self.plan.radius.is_some() {
            self.radius.reserve_exact(rows);
        }
        for (values, planned) in self.columns.iter_mut().zip(&self.plan.columns) {
            let more = rows.saturating_mul(planned.slots.len());
            match values {
                Values::F32(v) => v.reserve_exact(more),
                Values::F64(v) => v.reserve_exact(more),
                Values::I32(v) => v.reserve_exact(more),
                Values::I64(v) => v.reserve_exact(more),
                Values::U8(v) => v.reserve_exact(more),
                Values::Names { codes, .. } => codes.reserve_exact(more),
            }
        }
    }

    /// Adds `rows` rows; `lanes` are in the order of the plan's slots and hold them.
    pub(crate) fn push(&mut self, lanes: &[Lane<'_>], rows: usize) {
        let plan = &self.plan;
        let lane = |i: usize| match plan.position[i] {
            Some(slot) => lanes[slot],
            None => Lane::zero(plan.position_scalars[i]),
        };
        let position = [lane(0), lane(1), lane(2)];
        match &mut self.positions {
            Positions::Single(out) => append_positions(out, &position, rows),
            Positions::Double(out) => {
                let row = |row| std::array::from_fn(|i| position[i].number(row));
                out.push(&(0..rows).map(row).collect::<Vec<_>>());
            }
        }
        if let Some((slot, factor)) = plan.radius {
            append_scaled(&mut self.radius, &lanes[slot], rows, factor);
        }
        for (planned, values) in plan.columns.iter().zip(&mut self.columns) {
            let parts: Vec<_> = planned.slots.iter().map(|slot| lanes[*slot]).collect();
            let convert: &dyn Fn(f64) -> f64 = match planned.conversion {
                Conversion::Keep => {
                    append(values, &parts, rows);
                    continue;
                }
                Conversion::Scale(factor) => &move |v| v * factor,
                Conversion::Opacity(factor) => &move |v| 1.0 - v * factor,
            };
            if let Values::F32(out) = values {
                for row in 0..rows {
                    out.extend(parts.iter().map(|part| convert(part.number(row)) as f32));
                }
            }
        }
    }

    /// The particles.
    pub(crate) fn finish(self) -> Particles {
        let (origin, positions) = match self.positions {
            Positions::Single(positions) => ([0.0; 3], positions),
            Positions::Double(builder) => builder.finish(),
        };
        let radius = match self.plan.radius {
            Some(_) => Radius::Each(self.radius),
            None => Radius::Unknown,
        };
        let columns = self.plan.columns.into_iter().zip(self.columns);
        let columns =
            columns.map(|(c, values)| Column::new(c.name, c.slots.len(), values)).collect();
        Particles { origin, positions, radius, columns, ..Particles::default() }
    }
}
