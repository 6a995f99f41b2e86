//! A truth that is drawn from what the device's table states as uncertain.

use super::super::seed::Draw;
use super::prior::{DrawnDeviation, PriorRefusal};
use crate::config::{Direction, Key, UncertainNumber, exactly, put, written};
use toml::Table;

/// Draws the device of one run from the directions of its uncertainty, and makes the truth of it. What is a state of a filter is left to
/// that state's prior.
pub(super) fn draw(
    truth: &mut Table,
    directions: &[Direction],
    tracked: &[Key],
    (seed, run): (u64, u64),
) -> Result<Vec<DrawnDeviation>, PriorRefusal> {
    exactly(truth);
    let mut moved: Vec<(&UncertainNumber, f64)> = Vec::new();
    for (place, direction) in directions.iter().enumerate() {
        let deviation = Draw::of_device(seed, run, place).normal();
        for (number, step) in direction.steps.iter().filter(|(number, _)| !tracked.contains(&number.key)) {
            // A number whose errors hang together with those of others is moved in several directions.
            match moved.iter_mut().find(|(other, _)| other.key == number.key) {
                Some((_, sum)) => *sum += deviation * step,
                None => moved.push((number, deviation * step)),
            }
        }
    }
    let mut drawn = Vec::new();
    for (of, deviation) in moved {
        let (_, unit) = of.value.parts();
        let value = written((of.value.si() + deviation) / of.value.unit().factor(), unit);
        put(truth, &of.key, value).map_err(|fault| (of.key.clone(), fault))?;
        drawn.push(DrawnDeviation { name: of.name.clone().into(), deviation });
    }
    Ok(drawn)
}
