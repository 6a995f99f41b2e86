//! Messages about the identification.

use super::likelihood::unknown;
use super::proposal::DitherProposal;
use super::record::IdentificationRecord;
use super::visibility::{Visibility, chance};
use super::{AccelerometerOutcome, MECHANICS, WORTH_SETTING};
use crate::identify::{Correlated, Identification, Identified, NumberStatus, Undetermined};
use kalmems_core::Scalar;
use kalmems_models::constants::STANDARD_GRAVITY;

/// The unknowns by name and unit.
const NAMES: [(&str, &str); unknown::COUNT] = [
    ("spring k", "N/m"),
    ("damping b", "N s/m"),
    ("mass m", "kg"),
    ("noise variance of a sample", "V^2"),
    ("acceleration, root mean square", "m/s^2"),
    ("acceleration, bandwidth", "Hz"),
];

/// m/s² per mg.
const MG: f64 = 1e-3 * STANDARD_GRAVITY;

/// Fills in parameters, doubts and notes.
pub fn of(
    identification: &mut Identification,
    record: &IdentificationRecord,
    outcome: &AccelerometerOutcome,
) {
    let place = &record.material.name;
    for (index, (name, unit)) in NAMES.into_iter().enumerate() {
        let (value, relative) = (outcome.value(index), outcome.deviation(index));
        // What is not told has no interval; of all others it is the profile's.
        let ends =
            if relative.is_finite() { outcome.ends[index] } else { [f64::NEG_INFINITY, f64::INFINITY] };
        identification.parameters.push(Identified {
            name: name.to_owned(),
            stated: None,
            value,
            standard_error: value * relative,
            interval: ends.map(|end| value * Scalar::exp(end)),
            unit,
            recording: place.clone(),
        });
    }
    undetermined(identification, outcome);
    worst_pair(identification, place, outcome);
    for one in &outcome.visibility {
        say_visibility(identification, place, outcome, one);
    }
    let found = &outcome.found;
    let whiteness = &outcome.whiteness;
    if !whiteness.is_white() {
        identification.warnings.push(format!(
            "{place}: the innovations are not white (Durbin-Watson {:.2}, Ljung-Box p = {:.1e}): the acceleration has \
             another spectrum than the experiment states, or the device has more to it; the standard errors are too small",
            whiteness.durbin_watson, whiteness.probability
        ));
    }
    if !found.is_settled {
        identification.warnings.push(format!(
            "{place}: the search was given up after {} passes while ln p still grew: the recording hardly tells the \
             parameters apart; record with a dither on the feedback, or for longer",
            found.passes
        ));
    }
    // tr(M·C): what the errors of the parameters move the acceleration by.
    let square: f64 = (0..unknown::COUNT)
        .flat_map(|i| (0..unknown::COUNT).map(move |j| (i, j)))
        .map(|(i, j)| found.moves.get(i, j) * found.covariance.get(i, j))
        .sum();
    identification.notes.push(format!(
        "{place}: the standard errors found move the acceleration by {}{:.2} mg rms, beside the {:.2} mg that the filter \
         claims",
        if found.at_bound.contains(&true) { "more than " } else { "" },
        square.sqrt() / MG,
        found.claimed / MG
    ));
    identification.notes.push(format!(
        "{place}: ln p rose by {:.1} over {} samples, in {} passes",
        found.log_likelihood - found.at_start,
        found.samples,
        found.passes
    ));
    identification
        .notes
        .extend(record.material.diagnosis.iter().map(|finding| format!("{place}: {finding}")));
}

/// The recording that would determine what this one does not.
pub fn proposed(there: &DitherProposal, outcome: &AccelerometerOutcome) -> String {
    let untold = MECHANICS.iter().zip(there.deviations).filter(|((_, place), _)| !outcome.is_known(*place));
    let each =
        untold.map(|((_, place), deviation)| format!("{} to {:.2} %", NAMES[*place].0, 100.0 * deviation));
    format!(
        "another recording would determine {} ({}); as a table, to be tried with `kalmems simulate`:\n\n{}",
        each.collect::<Vec<_>>().join(", "),
        there.what,
        there.simulate.trim_end()
    )
}

