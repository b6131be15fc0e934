//! Carries the steps out, each over a block of particles at a time.

use std::ops::Range;

use rayon::prelude::*;

use super::parse::{Binary, Unary};
use super::resolve::Source;
use crate::{Particles, Radius, Values};

/// How many words of 64 particles a block has: 2048 particles, whose values fit the nearest cache.
const BLOCK_WORDS: usize = 32;

/// An expression made ready for one frame of particles.
pub(super) struct Program<'a> {
    pub particles: &'a Particles,
    pub steps: Vec<Step>,
    pub result: Operand,
}

/// Where a step takes a value from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Operand {
    Constant(f64),
    Source(Source),
    /// The last result of an earlier step that was not taken yet.
    Earlier,
}

/// One operation.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Unary(Unary, Operand),
    Binary(Binary, Operand, Operand),
    /// Whether a name has this code, or has not.
    Named {
        source: Source,
        code: Option<u32>,
        equal: bool,
    },
}

/// A value for each particle of a block.
enum Block {
    Same(f64),
    Each(Vec<f64>),
}

/// What a thread keeps from block to block.
#[derive(Default)]
struct Workspace {
    results: Vec<Block>,
    spare: Vec<Vec<f64>>,
}

impl Program<'_> {
    /// A bit per particle: bit `i % 64` of word `i / 64`.
    pub fn select(&self) -> Vec<u64> {
        let particles = self.particles.len();
        let mut words = vec![0; particles.div_ceil(64)];
        words.par_chunks_mut(BLOCK_WORDS).enumerate().for_each_init(
            Workspace::default,
            |workspace, (block, words)| {
                let start = block * BLOCK_WORDS * 64;
                let end = particles.min(start + words.len() * 64);
                self.block(start..end, workspace, words);
            },
        );
        words
    }

    fn block(&self, rows: Range<usize>, workspace: &mut Workspace, words: &mut [u64]) {
        for step in &self.steps {
            let result = match *step {
                Step::Unary(operation, of) => unary(operation, self.take(of, &rows, workspace)),
                Step::Binary(operation, left, right) => {
                    let right = self.take(right, &rows, workspace);
                    let left = self.take(left, &rows, workspace);
                    binary(operation, left, right, &mut workspace.spare)
                }
                Step::Named { source, code, equal } => {
                    let mut values = workspace.spare.pop().unwrap_or_default();
                    self.named(source, code, rows.clone(), &mut values);
                    let result = Block::Each(values);
                    if equal { result } else { unary(Unary::Not, result) }
                }
            };
            workspace.results.push(result);
        }
        match self.take(self.result, &rows, workspace) {
            Block::Same(value) => pack(rows.map(|_| value), words),
            Block::Each(values) => {
                pack(values.iter().copied(), words);
                workspace.spare.push(values);
            }
        }
    }

    fn take(&self, operand: Operand, rows: &Range<usize>, workspace: &mut Workspace) -> Block {
        match operand {
            Operand::Constant(value) => Block::Same(value),
            Operand::Source(source) => {
                let mut values = workspace.spare.pop().unwrap_or_default();
                values.clear();
                self.load(source, rows.clone(), &mut values);
                Block::Each(values)
            }
            // Every step left one result and each is taken once.
            Operand::Earlier => workspace.results.pop().unwrap_or(Block::Same(f64::NAN)),
        }
    }

    fn load(&self, source: Source, rows: Range<usize>, into: &mut Vec<f64>) {
        let particles = self.particles;
        match source {
            Source::Index => into.extend(rows.map(|row| row as f64)),
            Source::Radius => match &particles.radius {
                Radius::Each(radii) => into.extend(radii[rows].iter().map(|r| f64::from(*r))),
                Radius::Uniform(radius) => into.extend(rows.map(|_| f64::from(*radius))),
                Radius::Unknown => into.extend(rows.map(|_| f64::NAN)),
            },
            Source::Position(Some(axis)) => {
                let origin = particles.origin[axis];
                let positions = &particles.positions[rows];
                into.extend(positions.iter().map(|p| origin + f64::from(p[axis])));
            }
            Source::Position(None) => {
                let square =
                    |p: &[f32; 3], i: usize| (particles.origin[i] + f64::from(p[i])).powi(2);
                let positions = &particles.positions[rows];
                into.extend(
                    positions.iter().map(|p| (square(p, 0) + square(p, 1) + square(p, 2)).sqrt()),
                );
            }
            Source::Column { index, component: None } => {
                let column = &particles.columns[index];
                into.extend(rows.map(|row| column.magnitude(row)));
            }
            Source::Column { index, component: Some(component) } => {
                let column = &particles.columns[index];
                let of = Component { rows, components: column.components, component };
                match &column.values {
                    Values::F32(v) => of.load(v, into, f64::from),
                    Values::F64(v) => of.load(v, into, |v| v),
                    Values::I32(v) => of.load(v, into, f64::from),
                    Values::I64(v) => of.load(v, into, |v| v as f64),
                    Values::U8(v) => of.load(v, into, f64::from),
                    Values::Names { codes, .. } => of.load(codes, into, |c| f64::from(c) + 1.0),
                }
            }
        }
    }

    fn named(&self, source: Source, code: Option<u32>, rows: Range<usize>, into: &mut Vec<f64>) {
        into.clear();
        match (source.names(self.particles), code) {
            (Some(names), Some(code)) => {
                let of =
                    Component { rows, components: names.components, component: names.component };
                of.load(names.codes, into, |c| flag(c == code));
            }
            _ => into.extend(rows.map(|_| 0.0)),
        }
    }
}

