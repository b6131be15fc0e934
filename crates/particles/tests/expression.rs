//! Random expressions against their evaluation row by row, and any bytes at all against panics.

use motes_particles::{Column, Particles, Radius, Values, properties, select};

/// SplitMix64: the same expressions every time.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// A small multiple of ¼, which f32 holds exactly and which often equals another.
    fn quarter(&mut self) -> f64 {
        self.below(41) as f64 / 4.0 - 5.0
    }
}

fn particles(count: usize, random: &mut Random) -> Particles {
    let mut quarters = |n: usize| (0..n).map(|_| random.quarter()).collect::<Vec<f64>>();
    let single = |v: Vec<f64>| v.into_iter().map(|v| v as f32).collect::<Vec<f32>>();
    let mut mass = single(quarters(count));
    mass.iter_mut().step_by(7).for_each(|m| *m = f32::NAN);
    let names = vec!["O".to_owned(), "H".to_owned(), "C".to_owned()];
    let codes = quarters(count).into_iter().map(|v| v.abs() as u32 % 3).collect();
    let positions = (0..count).map(|_| single(quarters(3))).map(|v| [v[0], v[1], v[2]]).collect();
    Particles {
        origin: [1000.0, 0.0, -3.0],
        positions,
        radius: Radius::Each(single(quarters(count))),
        columns: vec![
            Column::new("Mass", 1, Values::F32(mass)),
            Column::new("Velocity", 3, Values::F64(quarters(3 * count))),
            Column::new("Particle Type", 1, Values::Names { codes, names }),
            Column::new(
                "Charge",
                1,
                Values::I32(quarters(count).iter().map(|v| *v as i32).collect()),
            ),
            Column::new("id", 1, Values::I64(quarters(count).iter().map(|v| *v as i64).collect())),
            Column::new(
                "flags",
                2,
                Values::U8(quarters(2 * count).iter().map(|v| *v as u8).collect()),
            ),
        ],
        ..Particles::default()
    }
}

/// The value of a property for a row.
type Value = Box<dyn Fn(&Particles, usize) -> f64>;

/// An expression as text, tightness of its outermost operator, and its meaning for one row.
struct Expression {
    text: String,
    tightness: u8,
    value: Value,
    kind: Kind,
}

/// What decides whether a number is rounded for a comparison.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// The same for all rows.
    Constant,
    /// A property in single precision about this origin.
    Single(f64),
    Other,
}

impl Expression {
    fn kind(self, kind: Kind) -> Self {
        Self { kind, ..self }
    }
}

/// `value`, rounded if it is a constant compared with `other` in single precision.
fn rounded(value: f64, kind: Kind, other: Kind) -> f64 {
    let (Kind::Constant, Kind::Single(origin)) = (kind, other) else { return value };
    let single = (value - origin) as f32;
    if single.is_normal() { origin + f64::from(single) } else { value }
}

const ATOM: u8 = 9;

fn of(
    text: String,
    tightness: u8,
    value: impl Fn(&Particles, usize) -> f64 + 'static,
) -> Expression {
    Expression { text, tightness, value: Box::new(value), kind: Kind::Other }
}

fn flag(condition: bool) -> f64 {
    if condition { 1.0 } else { 0.0 }
}

fn truth(value: f64) -> bool {
    value.abs() > 0.0
}

