//! A report with made-up data that resembles a real one.

use kalmems::figures::{
    Axis, ColumnHead, Figure, NoticeSeverity, Page, PageSection, Panel, Series, SeriesRole, TextTable,
};
use std::f64::consts::TAU;

/// Normal numbers, good enough for a picture: sums of twelve uniform ones.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        std::iter::repeat_with(uniform).take(12).sum::<f64>() - 6.0
    }
}

const RATE: f64 = 1e6;
const RESONANCE: f64 = 15_700.0;

fn line(label: &str, role: SeriesRole, t: &[f64], f: impl Fn(usize) -> f64 + Clone) -> Series {
    Series::line(label, role, t.iter().enumerate().map(move |(i, t)| (*t, f(i))))
}

pub fn signals() -> Figure {
    let start = 22e-3;
    let t: Vec<f64> = (0..=300).map(|i| start + f64::from(i) / RATE).collect();
    let mut noise = Noise(1);
    let angle: Vec<f64> = t.iter().map(|t| 8.1 * (TAU * RESONANCE * t).sin()).collect();
    let signal: Vec<f64> = angle.iter().map(|a| 0.9 - 0.011 * a * a).collect();
    let measured: Vec<f64> = signal.iter().map(|s| s + 0.03 * noise.next()).collect();
    let estimate: Vec<f64> = angle.iter().map(|a| a + 0.12 * noise.next()).collect();
    let time = || Axis::new("time", "s");
    let drive = |i: usize| if (t[i] * 2.0 * RESONANCE).fract() < 0.5 { 90.0 } else { 0.0 };
    Figure::new(
        "signals",
        "Drive, signal and angle",
        "The drive voltage, the capacitive signal as measured and as the filter predicts it, and the angle \
         that the filter says against the reference, over some cycles of the test recording.",
    )
    .with(Panel::new(time(), Axis::new("drive voltage", "V")).with(line(
        "drive",
        SeriesRole::Input,
        &t,
        drive,
    )))
    .with(
        Panel::new(time(), Axis::new("signal", "V"))
            .sharing_x()
            .with(line("measured", SeriesRole::Measured, &t, |i| measured[i]))
            .with(line("predicted", SeriesRole::Model, &t, |i| signal[i])),
    )
    .with(
        Panel::new(time(), Axis::new("angle", "deg"))
            .sharing_x()
            .with(line("reference", SeriesRole::Reference, &t, |i| angle[i]))
            .with(line("estimate", SeriesRole::Estimate, &t, |i| estimate[i]))
            .with(Series::band(
                "±3σ",
                SeriesRole::Estimate,
                t.iter().zip(&estimate).map(|(t, e)| (*t, e - 0.6, e + 0.6)),
            )),
    )
}

fn long_time() -> Vec<f64> {
    (0..24_000).map(|i| f64::from(i) / RATE).collect()
}

pub fn error() -> Figure {
    let t = long_time();
    let mut noise = Noise(2);
    let sigma = |t: f64| 0.02 + 0.3 * (-t / 1.5e-3).exp();
    let mut error: Vec<f64> = t.iter().map(|t| sigma(*t) * noise.next()).collect();
    error[9000..9300].fill(f64::NAN);
    let band = t.iter().map(|t| (*t, -3.0 * sigma(*t), 3.0 * sigma(*t)));
    Figure::new("error", "Error of the angle", "Estimate minus reference, and three standard deviations.")
        .with(
            Panel::new(Axis::new("time", "s"), Axis::new("angle error", "deg"))
                .with(line("estimate − reference", SeriesRole::Estimate, &t, |i| error[i]))
                .with(Series::band("±3σ", SeriesRole::Estimate, band)),
        )
}

pub fn consistency() -> Figure {
    let t = long_time();
    let mut noise = Noise(3);
    let nis: Vec<f64> = t.iter().map(|_| noise.next().powi(2)).collect();
    let window = 500;
    let mean = t
        .iter()
        .enumerate()
        .skip(window)
        .step_by(20)
        .map(|(i, t)| (*t, nis[i - window..i].iter().sum::<f64>() / window as f64));
    let interval = [(0.0, 0.87, 1.13), (24e-3, 0.87, 1.13)];
    Figure::new(
        "nis",
        "Normalised innovations squared",
        "Each sample, the mean over 0.5 ms, and what χ² with one degree of freedom allows for that mean.",
    )
    .with(
        Panel::new(Axis::new("time", "s"), Axis::new("NIS", "1").log().between(1e-4, 40.0))
            .with(Series::points(
                "per sample",
                SeriesRole::Measured,
                t.iter().copied().zip(nis.iter().copied()),
            ))
            .with(Series::line("mean over 0.5 ms", SeriesRole::Estimate, mean))
            .with(Series::band("95 % interval of the mean", SeriesRole::Bound, interval)),
    )
}

