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
    /// The recording, by the name of its file.
    pub file: String,
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

/// The channels of a template, and whether each is a reference.
fn channels_of(template: &Template) -> Vec<(&'static TemplateChannel, bool)> {
    let channels = template.channels.iter().map(|one| (one, false));
    channels.chain(template.references.iter().map(|one| (one, true))).collect()
}

/// Whether each stated channel is one of the template, and each stated column is in one of the recordings.
pub(super) fn check(
    stated: &[(String, String)],
    template: &Template,
    recordings: &[&[InspectedChannel]],
) -> Result<(), DraftError> {
    let wanted = channels_of(template);
    for (meaning, column) in stated {
        if wanted.iter().all(|(channel, _)| channel.meaning != meaning) {
            let known = wanted.iter().map(|(channel, _)| channel.meaning).collect();
            return Err(DraftError::Meaning { found: meaning.clone(), known });
        }
        let mut columns = recordings.iter().flat_map(|columns| columns.iter());
        if columns.all(|one| one.column != *column) {
            let mut known: Vec<String> = Vec::new();
            for one in recordings.iter().flat_map(|columns| columns.iter()) {
                if !known.contains(&one.column) {
                    known.push(one.column.clone());
                }
            }
            return Err(DraftError::Column { meaning: meaning.clone(), found: column.clone(), known });
        }
    }
    Ok(())
}

/// Finds the columns of a template's channels: stated ones first, then by their names, then what is left. Of a channel that is stated several
/// times the first column counts that is there, as recordings of a device may have other names for it. `needs` is whether a recording of this
/// kind needs a channel that an estimate needs.
pub(super) fn sort(
    file: &str,
    columns: &[InspectedChannel],
    template: &Template,
    stated: &[(String, String)],
    needs: impl Fn(&TemplateChannel) -> bool,
) -> (Vec<Assigned>, Vec<Question>) {
    let wanted = channels_of(template);
    let mut sorting = Sorting { columns, free: vec![true; columns.len()], assigned: Vec::new() };
    for (meaning, column) in stated {
        let channel = wanted.iter().find(|(channel, _)| channel.meaning == meaning);
        let place = columns.iter().position(|one| one.column == *column);
        if let (Some(channel), Some(place), false) = (channel, place, sorting.has(meaning)) {
            sorting.assign(*channel, place, STATED);
        }
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
    let is_needed = |channel: &TemplateChannel| channel.needed && needs(channel);
    for channel in wanted.iter().filter(|(channel, _)| is_needed(channel)) {
        if sorting.has(channel.0.meaning) {
            continue;
        }
        let others =
            wanted.iter().filter(|(other, _)| is_needed(other) && !sorting.has(other.meaning)).count();
        match sorting.only(channel.0, |_| true).filter(|_| others == 1) {
            Some(place) => sorting.assign(*channel, place, LEFT),
            None => questions.push(Question {
                file: file.to_owned(),
                meaning: channel.0.meaning,
                what: channel.0.what,
                candidates: sorting
                    .candidates(channel.0)
                    .map(|place| columns[place].column.clone())
                    .collect(),
            }),
        }
    }
    (sorting.assigned, questions)
}

/// No word of a template is longer.
pub(super) const LONGEST_WORD: usize = 16;

/// Whether the name of a column has one of these words of this length.
pub(super) fn is_named(column: &str, words: &[&str], length: usize) -> bool {
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
        let places = (0..self.columns.len()).filter(|place| self.free[*place]);
        places.filter(move |place| unit_fits(&self.columns[*place], channel))
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

/// Whether the unit of a column does not speak against a channel.
pub(super) fn unit_fits(column: &InspectedChannel, channel: &TemplateChannel) -> bool {
    let dimension = |unit: &str| Unit::parse(&ascii(unit)).map(|unit| unit.dimension()).ok();
    column.si_unit.is_empty() || dimension(&column.si_unit) == dimension(channel.unit)
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
            course: crate::inspect::ChannelCourse::default(),
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
        let (assigned, questions) = sort("scope.csv", &columns(names), &TEMPLATE, &stated, |_| true);
        (assigned.into_iter().map(|one| (one.meaning, one.column)).collect(), questions)
    }

    #[test]
    fn columns_are_recognised_by_names_and_units() {
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
    fn a_channel_that_no_name_identifies_is_asked_for() {
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
    fn a_stated_channel_or_column_that_does_not_exist_is_refused() {
        let columns = columns(&[("ch1_V", "V")]);
        let state = |meaning: &str, column: &str| {
            check(&[(meaning.to_owned(), column.to_owned())], &TEMPLATE, &[&columns]).unwrap_err().to_string()
        };
        let found = state("sgnal", "ch1_V");
        assert_eq!(found, "found the channel `sgnal`; the device has `drive`, `signal`, `angle` and `rate`");
        let found = state("signal", "ch7_V");
        assert_eq!(
            found,
            "`signal` is assigned to the column `ch7_V`, which does not exist; the recording has `ch1_V`"
        );
    }

    #[test]
    fn a_recording_without_a_drive_needs_none_and_of_several_stated_columns_the_first_that_exists_counts() {
        let columns = columns(&[("vo1_V", "V")]);
        let (assigned, questions) =
            sort("decay.csv", &columns, &TEMPLATE, &[], |channel| channel.meaning != "drive");
        assert_eq!((assigned.len(), assigned[0].meaning, questions.len()), (1, "signal", 0));
        let stated = [("drive", "CH1_V"), ("drive", "vo1_V")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        let (assigned, questions) = sort("decay.csv", &columns, &TEMPLATE, &stated, |_| true);
        assert_eq!((assigned[0].meaning, &*assigned[0].column, assigned[0].why), ("drive", "vo1_V", STATED));
        assert_eq!((questions[0].meaning, questions[0].candidates.len()), ("signal", 0));
    }
}
