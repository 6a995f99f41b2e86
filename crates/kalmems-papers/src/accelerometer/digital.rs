//! What the thesis names and does not do: a loop of one bit, and a digital observer with fewer samples.

use super::bench::{AccelerometerBench, BenchFilter, BenchRecord, INTERVAL_S, SKIP_S, differences, rms};
use super::failed;
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread, ValueOrigin,
};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::constants::STANDARD_GRAVITY;
use kalmems_models::control::{Comparator, PiController};
use kalmems_rigs::accelerometer::{Acceleration, ControllerTiming, settled_acceleration_sd};

/// The alternative.
pub static ONE_BIT: ItemHead = ItemHead {
    key: "one-bit-loop",
    title: "the loop of one bit",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "Z", label: "Section 1.2", page: "pages 4 and 5" }],
    origin: ValueOrigin::Computed,
};

/// Fewer samples.
pub static DECIMATION: ItemHead = ItemHead {
    key: "digital-observer",
    title: "the digital observer: interval, steps and decimation",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "Z", label: "Section 6.2", page: "page 72" }],
    origin: ValueOrigin::Computed,
};

/// Computes both.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    Ok(vec![one_bit(work)?, decimation(work)?])
}

const MILLI_G: f64 = 1e-3 * STANDARD_GRAVITY;

/// Samples in the means of bits.
const WINDOWS: [usize; 6] = [50, 100, 200, 500, 1000, 2000];
/// Of means, means of means, and so on.
const ORDERS: usize = 3;

/// What is left in means of bits, in m/s², by window and order; and the filter's.
struct BitMeans {
    left: [[f64; ORDERS]; WINDOWS.len()],
    filter: f64,
}

/// Means of `count` neighbours.
fn means(values: &[f64], count: usize) -> Vec<f64> {
    let mut sum: f64 = values.iter().take(count).sum();
    let mut means = Vec::with_capacity(values.len());
    for (leaving, entering) in values.iter().zip(values.iter().skip(count).chain([&0.0])) {
        means.push(sum / count as f64);
        if means.len() + count > values.len() {
            break;
        }
        sum += entering - leaving;
    }
    means
}

fn bits(bench: &AccelerometerBench, comparator: Comparator, (noise, seed): (bool, u64)) -> Option<BitMeans> {
    let mut run = bench.run(Acceleration::Chance, SKIP_S + 0.2, seed);
    (run.acting, run.noise) = (ControllerTiming::OneBit(comparator), noise);
    run.closed.controller = PiController { proportional: 10.0, integral: 0.0 };
    let record = BenchRecord::of(&run);
    let from = record.from();
    let per_volt = bench.closed.device.feedback_gain() / bench.closed.device.mass.mass;
    let over: Vec<f64> = record
        .feedback
        .iter()
        .zip(&record.acceleration)
        .skip(from)
        .map(|(feedback, acceleration)| feedback * per_volt - acceleration)
        .collect();
    let left = WINDOWS.map(|count| {
        let mut values = over.clone();
        [(); ORDERS].map(|()| {
            values = means(&values, count);
            rms(values.iter().copied())
        })
    });
    let trajectory = bench.estimate(BenchFilter::Honest, &record)?;
    let filter = rms(differences(&trajectory.state("acceleration")?.mean, &record.acceleration, from));
    Some(BitMeans { left, filter })
}

