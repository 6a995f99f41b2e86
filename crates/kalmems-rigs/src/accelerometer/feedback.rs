//! Whether the feedback that was recorded is the one that moved the mass, told from the recording alone.

use super::data::AccelerometerSegment;
use super::identification::most_likely_with;
use super::settings::AccelerometerHardware;
use super::varied_instrument::{VariedInstrument, settled};
use crate::estimate::EstimateError;
use crate::spikes::without_spikes;
use kalmems_core::FixedGain;

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

/// Samples at most of which it is asked what mechanics would make of them.
const ASKED: usize = 50_000;

/// Refuses a feedback under which the signal is far less likely than under one that is wrong in a known way.
///
/// Each is followed by the settled gain of the model at rest. Where there is no such gain nothing is said; the filters
/// will. A mass, a spring or a damping that is not as the experiment says can look like a wrong feedback: one that is more likely with the
/// stated numbers is therefore told only where it stays so when each of both has the numbers under which it is the likeliest.
pub fn require_right(
    hardware: &AccelerometerHardware,
    data: &AccelerometerSegment,
    column: &str,
    place: &str,
) -> Result<(), EstimateError> {
    let (Ok((instrument, settled)), Some(feedback)) = (settled(hardware, data.interval_s), data.feedback)
    else {
        return Ok(());
    };
    // Two spikes would outweigh all other samples, for one suspicion or the other.
    let signal = without_spikes(data.signal, hardware.noise_variance.sqrt());
    let data = &AccelerometerSegment { signal: &signal, ..*data };
    let Some((gain, suspicion)) = suspected((&instrument, settled), data, feedback) else { return Ok(()) };
    let other = suspicion.applied(feedback);
    let asked = |feedback: &[f64]| most_likely_with(hardware, &data.beginning(ASKED, feedback));
    let gain = match (asked(feedback), asked(&other)) {
        (Some(as_recorded), Some(otherwise)) => otherwise - as_recorded,
        // Too short a recording, or numbers beside which nothing can be computed: what is stated has to do.
        _ => gain,
    };
    if gain > CERTAIN {
        let (place, column) = (place.to_owned(), column.to_owned());
        return Err(EstimateError::FeedbackMismatch { place, column, found: suspicion.found, gain });
    }
    Ok(())
}

/// What is far more likely than the feedback as recorded with the stated numbers, and by how much.
fn suspected(
    (instrument, settled): (&VariedInstrument<f64>, FixedGain<f64, 4, 1>),
    data: &AccelerometerSegment,
    feedback: &[f64],
) -> Option<(f64, &'static Suspicion)> {
    let likelihood = |suspicion: &Suspicion| {
        let mut filter = settled;
        let mut total = 0.0;
        for (k, y) in data.signal.iter().enumerate() {
            if k > 0 {
                filter.predict(&instrument.process, &suspicion.at(feedback, k - 1)).ok()?;
            }
            if y.is_finite() {
                total += filter.update(&instrument.readout, &[*y]).ok()?.log_likelihood();
            }
        }
        Some(total)
    };
    let as_recorded = likelihood(&SUSPICIONS[0]).unwrap_or(f64::NEG_INFINITY);
    let others = SUSPICIONS[1..].iter().filter_map(|other| Some((likelihood(other)? - as_recorded, other)));
    others.max_by(|(a, _), (b, _)| a.total_cmp(b)).filter(|(gain, _)| *gain > CERTAIN)
}

impl Suspicion {
    /// What was applied from sample k on, if it is right.
    fn at(&self, feedback: &[f64], k: usize) -> f64 {
        let applied = k.checked_add_signed(self.shift).and_then(|k| feedback.get(k));
        self.sign * applied.copied().unwrap_or(feedback[k])
    }

    /// The same of all samples.
    fn applied(&self, feedback: &[f64]) -> Vec<f64> {
        (0..feedback.len()).map(|k| self.at(feedback, k)).collect()
    }
}
