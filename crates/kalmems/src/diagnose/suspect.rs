//! What may be wrong: numbers of the device table, and what was recorded.

use super::bench::TrialBench;
use super::change::{ChannelAlteration, TrialChange};
use super::input_fault::of_wiring;
use super::noise::square;
use crate::config::{Experiment, Key, KeyStep, written};
use crate::rigs::{OmittedNumber, RecordingChannels, Rig};
use crate::units::Value as Quantity;
use kalmems_core::{Portable, Scalar};
use kalmems_figures::significant;
use toml::{Table, Value};

/// Something that may be wrong by a size, 0 if it is right.
#[derive(Clone, Debug)]
pub(super) struct Suspect {
    pub(super) what: NumberRole,
    /// The sizes that are tried first, on both sides where it has two.
    pub(super) sizes: Vec<f64>,
}

/// What it is, and what its size means.
#[derive(Clone, Debug)]
pub(super) enum NumberRole {
    /// Numbers of the experiment that are wrong by the same factor, e to the size.
    Factor(Vec<WrittenNumber>),
    /// The noise of a measurement of equations, which is written as a variance in the square of this unit, is wrong by a factor, e to the
    /// size.
    Noise { key: Key, variance: f64, unit: String },
    /// A noise that equations have as a number with its unit, `4e-6[V^2]`, is wrong by a factor, e to the size.
    Literal { key: Key, value: f64, unit: String },
    /// A number that the device table leaves out, or has as zero: the size, in steps.
    LeftOut { key: Key, left_out: OmittedNumber },
    /// The column of an input is wrong by a factor, e to the size.
    InputScale { meaning: String },
    /// The column of an input is early, by the size in samples.
    InputEarly { meaning: String },
    /// What the signal's column shows without motion is wrong, by the size in standard deviations of its noise.
    Offset { meaning: String, sd: f64 },
    /// Numbers or the column of an input are wrong by this factor, as of a unit that was mistaken, and by e to the size.
    Slip { of: Box<NumberRole>, factor: f64, words: &'static str },
    /// Something is so or is not, and has no size.
    Choice { changes: Vec<TrialChange>, words: String },
}

/// A number in an experiment.
#[derive(Clone, Debug)]
pub(super) struct WrittenNumber {
    pub(super) key: Key,
    /// As it is written.
    pub(super) written: f64,
    /// The unit behind it; empty of a plain ratio.
    pub(super) unit: String,
}

impl WrittenNumber {
    /// That which a key has, as text with a unit or as a plain number; `None` of zero, which no factor changes.
    pub(super) fn of(key: &Key, value: &Value) -> Option<Self> {
        let mut found = Vec::new();
        collect(value, key, &mut found);
        found.pop().filter(|number| number.key == *key)
    }

