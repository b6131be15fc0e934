//! What is simulated: tanks, liquid in them, things in its way, and jets.
//!
//! All lengths are rounded to whole spacings of the particles, so that a block fills its tank from wall
//! to wall; the topmost layer holds what is left of the number asked for.

use crate::walls::Solid;

/// A parameter of a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in `sim:NAME?name=value`.
    pub name: &'static str,
    /// What it is if nothing is said.
    pub default: f64,
    /// Unit and meaning.
    pub meaning: &'static str,
}

/// A scenario that can be asked for.
#[derive(Clone, Copy, Debug)]
pub struct Scenario {
    /// Its name in `sim:NAME`.
    pub name: &'static str,
    /// One line about it.
    pub meaning: &'static str,
    /// What can be said about it.
    pub parameters: &'static [Parameter],
    make: fn(&Values<'_>) -> Setup,
}

/// The start of a simulation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Setup {
    /// Distance of particles at rest, metres; twice their radius.
    pub spacing: f32,
    /// The tank: least and greatest corner, metres. No particle leaves it.
    pub tank: [[f32; 3]; 2],
    /// What is solid.
    pub solids: Vec<Solid>,
    /// Where particles are, metres.
    pub positions: Vec<[f32; 3]>,
    /// How fast they are, metres per second.
    pub velocities: Vec<[f32; 3]>,
    /// Where more particles come from.
    pub jets: Vec<Jet>,
    /// The most particles there will be.
    pub most: usize,
    /// How deep the liquid can fall, metres: what the greatest speed is expected from.
    pub fall: f32,
}

/// A round nozzle that liquid comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Jet {
    /// Places of a layer of particles, metres.
    pub layer: Vec<[f32; 3]>,
    /// Metres per second.
    pub velocity: [f32; 3],
}

const PARTICLES: Parameter =
    Parameter { name: "particles", default: 27_000.0, meaning: "how many particles" };
const WIDTH: Parameter =
    Parameter { name: "width", default: 1.0, meaning: "width of the tank along y, m" };
const TANK_LENGTH: Parameter =
    Parameter { name: "tank_length", default: 3.0, meaning: "length of the tank along x, m" };
const TANK_HEIGHT: Parameter =
    Parameter { name: "tank_height", default: 2.0, meaning: "height of the tank, m" };

/// All scenarios.
pub const SCENARIOS: &[Scenario] = &[
    Scenario {
        name: "dam-break",
        meaning: "a column of liquid at one end of a tank collapses",
        parameters: &[
            PARTICLES,
            Parameter { name: "length", default: 1.0, meaning: "length of the column, m" },
            WIDTH,
            Parameter { name: "height", default: 1.0, meaning: "height of the column, m" },
            TANK_LENGTH,
            TANK_HEIGHT,
            Parameter { name: "ball", default: 0.0, meaning: "radius of a ball in the way, m" },
        ],
        make: dam_break,
    },
    Scenario {
        name: "double-dam-break",
        meaning: "two columns at opposite ends of a tank collapse and meet",
        parameters: &[
            PARTICLES,
            Parameter { name: "length", default: 0.75, meaning: "length of each column, m" },
            WIDTH,
            Parameter { name: "height", default: 1.0, meaning: "height of the columns, m" },
            TANK_LENGTH,
            TANK_HEIGHT,
        ],
        make: double_dam_break,
    },
    Scenario {
        name: "drop",
        meaning: "a ball of liquid falls into a pool",
        parameters: &[
            PARTICLES,
            Parameter { name: "radius", default: 0.25, meaning: "radius of the drop, m" },
            Parameter { name: "height", default: 1.0, meaning: "height of its centre, m" },
            Parameter { name: "depth", default: 0.3, meaning: "depth of the pool, m" },
            Parameter { name: "speed", default: 0.0, meaning: "speed downwards, m/s" },
            Parameter { name: "width", default: 1.2, meaning: "width of the tank, m" },
            TANK_HEIGHT,
        ],
        make: drop,
    },
    Scenario {
        name: "column",
        meaning: "liquid at rest fills a tank from wall to wall",
        parameters: &[
            PARTICLES,
            Parameter { name: "width", default: 0.5, meaning: "width of the tank, m" },
            Parameter { name: "height", default: 1.0, meaning: "height of the liquid, m" },
        ],
        make: column,
    },
    Scenario {
        name: "fountain",
        meaning: "jets rise from nozzles and fall into a basin",
        parameters: &[
            PARTICLES,
            Parameter { name: "jets", default: 4.0, meaning: "how many nozzles" },
            Parameter { name: "speed", default: 4.0, meaning: "speed of the jets, m/s" },
            Parameter { name: "angle", default: 75.0, meaning: "of the jets over the floor, °" },
            Parameter { name: "radius", default: 0.06, meaning: "radius of a nozzle, m" },
            Parameter { name: "width", default: 2.0, meaning: "width of the basin, m" },
            Parameter { name: "depth", default: 0.1, meaning: "of the basin in the end, m" },
        ],
        make: fountain,
    },
];

