//! The resonance, and how far the stage moves.

use super::failed;
use super::record_sets::{DAMPING_RATIO, DRIVE_GAIN, NATURAL_HZ, NOISE_V, VOLTS_PER_RATE, angle, stage};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use crate::simulate::WhiteNoise;
use kalmems_rigs::micro_stage::identification::{StageSweepPoint, fit_sweep, sweep_figure};
use std::f64::consts::TAU;

/// How far the stage moves under the printed drives.
pub static SETTINGS: ItemHead = ItemHead {
    key: "table-3-2",
    title: "range of the motion in the experiments",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "D", label: "Table 3.2", page: "page 41" }],
    origin: ValueOrigin::Measured,
};

/// The sweep and its fit.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-3-11",
    title: "resonance of the tilting mode",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "D", label: "Figure 3.11", page: "page 43" },
        PaperPlace { paper: "D", label: "Table 3.3, the stage", page: "page 43" },
    ],
    origin: ValueOrigin::Measured,
};

/// The damping ratio is printed as 0.005: at resonance its rounding is worth 10 % of the motion.
const DIGIT_OF_DAMPING: CheckTolerance =
    CheckTolerance::part(0.05, "half of what the one digit of ζ is worth at resonance");
/// Why the fitted values agree.
const MADE: &str = "the simulated sweep is one of the printed stage";
/// D Table 3.2: peak to peak in rad/s, smallest and largest, over the sweep and with the sensors.
const SWEEP_PP: [f64; 2] = [48.5, 54.3];
const SENSORS_PP: [f64; 2] = [29.5, 46.3];
/// The drive of the sweep in V.
const SWEEP_V: f64 = 0.8;
/// Samples per step, of which each fit makes one point.
const SAMPLES: f64 = 1500.0;

fn steps() -> impl Iterator<Item = f64> {
    (0..17_u32).map(|k| 1711.0 + 0.5 * f64::from(k))
}

/// The rate per volt at a frequency.
fn response(frequency_hz: f64) -> (f64, f64) {
    let turn = TAU * frequency_hz;
    let (re, im) = stage().response(turn);
    (-turn * im, turn * re)
}

/// Both items.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    Ok(vec![settings(), sweep(work.seed)?])
}

fn settings() -> Item {
    let over_sweep = steps().map(|f| {
        let (re, im) = response(f);
        2.0 * SWEEP_V * re.hypot(im)
    });
    let (low, high) =
        over_sweep.fold((f64::INFINITY, 0.0_f64), |(low, high), pp| (low.min(pp), high.max(pp)));
    let with_sensors = |volts: f64| 2.0 * angle(volts).amplitude * TAU * 1700.0;
    let value = |what: &str, paper, ours| {
        Check::value(what, "rad/s", paper, SeedSpread::exact(ours), DIGIT_OF_DAMPING)
    };
    let ratio = SENSORS_PP[1] / SENSORS_PP[0];
    Item::new(&SETTINGS)
        .check(value("1711 to 1719 Hz at 0.8 V, smallest", SWEEP_PP[0], low))
        .check(value("1711 to 1719 Hz at 0.8 V, largest", SWEEP_PP[1], high))
        .check(value("1700 Hz at 1.0 V", SENSORS_PP[0], with_sensors(1.0)))
        .check(value("1700 Hz at 1.3 V", SENSORS_PP[1], with_sensors(1.3)))
        .remark(format!(
            "Ours is the linear model of D Table 3.3. At 1700 Hz the printed motion grows by {ratio:.2} where the drive grows \
             by 1.30: the piezoelectric gain grows with the amplitude, which the model does not have. The parameters, \
             identified at 0.8 V near resonance, fit 1.3 V at 1700 Hz and not 1.0 V."
        ))
}

fn sweep(seed: u64) -> Result<Item, ReproduceError> {
    let mut noise = WhiteNoise::new(seed, 1);
    // Noise of the vibrometer and of the drive, in the phasors of a record.
    let deviation = |size: f64| {
        let relative = (NOISE_V[1] / (VOLTS_PER_RATE * SWEEP_V * size)).hypot(NOISE_V[2] / SWEEP_V);
        size * relative * (2.0 / SAMPLES).sqrt()
    };
    let points: Vec<StageSweepPoint> = steps()
        .map(|frequency_hz| {
            let (re, im) = response(frequency_hz);
            let deviation = deviation(re.hypot(im));
            let mut noisy = |part: f64| part + deviation * noise.sample();
            StageSweepPoint { frequency_hz, re: noisy(re), im: noisy(im), deviation }
        })
        .collect();
    let fitted = fit_sweep(&points).map_err(failed("figure-3-11"))?;
    let value = |what: &str, unit, paper, ours, tolerance| {
        Check::value(what, unit, paper, SeedSpread::exact(ours), tolerance).circular(MADE)
    };
    Ok(Item::new(&HEAD)
        .check(value("natural frequency by the circle", "Hz", NATURAL_HZ, fitted.circle_frequency_hz().value, CheckTolerance::digit(0.1)))
        .check(value("damping ratio by the circle", "", DAMPING_RATIO, fitted.circle_damping_ratio().value, CheckTolerance::part(0.01, "noise of the sweep")))
        .check(value("b_c by the circle", "rad/s^2/V", DRIVE_GAIN, fitted.circle_drive_gain().value, CheckTolerance::part(0.01, "noise of the sweep")))
        .check(value("natural frequency by least squares", "Hz", NATURAL_HZ, fitted.natural_frequency_hz().value, CheckTolerance::digit(0.1)))
        .remark(
            "Ours is a sweep of the printed stage, so that agreement says that the fits work on the printed steps, not that \
             the stage is right. The table calls b_c a DC gain; its unit is that of an angular acceleration per volt.",
        )
        .figure(sweep_figure(&points, &fitted, "simulated")))
}