    /// What is to stand there for so many times the number.
    pub(super) fn times(&self, factor: f64) -> Value {
        written(self.written * factor, &self.unit)
    }
}

/// How far beyond the first sizes that are tried a search may go.
const BEYOND: f64 = 3.0;

/// Relative sizes by which a number of a device may be wrong.
const FACTORS: [f64; 6] = [1e-4, 1e-3, 5e-3, 2e-2, 8e-2, 0.3];

/// Those of a noise, which is seldom known well.
const NOISE_FACTORS: [f64; 4] = [0.1, 0.7, 2.3, 4.7];

/// Factors of mistaken units and signs, and what they are of.
const SLIPS: [(f64, &str); 15] = [
    (-1.0, "with the opposite sign"),
    (1e-3, "with a prefix of its unit mistaken"),
    (1e3, "with a prefix of its unit mistaken"),
    (1e-6, "with a prefix of its unit mistaken"),
    (1e6, "with a prefix of its unit mistaken"),
    (0.1, "with a power of ten mistaken"),
    (10.0, "with a power of ten mistaken"),
    (1e-2, "in per cent"),
    (1e2, "as a part of one for per cent"),
    (std::f64::consts::TAU, "in cycles for radians"),
    (1.0 / std::f64::consts::TAU, "in radians for cycles"),
    (std::f64::consts::TAU * std::f64::consts::TAU, "in squared cycles for radians"),
    (180.0 / std::f64::consts::PI, "in radians for degrees"),
    (std::f64::consts::PI / 180.0, "in degrees for radians"),
    (9.806_65, "in units of standard gravity"),
];

/// Samples by which a drive may be early or late.
const SAMPLES: [f64; 5] = [0.1, 0.5, 2.0, 8.0, 32.0];

/// Steps of what has no size of its own.
const STEPS: [f64; 5] = [1.0, 4.0, 16.0, 64.0, 256.0];

impl Suspect {
    /// All that may be wrong of a device, by its table and its channels; `noise_sd` is that of a sample of the signal.
    pub(super) fn all(rig: &dyn Rig, experiment: &Experiment, document: &Table, noise_sd: f64) -> Vec<Self> {
        let device = Key::from("device").child(experiment.device_name());
        let mut numbers = Vec::new();
        if let Some(table) = document.get("device").and_then(|d| d.get(experiment.device_name())) {
            collect(table, &device, &mut numbers);
        }
        let left_out = rig.left_out(experiment);
        let is_there = |left: &OmittedNumber| {
            numbers.iter().any(|number: &WrittenNumber| number.key == left.key(&device))
        };
        let mut suspects: Vec<Self> = left_out
            .iter()
            .filter(|left| !is_there(left))
            .map(|left| {
                let what = NumberRole::LeftOut { key: left.key(&device), left_out: *left };
                Self { what, sizes: sides(&STEPS, !left.is_never_negative) }
            })
            .collect();
        let siblings = siblings(&numbers);
        let has_offset = numbers.iter().any(|number| number.key.last() == "offset")
            || left_out.iter().any(|left| left.key.ends_with("offset"));
        let each = siblings.into_iter().chain(numbers.into_iter().map(|number| vec![number]));
        suspects.extend(each.map(|numbers| {
            let mut suspect = Self { what: NumberRole::Factor(numbers), sizes: sides(&FACTORS, true) };
            if suspect.is_noise_in(document) {
                suspect.sizes = sides(&NOISE_FACTORS, true);
            }
            suspect
        }));
        if let Some(noises) =
            equations_of(document).and_then(|equations| equations.get("noise")).and_then(Value::as_table)
        {
            let key = Key::from("device.equations.noise");
            let literals =
                noises.iter().filter_map(|(name, value)| literal(key.clone().child(name), value.as_str()?));
            suspects.extend(literals.map(|what| Self { what, sizes: sides(&NOISE_FACTORS, true) }));
        }
        suspects.extend(of_channels(&rig.channels(experiment), noise_sd, has_offset));
        suspects
    }

    /// Mistaken units and signs of these, but for noises, whose sizes go as far.
    pub(super) fn slips(all: &[Self], document: &Table) -> Vec<Self> {
        let may = |suspect: &&Self| suspect.is_factor() && !suspect.is_noise_in(document);
        let of = |suspect: &Self| {
            let what = suspect.what.clone();
            SLIPS.map(|(factor, words)| {
                let what = NumberRole::Slip { of: Box::new(what.clone()), factor, words };
                Self { what, sizes: sides(&FACTORS, true) }
            })
        };
        all.iter().filter(may).flat_map(of).collect()
    }

    /// What else is tried where no number of these explains a recording: another interpolation of an input, and signals that are inverted or
    /// exchanged.
    pub(super) fn further(rig: &dyn Rig, bench: &TrialBench) -> Vec<Self> {
        let (experiment, document) = (&bench.experiment, &bench.document);
        let choice = |changes, words| Self { what: NumberRole::Choice { changes, words }, sizes: Vec::new() };
        let mut choices = Vec::new();
        if let Some(equations) = equations_of(document).filter(|equations| equations.contains_key("inputs")) {
            let key = Key::from("device.equations.interpolation");
            let stated = equations.get("interpolation").and_then(Value::as_str);
            let others = ["hold", "linear"].into_iter().filter(|word| stated != Some(word));
            choices.extend(others.map(|word| {
                let change = TrialChange::Key(key.clone(), Value::String(word.to_owned()));
                choice(vec![change], format!("the input between samples, which is `{word}`"))
            }));
        }
        // The sign of an input is one of its scale.
        let RecordingChannels { signals, .. } = rig.channels(experiment);
        let wiring = of_wiring(bench, &RecordingChannels { inputs: Vec::new(), signals });
        choices.extend(wiring.into_iter().map(|fault| choice(fault.changes, fault.words)));
        choices
    }

