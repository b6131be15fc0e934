//! From text to postfix order: `1 + 2 * 3` becomes `1 2 3 * +`.
//!
//! Postfix, not a tree: it is checked, compiled, evaluated and dropped without recursion, so that only
//! the parser needs a limit to its depth.

use std::ops::Range;

use super::ExpressionError;
use super::token::{Function, Token, Tokens};

/// An operation on one value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[rustfmt::skip] // one line
pub(super) enum Unary {
    Negate, Not, Abs, Sqrt, Exp, Log, Log10, Sin, Cos, Tan, Floor, Ceil, Round,
}

/// An operation on two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Binary {
    Or,
    And,
    Equal,
    NotEqual,
    Less,
    AtMost,
    Greater,
    AtLeast,
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    Power,
    Least,
    Greatest,
}

/// How tightly operators bind, from loosest.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Level {
    Or,
    And,
    Comparison,
    Sum,
    Product,
    Sign,
    Power,
}

impl Binary {
    fn level(self) -> Level {
        match self {
            Self::Or => Level::Or,
            Self::And => Level::And,
            Self::Add | Self::Subtract => Level::Sum,
            Self::Multiply | Self::Divide | Self::Remainder => Level::Product,
            Self::Power | Self::Least | Self::Greatest => Level::Power,
            _ => Level::Comparison,
        }
    }

    /// The loosest operator that the right side may hold.
    fn right(self) -> Level {
        match self.level() {
            Level::Or => Level::And,
            Level::And => Level::Comparison,
            Level::Comparison => Level::Sum,
            Level::Sum => Level::Product,
            Level::Product | Level::Sign | Level::Power => Level::Sign,
        }
    }

    pub fn is_comparison(self) -> bool {
        self.level() == Level::Comparison
    }
}

/// A value or an operation on the values before it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum What {
    Number(f64),
    Text(String),
    Name(String),
    Unary(Unary),
    Binary(Binary),
}

/// One piece of an expression in postfix order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Item {
    pub what: What,
    /// The bytes of the text it stands on.
    pub at: Range<usize>,
}

/// How deep parentheses, signs and powers may nest.
const MOST_DEPTH: usize = 200;
/// How long an expression may be, bytes: thousands of conditions.
const MOST_BYTES: usize = 1 << 16;

/// Reads an expression. What it gives is well-formed: every operation finds its values.
pub(super) fn parse(text: &str) -> Result<Vec<Item>, ExpressionError> {
    if text.len() > MOST_BYTES {
        let message = format!("expected at most {MOST_BYTES} bytes, found {}", text.len());
        return Err(ExpressionError::new(text, 0..0, message));
    }
    let mut tokens = Tokens::new(text);
    let next = tokens.next()?;
    let mut parser = Parser { text, tokens, next, items: Vec::new(), depth: 0 };
    parser.expression(Level::Or)?;
    match parser.next.0 {
        Token::End => Ok(parser.items),
        _ => parser.unexpected("an operator or the end"),
    }
}

struct Parser<'a> {
    text: &'a str,
    tokens: Tokens<'a>,
    next: (Token, Range<usize>),
    items: Vec<Item>,
    depth: usize,
}

impl Parser<'_> {
    /// Reads a value and all that follows of operators at `loosest` or tighter.
    fn expression(&mut self, loosest: Level) -> Result<(), ExpressionError> {
        self.depth += 1;
        if self.depth > MOST_DEPTH {
            let message = format!("expected at most {MOST_DEPTH} levels of nesting");
            return Err(ExpressionError::new(self.text, self.next.1.clone(), message));
        }
        self.value()?;
        while let Token::Binary(operation) = self.next.0
            && operation.level() >= loosest
        {
            let (_, at) = self.advance()?;
            self.expression(operation.right())?;
            self.items.push(Item { what: What::Binary(operation), at });
            if operation.is_comparison()
                && matches!(self.next.0, Token::Binary(next) if next.is_comparison())
            {
                return self.unexpected("one comparison at a time, as in `1 < Mass && Mass < 2`");
            }
        }
        self.depth -= 1;
        Ok(())
    }

    /// Reads one value with what stands before it.
    fn value(&mut self) -> Result<(), ExpressionError> {
        if !is_value(&self.next.0) {
            return self.unexpected("a number, a property, a text or `(`");
        }
        let (token, at) = self.advance()?;
        let what = match token {
            Token::Number(number) => What::Number(number),
            Token::Text(text) => What::Text(text),
            Token::Name(name) => What::Name(name),
            Token::Not => {
                self.expression(Level::Comparison)?;
                What::Unary(Unary::Not)
            }
            Token::Binary(Binary::Subtract) => {
                self.expression(Level::Sign)?;
                What::Unary(Unary::Negate)
            }
            Token::Function(function) => return self.arguments(function, at),
            Token::Open => {
                self.expression(Level::Or)?;
                return self.close(at);
            }
            // A plus sign, which changes nothing.
            _ => return self.expression(Level::Sign),
        };
        self.items.push(Item { what, at });
        Ok(())
    }

    fn arguments(&mut self, function: Function, at: Range<usize>) -> Result<(), ExpressionError> {
        self.expression(Level::Or)?;
        match function {
            Function::One(operation) => {
                self.items.push(Item { what: What::Unary(operation), at: at.clone() });
            }
            Function::Many(operation) => {
                if self.next.0 != Token::Comma {
                    return self.unexpected("`,` and another value");
                }
                while self.next.0 == Token::Comma {
                    self.advance()?;
                    self.expression(Level::Or)?;
                    self.items.push(Item { what: What::Binary(operation), at: at.clone() });
                }
            }
        }
        self.close(at)
    }

    fn close(&mut self, opened: Range<usize>) -> Result<(), ExpressionError> {
        match self.next.0 {
            Token::Close => self.advance().map(|_| ()),
            Token::End => {
                let message = "expected a `)` for this, found the end";
                Err(ExpressionError::new(self.text, opened, message))
            }
            _ => self.unexpected("an operator or `)`"),
        }
    }

    fn advance(&mut self) -> Result<(Token, Range<usize>), ExpressionError> {
        let next = self.tokens.next()?;
        Ok(std::mem::replace(&mut self.next, next))
    }

    fn unexpected<T>(&self, expected: &str) -> Result<T, ExpressionError> {
        let (token, at) = &self.next;
        let found = match (token, self.text.get(at.clone())) {
            (Token::End, _) | (_, None) => "the end".into(),
            (_, Some(found)) => format!("`{found}`"),
        };
        let message = format!("expected {expected}, found {found}");
        Err(ExpressionError::new(self.text, at.clone(), message))
    }
}

/// Whether a value can begin with `token`.
fn is_value(token: &Token) -> bool {
    match token {
        Token::Binary(operation) => matches!(operation, Binary::Add | Binary::Subtract),
        Token::Close | Token::Comma | Token::End => false,
        _ => true,
    }
}
