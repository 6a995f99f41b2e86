//! The ring-down: decay, and the capacitance over the angle, by the papers' fits and by that of `kalmems identify`.

use super::bench::{SAMPLING_HZ, ScannerBench};
use super::failed;
use super::published::{s_table_i, s_table_i_circuit, s_table_ii};
use crate::fit::{ByDual, FitSettings, ResidualLaw, fit};
use crate::identify::fit_free_decay;
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use crate::progress::Silent;
use crate::simulate::{Drive, Simulator, WhiteNoise};
use kalmems_core::{Measurement, Over};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::{BiasedComb, DemodulatedComb};
use kalmems_rigs::shared_scanner::identification::{RingDown, fit_ring_down, unknown};
use std::f64::consts::TAU;

/// Decay and capacitance.
pub static HEAD: ItemHead = ItemHead {
    key: "ring-down",
    title: "ring-down, its fit, and the capacitance over the angle",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "S", label: "Figure 7", page: "section IV-A" },
        PaperPlace { paper: "D", label: "Figure 5.6", page: "page 96" },
        PaperPlace { paper: "D", label: "Figure 5.7", page: "page 98" },
    ],
    origin: ValueOrigin::Measured,
};

/// Where the free oscillation starts: 12° at rest.
const START: [f64; 2] = [0.2094, 0.0];
/// The optical sensor's noise here, in rad; the papers state none.
const OPTICAL_NOISE: f64 = 1e-4;
/// That of V_o1 here, in V; the papers state none.
const AMPLIFIER_NOISE: f64 = 1e-3;

/// Up to which difference a fit gives back what was put in.
const SAME: CheckTolerance = CheckTolerance::part(5e-3, "the third digit, as printed");
/// Why it does.
const MADE: &str = "the simulated device was made with it";

/// What is recorded of one ring-down.
struct RingDownRecord {
    time_s: Vec<f64>,
    /// By the optical sensor, in rad.
    angle: Vec<f64>,
    /// In V: demodulated, or V_o1.
    signal: Vec<f64>,
}

/// k in N·m, b in N·m·s, C₀ in F and θ₀ in rad.
type RingDownConstants = [f64; 4];

/// Where a [`RingDownConstants`] is among the unknowns of the identification.
const PLACES: [usize; 4] = [unknown::STIFFNESS, unknown::DAMPING, unknown::NOMINAL, unknown::WIDTH];

/// What one seed gives.
struct RingDownResult {
    /// By the papers' fits, from the optical angle.
    optical: Optical,
    /// By shooting, from V_o1 and the optical angle.
    current: RingDownConstants,
    /// The standard errors that this fit claims.
    claimed: RingDownConstants,
    /// By shooting, from V_o1 alone.
    current_alone: RingDownConstants,
}

/// What the papers' fits give.
#[derive(Clone, Copy)]
struct Optical {
    /// k in N·m.
    stiffness: f64,
    /// b in N·m·s.
    damping: f64,
    /// C₀ in F, θ₀ in rad, and C_b in F, which is known only as far as the circuit's offset is.
    comb: GaussianComb<f64>,
}

/// The signal over the optical angle: [C₀, θ₀, C_b].
struct Profile<'a> {
    record: &'a RingDownRecord,
    readout: DemodulatedComb<f64>,
    deviation: f64,
}

impl ResidualLaw<3> for Profile<'_> {
    fn residuals<S: Over<f64>>(&self, [nominal, width, bias]: &[S; 3], each: &mut impl FnMut(S)) {
        let Self { record, readout, deviation } = self;
        for (angle, signal) in record.angle.iter().zip(&record.signal) {
            let overlap = (-(width.recip() * *angle).sq()).exp();
            let predicted = (overlap * *nominal + *bias) * readout.gain + readout.offset;
            each((predicted - *signal) * deviation.recip());
        }
    }
}

/// A ring-down with the carrier on, whose signal is demodulated.
fn record(bench: &ScannerBench, seed: u64, count: u32) -> RingDownRecord {
    let hardware = bench.hardware();
    let noise = hardware.noise_variance.sqrt();
    recorded(hardware.scanner, (seed, [0, 1]), count, |state, chance| {
        let [clean] = hardware.readout.predict(state);
        clean + noise * chance
    })
}