fn one_bit(work: &PartWork) -> Result<Item, ReproduceError> {
    let bench = AccelerometerBench::new(4.0)?;
    let comparator = Comparator { level: 0.5 * bench.closed.device.bias, lead_s: 5.6e-6 };
    let seeds = match work.effort {
        Effort::Quick => 2,
        Effort::Full => 20,
    };
    let first_seed = work.seed;
    let found = work.map("the loop of one bit", (2 * seeds, 1), |index, _| {
        Some(bits(&bench, comparator, (index % 2 == 1, first_seed + (index / 2) as u64)))
    })?;
    let spread = |noisy: bool, of: &dyn Fn(&BitMeans) -> f64| {
        let runs = found.iter().skip(usize::from(noisy)).step_by(2);
        SeedSpread::of(runs.map(|bits| bits.as_ref().map_or(f64::NAN, of) / MILLI_G))
    };
    let bound = settled_sd(&bench, INTERVAL_S)? / MILLI_G;
    let mut table = TextTable::new(
        "What is left of the acceleration's error in decimated bits, in mg",
        [
            ColumnHead::text("decimated by"),
            ColumnHead::number("window", "µs"),
            ColumnHead::number("without noise", "mg"),
            ColumnHead::number("with noise", "mg"),
        ],
    );
    let mut panel = Panel::new(Axis::new("window", "s").log(), Axis::new("error that is left", "g").log());
    let names = ["means", "means of means", "means of means of means"];
    let roles = [SeriesRole::Measured, SeriesRole::Model, SeriesRole::Estimate];
    for ((order, name), role) in names.into_iter().enumerate().zip(roles) {
        for (place, count) in WINDOWS.iter().enumerate() {
            table.push([
                name.to_owned(),
                format!("{:.0}", 1e6 * INTERVAL_S * *count as f64),
                spread(false, &|bits| bits.left[place][order]).to_text(),
                spread(true, &|bits| bits.left[place][order]).to_text(),
            ]);
        }
        let line = |noisy| -> Vec<(f64, f64)> {
            let of = |(place, count): (usize, &usize)| {
                (INTERVAL_S * *count as f64, 1e-3 * spread(noisy, &|bits| bits.left[place][order]).median)
            };
            WINDOWS.iter().enumerate().map(of).collect()
        };
        panel = panel.with(Series::line(name, role, line(true)));
        if order == ORDERS - 1 {
            panel = panel.with(Series::line("the last, without noise", SeriesRole::Bound, line(false)));
        }
    }
    let quiet = |place: usize| spread(false, &|bits| bits.left[place][2]).median;
    let filter = spread(true, &|bits| bits.filter);
    Ok(Item::new(&ONE_BIT)
        .check(Check::claim(
            "the mass shapes the noise of the bits: ten times the window leaves far less than √10 times less",
            "sections 1.2 and 2: ΔΣ loops as over-sampling converters",
            format!(
                "{:.0} times less from 50 to 500 µs, without other noise",
                quiet(0) / quiet(3)
            ),
            "more than ten times",
            quiet(0) / quiet(3) > 10.0,
        ))
        .check(Check::claim(
            "the loop of one bit has a lower noise floor",
            "the more advanced the control, \"the smaller noise floor\" (page 5)",
            format!(
                "the same filter reaches {} mg on it, where {bound:.2} mg is the bound of the device, with any loop",
                filter.to_text()
            ),
            "5 % below that bound",
            filter.median < 0.95 * bound,
        ))
        .remark(
            "The loop of the thesis's instrument (ε_r = 4) with a comparator at 1 MHz in the place of its controller: ±V_B/2, \
             10 g full scale, a lead of 5.6 µs. What the bits push is what the acceleration does, so that their mean is the \
             acceleration. How they are averaged decides: a plain mean sees the jitter of the mass at its two ends.",
        )
        .remark(
            "Two levels make a force that is linear in the bits, and the output needs no converter; but the molecules and \
             the readout are those of the same device, and what they leave is the same for every loop.",
        )
        .table(table)
        .figure(
            Figure::new(
                "one-bit-loop_windows",
                "A loop of one bit, decimated",
                "What is left of an acceleration's error after means of this window, with the device's noise.",
            )
            .with(panel),
        ))
}

/// The standard deviation of the acceleration that the honest filter claims once it has settled, in m/s².
fn settled_sd(bench: &AccelerometerBench, interval_s: f64) -> Result<f64, ReproduceError> {
    settled_acceleration_sd(bench.hardware(), interval_s).map_err(|e| failed("the settled filter")(e.into()))
}

/// Samples that are made one: odd numbers, so that a mean has a middle.
const FEWER: [usize; 4] = [1, 5, 51, 501];

/// An error in m/s², and what the filter claims.
type ErrorAndClaim = (f64, f64);

