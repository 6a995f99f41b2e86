//! What a device is described by, in the order in which it is written.

use crate::error::EquationError;
use kalmems_units::Unit;
use std::fmt;

/// Where a text of a description stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TextPlace {
    /// The way to it, such as `derivative.omega`.
    pub key: String,
    /// Where it begins in the file, in bytes; `None` where it comes from no file.
    pub offset: Option<usize>,
}

impl fmt::Display for TextPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.key)
    }
}

/// A name and the text behind it: a unit, a value with its unit, or an expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedText {
    /// The name.
    pub name: String,
    /// The text.
    pub text: String,
    /// Where the text stands.
    pub place: TextPlace,
}

impl NamedText {
    /// An entry of a table, from no file.
    pub fn new(table: &str, name: &str, text: &str) -> Self {
        let place = TextPlace { key: format!("{table}.{name}"), offset: None };
        Self { name: name.to_owned(), text: text.to_owned(), place }
    }
}

/// A state behind another expression: what it follows, and how late.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Follower {
    /// Its name.
    pub name: String,
    /// What it follows, an expression that states its unit by `in`.
    pub of: NamedText,
    /// The time constant of a lag, or the time by which a delay is late.
    pub time: NamedText,
    /// The order of a delay's approximation, 1 or 2; not used by a lag.
    pub order: u8,
}

/// What happens to some states at once where an expression passes zero.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ResetText {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub place: TextPlace,
    /// The expression, where it happens as that passes zero from below.
    pub rises: Option<NamedText>,
    /// The same from above.
    pub falls: Option<NamedText>,
    /// The same from either side.
    pub crosses: Option<NamedText>,
    /// What the states are then, by their names; the others stay.
    pub set: Vec<NamedText>,
}

/// What a curve does beyond its first and last point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveExtension {
    /// It is not a number there, which every result that depends on it shows.
    #[default]
    Error,
    /// It keeps the value of the end.
    Clamp,
    /// It goes on along the tangent of the end.
    Linear,
}

/// A curve through points, or a surface through points on a grid, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvePoints {
    /// Its name: a function of one argument, or of two.
    pub name: String,
    /// Where it was described.
    pub place: TextPlace,
    /// The file that the points are in, where they are not written out. Whoever reads files puts the points and their units
    /// in its place.
    pub file: Option<String>,
    /// Where the points are, rising.
    pub x: Vec<f64>,
    /// Its value at each; of a surface where the points are along the second argument, rising.
    pub y: Vec<f64>,
    /// Of a surface its values, row by row of equal x; empty of a curve.
    pub z: Vec<f64>,
    /// The unit of the argument.
    pub x_unit: String,
    /// The unit of the value; of a surface that of the second argument.
    pub y_unit: String,
    /// The unit of a surface's value.
    pub z_unit: String,
    /// What it does beyond the points.
    pub outside: CurveExtension,
}

impl CurvePoints {
    /// The same with places and values in SI, of points that are in their units.
    ///
    /// # Errors
    ///
    /// A unit that is not known.
    pub fn in_si(self) -> Result<Self, EquationError> {
        let factor = |unit: &str| match Unit::parse(unit) {
            Ok(unit) => Ok(unit.factor()),
            Err(fault) => Err(EquationError::whole(&self.place, unit, fault.into())),
        };
        let of_z = if self.z.is_empty() { 1.0 } else { factor(&self.z_unit)? };
        let (of_x, of_y) = (factor(&self.x_unit)?, factor(&self.y_unit)?);
        let in_si = |values: &[f64], factor: f64| values.iter().map(|value| value * factor).collect();
        let [x, y, z] = [(&self.x, of_x), (&self.y, of_y), (&self.z, of_z)].map(|(of, by)| in_si(of, by));
        Ok(Self { x, y, z, ..self })
    }
}

/// A device as it is written: names and texts in the order of the file. [`Device::of`](crate::Device::of) reads it.
///
/// The order of `states`, `inputs`, `parameters` and `measure` is that of the numbers in every vector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    /// States with their units.
    pub states: Vec<NamedText>,
    /// Inputs with their units.
    pub inputs: Vec<NamedText>,
    /// Parameters with their values and units.
    pub parameters: Vec<NamedText>,
    /// Named expressions.
    pub lets: Vec<NamedText>,
    /// Functions; the name is that of the function with its arguments, such as `plate(angle, near, far)`.
    pub functions: Vec<NamedText>,
    /// The rate of each state, by its name.
    pub derivative: Vec<NamedText>,
    /// What is measured, each expression with its unit behind `in`.
    pub measure: Vec<NamedText>,
    /// What follows from the states and is wanted as well, each expression with its unit behind `in`.
    pub quantities: Vec<NamedText>,
    /// The noise of a state's rate or of a measurement, by its name.
    pub noise: Vec<NamedText>,
    /// Curves and surfaces through points.
    pub tables: Vec<CurvePoints>,
    /// Expressions that are zero where something happens.
    pub events: Vec<NamedText>,
    /// What happens to the states at once where an expression passes zero.
    pub when: Vec<ResetText>,
    /// The period of a state, by its name.
    pub cyclic: Vec<NamedText>,
    /// States that follow expressions through one pole.
    pub lag: Vec<Follower>,
    /// Expressions a while ago.
    pub delay: Vec<Follower>,
    /// What the device's energy is, for the check of its equations.
    pub energy: Option<NamedText>,
}
