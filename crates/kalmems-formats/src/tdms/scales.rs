//! What the properties `NI_Scale[…]` say is to be done to the values of a channel (National Instruments, TDM Streaming
//! in LabVIEW, scaling information).

use crate::clock::{ChannelClock, SampleStep};
use crate::scaling::ScalingStep;
use crate::{Instant, limits, refuse_if};
use std::collections::HashMap;

/// Scales of a channel.
const SCALES: usize = 64;
/// Points of a table and coefficients of a polynomial.
const POINTS: usize = 4096;
/// The input of a scale that is the stored values.
const STORED: f64 = 4_294_967_295.0;

/// A property.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Property {
    Text(String),
    Number(f64),
    Time(Instant),
    Other,
}

/// The properties of an object that are looked at.
#[derive(Clone, Debug, Default)]
pub(super) struct Properties {
    known: HashMap<String, Property>,
    /// Whether one of the clock's was stated since this was last asked for.
    clock_changed: bool,
}

impl Properties {
    /// Keeps what will be asked for.
    pub(super) fn learn(&mut self, name: &str, value: Property) {
        let is_kept = name.starts_with("NI_") || name.starts_with("wf_") || is_unit(name);
        if is_kept && self.known.len() < limits::COLUMNS {
            self.clock_changed |= name.starts_with("wf_");
            self.known.insert(name.to_owned(), value);
        }
    }

    /// What is stated of the times of the samples.
    pub(super) fn clock(&self) -> ChannelClock {
        let start = match self.known.get("wf_start_time") {
            // A waveform without a time of its own begins with 1904.
            Some(Property::Time(time)) if *time > Instant::of_seconds(crate::LABVIEW_ZERO_S) => Some(*time),
            _ => None,
        };
        ChannelClock {
            start,
            offset_s: self.number("wf_start_offset").unwrap_or(0.0),
            step: self.number("wf_increment").map(SampleStep::Interval),
        }
    }

    /// Whether something was stated of the times since this was last asked.
    pub(super) fn take_clock_change(&mut self) -> bool {
        std::mem::take(&mut self.clock_changed)
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        match self.known.get(name)? {
            Property::Number(number) => Some(*number),
            _ => None,
        }
    }

