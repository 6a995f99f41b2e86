//! Which column of a recording is which channel of a device, by their names and units.

use super::DraftError;
use crate::inspect::InspectedChannel;
use crate::rigs::{Template, TemplateChannel};
use crate::units::Unit;
use serde::Serialize;

/// A column that is a channel of the device, or of a reference.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Assigned {
    /// The channel.
    pub meaning: &'static str,
    /// The column.
    pub column: String,
    /// What its numbers are in, where the name of the column does not say it.
    pub unit: Option<&'static str>,
    /// Why it is this one.
    pub why: &'static str,
    /// Whether it is a reference and no channel of the device.
    pub is_reference: bool,
}

/// A channel whose column is not known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Question {
    /// The channel.
    pub meaning: &'static str,
    /// What it is.
    pub what: &'static str,
    /// The columns that it may be.
    pub candidates: Vec<String>,
}

const STATED: &str = "as stated";
const BY_NAME: &str = "by its name";
const LEFT: &str = "the only column with its unit that is left";

/// Finds the columns of a template's channels: stated ones first, then by their names, then what is left.
pub(super) fn sort(
    columns: &[InspectedChannel],
    template: &Template,
    stated: &[(String, String)],
) -> Result<(Vec<Assigned>, Vec<Question>), DraftError> {
    let wanted: Vec<(&'static TemplateChannel, bool)> = (template.channels.iter().map(|one| (one, false)))
        .chain(template.references.iter().map(|one| (one, true)))
        .collect();
    let mut sorting = Sorting { columns, free: vec![true; columns.len()], assigned: Vec::new() };
    for (meaning, column) in stated {
        let Some(channel) = wanted.iter().find(|(channel, _)| channel.meaning == meaning) else {
            let known = wanted.iter().map(|(channel, _)| channel.meaning).collect();
            return Err(DraftError::Meaning { found: meaning.clone(), known });
        };
        let Some(place) = columns.iter().position(|one| one.column == *column) else {
            let known = columns.iter().map(|one| one.column.clone()).collect();
            return Err(DraftError::Column { meaning: meaning.clone(), found: column.clone(), known });
        };
        sorting.assign(*channel, place, STATED);
    }
    // What the longest word of a name says goes first: `cap_out` is rather a `cap` than an `out`.
    for length in (1..=LONGEST_WORD).rev() {
        for channel in &wanted {
            let by_name = |column: &InspectedChannel| is_named(&column.column, channel.0.words, length);
            if let Some(place) = sorting.only(channel.0, by_name) {
                sorting.assign(*channel, place, BY_NAME);
            }
        }
    }
    let mut questions = Vec::new();
    for channel in wanted.iter().filter(|(channel, _)| channel.needed) {
        if sorting.has(channel.0.meaning) {
            continue;
        }
        let others = wanted.iter().filter(|(other, _)| other.needed && !sorting.has(other.meaning)).count();
        match sorting.only(channel.0, |_| true).filter(|_| others == 1) {
            Some(place) => sorting.assign(*channel, place, LEFT),
            None => questions.push(Question {
                meaning: channel.0.meaning,
                what: channel.0.what,
                candidates: sorting
                    .candidates(channel.0)
                    .map(|place| columns[place].column.clone())
                    .collect(),
            }),
        }
    }
    Ok((sorting.assigned, questions))
}

/// No word of a template is longer.
const LONGEST_WORD: usize = 16;

/// Whether the name of a column has one of these words of this length.
fn is_named(column: &str, words: &[&str], length: usize) -> bool {
    let name = column.to_lowercase();
    words.iter().filter(|word| word.len() == length).any(|word| match word.len() {
        // A letter or two has to stand by itself.
        1 | 2 => name
            .split(|c: char| !c.is_alphanumeric())
            .any(|part| part == *word || part.ends_with(*word) && part.len() > 3),
        _ => name.contains(word),
    })
}

struct Sorting<'a> {
    columns: &'a [InspectedChannel],
    free: Vec<bool>,
    assigned: Vec<Assigned>,
}