fn property(random: &mut Random) -> Expression {
    let column = |text: &str, index: usize, component: usize| {
        of(text.into(), ATOM, move |p: &Particles, row| p.columns[index].number(row, component))
    };
    match random.below(12) {
        0 => column("Mass", 0, 0).kind(Kind::Single(0.0)),
        1 => column("`Velocity`.Y", 1, 1),
        2 => column("velocity[2]", 1, 2),
        // A name is its code only beside a number, and two properties may meet here.
        3 => of("Particle Type * 1".into(), 6, |p, row| p.columns[2].number(row, 0)),
        4 => column("charge", 3, 0),
        5 => column("id", 4, 0),
        6 => column("flags[1]", 5, 1),
        7 => of("Velocity".into(), ATOM, |p, row| p.columns[1].magnitude(row)),
        8 => of("Index".into(), ATOM, |_, row| row as f64),
        9 => of("Radius".into(), ATOM, |p, row| match &p.radius {
            Radius::Each(radii) => f64::from(radii[row]),
            _ => f64::NAN,
        })
        .kind(Kind::Single(0.0)),
        10 => of("Position.Z".into(), ATOM, |p, row| p.origin[2] + f64::from(p.positions[row][2]))
            .kind(Kind::Single(-3.0)),
        _ => {
            let name = ["O", "H", "C", "Xe"][random.below(4)];
            let equal = random.below(2) == 0;
            let sign = if equal { "==" } else { "!=" };
            of(format!("ParticleType {sign} \"{name}\""), 4, move |p, row| {
                let Values::Names { codes, names } = &p.columns[2].values else { return f64::NAN };
                flag((names[codes[row] as usize] == name) == equal)
            })
        }
    }
}

/// The text, in parentheses where it binds less tightly than its place asks, or by whim.
fn within(e: &Expression, tightness: u8, random: &mut Random) -> String {
    let text = &e.text;
    if e.tightness < tightness || random.below(8) == 0 { format!("({text})") } else { text.clone() }
}

type Operation = (&'static [&'static str], u8, fn(f64, f64) -> f64);

#[rustfmt::skip] // one a line
const OPERATIONS: [Operation; 14] = [
    (&["||", "or"], 1, |a, b| flag(truth(a) || truth(b))),
    (&["&&", "and"], 2, |a, b| flag(truth(a) && truth(b))),
    (&["=="], 4, |a, b| flag(a == b)),
    (&["!="], 4, |a, b| flag(a != b)),
    (&["<"], 4, |a, b| flag(a < b)),
    (&["<="], 4, |a, b| flag(a <= b)),
    (&[">"], 4, |a, b| flag(a > b)),
    (&[">="], 4, |a, b| flag(a >= b)),
    (&["+"], 5, |a, b| a + b),
    (&["-"], 5, |a, b| a - b),
    (&["*"], 6, |a, b| a * b),
    (&["/"], 6, |a, b| a / b),
    (&["%"], 6, |a, b| a % b),
    (&["^", "**"], 8, |a, b| if b == 2.0 { a * a } else { a.powf(b) }),
];