    pub(super) fn text(&self, name: &str) -> Option<&str> {
        match self.known.get(name)? {
            Property::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The unit of the values, as it is written.
    pub(super) fn unit(&self) -> &str {
        let names = ["unit_string", "NI_UnitDescription", "Unit", "unit", "Units", "units"];
        names
            .iter()
            .filter_map(|name| self.text(name))
            .find(|unit| !unit.trim().is_empty())
            .unwrap_or_default()
    }

    /// How many scales there are; none where it says nothing of them.
    fn count(&self) -> Option<usize> {
        if let Some(count) = self.number("NI_Number_Of_Scales") {
            // Beyond the limit all are refused.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // in this range
            return Some(count.clamp(0.0, 1e6) as usize);
        }
        (0..SCALES)
            .filter(|number| self.known.contains_key(&format!("NI_Scale[{number}]_Scale_Type")))
            .max()
            .map(|last| last + 1)
    }

    fn several(&self, name: &str, count: usize) -> Result<Vec<f64>, String> {
        let numbers = (0..count).map(|place| self.number(&format!("{name}[{place}]")));
        numbers
            .collect::<Option<Vec<f64>>>()
            .ok_or_else(|| format!("`{name}` lacks some of its {count} numbers"))
    }

    fn length(&self, name: &str) -> Result<Option<usize>, String> {
        match self.number(name) {
            None => Ok(None),
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // in this range
            Some(length) if (0.0..=POINTS as f64).contains(&length) => Ok(Some(length as usize)),
            Some(length) => Err(format!("`{name}` of {length}; at most {POINTS} is read")),
        }
    }
}

fn is_unit(name: &str) -> bool {
    matches!(name, "unit_string" | "Unit" | "unit" | "Units" | "units")
}

/// What is to be done to the values of a channel: what it says itself, or its group, or the file. None of it where they
/// are scaled already; in words why not, where it cannot be done here.
pub(super) fn steps(objects: [Option<&Properties>; 3]) -> Result<Vec<ScalingStep>, String> {
    let scaled = |properties: &&Properties| properties.text("NI_Scaling_Status") == Some("scaled");
    let said =
        |properties: &&Properties| properties.count().is_some_and(|count| count > 0) && !scaled(properties);
    let Some(properties) = objects.into_iter().flatten().find(said) else { return Ok(Vec::new()) };
    let count = properties.count().unwrap_or(0);
    refuse_if(count > SCALES, || format!("{count} scales; at most {SCALES} are read"))?;
    let mut steps = Vec::new();
    let mut number = (count - 1) as f64;
    // From the last back to the stored values, each at most once.
    for _ in 0..count {
        let prefix = format!("NI_Scale[{number}]");
        let kind = properties
            .text(&format!("{prefix}_Scale_Type"))
            .ok_or_else(|| format!("raw values of DAQmx, by `{prefix}`"))?;
        let own = |name: &str| {
            let name = format!("{prefix}_{kind}_{name}");
            properties.number(&name).ok_or_else(|| format!("`{name}` is not there"))
        };
        match kind {
            "Linear" => {
                steps.push(ScalingStep::Linear { factor: own("Slope")?, offset: own("Y_Intercept")? });
            }
            "Polynomial" => {
                let count =
                    properties.length(&format!("{prefix}_Polynomial_Coefficients_Size"))?.unwrap_or(4);
                let name = format!("{prefix}_Polynomial_Coefficients");
                steps.push(ScalingStep::Polynomial(properties.several(&name, count)?));
            }
            "Table" => steps.push(table(properties, &prefix)?),
            // It says where the values come from and changes nothing.
            "AdvancedAPI" => {}
            kind => return Err(format!("a scale of the type `{kind}`")),
        }
        let input = properties.number(&format!("{prefix}_{kind}_Input_Source")).unwrap_or(STORED);
        if input == STORED {
            steps.reverse();
            return Ok(steps);
        }
        refuse_if(!(0.0..count as f64).contains(&input) || input.fract() != 0.0, || {
            format!("the input {input} of `{prefix}`")
        })?;
        number = input;
    }
    Err("scales that refer to each other".to_owned())
}

fn table(properties: &Properties, prefix: &str) -> Result<ScalingStep, String> {
    let values = |name: &str| {
        let name = format!("{prefix}_Table_{name}");
        let count = properties.length(&format!("{name}_Size"))?.unwrap_or(0);
        properties.several(&name, count)
    };
    let (mut from, mut to) = (values("Pre_Scaled_Values")?, values("Scaled_Values")?);
    refuse_if(from.len() != to.len() || from.is_empty(), || {
        format!("`{prefix}_Table` of {} to {} points", from.len(), to.len())
    })?;
    if from.first() > from.last() {
        from.reverse();
        to.reverse();
    }
    refuse_if(!from.windows(2).all(|pair| pair[0] < pair[1]), || {
        format!("`{prefix}_Table`, whose points neither rise nor fall")
    })?;
    Ok(ScalingStep::Table { from, to })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn properties(pairs: &[(&str, Property)]) -> Properties {
        let mut properties = Properties::default();
        for (name, value) in pairs {
            properties.learn(name, value.clone());
        }
        properties
    }

    #[test]
    fn scales_are_followed_to_the_stored_values() {
        let (number, text) = (Property::Number, |text: &str| Property::Text(text.to_owned()));
        let chain = properties(&[
            ("NI_Number_Of_Scales", number(2.0)),
            ("NI_Scale[0]_Scale_Type", text("Linear")),
            ("NI_Scale[0]_Linear_Slope", number(2.0)),
            ("NI_Scale[0]_Linear_Y_Intercept", number(1.0)),
            ("NI_Scale[0]_Linear_Input_Source", number(STORED)),
            ("NI_Scale[1]_Scale_Type", text("Polynomial")),
            ("NI_Scale[1]_Polynomial_Coefficients_Size", number(2.0)),
            ("NI_Scale[1]_Polynomial_Coefficients[0]", number(0.5)),
            ("NI_Scale[1]_Polynomial_Coefficients[1]", number(3.0)),
            ("NI_Scale[1]_Polynomial_Input_Source", number(0.0)),
        ]);
        let expected =
            vec![ScalingStep::Linear { factor: 2.0, offset: 1.0 }, ScalingStep::Polynomial(vec![0.5, 3.0])];
        assert_eq!(steps([Some(&chain), None, None]), Ok(expected.clone()));
        // Of the group, where the channel says nothing; of no use where the values are scaled already.
        assert_eq!(steps([Some(&Properties::default()), Some(&chain), None]), Ok(expected));
        let mut scaled = chain.clone();
        scaled.learn("NI_Scaling_Status", text("scaled"));
        assert_eq!(steps([Some(&scaled), None, None]), Ok(Vec::new()));
        let mut circle = chain;
        circle.learn("NI_Scale[0]_Linear_Input_Source", number(1.0));
        assert!(steps([Some(&circle), None, None]).unwrap_err().contains("refer to each other"));
    }

    #[test]
    fn scales_that_are_not_read_are_named() {
        let (number, text) = (Property::Number, |text: &str| Property::Text(text.to_owned()));
        for (pairs, words) in [
            (&[("NI_Scale[0]_Scale_Type", text("Thermocouple"))][..], "a scale of the type `Thermocouple`"),
            (&[("NI_Number_Of_Scales", number(1.0))], "raw values of DAQmx"),
            (&[("NI_Number_Of_Scales", number(1e9))], "1000000 scales"),
            (&[("NI_Scale[0]_Scale_Type", text("Linear"))], "`NI_Scale[0]_Linear_Slope` is not there"),
            (
                &[
                    ("NI_Scale[0]_Scale_Type", text("Polynomial")),
                    ("NI_Scale[0]_Polynomial_Coefficients_Size", number(1e9)),
                ],
                "at most 4096",
            ),
            (&[("NI_Scale[0]_Scale_Type", text("Table"))], "of 0 to 0 points"),
        ] {
            let found = steps([Some(&properties(pairs)), None, None]).unwrap_err();
            assert!(found.contains(words), "{found}");
        }
    }
}
