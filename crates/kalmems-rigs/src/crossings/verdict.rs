//! Whether a signal crosses its level as the device says.

use super::fallback::LOUD;
use super::search::SearchTally;
use crate::estimate::{EstimateError, SignalSegment};

/// How many times as steep as its rises a signal must fall to be taken for reversed.
const SIGN_RATIO: f64 = 1.5;

/// Judges a signal by what was found until the end of a part: a segment that is whole, or whose beginning shows that it is wrong,
/// is refused at once; what a longer one is refused for at its end is given back, for when all of the recording was taken.
pub fn judge_crossings(
    tally: SearchTally,
    segment: &SignalSegment,
    place: (&str, &str),
) -> Result<Option<EstimateError>, EstimateError> {
    match (segment.begins, segment.ends) {
        (true, true) => require_crossings(tally, place).map(|()| None),
        // That it moves may come.
        (true, false) => require_sign(tally, tally.threshold.max(LOUD), place).map(|()| None),
        (false, true) => Ok(require_crossings(tally, place).err()),
        (false, false) => Ok(None),
    }
}

fn require_crossings(tally: SearchTally, (place, column): (&str, &str)) -> Result<(), EstimateError> {
    require_sign(tally, tally.threshold, (place, column))?;
    let SearchTally { count, rising, by_noise, .. } = tally;
    // As many as noise alone has, within four standard deviations of that, and none that noise could not be.
    let is_few = count as f64 <= by_noise + 4.0 * by_noise.sqrt() + 1.0;
    if count == 0 || (is_few && rising < LOUD) {
        let (place, column) = (place.to_owned(), column.to_owned());
        return Err(EstimateError::NoCrossing { place, column, count, by_noise, largest: rising });
    }
    Ok(())
}

fn require_sign(tally: SearchTally, least: f64, (place, column): (&str, &str)) -> Result<(), EstimateError> {
    let SearchTally { rising, falling, .. } = tally;
    if falling > SIGN_RATIO * rising && falling > least {
        let (place, column) = (place.to_owned(), column.to_owned());
        return Err(EstimateError::SignReversed { place, column, falling, rising });
    }
    Ok(())
}
