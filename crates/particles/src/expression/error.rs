//! What is wrong with an expression, and where in it.

use std::fmt;
use std::ops::Range;

/// An error in an expression, fit to be shown to the user as it is: one line of what is wrong, then
/// the expression, then a line with carets under the place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct ExpressionError {
    /// The character at fault, counted from 1.
    pub column: usize,
    /// What was expected and what stood there.
    pub message: String,
    /// What surrounds the place.
    excerpt: String,
    /// Characters of the excerpt before the place, and of the place.
    carets: (usize, usize),
}

/// How many characters of the expression are shown on each side of the place.
const SHOWN: usize = 50;

impl ExpressionError {
    /// An error of the bytes `at` of `text`.
    pub(super) fn new(text: &str, at: Range<usize>, message: impl Into<String>) -> Self {
        let characters = |part: Option<&str>| part.map_or(0, |part| part.chars().count());
        let before = characters(text.get(..at.start));
        let width = characters(text.get(at)).clamp(1, SHOWN);
        let first = before.saturating_sub(SHOWN);
        let plain = |c: char| if c.is_control() { ' ' } else { c };
        let excerpt = text.chars().skip(first).take(before - first + width + SHOWN).map(plain);
        Self {
            column: before + 1,
            // One line, whatever stood there.
            message: message.into().chars().map(plain).collect(),
            excerpt: excerpt.collect(),
            carets: (before - first, width),
        }
    }
}

impl fmt::Display for ExpressionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (before, width) = self.carets;
        writeln!(f, "expression, column {}: {}", self.column, self.message)?;
        writeln!(f, "  {}", self.excerpt)?;
        write!(f, "  {:before$}{:^<width$}", "", "")
    }
}