/// Without and with an averaging filter, for each of [`FEWER`].
fn decimated(bench: &AccelerometerBench, seed: u64) -> Option<[[ErrorAndClaim; 2]; FEWER.len()]> {
    let record = BenchRecord::of(&bench.run(Acceleration::Chance, SKIP_S + 0.4, seed));
    let mut judged = [[(f64::NAN, f64::NAN); 2]; FEWER.len()];
    for (row, count) in judged.iter_mut().zip(FEWER) {
        for (entry, averaged) in row.iter_mut().zip([false, true]) {
            let fewer = record.decimated(count, averaged);
            let mut told = bench.clone();
            if averaged {
                told.hardware.noise_variance /= count as f64;
            }
            let trajectory = told.estimate(BenchFilter::Honest, &fewer)?;
            let estimated = &trajectory.state("acceleration")?.mean;
            let error = rms(differences(estimated, &fewer.acceleration, fewer.from()));
            *entry = (error, settled_sd(&told, fewer.interval_s).ok()?);
        }
    }
    Some(judged)
}

fn decimation(work: &PartWork) -> Result<Item, ReproduceError> {
    let closed = AccelerometerBench::new(4.0)?;
    let benches = [closed.open(), closed.clone()];
    let seeds = match work.effort {
        Effort::Quick => 3,
        Effort::Full => 30,
    };
    let first_seed = work.seed;
    let found = work.map("decimation", (2 * seeds, 1), |index, _| {
        Some(decimated(&benches[index % 2], first_seed + (index / 2) as u64))
    })?;
    let spread = |loop_is_closed: bool, of: &dyn Fn(&[[ErrorAndClaim; 2]; FEWER.len()]) -> f64| {
        let runs = found.iter().skip(usize::from(loop_is_closed)).step_by(2);
        SeedSpread::of(runs.map(|found| found.as_ref().map_or(f64::NAN, of) / MILLI_G))
    };
    let mut table = TextTable::new(
        "The acceleration by the honest filter, from fewer samples (1 MHz before), in mg",
        [
            ColumnHead::text("structure"),
            ColumnHead::number("samples made one", ""),
            ColumnHead::number("interval", "µs"),
            ColumnHead::number("one of them taken", "mg"),
            ColumnHead::number("claimed", "mg"),
            ColumnHead::number("their mean taken", "mg"),
            ColumnHead::number("claimed", "mg"),
        ],
    );
    for (closed, name) in [(false, "open loop"), (true, "closed loop")] {
        for (place, count) in FEWER.iter().enumerate() {
            let of = |averaged: usize| spread(closed, &move |judged| judged[place][averaged].0).to_text();
            let claimed = |averaged: usize| {
                format!("{:.2}", spread(closed, &move |judged| judged[place][averaged].1).median)
            };
            table.push([
                name.to_owned(),
                count.to_string(),
                format!("{:.0}", 1e6 * INTERVAL_S * *count as f64),
                of(0),
                claimed(0),
                of(1),
                claimed(1),
            ]);
        }
    }
    let of = |closed, place: usize, averaged: usize| {
        spread(closed, &move |judged| judged[place][averaged].0).median
    };
    let (taken, mean) = (of(false, 2, 0) / of(false, 0, 0), of(false, 2, 1) / of(false, 0, 0));
    let five = of(true, 1, 1) / of(true, 0, 0);
    Ok(Item::new(&DECIMATION)
        .check(Check::claim(
            "an exact step is stable at any interval; 5 µs are needed for Euler's only",
            "\"the sampling time is smaller than 5 µs\" (page 72)",
            format!("{mean:.2} times the error at 1 µs where 51 samples are made one, in the open loop"),
            "less than 1.1 times",
            mean < 1.1,
        ))
        .check(Check::claim(
            "a closed loop bears 5 µs by means",
            "section 6.2",
            format!("{five:.2} times the error at 1 µs"),
            "less than 1.1 times",
            five < 1.1,
        ))
        .remark(format!(
            "What the thesis does not treat: an averaging filter before the decimation. Where 51 samples are made one the error \
             is {taken:.2} times that at 1 µs without it, and {mean:.2} times with it."
        ))
        .remark(
            "Every n-th sample alone folds all noise of the band into what is left: the filter has one n-th of the looks. The \
             mean of n has their noise; what it loses is what moves within n samples. In the closed loop that is the \
             feedback's own jitter, up to the loop's bandwidth, so that its intervals must be short against it. A mean stands for the \
             middle of its samples and so looks half of them ahead, by which the open loop's error even falls.",
        )
        .remark(
            "What a step costs against the 5 µs, in f32 and f64: `cargo bench -p kalmems-models --bench speed`; it is timed \
             where it runs, and stands in the book.",
        )
        .table(table))
}
