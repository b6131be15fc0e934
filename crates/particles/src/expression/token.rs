//! The words and signs of an expression.

use std::ops::Range;

use super::ExpressionError;
use super::parse::{Binary, Unary};

/// A word or sign.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Number(f64),
    Text(String),
    /// A property's name with its component.
    Name(String),
    /// A function, and the parenthesis after it.
    Function(Function),
    Binary(Binary),
    Not,
    Open,
    Close,
    Comma,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Function {
    /// Of one value.
    One(Unary),
    /// Of two or more, taken two at a time from the left.
    Many(Binary),
}

const FUNCTIONS: &[(&str, Function)] = &[
    ("abs", Function::One(Unary::Abs)),
    ("sqrt", Function::One(Unary::Sqrt)),
    ("exp", Function::One(Unary::Exp)),
    ("log", Function::One(Unary::Log)),
    ("log10", Function::One(Unary::Log10)),
    ("sin", Function::One(Unary::Sin)),
    ("cos", Function::One(Unary::Cos)),
    ("tan", Function::One(Unary::Tan)),
    ("floor", Function::One(Unary::Floor)),
    ("ceil", Function::One(Unary::Ceil)),
    ("round", Function::One(Unary::Round)),
    ("min", Function::Many(Binary::Least)),
    ("max", Function::Many(Binary::Greatest)),
];

const WORDS: &[(&str, Token)] = &[
    ("or", Token::Binary(Binary::Or)),
    ("and", Token::Binary(Binary::And)),
    ("not", Token::Not),
    ("pi", Token::Number(std::f64::consts::PI)),
    ("true", Token::Number(1.0)),
    ("false", Token::Number(0.0)),
];

/// Longer signs come before those they begin with.
const SIGNS: &[(&str, Token)] = &[
    ("||", Token::Binary(Binary::Or)),
    ("&&", Token::Binary(Binary::And)),
    ("==", Token::Binary(Binary::Equal)),
    ("!=", Token::Binary(Binary::NotEqual)),
    ("<=", Token::Binary(Binary::AtMost)),
    (">=", Token::Binary(Binary::AtLeast)),
    ("**", Token::Binary(Binary::Power)),
    ("<", Token::Binary(Binary::Less)),
    (">", Token::Binary(Binary::Greater)),
    ("!", Token::Not),
    ("+", Token::Binary(Binary::Add)),
    ("-", Token::Binary(Binary::Subtract)),
    ("*", Token::Binary(Binary::Multiply)),
    ("/", Token::Binary(Binary::Divide)),
    ("%", Token::Binary(Binary::Remainder)),
    ("^", Token::Binary(Binary::Power)),
    ("(", Token::Open),
    (")", Token::Close),
    (",", Token::Comma),
];

/// Signs of other languages, and what they are here.
const FOREIGN: &[(&str, &str)] = &[("=", "=="), ("&", "&&"), ("|", "||"), ("<>", "!=")];

fn look_up<T: Clone>(table: &[(&str, T)], word: &str) -> Option<T> {
    table.iter().find(|(name, _)| name.eq_ignore_ascii_case(word)).map(|(_, found)| found.clone())
}

/// Reads tokens off the front of a text.
pub(super) struct Tokens<'a> {
    text: &'a str,
    /// Where the next one begins; always between characters.
    at: usize,
}