/// The values of a scenario's parameters.
struct Values<'a> {
    scenario: &'a Scenario,
    values: Vec<f64>,
}

impl Values<'_> {
    fn get(&self, name: &str) -> f64 {
        let at = self.scenario.parameters.iter().position(|p| p.name == name);
        at.map_or(0.0, |at| self.values[at])
    }

    fn particles(&self) -> usize {
        self.get("particles") as usize
    }
}

impl Scenario {
    /// The scenario called `name`.
    ///
    /// # Errors
    /// There is none: which there are, in words.
    pub fn named(name: &str) -> Result<&'static Self, String> {
        let names: Vec<_> = SCENARIOS.iter().map(|s| s.name).collect();
        SCENARIOS
            .iter()
            .find(|s| s.name == name)
            .ok_or_else(|| format!("there is no scenario '{name}'; there are {}", names.join(", ")))
    }

    /// Its start, with these parameters (names and values) and else its defaults.
    ///
    /// # Errors
    /// An unknown parameter, or a value that makes no sense, in words.
    pub fn setup(&self, parameters: &[(&str, &str)]) -> Result<Setup, String> {
        let mut values: Vec<f64> = self.parameters.iter().map(|p| p.default).collect();
        for (name, text) in parameters {
            let Some(at) = self.parameters.iter().position(|p| p.name == *name) else {
                let names: Vec<_> = self.parameters.iter().map(|p| p.name).collect();
                let names = names.join(", ");
                return Err(format!("{} has no parameter '{name}'; it has {names}", self.name));
            };
            let number: f64 = text.trim().parse().unwrap_or(f64::NAN);
            if !(number >= 0.0 && number.is_finite()) {
                return Err(format!("{name}: expected a number, 0 or more, found '{text}'"));
            }
            let whole = *name == "particles" || *name == "jets";
            if whole && (number.fract() != 0.0 || !(1.0..=MOST).contains(&number)) {
                let most = MOST;
                return Err(format!(
                    "{name}: expected a whole number, 1 to {most:e}, found '{text}'"
                ));
            }
            values[at] = number;
        }
        let values = Values { scenario: self, values };
        let sizes = ["length", "width", "height", "tank_length", "tank_height"];
        for name in sizes.iter().filter(|name| self.parameters.iter().any(|p| p.name == **name)) {
            let size = values.get(name);
            if !(1e-4..=1e4).contains(&size) {
                return Err(format!("{name}: expected 1e-4 to 1e4 m, found {size}"));
            }
        }
        let setup = (self.make)(&values);
        let [low, high] = setup.tank;
        let [x, y, z] = [0, 1, 2].map(|a| f64::from((high[a] - low[a]) / setup.spacing) + 6.0);
        let most = MOST_CELLS + MOST_CELLS_EACH * values.particles() as f64;
        // Cells of two spacings, and samples of the walls.
        let fits = x * y * z / 8.0 < most && 2.0 * (x * y + y * z + z * x) < most;
        if !fits || setup.spacing <= 0.0 {
            return Err("the tank is too large for so little liquid".into());
        }
        Ok(setup)
    }
}

/// The most particles.
const MOST: f64 = 2e8;
/// The most cells of a tank, and samples of its walls: their memory is to stay near the particles'.
const MOST_CELLS: f64 = 1e6;
/// And this many more for each particle.
const MOST_CELLS_EACH: f64 = 20.0;

/// The spacing at which `particles` fill `volume`, in single precision from here on.
fn spacing(volume: f64, particles: usize) -> f32 {
    (volume / particles as f64).cbrt() as f32
}

/// How many spacings a length has, one at the least.
fn whole(length: f64, spacing: f32) -> usize {
    ((length / f64::from(spacing)).round() as usize).max(1)
}

