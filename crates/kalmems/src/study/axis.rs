//! What varies: the values of one key.

use super::description::{AppliesTo, GridValues, Normal, Spacing, Uniform, Vary};
use super::seed::Draw;
use crate::config::{ConfigFault, Key};
use crate::units::{ColumnHeader, Unit, Value};

/// A key with the values that it takes.
#[derive(Clone, Debug)]
pub(super) struct StudyAxis {
    /// The key in the experiment file.
    pub(super) key: Key,
    /// Its name in the results.
    pub(super) name: String,
    /// Its column in the results: the name, and the SI unit where it has one.
    pub(super) column: String,
    /// Its unit as written; empty where it has none.
    pub(super) unit: String,
    pub(super) applies_to: AppliesTo,
    pub(super) values: AxisValues,
}

/// The values of a key.
#[derive(Clone, Debug)]
pub(super) enum AxisValues {
    /// One after the other: a dimension of the grid.
    Listed(Vec<AxisValue>),
    /// By chance, in every run anew.
    Drawn(RandomValues),
}

/// A distribution in the unit of its first value.
#[derive(Clone, Debug)]
pub(super) enum RandomValues {
    Normal { mean: f64, sd: f64, unit: String },
    Uniform { from: f64, to: f64, unit: String },
}

/// One value that a key takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AxisValue {
    /// As the experiment file would have it.
    pub(super) toml: toml::Value,
    /// As the results have it: SI where it has a unit.
    pub(super) cell: String,
    /// As a number in the unit as written; `None` for a word.
    pub(super) number: Option<f64>,
}

/// What the values of a key are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum AxisValueKind {
    Quantity(Unit),
    Number,
    Word,
}

impl AxisValue {
    /// As people read it: a number has one form, whether it was written so or is one of a grid.
    pub(super) fn text(&self) -> String {
        let parts = quantity(&self.toml).map(|value| value.parts().1.to_owned());
        match (self.number, parts) {
            (Some(number), Some(unit)) => format!("{} {unit}", plain_number(number)),
            (Some(number), None) => plain_number(number),
            (None, _) => self.toml.as_str().map_or_else(|| self.toml.to_string(), str::to_owned),
        }
    }
}

impl StudyAxis {
    /// A value of the key as a number in the unit in which the results have it; `None` for a word.
    pub(super) fn number_of(&self, value: &toml::Value) -> Option<f64> {
        let own = setting(value.clone()).number;
        if unit_text(value) == self.unit {
            return own;
        }
        let of_unit = |number: u8| Some(Value::parse(&format!("{number} {}", self.unit)).ok()?.si());
        // A temperature in °C has another zero.
        (of_unit(0)? == 0.0).then_some(quantity(value)?.si() / of_unit(1)?)
    }

