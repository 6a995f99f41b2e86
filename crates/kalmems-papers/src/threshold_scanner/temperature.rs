//! What thresholds are for: gain, gap and resonance drift, the angle of the threshold stays.

use super::bench::{ClosedFormDecay, ThresholdBench, errors, estimate, name_of};
use crate::program::significance::SignTest;
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread, ValueOrigin,
};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_rigs::threshold_scanner::ThresholdHardware;

/// The run.
pub static HEAD: ItemHead = ItemHead {
    key: "temperature",
    title: "accuracy while gain, gap and resonance drift and the threshold stays",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Section I", page: "" },
        PaperPlace { paper: "D", label: "Section 4.2.1", page: "" },
    ],
    origin: ValueOrigin::Stated,
};

/// Relative change of the amplifier's gain per K. The papers have no number for this or the next two: these are within what
/// is usual of thick-film resistors, glued chips and silicon.
const GAIN_PER_K: f64 = -5e-4;
/// Of the comb's gap, which N_g and N_θ are inverse to.
const GAP_PER_K: f64 = 1e-4;
/// The same of a comb that is held badly, for comparison.
const LOOSE_GAP_PER_K: f64 = 5e-4;
/// Of the resonance.
const RESONANCE_PER_K: f64 = -1e-4;
/// How much warmer than when it was calibrated, in K.
const WARMER_K: [f64; 7] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0];

/// The highest of them.
const HOTTEST_K: f64 = WARMER_K[WARMER_K.len() - 1];
/// The head of the last column.
const LOOSE: &str = "+60 K, loose comb";

/// The filters, in pairs without and with crossings, and two that have no partner.
const FILTERS: [&str; 8] = [
    "EKF",
    "hybrid",
    "EKF, resonance",
    "hybrid, resonance",
    "EKF, resonance and gain",
    "hybrid, resonance and gain",
    "crossings alone, resonance",
    "hybrid, led by the crossings",
];

/// The device when it is so much warmer.
pub fn drifted(device: &ThresholdHardware, warmer_k: f64) -> ThresholdHardware {
    drifted_by(device, warmer_k, GAP_PER_K)
}

fn drifted_by(device: &ThresholdHardware, warmer_k: f64, gap_per_k: f64) -> ThresholdHardware {
    let mut drifted = *device;
    let gap = 1.0 + gap_per_k * warmer_k;
    drifted.readout.comb.gain *= (1.0 + GAIN_PER_K * warmer_k) / gap;
    drifted.readout.comb.steepness /= gap;
    drifted.mirror.comb = drifted.readout.comb;
    drifted.mirror.resonator.natural_rate *= 1.0 + RESONANCE_PER_K * warmer_k;
    drifted
}