/// `count` places of a block that is `nx` by `ny` wide, upwards from the corner `low`.
fn block(low: [f32; 3], (nx, ny): (usize, usize), count: usize, spacing: f32) -> Vec<[f32; 3]> {
    let along = |a: usize, i: usize| low[a] + (i as f32 + 0.5) * spacing;
    let place = |i: usize| [along(0, i % nx), along(1, i / nx % ny), along(2, i / (nx * ny))];
    (0..count).map(place).collect()
}

/// A tank from the origin with liquid at rest in it.
fn tank(spacing: f32, sizes: [f64; 3], positions: Vec<[f32; 3]>) -> Setup {
    let top = positions.iter().map(|p| p[2]).fold(0.0, f32::max) + 0.5 * spacing;
    let mut high = sizes.map(|size| whole(size, spacing) as f32 * spacing);
    high[2] = high[2].max(top + 2.0 * spacing);
    Setup {
        spacing,
        tank: [[0.0; 3], high],
        solids: vec![Solid::Box([0.0; 3], high)],
        velocities: vec![[0.0; 3]; positions.len()],
        most: positions.len(),
        positions,
        jets: vec![],
        fall: top,
    }
}

fn dam_break(values: &Values<'_>) -> Setup {
    let [length, width, height] = ["length", "width", "height"].map(|name| values.get(name));
    let count = values.particles();
    let spacing = spacing(length * width * height, count);
    let across = (whole(length, spacing), whole(width, spacing));
    let positions = block([0.0; 3], across, count, spacing);
    let long = values.get("tank_length").max(length);
    let mut setup = tank(spacing, [long, width, values.get("tank_height")], positions);
    let ball = values.get("ball") as f32;
    if ball > 0.0 {
        let [_, high] = setup.tank;
        let center = [0.5 * (high[0] + across.0 as f32 * spacing), 0.5 * high[1], ball];
        setup.solids.push(Solid::Ball(center, ball));
    }
    setup
}

fn double_dam_break(values: &Values<'_>) -> Setup {
    let [length, width, height] = ["length", "width", "height"].map(|name| values.get(name));
    let count = values.particles();
    let spacing = spacing(2.0 * length * width * height, count);
    let across = (whole(length, spacing), whole(width, spacing));
    let long = whole(values.get("tank_length").max(2.0 * length), spacing).max(2 * across.0);
    let mut positions = block([0.0; 3], across, count.div_ceil(2), spacing);
    let second = [(long - across.0) as f32 * spacing, 0.0, 0.0];
    positions.extend(block(second, across, count / 2, spacing));
    let long = long as f64 * f64::from(spacing);
    tank(spacing, [long, width, values.get("tank_height")], positions)
}

fn drop(values: &Values<'_>) -> Setup {
    let [radius, height, depth, width] =
        ["radius", "height", "depth", "width"].map(|name| values.get(name));
    let radius = radius.min(0.5 * width);
    let ball = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let count = values.particles();
    let spacing = spacing((ball + width * width * depth).max(1e-12), count);
    let across = whole(width, spacing);
    let middle = 0.5 * across as f32 * spacing;
    let height = height.max(depth + radius + 2.0 * f64::from(spacing)) as f32;
    let mut positions = round([middle, middle, height], radius as f32, spacing);
    positions.truncate(count);
    let drop = positions.len();
    positions.extend(block([0.0; 3], (across, across), count - drop, spacing));
    let mut setup = tank(spacing, [width, width, values.get("tank_height")], positions);
    let speed = -(values.get("speed") as f32);
    setup.velocities[..drop].fill([0.0, 0.0, speed]);
    setup.fall += speed * speed / 20.0;
    setup
}

/// Places of a lattice within a ball.
fn round(center: [f32; 3], radius: f32, spacing: f32) -> Vec<[f32; 3]> {
    let half = (radius / spacing).ceil() as i32;
    let mut places = Vec::new();
    for z in -half..half {
        for y in -half..half {
            for x in -half..half {
                let way = [x, y, z].map(|i| (i as f32 + 0.5) * spacing);
                if way.iter().map(|v| v * v).sum::<f32>() <= radius * radius {
                    places.push(std::array::from_fn(|a| center[a] + way[a]));
                }
            }
        }
    }
    places
}

fn column(values: &Values<'_>) -> Setup {
    let (width, height) = (values.get("width"), values.get("height"));
    let count = values.particles();
    let spacing = spacing(width * width * height, count);
    let across = whole(width, spacing);
    let positions = block([0.0; 3], (across, across), count, spacing);
    tank(spacing, [width, width, 1.2 * height], positions)
}

