//! Conditions on particles' properties: `Particle Type == "O" && Position.Z > 2.5`.
//!
//! Every value is an f64 and a condition is 0 or 1, so a property may stand for "is not 0" and
//! conditions may be added up. From loosest to tightest:
//!
//! | | |
//! |---|---|
//! | `\|\|` `or` | |
//! | `&&` `and` | |
//! | `!` `not` | of a whole comparison: `not Mass > 2` is `Mass <= 2` |
//! | `==` `!=` `<` `<=` `>` `>=` | one at a time |
//! | `+` `-` | |
//! | `*` `/` `%` | the remainder has the sign of the dividend |
//! | `-` `+` before a value | |
//! | `^` `**` | from the right: `2^3^2` is `2^9`, `-2^2` is −4 |
//!
//! Numbers (`1e3`, `.5`), `pi`, `true`, `false`, parentheses, and the functions `abs sqrt exp log`
//! (natural) `log10 sin cos tan floor ceil round` (half away from zero) `min max` (of two or more).
//! Words of the language are read in any case.
//!
//! **Properties** are written as in the file, blanks and all (`Particle Type`, `c_pe`), or in
//! backticks where a name holds other signs or a word of the language. The exact name comes first,
//! then one that differs in case, then in blanks and underscores (`ParticleType`), then the usual
//! spellings (`type`, `vx`). Besides the columns there are `Position` in the file's own coordinates,
//! `Radius` where the file has it, and `Index`, counted from 0 in the file's order. Components are
//! `Velocity.X`, `.Y`, `.Z`, `.W`, `Color.R`, `.G`, `.B`, `Stress[4]` counted from 0, and
//! `Velocity.Magnitude`, which the bare name of a vector also means.
//!
//! **Text** stands in single or double quotes and is compared, by `==` or `!=`, with a property that
//! holds names; beside a number such a property is its code, counted from 1.
//!
//! NaN compares as everywhere (IEEE 754: false but for `!=`) and is itself no true condition. A number
//! compared with a property in single precision is rounded as the property was, so that `Mass >= 0.7`
//! holds for a mass of 0.7 in the file.
//!
//! The parser is our own: the maintained crates (evalexpr, exmex, fasteval, rhai) go row by row, tens
//! of nanoseconds or more each, and know neither names with blanks nor text against codes.

mod compile;
mod error;
mod evaluate;
mod parse;
mod resolve;
#[cfg(test)]
mod tests;
mod token;

pub use error::ExpressionError;
pub use resolve::Source as Property;

use crate::Particles;

/// Which particles an expression holds for: a bit per particle in the file's order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Bit `i % 64` of word `i / 64` is particle `i`; bits past the last particle are 0.
    words: Vec<u64>,
}

impl Selection {
    /// Whether particle `index`, counted in the file's order, is selected; past the end none is.
    #[inline]
    pub fn contains(&self, index: u32) -> bool {
        self.words.get(index as usize / 64).is_some_and(|word| word >> (index % 64) & 1 == 1)
    }

    /// How many particles are selected.
    pub fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }
}

/// The particles for which the expression `text` holds; the same for any number of threads.
///
/// Without particles, properties are not looked up: an empty frame may come without its columns.
///
/// # Errors
/// The text is no expression, names a property that `particles` do not have, or mixes text and
/// numbers.
pub fn select(text: &str, particles: &Particles) -> Result<Selection, ExpressionError> {
    let items = parse::parse(text)?;
    if particles.is_empty() {
        return Ok(Selection::default());
    }
    let program = compile::compile(text, items, particles)?;
    Ok(Selection { words: program.select() })
}

/// Names of the properties that `text` uses, once each, in order of appearance, as
/// [`Wanted::Only`](crate::read::Wanted::Only) takes them: as written, and what else that may mean.
///
/// `Stress[4]` gives `Stress[4]` and `Stress`, for it may be a column or a component; `vx` gives `vx`
/// and `Velocity`.
///
/// # Errors
/// The text is no expression.
pub fn properties(text: &str) -> Result<Vec<String>, ExpressionError> {
    let mut names: Vec<String> = Vec::new();
    for item in parse::parse(text)? {
        if let parse::What::Name(name) = item.what {
            for meaning in resolve::meanings(&name) {
                if !names.contains(&meaning) {
                    names.push(meaning);
                }
            }
        }
    }
    Ok(names)
}
