//! Writing to many pieces of an array at once.

/// How many elements are written at once: fewer do not make the memory hurry.
const LINE: usize = 32;

/// A piece of an array, and where in the array it begins.
pub(crate) type Piece<'a, T> = (usize, &'a mut [T]);

/// Elements on their way to the pieces of an array, a line at a time: so many pieces are open at once
/// that writing each element by itself would wait for memory every time.
pub(crate) struct Streams<'a, T> {
    /// Which elements of each piece's line wait: `from..to`.
    to: Vec<u32>,
    from: Vec<u32>,
    lines: Vec<[T; LINE]>,
    rest: Vec<&'a mut [T]>,
}

impl<'a, T: Copy + Default> Streams<'a, T> {
    /// Streams to `pieces`. Lines begin at multiples of their length in the array.
    pub fn new(pieces: Vec<Piece<'a, T>>) -> Self {
        let from: Vec<u32> = pieces.iter().map(|(at, _)| (at % LINE) as u32).collect();
        Self {
            to: from.clone(),
            from,
            lines: vec![[T::default(); LINE]; pieces.len()],
            rest: pieces.into_iter().map(|(_, piece)| piece).collect(),
        }
    }

    /// Puts `value` at the next place of piece `piece`.
    #[inline(always)]
    pub fn put(&mut self, piece: usize, value: T) {
        let mut to = self.to[piece] as usize;
        // Not when its last element comes: reading the line would then wait for that to arrive.
        if to == LINE {
            self.write_line(piece);
            to = 0;
        }
        self.lines[piece][to % LINE] = value;
        self.to[piece] = to as u32 + 1;
    }

    #[inline(always)]
    fn write_line(&mut self, piece: usize) {
        if self.from[piece] > 0 {
            return self.write_part(piece);
        }
        let rest = std::mem::take(&mut self.rest[piece]);
        if let Some((place, rest)) = rest.split_first_chunk_mut() {
            *place = self.lines[piece];
            self.rest[piece] = rest;
        }
    }

    /// Writes a line that is not full: the first or the last of the piece.
    #[cold]
    fn write_part(&mut self, piece: usize) {
        let waiting = &self.lines[piece][self.from[piece] as usize..self.to[piece] as usize];
        let (place, rest) = std::mem::take(&mut self.rest[piece]).split_at_mut(waiting.len());
        place.copy_from_slice(waiting);
        self.rest[piece] = rest;
        self.from[piece] = 0;
    }

    /// Writes what waits.
    pub fn finish(mut self) {
        (0..self.rest.len()).for_each(|piece| self.write_part(piece));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_arrives_in_order() {
        let lengths = [0, 5, 200, 32, 1, 64, 31];
        let mut array = vec![0u32; lengths.iter().sum()];
        let mut pieces = Vec::new();
        let (mut at, mut rest) = (0, &mut array[..]);
        for length in lengths {
            let (piece, after) = rest.split_at_mut(length);
            pieces.push((at, piece));
            (at, rest) = (at + length, after);
        }
        let mut streams = Streams::new(pieces);
        for i in 0..200 {
            for (piece, _) in lengths.iter().enumerate().filter(|(_, length)| i < **length) {
                streams.put(piece, (1000 * piece + i) as u32);
            }
        }
        streams.finish();
        let of_piece =
            |(piece, length): (usize, &usize)| (0..*length).map(move |i| 1000 * piece + i);
        let expected: Vec<u32> =
            lengths.iter().enumerate().flat_map(of_piece).map(|v| v as u32).collect();
        assert_eq!(array, expected);
    }
}
