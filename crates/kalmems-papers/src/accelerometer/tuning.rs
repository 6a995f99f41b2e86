//! Table IV and Figures 27 to 31: a filter that is told other noise than there is.

use super::bench::{AccelerometerBench, BenchFilter, BenchRecord, SKIP_S, decibels, differences, rms};
use super::published::TUNINGS;
use crate::estimate::Trajectory;
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// Numbers.
pub static TABLE_IV: ItemHead = ItemHead {
    key: "table-iv",
    title: "the filter with other noise in its model than in the device",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "Z", label: "Table IV", page: "page 69" }],
    origin: ValueOrigin::Computed,
};

/// Pictures.
pub static FIGURES: ItemHead = ItemHead {
    key: "figures-27-31",
    title: "the estimated output, with other noise in the model than in the device",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "Z", label: "Figure 27", page: "page 64" },
        PaperPlace { paper: "Z", label: "Figure 28", page: "page 65" },
        PaperPlace { paper: "Z", label: "Figure 29", page: "page 66" },
        PaperPlace { paper: "Z", label: "Figure 30", page: "page 67" },
        PaperPlace { paper: "Z", label: "Figure 31", page: "page 68" },
    ],
    origin: ValueOrigin::Computed,
};

/// The table's rows of equal filters, Q × 10 and R / 10, and Q / 10 and R × 10, differ by up to 5 %: by chance.
const OF_EQUAL_ROWS: CheckTolerance = CheckTolerance::part(0.1, "twice what rows of equal filters differ by");

/// One period of the signal after the settling.
const DURATION_S: f64 = SKIP_S + 0.1;
const AMPLITUDE_G: f64 = 0.1;
/// Q over R, both sides of the stated, in decades.
const DECADES: std::ops::RangeInclusive<i32> = -6..=4;

/// How a filter has the acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AccelerationModel {
    /// As a true input.
    Acceleration,
    /// As an input that is always 0: the same filter, without the answer.
    Nothing,
    /// As a state.
    ThatThereIsOne,
}

const KINDS: [AccelerationModel; 3] =
    [AccelerationModel::Acceleration, AccelerationModel::Nothing, AccelerationModel::ThatThereIsOne];

/// The linear instrument in its loop: with readout noise, and no push of the molecules, which is what Table IV tells of.
fn record(seed: u64) -> Result<(AccelerometerBench, BenchRecord), ReproduceError> {
    let mut bench = AccelerometerBench::linear()?;
    bench.hardware.force_density = 0.0;
    let record = BenchRecord::of(&bench.sine(AMPLITUDE_G, DURATION_S, seed));
    Ok((bench, record))
}

/// What a filter that is told these factors of Q and R makes of a record.
fn estimate(
    bench: &AccelerometerBench,
    record: &BenchRecord,
    knows: AccelerationModel,
    factors: [f64; 2],
) -> Option<Trajectory> {
    let tuned = bench.tuned(factors);
    match knows {
        AccelerationModel::Acceleration => tuned.estimate(BenchFilter::Told, record),
        AccelerationModel::ThatThereIsOne => tuned.estimate(BenchFilter::Honest, record),
        AccelerationModel::Nothing => {
            let blind = BenchRecord { acceleration: vec![0.0; record.acceleration.len()], ..record.clone() };
            tuned.estimate(BenchFilter::Told, &blind)
        }
    }
}

/// The error of the displacement.
#[derive(Clone, Copy, Debug)]
struct TuningResult {
    sd_m: f64,
    largest_m: f64,
    snr_db: f64,
    /// Whether every variance was a number of 0 or more at every step.
    is_positive: bool,
}

fn found(
    bench: &AccelerometerBench,
    record: &BenchRecord,
    knows: AccelerationModel,
    factors: [f64; 2],
) -> Option<TuningResult> {
    let trajectory = estimate(bench, record, knows, factors)?;
    let displacement = trajectory.state("displacement")?;
    let from = record.from();
    let errors = || differences(&displacement.mean, &record.displacement, from);
    let sd_m = rms(errors());
    Some(TuningResult {
        sd_m,
        largest_m: errors().fold(0.0, |most: f64, error| most.max(error.abs())),
        snr_db: decibels(rms(record.displacement[from..].iter().copied()) / sd_m),
        is_positive: trajectory.stops.is_empty()
            && trajectory.states.iter().all(|state| state.sd.iter().all(|sd| *sd >= 0.0)),
    })
}

/// Q and R whose ratio is this many decades off.
fn factors(decades: i32) -> [f64; 2] {
    let half = 10_f64.powf(0.5 * f64::from(decades));
    [half, 1.0 / half]
}

