//! Words of a file, each kept once.

use std::collections::HashMap;

use crate::Values;

/// How many of the words seen lately are found without the table: nearly every line repeats one. A
/// power of two.
const RECENT: usize = 64;

/// A column of words, with its dictionary in order of first appearance.
#[derive(Debug)]
pub(super) struct Dictionary {
    /// One index into the words per value.
    pub(super) codes: Vec<u32>,
    words: Vec<Box<[u8]>>,
    known: HashMap<Box<[u8]>, u32>,
    /// Codes of words seen lately, by some bits of the word.
    recent: Box<[u32; RECENT]>,
}

impl Default for Dictionary {
    fn default() -> Self {
        let (codes, words, known) = (Vec::new(), Vec::new(), HashMap::new());
        Self { codes, words, known, recent: Box::new([0; RECENT]) }
    }
}

/// A place among the recent words, by a word's first bytes and length.
fn place(word: &[u8]) -> usize {
    let bytes =
        word.iter().take(8).fold(word.len() as u64, |all, byte| all << 7 ^ u64::from(*byte));
    // The golden ratio spreads the bits.
    (bytes.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 58) as usize % RECENT
}

impl Dictionary {
    /// The code of `word`, which is entered if it is new.
    pub(super) fn code(&mut self, word: &[u8]) -> u32 {
        let place = place(word);
        let recent = self.recent[place];
        if self.words.get(recent as usize).is_some_and(|known| **known == *word) {
            return recent;
        }
        let code = self.known.get(word).copied().unwrap_or_else(|| {
            let code = self.words.len() as u32;
            self.words.push(word.into());
            self.known.insert(word.into(), code);
            code
        });
        self.recent[place] = code;
        code
    }

    /// Adds a value.
    pub(super) fn push(&mut self, word: &[u8]) {
        let code = self.code(word);
        self.codes.push(code);
    }

    /// Adds the values of another column.
    pub(super) fn append(&mut self, other: Self) {
        let map: Vec<u32> = other.words.iter().map(|word| self.code(word)).collect();
        self.codes.extend(other.codes.iter().map(|code| map[*code as usize]));
    }

    /// Whether there is no word but the empty one.
    pub(super) fn is_blank(&self) -> bool {
        self.words.iter().all(|word| word.is_empty())
    }

    /// The column; bytes that are not UTF-8 are replaced.
    pub(super) fn into_values(self) -> Values {
        let text = |word: Box<[u8]>| String::from_utf8_lossy(&word).into_owned();
        Values::Names { codes: self.codes, names: self.words.into_iter().map(text).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(words: &[&str]) -> Dictionary {
        let mut dictionary = Dictionary::default();
        words.iter().for_each(|word| dictionary.push(word.as_bytes()));
        dictionary
    }

    #[test]
    fn words_keep_the_order_of_first_appearance() {
        let mut all = of(&["CA", "", "N", "CA", "N"]);
        all.append(of(&["O", "N", "CA"]));
        let names = ["CA", "", "N", "O"].map(String::from).to_vec();
        assert_eq!(all.into_values(), Values::Names { codes: vec![0, 1, 2, 0, 2, 3, 2, 0], names });
    }

    #[test]
    fn more_words_than_are_recent_keep_their_codes() {
        let words: Vec<String> = (0..1000).map(|i| format!("w{}", i % 500)).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let codes: Vec<u32> = (0..1000).map(|i| i % 500).collect();
        assert_eq!(of(&words).codes, codes);
    }

    #[test]
    fn blank_is_no_word_but_the_empty_one() {
        assert!(of(&[]).is_blank() && of(&["", ""]).is_blank() && !of(&["", "A"]).is_blank());
    }
}
