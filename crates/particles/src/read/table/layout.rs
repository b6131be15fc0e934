//! How a table is laid out: what parts its fields, whether it has a header, where its rows begin.

use crate::read::Head;
use crate::read::rows::{MOST_COLUMNS, is_comment, is_missing};
use crate::read::text::{self, Separator};

/// How many rows are looked at.
const SAMPLE_ROWS: usize = 200;

/// The layout of a table.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) separator: Separator,
    /// Names of the columns, from a header, from comments, or none.
    pub(super) names: Option<Vec<String>>,
    /// The line of the first row, counted from 1.
    pub(super) first_row: u64,
    /// The number of rows, where the first line is nothing else.
    pub(super) declared: Option<u64>,
    /// Which columns hold numbers, as far as the first rows tell; `None` where all are empty there.
    pub(super) numeric: Vec<Option<bool>>,
}

/// A line and what is wrong with it.
pub(super) type Wrong = (u64, String);

/// A line that is no comment: its number, counted from 1, and its text.
type Numbered = (u64, String);

impl Layout {
    /// The layout that fits the first lines of a file.
    ///
    /// # Errors
    /// None fits; the error is that of the separator that got farthest.
    pub(super) fn guess(head: &Head<'_>) -> Result<Self, Wrong> {
        // IMD configurations are tables but for a header of their own, which says what a column means.
        if head.bytes.starts_with(b"#F ") {
            return Err((
                1,
                "expected a table, found the header of an IMD configuration".to_owned(),
            ));
        }
        let mut comments = Vec::new();
        let mut content: Vec<Numbered> = Vec::new();
        for (i, line) in head.lines().enumerate() {
            let line = line.trim_start_matches('\u{feff}').to_owned();
            if !is_comment(line.as_bytes()) {
                content.push((i as u64 + 1, line));
            } else if content.is_empty() {
                comments.push(line);
            }
            if content.len() > SAMPLE_ROWS {
                break;
            }
        }
        let declared = declared_count(&content);
        let body = &content[usize::from(declared.is_some())..];
        let mut farthest: Wrong = (1, "expected a table, found no line of values".to_owned());
        for separator in [
            Separator::Byte(b';'),
            Separator::Byte(b'\t'),
            Separator::Byte(b','),
            Separator::BlankQuoted,
        ] {
            match Self::with(separator, body, &comments) {
                Ok(layout) => return Ok(Self { declared, ..layout }),
                Err(wrong) if wrong.0 >= farthest.0 => farthest = wrong,
                Err(_) => {}
            }
        }
        Err(farthest)
    }

    fn with(separator: Separator, body: &[Numbered], comments: &[String]) -> Result<Self, Wrong> {
        let split: Vec<(u64, Vec<String>)> =
            body.iter().map(|(line, text)| (*line, tokens(text, separator))).collect();
        let numbers = |tokens: &[String]| tokens.iter().filter(|t| is_number(t, separator)).count();
        // Names, and perhaps a line of units, come before the first line that has a number.
        let headers = split.iter().take_while(|(_, t)| numbers(t) == 0).count();
        let (rows, names) = match (&split[headers.min(split.len())..], headers) {
            (rows, 0) => (rows, None),
            (rows, 1 | 2) => (rows, Some(split[0].1.clone())),
            _ => return Err(refuse(body, headers.saturating_sub(1), "a row with numbers")),
        };
        let Some((first_row, first)) = rows.first() else {
            return Self::empty(separator, body, names);
        };
        let fields = first.len();
        if !(2..=MOST_COLUMNS).contains(&fields) || numbers(first) < 2 {
            return Err(refuse(body, headers, "a row with two coordinates at least"));
        }
        for (i, (_, row)) in rows.iter().enumerate() {
            if row.len() != fields {
                let expected = format!("{fields} values as in line {first_row}");
                return Err(refuse(body, headers + i, &expected));
            }
        }
        let names =
            match names {
                Some(names) => Some(fit_names(names, fields).ok_or_else(|| {
                    refuse(body, headers, "as many values as there are names above")
                })?),
                None => names_in_comments(comments, fields, separator),
            };
        let numeric = (0..fields).map(|i| column_is_numeric(rows, i, separator)).collect();
        Ok(Self { separator, names, first_row: *first_row, declared: None, numeric })
    }

