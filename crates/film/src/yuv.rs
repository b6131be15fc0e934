//! From sRGB pixels to what encoders take: Y'CbCr of BT.709 in its limited range, colour at half the
//! resolution (4:2:0).
//!
//! > Y' = 16 + 219·(0.2126 R + 0.7152 G + 0.0722 B)
//! > Cb = 128 + 224·(B − Y)/1.8556,  Cr = 128 + 224·(R − Y)/1.5748
//!
//! with R, G, B and Y in 0 … 1. A colour sample stands beside the left one of its two columns and between
//! its two rows (H.264's default, chroma_sample_loc_type 0): it is the mean of two rows, with the weights
//! ¼, ½, ¼ over three columns. All in whole numbers, so that a film has the same bits everywhere.

use motes_frame::Rgba8;

/// The planes of one picture: even sides, rows one after the other.
pub(crate) struct Planes {
    pub width: usize,
    pub height: usize,
    /// `width · height` bytes.
    pub y: Vec<u8>,
    /// `width · height / 4` bytes.
    pub cb: Vec<u8>,
    /// `width · height / 4` bytes.
    pub cr: Vec<u8>,
}

/// Binary digits after the point.
const SHIFT: u32 = 20;

/// Weights of R, G and B, for 8-bit values.
const fn weights(of: [f64; 3], range: f64) -> [i32; 3] {
    let one = (1 << SHIFT) as f64 * range / 255.0;
    [nearest(of[0] * one), nearest(of[1] * one), nearest(of[2] * one)]
}

const fn nearest(x: f64) -> i32 {
    if x < 0.0 { (x - 0.5) as i32 } else { (x + 0.5) as i32 }
}

const Y: [i32; 3] = weights([0.2126, 0.7152, 0.0722], 219.0);
const CB: [i32; 3] = weights([-0.2126 / 1.8556, -0.7152 / 1.8556, 0.5], 224.0);
const CR: [i32; 3] = weights([0.5, -0.7152 / 1.5748, -0.0722 / 1.5748], 224.0);

impl Planes {
    /// Room for a picture of `width` × `height` pixels. An odd side is one pixel longer: its last column
    /// or row stands twice.
    pub fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width.next_multiple_of(2), height.next_multiple_of(2));
        let quarter = width * height / 4;
        Self { width, height, y: vec![0; 4 * quarter], cb: vec![0; quarter], cr: vec![0; quarter] }
    }

    /// Takes over a picture of the size it was made for; its alpha does not count.
    pub fn fill(&mut self, picture: &Rgba8) {
        let row_of = |row: usize| {
            let row = row.min(picture.height - 1) * picture.width;
            &picture.pixels[row..row + picture.width]
        };
        let half = self.width / 2;
        for (row, out) in self.y.chunks_exact_mut(self.width).enumerate() {
            luma(row_of(row), out);
        }
        let mut sums = vec![[0; 3]; self.width];
        let rows = self.cb.chunks_exact_mut(half).zip(self.cr.chunks_exact_mut(half));
        for (row, (cb, cr)) in rows.enumerate() {
            add_rows([row_of(2 * row), row_of(2 * row + 1)], &mut sums);
            for (i, (cb, cr)) in cb.iter_mut().zip(cr).enumerate() {
                let (left, here, right) = (sums[(2 * i).max(1) - 1], sums[2 * i], sums[2 * i + 1]);
                // Eight times the mean.
                let sum: [i32; 3] = std::array::from_fn(|c| left[c] + 2 * here[c] + right[c]);
                (*cb, *cr) = (weigh(CB, sum, 128, 3), weigh(CR, sum, 128, 3));
            }
        }
    }
}

fn luma(row: &[[u8; 4]], out: &mut [u8]) {
    let last = row.last().copied().unwrap_or_default();
    let pixels = row.iter().copied().chain(std::iter::repeat(last));
    for (out, [r, g, b, _]) in out.iter_mut().zip(pixels) {
        *out = weigh(Y, [r, g, b].map(i32::from), 16, 0);
    }
}

/// The sums of two rows' pixels.
fn add_rows([a, b]: [&[[u8; 4]]; 2], sums: &mut [[i32; 3]]) {
    let mut last = [0; 3];
    let mut rows = a.iter().zip(b);
    for sum in sums {
        if let Some((a, b)) = rows.next() {
            last = std::array::from_fn(|c| i32::from(a[c]) + i32::from(b[c]));
        }
        *sum = last;
    }
}

/// `zero` + the weighted sum of `rgb`, which is 2^`more` times as large, rounded.
fn weigh(by: [i32; 3], rgb: [i32; 3], zero: i32, more: u32) -> u8 {
    let shift = SHIFT + more;
    let sum: i64 = (0..3).map(|c| i64::from(by[c]) * i64::from(rgb[c])).sum();
    (zero + ((sum + (1 << (shift - 1))) >> shift) as i32) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [u8; 3]) -> Planes {
        let pixels = (0..width * height).map(|i| {
            let [r, g, b] = pixel(i % width, i / width);
            [r, g, b, 255]
        });
        let mut planes = Planes::new(width, height);
        planes.fill(&Rgba8 { width, height, pixels: pixels.collect() });
        planes
    }

    #[test]
    fn the_colours_of_the_standard() {
        // ITU-R BT.709: black, white, and the bars of full colour, eight bits.
        for (rgb, expected) in [
            ([0, 0, 0], [16, 128, 128]),
            ([255, 255, 255], [235, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
            ([255, 255, 0], [219, 16, 138]),
            ([0, 255, 255], [188, 154, 16]),
            ([255, 0, 255], [78, 214, 230]),
        ] {
            let p = filled(6, 4, |_, _| rgb);
            let all = |plane: &[u8], v: u8| plane.iter().all(|x| *x == v);
            let [y, cb, cr] = expected;
            assert!(all(&p.y, y) && all(&p.cb, cb) && all(&p.cr, cr), "{rgb:?}: {}", p.y[0]);
        }
    }

    #[test]
    fn grey_has_no_colour_and_every_level_its_place() {
        for level in 0..=255 {
            let p = filled(2, 2, |_, _| [level; 3]);
            assert_eq!((p.cb[0], p.cr[0]), (128, 128), "{level}");
            let exact = 16.0 + 219.0 / 255.0 * f64::from(level);
            assert!((f64::from(p.y[0]) - exact).abs() <= 0.5, "{level}");
        }
    }

    #[test]
    fn odd_sides_repeat_the_last_pixels() {
        let p = filled(3, 5, |x, y| [(10 * x + y) as u8; 3]);
        assert_eq!((p.width, p.height), (4, 6));
        assert_eq!((p.y.len(), p.cb.len()), (24, 6));
        assert!((0..6).all(|row| p.y[row * 4 + 3] == p.y[row * 4 + 2]));
        assert_eq!(p.y[5 * 4..], p.y[4 * 4..5 * 4]);
        let one = filled(1, 1, |_, _| [255, 0, 0]);
        assert_eq!((&one.y[..], &one.cb[..], &one.cr[..]), (&[63; 4][..], &[102][..], &[240][..]));
    }

    #[test]
    fn colour_stands_beside_the_left_column() {
        // Red from column 4 on: the sample at column 4 has three quarters of it, that before none.
        let p = filled(8, 2, |x, _| if x >= 4 { [255, 0, 0] } else { [0, 0, 0] });
        assert_eq!(p.cr, [128, 128, 212, 240]);
    }
}
