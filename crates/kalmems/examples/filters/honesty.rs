//! What the innovations say of a filter: their mean normalised square, which is 1 where the filter is right.

use super::chance::{Chance, Spread};
use super::contest::SEEDS;
use super::scanner::{
    DENSITY, INTERVAL, Motion, NOISE_VARIANCE, READOUT, SCANNER, START_SD, Score, Truth, signal,
};
use kalmems_core::consistency::Consistency;
use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Ekf, Filter, Measurement, Nodes,
    NoiseDensity, Process, Rk4,
};
use std::error::Error;
use std::fmt::Write as _;

const SAMPLES: usize = 30_000;
const SETTLING: usize = 15_000;

/// The angle's error in 10⁻³ degrees, its standard deviation as the filter says it, and the mean NIS.
fn follow<const N: usize>(
    mut filter: Ekf<f64, N>,
    (process, readout): (&impl Process<f64, N, Input = Nodes<f64>>, &impl Measurement<f64, N, 1>),
    (motion, signal): &(Motion, Vec<f64>),
) -> Result<[f64; 3], Box<dyn Error>> {
    let r = Covariance::from_variances([NOISE_VARIANCE]);
    let mut consistency = Consistency::<f64, 1, 1>::new();
    let (mut angle, mut variance) = (Vec::new(), 0.0);
    for (k, (drive, y)) in motion.drive.iter().zip(signal).enumerate() {
        filter.predict(process, drive)?;
        let innovation = filter.update(readout, &[*y], &r)?;
        if k >= SETTLING {
            consistency.add(&innovation);
            variance += filter.covariance().get(0, 0);
        }
        angle.push(filter.mean()[0]);
    }
    let claimed = (variance / (SAMPLES - SETTLING) as f64).sqrt().to_degrees() * 1e3;
    Ok([Score::of(&angle, motion, SETTLING).angle_mdeg, claimed, consistency.mean_nis()])
}

/// The table.
pub fn run() -> Result<String, Box<dyn Error>> {
    eprintln!("innovations, {SEEDS} seeds");
    let recordings = |stiffness| -> Vec<(Motion, Vec<f64>)> {
        let one = |seed| {
            let mut chance = Chance::new(seed);
            let motion = Truth { stiffness, density: DENSITY, samples: SAMPLES }.motion(&mut chance);
            let signal = signal(&motion, NOISE_VARIANCE.sqrt(), &mut chance);
            (motion, signal)
        };
        (1..=SEEDS).map(one).collect()
    };
    let (exact, softer) = (recordings(1.0), recordings(0.997));
    let process = |density: f64| {
        Rk4::new(SCANNER, INTERVAL, &NoiseDensity::none().on::<1>(density), (&[0.0, 0.0], &0.0))
    };
    let plain = |density: f64, recording: &(Motion, Vec<f64>)| {
        let start = Covariance::from_standard_deviations(START_SD);
        follow(Ekf::new(recording.0.start, start), (&process(density), &READOUT), recording)
    };
    // 1 is 0.3 %.
    let added = [AddedState {
        scale: 0.003 * SCANNER.resonator.stiffness,
        drift: Drift::RandomWalk { density: 0.0 },
    }];
    let augmented = Augmented::<_, _, 2, 1, 3>::new(process(DENSITY), &added, [Some("resonator.stiffness")])?;
    let readout = AugmentedMeasurement::<_, _, 2, 1>::new(READOUT, &added, [None])?;
    let with_stiffness = |recording: &(Motion, Vec<f64>)| {
        let [angle, rate] = recording.0.start;
        let start = Covariance::from_standard_deviations([START_SD[0], START_SD[1], 1.0]);
        follow(Ekf::new([angle, rate, 0.0], start), (&augmented, &readout), recording)
    };
    let mut table =
        String::from("| | error, mdeg | σ that the filter says, mdeg | mean NIS |\n|---|---:|---:|---:|\n");
    let mut row = |name: &str, outcomes: Result<Vec<[f64; 3]>, Box<dyn Error>>| {
        let outcomes = outcomes?;
        let of = |i: usize| Spread::of(outcomes.iter().filter_map(|o| o.get(i).copied()).collect()).text();
        let _ = writeln!(table, "| {name} | {} | {} | {} |", of(0), of(1), of(2));
        Ok::<(), Box<dyn Error>>(())
    };
    row("A: EKF, q = 10⁶", exact.iter().map(|r| plain(DENSITY, r)).collect())?;
    row("B: EKF, q = 10⁶", softer.iter().map(|r| plain(DENSITY, r)).collect())?;
    row("B: EKF, q = 10⁷", softer.iter().map(|r| plain(1e7, r)).collect())?;
    row("B: EKF, q = 10⁸", softer.iter().map(|r| plain(1e8, r)).collect())?;
    row("B: EKF, q = 10⁹", softer.iter().map(|r| plain(1e9, r)).collect())?;
    row("B: EKF, q = 10¹⁰", softer.iter().map(|r| plain(1e10, r)).collect())?;
    row("B: stiffness as a state, q = 10⁶", softer.iter().map(with_stiffness).collect())?;
    Ok(table)
}