    /// A table with names and no rows.
    fn empty(
        separator: Separator,
        body: &[Numbered],
        names: Option<Vec<String>>,
    ) -> Result<Self, Wrong> {
        match (body, names) {
            ([(line, _)], Some(names)) if super::columns::has_coordinates(&names) => {
                let numeric = vec![None; names.len()];
                Ok(Self {
                    separator,
                    names: Some(names),
                    first_row: line + 1,
                    declared: None,
                    numeric,
                })
            }
            _ => Err(refuse(body, body.len().saturating_sub(1), "a row with numbers")),
        }
    }
}

fn refuse(body: &[Numbered], index: usize, expected: &str) -> Wrong {
    let (line, text) =
        body.get(index).or(body.last()).map_or((1, ""), |(line, text)| (*line, text.trim()));
    (line, format!("expected {expected}, found {}", text::shown(text.as_bytes())))
}

/// The fields of a line; an empty one at the end of a CSV line is none.
fn tokens(text: &str, separator: Separator) -> Vec<String> {
    let mut tokens: Vec<String> = text::fields(text.as_bytes(), separator)
        .take(MOST_COLUMNS + 2)
        .map(|t| String::from_utf8_lossy(t).into_owned())
        .collect();
    if text.trim_end().ends_with([',', ';']) && tokens.last().is_some_and(String::is_empty) {
        tokens.pop();
    }
    tokens
}

fn is_number(token: &str, separator: Separator) -> bool {
    text::real(token.as_bytes()).is_some()
        || separator == Separator::Byte(b';')
            && text::real(token.replace(',', ".").as_bytes()).is_some()
}

fn column_is_numeric(
    rows: &[(u64, Vec<String>)],
    column: usize,
    separator: Separator,
) -> Option<bool> {
    let mut tokens = rows
        .iter()
        .filter_map(|(_, row)| row.get(column))
        .filter(|t| !is_missing(t.as_bytes()))
        .peekable();
    tokens.peek()?;
    Some(tokens.all(|t| is_number(t, separator)))
}

/// The count, where the first line is one integer and rows of more follow.
fn declared_count(content: &[Numbered]) -> Option<u64> {
    let [(_, first), (_, second), ..] = content else { return None };
    let count = text::integer(first.trim().as_bytes())?;
    let parted = second.trim().contains([' ', '\t', ',', ';']);
    u64::try_from(count).ok().filter(|_| parted)
}

/// Names for `fields` columns; tables from R have none for the first, which numbers the rows.
fn fit_names(mut names: Vec<String>, fields: usize) -> Option<Vec<String>> {
    if names.len() + 1 == fields {
        names.insert(0, "Row".to_owned());
    }
    (names.len() == fields).then_some(names)
}

/// Names from comments: `# $1 = time [s]`, one a line, or `# x y z` above the rows.
fn names_in_comments(
    comments: &[String],
    fields: usize,
    separator: Separator,
) -> Option<Vec<String>> {
    let plain = |c: &String| c.trim().trim_start_matches(['#', '%']).trim().to_owned();
    let numbered: Vec<String> = comments
        .iter()
        .filter_map(|c| {
            let comment = plain(c);
            let (number, name) = comment.strip_prefix('$')?.split_once('=')?;
            number.trim().parse::<usize>().ok().map(|_| name.trim().to_owned())
        })
        .collect();
    if numbered.len() == fields {
        return Some(numbered);
    }
    let candidates = comments.iter().rev().flat_map(|c| {
        let comment = plain(c);
        [tokens(&comment, separator), tokens(&comment, Separator::BlankQuoted)]
    });
    let fits = |names: &Vec<String>| {
        names.len() == fields && !names.iter().any(|n| is_number(n, separator))
    };
    candidates.into_iter().find(fits)
}