    /// Reads and checks a `[[vary]]` table; where it is wrong, the key below it.
    pub(super) fn of(vary: &Vary, simulated: bool) -> Result<Self, (&'static str, ConfigFault)> {
        let value = |why: String| ConfigFault::Value { why };
        let key = Key::parse(&vary.key).ok_or_else(|| {
            let why = format!(
                "`{}` is no key; expected names and indices, such as `recording[0].clock.rate`",
                vary.key
            );
            ("key", value(why))
        })?;
        if matches!(key.last(), "file") {
            let why = "the files of a study are the same at all its points; use several experiments instead";
            return Err(("key", value(why.to_owned())));
        }
        if vary.key == "simulate.seed" {
            let why = "the noise of each run follows from the study's `seed`; use `repeats` instead";
            return Err(("key", value(why.to_owned())));
        }
        let applies_to = match (vary.applies_to, simulated) {
            (None, true) => AppliesTo::Both,
            (None | Some(AppliesTo::Told), false) => AppliesTo::Told,
            (Some(applies_to), true) => applies_to,
            (Some(_), false) => {
                let why =
                    "the experiment has no `[simulate]`: its recordings are what they are; write `told`";
                return Err(("applies_to", value(why.to_owned())));
            }
        };
        let (first, values) = match (&vary.grid, &vary.values, &vary.normal, &vary.uniform) {
            (Some(grid), None, None, None) => listed(self::grid(grid).map_err(|fault| ("grid", fault))?),
            (None, Some(values), None, None) => listed(list(values).map_err(|fault| ("values", fault))?),
            (None, None, Some(n), None) => normal(n).map_err(|fault| ("normal", fault))?,
            (None, None, None, Some(u)) => uniform(u).map_err(|fault| ("uniform", fault))?,
            (grid, values, normal, uniform) => {
                let known = ["grid", "values", "normal", "uniform"];
                let there = [grid.is_some(), values.is_some(), normal.is_some(), uniform.is_some()];
                let found = known.iter().zip(there).filter(|(_, there)| *there);
                let found = found.map(|(name, _)| (*name).to_owned()).collect();
                return Err(("", ConfigFault::OneOf { found, known: known.map(str::to_owned).to_vec() }));
            }
        };
        let name = vary.name.as_ref().map_or_else(|| key.last().to_owned(), ToString::to_string);
        if name.is_empty() {
            let why = "an entry of a list has no name of its own; add `name`".to_owned();
            return Err(("key", value(why)));
        }
        let (ending, unit) = match sort_of(&first).map_err(|fault| ("values", fault))? {
            AxisValueKind::Quantity(unit) => {
                (format!("_{}", ending(unit, &unit_text(&first))), unit_text(&first))
            }
            AxisValueKind::Number => ("_1".to_owned(), String::new()),
            AxisValueKind::Word => (String::new(), String::new()),
        };
        Ok(Self { key, column: format!("{name}{ending}"), name, unit, applies_to, values })
    }

    /// Whether its values are numbers, and not words.
    pub(super) fn is_of_numbers(&self) -> bool {
        self.listed().iter().all(|setting| setting.number.is_some())
    }

    /// The settings that are listed; one, which stands for all, where they are drawn.
    pub(super) fn listed(&self) -> &[AxisValue] {
        match &self.values {
            AxisValues::Listed(settings) => settings,
            AxisValues::Drawn(_) => &[],
        }
    }

    /// How many points of the grid this one makes of each.
    pub(super) fn points(&self) -> u64 {
        match &self.values {
            AxisValues::Listed(settings) => settings.len() as u64,
            AxisValues::Drawn(_) => 1,
        }
    }
}

impl RandomValues {
    /// The value of one run.
    pub(super) fn setting(&self, draw: Draw) -> AxisValue {
        let (number, unit) = match self {
            Self::Normal { mean, sd, unit } => (mean + sd * draw.normal(), unit),
            Self::Uniform { from, to, unit } => (from + (to - from) * draw.uniform(), unit),
        };
        written(number, unit)
    }

    /// A value in the middle, to check the key by.
    pub(super) fn middle(&self) -> AxisValue {
        match self {
            Self::Normal { mean, unit, .. } => written(*mean, unit),
            Self::Uniform { from, to, unit } => written(from.midpoint(*to), unit),
        }
    }
}

fn listed(settings: Vec<AxisValue>) -> (toml::Value, AxisValues) {
    // There is a first one: grids and lists without values are refused.
    let first = settings.first().map_or(toml::Value::Boolean(false), |setting| setting.toml.clone());
    (first, AxisValues::Listed(settings))
}

fn list(values: &[toml::Value]) -> Result<Vec<AxisValue>, ConfigFault> {
    let Some(first) = values.first() else {
        return Err(ConfigFault::Value { why: "found no value; expected at least one".to_owned() });
    };
    let sort = sort_of(first)?;
    let mut settings = Vec::new();
    for value in values {
        same_sort(sort, first, value)?;
        let setting = setting(value.clone());
        if settings.iter().any(|other: &AxisValue| other.cell == setting.cell) {
            return Err(ConfigFault::Value { why: format!("{value} stands here twice") });
        }
        settings.push(setting);
    }
    Ok(settings)
}