/// Computes both.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let seeds: usize = match work.effort {
        Effort::Quick => 2,
        Effort::Full => 20,
    };
    let records: Vec<(AccelerometerBench, BenchRecord)> =
        (0..seeds as u64).map(|seed| record(work.seed + seed)).collect::<Result<_, _>>()?;
    // The six rows of the table, then every ratio for every kind of filter.
    let asked: Vec<(AccelerationModel, [f64; 2])> = TUNINGS
        .iter()
        .map(|row| (AccelerationModel::Acceleration, row.factors))
        .chain(KINDS.iter().flat_map(|kind| DECADES.map(|decades| (*kind, factors(decades)))))
        .collect();
    let found = work.map("tunings", (asked.len() * seeds, 1), |index, _| {
        let ((bench, record), (knows, factors)) = (&records[index % seeds], asked[index / seeds]);
        Some(found(bench, record, knows, factors))
    })?;
    let spread = |place: usize, of: &dyn Fn(&TuningResult) -> f64| {
        let runs = &found[place * seeds..(place + 1) * seeds];
        SeedSpread::of(runs.iter().map(|found| found.as_ref().map_or(f64::NAN, of)))
    };
    let is_positive = found[..].iter().flatten().all(|found| found.is_positive);
    let (bench, record) = &records[0];
    Ok(vec![table(&spread, is_positive), figures(bench, record)])
}

/// Where a kind's run at this ratio is among all that is asked.
fn place(knows: AccelerationModel, decades: i32) -> usize {
    let kind = KINDS.iter().position(|kind| *kind == knows).unwrap_or(0);
    let each = DECADES.count();
    let passed = DECADES.take_while(|other| *other < decades).count();
    TUNINGS.len() + kind * each + passed
}

type Spreads<'a> = &'a dyn Fn(usize, &dyn Fn(&TuningResult) -> f64) -> SeedSpread;

fn table(spread: Spreads, is_positive: bool) -> Item {
    let mut item = Item::new(&TABLE_IV);
    let mut rows = TextTable::new(
        "Table IV, with the acceleration as an input",
        [
            ColumnHead::text("input"),
            ColumnHead::number("standard deviation, thesis", "pm"),
            ColumnHead::number("ours", "pm"),
            ColumnHead::number("largest error, thesis", "pm"),
            ColumnHead::number("ours", "pm"),
            ColumnHead::number("SNR, thesis", "dB"),
            ColumnHead::number("ours", "dB"),
        ],
    );
    for (place, row) in TUNINGS.iter().enumerate() {
        let sd = spread(place, &|f| 1e12 * f.sd_m);
        item = item.check(Check::value(
            format!("standard deviation, {}", row.words),
            "pm",
            row.sd_pm,
            sd,
            OF_EQUAL_ROWS,
        ));
        let exceeds = if row.snr_db >= 40.0 { ">" } else { "" };
        rows.push([
            row.words.to_owned(),
            significant(row.sd_pm),
            sd.to_text(),
            significant(row.largest_pm),
            spread(place, &|f| 1e12 * f.largest_m).to_text(),
            format!("{exceeds}{}", row.snr_db),
            spread(place, &|f| f.snr_db).to_text(),
        ]);
    }
    let sd = |knows, decades| spread(place(knows, decades), &|f| 1e12 * f.sd_m).median;
    let falls = |knows| DECADES.zip(DECADES.skip(1)).all(|(less, more)| sd(knows, less) < sd(knows, more));
    let lowest = |knows| DECADES.min_by(|a, b| sd(knows, *a).total_cmp(&sd(knows, *b))).unwrap_or(0);
    let further = sd(AccelerationModel::Acceleration, -2) / sd(AccelerationModel::Acceleration, -4);
    let blind = sd(AccelerationModel::Nothing, -2) / sd(AccelerationModel::Nothing, 0);
    let honest = sd(AccelerationModel::ThatThereIsOne, lowest(AccelerationModel::ThatThereIsOne));
    item.check(Check::claim(
        "with the acceleration as an input, a smaller Q and a larger R are better",
        "section 5.3",
        "from one ratio to the next, over ten decades",
        "less from each ratio to the next lower one",
        falls(AccelerationModel::Acceleration),
    ))
    .check(Check::claim(
        "more than ten times changes nothing",
        "\"will remain unchanged\" (page 68)",
        format!("ten times more of both makes the error {further:.1} times smaller again"),
        "less than 10 %",
        further < 1.1,
    ))
    .check(Check::claim(
        "a smaller Q and a larger R are better where the acceleration is not known",
        "an accelerometer is to measure it",
        format!(
            "the same filter without it: {blind:.0} times worse with Q/10 and R·10; its best is at {} decades",
            signed(lowest(AccelerationModel::Nothing))
        ),
        "a smaller error with Q/10 and R·10",
        blind < 1.0,
    ))
    .check(Check::claim(
        "too small a Q and too large an R lose the positive covariance",
        "\"estimation covariance P not semi-positive\" (page 68)",
        if is_positive { "no variance was negative in any run, six decades down" } else { "a variance was lost" },
        "a variance below 0 in a run",
        !is_positive,
    ))
    .remark(format!(
        "Why it falls: with the acceleration as an input, and without another force on the mass, the model alone is right, and every \
         look at the noisy output makes it worse. The printed trend says that the filter was given the answer, not that it \
         is tuned better. With the acceleration as a state the error is {} pm at best, at {} decades, where the molecules that are not there \
         count for little.",
        significant(honest),
        signed(lowest(AccelerationModel::ThatThereIsOne))
    ))
    .remark(
        "Run without the molecules' push, which alone gives the printed standard deviations; on the linear device of equation \
         5-1, in which the plates take nothing from the spring; at 1 MHz (1.5 MHz would fit better). The \
         table's SNR fits the amplitude of the displacement over its error better than the usual definition, used for ours. \
         A factor 10 of Q is the same filter as one of 1/R, so that the printed rows that should agree show the chance in \
         the others.",
    )
    .table(rows)
    .figure(figure(spread))
}