    /// What a size changes; `None` of one that there cannot be.
    pub(super) fn changes(&self, size: f64) -> Option<Vec<TrialChange>> {
        let channel = |meaning: &str, how| vec![TrialChange::Channel { meaning: meaning.to_owned(), how }];
        let times = |what: &NumberRole, factor: f64| match what {
            NumberRole::Factor(numbers) => {
                numbers.iter().map(|n| TrialChange::Key(n.key.clone(), n.times(factor))).collect()
            }
            NumberRole::InputScale { meaning } => channel(meaning, ChannelAlteration::Scaled(factor)),
            _ => Vec::new(),
        };
        Some(match &self.what {
            NumberRole::Slip { of, factor, .. } => times(of, factor * Scalar::exp(size)),
            NumberRole::Choice { changes, .. } => changes.clone(),
            _ if size == 0.0 => Vec::new(),
            NumberRole::Factor(_) | NumberRole::InputScale { .. } => times(&self.what, Scalar::exp(size)),
            NumberRole::Noise { key, variance, unit } => {
                let written = square(variance * Scalar::exp(size), unit);
                vec![TrialChange::Key(key.clone(), Value::String(written))]
            }
            NumberRole::Literal { key, value, unit } => {
                let written = format!("{:e}[{unit}]", value * Scalar::exp(size));
                vec![TrialChange::Key(key.clone(), Value::String(written))]
            }
            NumberRole::LeftOut { key, left_out } => {
                if size < 0.0 && left_out.is_never_negative {
                    return None;
                }
                let mut changes = vec![TrialChange::Key(key.clone(), left_out.value(size))];
                if let Some(switch) = left_out.filter_switch {
                    let filter = Key::from("estimate").child("filter").index(0).child(switch);
                    changes.push(TrialChange::Key(filter, Value::Boolean(true)));
                }
                changes
            }
            NumberRole::InputEarly { meaning } => channel(meaning, ChannelAlteration::Later(size)),
            NumberRole::Offset { meaning, sd } => channel(meaning, ChannelAlteration::Raised(size * sd)),
        })
    }

    /// Whether it is wrong by a factor.
    pub(super) const fn is_factor(&self) -> bool {
        matches!(self.what, NumberRole::Factor(_) | NumberRole::InputScale { .. })
    }

    /// Whether it is the noise of a measurement: what changes the gain of the filter and no prediction of a motion that is known.
    pub(super) fn is_noise(&self) -> bool {
        match &self.what {
            NumberRole::Noise { .. } | NumberRole::Literal { .. } => true,
            NumberRole::Factor(numbers) => {
                numbers.iter().all(|number| number.key.last().starts_with("noise"))
            }
            _ => false,
        }
    }

    /// The same by where it enters the equations of a document, whatever it is called.
    pub(super) fn is_noise_in(&self, document: &Table) -> bool {
        let by_place =
            |numbers: &[WrittenNumber]| numbers.iter().all(|number| is_of_noise_alone(number, document));
        self.is_noise() || matches!(&self.what, NumberRole::Factor(numbers) if by_place(numbers))
    }

    /// Whether it is a mistaken unit or sign.
    pub(super) const fn is_slip(&self) -> bool {
        matches!(self.what, NumberRole::Slip { .. })
    }

    /// Whether it is so or is not, without a size.
    pub(super) const fn is_choice(&self) -> bool {
        matches!(self.what, NumberRole::Choice { .. })
    }

    /// Whether it is a choice of the wiring, which any part of a recording shows.
    pub(super) fn is_wiring(&self) -> bool {
        let is_of_channels = |change: &TrialChange| !matches!(change, TrialChange::Key(..));
        matches!(&self.what, NumberRole::Choice { changes, .. } if changes.iter().all(is_of_channels))
    }

    /// Whether it is tried where no number explains a recording.
    pub(super) const fn is_further(&self) -> bool {
        self.is_slip() || self.is_choice()
    }

    /// A first step: half of the smallest size that is tried.
    pub(super) fn step(&self) -> f64 {
        0.5 * self.sizes.iter().fold(f64::INFINITY, |least, size| least.min(size.abs()))
    }

    /// The largest size that a search tries, in the direction of either sign.
    pub(super) fn furthest(&self) -> f64 {
        BEYOND * self.sizes.iter().fold(0.0_f64, |largest, size| largest.max(size.abs()))
    }

    /// A size in words, with its unit.
    pub(super) fn size_in_words(&self, size: f64) -> String {
        match &self.what {
            NumberRole::Choice { .. } => String::new(),
            NumberRole::Slip { factor, .. } => format!("times {}", significant(factor * Scalar::exp(size))),
            NumberRole::Factor(_)
            | NumberRole::Noise { .. }
            | NumberRole::Literal { .. }
            | NumberRole::InputScale { .. } => {
                format!("{} %", significant(100.0 * size.portable_exp_m1()))
            }
            NumberRole::LeftOut { left_out, .. } => {
                format!("{} {}", significant(size * left_out.step), left_out.unit).trim_end().to_owned()
            }
            NumberRole::InputEarly { .. } => format!("{} samples earlier", significant(size)),
            NumberRole::Offset { sd, .. } => format!("{} V", significant(size * sd)),
        }
    }