impl Sorting<'_> {
    fn has(&self, meaning: &str) -> bool {
        self.assigned.iter().any(|one| one.meaning == meaning)
    }

    /// The free columns whose unit does not speak against a channel.
    fn candidates(&self, channel: &TemplateChannel) -> impl Iterator<Item = usize> {
        let dimension = |unit: &str| Unit::parse(&ascii(unit)).map(|unit| unit.dimension()).ok();
        let wanted = dimension(channel.unit);
        let fits = move |column: &InspectedChannel| {
            column.si_unit.is_empty() || dimension(&column.si_unit) == wanted
        };
        let places = (0..self.columns.len()).filter(|place| self.free[*place]);
        places.filter(move |place| fits(&self.columns[*place]))
    }

    /// The only column that may be this channel and of which this is true.
    fn only(&self, channel: &TemplateChannel, is: impl Fn(&InspectedChannel) -> bool) -> Option<usize> {
        if self.has(channel.meaning) {
            return None;
        }
        let mut places = self.candidates(channel).filter(|place| is(&self.columns[*place]));
        let first = places.next()?;
        places.next().is_none().then_some(first)
    }

    fn assign(&mut self, (channel, is_reference): (&TemplateChannel, bool), place: usize, why: &'static str) {
        self.free[place] = false;
        let column = &self.columns[place];
        let unit = column.si_unit.is_empty().then_some(channel.unit);
        self.assigned.push(Assigned {
            meaning: channel.meaning,
            column: column.column.clone(),
            unit,
            why,
            is_reference,
        });
    }
}

/// A unit as an inspection writes it, as a reader of units takes it.
fn ascii(unit: &str) -> String {
    unit.replace('²', "^2").replace('³', "^3").replace("√Hz", "sqrt(Hz)")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::Statistics;

    fn columns(names: &[(&str, &str)]) -> Vec<InspectedChannel> {
        let statistics = Statistics {
            count: 1,
            missing: 0,
            minimum: None,
            maximum: None,
            mean: None,
            standard_deviation: None,
        };
        let channel = |(name, unit): &(&str, &str)| InspectedChannel {
            column: (*name).to_owned(),
            unit: (*unit).to_owned(),
            si_unit: (*unit).to_owned(),
            statistics: statistics.clone(),
            spectrum: None,
            no_spectrum: None,
        };
        names.iter().map(channel).collect()
    }

    const TEMPLATE: Template = Template {
        text: "",
        channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
        references: &[TemplateChannel::ANGLE, TemplateChannel::RATE],
    };

    fn sorted(
        names: &[(&str, &str)],
        stated: &[(&str, &str)],
    ) -> (Vec<(&'static str, String)>, Vec<Question>) {
        let stated: Vec<(String, String)> =
            stated.iter().map(|(meaning, column)| ((*meaning).to_owned(), (*column).to_owned())).collect();
        let (assigned, questions) = sort(&columns(names), &TEMPLATE, &stated).unwrap();
        (assigned.into_iter().map(|one| (one.meaning, one.column)).collect(), questions)
    }

    #[test]
    fn names_and_units_tell_the_columns() {
        let (assigned, questions) =
            sorted(&[("theta_mrad", "rad"), ("Vdrive_V", "V"), ("CapSense_V", "V")], &[]);
        let expected = [("signal", "CapSense_V"), ("angle", "theta_mrad"), ("drive", "Vdrive_V")]
            .map(|(a, b)| (a, b.to_owned()));
        assert!(expected.iter().all(|one| assigned.contains(one)) && assigned.len() == 3, "{assigned:?}");
        assert!(questions.is_empty());
        // One that is named leaves one for the other.
        let (assigned, questions) = sorted(&[("ch1_V", "V"), ("drive_V", "V")], &[]);
        assert_eq!(assigned, [("drive", "drive_V".to_owned()), ("signal", "ch1_V".to_owned())]);
        assert!(questions.is_empty());
    }

    #[test]
    fn what_names_do_not_tell_is_asked_for() {
        let (assigned, questions) = sorted(&[("ch1_V", "V"), ("ch2_V", "V"), ("laser_m", "m")], &[]);
        assert!(assigned.is_empty());
        let candidates = vec!["ch1_V".to_owned(), "ch2_V".to_owned()];
        assert_eq!(questions.len(), 2);
        assert!(questions.iter().all(|question| question.candidates == candidates), "{questions:?}");
        let (assigned, questions) = sorted(&[("ch1_V", "V"), ("ch2_V", "V")], &[("signal", "ch1_V")]);
        assert_eq!(assigned, [("signal", "ch1_V".to_owned()), ("drive", "ch2_V".to_owned())]);
        assert!(questions.is_empty());
        let (_, questions) = sorted(&[("laser_m", "m")], &[]);
        assert!(questions.iter().all(|question| question.candidates.is_empty()) && questions.len() == 2);
    }

    #[test]
    fn what_is_stated_has_to_be_there() {
        let columns = columns(&[("ch1_V", "V")]);
        let state = |meaning: &str, column: &str| {
            sort(&columns, &TEMPLATE, &[(meaning.to_owned(), column.to_owned())]).unwrap_err().to_string()
        };
        let found = state("sgnal", "ch1_V");
        assert_eq!(found, "found the channel `sgnal`; the device has `drive`, `signal`, `angle` and `rate`");
        let found = state("signal", "ch7_V");
        assert_eq!(
            found,
            "`signal` is assigned to the column `ch7_V`, which does not exist; the recording has `ch1_V`"
        );
    }
}