fn grid(grid: &GridValues) -> Result<Vec<AxisValue>, ConfigFault> {
    let (from, to, unit) = range(&grid.from, &grid.to)?;
    let refuse = |why: String| Err(ConfigFault::Value { why });
    if !(2..=1_000_000).contains(&grid.points) {
        return refuse(format!("`{}` points are no grid; expected 2 to 1000000", grid.points));
    }
    if from == to {
        return refuse(format!("{} and {} are the same value", grid.from, grid.to));
    }
    if grid.spacing == Spacing::Log && (to / from <= 0.0 || !(to / from).is_finite()) {
        return refuse(format!("{} and {} have no ratio above 0; use linear spacing", grid.from, grid.to));
    }
    let last = grid.points - 1;
    let inner = |i: u64| {
        let part = i as f64 / last as f64;
        let number = match grid.spacing {
            Spacing::Linear => from + (to - from) * part,
            // Elementary functions of the core: the same on every machine.
            Spacing::Log => {
                let ratio: f64 = kalmems_core::Scalar::ln(to / from);
                from * kalmems_core::Scalar::exp(ratio * part)
            }
        };
        // Twelve digits are what is meant: 1.096, not 1.0960000000000001.
        written(format!("{number:.11e}").parse().unwrap_or(number), &unit)
    };
    let ends = |value: &toml::Value| setting(value.clone());
    Ok((0..=last)
        .map(|i| match i {
            0 => ends(&grid.from),
            i if i == last => ends(&grid.to),
            i => inner(i),
        })
        .collect())
}

fn normal(normal: &Normal) -> Result<(toml::Value, AxisValues), ConfigFault> {
    let (mean, sd, unit) = range(&normal.mean, &normal.sd)?;
    if sd < 0.0 {
        return Err(ConfigFault::Value { why: format!("the standard deviation {} is below 0", normal.sd) });
    }
    Ok((normal.mean.clone(), AxisValues::Drawn(RandomValues::Normal { mean, sd, unit })))
}

fn uniform(uniform: &Uniform) -> Result<(toml::Value, AxisValues), ConfigFault> {
    let (from, to, unit) = range(&uniform.from, &uniform.to)?;
    if from >= to {
        return Err(ConfigFault::Value { why: format!("{} is not below {}", uniform.from, uniform.to) });
    }
    Ok((uniform.from.clone(), AxisValues::Drawn(RandomValues::Uniform { from, to, unit })))
}

/// Two values of one dimension as numbers in the unit of the first.
fn range(first: &toml::Value, second: &toml::Value) -> Result<(f64, f64, String), ConfigFault> {
    let sort = sort_of(first)?;
    same_sort(sort, first, second)?;
    if sort == AxisValueKind::Word {
        let why = format!("{first} is no number with a unit; between words there is nothing");
        return Err(ConfigFault::Value { why });
    }
    let unit = unit_text(first);
    let numbers = (setting(first.clone()).number, setting(second.clone()).number);
    let (Some(from), Some(mut to)) = numbers else {
        return Err(ConfigFault::Value { why: format!("{first} and {second} are no numbers") });
    };
    if let (Some(a), Some(b)) = (quantity(first), quantity(second))
        && unit_text(second) != unit
    {
        to = b.si() / a.unit().factor();
    }
    if !(from.is_finite() && to.is_finite()) {
        return Err(ConfigFault::Value { why: format!("{first} and {second} are not both finite") });
    }
    Ok((from, to, unit))
}

fn same_sort(sort: AxisValueKind, first: &toml::Value, other: &toml::Value) -> Result<(), ConfigFault> {
    let same = match (sort, sort_of(other)?) {
        (AxisValueKind::Quantity(a), AxisValueKind::Quantity(b)) => a.dimension() == b.dimension(),
        (a, b) => a == b,
    };
    if same {
        Ok(())
    } else {
        Err(ConfigFault::Value { why: format!("{other} is not of the same kind as {first}") })
    }
}

fn sort_of(value: &toml::Value) -> Result<AxisValueKind, ConfigFault> {
    match value {
        toml::Value::Integer(_) | toml::Value::Float(_) => Ok(AxisValueKind::Number),
        toml::Value::Boolean(_) => Ok(AxisValueKind::Word),
        toml::Value::String(_) => {
            Ok(quantity(value).map_or(AxisValueKind::Word, |value| AxisValueKind::Quantity(value.unit())))
        }
        other => {
            let why = format!("found {}; expected text, a number, `true` or `false`", other.type_str());
            Err(ConfigFault::Value { why })
        }
    }
}