/// Estimates decays of the drifted device by filters that know it as it was.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let first_seed = work.seed;
    let bench = ThresholdBench::new()?;
    let trials = match work.effort {
        Effort::Quick => 8,
        Effort::Full => 20,
    };
    let settings = bench.settings_for(bench.device, &FILTERS);
    let order: Vec<usize> = FILTERS
        .iter()
        .filter_map(|name| settings.filters.iter().position(|filter| name_of(filter) == *name))
        .collect();
    // All temperatures, and the highest once more with the loose comb.
    let runs = WARMER_K.len() + 1;
    let points = (runs * trials, 40_000 * FILTERS.len() as u64);
    let all = work.map("drift with temperature", points, |i, progress| {
        let (run, trial) = (i / trials, i % trials);
        let device = match WARMER_K.get(run) {
            Some(warmer_k) => drifted(&bench.device, *warmer_k),
            None => drifted_by(&bench.device, HOTTEST_K, LOOSE_GAP_PER_K),
        };
        let decay = ClosedFormDecay::of(&device, ClosedFormDecay::phase(trial));
        let seed = first_seed + trial as u64;
        let signal = decay.recorded(bench.device.noise_variance.sqrt(), seed);
        let (_, filters) = estimate(&settings, &decay, &signal, seed, progress)?;
        Ok(order.iter().map(|place| settled(&errors(&filters[*place], &decay))).collect::<Vec<f64>>())
    })?;
    let of = |run: usize, filter: usize| {
        SeedSpread::of(all[run * trials..(run + 1) * trials].iter().map(|errors| errors[filter]))
    };
    let heads = WARMER_K.map(|k| ColumnHead::number(format!("+{k} K"), "mrad"));
    let mut table = TextTable::new(
        format!("Root mean square error of the angle from 20 ms on, median of {trials} decays"),
        std::iter::once(ColumnHead::text("filter")).chain(heads).chain([ColumnHead::number(LOOSE, "mrad")]),
    );
    for (filter, name) in FILTERS.iter().enumerate() {
        let cells = (0..runs).map(|warmer| significant(1e3 * of(warmer, filter).median));
        table.push(std::iter::once((*name).to_owned()).chain(cells));
    }
    let last = WARMER_K.len() - 1;
    let at = |run: usize, filter: usize| significant(1e3 * of(run, filter).median);
    let hottest = &all[last * trials..(last + 1) * trials];
    let is_less = SignTest::of(hottest.iter().map(|errors| errors[1] < errors[0]));
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::claim(
                "thresholds improve the estimate of a device that has drifted",
                "stated, not shown",
                format!(
                    "at +60 K {} mrad without and {} with thresholds; less with them {}",
                    at(last, 0),
                    at(last, 1),
                    is_less.to_text()
                ),
                "sign test over the decays at +60 K, at 5 %",
                is_less.holds(),
            ))
            .remark(format!(
                "What the papers do not try: with resonance and gain as states the error at +60 K is {} mrad without and {} with \
                 thresholds, so that states are worth more than thresholds, and thresholds beside them nothing.",
                at(last, 4),
                at(last, 5)
            ))
            .remark(format!(
                "{} ppm/K in the amplifier's gain, {} ppm/K in the comb's gap, to which its gain and its steepness are \
                 inverse, and {} ppm/K in the resonance are assumed; the loose comb has {} ppm/K. The first 20 ms are not \
                 counted: with more states a filter needs them to settle.",
                1e6 * GAIN_PER_K,
                1e6 * GAP_PER_K,
                1e6 * RESONANCE_PER_K,
                1e6 * LOOSE_GAP_PER_K
            ))
            .remark(
                "A threshold says when an angle was passed, at any amplitude. It mends what the drift does to the phase, and not \
                 what a wrong gain does to the amplitude: that takes the gain as a state, and then the scale of the angle \
                 rests on the steepness of the curve. Where that drifts as well nothing is left that knows the scale but the \
                 distance of the threshold from the middle, 3.7 mrad of 150.",
            )
            .table(table)
            .figure(figure(&|warmer, filter| of(warmer, filter).median)),
    ])
}

/// The error from the second quarter on.
fn settled(errors: &[f64; 5]) -> f64 {
    let [_, second, third, fourth, _] = errors;
    ((second * second + third * third + fourth * fourth) / 3.0).sqrt()
}

fn figure(of: &dyn Fn(usize, usize) -> f64) -> Figure {
    let panel = |filters: &[usize], words: &str| {
        let axis = Axis::new(format!("error, {words}"), "rad").log();
        let roles = [SeriesRole::Reference, SeriesRole::Model, SeriesRole::Estimate, SeriesRole::Other];
        let lines = filters.iter().zip(roles).map(|(filter, role)| {
            let points: Vec<(f64, f64)> =
                WARMER_K.iter().zip(0..).map(|(k, w)| (*k, of(w, *filter))).collect();
            Series::line(FILTERS[*filter], role, points)
        });
        lines.fold(Panel::new(Axis::new("warmer than at the calibration", "K"), axis), Panel::with)
    };
    Figure::new(
        "temperature_drift",
        "Accuracy against drift",
        "All filters know the device as it was calibrated, at +0 K. Above without and with thresholds; below with parameters \
         of the device as states.",
    )
    .with(panel(&[0, 1, 2, 3], "few states"))
    .with(panel(&[4, 5, 6, 7], "more states").sharing_x())
}