    /// What it is called: keys as the experiment has them, below the device's table.
    pub(super) fn name(&self) -> String {
        Self::name_of(&self.what)
    }

    fn name_of(what: &NumberRole) -> String {
        match what {
            NumberRole::Choice { words, .. } => words.clone(),
            NumberRole::Slip { of, words, .. } => format!("{}, {words}", Self::name_of(of)),
            NumberRole::Factor(numbers) => match numbers.as_slice() {
                [one] => below_device(&one.key),
                all => format!("{} of all {}", all[0].key.last(), all.len()),
            },
            NumberRole::Noise { key, .. }
            | NumberRole::Literal { key, .. }
            | NumberRole::LeftOut { key, .. } => below_device(key),
            NumberRole::InputScale { meaning } => format!("the scale of the {meaning}'s column"),
            NumberRole::InputEarly { meaning } => format!("the time of the {meaning}'s column"),
            NumberRole::Offset { meaning, .. } => format!("the offset of the {meaning}'s column"),
        }
    }
}

/// Whether a parameter of equations enters the table of noises and no other expression, whatever it is called.
fn is_of_noise_alone(number: &WrittenNumber, document: &Table) -> bool {
    let Some(equations) = equations_of(document) else { return false };
    let of_parameters = Key::from("device.equations.parameters").child(number.key.last());
    let names = |value: &Value| expressions_with(value, number.key.last());
    let others = equations.iter().filter(|(table, _)| !matches!(table.as_str(), "noise" | "parameters"));
    number.key == of_parameters
        && equations.get("noise").is_some_and(names)
        && !others.into_iter().any(|(_, value)| names(value))
        // A parameter may stand for others by an expression of its own.
        && !equations.get("parameters").is_some_and(names)
}

/// The equations of a device of one's own.
pub(super) fn equations_of(document: &Table) -> Option<&Table> {
    document.get("device")?.get("equations")?.as_table()
}

/// A noise that is written as a number with its unit, such as `4e-6[V^2]`.
fn literal(key: Key, text: &str) -> Option<NumberRole> {
    let (number, unit) = text.trim().strip_suffix(']')?.split_once('[')?;
    let value: f64 = number.trim().parse().ok().filter(|value| *value > 0.0)?;
    (!unit.contains(['[', ']'])).then(|| NumberRole::Literal { key, value, unit: unit.trim().to_owned() })
}

/// Whether a text of a table has this name as a word.
pub(super) fn expressions_with(value: &Value, name: &str) -> bool {
    match value {
        Value::String(text) => {
            text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name)
        }
        Value::Table(table) => table.values().any(|value| expressions_with(value, name)),
        Value::Array(list) => list.iter().any(|value| expressions_with(value, name)),
        _ => false,
    }
}

/// A key without the way to the device's table, or to that of the estimate.
pub(super) fn below_device(key: &Key) -> String {
    let of_estimate = key.steps().first() == Some(&KeyStep::Name("estimate".to_owned()));
    let steps = key.steps().iter().skip(if of_estimate { 1 } else { 2 });
    steps
        .fold(Key::default(), |key, step| match step {
            KeyStep::Name(name) => key.child(name),
            KeyStep::Index(index) => key.index(*index),
        })
        .to_string()
}

fn of_channels(
    RecordingChannels { inputs, signals }: &RecordingChannels,
    noise_sd: f64,
    has_offset: bool,
) -> Vec<Suspect> {
    let of_input = |meaning: &String| {
        let meaning = || meaning.clone();
        [
            Suspect { what: NumberRole::InputScale { meaning: meaning() }, sizes: sides(&FACTORS, true) },
            Suspect { what: NumberRole::InputEarly { meaning: meaning() }, sizes: sides(&SAMPLES, true) },
        ]
    };
    let of_signal = |meaning: &String| {
        let what = NumberRole::Offset { meaning: meaning.clone(), sd: 0.1 * noise_sd };
        Suspect { what, sizes: sides(&STEPS, true) }
    };
    let offsets = signals.iter().filter(|_| !has_offset).map(of_signal);
    inputs.iter().flat_map(of_input).chain(offsets).collect()
}