/// Which values of a column are meant.
struct Component {
    rows: Range<usize>,
    components: usize,
    component: usize,
}

impl Component {
    fn load<T: Copy>(&self, values: &[T], into: &mut Vec<f64>, number: impl Fn(T) -> f64) {
        let n = self.components;
        let values = &values[self.rows.start * n..self.rows.end * n];
        if n == 1 {
            into.extend(values.iter().map(|v| number(*v)));
        } else {
            into.extend(values.chunks_exact(n).map(|row| number(row[self.component])));
        }
    }
}

/// Sets the bits of the values that are true; all bits are 0 before.
fn pack(values: impl Iterator<Item = f64>, words: &mut [u64]) {
    for (i, value) in values.enumerate() {
        words[i / 64] |= u64::from(is_true(value)) << (i % 64);
    }
}

fn flag(condition: bool) -> f64 {
    f64::from(u8::from(condition))
}

fn is_true(value: f64) -> bool {
    value != 0.0 && !value.is_nan()
}

/// The result of an operation on a constant.
pub(super) fn unary_constant(operation: Unary, of: f64) -> f64 {
    match unary(operation, Block::Same(of)) {
        Block::Same(value) => value,
        Block::Each(_) => f64::NAN,
    }
}

/// The result of an operation on constants.
pub(super) fn binary_constant(operation: Binary, left: f64, right: f64) -> f64 {
    match binary(operation, Block::Same(left), Block::Same(right), &mut Vec::new()) {
        Block::Same(value) => value,
        Block::Each(_) => f64::NAN,
    }
}

fn unary(operation: Unary, of: Block) -> Block {
    match operation {
        Unary::Negate => change(of, |a| -a),
        Unary::Not => change(of, |a| flag(!is_true(a))),
        Unary::Abs => change(of, f64::abs),
        Unary::Sqrt => change(of, f64::sqrt),
        Unary::Exp => change(of, f64::exp),
        Unary::Log => change(of, f64::ln),
        Unary::Log10 => change(of, f64::log10),
        Unary::Sin => change(of, f64::sin),
        Unary::Cos => change(of, f64::cos),
        Unary::Tan => change(of, f64::tan),
        Unary::Floor => change(of, f64::floor),
        Unary::Ceil => change(of, f64::ceil),
        Unary::Round => change(of, f64::round),
    }
}

fn binary(operation: Binary, left: Block, right: Block, spare: &mut Vec<Vec<f64>>) -> Block {
    match operation {
        Binary::Or => combine(left, right, spare, |a, b| flag(is_true(a) | is_true(b))),
        Binary::And => combine(left, right, spare, |a, b| flag(is_true(a) & is_true(b))),
        Binary::Equal => combine(left, right, spare, |a, b| flag(a == b)),
        Binary::NotEqual => combine(left, right, spare, |a, b| flag(a != b)),
        Binary::Less => combine(left, right, spare, |a, b| flag(a < b)),
        Binary::AtMost => combine(left, right, spare, |a, b| flag(a <= b)),
        Binary::Greater => combine(left, right, spare, |a, b| flag(a > b)),
        Binary::AtLeast => combine(left, right, spare, |a, b| flag(a >= b)),
        Binary::Add => combine(left, right, spare, |a, b| a + b),
        Binary::Subtract => combine(left, right, spare, |a, b| a - b),
        Binary::Multiply => combine(left, right, spare, |a, b| a * b),
        Binary::Divide => combine(left, right, spare, |a, b| a / b),
        Binary::Remainder => combine(left, right, spare, |a, b| a % b),
        // Squares are the powers people write, and many times dearer by way of the logarithm.
        Binary::Power => {
            combine(left, right, spare, |a, b| if b == 2.0 { a * a } else { a.powf(b) })
        }
        Binary::Least => combine(left, right, spare, f64::min),
        Binary::Greatest => combine(left, right, spare, f64::max),
    }
}

fn change(of: Block, operation: impl Fn(f64) -> f64) -> Block {
    match of {
        Block::Same(a) => Block::Same(operation(a)),
        Block::Each(mut values) => {
            values.iter_mut().for_each(|a| *a = operation(*a));
            Block::Each(values)
        }
    }
}

/// Works in the memory of one side and keeps the other's for the next block.
fn combine(
    left: Block,
    right: Block,
    spare: &mut Vec<Vec<f64>>,
    operation: impl Fn(f64, f64) -> f64,
) -> Block {
    match (left, right) {
        (Block::Same(a), Block::Same(b)) => Block::Same(operation(a, b)),
        (Block::Each(mut left), Block::Same(b)) => {
            left.iter_mut().for_each(|a| *a = operation(*a, b));
            Block::Each(left)
        }
        (Block::Same(a), Block::Each(mut right)) => {
            right.iter_mut().for_each(|b| *b = operation(a, *b));
            Block::Each(right)
        }
        (Block::Each(mut left), Block::Each(right)) => {
            left.iter_mut().zip(&right).for_each(|(a, b)| *a = operation(*a, *b));
            spare.push(right);
            Block::Each(left)
        }
    }
}
