//! [`Grid`]: a function known at points, of one argument or two, between them and beyond; [`Table`] owns one.

mod weights;

use super::Scalar;
use serde::{Deserialize, Serialize};
use weights::{Weights, weights};

/// How a table is read between its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Interpolation {
    /// By straight lines; the slope jumps at the points.
    Linear,
    /// By cubic polynomials with the slope of the parabola through each three neighbors (cubic Bessel interpolation; C. de
    /// Boor, *A Practical Guide to Splines*, 2001, chapter IV): value and slope are continuous.
    Smooth,
}

/// How a table is read beyond its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Extrapolation {
    /// The value at the end.
    Hold,
    /// A straight line with the slope at the end.
    Linear,
}

/// Points that make no table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// An axis with fewer than two points.
    #[error("an axis of the table has {0} point(s); give at least two")]
    TooShort(usize),
    /// An axis that does not rise.
    #[error(
        "point {index} of an axis of the table is {value}, which is not above the point before it; sort the points"
    )]
    NotRising {
        /// The point's number.
        index: usize,
        /// Where it stands.
        value: f64,
    },
    /// Not one value per point.
    #[error("the table has {found} values for {expected} points")]
    Count {
        /// Points.
        expected: usize,
        /// Values.
        found: usize,
    },
    /// A value that is not finite.
    #[error("value {index} of the table is {value}; fill it in or leave its row out")]
    NotFinite {
        /// The value's number.
        index: usize,
        /// The value.
        value: f64,
    },
}

/// A table on borrowed numbers, of one argument or two; needs no memory of its own.
///
/// At a point the slope is that of the interval above it, at the last that of the interval below.
///
/// ```
/// use greybox::{Dual, scalar::{Extrapolation, Grid, Interpolation}};
/// let flux = Grid::curve(&[0.0, 1.0, 3.0], &[0.0, 0.8, 1.2], Interpolation::Linear, Extrapolation::Hold).unwrap();
/// let psi = flux.at(Dual::<1>::variable(2.0, 0));
/// assert_eq!(psi.value, 1.0);
/// assert!((psi.slopes[0] - 0.2).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid<'a> {
    x: &'a [f64],
    /// Empty for a table of one argument.
    y: &'a [f64],
    /// By rows: for each `x` the values over `y`.
    values: &'a [f64],
    interpolation: Interpolation,
    extrapolation: Extrapolation,
}

fn check_axis(axis: &[f64]) -> Result<(), TableError> {
    if axis.len() < 2 {
        return Err(TableError::TooShort(axis.len()));
    }
    let rises = |i: &usize| axis[*i].is_finite() && (*i == 0 || axis[*i] > axis[*i - 1]);
    match (0..axis.len()).find(|i| !rises(i)) {
        Some(index) => Err(TableError::NotRising { index, value: axis[index] }),
        None => Ok(()),
    }
}

fn check_values(values: &[f64], expected: usize) -> Result<(), TableError> {
    if values.len() != expected {
        return Err(TableError::Count { expected, found: values.len() });
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(TableError::NotFinite { index, value: values[index] }),
        None => Ok(()),
    }
}

impl<'a> Grid<'a> {
    /// A function of one argument.
    ///
    /// # Errors
    /// If the points do not rise, or the numbers do not fit.
    pub fn curve(
        x: &'a [f64],
        values: &'a [f64],
        interpolation: Interpolation,
        extrapolation: Extrapolation,
    ) -> Result<Self, TableError> {
        check_axis(x)?;
        check_values(values, x.len())?;
        Ok(Grid { x, y: &[], values, interpolation, extrapolation })
    }

    /// A function of two arguments: `values[i * y.len() + j]` at `x[i]`, `y[j]`.
    ///
    /// # Errors
    /// If the points do not rise, or the numbers do not fit.
    pub fn surface(
        x: &'a [f64],
        y: &'a [f64],
        values: &'a [f64],
        interpolation: Interpolation,
        extrapolation: Extrapolation,
    ) -> Result<Self, TableError> {
        check_axis(x)?;
        check_axis(y)?;
        check_values(values, x.len() * y.len())?;
        Ok(Grid { x, y, values, interpolation, extrapolation })
    }

    /// The points of both arguments; none of a second that it has not.
    pub fn axes(&self) -> [&'a [f64]; 2] {
        [self.x, self.y]
    }

