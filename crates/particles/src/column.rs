//! Named columns: one value, or a short vector of values, per particle.

/// The values of a column, row by row (`components` values for each particle).
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
    /// 32-bit integers.
    I32(Vec<i32>),
    /// 64-bit integers.
    I64(Vec<i64>),
    /// Bytes, flags, 8-bit colours.
    U8(Vec<u8>),
    /// Names from a dictionary: value `c` means `names[c]`.
    ///
    /// Seen as numbers (for colour, filters and `info`) the first name is 1, the second 2, …, as
    /// particle types are counted in the field.
    Names {
        /// One index into `names` per value.
        codes: Vec<u32>,
        /// The names, in order of first appearance.
        names: Vec<String>,
    },
}

impl Values {
    /// How many values are stored (particles × components).
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
            Self::I32(v) => v.len(),
            Self::I64(v) => v.len(),
            Self::U8(v) => v.len(),
            Self::Names { codes, .. } => codes.len(),
        }
    }

    /// Whether nothing is stored.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i` as a number; names count from 1.
    pub fn number(&self, i: usize) -> f64 {
        match self {
            Self::F32(v) => f64::from(v[i]),
            Self::F64(v) => v[i],
            Self::I32(v) => f64::from(v[i]),
            Self::I64(v) => v[i] as f64,
            Self::U8(v) => f64::from(v[i]),
            Self::Names { codes, .. } => f64::from(codes[i]) + 1.0,
        }
    }

    /// The name of the stored type as `motes info` prints it.
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::F32(_) => "f32",
            Self::F64(_) => "f64",
            Self::I32(_) => "i32",
            Self::I64(_) => "i64",
            Self::U8(_) => "u8",
            Self::Names { .. } => "names",
        }
    }
}

/// A named property of the particles, in the file's own order.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The field's standard name (`Velocity`, `Particle Type`, …) or the file's own.
    pub name: String,
    /// Values per particle, 1–9.
    pub components: usize,
    /// `particles × components` values, row by row.
    pub values: Values,
}

impl Column {
    /// A column of `components` values per particle.
    ///
    /// # Panics
    /// If `components` is 0 or the values do not divide into whole rows: a reader's mistake.
    pub fn new(name: impl Into<String>, components: usize, values: Values) -> Self {
        assert!(components > 0 && values.len().is_multiple_of(components), "ragged column");
        Self { name: name.into(), components, values }
    }

    /// How many particles the column describes.
    pub fn rows(&self) -> usize {
        self.values.len() / self.components
    }

    /// Component `component` of particle `row` as a number; names count from 1.
    pub fn number(&self, row: usize, component: usize) -> f64 {
        self.values.number(row * self.components + component)
    }

    /// The Euclidean length of particle `row`'s vector (the value itself for one component).
    pub fn magnitude(&self, row: usize) -> f64 {
        if self.components == 1 {
            return self.number(row, 0);
        }
        (0..self.components).map(|c| self.number(row, c).powi(2)).sum::<f64>().sqrt()
    }

    /// Least and greatest finite value of each component; `None` where there is none.
    pub fn range(&self) -> Vec<Option<(f64, f64)>> {
        (0..self.components)
            .map(|c| {
                (0..self.rows()).map(|row| self.number(row, c)).filter(|v| v.is_finite()).fold(
                    None,
                    |range, v| match range {
                        None => Some((v, v)),
                        Some((low, high)) => Some((v.min(low), v.max(high))),
                    },
                )
            })
            .collect()
    }
}
