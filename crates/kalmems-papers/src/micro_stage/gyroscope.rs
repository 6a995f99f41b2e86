//! The gyroscope that is calibrated: what its data sheet says, and what is simulated.

use super::failed;
use super::record_sets::{DRIVE_HZ, DRIVES_V, angle};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use crate::simulate::WhiteNoise;
use kalmems_applications::calibration::{
    AxisAtRest, CalibrationError, SimulatedInstrument, SimulatedUnit, Vibration,
};
use kalmems_models::inertial::{SampleClock, Triad};
use std::f64::consts::TAU;

/// The data sheet.
pub static HEAD: ItemHead = ItemHead {
    key: "table-3-1",
    title: "the gyroscope's specifications",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "D", label: "Table 3.1", page: "page 37" }],
    origin: ValueOrigin::Stated,
};

/// D Table 3.1 in degrees per second: the largest and the smallest full scale, and the total noise rms.
const FULL_SCALE_DPS: f64 = 2000.0;
const LEAST_SCALE_DPS: f64 = 250.0;
const NOISE_DPS: f64 = 0.1;
/// Its bias at the most, in degrees per second.
const BIAS_DPS: f64 = 5.0;

/// Why ours agrees.
const MADE: &str = "the simulated gyroscope was made by the data sheet";

/// Counts of a converter of 16 bits.
const COUNTS: f64 = 65536.0;

/// The unit with this scale factor about y, on a clock that is 0.31 % fast.
pub fn unit(scale_factor: f64) -> SimulatedUnit {
    let triad =
        Triad { y: [0.0, scale_factor, 0.0], bias: [0.0, 0.0312, 0.0], ..SimulatedInstrument::IDEAL.triad };
    let full_scale = FULL_SCALE_DPS.to_radians();
    let gyroscopes = SimulatedInstrument {
        triad,
        noise: NOISE_DPS.to_radians(),
        step: 2.0 * full_scale / COUNTS,
        full_scale,
        ..SimulatedInstrument::IDEAL
    };
    SimulatedUnit {
        clock: SampleClock { start: 3.3e-5, rate: 8000.0, skew: 3.1e-3 },
        gyroscopes,
        accelerometers: None,
    }
}

/// The item.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let still = Vibration { frequency_hz: DRIVE_HZ, amplitude: [0.0; 3], phase_rad: [0.0; 3] };
    let [rates, _] = unit(1.0).record(&still, 8000, &mut WhiteNoise::new(work.seed, 0));
    let values = rates.axes[1].as_deref().unwrap_or_default();
    let found = AxisAtRest::of("y", values, 1.0 / 8000.0).ok_or_else(|| {
        let place = "the simulated record at rest".to_owned();
        failed(HEAD.key)(CalibrationError::Rest { place, samples: values.len() })
    })?;
    let largest =
        DRIVES_V.map(|volts| angle(volts).amplitude * TAU * DRIVE_HZ).into_iter().fold(0.0, f64::max);
    let full = FULL_SCALE_DPS.to_radians();
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::value("largest full scale", "rad/s", 34.9, SeedSpread::exact(full), CheckTolerance::digit(0.1)).circular(MADE))
            .check(Check::value(
                "smallest full scale",
                "rad/s",
                4.4,
                SeedSpread::exact(LEAST_SCALE_DPS.to_radians()),
                CheckTolerance::digit(0.1),
            ).circular(MADE))
            .check(Check::value(
                "total noise, of 8000 samples at rest",
                "deg/s",
                NOISE_DPS,
                SeedSpread::exact(found.noise.to_degrees()),
                CheckTolerance::part(0.05, "chance of the samples, and the steps of the converter"),
            ).circular(MADE))
            .check(Check::claim(
                "the full scale holds the motion",
                "34.9 rad/s, and 46.3 rad/s from peak to peak",
                format!("{full:.1} rad/s, and {:.1} rad/s from peak to peak", 2.0 * largest),
                "the motion's amplitude is below the full scale",
                largest < full,
            ).circular(MADE))
            .check(Check::claim(
                "the bias is within the specification",
                format!("±{BIAS_DPS} deg/s"),
                format!("{:.2} deg/s", found.bias.to_degrees()),
                "within it",
                found.bias.to_degrees().abs() < BIAS_DPS,
            ).circular(MADE))
            .remark(
                "A data sheet's values: ours are those of the simulated gyroscope, which has the noise, the steps of 16 bits and \
                 the full scale of it, and no cross-axis sensitivity. Scale factor and its change with temperature are those \
                 of D Table 3.6.",
            ),
    ])
}
