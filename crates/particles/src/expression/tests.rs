//! Known answers, then errors; random expressions are in `tests/expression.rs`.

use super::*;
use crate::{Column, Radius, Values};

/// Three particles with one column of each type.
fn particles() -> Particles {
    let names = Values::Names { codes: vec![0, 1, 0], names: vec!["O".into(), "H".into()] };
    Particles {
        origin: [1e6, 0.0, -10.0],
        positions: vec![[0.0, 1.0, 2.0], [0.5, -1.0, 0.0], [1.5, 3.0, 4.0]],
        radius: Radius::Each(vec![0.1, 0.2, 0.7]),
        columns: vec![
            Column::new("Particle Type", 1, names),
            Column::new("Mass", 1, Values::F32(vec![0.7, 16.0, f32::NAN])),
            Column::new("Velocity", 3, Values::F64(vec![3., 4., 0., 0., 0., 1., -6., 0., 8.])),
            Column::new("Count", 1, Values::I32(vec![-1, 0, 7])),
            Column::new("Particle Identifier", 1, Values::I64(vec![10, 20, 30])),
            Column::new("Color", 3, Values::U8(vec![255, 0, 1, 0, 0, 2, 9, 9, 3])),
            Column::new("c_stress[1]", 1, Values::F64(vec![1.0, 2.0, 3.0])),
            Column::new("stress", 6, Values::F32((0..18).map(|i| i as f32).collect())),
            Column::new("Column 3", 1, Values::U8(vec![0, 0, 1])),
            Column::new("and/or", 1, Values::U8(vec![0, 1, 0])),
        ],
        ..Particles::default()
    }
}

/// The selected particles as digits: `"02"` for the first and the third.
fn selected(text: &str) -> String {
    let selection = select(text, &particles()).unwrap_or_else(|e| panic!("{e}"));
    let digits: String = (0..3).filter(|i| selection.contains(*i)).map(|i| i.to_string()).collect();
    assert_eq!(selection.count(), digits.len());
    digits
}

