//! How many cuts have taken each block: small counters, 1, 4 or 8 bits each.
//!
//! Chaudhari, §3.3–3.4, keeps a number per block that each cut raises and its undoing lowers, and says
//! that n bits allow 2ⁿ undo operations. The reading here: n bits count to 2ⁿ − 1 cuts. A counter that has
//! reached that no longer knows its number: lowered, it has to be counted anew from the planes. So every
//! width allows any number of cuts, and its undoing in any order; a narrow one only counts anew more often.

/// Bits of a counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Width {
    /// 1: whether any cut has taken the block.
    One,
    /// 4: up to 15.
    #[default]
    Four,
    /// 8: up to 255.
    Eight,
}

impl Width {
    /// How many bits.
    pub fn bits(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Four => 4,
            Self::Eight => 8,
        }
    }

    /// The greatest number a counter holds; it stands for all from there on.
    pub fn most(self) -> u32 {
        (1 << self.bits()) - 1
    }
}

/// Counters, packed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Counters {
    width: Width,
    words: Vec<u64>,
}

impl Counters {
    pub fn new(width: Width, count: usize) -> Self {
        Self { width, words: vec![0; count.div_ceil(64 / width.bits() as usize)] }
    }

    pub fn get(&self, i: usize) -> u32 {
        let (word, shift) = self.place(i);
        (self.words[word] >> shift) as u32 & self.width.most()
    }

    /// Sets a counter to `value`, or to the greatest number it holds.
    pub fn set(&mut self, i: usize, value: u32) {
        let (word, shift) = self.place(i);
        let most = u64::from(self.width.most());
        self.words[word] &= !(most << shift);
        self.words[word] |= u64::from(value).min(most) << shift;
    }

    /// The number after `more` and `fewer` cuts; `None` where it has to be counted anew.
    pub fn after(&self, i: usize, more: u32, fewer: u32) -> Option<u32> {
        let now = self.get(i);
        if now == self.width.most() && fewer > 0 {
            return None;
        }
        now.saturating_add(more).checked_sub(fewer)
    }

    pub fn bytes(&self) -> usize {
        self.words.len() * 8
    }

    fn place(&self, i: usize) -> (usize, u32) {
        let bits = self.width.bits() as usize;
        let each = 64 / bits;
        (i / each, (i % each * bits) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_width_counts_to_its_most_and_then_has_to_count_anew() {
        for width in [Width::One, Width::Four, Width::Eight] {
            let mut counters = Counters::new(width, 100);
            counters.set(70, width.most() - 1);
            assert_eq!(counters.after(70, 1, 0), Some(width.most()));
            counters.set(70, width.most() + 5);
            assert_eq!(
                (counters.get(69), counters.get(70), counters.get(71)),
                (0, width.most(), 0)
            );
            assert_eq!(counters.after(70, 0, 1), None);
            assert!(counters.after(70, 1, 0) >= Some(width.most()));
            counters.set(70, 0);
            assert_eq!(counters, Counters::new(width, 100));
        }
    }
}
