//! What the user names: a file, a pattern of files, or a deterministic set.
//!
//! In a pattern `*` stands for any run of characters, `?` for one, `[a-c]` and `[!a-c]` for one of a
//! set, `{}` for any number, `%d` for any number and `%04d` for one of at least four digits. Files
//! come in natural order: `out_9` before `out_10`.

use std::cmp::Ordering;
use std::path::{Component, Path, PathBuf};

use crate::demo::Demo;
use crate::{Place, ReadError, Result};

/// A source, with its files found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Source {
    /// At least one file, in natural order.
    Files(Vec<PathBuf>),
    /// A deterministic set.
    Demo(Demo),
}

impl Source {
    /// Understands `source` and looks for its files.
    ///
    /// # Errors
    /// There is no such file, nothing matches the pattern, or a `demo:` is misspelt.
    pub(crate) fn find(source: &str) -> Result<Self> {
        let error = |message: String| Err(ReadError::new(source, Place::Whole, message));
        if let Some(demo) = source.strip_prefix("demo:") {
            return Demo::parse(demo).map(Self::Demo).or_else(error);
        }
        let path = Path::new(source);
        // A name that exists is that file, whatever characters it holds.
        if path.is_dir() {
            let pattern = path.join("*");
            return error(format!(
                "is a directory; name a file in it or a pattern such as '{}'",
                pattern.display()
            ));
        }
        if !is_pattern(source) || path.exists() {
            return match path.exists() {
                true => Ok(Self::Files(vec![path.into()])),
                false => error("no such file".into()),
            };
        }
        let mut files = matching_files(path);
        if files.is_empty() {
            return error(format!("no file matches the pattern '{source}'"));
        }
        files.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
        Ok(Self::Files(files))
    }
}

/// One piece of a pattern for a single directory level.
#[derive(Clone, Debug, PartialEq)]
enum Piece {
    Literal(char),
    /// `?`
    One,
    /// `*`
    Any,
    /// `[…]`: ranges, both ends included, and whether they are excluded.
    Set(Vec<(char, char)>, bool),
    /// `{}`, `%d`, `%04d`: at least so many digits.
    Digits(usize),
}

fn is_pattern(text: &str) -> bool {
    parse_pattern(text).iter().any(|piece| !matches!(piece, Piece::Literal(_)))
}

fn parse_pattern(text: &str) -> Vec<Piece> {
    let chars: Vec<char> = text.chars().collect();
    let mut pieces = Vec::new();
    let mut rest = &chars[..];
    while let [first, tail @ ..] = rest {
        let (piece, used) = match (first, tail) {
            ('*', _) => (Piece::Any, 1),
            ('?', _) => (Piece::One, 1),
            ('{', ['}', ..]) => (Piece::Digits(1), 2),
            ('%', _) => printf_number(tail).map_or((Piece::Literal('%'), 1), |(p, n)| (p, n + 1)),
            ('[', _) => character_set(tail).map_or((Piece::Literal('['), 1), |(p, n)| (p, n + 1)),
            (other, _) => (Piece::Literal(*other), 1),
        };
        pieces.push(piece);
        rest = &rest[used..];
    }
    pieces
}

/// `04d` of `%04d`, and its length.
fn printf_number(tail: &[char]) -> Option<(Piece, usize)> {
    let digits = tail.iter().take_while(|c| c.is_ascii_digit()).count();
    if digits > 3 || !matches!(tail.get(digits), Some('d' | 'i' | 'u')) {
        return None;
    }
    let width = match tail[..digits].split_first() {
        Some(('0', width)) => width.iter().collect::<String>().parse().unwrap_or(1),
        _ => 1,
    };
    Some((Piece::Digits(width.max(1)), digits + 1))
}