fn error(text: &str) -> String {
    match select(text, &particles()) {
        Ok(_) => panic!("`{text}` was accepted"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn properties_of_every_type() {
    for (text, expected) in [
        ("Mass > 1", "1"),
        ("Count < 1", "01"),
        ("Particle Identifier == 20", "1"),
        ("Velocity.X < 0", "2"),
        ("Velocity[2] >= 1", "12"),
        ("Velocity == 5 || Velocity.Magnitude == 10", "02"),
        ("Color.R == 255 or color.b == 2", "01"),
        ("stress[5] == 11", "1"),
        ("c_stress[1] == 2", "1"),
        ("`c_stress[1]` == 2", "1"),
        ("`Velocity`.Y == 4", "0"),
        ("`and/or` == 1", "1"),
        ("Radius > 0.15", "12"),
        ("Index != 1", "02"),
        ("Column 3", "2"),
    ] {
        assert_eq!(selected(text), expected, "{text}");
    }
}

#[test]
fn positions_are_in_the_files_coordinates() {
    assert_eq!(selected("Position.X > 1000000.4"), "12");
    assert_eq!(selected("Position.Z == -6"), "2");
    assert_eq!(selected("Position.Y < 0"), "1");
    assert_eq!(selected("position > 1000001"), "2");
}

#[test]
fn names_and_their_codes() {
    for (text, expected) in [
        ("Particle Type == \"O\"", "02"),
        ("'H' == ParticleType", "1"),
        ("particle type != 'O'", "1"),
        ("particle_type == 'Xe'", ""),
        ("type != 'Xe'", "012"),
        ("Particle Type == 1", "02"),
        ("Particle Type > 1", "1"),
        ("`Particle Type` + 1 == 3", "1"),
    ] {
        assert_eq!(selected(text), expected, "{text}");
    }
}

#[test]
fn usual_spellings_and_components() {
    assert_eq!(selected("vx == 3 || id == 30"), "02");
    assert_eq!(selected("velocity.z == 1"), "1");
}

/// Each line is true, and false under any other reading.
#[test]
fn precedence() {
    for text in [
        "1 + 2 * 3 == 7",
        "(1 + 2) * 3 == 9",
        "8 - 4 - 2 == 2",
        "16 / 4 / 2 == 2",
        "7 % 4 * 2 == 6",
        "2 * 3 ^ 2 == 18",
        "2 ^ 3 ^ 2 == 512",
        "2 ** 3 ** 2 == 512",
        "-2 ^ 2 == -4",
        "2 ^ -1 * 4 == 2",
        "- -3 == +3",
        "-7 % 4 == -3",
        "1 < 2 && 2 < 3",
        "true || true && false",
        "not 1 == 2",
        "! false || true && false",
        "!(true and false) And NOT false",
        "1 + 1 == 2 == true || true",
        "(3 > 2) + (2 > 1) == 2",
        "not not 5",
    ] {
        // The one chained comparison of the list must be refused.
        match text.contains("== 2 ==") {
            true => assert!(error(text).contains("one comparison at a time"), "{text}"),
            false => assert_eq!(selected(text), "012", "{text}"),
        }
    }
}

#[test]
fn numbers_and_functions() {
    for text in [
        "1e3 == 1000 && .5 == 0.5 && 5. == 5 && 1E-1 == 0.1 && 2e+1 == 20",
        "abs(-2) == 2 && sqrt (9) == 3 && floor(-1.5) == -2 && ceil(1.2) == 2",
        "round(2.5) == 3 && round(-2.5) == -3",
        "exp(0) == 1 && log(exp(1)) == 1 && log10(1000) == 3",
        "abs(sin(pi)) < 1e-15 && cos(PI) == -1 && abs(tan(pi / 4) - 1) < 1e-15",
        "min(3, 1, 2) == 1 && MAX(1, 2) == 2",
        "1 / 0 > 1e300",
    ] {
        assert_eq!(selected(text), "012", "{text}");
    }
    assert_eq!(selected("max(Count, Index, 1) == 1"), "01");
    assert_eq!(selected("sqrt(Velocity.X^2 + Velocity.Y^2 + Velocity.Z^2) == Velocity"), "012");
}

#[test]
fn single_precision_keeps_the_numbers_of_the_file() {
    assert_eq!(selected("Mass >= 0.7 && Mass <= 0.7 && 0.7 == Mass"), "0");
    assert_eq!(selected("Radius == 7 / 10"), "2");
    // What f32 cannot hold is compared as it is.
    assert_eq!(selected("Color.R >= 1e-60 && stress[0] >= 1e-60 || Mass > 1e300"), "2");
}

#[test]
fn nan_is_never_equal_nor_ordered_nor_true() {
    for text in ["Mass < 1e9", "Mass >= 0", "Mass == Mass", "Mass"] {
        assert_eq!(selected(text), "01", "{text}");
    }
    assert_eq!(selected("Mass != Mass"), "2");
    assert_eq!(selected("not Mass"), "2");
    assert_eq!(selected("sqrt(-1) || 0 / 0 > 0"), "");
}

#[test]
fn selection_ends_with_the_particles() {
    let selection = select("true", &particles()).unwrap_or_default();
    assert_eq!(selection.count(), 3);
    assert!(!selection.contains(3) && !selection.contains(u32::MAX));
    assert_eq!(select("Mass > 1", &Particles::default()).map(|s| s.count()), Ok(0));
    assert!(select("Mass >", &Particles::default()).is_err());
}

#[test]
fn unknown_radius_is_no_property() {
    let particles = Particles { positions: vec![[0.0; 3]], ..Particles::default() };
    let message = select("Radius > 1", &particles).map_err(|e| e.message);
    assert_eq!(message, Err("no property `Radius`; there are Position, Index".into()));
    let particles = Particles { radius: Radius::Uniform(2.0), ..particles };
    assert_eq!(select("Radius > 1", &particles).map(|s| s.count()), Ok(1));
}

#[test]
fn properties_are_what_must_be_read() {
    let names = |text| properties(text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        names("Mass > 1 && Mass < 2 or not Particle Type == 'O'"),
        ["Mass", "Particle Type"]
    );
    assert_eq!(names("Velocity.X > sqrt(2) * pi"), ["Velocity.X", "Velocity"]);
    assert_eq!(names("vx > 1"), ["vx", "Velocity"]);
    assert_eq!(names("`a b/c`[2] > 1"), ["`a b/c`[2]".replace('`', ""), "a b/c".into()]);
    assert!(names("1 < 2").is_empty());
    let wanted = crate::read::Wanted::Only(names("particletype == 1 and MASS > 2"));
    assert!(wanted.wants("Particle Type") && wanted.wants("Mass") && !wanted.wants("Charge"));
}

#[test]
fn errors_point_at_the_place() {
    assert_eq!(
        error("Mass > && 3"),
        "expression, column 8: expected a number, a property, a text or `(`, found `&&`\n  \
         Mass > && 3\n         ^^"
    );
    assert_eq!(
        error("1 < 2 and Masss > 3"),
        "expression, column 11: no property `Masss`; did you mean `Mass`? There are Particle Type, \
         Mass, Velocity, Count, Particle Identifier, Color, c_stress[1], stress, Column 3, and/or, \
         Position, Radius, Index\n  1 < 2 and Masss > 3\n            ^^^^^"
    );
    // Characters, not bytes, are counted.
    assert_eq!(select("'äöü' ? 1", &particles()).map_err(|e| e.column), Err(7));
}

#[test]
fn errors_say_what_was_expected() {
    for (text, expected) in [
        ("", "expected a number, a property, a text or `(`, found the end"),
        ("Mass = 3", "expected `==`, found `=`"),
        ("Mass <> 3", "expected `!=`, found `<>`"),
        ("Mass & 3", "expected `&&`, found `&`"),
        ("(Mass > 3", "expected a `)` for this, found the end"),
        ("Mass > 3)", "expected an operator or the end, found `)`"),
        ("(1 2)", "expected an operator or `)`, found `2`"),
        ("1 < Mass < 3", "expected one comparison at a time"),
        ("foo(3)", "no function `foo`; there are abs, sqrt"),
        ("min(3)", "expected `,` and another value, found `)`"),
        ("sqrt(1, 2)", "expected an operator or `)`, found `,`"),
        ("Mass > 'x", "expected another ' before the end"),
        ("Mass > .", "expected a number, found `.`"),
        ("Mass > #", "found `#`; names with such signs stand in backticks"),
        ("Mass + 'x' > 1", "expected a number, found the text \"x\""),
        ("'x'", "expected a number, found the text \"x\""),
        ("'x' == 'x'", "expected a property beside the text"),
        ("1 == 'x'", "expected a number, found the text \"x\""),
        ("Mass == 'x'", "expected a property that holds names, found `Mass` with numbers"),
        ("'Particle Type' == 1", "the property `Particle Type` stands in backticks"),
        ("Particle Type < 'O'", "expected a number, found the text \"O\""),
        ("Particle Type == O", "did you mean the text \"O\"?"),
        ("Particle Type == Particle Type", "expected a number or a text beside the names"),
        ("Velocity.W > 1", "`Velocity` has the components [0] to [2], found [3]"),
        ("Mass.Y > 1", "`Mass` has one value and no component [1]"),
        ("Velocitty.X > 1", "did you mean `Velocity`?"),
        ("Velocity[99999999999999999999999] > 1", "no property"),
    ] {
        let message = error(text);
        assert!(message.contains(expected), "{text}: {message}");
    }
}

#[test]
fn hostile_expressions_are_refused() {
    for text in [
        "(".repeat(60_000),
        "-".repeat(60_000),
        "not ".repeat(15_000),
        "abs(".repeat(15_000),
        "2^".repeat(30_000),
    ] {
        assert!(error(&text).contains("at most 200 levels of nesting"));
    }
    assert!(error(&"1+".repeat(40_000)).contains("expected at most 65536 bytes"));
    assert!(error(&format!("{}?", " ".repeat(60_000))).len() < 400);
    assert!(error(&"a".repeat(60_000)).lines().skip(1).all(|line| line.len() < 200));
}

#[test]
fn long_flat_and_fairly_nested_expressions_work() {
    assert_eq!(selected(&format!("{}0 == 30000", "1+".repeat(30_000))), "012");
    let nested = format!("{}Index{} == 1", "(".repeat(150), ")".repeat(150));
    assert_eq!(selected(&nested), "1");
}