fn quantity(value: &toml::Value) -> Option<Value> {
    Value::parse(value.as_str()?).ok()
}

/// The SI unit as a column name has it: the unit as written where that is one, so that N m stays N_m.
fn ending(unit: Unit, text: &str) -> String {
    let same = text.replace(' ', "_").replace('^', "").replace('/', "_per_");
    let read = ColumnHeader::parse(&format!("x_{same}"));
    let is_si = |found: Unit| found.dimension() == unit.dimension() && found.factor() == 1.0;
    if read.unit.is_some_and(is_si) && read.unit_text == same { same } else { unit.si_header() }
}

fn unit_text(value: &toml::Value) -> String {
    quantity(value).map_or_else(String::new, |value| value.parts().1.to_owned())
}

/// A number in a unit, or a plain one, as a setting.
fn written(number: f64, unit: &str) -> AxisValue {
    setting(if unit.is_empty() {
        toml::Value::Float(number)
    } else {
        // The shortest text that reads back as the same number.
        toml::Value::String(format!("{number:?} {unit}"))
    })
}

#[allow(clippy::cast_precision_loss)] // a picture does not show it
fn setting(toml: toml::Value) -> AxisValue {
    let (cell, number) = match (&toml, quantity(&toml)) {
        (_, Some(value)) => (shortest(value.si()), value.parts().0.parse().ok()),
        (toml::Value::String(word), None) => (word.clone(), None),
        (toml::Value::Integer(n), _) => (n.to_string(), Some(*n as f64)),
        (toml::Value::Float(x), _) => (shortest(*x), Some(*x)),
        (other, _) => (other.to_string(), None),
    };
    AxisValue { toml, cell, number }
}

/// With an exponent where that is shorter and there would be zeros to count.
pub(super) fn plain_number(number: f64) -> String {
    let (plain, with_exponent) = (format!("{number}"), format!("{number:e}"));
    let counts = number != 0.0 && !(1e-3..1e4).contains(&number.abs());
    if counts && with_exponent.len() < plain.len() { with_exponent } else { plain }
}

