//! The parameters of cues, what is drawn over a picture to tell depth and structure, under `cue.`
//! (Chaudhari, *Real-Time Cross-Sectioning of Dynamic Particle Systems*, §4).

use crate::color::Color;
use crate::error::{Result, SceneError, hint};
use crate::resolve::{need, not_negative, positive};
use crate::settings::settings;

settings! {
    /// Cues of depth and structure, for every renderer.
    pub struct Cue {
        /// Which of edges, depth, halo, rim, seam and sprite (no light, but rims) there are, parted by commas; empty: none.
        on: String = String::new() => "\"edges, depth\"",
        /// What is farther behind something is another structure, in world units; none: 4 radii of a typical particle.
        structure: Option<f64> = None => "7.0",
        /// Strength of edges, lines where structures end: 0 (unseen) to 1.
        edges: f64 = 0.9,
        /// Width of edges, as a part of the picture's height.
        edges_width: f64 = 0.002,
        /// Colour of edges.
        edges_color: Color = Color::hex(0x101418),
        /// Strength of depth: how much of the colour is gone at the far end, 0 to 1.
        depth: f64 = 0.8,
        /// Distances from the camera between which depth fades, in world units; none: those of what is framed.
        depth_range: Option<[f64; 2]> = None => "[10.0, 30.0]",
        /// Colour that depth fades to; none: the background.
        depth_color: Option<Color> = None => "\"black\"",
        /// Strength of halos, shade on what lies behind something: 0 to 1.
        halo: f64 = 0.7,
        /// How far halos reach, as a part of the picture's height.
        halo_width: f64 = 0.02,
        /// Colour of halos.
        halo_color: Color = Color::hex(0x000000),
        /// Strength of rims, which darken each sphere towards its end: 0 to 1.
        rim: f64 = 0.8,
        /// Width of rims, as a part of the sphere's radius.
        rim_width: f64 = 0.4,
        /// Colour of rims.
        rim_color: Color = Color::hex(0x000000),
        /// Strength of seams, lines where surfaces intersect: 0 to 1.
        seam: f64 = 0.7,
        /// Width of seams, as a part of the picture's height.
        seam_width: f64 = 0.001,
        /// Colour of seams.
        seam_color: Color = Color::hex(0x101418),
    }
}

/// The words of `cue.on`.
const WORDS: [&str; 6] = ["edges", "depth", "halo", "rim", "seam", "sprite"];

impl Cue {
    /// Whether the cue called `word` is on; sprites have rims.
    pub fn has(&self, word: &str) -> bool {
        self.words().any(|on| on == word || (on == "sprite" && word == "rim"))
    }

    /// Whether any is on.
    pub fn any(&self) -> bool {
        self.words().next().is_some()
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        self.on.split(',').map(str::trim).filter(|word| !word.is_empty())
    }
}

pub(crate) fn check(cue: &Cue) -> Result<()> {
    if let Some(word) = cue.words().find(|word| !WORDS.contains(word)) {
        return Err(SceneError::UnknownName {
            kind: "cue",
            name: word.to_owned(),
            hint: hint(word, WORDS),
        });
    }
    let strengths = [
        ("cue.edges", cue.edges),
        ("cue.depth", cue.depth),
        ("cue.halo", cue.halo),
        ("cue.rim", cue.rim),
        ("cue.seam", cue.seam),
    ];
    for (path, v) in strengths {
        need(path, v, (0.0..=1.0).contains(&v), "a number in 0 to 1")?;
    }
    // Lines as wide as this cover a picture; what is wider only takes time.
    let widths = [
        ("cue.edges_width", cue.edges_width, 0.02),
        ("cue.seam_width", cue.seam_width, 0.02),
        ("cue.halo_width", cue.halo_width, 1.0),
    ];
    for (path, v, most) in widths {
        let expected = format!("a number in 0 to {most}");
        need(path, v, (0.0..=most).contains(&v), &expected)?;
    }
    let rim = cue.rim_width;
    need("cue.rim_width", rim, rim > 0.0 && rim <= 1.0, "a number above 0, at most 1")?;
    let structure = cue.structure;
    need("cue.structure", structure, structure.is_none_or(positive), "a number above 0")?;
    let fits = cue.depth_range.is_none_or(|[a, b]| not_negative(a) && b.is_finite() && a < b);
    need("cue.depth_range", cue.depth_range, fits, "two distances, the first one less")
}

#[cfg(test)]
mod tests {
    use crate::Scene;

    #[test]
    fn cues_are_named_and_a_typo_names_the_nearest() {
        let mut scene = Scene::default();
        assert!(!scene.cue.any());
        scene.set("cue.on", "edges, depth,halo").unwrap();
        assert!(["edges", "depth", "halo"].iter().all(|word| scene.cue.has(word)));
        assert!(!scene.cue.has("rim") && !scene.cue.has("seam"));
        scene.check().unwrap();
        scene.set("cue.on", "sprite").unwrap();
        assert!(scene.cue.has("rim") && !scene.cue.has("edges"));
        scene.set("cue.on", "depth,egdes").unwrap();
        let error = scene.check().unwrap_err().to_string();
        assert_eq!(error, "no cue `egdes`; did you mean `edges`?");
    }

    #[test]
    fn sprites_are_not_lit() {
        let mut scene = Scene::default();
        scene.set("cue.on", "sprite").unwrap();
        let lights = scene.resolve(None).unwrap().lights;
        scene.set("cue.on", "rim").unwrap();
        assert_ne!(scene.resolve(None).unwrap().lights, lights);
        scene.set("light.preset", "flat").unwrap();
        assert_eq!(scene.resolve(None).unwrap().lights, lights);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for (path, value) in [
            ("cue.edges", "1.5"),
            ("cue.edges_width", "0.5"),
            ("cue.rim_width", "0"),
            ("cue.structure", "0"),
            ("cue.depth_range", "3,2"),
        ] {
            let mut scene = Scene::default();
            scene.set(path, value).unwrap();
            let error = scene.check().unwrap_err().to_string();
            assert!(error.starts_with(path), "{error}");
        }
    }
}