/// `a-c]` of `[a-c]`, and its length.
fn character_set(tail: &[char]) -> Option<(Piece, usize)> {
    let excluded = matches!(tail.first(), Some('!' | '^'));
    let start = usize::from(excluded);
    // A `]` that comes first stands for itself.
    let length = tail.get(start + 1..)?.iter().position(|c| *c == ']')? + 1;
    let mut inside = &tail[start..start + length];
    let mut ranges = Vec::new();
    while let [first, more @ ..] = inside {
        match more {
            ['-', last, more @ ..] => {
                ranges.push((*first, *last));
                inside = more;
            }
            _ => {
                ranges.push((*first, *first));
                inside = more;
            }
        }
    }
    Some((Piece::Set(ranges, excluded), start + length + 1))
}

/// Whether the whole of `name` fits; all positions reached are followed at once, so that no pattern
/// takes more than pattern × name steps.
fn fits(pieces: &[Piece], name: &str) -> bool {
    let name: Vec<char> = name.chars().collect();
    // A hidden file must be meant.
    if name.first() == Some(&'.') && pieces.first() != Some(&Piece::Literal('.')) {
        return false;
    }
    let mut reached = vec![false; name.len() + 1];
    reached[0] = true;
    for piece in pieces {
        reached = advance(piece, &name, &reached);
    }
    reached[name.len()]
}

fn advance(piece: &Piece, name: &[char], reached: &[bool]) -> Vec<bool> {
    let mut next = vec![false; reached.len()];
    let mut run = None;
    for (i, here) in reached.iter().enumerate() {
        match piece {
            Piece::Any => next[i] = *here || (i > 0 && next[i - 1]),
            Piece::Digits(least) => {
                // `run`: the digits since the earliest position reached.
                if let Some(length) = run {
                    next[i] = length >= *least;
                }
                let digit = name.get(i).is_some_and(char::is_ascii_digit);
                run = match (digit, run, here) {
                    (true, Some(length), _) => Some(length + 1),
                    (true, None, true) => Some(1),
                    _ => None,
                };
            }
            _ => {
                if *here && name.get(i).is_some_and(|c| takes(piece, *c)) {
                    next[i + 1] = true;
                }
            }
        }
    }
    next
}

fn takes(piece: &Piece, c: char) -> bool {
    match piece {
        Piece::Literal(literal) => *literal == c,
        Piece::Set(ranges, excluded) => {
            ranges.iter().any(|(low, high)| (*low..=*high).contains(&c)) != *excluded
        }
        _ => true,
    }
}

/// All files that fit, level by level; directories may be patterns too.
fn matching_files(pattern: &Path) -> Vec<PathBuf> {
    let mut found = vec![PathBuf::new()];
    for component in pattern.components() {
        let Component::Normal(level) = component else {
            found.iter_mut().for_each(|path| path.push(component));
            continue;
        };
        let level = level.to_string_lossy();
        if !is_pattern(&level) {
            found.iter_mut().for_each(|path| path.push(&*level));
            continue;
        }
        let pieces = parse_pattern(&level);
        found = found.iter().flat_map(|folder| matching_entries(folder, &pieces)).collect();
    }
    found.retain(|path| path.is_file());
    found
}

fn matching_entries(folder: &Path, pieces: &[Piece]) -> Vec<PathBuf> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    // A folder that cannot be read holds nothing that matches.
    let entries = std::fs::read_dir(here).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.file_name())
        .filter(|name| fits(pieces, &name.to_string_lossy()))
        .map(|name| folder.join(name))
        .collect()
}