/// The shortest text that reads back as the same number.
fn shortest(number: f64) -> String {
    format!("{number:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(text: &str) -> Result<StudyAxis, (&'static str, String)> {
        let vary: Vary = toml::from_str(text).unwrap();
        StudyAxis::of(&vary, true).map_err(|(key, fault)| (key, fault.to_string()))
    }

    fn texts(axis: &StudyAxis) -> Vec<String> {
        axis.listed().iter().map(|setting| setting.toml.to_string().replace('"', "")).collect()
    }

    #[test]
    fn a_grid_keeps_its_ends_and_its_unit() {
        let axis = axis("key = \"a.frequency\"\ngrid = { from = \"900 Hz\", to = \"1.1 kHz\", points = 3 }")
            .unwrap();
        assert_eq!(texts(&axis), ["900 Hz", "1000.0 Hz", "1.1 kHz"]);
        assert_eq!(
            axis.listed().iter().map(|s| s.cell.as_str()).collect::<Vec<_>>(),
            ["900.0", "1000.0", "1100.0"]
        );
        assert_eq!((axis.column.as_str(), axis.unit.as_str()), ("frequency_Hz", "Hz"));
    }

    #[test]
    fn another_value_is_a_number_in_the_unit_of_the_axis() {
        let told = axis("key = \"a.b\"\ngrid = { from = \"1 N m\", to = \"2 N m\", points = 3 }").unwrap();
        let of = |text: &str| told.number_of(&toml::Value::from(text));
        assert_eq!((of("3 N m"), of("0.5 N m")), (Some(3.0), Some(0.5)));
        assert!((of("1500 mN m").unwrap() - 1.5).abs() < 1e-12);
        assert_eq!((of("hold"), told.number_of(&toml::Value::from(2))), (None, None));
    }

    #[test]
    fn a_grid_of_equal_ratios() {
        let axis = axis(
            "key = \"q\"\ngrid = { from = \"1e4 rad^2/s^3\", to = \"1e8 rad^2/s^3\", points = 5, spacing = \"log\" }",
        )
        .unwrap();
        let numbers: Vec<f64> = axis.listed().iter().filter_map(|s| s.number).collect();
        assert_eq!(numbers, [1e4, 1e5, 1e6, 1e7, 1e8]);
        assert_eq!(axis.column, "q_rad2_per_s3");
    }

    #[test]
    fn a_column_has_the_unit_as_written_where_it_is_si() {
        for (unit, ending) in [("N m", "N_m"), ("kHz", "Hz"), ("rad/s", "rad_per_s"), ("%", "1")] {
            let axis = axis(&format!("key = \"x\"\nvalues = [\"2 {unit}\"]")).unwrap();
            let read = ColumnHeader::parse(&axis.column).unit.unwrap();
            assert_eq!(
                (read.dimension(), read.factor()),
                (Unit::parse(unit).unwrap().dimension(), 1.0),
                "{unit}"
            );
            assert_eq!(axis.column, format!("x_{ending}"));
        }
    }

    /// As a legend has them: `1e4` of the file and 1000000.0 of its grid are of one form.
    #[test]
    fn numbers_of_an_axis_have_one_form() {
        let grid = "key = \"a.frequency\"\ngrid = { from = \"1e4 Hz\", to = \"1e8 Hz\", points = 3, spacing = \"log\" }";
        let texts = |axis: &StudyAxis| axis.listed().iter().map(AxisValue::text).collect::<Vec<_>>();
        assert_eq!(texts(&axis(grid).unwrap()), ["1e4 Hz", "1e6 Hz", "1e8 Hz"]);
        let listed = axis("key = \"a.b\"\nvalues = [31350, 0.25, 1e-5, 100000.0]").unwrap();
        assert_eq!(texts(&listed), ["31350", "0.25", "1e-5", "1e5"]);
    }

    #[test]
    fn words_and_numbers_can_be_listed() {
        let words = axis("key = \"estimate.first_peak\"\nvalues = [\"positive\", \"negative\"]").unwrap();
        assert_eq!(
            (words.column.as_str(), texts(&words)),
            ("first_peak", vec!["positive".into(), "negative".into()])
        );
        let numbers = axis("key = \"simulate.adc.bits\"\nvalues = [8, 12]").unwrap();
        assert_eq!(numbers.column, "bits_1");
        assert_eq!(numbers.listed()[1].toml, toml::Value::Integer(12));
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (text, at, message) in [
            ("key = \"a..b\"\nvalues = [1]", "key", "is no key"),
            ("key = \"a\"", "", "found none; expected exactly one of: grid, values, normal, uniform"),
            ("key = \"a\"\nvalues = [1]\nuniform = { from = 1, to = 2 }", "", "found 2 (values, uniform)"),
            ("key = \"a\"\nvalues = []", "values", "found no value"),
            ("key = \"a\"\nvalues = [\"1 V\", \"1000 mV\"]", "values", "stands here twice"),
            ("key = \"a\"\nvalues = [\"1 V\", \"2 A\"]", "values", "is not of the same kind as \"1 V\""),
            (
                "key = \"a\"\ngrid = { from = \"1 V\", to = \"2 A\", points = 3 }",
                "grid",
                "is not of the same kind",
            ),
            ("key = \"a\"\ngrid = { from = \"1 V\", to = \"2 V\", points = 1 }", "grid", "are no grid"),
            ("key = \"a\"\ngrid = { from = \"x\", to = \"y\", points = 3 }", "grid", "no number with a unit"),
            (
                "key = \"a\"\ngrid = { from = \"0 V\", to = \"2 V\", points = 3, spacing = \"log\" }",
                "grid",
                "no ratio",
            ),
            ("key = \"a\"\nnormal = { mean = \"1 V\", sd = \"-1 V\" }", "normal", "below 0"),
            ("key = \"a\"\nuniform = { from = \"2 V\", to = \"1 V\" }", "uniform", "is not below"),
            ("key = \"simulate.seed\"\nvalues = [1]", "key", "use `repeats`"),
            ("key = \"recording[0].file\"\nvalues = [\"a\"]", "key", "the files of a study"),
        ] {
            let (key, found) = axis(text).unwrap_err();
            assert!(key == at && found.contains(message), "{text}: {key}: {found}");
        }
    }
}
