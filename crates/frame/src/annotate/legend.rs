//! What the colours mean: a bar with ticks, or a list of names.

use super::canvas::{Align, Canvas};
use super::coverage::Bounds;
use super::text::{CAP_HEIGHT, Text};
use crate::ticks::ticks;

/// What the colours mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// What is coloured, with its unit, such as `Velocity (Å/ps)`; may be empty.
    pub title: String,
    /// The colours and what each stands for.
    pub keys: LegendKeys,
}

/// The colours of a legend and what each stands for.
#[derive(Clone, Debug, PartialEq)]
pub enum LegendKeys {
    /// A range of numbers.
    Scale {
        /// The numbers of the first and the last colour.
        range: [f64; 2],
        /// Linear colours, evenly spaced over the range; a few hundred look continuous.
        colors: Vec<[f32; 3]>,
    },
    /// Names; of more than twenty, the rest is only counted.
    Categories(Vec<Category>),
}

/// One entry of a list of names.
#[derive(Clone, Debug, PartialEq)]
pub struct Category {
    /// The name.
    pub name: String,
    /// Its linear colour.
    pub color: [f32; 3],
}

const MOST_CATEGORIES: usize = 20;

/// The part of the picture that a legend may fill.
struct Room {
    right: f32,
    top: f32,
    bottom: f32,
    /// Widest text.
    width: f32,
}

impl Legend {
    /// Draws at the right, above `taken` pixels at the bottom.
    pub(super) fn draw(&self, canvas: &mut Canvas<'_>, taken: f32) {
        let margin = canvas.margin();
        let room = Room {
            right: canvas.width() - margin,
            top: margin,
            bottom: canvas.height() - margin.max(taken),
            width: 0.45 * canvas.width(),
        };
        match &self.keys {
            LegendKeys::Scale { range, colors } => self.draw_scale(canvas, &room, *range, colors),
            LegendKeys::Categories(list) => self.draw_categories(canvas, &room, list),
        }
    }

    fn draw_scale(
        &self,
        canvas: &mut Canvas<'_>,
        room: &Room,
        range: [f64; 2],
        colors: &[[f32; 3]],
    ) {
        let em = canvas.em;
        let small = 0.9 * em;
        let height = (0.42 * canvas.height()).min(room.bottom - room.top - 3.2 * em);
        if colors.is_empty() || height < 2.0 * em {
            return;
        }
        let most = (height / (2.6 * em)).clamp(1.0, 20.0) as usize + 1;
        let ticks = ticks(range[0], range[1], most);
        let labels: Vec<Text> =
            ticks.labels.iter().map(|l| Text::new(l, small, room.width)).collect();
        let title = Text::new(&self.title, em, room.width);
        let multiplier = ticks.multiplier.map(|m| Text::new(&m, small, room.width));

        let gap = 0.65 * em;
        let widest = labels.iter().map(|label| label.width).fold(0.0, f32::max);
        let beside = multiplier.as_ref().map_or(0.0, |m| m.width - 0.95 * em).max(widest + gap);
        let left = (room.right - (0.95 * em + beside)).round();
        let above = if multiplier.is_some() { 2.9 * em } else { 1.6 * em };
        let top = ((room.top + room.bottom + above - height) / 2.0).round().max(room.top + above);
        let bar = [left, top, left + (0.95 * em).round(), (top + height).round()];

        // A long title reaches over the bar to the left, so that the bar stays at the rim.
        let title_left = left.min(room.right - title.width);
        canvas.text(&title, [title_left, top - above + CAP_HEIGHT * em], Align::Left);
        if let Some(multiplier) = &multiplier {
            canvas.text(multiplier, [left, top - 0.6 * em], Align::Left);
        }
        let height_of = |value: f64| {
            let share = if range[0] == range[1] { 0.5 } else { share_of(value, range) };
            bar[3] - share * (bar[3] - bar[1])
        };
        let heights: Vec<f32> = ticks.values.iter().map(|value| height_of(*value)).collect();
        draw_bar(canvas, bar, &heights, colors);
        for (y, label) in heights.iter().zip(&labels) {
            let baseline = y + CAP_HEIGHT * small / 2.0;
            canvas.text(label, [bar[2] + gap, baseline], Align::Left);
        }
    }