fn fountain(values: &Values<'_>) -> Setup {
    let (width, depth) = (values.get("width"), values.get("depth").max(1e-3));
    let (speed, angle) = (values.get("speed") as f32, values.get("angle").to_radians());
    let most = values.particles();
    let spacing = spacing(width * width * depth, most);
    let rise = speed * speed / 19.62 + 4.0 * spacing;
    let mut setup = tank(spacing, [width, width, depth + f64::from(rise) * 1.3], vec![]);
    let jets = values.get("jets") as u32;
    let middle = 0.5 * setup.tank[1][0];
    // Nozzles end above what the basin holds in the end.
    let height = 1.5 * depth as f32 + 2.0 * spacing;
    setup.jets = (0..jets)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(jets)).sin_cos();
            let (up, out) = (angle.sin(), if jets > 1 { angle.cos() } else { 0.0 });
            let way = [out * cos, out * sin, up].map(|v| v as f32);
            let apart = if jets > 1 { 0.1 * values.get("width") } else { 0.0 };
            let foot = [middle + (apart * cos) as f32, middle + (apart * sin) as f32, height];
            Jet {
                layer: disc(foot, way, values.get("radius") as f32, spacing),
                velocity: way.map(|v| v * speed),
            }
        })
        .collect();
    setup.most = most;
    setup.fall = rise + height;
    setup
}

/// Places of a square lattice within a disc across `way`.
fn disc(center: [f32; 3], way: [f32; 3], radius: f32, spacing: f32) -> Vec<[f32; 3]> {
    // Two directions across: the first level.
    let level = (way[0] * way[0] + way[1] * way[1]).sqrt();
    let u = if level > 1e-6 { [-way[1] / level, way[0] / level, 0.0] } else { [1.0, 0.0, 0.0] };
    let v = [
        way[1] * u[2] - way[2] * u[1],
        way[2] * u[0] - way[0] * u[2],
        way[0] * u[1] - way[1] * u[0],
    ];
    let half = (radius / spacing).floor() as i32;
    let mut places = Vec::new();
    for i in -half..=half {
        for k in -half..=half {
            let (p, q) = (i as f32 * spacing, k as f32 * spacing);
            if p * p + q * q <= radius * radius {
                places.push(std::array::from_fn(|a| center[a] + p * u[a] + q * v[a]));
            }
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scenario_has_as_many_particles_as_asked_for_inside_its_tank() {
        for scenario in SCENARIOS {
            for count in ["1", "1000", "27000"] {
                let setup = scenario.setup(&[("particles", count)]).unwrap();
                let jets = if setup.jets.is_empty() { 0 } else { setup.most };
                assert_eq!(
                    setup.positions.len() + jets,
                    count.parse().unwrap(),
                    "{}",
                    scenario.name
                );
                assert_eq!(setup.velocities.len(), setup.positions.len());
                let [low, high] = setup.tank;
                let places = setup.positions.iter().chain(setup.jets.iter().flat_map(|j| &j.layer));
                for p in places.filter(|_| count != "1") {
                    assert!((0..3).all(|a| p[a] > low[a] && p[a] < high[a]), "{}", scenario.name);
                }
            }
        }
    }

    #[test]
    fn particles_begin_a_spacing_apart() {
        for scenario in SCENARIOS {
            let setup = scenario.setup(&[("particles", "500")]).unwrap();
            for (i, p) in setup.positions.iter().enumerate() {
                for q in &setup.positions[..i] {
                    let square: f32 = (0..3).map(|a| (p[a] - q[a]).powi(2)).sum();
                    let name = scenario.name;
                    assert!(square.sqrt() > 0.999 * setup.spacing, "{name}: {p:?} {q:?}");
                }
            }
        }
    }

    #[test]
    fn nonsense_is_refused() {
        let message = |name: &str, parameters: &[(&str, &str)]| {
            let setup = Scenario::named(name).and_then(|s| s.setup(parameters));
            setup.map(|_| ()).unwrap_err()
        };
        assert!(message("dam-brake", &[]).contains("dam-break, double-dam-break"));
        assert!(message("drop", &[("radios", "1")]).contains("radius"));
        for bad in ["0", "1.5", "-3", "nan", "many", "1e12"] {
            assert!(message("drop", &[("particles", bad)]).contains(bad));
        }
        assert!(message("column", &[("width", "0")]).contains("width"));
        assert!(message("dam-break", &[("tank_length", "9999")]).contains("too large"));
    }
}