type Function = (&'static str, fn(f64) -> f64);

const FUNCTIONS: [Function; 8] = [
    ("abs", f64::abs),
    ("sqrt", f64::sqrt),
    ("exp", f64::exp),
    ("log", f64::ln),
    ("log10", f64::log10),
    ("sin", f64::sin),
    ("floor", f64::floor),
    ("round", f64::round),
];

fn expression(random: &mut Random, depth: usize) -> Expression {
    if depth == 0 {
        if random.below(3) > 0 {
            return property(random);
        }
        let number = random.quarter().abs();
        return of(format!("{number}"), ATOM, move |_, _| number).kind(Kind::Constant);
    }
    let depth = depth - 1 - random.below(depth);
    let left = expression(random, depth);
    let constant = if left.kind == Kind::Constant { Kind::Constant } else { Kind::Other };
    match random.below(10) {
        0 => {
            let (name, function) = FUNCTIONS[random.below(FUNCTIONS.len())];
            of(format!("{name}({})", left.text), ATOM, move |p, row| function((left.value)(p, row)))
                .kind(constant)
        }
        1 => {
            let word = ["!", "not "][random.below(2)];
            let text = format!("{word}{}", within(&left, 3, random));
            of(text, 3, move |p, row| flag(!truth((left.value)(p, row)))).kind(constant)
        }
        2 => {
            let text = format!("-{}", within(&left, 7, random));
            of(text, 7, move |p, row| -(left.value)(p, row)).kind(constant)
        }
        _ => {
            let right = expression(random, depth);
            let kind = if right.kind == Kind::Constant { constant } else { Kind::Other };
            pair(left, right, random).kind(kind)
        }
    }
}

/// Two expressions under an operator or a function.
fn pair(left: Expression, right: Expression, random: &mut Random) -> Expression {
    if random.below(8) == 0 {
        let text = format!("min({}, {})", left.text, right.text);
        return of(text, ATOM, move |p, row| (left.value)(p, row).min((right.value)(p, row)));
    }
    let (signs, level, operation) = OPERATIONS[random.below(OPERATIONS.len())];
    // Comparisons do not chain, powers go from the right, all others from the left.
    let (on_left, on_right) = match level {
        4 => (5, 5),
        8 => (9, 7),
        level => (level, level + 1),
    };
    let sign = signs[random.below(signs.len())];
    let left_text = within(&left, on_left, random);
    let text = format!("{left_text} {sign} {}", within(&right, on_right, random));
    of(text, level, move |p, row| {
        let (a, b) = ((left.value)(p, row), (right.value)(p, row));
        match level {
            4 => operation(rounded(a, left.kind, right.kind), rounded(b, right.kind, left.kind)),
            _ => operation(a, b),
        }
    })
}

#[test]
fn random_expressions_agree_with_each_row() {
    let mut random = Random(1);
    // More than two blocks, and a last word that is not full.
    let particles = particles(5000, &mut random);
    let (mut some, mut rows) = (0, 0);
    for _ in 0..1500 {
        let e = expression(&mut random, 5);
        let selection = select(&e.text, &particles).unwrap_or_else(|error| panic!("{error}"));
        let expected: Vec<bool> =
            (0..particles.len()).map(|row| truth((e.value)(&particles, row))).collect();
        for (row, expected) in expected.iter().enumerate() {
            assert_eq!(selection.contains(row as u32), *expected, "row {row} of {}", e.text);
        }
        let count = expected.iter().filter(|e| **e).count();
        assert_eq!(selection.count(), count, "{}", e.text);
        some += usize::from(count > 0 && count < particles.len());
        rows += count;
    }
    // The expressions are no trivial ones.
    assert!(some > 500, "{some} of 1500 expressions select some but not all, {rows} rows");
}

#[test]
fn any_number_of_threads_selects_the_same() {
    let mut random = Random(2);
    let particles = particles(20_000, &mut random);
    let text = "sin(Velocity.X) + Mass ^ 1.5 > Position.Z / 7 || Particle Type == 'H'";
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map(|pool| pool.install(|| select(text, &particles)))
    };
    let one = with(1).map(|s| s.map(|s| s.count()));
    assert!(matches!(one, Ok(Ok(count)) if count > 0 && count < 20_000));
    let (Ok(Ok(one)), Ok(Ok(three))) = (with(1), with(3)) else { panic!("not evaluated") };
    assert_eq!(one, three);
}

#[test]
fn no_text_panics() {
    let pieces = [
        "Mass",
        "Velocity",
        "Particle Type",
        "`",
        "'",
        "\"",
        "(",
        ")",
        "[",
        "]",
        ".",
        "X",
        "1e",
        "9",
        "==",
        "=",
        "!",
        "<",
        ">",
        "&&",
        "||",
        "and",
        "not",
        "-",
        "^",
        "**",
        ",",
        "min(",
        "sqrt(",
        " ",
        "é",
        "∞",
        "\n",
        "\0",
        "1e999",
        "pi",
        "[18446744073709551616]",
        "'O'",
        "?",
        "٣",
    ];
    let mut random = Random(3);
    let particles = particles(70, &mut random);
    let mut accepted = 0;
    for _ in 0..200_000 {
        let text: String =
            (0..random.below(9)).map(|_| pieces[random.below(pieces.len())]).collect();
        let selection = select(&text, &particles);
        accepted += usize::from(selection.is_ok());
        assert!(selection.is_err() || properties(&text).is_ok(), "{text}");
        if let Err(error) = selection {
            assert!(error.to_string().lines().count() == 3, "{error}");
        }
    }
    assert!(accepted > 1000, "{accepted}");
}
