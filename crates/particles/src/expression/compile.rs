//! From postfix order to steps: properties found, text turned into codes, constants folded.

use std::ops::Range;

use super::ExpressionError;
use super::evaluate::{self, Operand, Program, Step};
use super::parse::{Binary, Item, What};
use super::resolve::Source;
use crate::Particles;

/// What an item leaves behind for the operations after it.
struct Value {
    kind: Kind,
    /// Where it stands in the text, or where the operation does that made it.
    at: Range<usize>,
}

enum Kind {
    Number(Operand),
    Text(String),
}

/// Turns `items`, which [`super::parse::parse`] made of `text`, into steps.
pub(super) fn compile<'a>(
    text: &'a str,
    items: Vec<Item>,
    particles: &'a Particles,
) -> Result<Program<'a>, ExpressionError> {
    let mut compiler = Compiler { text, particles, steps: Vec::new(), values: Vec::new() };
    for item in items {
        compiler.item(item)?;
    }
    let result = compiler.pop(0..0)?;
    let result = compiler.number(result)?;
    Ok(Program { particles, steps: compiler.steps, result })
}

struct Compiler<'a> {
    text: &'a str,
    particles: &'a Particles,
    steps: Vec<Step>,
    values: Vec<Value>,
}

impl Compiler<'_> {
    fn item(&mut self, item: Item) -> Result<(), ExpressionError> {
        let at = item.at;
        let kind = match item.what {
            What::Number(number) => Kind::Number(Operand::Constant(number)),
            What::Text(text) => Kind::Text(text),
            What::Name(name) => {
                let source = Source::find(self.particles, &name);
                Kind::Number(Operand::Source(source.map_err(|m| self.error(at.clone(), m))?))
            }
            What::Unary(operation) => {
                let of = self.pop(at.clone())?;
                Kind::Number(match self.number(of)? {
                    Operand::Constant(of) => {
                        Operand::Constant(evaluate::unary_constant(operation, of))
                    }
                    of => self.step(Step::Unary(operation, of)),
                })
            }
            What::Binary(operation) => {
                let right = self.pop(at.clone())?;
                let left = self.pop(at.clone())?;
                Kind::Number(self.binary(operation, left, right)?)
            }
        };
        self.values.push(Value { kind, at });
        Ok(())
    }

    fn binary(
        &mut self,
        operation: Binary,
        left: Value,
        right: Value,
    ) -> Result<Operand, ExpressionError> {
        let equal = match operation {
            Binary::Equal => Some(true),
            Binary::NotEqual => Some(false),
            _ => None,
        };
        if let (Some(equal), (Kind::Text(_), _) | (_, Kind::Text(_))) =
            (equal, (&left.kind, &right.kind))
        {
            return self.text_comparison(left, right, equal);
        }
        let (left_at, right_at) = (left.at.clone(), right.at.clone());
        let (mut left, mut right) = (self.number(left)?, self.number(right)?);
        if operation.is_comparison() {
            if self.holds_names(left) && self.holds_names(right) {
                let message = "expected a number or a text beside the names of a property, found \
                               the names of another";
                return Err(self.error(left_at.start..right_at.end, message));
            }
            if let (Operand::Source(source), Operand::Constant(number)) = (left, right) {
                right = Operand::Constant(source.round(self.particles, number));
            }
            if let (Operand::Constant(number), Operand::Source(source)) = (left, right) {
                left = Operand::Constant(source.round(self.particles, number));
            }
        }
        Ok(match (left, right) {
            (Operand::Constant(left), Operand::Constant(right)) => {
                Operand::Constant(evaluate::binary_constant(operation, left, right))
            }
            _ => self.step(Step::Binary(operation, left, right)),
        })
    }

    /// A text compared with a property that holds names, whichever comes first.
    fn text_comparison(
        &mut self,
        left: Value,
        right: Value,
        equal: bool,
    ) -> Result<Operand, ExpressionError> {
        let (text, other) = match (left.kind, right.kind) {
            (Kind::Text(text), Kind::Number(other)) => ((text, left.at), (other, right.at)),
            (Kind::Number(other), Kind::Text(text)) => ((text, right.at), (other, left.at)),
            _ => {
                let message = "expected a property beside the text, found another text";
                return Err(self.error(right.at, message));
            }
        };
        let Operand::Source(source) = other.0 else {
            return Err(self.text_alone(&text.0, text.1));
        };
        let Some(column) = source.names(self.particles) else {
            let found = self.text.get(other.1.clone()).unwrap_or_default();
            let mut message = format!("expected a property that holds names, found `{found}`");
            message.push_str(" with numbers");
            if Source::find(self.particles, &text.0).is_ok() {
                message.push_str(&format!("; the property `{}` stands in backticks", text.0));
            }
            return Err(self.error(other.1, message));
        };
        // In another frame there may be such a name; here nothing is called so.
        let code = column.names.iter().position(|name| *name == text.0);
        let code = code.and_then(|code| u32::try_from(code).ok());
        Ok(self.step(Step::Named { source, code, equal }))
    }

    fn holds_names(&self, operand: Operand) -> bool {
        matches!(operand, Operand::Source(source) if source.names(self.particles).is_some())
    }

    fn step(&mut self, step: Step) -> Operand {
        self.steps.push(step);
        Operand::Earlier
    }

    fn pop(&mut self, at: Range<usize>) -> Result<Value, ExpressionError> {
        self.values.pop().ok_or_else(|| self.error(at, "expected a value"))
    }

    fn number(&self, value: Value) -> Result<Operand, ExpressionError> {
        match value.kind {
            Kind::Number(operand) => Ok(operand),
            Kind::Text(text) => Err(self.text_alone(&text, value.at)),
        }
    }

    fn text_alone(&self, text: &str, at: Range<usize>) -> ExpressionError {
        let mut message = format!(
            "expected a number, found the text \"{text}\"; a text is compared by == or != with a \
             property that holds names"
        );
        if Source::find(self.particles, text).is_ok() {
            message.push_str(&format!("; the property `{text}` stands in backticks"));
        }
        self.error(at, message)
    }

    fn error(&self, at: Range<usize>, message: impl Into<String>) -> ExpressionError {
        ExpressionError::new(self.text, at, message)
    }
}