/// A ring-down without a carrier, which would hide the current; V_o1 is recorded.
fn record_of_current(bench: &ScannerBench, seed: u64, count: u32) -> RingDownRecord {
    let scanner = ParametricScanner { carrier_mean_square: 0.0, ..bench.scanner() };
    let readout = BiasedComb { comb: scanner.comb, gain: CURRENT_GAIN, offset: 0.0, angle_offset: 0.0 };
    recorded(scanner, (seed, [2, 3]), count, |state, chance| {
        let [clean, _] = readout.predict(state);
        clean + AMPLIFIER_NOISE * chance
    })
}

/// R_f·V in Ω·V.
const CURRENT_GAIN: f64 = s_table_i_circuit::FEEDBACK_OHM * s_table_i::BIAS_V;

fn recorded(
    scanner: ParametricScanner<f64>,
    (seed, streams): (u64, [u64; 2]),
    count: u32,
    read: impl Fn(&[f64; 2], f64) -> f64,
) -> RingDownRecord {
    const STEPS: u32 = 4;
    let drive = Drive::Constant { level: s_table_i::BIAS_V };
    let mut simulator = Simulator::new(scanner, drive, SAMPLING_HZ * f64::from(STEPS), START);
    let [mut optical, mut chance] = streams.map(|stream| WhiteNoise::new(seed, stream));
    let mut record = RingDownRecord { time_s: Vec::new(), angle: Vec::new(), signal: Vec::new() };
    for k in 0..count {
        record.time_s.push(f64::from(k) / SAMPLING_HZ);
        record.angle.push(simulator.state()[0] + OPTICAL_NOISE * optical.sample());
        record.signal.push(read(simulator.state(), chance.sample()));
        for _ in 0..STEPS {
            simulator.step();
        }
    }
    record
}

/// What a laboratory believes before: stiffness 0.3 %, damping 20 %, capacitance 5 % and width 8 % wrong.
fn believed(scanner: &ParametricScanner<f64>) -> ParametricScanner<f64> {
    let ParametricScanner { resonator, comb, .. } = *scanner;
    ParametricScanner {
        resonator: TorsionalResonator {
            damping: 0.8 * resonator.damping,
            stiffness: 1.003 * resonator.stiffness,
            ..resonator
        },
        comb: GaussianComb { nominal: 1.05 * comb.nominal, angular_width: 0.92 * comb.angular_width, ..comb },
        carrier_mean_square: 0.0,
    }
}

/// By shooting, from V_o1 and the reference, or without the latter: values and their standard errors.
fn identified(
    bench: &ScannerBench,
    record: &RingDownRecord,
    with_reference: bool,
) -> Result<[RingDownConstants; 2], ReproduceError> {
    let record = RingDown {
        interval_s: 1.0 / SAMPLING_HZ,
        signal: &record.signal,
        angle: if with_reference { &record.angle } else { &[] },
        scanner: believed(&bench.scanner()),
        bias: s_table_i::BIAS_V,
        gain: CURRENT_GAIN,
    };
    let fitted =
        fit_ring_down(&record, &Silent).map_err(|e| failed("the ring-down by shooting")(e.into()))?;
    let all = PLACES.map(|place| fitted.fit.parameter(place));
    Ok([all.map(|one| one.value), all.map(|one| one.deviation)])
}

fn found(bench: &ScannerBench, seed: u64, samples: u32) -> Result<RingDownResult, ReproduceError> {
    let current = record_of_current(bench, seed, samples);
    let [values, claimed] = identified(bench, &current, true)?;
    let [current_alone, _] = identified(bench, &current, false)?;
    let optical = find(bench, &record(bench, seed, samples))?;
    Ok(RingDownResult { optical, current: values, claimed, current_alone })
}