/// Sizes on one side or on both.
fn sides(sizes: &[f64], both: bool) -> Vec<f64> {
    sizes.iter().flat_map(|size| [Some(*size), both.then_some(-size)]).flatten().collect()
}

/// The numbers of a table, but for those that are zero, which no factor changes.
fn collect(value: &Value, key: &Key, numbers: &mut Vec<WrittenNumber>) {
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(name, value)| collect(value, &key.clone().child(name), numbers));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, value)| collect(value, &key.clone().index(i), numbers));
        }
        Value::String(text) => {
            if let Ok(quantity) = Quantity::parse(text)
                && quantity.si() != 0.0
                && let (number, unit) = quantity.parts()
                && let Ok(written) = number.parse()
            {
                numbers.push(WrittenNumber { key: key.clone(), written, unit: unit.to_owned() });
            }
        }
        Value::Float(number) if *number != 0.0 => {
            numbers.push(WrittenNumber { key: key.clone(), written: *number, unit: String::new() });
        }
        _ => {}
    }
}

/// Numbers of the same name in tables beside one another that have the same names in them, as those of several electrodes do.
fn siblings(numbers: &[WrittenNumber]) -> Vec<Vec<WrittenNumber>> {
    let table = |number: &WrittenNumber| number.key.steps().split_last().map(|(_, table)| table.to_vec());
    let names = |table: &[KeyStep]| -> Vec<&str> {
        let inside =
            numbers.iter().filter(|number| number.key.steps().split_last().is_some_and(|(_, t)| t == table));
        inside.map(|number| number.key.last()).collect()
    };
    let mut families: Vec<Vec<WrittenNumber>> = Vec::new();
    for number in numbers {
        let Some(own) = table(number) else { continue };
        let is_sibling = |members: &&mut Vec<WrittenNumber>| {
            let Some(other) = members.first().and_then(table) else { return false };
            members[0].key.last() == number.key.last()
                && own.split_last().map(|(_, parent)| parent) == other.split_last().map(|(_, parent)| parent)
                && names(&own) == names(&other)
        };
        match families.iter_mut().find(is_sibling) {
            Some(members) => members.push(number.clone()),
            None => families.push(vec![number.clone()]),
        }
    }
    families.retain(|members| members.len() > 1);
    families
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<WrittenNumber> {
        let mut numbers = Vec::new();
        collect(&Value::Table(text.parse().unwrap()), &Key::from("device.stage"), &mut numbers);
        numbers
    }

    #[test]
    fn numbers_with_and_without_units_are_found_and_changed() {
        let numbers =
            numbers("a = \"2.5 kHz\"\nb = 0.25\nc = \"0 V\"\nd = \"logistic\"\ne = [\"1 pF\", \"2 pF\"]");
        let keys: Vec<String> = numbers.iter().map(|number| number.key.to_string()).collect();
        assert_eq!(keys, ["device.stage.a", "device.stage.b", "device.stage.e[0]", "device.stage.e[1]"]);
        assert_eq!(numbers[0].times(2.0), Value::String("5e0 kHz".to_owned()));
        assert_eq!(numbers[1].times(2.0), Value::Float(0.5));
    }

    #[test]
    fn a_number_is_a_noise_by_where_it_enters_and_not_by_its_name() {
        let text = "[device.equations]\nderivative = { x = \"-noisy*x\" }\nnoise = { signal = \"n*(1 + noisy)\" }\n\
                    [device.equations.parameters]\nn = \"2 V^2\"\nnoisy = \"3 1/s\"\n";
        let document: Table = text.parse().unwrap();
        let mut found = Vec::new();
        collect(&document["device"], &Key::from("device"), &mut found);
        let of = |name: &str| {
            is_of_noise_alone(found.iter().find(|one| one.key.last() == name).unwrap(), &document)
        };
        assert!(of("n") && !of("noisy"));
    }

    #[test]
    fn only_tables_that_are_alike_have_numbers_in_common() {
        let numbers = numbers(
            "[electrodes.A]\ngap = \"2 um\"\ngain = 3.0\n[electrodes.B]\ngap = \"3 um\"\ngain = 4.0\n[electrodes.C]\ngain = 5.0",
        );
        let families = siblings(&numbers);
        let named: Vec<(&str, usize)> = families.iter().map(|f| (f[0].key.last(), f.len())).collect();
        assert_eq!(named, [("gap", 2), ("gain", 2)]);
    }
}
