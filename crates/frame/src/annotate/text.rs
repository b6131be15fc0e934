//! Text in DejaVu Sans.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};

use super::coverage::{Coverage, Point};

/// Height of capitals and digits, in ems of DejaVu Sans.
pub(crate) const CAP_HEIGHT: f32 = 0.729;
/// More than any label that can be read.
const MOST_CHARACTERS: usize = 500;

static FONT: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::try_from_slice(dejavu::sans::regular()).ok());

/// One line of text of a given size, ready to be placed.
pub(crate) struct Text {
    glyphs: Vec<ab_glyph::Glyph>,
    /// Advance of the whole line in pixels.
    pub(crate) width: f32,
    /// Size in pixels per em.
    pub(crate) em: f32,
}

impl Text {
    /// Sets `text` in `em` pixels; what needs more than `max_width` pixels ends in an ellipsis.
    pub(crate) fn new(text: &str, em: f32, max_width: f32) -> Text {
        let shown = |c: &char| !c.is_control();
        let characters: Vec<char> = text.chars().filter(shown).take(MOST_CHARACTERS).collect();
        let line = Text::set(&characters, em);
        if line.width <= max_width {
            return line;
        }
        let shorter = |length: usize| {
            let kept = characters.iter().take(length).copied();
            Text::set(&kept.chain(['…']).collect::<Vec<char>>(), em)
        };
        let fitting = (0..characters.len()).rev().map(shorter).find(|t| t.width <= max_width);
        fitting.unwrap_or(Text { glyphs: Vec::new(), width: 0.0, em })
    }

    fn set(characters: &[char], em: f32) -> Text {
        let mut line = Text { glyphs: Vec::new(), width: 0.0, em };
        let Some(font) = &*FONT else { return line };
        // The rasteriser's scale is the height from ascender to descender.
        let units = font.units_per_em().unwrap_or(2048.0);
        let scale = PxScale::from(em * font.height_unscaled() / units);
        let scaled = font.as_scaled(scale);
        let mut previous = None;
        for &character in characters {
            let id = scaled.glyph_id(character);
            line.width += previous.map_or(0.0, |before| scaled.kern(before, id));
            line.glyphs.push(id.with_scale_and_position(scale, point(line.width, 0.0)));
            line.width += scaled.h_advance(id);
            previous = Some(id);
        }
        line
    }

    /// The text's shape in a picture of `size` pixels, `at` the left end of its baseline, with room for
    /// `rim` pixels around it.
    pub(crate) fn coverage(&self, at: Point, rim: f32, size: [usize; 2]) -> Coverage {
        // A baseline between pixels would blur every foot.
        let [x, y] = [at[0], at[1].round()];
        let bounds = [x - self.em, y - self.em, x + self.width + self.em, y + 0.3 * self.em];
        let mut coverage = Coverage::new(bounds, rim, size);
        let Some(font) = &*FONT else { return coverage };
        for glyph in &self.glyphs {
            let mut placed = glyph.clone();
            placed.position.x += x;
            placed.position.y += y;
            let Some(outline) = font.outline_glyph(placed) else { continue };
            let corner = outline.px_bounds().min;
            outline.draw(|column, row, share| {
                let (x, y) = (corner.x + column as f32, corner.y + row as f32);
                if x >= 0.0 && y >= 0.0 {
                    coverage.put(x as usize, y as usize, share.min(1.0));
                }
            });
        }
        coverage
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_what_science_writes() {
        let font = FONT.as_ref().unwrap();
        for character in "AZaz09 Åµμ·−×²³⁰⁹⁻°…ÄöüßσρΔ₀₂".chars() {
            assert_ne!(font.glyph_id(character).0, 0, "{character}");
        }
    }

    #[test]
    fn capitals_are_as_high_as_the_layout_assumes() {
        let em = 200.0;
        let coverage = Text::new("H", em, 1e3).coverage([50.0, 250.0], 0.0, [300, 300]);
        let rows = coverage.values.chunks(coverage.size[0]);
        let height = rows.filter(|row| row.iter().any(|v| *v > 0.5)).count() as f32;
        assert!((height - CAP_HEIGHT * em).abs() <= 1.0, "{height}");
    }

    #[test]
    fn long_text_ends_in_an_ellipsis_that_fits() {
        let whole = Text::new("Potential energy per atom", 20.0, f32::INFINITY);
        let cut = Text::new("Potential energy per atom", 20.0, 100.0);
        assert!(whole.width > 200.0);
        assert!((80.0..=100.0).contains(&cut.width), "{}", cut.width);
        assert_eq!(Text::new("abc", 20.0, 1.0).width, 0.0);
    }

    #[test]
    fn absurd_text_is_nothing() {
        for em in [0.0, -5.0, f32::NAN] {
            Text::new("a\n\u{0}\u{10FFFF}", em, 50.0).coverage([f32::NAN, 1e30], 2.0, [4, 4]);
        }
    }
}