fn find(bench: &ScannerBench, record: &RingDownRecord) -> Result<Optical, ReproduceError> {
    let hardware = bench.hardware();
    let inertia = hardware.scanner.resonator.inertia;
    // The damped sine that the papers fit, to the motion's tail, where it is nearly one.
    let tail = record.time_s.len() / 2;
    let sine = fit_free_decay(&record.time_s[tail..], &record.angle[tail..])
        .map_err(|e| failed("the decay's damped sine")(e.into()))?;
    let natural = TAU * sine.natural_frequency_hz().value;
    let profile = Profile { record, readout: hardware.readout, deviation: hardware.noise_variance.sqrt() };
    let start = FitSettings::from_start([5e-12, 0.25, 1e-11]);
    let [nominal, angular_width, bias] =
        fit(&ByDual(profile), &start).map_err(|e| failed("the capacitance's profile")(e.into()))?.parameters;
    Ok(Optical {
        stiffness: inertia * natural * natural,
        damping: 2.0 * inertia * sine.decay_rate().value,
        comb: GaussianComb { nominal, angular_width, bias },
    })
}

/// Records ring-downs and fits them.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let bench = ScannerBench::new()?;
    let (runs, samples) = match work.effort {
        Effort::Quick => (3, 8_000),
        Effort::Full => (12, 20_000),
    };
    let first_seed = work.seed;
    let found = work.map("ring-downs", (runs, u64::from(samples)), |index, _| {
        Some(found(&bench, first_seed + index as u64, samples))
    })?;
    let found: Vec<RingDownResult> = found.into_iter().collect::<Result<_, _>>()?;
    Ok(vec![item(&bench, &record(&bench, work.seed, samples), &found)])
}

fn item(bench: &ScannerBench, record: &RingDownRecord, found: &[RingDownResult]) -> Item {
    let over = |value: &dyn Fn(&RingDownResult) -> f64| SeedSpread::of(found.iter().map(value));
    let k = bench.scanner().resonator.stiffness;
    let excess = over(&|f| f.optical.stiffness / k).median - 1.0;
    let names = ["k", "b", "C₀", "θ₀"];
    let units = ["1e-4 N m", "1e-12 N m s", "pF", "rad"];
    let scales = [1e4, 1e12, 1e12, 1.0];
    let printed =
        [s_table_ii::STIFFNESS, s_table_ii::DAMPING, s_table_ii::NOMINAL_PF, s_table_ii::ANGULAR_WIDTH];
    let optical = |f: &RingDownResult| -> RingDownConstants {
        let Optical { stiffness, damping, comb } = f.optical;
        [stiffness, damping, comb.nominal, comb.angular_width]
    };
    let mut item = Item::new(&HEAD);
    for i in 0..4 {
        let quantity = format!("{} of {}", names[i], if i < 2 { "a damped sine" } else { "the profile" });
        let ours = over(&|f| scales[i] * optical(f)[i]);
        item = item.check(Check::value(quantity, units[i], printed[i], ours, SAME).circular(MADE));
    }
    for i in 0..4 {
        let ours = over(&|f| scales[i] * f.current[i]);
        item = item.check(
            Check::value(format!("{} by shooting, V_o1", names[i]), units[i], printed[i], ours, SAME)
                .circular(MADE),
        );
    }
    // How far from what was put in, in parts of a thousand: the median over the seeds without its sign.
    let put_in = [
        k,
        bench.scanner().resonator.damping,
        bench.scanner().comb.nominal,
        bench.scanner().comb.angular_width,
    ];
    let off = |value: &dyn Fn(&RingDownResult) -> f64, i: usize| {
        format!("{:.1e}", over(&|f| (value(f) / put_in[i] - 1.0).abs()).median)
    };
    let mut table = TextTable::new(
        "How far each way is from the simulated device, relative, median without sign",
        [
            ColumnHead::text("parameter"),
            ColumnHead::number("damped sine and profile, optical angle", ""),
            ColumnHead::number("shooting, V_o1 with optical angle", ""),
            ColumnHead::number("its standard error", ""),
            ColumnHead::number("shooting, V_o1 alone", ""),
        ],
    );
    for i in 0..4 {
        table = table.row([
            names[i].to_owned(),
            off(&|f| optical(f)[i], i),
            off(&|f| f.current[i], i),
            format!("{:.1e}", over(&|f| f.claimed[i] / put_in[i]).median),
            off(&|f| f.current_alone[i], i),
        ]);
    }
    item.remark(format!(
            "The ring-down is that of the simulated device of S Table II under the bias of 23.76 V, so that this checks \
             the method: fits as the papers describe them give back what was put in. The bias pulls the mirror back; a \
             damped sine, which knows nothing of that, finds a stiffness {excess:.1e} of itself too large, of no weight \
             beside the printed three digits. For these the demodulated signal is set against the optical angle, which \
             has {:.1} mrad of noise (the papers state none).",
            OPTICAL_NOISE * 1e3
        ))
        .remark(format!(
            "The papers get the capacitance by integrating the current V_o1, whose offset walks away. `kalmems identify` \
             fits the equation of motion to V_o1 by shooting, the bias's pull included, beside the optical angle; here with \
             {:.0} mV of noise and from a start 0.3 % (k), 20 % (b), 5 % (C₀) and 8 % (θ₀) wrong. From V_o1 alone θ₀ \
             is the least certain: it is known only by the bias's pull and the shape of the current.",
            AMPLIFIER_NOISE * 1e3
        ))
        .table(table)
        .figure(decay(bench, record, found))
        .figure(capacitance(bench, record, found))
}

