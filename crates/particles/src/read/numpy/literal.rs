//! The Python literals in the header of an NPY file: strings, numbers, tuples, lists, one dictionary.

/// No header nests deeper than a list of fields with a shape each, itself nested a few times.
const DEEPEST: usize = 16;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Literal {
    Text(String),
    Integer(i64),
    Bool(bool),
    None,
    /// A tuple or a list.
    Sequence(Vec<Literal>),
    Dictionary(Vec<(Literal, Literal)>),
}

impl Literal {
    /// The value of `key` in a dictionary.
    pub(super) fn get(&self, key: &str) -> Option<&Literal> {
        let Self::Dictionary(entries) = self else { return None };
        entries.iter().find(|(k, _)| *k == Self::Text(key.into())).map(|(_, value)| value)
    }
}

/// Parses one literal; `Err` is the byte where something else stood.
pub(super) fn parse(text: &str) -> Result<Literal, usize> {
    let mut cursor = Cursor { text: text.as_bytes(), at: 0 };
    let value = cursor.value(0)?;
    cursor.blanks();
    if cursor.at == text.len() { Ok(value) } else { Err(cursor.at) }
}

struct Cursor<'a> {
    text: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    fn blanks(&mut self) {
        while self.peek().is_some_and(|b| b.is_ascii_whitespace() || b == 0) {
            self.at += 1;
        }
    }

    /// Passes `byte`, if it is next.
    fn passes(&mut self, byte: u8) -> bool {
        self.blanks();
        let next = self.peek() == Some(byte);
        self.at += usize::from(next);
        next
    }

    fn value(&mut self, depth: usize) -> Result<Literal, usize> {
        self.blanks();
        match self.peek() {
            Some(b'\'' | b'"') => self.text(),
            Some(b'(' | b'[' | b'{') if depth == DEEPEST => Err(self.at),
            Some(b'(') => self.sequence(b')', depth),
            Some(b'[') => self.sequence(b']', depth),
            Some(b'{') => self.dictionary(depth),
            _ => self.word(),
        }
    }

    fn text(&mut self) -> Result<Literal, usize> {
        let quote = self.text[self.at];
        let start = self.at + 1;
        let end = memchr::memchr(quote, &self.text[start..]).ok_or(self.at)? + start;
        self.at = end + 1;
        Ok(Literal::Text(String::from_utf8_lossy(&self.text[start..end]).into_owned()))
    }

    fn sequence(&mut self, close: u8, depth: usize) -> Result<Literal, usize> {
        self.at += 1;
        let mut items = Vec::new();
        while !self.passes(close) {
            items.push(self.value(depth + 1)?);
            if !self.passes(b',') && self.peek() != Some(close) {
                return Err(self.at);
            }
        }
        Ok(Literal::Sequence(items))
    }

    fn dictionary(&mut self, depth: usize) -> Result<Literal, usize> {
        self.at += 1;
        let mut entries = Vec::new();
        while !self.passes(b'}') {
            let key = self.value(depth + 1)?;
            if !self.passes(b':') {
                return Err(self.at);
            }
            entries.push((key, self.value(depth + 1)?));
            if !self.passes(b',') && self.peek() != Some(b'}') {
                return Err(self.at);
            }
        }
        Ok(Literal::Dictionary(entries))
    }

    fn word(&mut self) -> Result<Literal, usize> {
        let start = self.at;
        while self.peek().is_some_and(|b| b.is_ascii_alphanumeric() || b == b'-') {
            self.at += 1;
        }
        match std::str::from_utf8(&self.text[start..self.at]).unwrap_or_default() {
            "True" => Ok(Literal::Bool(true)),
            "False" => Ok(Literal::Bool(false)),
            "None" => Ok(Literal::None),
            // Python 2 wrote long integers with an L.
            number => number.trim_end_matches('L').parse().map(Literal::Integer).map_err(|_| start),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_a_dictionary() {
        let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (10L, 3), }   \n";
        let header = parse(text).unwrap();
        assert_eq!(header.get("descr"), Some(&Literal::Text("<f8".into())));
        assert_eq!(header.get("fortran_order"), Some(&Literal::Bool(false)));
        let shape = Literal::Sequence(vec![Literal::Integer(10), Literal::Integer(3)]);
        assert_eq!(header.get("shape"), Some(&shape));
    }

    #[test]
    fn what_is_no_literal_is_refused_where_it_stands() {
        assert_eq!(parse("{'shape': (3 3)}"), Err(13));
        assert_eq!(parse("{'shape': os.system}"), Err(10));
        assert!(parse(&"(".repeat(100_000)).is_err());
    }
}