impl<'a> Tokens<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { text, at: 0 }
    }

    /// The next token and the bytes it stands on; at the end, `End` for ever.
    pub fn next(&mut self) -> Result<(Token, Range<usize>), ExpressionError> {
        self.skip(char::is_whitespace);
        let start = self.at;
        let token = match self.peek() {
            None => Token::End,
            Some(quote @ ('"' | '\'')) => Token::Text(self.quoted(quote)?.to_owned()),
            Some('`') => {
                let mut name = self.quoted('`')?.to_owned();
                let suffix = self.at;
                while self.component() {}
                name.push_str(self.since(suffix));
                Token::Name(name)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number()?,
            Some(c) if begins_word(c) => self.word()?,
            Some(_) => self.sign()?,
        };
        Ok((token, start..self.at))
    }

    fn rest(&self) -> &'a str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn since(&self, start: usize) -> &'a str {
        self.text.get(start..self.at).unwrap_or_default()
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    /// Skips what fits; whether there was any.
    fn skip(&mut self, fits: impl Fn(char) -> bool) -> bool {
        let rest = self.rest();
        let length = rest.find(|c| !fits(c)).unwrap_or(rest.len());
        self.at += length;
        length > 0
    }

    fn error<T>(&self, at: Range<usize>, message: impl Into<String>) -> Result<T, ExpressionError> {
        Err(ExpressionError::new(self.text, at, message))
    }

    /// What stands between two quotes, each of one byte.
    fn quoted(&mut self, quote: char) -> Result<&'a str, ExpressionError> {
        let start = self.at;
        self.at += 1;
        let inside = self.rest();
        match inside.split_once(quote) {
            Some((quoted, _)) => {
                self.at += quoted.len() + 1;
                Ok(quoted)
            }
            None => self.error(start..self.at, format!("expected another {quote} before the end")),
        }
    }

    fn number(&mut self) -> Result<Token, ExpressionError> {
        let start = self.at;
        let digit = |c: char| c.is_ascii_digit();
        self.skip(digit);
        if self.peek() == Some('.') {
            self.at += 1;
            self.skip(digit);
        }
        let mantissa = self.at;
        if matches!(self.peek(), Some('e' | 'E')) {
            self.at += 1;
            self.at += usize::from(matches!(self.peek(), Some('+' | '-')));
            if !self.skip(digit) {
                self.at = mantissa;
            }
        }
        match self.since(start).parse() {
            Ok(number) => Ok(Token::Number(number)),
            Err(_) => {
                let message = format!("expected a number, found `{}`", self.since(start));
                self.error(start..self.at, message)
            }
        }
    }

    /// A word of the language, or a name.
    fn word(&mut self) -> Result<Token, ExpressionError> {
        let start = self.at;
        self.skip(within_word);
        let word = self.since(start);
        if let Some(token) = look_up(WORDS, word) {
            return Ok(token);
        }
        let after = self.rest().trim_start();
        if after.starts_with('(') {
            let end = self.at;
            self.at = self.text.len() - after.len() + 1;
            return match look_up(FUNCTIONS, word) {
                Some(function) => Ok(Token::Function(function)),
                None => {
                    let all: Vec<&str> = FUNCTIONS.iter().map(|(name, _)| *name).collect();
                    let all = all.join(", ");
                    self.error(start..end, format!("no function `{word}`; there are {all}"))
                }
            };
        }
        Ok(Token::Name(self.name(start)))
    }

    /// The name that begins with the word just read: no operator stands between the words of a name,
    /// so all words and whole numbers that follow belong to it.
    fn name(&mut self, start: usize) -> String {
        let mut name = self.since(start).to_owned();
        loop {
            let part = self.at;
            if self.component() {
                name.push_str(self.since(part));
                continue;
            }
            self.skip(char::is_whitespace);
            let word = self.at;
            let more = self.at > part && self.skip(within_word);
            if !more || look_up(WORDS, self.since(word)).is_some() {
                self.at = part;
                return name;
            }
            name.push(' ');
            name.push_str(self.since(word));
        }
    }

    /// Skips `.X` or `[4]`; whether there was one.
    fn component(&mut self) -> bool {
        let start = self.at;
        let found = match self.peek() {
            Some('.') => {
                self.at += 1;
                self.skip(within_word)
            }
            Some('[') => {
                self.at += 1;
                let number = self.skip(|c| c.is_ascii_digit());
                let closed = self.peek() == Some(']');
                self.at += usize::from(closed);
                number && closed
            }
            _ => false,
        };
        if !found {
            self.at = start;
        }
        found
    }

    fn sign(&mut self) -> Result<Token, ExpressionError> {
        let (start, rest) = (self.at, self.rest());
        let found = SIGNS.iter().find(|(sign, _)| rest.starts_with(sign));
        if let Some((sign, token)) = found
            && !rest.starts_with("<>")
        {
            self.at += sign.len();
            return Ok(token.clone());
        }
        match FOREIGN.iter().find(|(sign, _)| rest.starts_with(sign)) {
            Some((sign, here)) => {
                let message = format!("expected `{here}`, found `{sign}`");
                self.error(start..start + sign.len(), message)
            }
            None => {
                let sign = rest.chars().next().unwrap_or_default();
                let message = format!(
                    "expected a number, a property, a text or an operator, found `{sign}`; \
                     names with such signs stand in backticks"
                );
                self.error(start..start + sign.len_utf8(), message)
            }
        }
    }
}

fn begins_word(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn within_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