    /// The values, for each point of the first argument those over the second.
    pub fn values(&self) -> &'a [f64] {
        self.values
    }

    /// How it is read between its points.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// How it is read beyond its ends.
    pub fn extrapolation(&self) -> Extrapolation {
        self.extrapolation
    }

    /// Whether it has two arguments.
    pub fn is_surface(&self) -> bool {
        !self.y.is_empty()
    }

    /// The value at `x`; of a table of two arguments, at `y = 0`.
    #[inline]
    pub fn at<S: Scalar>(&self, x: S) -> S {
        S::look_up(self, [x, S::from(0.0)], [0, 0])
    }

    /// The value at `x`, `y`; a table of one argument does not depend on `y`.
    #[inline]
    pub fn at2<S: Scalar>(&self, x: S, y: S) -> S {
        S::look_up(self, [x, y], [0, 0])
    }

    /// The value, or its derivative of these orders in `x` and `y`.
    pub fn derivative(&self, at: [f64; 2], order: [u8; 2]) -> f64 {
        let along = |axis: &[f64], at: f64, order: u8| weights(axis, at, order, self.interpolation, self.extrapolation);
        if at[0].is_nan() {
            return f64::NAN;
        }
        let rows = along(self.x, at[0], order[0]);
        if !self.is_surface() {
            return if order[1] > 0 { 0.0 } else { rows.of(|i| self.values[i]) };
        }
        if at[1].is_nan() {
            return f64::NAN;
        }
        let columns: Weights = along(self.y, at[1], order[1]);
        rows.of(|i| columns.of(|j| self.values[i * self.y.len() + j]))
    }
}

/// A table that owns its numbers.
#[cfg(feature = "std")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub struct Table(Parts);

#[cfg(feature = "std")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    x: Vec<f64>,
    y: Vec<f64>,
    values: Vec<f64>,
    interpolation: Interpolation,
    extrapolation: Extrapolation,
}

#[cfg(feature = "std")]
impl Table {
    /// A function of one argument.
    ///
    /// # Errors
    /// As [`Grid::curve`].
    pub fn curve(
        x: &[f64],
        values: &[f64],
        interpolation: Interpolation,
        extrapolation: Extrapolation,
    ) -> Result<Self, TableError> {
        Grid::curve(x, values, interpolation, extrapolation).map(|grid| Table::from(&grid))
    }

    /// A function of two arguments: `values[i * y.len() + j]` at `x[i]`, `y[j]`.
    ///
    /// # Errors
    /// As [`Grid::surface`].
    pub fn surface(
        x: &[f64],
        y: &[f64],
        values: &[f64],
        interpolation: Interpolation,
        extrapolation: Extrapolation,
    ) -> Result<Self, TableError> {
        Grid::surface(x, y, values, interpolation, extrapolation).map(|grid| Table::from(&grid))
    }

    /// The table on its own numbers.
    pub fn grid(&self) -> Grid<'_> {
        let Parts { x, y, values, interpolation, extrapolation } = &self.0;
        Grid { x, y, values, interpolation: *interpolation, extrapolation: *extrapolation }
    }

    /// The value at `x`.
    pub fn at<S: Scalar>(&self, x: S) -> S {
        self.grid().at(x)
    }

    /// The value at `x`, `y`.
    pub fn at2<S: Scalar>(&self, x: S, y: S) -> S {
        self.grid().at2(x, y)
    }
}

#[cfg(feature = "std")]
impl From<&Grid<'_>> for Table {
    fn from(grid: &Grid<'_>) -> Self {
        let Grid { x, y, values, interpolation, extrapolation } = *grid;
        Table(Parts { x: x.to_vec(), y: y.to_vec(), values: values.to_vec(), interpolation, extrapolation })
    }
}

#[cfg(feature = "std")]
impl From<Table> for Parts {
    fn from(table: Table) -> Self {
        table.0
    }
}

#[cfg(feature = "std")]
impl TryFrom<Parts> for Table {
    type Error = TableError;

    fn try_from(parts: Parts) -> Result<Self, TableError> {
        let Parts { x, y, values, interpolation, extrapolation } = &parts;
        match y.is_empty() {
            true => Grid::curve(x, values, *interpolation, *extrapolation)?,
            false => Grid::surface(x, y, values, *interpolation, *extrapolation)?,
        };
        Ok(Table(parts))
    }
}