fn signed(decades: i32) -> String {
    format!("{decades:+}")
}

fn figure(spread: Spreads) -> Figure {
    let mut panel = Panel::new(
        Axis::new("Q/R over the stated", "").log(),
        Axis::new("rms error of the displacement", "m").log(),
    );
    for (knows, label, role) in [
        (AccelerationModel::Acceleration, "with the acceleration as an input", SeriesRole::Model),
        (AccelerationModel::Nothing, "the same filter without it", SeriesRole::Measured),
        (AccelerationModel::ThatThereIsOne, "acceleration as a state", SeriesRole::Estimate),
    ] {
        let points =
            DECADES.map(|decades| (10_f64.powi(decades), spread(place(knows, decades), &|f| f.sd_m).median));
        panel = panel.with(Series::line(label, role, points.collect::<Vec<_>>()));
    }
    let printed =
        TUNINGS.iter().map(|row| (row.factors[0] / row.factors[1], 1e-12 * row.sd_pm)).collect::<Vec<_>>();
    panel = panel.with(Series::points("thesis, Table IV", SeriesRole::Reference, printed));
    Figure::new(
        "table-iv_trend",
        "Table IV, and its reversal",
        "With the true acceleration as an input the error falls as Q/R does. The same filter without it has its least error \
         elsewhere and loses the signal as Q/R falls; with the acceleration as a state there is a wide minimum.",
    )
    .with(panel)
}

fn figures(bench: &AccelerometerBench, record: &BenchRecord) -> Item {
    let mut figure = Figure::new(
        "figures-27-31_outputs",
        "Figures 27 to 31: error of the estimated output",
        "With the acceleration as an input, and other Q and R than the stated. A sample of the output itself has an error of 221 µV rms.",
    );
    let mut left = Vec::new();
    for (place, row) in TUNINGS.iter().enumerate().skip(1) {
        let Some(trajectory) = estimate(bench, record, AccelerationModel::Acceleration, row.factors) else {
            continue;
        };
        let Some(displacement) = trajectory.state("displacement") else { continue };
        let readout = bench.closed.readout;
        let errors = displacement.mean.iter().zip(&record.displacement);
        let volts = errors.map(|(estimated, x)| readout.voltage(*estimated) - readout.voltage(*x));
        let points: Vec<(f64, f64)> = record.time_s.iter().copied().zip(volts).step_by(20).collect();
        let panel = Panel::new(Axis::new("time", "s"), Axis::new(row.words, "V").between(-2e-4, 2e-4))
            .with(Series::line("", SeriesRole::Estimate, points));
        figure = figure.with(if place == 1 { panel } else { panel.sharing_x() });
        left.push(rms(differences(&displacement.mean, &record.displacement, record.from())));
    }
    let best = left.iter().copied().fold(f64::INFINITY, f64::min);
    Item::new(&FIGURES)
        .check(Check::claim(
            "the estimate is smoothest with R · 10 and Q / 10",
            "Figure 31",
            format!("rms errors of {} pm", left.iter().map(|v| significant(1e12 * v)).collect::<Vec<_>>().join(", ")),
            "the least of the five",
            left.last().is_some_and(|last| *last <= best),
        ))
        .remark("In the order of the figures; all with the acceleration as an input. Figure 31's caption is that of Figure 30.")
        .figure(figure)
}
