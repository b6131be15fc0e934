//! The `settings!` macro: a parameter's name, type, default and line of meaning stand together, once.
//!
//! From one list of fields it makes the struct, its `Default`, its serde (missing fields take their
//! defaults, unknown ones are refused) and its [`Shape`], from which the documented scene, the paths of
//! `--set` and the words of the errors come.

/// What a parameter can hold.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// One value; the words say what it can be, such as `a number`.
    Value(String),
    /// A table of named parameters.
    Table(Vec<Field>),
    /// A list of tables, and one with its defaults.
    List(Box<Shape>, toml::Table),
    /// Values under free names.
    Map(Box<Shape>),
}

/// One parameter of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The name, as in the TOML.
    pub name: &'static str,
    /// What it means, with the unit: one line.
    pub meaning: String,
    /// For a parameter that has no value by default: one it could have, as TOML.
    pub example: Option<&'static str>,
    /// What it can hold.
    pub shape: Shape,
}

/// A type that can stand in a scene.
pub trait Setting {
    /// What the type can hold.
    fn shape() -> Shape;
}

impl Shape {
    /// In the words of an error: `a number`, `a table`, ….
    pub fn expected(&self) -> String {
        match self {
            Self::Value(words) => words.clone(),
            Self::Table(fields) => {
                let names: Vec<_> = fields.iter().map(|f| f.name).collect();
                format!("a table of {}", names.join(", "))
            }
            Self::List(..) => "a list of tables".into(),
            Self::Map(of) => format!("a table of names, each with {}", of.expected()),
        }
    }
}

/// Plain values and the words for them.
macro_rules! values {
    ($($type:ty => $words:expr;)+) => {$(
        impl Setting for $type {
            fn shape() -> Shape {
                Shape::Value($words.into())
            }
        }
    )+};
}

values! {
    f64 => "a number";
    u32 => "a whole number, 0 or more";
    i64 => "a whole number";
    bool => "true or false";
    String => "text";
    [f64; 2] => "two numbers, [a, b]";
    glam::DVec3 => "three numbers, [x, y, z]";
}

impl<T: Setting> Setting for Option<T> {
    fn shape() -> Shape {
        T::shape()
    }
}

impl<T: Setting + Default + serde::Serialize> Setting for Vec<T> {
    fn shape() -> Shape {
        let defaults = toml::Table::try_from(T::default()).unwrap_or_default();
        Shape::List(Box::new(T::shape()), defaults)
    }
}

impl<T: Setting> Setting for std::collections::BTreeMap<String, T> {
    fn shape() -> Shape {
        Shape::Map(Box::new(T::shape()))
    }
}

/// A table of parameters: `/// meaning` then `name: Type = default,`; a parameter that may be missing
/// ends with `=> "an example"`.
macro_rules! settings {
    (
        $(#[doc = $about:literal])+
        pub struct $name:ident {
            $( $(#[doc = $doc:literal])+ $field:ident : $type:ty = $default:expr $(=> $example:literal)? ,)+
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $( $(#[doc = $doc])+ pub $field: $type, )+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $field: $default, )+ }
            }
        }

        impl crate::settings::Setting for $name {
            fn shape() -> crate::settings::Shape {
                crate::settings::Shape::Table(vec![$(
                    crate::settings::Field {
                        name: stringify!($field).trim_start_matches("r#"),
                        meaning: concat!($($doc),+).trim().to_owned(),
                        example: settings!(@example $($example)?),
                        shape: <$type as crate::settings::Setting>::shape(),
                    },
                )+])
            }
        }
    };
    (@example) => { None };
    (@example $example:literal) => { Some($example) };
}

/// An enum of words, written in the TOML as the word given.
macro_rules! words {
    (
        $(#[doc = $about:literal])+
        pub enum $name:ident {
            $( $(#[doc = $doc:literal])+ $variant:ident = $word:literal ,)+
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $( $(#[doc = $doc])+ #[serde(rename = $word)] $variant, )+
        }

        impl $name {
            /// Every word, in order.
            pub const WORDS: &'static [&'static str] = &[$($word),+];
        }

        impl crate::settings::Setting for $name {
            fn shape() -> crate::settings::Shape {
                crate::settings::Shape::Value(format!("one of {}", Self::WORDS.join(", ")))
            }
        }
    };
}

pub(crate) use {settings, words};