/// What tells the mechanics whatever the acceleration is.
const HELP: &str = "record with a dither on the feedback, or for longer";

fn undetermined(identification: &mut Identification, outcome: &AccelerometerOutcome) {
    let mut add = |what: &str, why: String| {
        identification.undetermined.push(Undetermined { what: what.to_owned(), why });
    };
    add(
        "gains of readout and feedback",
        "they are those of the plates, the carrier, the bias and C4 in the experiment: where one of them is off by 1 %, \
         damping, mass and what the plates leave of the spring are off by as much"
            .to_owned(),
    );
    for (index, (name, _)) in NAMES.into_iter().enumerate() {
        let why = match outcome.standings[index] {
            NumberStatus::Determined => continue,
            NumberStatus::DependsOn(other) => format!(
                "it depends on the {}, which the recording does not determine: both keep the values of the experiment, since a change of one of them \
                 alone would be wrong; {HELP}",
                NAMES[other].0
            ),
            NumberStatus::Undetermined if outcome.found.at_bound[index] => format!(
                "its likelihood grows beyond a quarter or four times of what the experiment says, which keeps its value; {HELP}"
            ),
            NumberStatus::Undetermined => format!(
                "its standard error is {:.0} % of it; above {:.0} % the experiment keeps the value that it had; {HELP}",
                100.0 * outcome.deviation(index),
                100.0 * WORTH_SETTING
            ),
        };
        add(name, why);
    }
}

fn worst_pair(identification: &mut Identification, place: &str, outcome: &AccelerometerOutcome) {
    let pairs = (0..unknown::COUNT).flat_map(|i| (0..i).map(move |j| (j, i)));
    let worst = pairs
        .map(|(i, j)| (outcome.found.correlation(i, j), [i, j]))
        .filter(|(correlation, _)| correlation.is_finite())
        .max_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
    if let Some((correlation, pair)) = worst {
        let names = pair.map(|index| NAMES[index].0.to_owned());
        identification.worst_pairs.push(Correlated { names, correlation, recording: place.to_owned() });
    }
}

/// Standard errors that an error must be beyond to be told from none.
const CERTAIN: f64 = 3.0;

/// Whether the innovations would have shown an error of one parameter that the acceleration suffers from.
fn say_visibility(
    identification: &mut Identification,
    place: &str,
    outcome: &AccelerometerOutcome,
    one: &Visibility,
) {
    let (name, claimed) = (NAMES[one.parameter].0, outcome.found.claimed);
    let samples = outcome.found.samples;
    let band = 1.96 * chance(samples);
    if let Some(hidden) = one.worst_hidden(samples) {
        let deviation = outcome.deviation(one.parameter);
        let mut text = format!(
            "{place}: {name}: {:+.0} % of error would move the acceleration by {:.1} mg rms, {:.1} times what the filter \
             claims, and the mean NIS to {:.4}, within the ±{band:.4} of chance: the innovations' size does not show it",
            100.0 * (hidden.factor - 1.0),
            hidden.moved / MG,
            hidden.moved / claimed,
            hidden.mean_nis
        );
        // Likelihood sees the correlation with the feedback, which the size does not.
        if CERTAIN * deviation < (hidden.factor - 1.0).abs() {
            text += &format!("; their likelihood does, to ±{:.1} %", 100.0 * deviation);
            identification.notes.push(text);
        } else if hidden.moved > claimed {
            text += ", nor does their likelihood: record with a dither on the feedback";
            identification.warnings.push(text);
        } else {
            identification.notes.push(text);
        }
        return;
    }
    let [first, .., last] = one.shifted.as_slice() else { return };
    identification.notes.push(format!(
        "{place}: {name}: {:+.0} % and {:+.0} % of error would move the acceleration by {:.1} and {:.1} mg rms, and the \
         mean NIS to {:.3} and {:.3}, outside the ±{band:.4} of chance: the innovations show it",
        100.0 * (first.factor - 1.0),
        100.0 * (last.factor - 1.0),
        first.moved / MG,
        last.moved / MG,
        first.mean_nis,
        last.mean_nis
    ));
}
