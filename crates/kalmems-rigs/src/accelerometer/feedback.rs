//! Whether the feedback that was recorded is the one that moved the mass, told from the recording alone.

use super::data::SegmentData;
use super::instrument::Instrument;
use crate::estimate::EstimateError;
use kalmems_core::FixedGain;
use kalmems_models::dynamics::SensedAcceleration;

/// A way in which a recorded feedback may be wrong.
struct Suspicion {
    /// What would be right.
    found: &'static str,
    sign: f64,
    /// The recorded value that was applied from sample k on is that of k + `shift`.
    shift: isize,
}

/// As it should be, and what is known to happen.
const SUSPICIONS: [Suspicion; 4] = [
    Suspicion { found: "", sign: 1.0, shift: 0 },
    Suspicion { found: "the opposite sign", sign: -1.0, shift: 0 },
    Suspicion { found: "its values one sample earlier: they were recorded late", sign: 1.0, shift: 1 },
    Suspicion { found: "its values one sample later: they were recorded early", sign: 1.0, shift: -1 },
];

/// By how much a suspicion must be more likely, in nats, before it is told.
const CERTAIN: f64 = 50.0;

/// Refuses a feedback under which the signal is far less likely than under one that is wrong in a known way.
///
/// Each is followed by the settled gain of the model at rest. Where there is no such gain nothing is said; the filters
/// will.
pub fn require_right(
    instrument: &Instrument<SensedAcceleration<f64>, 4>,
    data: &SegmentData,
    column: &str,
    place: &str,
) -> Result<(), EstimateError> {
    let Some(feedback) = data.feedback else { return Ok(()) };
    let point = instrument.at_rest(data.interval_s);
    let Ok(settled) = FixedGain::steady_state([0.0; 4], &point) else { return Ok(()) };
    let process = instrument.over(data.interval_s);
    let likelihood = |suspicion: &Suspicion| {
        let mut filter = settled;
        let mut total = 0.0;
        for (k, y) in data.signal.iter().enumerate() {
            if k > 0 {
                let applied = (k - 1).checked_add_signed(suspicion.shift).and_then(|k| feedback.get(k));
                let volts = suspicion.sign * applied.copied().unwrap_or(feedback[k - 1]);
                filter.predict(&process, &volts).ok()?;
            }
            if y.is_finite() {
                total += filter.update(&instrument.readout, &[*y]).ok()?.log_likelihood();
            }
        }
        Some(total)
    };
    let as_recorded = likelihood(&SUSPICIONS[0]).unwrap_or(f64::NEG_INFINITY);
    let others = SUSPICIONS[1..].iter().filter_map(|other| Some((likelihood(other)? - as_recorded, other)));
    let best = others.max_by(|(a, _), (b, _)| a.total_cmp(b));
    match best {
        Some((gain, suspicion)) if gain > CERTAIN => Err(EstimateError::FeedbackMismatch {
            place: place.to_owned(),
            column: column.to_owned(),
            found: suspicion.found,
            gain,
        }),
        _ => Ok(()),
    }
}