fn decay(bench: &ScannerBench, record: &RingDownRecord, found: &[RingDownResult]) -> Figure {
    let degrees = record.time_s.iter().zip(&record.angle).map(|(t, a)| (*t, a.to_degrees()));
    let mut envelope = Panel::new(Axis::new("time", "s"), Axis::new("angle", "deg")).with(Series::line(
        "optical sensor, simulated",
        SeriesRole::Measured,
        degrees,
    ));
    if let Some(first) = found.first() {
        let rate = 0.5 * first.optical.damping / bench.scanner().resonator.inertia;
        for (label, sign) in [("fitted decay", 1.0), ("", -1.0)] {
            let line: Vec<(f64, f64)> = record
                .time_s
                .iter()
                .map(|t| (*t, (sign * START[0] * (-rate * t).exp()).to_degrees()))
                .collect();
            envelope = envelope.with(Series::line(label, SeriesRole::Model, line));
        }
    }
    Figure::new(
        "ring-down_decay",
        "Ring-down",
        "The free oscillation under the bias, and the decay that the fit's damping gives (S Figure 7a, D Figure 5.6).",
    )
    .with(envelope)
}

fn capacitance(bench: &ScannerBench, record: &RingDownRecord, found: &[RingDownResult]) -> Figure {
    let hardware = bench.hardware();
    let stride = (record.angle.len() / 600).max(1);
    let seen: Vec<(f64, f64)> = record
        .angle
        .iter()
        .zip(&record.signal)
        .step_by(stride)
        .map(|(angle, volts)| {
            let farad = (volts - hardware.readout.offset) / hardware.readout.gain;
            (angle.to_degrees(), farad)
        })
        .collect();
    let grid = || (-120..=120).map(|i| 0.2 * f64::from(i));
    let mut panel = Panel::new(Axis::new("angle", "deg"), Axis::new("capacitance", "F"))
        .with(Series::points("from the simulated signal", SeriesRole::Measured, seen));
    if let Some(RingDownResult { optical: Optical { comb, .. }, .. }) = found.first() {
        let gaussian: Vec<(f64, f64)> = grid().map(|a| (a, comb.capacitance(a.to_radians()))).collect();
        let quadratic: Vec<(f64, f64)> = grid()
            .filter(|a| a.abs() <= 12.0)
            .map(|a| (a, comb.capacitance(0.0) + 0.5 * comb.curvature_at_rest() * a.to_radians().powi(2)))
            .collect();
        panel = panel
            .with(Series::line("Gaussian (S equation 13)", SeriesRole::Model, gaussian))
            .with(Series::line("quadratic (S equation 15)", SeriesRole::Bound, quadratic));
    }
    Figure::new(
        "ring-down_capacitance",
        "Capacitance over the angle",
        "The signal turned into capacitance against the optical angle, and the fitted profile (S Figure 7b, D Figure \
         5.7). The quadratic that the papers' circuit analysis uses leaves it beyond a few degrees.",
    )
    .with(panel)
}