pub fn phase() -> Figure {
    let mut noise = Noise(4);
    let cycles: Vec<(f64, f64)> =
        (0..350).map(|i| (f64::from(i) / RESONANCE, 12e-9 * noise.next() - 4e-9)).collect();
    Figure::new(
        "phase",
        "Phase error per cycle",
        "Zero crossings of the estimate against those of the reference.",
    )
    .with(
        Panel::new(Axis::new("time", "s"), Axis::new("phase error", "s"))
            .with(Series::points("per cycle", SeriesRole::Estimate, cycles))
            .with(Series::level("bound, ±1σ", SeriesRole::Bound, 10e-9))
            .with(Series::level("", SeriesRole::Bound, -10e-9)),
    )
}

pub fn spectrum() -> Figure {
    let density = |f: f64, q: f64| {
        let ratio = f / RESONANCE;
        1e-12 / ((1.0 - ratio.powi(2)).powi(2) + (ratio / q).powi(2))
    };
    let curve = move |q: f64| {
        (0..2000).map(move |i| {
            let f = 10_f64.powf(2.0 + f64::from(i) / 500.0);
            (f, density(f, q))
        })
    };
    Figure::new("spectrum", "Noise density", "Three filters and the amplifier.").with(
        Panel::new(Axis::new("frequency", "Hz").log(), Axis::new("power density", "V^2/Hz").log())
            .with(Series::line("extended", SeriesRole::Estimate, curve(100.0)))
            .with(Series::line("steady state", SeriesRole::Estimate, curve(30.0)))
            .with(Series::line("unscented", SeriesRole::Estimate, curve(10.0)))
            .with(Series::level("amplifier", SeriesRole::Bound, 3e-13)),
    )
}

pub fn odd() -> Figure {
    let panel = |x: Axis, y: Axis, label: &str, data: Vec<(f64, f64)>| {
        Panel::new(x, y).with(Series::line(label, SeriesRole::Other, data))
    };
    let of = |f: fn(f64) -> (f64, f64)| (0..50).map(|i| f(f64::from(i))).collect::<Vec<_>>();
    let sample = || Axis::new("sample", "");
    Figure::new(
        "odd",
        "Odd data: <script>alert(1)</script> & \"quotes\"",
        "Tiny, constant, empty & <b>odd</b> data.",
    )
    .with(panel(sample(), Axis::new("tiny", "F"), "<i>10⁻²¹</i>", of(|i| (i, 1e-21 * (i % 7.0)))))
    .with(panel(sample(), Axis::new("constant", "Hz"), "constant", of(|i| (i, RESONANCE))))
    .with(panel(
        Axis::new("time", "s"),
        Axis::new("a resonance with a label that is too long for the height of its panel", "Hz"),
        "resonance",
        of(|i| (100.0 + 1e-5 * i, RESONANCE + 1e-4 * (i % 9.0))),
    ))
    .with(panel(Axis::new("time", "s"), Axis::new("nothing", "V"), "empty", Vec::new()))
    .with(panel(sample(), Axis::new("cut", "V").between(-1.0, 1.0), "ramp", of(|i| (i, 0.1 * i - 3.0))))
}

pub fn all() -> [Figure; 6] {
    [signals(), error(), consistency(), phase(), spectrum(), odd()]
}

pub fn demo() -> Page {
    let columns = [
        ColumnHead::text("filter"),
        ColumnHead::number("rms error", "deg"),
        ColumnHead::number("phase error", "ns"),
        ColumnHead::text("consistent"),
    ];
    let table = TextTable::new("Errors against the reference", columns)
        .row(["extended Kalman filter", "0.0213", "12.1", "yes"])
        .row(["steady-state gain", "0.1420", "−240.0", "no"]);
    let result = PageSection::new("Result")
        .notice(
            NoticeSeverity::Warning,
            "The estimate failed its consistency test: the mean NIS is 1.42; expected 0.98 to 1.02.",
        )
        .notice(
            NoticeSeverity::Note,
            "Three samples of the recording are missing; the filter predicted across them.",
        )
        .notice(NoticeSeverity::Ok, "The truth was read by the evaluation alone.")
        .paragraph("The filter started at rest and was given the drive voltage and the capacitive signal.")
        .table(table)
        .key_values([("recording", "scanner_test.csv"), ("samples", "24 000"), ("rate", "1 MHz")]);
    let [signals, error, consistency, phase, spectrum, odd] = all();
    Page::new("Shared scanner", "Test recording, 24 000 samples at 1 MHz, seed 7")
        .with(result)
        .with(PageSection::new("Signals").figure(signals).figure(error).figure(consistency).figure(phase))
        .with(PageSection::new("Other").figure(spectrum).figure(odd))
        .with(
            PageSection::new("How it was made")
                .preformatted("Resolved configuration", "seed = 7\n[device]\nname = \"<scanner>\"\n"),
        )
}
