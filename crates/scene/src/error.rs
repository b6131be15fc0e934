//! What can be wrong with a scene.

/// Why a scene, or one `path=value` of it, is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// The TOML text does not read as a scene; lines count from 1.
    #[error("line {line}: {reason}")]
    Text {
        /// The line of the text at fault, from 1.
        line: usize,
        /// What was expected and what stood there.
        reason: String,
    },
    /// A path names no parameter.
    #[error("no parameter `{path}`{hint}")]
    UnknownPath {
        /// The path as typed.
        path: String,
        /// `; did you mean …?`, or what there is.
        hint: String,
    },
    /// A parameter has a value it cannot have.
    #[error("{path}: expected {expected}, found {found}")]
    Value {
        /// The parameter's path, such as `camera.fov`.
        path: String,
        /// What it can be.
        expected: String,
        /// What stood there.
        found: String,
    },
    /// A name (of a colour map, …) that is not known.
    #[error("no {kind} `{name}`{hint}")]
    UnknownName {
        /// What was looked for, such as `colour map`.
        kind: &'static str,
        /// The name as typed.
        name: String,
        /// `; did you mean …?`, or empty.
        hint: String,
    },
}

/// A `Result` with [`SceneError`].
pub type Result<T, E = SceneError> = std::result::Result<T, E>;

impl SceneError {
    /// An unfit value at `path`.
    pub(crate) fn value(
        path: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::Value {
            path: path.into(),
            expected: expected.into(),
            found: quoted(&found.to_string()),
        }
    }
}

/// Longest word that is compared or quoted whole, bytes: no name is longer.
const LONGEST: usize = 200;

/// `text` for an error's message: long text is cut.
pub(crate) fn quoted(text: &str) -> String {
    let end = text.floor_char_boundary(LONGEST);
    format!("{}{}", &text[..end], if end < text.len() { "…" } else { "" })
}

/// How alike two words are, 0 to 1.
pub(crate) fn likeness(a: &str, b: &str) -> f64 {
    if a.len() > LONGEST { 0.0 } else { strsim::jaro_winkler(a, b) }
}

/// The candidate most like `word`, if any is like it at all; case does not count.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase();
    candidates
        .into_iter()
        .map(|c| (likeness(&word, &c.to_lowercase()), c))
        .filter(|(score, _)| *score > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

/// `; did you mean …?`, or the list of what there is when nothing is near.
pub(crate) fn hint<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    let candidates: Vec<&str> = candidates.into_iter().collect();
    match nearest(word, candidates.iter().copied()) {
        Some(near) => format!("; did you mean `{near}`?"),
        None if candidates.is_empty() => String::new(),
        None => format!("; there is {}", candidates.join(", ")),
    }
}