/// Orders runs of digits by their value and everything else by character; a total order.
fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a.as_bytes(), b.as_bytes());
    loop {
        let (run_left, run_right) = (digits(left), digits(right));
        let order = if !run_left.is_empty() && !run_right.is_empty() {
            (left, right) = (&left[run_left.len()..], &right[run_right.len()..]);
            let value = |run| {
                let start = <[u8]>::iter(run).take_while(|d| **d == b'0').count();
                run[start..].to_vec()
            };
            let (x, y) = (value(run_left), value(run_right));
            x.len().cmp(&y.len()).then(x.cmp(&y))
        } else {
            match (left.split_first(), right.split_first()) {
                (Some((x, more_left)), Some((y, more_right))) => {
                    (left, right) = (more_left, more_right);
                    x.cmp(y)
                }
                // `07` and `7` have the same value: then by character.
                (None, None) => return a.cmp(b),
                (x, _) => return if x.is_none() { Ordering::Less } else { Ordering::Greater },
            }
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

fn digits(text: &[u8]) -> &[u8] {
    &text[..text.iter().take_while(|c| c.is_ascii_digit()).count()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(pattern: &str, name: &str) -> bool {
        fits(&parse_pattern(pattern), name)
    }

    #[test]
    fn patterns_fit_what_they_say() {
        assert!(fit("dump.*.gz", "dump.100.gz"));
        assert!(!fit("dump.*.gz", "dump.100.gz.bak"));
        assert!(fit("*a*b*", "xxaxxbxx") && !fit("*a*b*", "xxbxxaxx"));
        assert!(fit("out_%04d.vtk", "out_0012.vtk") && fit("out_%04d.vtk", "out_12345.vtk"));
        assert!(!fit("out_%04d.vtk", "out_12.vtk") && !fit("out_%04d.vtk", "out_final.vtk"));
        assert!(fit("out_%d.vtk", "out_7.vtk") && !fit("out_%d.vtk", "out_.vtk"));
        assert!(fit("a{}b", "a123b") && !fit("a{}b", "ab") && !fit("a{}b", "a1.5b"));
        // Digits before a number may be literal text of the name.
        assert!(fit("*{}.vtk", "run12.vtk") && fit("1{}", "12") && !fit("1{}", "1"));
        assert!(fit("f[0-2].x", "f1.x") && !fit("f[0-2].x", "f3.x") && fit("f[!0-2].x", "f3.x"));
        assert!(fit("f[]]", "f]") && fit("f[x", "f[x") && fit("100%", "100%") && fit("?", "ä"));
        assert!(!fit("*", ".hidden") && fit(".*", ".hidden"));
    }

    #[test]
    fn a_pattern_full_of_stars_is_quick() {
        assert!(!fit(&"*a".repeat(200), &"a".repeat(199)));
    }

    #[test]
    fn numbers_are_ordered_by_value() {
        let mut names = ["out_10", "out_9", "out_009", "out_1.b", "out_1.a", "out", "out_100"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["out", "out_1.a", "out_1.b", "out_009", "out_9", "out_10", "out_100"]);
    }

    #[test]
    fn finds_files_in_natural_order() -> std::io::Result<()> {
        let root = std::env::temp_dir().join(format!("motes-source-{}", std::process::id()));
        for name in ["a1/p_10.x", "a1/p_9.x", "a2/p_1.x", "a1/q.x", "b/p_1.x", "a1/[odd].x"] {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(&root))?;
            std::fs::write(path, "1")?;
        }
        let find = |pattern: &str| Source::find(&root.join(pattern).to_string_lossy());
        let expected = ["a1/p_9.x", "a1/p_10.x", "a2/p_1.x"].map(|name| root.join(name));
        assert_eq!(find("a?/p_{}.x"), Ok(Source::Files(expected.to_vec())));
        assert_eq!(find("a1/[odd].x"), Ok(Source::Files(vec![root.join("a1/[odd].x")])));
        let message = |pattern| find(pattern).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(
            message("z_*.x").contains("no file matches the pattern")
                && message("z_*.x").contains("z_*.x")
        );
        assert!(message("a1").contains("is a directory"));
        assert!(message("none.x").contains("no such file"));
        std::fs::remove_dir_all(&root)
    }

    #[test]
    fn demos_are_told_from_files() {
        assert!(matches!(Source::find("demo:dam:1e3"), Ok(Source::Demo(_))));
        let message = Source::find("demo:dan:1e3").err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("demo:dan:1e3") && message.contains("dam"), "{message}");
    }
}
