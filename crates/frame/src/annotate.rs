//! What is drawn over the picture: legend, scale bar, caption, axes and lines.
//!
//! Everything arrives as pixels, labels and colours; whoever holds the camera has projected it. Sizes
//! follow from the picture's height alone, so that a small preview and a large print look alike.

mod axes;
mod canvas;
mod coverage;
mod legend;
mod lines;
mod scale_bar;
mod text;

pub use axes::Axes;
pub use canvas::Ink;
pub use legend::{Category, Legend, LegendKeys};
pub use lines::{Line, LineEnd, Lines};
pub use scale_bar::ScaleBar;

use crate::Frame;
use canvas::{Align, Canvas};

/// All that is drawn over a picture. The default is nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Annotations {
    /// Colour of text and strokes.
    pub ink: Ink,
    /// Lines in space, such as the edges of the simulation box.
    pub lines: Option<Lines>,
    /// What the colours mean; at the right.
    pub legend: Option<Legend>,
    /// How long a length is; at the bottom left.
    pub scale_bar: Option<ScaleBar>,
    /// Text at the top left, such as the time; line feeds begin new lines.
    pub caption: Option<String>,
    /// Where the axes point; in a bottom corner.
    pub axes: Option<Axes>,
    /// How many times the picture will be enlarged: its text then has the size it would have without. 0 and 1: not.
    pub enlarged: f32,
}

/// Text is no smaller than so many pixels, as far as the picture has room.
const LEAST_TEXT: f32 = 12.5;

/// The left or the right of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// The left.
    Left,
    /// The right.
    #[default]
    Right,
}

impl Annotations {
    /// Draws all of it over the frame's colours; the other layers stay as they are.
    ///
    /// It belongs after tone and background: what it touches is clipped to what a screen can show.
    pub fn draw(&self, frame: &mut Frame) {
        if frame.color().is_empty() {
            return;
        }
        let mut canvas = Canvas::new(frame, self.ink, LEAST_TEXT / self.enlarged.max(1.0));
        if let Some(lines) = &self.lines {
            lines.draw(&mut canvas);
        }
        let corner = self.axes.as_ref().map(|axes| (axes.side, axes.draw(&mut canvas)));
        let taken = |side| corner.filter(|(at, _)| *at == side).map_or(0.0, |(_, size)| size);
        if let Some(bar) = &self.scale_bar {
            bar.draw(&mut canvas, taken(Side::Left));
        }
        if let Some(legend) = &self.legend {
            legend.draw(&mut canvas, taken(Side::Right));
        }
        if let Some(caption) = &self.caption {
            draw_caption(&mut canvas, caption);
        }
    }
}

fn draw_caption(canvas: &mut Canvas<'_>, caption: &str) {
    let (em, margin) = (canvas.em, canvas.margin());
    let width = canvas.width() - 2.0 * margin;
    let first = margin + text::CAP_HEIGHT * em;
    let fitting = ((canvas.height() - first) / (1.4 * em)).max(0.0) as usize + 1;
    for (i, line) in caption.lines().take(fitting).enumerate() {
        let baseline = first + 1.4 * em * i as f32;
        canvas.text(&text::Text::new(line, em, width), [margin, baseline], Align::Left);
    }
}
