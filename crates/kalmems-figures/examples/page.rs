//! A page with plots to look into: `cargo run --example page -- page.html`.

use kalmems_figures::{
    Axis, ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, Series, SeriesRole,
    TextTable, Track,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("name the file to write")?;
    Ok(std::fs::write(file, page().to_html()?)?)
}

fn page() -> Page {
    let verdicts = TextTable::new(
        "",
        [
            ColumnHead::text("filter"),
            ColumnHead::number("rms error", "deg"),
            ColumnHead::number("mean NIS", ""),
            ColumnHead::number("samples", ""),
            ColumnHead::text("verdict"),
        ],
    )
    .row(["extended Kalman filter", "0.0213", "1.003", "24000", "passes"])
    .row(["model alone", "1.54", "–", "24000", "astray"])
    .with_verdicts("verdict", [NoticeSeverity::Ok, NoticeSeverity::Failure]);
    Page::new("A page to look into", "simulated, as an example")
        .with(
            PageSection::new("Verdict")
                .part(PagePart::Verdict)
                .notice(NoticeSeverity::Ok, "The extended Kalman filter passes.")
                .table(verdicts),
        )
        .with(PageSection::new("Motion").figure(motion()))
        .with(PageSection::new("Noise").part(PagePart::Evidence).figure(spectrum()).figure(long()))
        .with(PageSection::new("How it was made").part(PagePart::Made).preformatted("Settings", "seed = 7\n"))
}

fn noise(i: u32) -> f64 {
    f64::from(i.wrapping_mul(2_654_435_761).rotate_left(7).wrapping_mul(2_246_822_519) >> 8)
        / f64::from(1_u32 << 24)
        - 0.5
}

fn motion() -> Figure {
    let time = |i: u32| 1e-6 * f64::from(i);
    let angle = |i: u32| 9.0 * (f64::from(i) * 0.03).sin();
    let sd = |i: u32| 0.02 + 2.0 * (-f64::from(i) / 3000.0).exp();
    let mut track = Track::new(3);
    for i in 0..24_000 {
        track.push(time(i), &[angle(i), angle(i) - 3.0 * sd(i), angle(i) + 3.0 * sd(i)]);
    }
    let last = 23_000..24_000;
    let of = |points: fn(f64, f64) -> (f64, f64)| last.clone().map(move |i| points(time(i), angle(i)));
    let angles = Panel::new(Axis::new("time", "s"), Axis::new("angle", "deg"))
        .with(Series::line("reference", SeriesRole::Reference, of(|t, a| (t, a + 0.01))))
        .with(
            Series::band(
                "±3σ",
                SeriesRole::Estimate,
                last.clone().map(|i| (time(i), angle(i) - 3.0 * sd(i), angle(i) + 3.0 * sd(i))),
            )
            .of_all(&track, [1, 2]),
        )
        .with(Series::line("estimate", SeriesRole::Estimate, of(|t, a| (t, a))).of_all(&track, [0, 0]));
    let signal = Panel::new(Axis::new("time", "s"), Axis::new("signal", "V"))
        .with(Series::points(
            "measured",
            SeriesRole::Measured,
            (0..24_000).map(|i| (time(i), 1e-3 * noise(i))),
        ))
        .with(Series::level("limit", SeriesRole::Bound, 6e-4));
    Figure::new("motion", "Motion", "The end of the recording at first, and all of it to look into.")
        .with(signal)
        .with(angles.sharing_x())
}

fn spectrum() -> Figure {
    let line =
        (1..2000).map(|k| (10.0 * f64::from(k), 1e-9 * (1.0 + 50.0 / f64::from(k)) * (1.2 + noise(k))));
    let panel = Panel::new(Axis::new("frequency", "Hz").log(), Axis::new("density", "V^2/Hz").log());
    Figure::new("spectrum", "Spectrum", "Of the innovations.").with(panel.with(Series::line(
        "innovations",
        SeriesRole::Estimate,
        line,
    )))
}

fn long() -> Figure {
    let panel = Panel::new(Axis::new("time", "s"), Axis::new("value", "V"));
    let points = (0..3_000_000).map(|i| {
        (
            1e-6 * f64::from(i),
            if (1_000_000..1_200_000).contains(&i) {
                f64::NAN
            } else {
                noise(i) + (f64::from(i) * 5e-6).sin()
            },
        )
    });
    Figure::new("long", "Three million samples", "Drawn as a band.").with(panel.with(Series::line(
        "value",
        SeriesRole::Measured,
        points,
    )))
}