    fn draw_categories(&self, canvas: &mut Canvas<'_>, room: &Room, list: &[Category]) {
        let em = canvas.em;
        let row = 1.45 * em;
        let heading = if self.title.is_empty() { 0.0 } else { 1.7 * em };
        let rows = ((room.bottom - room.top - heading) / row).clamp(0.0, 100.0) as usize;
        let whole = list.len() <= rows.min(MOST_CATEGORIES);
        // The last row is needed to say how many are missing.
        let shown = if whole { list.len() } else { rows.saturating_sub(1).min(MOST_CATEGORIES) };
        let mut names: Vec<Text> =
            list.iter().take(shown).map(|c| Text::new(&c.name, em, room.width)).collect();
        if !whole && rows > 0 {
            let more = format!("+ {} more", list.len() - shown);
            names.push(Text::new(&more, 0.9 * em, room.width));
        }
        let title = Text::new(&self.title, em, room.width);
        let indent = 1.25 * em;
        let widest = names.iter().map(|name| name.width + indent).fold(title.width, f32::max);
        let left = (room.right - widest).round();
        let height = heading + row * names.len() as f32;
        let top = (room.top + room.bottom - height).max(2.0 * room.top) / 2.0;

        canvas.text(&title, [left, top + CAP_HEIGHT * em], Align::Left);
        for (i, name) in names.iter().enumerate() {
            let middle = top + heading + row * (i as f32 + 0.5);
            canvas.text(name, [left + indent, middle + CAP_HEIGHT * em / 2.0], Align::Left);
            if let Some(category) = list.get(i).filter(|_| i < shown) {
                draw_swatch(canvas, [left + 0.45 * em, middle], category.color);
            }
        }
    }
}

/// Where `value` lies between the ends of `range`, 0 … 1; by halves, which cannot overflow.
fn share_of(value: f64, [from, to]: [f64; 2]) -> f32 {
    ((value / 2.0 - from / 2.0) / (to / 2.0 - from / 2.0)).clamp(0.0, 1.0) as f32
}

/// The colours from the bottom to the top, in a thin frame with ticks at the given `heights`.
fn draw_bar(canvas: &mut Canvas<'_>, bar: Bounds, heights: &[f32], colors: &[[f32; 3]]) {
    let [left, top, right, bottom] = bar;
    let stroke = canvas.stroke();
    let tick_end = right + stroke + 0.3 * canvas.em;
    let frame = [left - stroke, top - stroke, right + stroke, bottom + stroke];
    let mut shape = canvas.shape([frame[0], frame[1], tick_end, frame[3]]);
    shape.rectangle(frame);
    for y in heights {
        // On whole pixels, or it would be twice as wide and half as dark.
        let y = (y - stroke / 2.0).round();
        shape.rectangle([right, y, tick_end, y + stroke]);
    }
    canvas.halo_of(&shape);
    canvas.fill(&shape, canvas.ink, 1.0);
    let mut shape = canvas.shape(bar);
    shape.rectangle(bar);
    canvas.fill_rows(&shape, |row| {
        color_at((bottom - row as f32 - 0.5) / (bottom - top).max(1.0), colors)
    });
}

/// The colour at `share` of the way through evenly spaced colours.
fn color_at(share: f32, colors: &[[f32; 3]]) -> [f32; 3] {
    let last = colors.len().saturating_sub(1);
    let position = share.clamp(0.0, 1.0) * last as f32;
    let below = (position as usize).min(last);
    let t = position - below as f32;
    let at = |i: usize| colors.get(i.min(last)).copied().unwrap_or_default();
    let (from, to) = (at(below), at(below + 1));
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * t)
}

/// A disc, as particles are, with a thin rim that keeps pale colours from vanishing.
fn draw_swatch(canvas: &mut Canvas<'_>, center: [f32; 2], color: [f32; 3]) {
    let radius = 0.42 * canvas.em;
    let [x, y] = center;
    let bounds = [x - radius, y - radius, x + radius, y + radius];
    let mut disc = canvas.shape(bounds);
    disc.disc(center, radius);
    canvas.halo_of(&disc);
    canvas.fill(&disc, canvas.ink, 1.0);
    let mut inner = canvas.shape(bounds);
    inner.disc(center, radius - canvas.stroke());
    canvas.fill(&inner, color, 1.0);
}
