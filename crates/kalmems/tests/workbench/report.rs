//! The report page and its figures, as another module uses them.
//!
//! What is drawn is read back from the SVG and compared with the data that went in.

use crate::report_demo;
use crate::report_demo::{all, demo, error, odd, signals, spectrum};
use kalmems::figures::{Axis, Figure, Page, PageSection, Panel, Series, SeriesRole, Shape};
use proptest::prelude::*;
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

/// Written to `report-demo/` in the test folder of the build, to be looked at.
#[test]
fn the_demo_can_be_looked_at() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report-demo");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("page.html"), demo().to_html().unwrap()).unwrap();
    for figure in all() {
        std::fs::write(folder.join(format!("{}.svg", figure.id)), figure.to_svg()).unwrap();
    }
}

/// A panel as the SVG describes it.
struct Drawn {
    axes: BTreeMap<String, f64>,
    log: [bool; 2],
    /// Label and runs of points, in units of the drawing.
    series: Vec<(String, Vec<Vec<[f64; 2]>>)>,
    /// Text, x, y, whether it belongs to the x axis.
    labels: Vec<(String, f64, f64, bool)>,
}

impl Drawn {
    fn edge(&self, name: &str) -> f64 {
        self.axes[&format!("data-{name}")]
    }

    fn invert(&self, share: f64, low: &str, high: &str, log: bool) -> f64 {
        let (low, high) = (self.edge(low), self.edge(high));
        if log {
            10_f64.powf(low.log10() + share * (high.log10() - low.log10()))
        } else {
            low + share * (high - low)
        }
    }

    /// The value at a point of the drawing.
    fn value(&self, point: [f64; 2]) -> [f64; 2] {
        let [left, right, top, bottom] = ["left", "right", "top", "bottom"].map(|name| self.edge(name));
        [
            self.invert((point[0] - left) / (right - left), "x-low", "x-high", self.log[0]),
            self.invert((bottom - point[1]) / (bottom - top), "y-low", "y-high", self.log[1]),
        ]
    }

    /// What one unit of the drawing means on linear axes.
    fn unit(&self) -> [f64; 2] {
        [
            (self.edge("x-high") - self.edge("x-low")) / (self.edge("right") - self.edge("left")),
            (self.edge("y-high") - self.edge("y-low")) / (self.edge("bottom") - self.edge("top")),
        ]
    }
}

fn class<'a>(node: &Node<'a, 'a>) -> &'a str {
    node.attribute("class").unwrap_or("")
}

fn read(svg: &str) -> Vec<Drawn> {
    let document = Document::parse(svg).unwrap();
    let mut panels = Vec::new();
    let mut series = Vec::new();
    for group in document.root_element().children().filter(Node::is_element) {
        if class(&group) == "series" {
            let runs = group.children().filter_map(|p| p.attribute("d")).flat_map(runs).collect();
            series.push((group.attribute("data-label").unwrap().to_owned(), runs));
        }
        if class(&group) != "axes" {
            continue;
        }
        let axes =
            group.attributes().filter_map(|a| Some((a.name().to_owned(), a.value().parse().ok()?))).collect();
        let number = |node: &Node, name| node.attribute(name).unwrap().parse::<f64>().unwrap();
        let labels = group
            .children()
            .filter(|node| node.attribute("font-size") == Some("11"))
            .map(|node| {
                let text = node.text().unwrap_or("").to_owned();
                (
                    text,
                    number(&node, "x"),
                    number(&node, "y"),
                    node.attribute("text-anchor") == Some("middle"),
                )
            })
            .collect();
        let is_log = |name| group.attribute(name) == Some("log");
        panels.push(Drawn {
            axes,
            log: [is_log("data-x-scale"), is_log("data-y-scale")],
            series: std::mem::take(&mut series),
            labels,
        });
    }
    panels
}

/// Absolute moves, then relative lines; `h0` ends a dot.
fn runs(d: &str) -> Vec<Vec<[f64; 2]>> {
    d.split('M')
        .filter(|run| !run.is_empty())
        .map(|run| {
            let run = run.trim_end_matches('z').trim_end_matches("h0").replace('l', " ");
            let numbers: Vec<f64> = run.split_whitespace().map(|n| n.parse().unwrap()).collect();
            let mut at = [0.0, 0.0];
            numbers
                .chunks(2)
                .map(|step| {
                    at = [at[0] + step[0], at[1] + step[1]];
                    at
                })
                .collect()
        })
        .collect()
}

fn assert_near(got: [f64; 2], expected: [f64; 2], tolerance: [f64; 2]) {
    for i in 0..2 {
        assert!((got[i] - expected[i]).abs() <= tolerance[i], "{got:?} is not {expected:?}");
    }
}

#[test]
fn every_sample_of_a_short_line_is_where_it_belongs() {
    for figure in [signals(), odd()] {
        let drawn = read(&figure.to_svg());
        assert_eq!(drawn.len(), figure.panels.len());
        let mut compared = 0;
        for (panel, drawn) in figure.panels.iter().zip(&drawn) {
            for series in &panel.series {
                let Shape::Line(expected) = series.shape() else { continue };
                if expected.is_empty() || panel.y.range.is_some() {
                    continue;
                }
                let (_, got) = drawn.series.iter().find(|(label, _)| label == series.label()).unwrap();
                assert_eq!(got.len(), expected.len());
                let unit = drawn.unit();
                for (got, expected) in got.iter().flatten().zip(expected.iter().flatten()) {
                    // Two decimals, and nothing else, are lost.
                    assert_near(drawn.value(*got), *expected, [0.011 * unit[0], 0.011 * unit[1]]);
                    compared += 1;
                }
            }
        }
        assert!(compared >= 150, "{compared}");
    }
}

#[test]
fn a_line_that_leaves_its_range_keeps_its_course() {
    let data = [(0.0, 0.5), (1.0, 1e6), (2.0, -1e6), (3.0, f64::MAX), (4.0, 0.25)];
    let panel = Panel::new(Axis::new("x", ""), Axis::new("y", "").between(-1.0, 1.0))
        .with(Series::line("line", SeriesRole::Bound, data))
        .with(Series::band("band", SeriesRole::Bound, data.map(|(x, y)| (x, -y, y))));
    let svg = Figure::new("f", "", "").with(panel).to_svg();
    let drawn = read(&svg).remove(0);
    let [low, high] = ["top", "bottom"].map(|name| drawn.edge(name));
    for (label, runs) in &drawn.series {
        for point in runs.iter().flatten() {
            assert!((low - 21.0..=high + 21.0).contains(&point[1]), "{label} {point:?}");
        }
    }
    // The sample that no axis can hold is a gap, and the last one stands alone.
    let (_, runs) = &drawn.series.iter().find(|(label, _)| label == "line").unwrap();
    assert_eq!(runs.len(), 3);
    // From 0.5 up to 1e6, then down from 1e6 to -1e6, half way in between.
    for (point, x) in
        [(runs[0][0], 0.0), (runs[0][1], 0.0), (runs[1][0], 1.5), (runs[1][1], 1.5), (runs[2][0], 4.0)]
    {
        assert!((drawn.value(point)[0] - x).abs() < drawn.unit()[0], "{x}");
    }
    assert!(svg.contains("line leaves the axis: it goes from −1 · 10⁶ to 1 · 10⁶."));
}

#[test]
fn a_logarithmic_axis_reads_back_too() {
    let drawn = read(&spectrum().to_svg()).remove(0);
    let (_, runs) = &drawn.series.iter().find(|(label, _)| label == "steady state").unwrap();
    for point in &runs[0] {
        let [f, density] = drawn.value(*point);
        let ratio = f / 15_700.0;
        let expected = 1e-12 / ((1.0 - ratio * ratio).powi(2) + (ratio / 30.0).powi(2));
        // 0.01 of a unit is 3e-4 in the density, and near the resonance much more through the frequency.
        let tolerance = if (0.8..1.2).contains(&ratio) { 0.02 } else { 2e-3 };
        assert!((density / expected - 1.0).abs() < tolerance, "{f}: {density:e} is not {expected:e}");
    }
}

#[test]
fn no_extreme_of_a_long_signal_is_lost() {
    let samples = 24_000;
    let y = |i: u32| {
        let noise = f64::from(i.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
        if i == 7_777 { 25.0 } else { noise }
    };
    let data: Vec<[f64; 2]> = (0..samples).map(|i| [f64::from(i) * 1e-6, y(i)]).collect();
    let line = Series::line("noise", SeriesRole::Estimate, data.iter().map(|p| (p[0], p[1])));
    let figure =
        Figure::new("f", "", "").with(Panel::new(Axis::new("time", "s"), Axis::new("y", "V")).with(line));
    let drawn = read(&figure.to_svg()).remove(0);
    let points: Vec<[f64; 2]> = drawn.series[0].1.iter().flatten().map(|p| drawn.value(*p)).collect();
    assert!(points.len() <= 4 * 800);
    let unit = drawn.unit();
    let top = points.iter().copied().reduce(|a, b| if b[1] > a[1] { b } else { a }).unwrap();
    assert_near(top, [7_777e-6, 25.0], unit);
    // What is drawn within a pixel or two reaches at least as far as each sample there.
    for sample in data.iter().step_by(7) {
        let near = || points.iter().filter(|p| (p[0] - sample[0]).abs() <= 1.5 * unit[0]).map(|p| p[1]);
        let (low, high) = (near().fold(f64::MAX, f64::min), near().fold(f64::MIN, f64::max));
        assert!(low <= sample[1] + unit[1] && sample[1] - unit[1] <= high, "{sample:?}");
    }
}

#[test]
fn a_gap_is_a_gap_and_is_counted() {
    let svg = error().to_svg();
    let drawn = read(&svg).remove(0);
    let (_, runs) = drawn.series.iter().find(|(label, _)| label.starts_with("estimate")).unwrap();
    assert_eq!(runs.len(), 2);
    let edge = |point: Option<&[f64; 2]>| drawn.value(*point.unwrap())[0];
    let unit = drawn.unit()[0];
    assert!((edge(runs[0].last()) - 8.999e-3).abs() < unit);
    assert!((edge(runs[1].first()) - 9.3e-3).abs() < unit);
    assert!(svg.contains("estimate − reference: 300 of 24000 samples are missing."));
}

#[test]
fn ticks_lie_where_their_labels_say() {
    // Factors of the prefixed units of the panels.
    for (figure, factors) in [
        (signals(), vec![[1e-3, 1.0], [1e-3, 1.0], [1e-3, 1.0]]),
        (error(), vec![[1e-3, 1.0]]),
        (report_demo::phase(), vec![[1e-3, 1e-9]]),
        (spectrum(), vec![[1e3, 1.0]]),
    ] {
        let mut checked = 0;
        for (drawn, factor) in read(&figure.to_svg()).iter().zip(factors) {
            for (text, x, y, is_x) in &drawn.labels {
                let Ok(number) = text.replace('−', "-").parse::<f64>() else { continue };
                // Labels of the y axis stand 0.36 of their size below their tick.
                let point = drawn.value([*x, *y - 0.36 * 11.0]);
                let (got, expected) =
                    if *is_x { (point[0], number * factor[0]) } else { (point[1], number * factor[1]) };
                let tolerance = match (is_x, drawn.log) {
                    (true, [false, _]) => drawn.unit()[0],
                    (false, [_, false]) => drawn.unit()[1],
                    _ => 0.02 * expected.abs(),
                };
                assert!((got - expected).abs() <= tolerance, "{text}: {got}");
                checked += 1;
            }
        }
        assert!(checked >= 4, "{}: {checked}", figure.id);
    }
}

#[test]
fn labels_do_not_overlap() {
    for figure in all() {
        for drawn in read(&figure.to_svg()) {
            let mut x: Vec<f64> = drawn.labels.iter().filter(|l| l.3).map(|l| l.1).collect();
            x.sort_by(f64::total_cmp);
            assert!(x.windows(2).all(|pair| pair[1] - pair[0] > 40.0), "{}: {x:?}", figure.id);
            let mut y: Vec<f64> = drawn.labels.iter().filter(|l| !l.3).map(|l| l.2).collect();
            y.sort_by(f64::total_cmp);
            assert!(y.windows(2).all(|pair| pair[1] - pair[0] > 14.0), "{}: {y:?}", figure.id);
        }
    }
}

#[test]
fn shared_panels_have_one_x_axis() {
    let drawn = read(&signals().to_svg());
    let x_labels: Vec<usize> = drawn.iter().map(|d| d.labels.iter().filter(|l| l.3).count()).collect();
    assert_eq!(x_labels, [0, 0, 7]);
    let ends: Vec<[u64; 2]> =
        drawn.iter().map(|d| [d.edge("x-low").to_bits(), d.edge("x-high").to_bits()]).collect();
    assert!(ends.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn what_a_fixed_range_hides_is_said() {
    let svg = odd().to_svg();
    assert!(svg.contains("ramp leaves the axis: it goes from −3 V to 1.9 V."));
    let data = [(0.0, 1.0), (1.0, -1.0), (2.0, 0.0), (3.0, 100.0)];
    let panel = Panel::new(Axis::new("time", "s").between(0.0, 2.5), Axis::new("NIS", "").log())
        .with(Series::points("each", SeriesRole::Measured, data))
        .with(Series::level("lost", SeriesRole::Bound, f64::NAN));
    let svg = Figure::new("f", "", "").with(panel).to_svg();
    for note in [
        "each: 2 of 4 values are not positive and lie below the logarithmic axis.",
        "each: time continues outside of the axis, from 0 s to 3 s.",
        "lost: 1 of 1 samples are missing.",
    ] {
        assert!(svg.contains(note), "{note}");
    }
    let useless = Panel::new(Axis::new("time", "s").between(2.0, 1.0), Axis::new("y", "V"))
        .with(Series::points("each", SeriesRole::Measured, data));
    let svg = Figure::new("f", "", "").with(useless).to_svg();
    assert!(svg.contains("time: no axis can run from 2e0 to 1e0; it shows all of the data."), "{svg}");
}

#[test]
fn a_page_without_data_states_this() {
    let axes = || (Axis::new("time", "s"), Axis::new("y", "V"));
    let panel = |series: Vec<Series>| {
        let mut panel = Panel::new(axes().0, axes().1);
        panel.series = series;
        Figure::new("f", "", "").with(panel)
    };
    for figure in [
        panel(Vec::new()),
        panel(vec![Series::line("a", SeriesRole::Other, [])]),
        panel(vec![Series::band("a", SeriesRole::Other, [(f64::NAN, 0.0, 1.0)])]),
    ] {
        assert!(figure.to_svg().contains(">no data<"));
    }
    assert!(Document::parse(&Figure::new("f", "none", "").to_svg()).is_ok());
    let away = Panel::new(axes().0, axes().1.between(5.0, 6.0)).with(Series::line(
        "a",
        SeriesRole::Other,
        [(0.0, 0.0), (1.0, 1.0)],
    ));
    let svg = Figure::new("f", "", "").with(away).to_svg();
    assert!(
        svg.contains(">no data in this range<")
            && svg.contains("a leaves the axis: it goes from 0 V to 1 V.")
    );
}

#[test]
fn a_page_needs_nothing_else_and_escapes_everything() {
    let html = demo().to_html().unwrap();
    // The library of the plots names where it is from.
    let outside =
        html.replace("http://www.w3.org/2000/svg", "").replace("https://github.com/leeoniya/uPlot", "");
    // The page itself says that it has no picture of its own for the browser's tab, and asks who serves it for single samples.
    let outside = outside.replacen("<link rel=\"icon\" href=\"data:,\"/>", "", 1).replacen(
        "await fetch(address, ",
        "",
        1,
    );
    for forbidden in
        ["http:", "https:", "<link", "<img", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"]
    {
        assert!(!outside.contains(forbidden), "{forbidden}");
    }
    assert_eq!(html.matches("<script").count(), 3);
    assert!(html.contains("Copyright (c) 2022 Leon Sorokin"));
    assert_eq!(html.matches("http://www.w3.org/2000/svg").count(), 6);
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = Document::parse_with_options(&html, options).unwrap();
    let all = |name: &str| document.descendants().filter(|n| n.has_tag_name(name)).collect::<Vec<_>>();
    let texts = |class: &str| {
        let is_class = |n: &Node| n.attribute("class").is_some_and(|c| c.split(' ').next() == Some(class));
        let inside = |n: &Node| is_class(n) && n.tag_name().name() == "td";
        document.descendants().filter(inside).filter_map(|n| n.text()).collect::<Vec<_>>()
    };
    let has = |class: &str, cells: [&str; 4]| texts(class).windows(4).any(|window| window == cells);
    assert!(has("number", ["0.0213", "12.1", "0.1420", "−240.0"]));
    assert!(has("text", ["extended Kalman filter", "yes", "steady-state gain", "no"]));
    assert_eq!(all("figcaption").len(), 6);
    assert_eq!(all("pre").last().unwrap().text(), Some("seed = 7\n[device]\nname = \"<scanner>\"\n"));
    // The warning stands at the top and in its section, and one leads to the other.
    let warnings = html.matches("The estimate failed its consistency test").count();
    assert_eq!(warnings, 2);
    assert_eq!(all("a")[0].attribute("href"), Some("#warning-1"));
    assert!(document.descendants().any(|n| n.attribute("id") == Some("warning-1")));
}

#[test]
fn markup_in_any_text_stays_text() {
    let evil = "</style><script>alert('x')</script>\" onload=\"x\" & \u{1}";
    let panel = Panel::new(Axis::new(evil, evil), Axis::new(evil, evil)).with(Series::line(
        evil,
        SeriesRole::Other,
        [(0.0, 1.0), (1.0, 2.0)],
    ));
    let figure = Figure::new(evil, evil, evil).with(panel);
    let table = kalmems::figures::TextTable::new(evil, [kalmems::figures::ColumnHead::number(evil, evil)])
        .row([evil]);
    let section = PageSection::new(evil)
        .paragraph(evil)
        .notice(kalmems::figures::NoticeSeverity::Warning, evil)
        .key_values([(evil, evil)])
        .table(table)
        .figure(figure.clone())
        .preformatted(evil, evil);
    let html = Page::new(evil, evil).with(section).to_html().unwrap();
    // Data for the script are text as well, and cannot end it.
    let (before, rest) = html.split_once("id=\"figure-data\">").unwrap();
    let (data, after) = rest.split_once("</script>").unwrap();
    assert!(!data.contains('<') && !data.contains('&'));
    for markup in [before, after] {
        assert!(!markup.contains("<script>alert") && !markup.contains("\" onload"));
    }
    assert!(Document::parse(&figure.to_svg()).is_ok());
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    assert_eq!(demo().to_html().unwrap(), demo().to_html().unwrap());
    assert_eq!(signals().to_svg(), signals().to_svg());
}

#[test]
fn ten_million_samples_fit_a_page() {
    let samples = 10_000_000_u32;
    let time = |i: u32| f64::from(i) * 1e-7;
    let value = |i: u32, k: u32| f64::from((i ^ k).wrapping_mul(2_654_435_761) >> 16) / 65_536.0;
    let line = |k: u32| {
        let points = (0..samples).map(move |i| (time(i), if i == 1_234_567 { -9.0 } else { value(i, k) }));
        Series::line(format!("line {k}"), SeriesRole::Other, points)
    };
    let band =
        Series::band("band", SeriesRole::Bound, (0..samples).map(|i| (time(i), -value(i, 8), value(i, 9))));
    let dots = Series::points("points", SeriesRole::Measured, (0..samples).map(|i| (time(i), value(i, 10))));
    let mut panel = Panel::new(Axis::new("time", "s"), Axis::new("value", "V"));
    panel.series = vec![line(1), line(2), line(3), line(4), band, dots];
    assert!(panel.series.iter().all(|s| s.source_samples() == 10_000_000));
    let Shape::Line(runs) = panel.series[2].shape() else { panic!("no line") };
    assert!(runs[0].contains(&[time(1_234_567), -9.0]));
    let figure = Figure::new("long", "Ten million samples", "").with(panel);
    let svg = figure.to_svg();
    assert!(svg.len() < 300_000, "{}", svg.len());
    let html = Page::new("Long", "").with(PageSection::new("").figure(figure)).to_html().unwrap();
    assert!(html.len() < 6_000_000, "{}", html.len());
}

fn odd_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0_f64,
        1 => any::<f64>(),
        1 => prop::sample::select(vec![0.0, f64::NAN, f64::INFINITY, 1e300, -1e300, 5e-324, 1e-21]),
    ]
}

fn odd_axis() -> impl Strategy<Value = Axis> {
    (any::<bool>(), prop::option::of((odd_number(), odd_number())), ".{0,20}", ".{0,6}").prop_map(
        |(log, range, label, unit)| {
            let axis = Axis::new(label, unit);
            let axis = if log { axis.log() } else { axis };
            range.map_or(axis.clone(), |(from, to)| axis.between(from, to))
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn no_data_make_a_broken_picture(
        x in odd_axis(),
        y in odd_axis(),
        data in prop::collection::vec((odd_number(), odd_number(), odd_number()), 0..40),
        level in odd_number(),
        label in ".{0,30}",
    ) {
        let points = || data.iter().map(|p| (p.0, p.1));
        let panel = Panel::new(x.clone(), y.clone())
            .with(Series::line(label.as_str(), SeriesRole::Estimate, points()))
            .with(Series::points(label.as_str(), SeriesRole::Measured, points()))
            .with(Series::band(label.as_str(), SeriesRole::Estimate, data.iter().copied()))
            .with(Series::level(label.as_str(), SeriesRole::Bound, level));
        let shared = panel.clone().sharing_x();
        let figure = Figure::new(label.as_str(), label.as_str(), "").with(panel).with(shared);
        let svg = figure.to_svg();
        let document = Document::parse(&svg).unwrap();
        for node in document.descendants() {
            for name in ["x", "y", "width", "height"] {
                if let Some(value) = node.attribute(name) {
                    prop_assert!(value.parse::<f64>().is_ok_and(|v| v.abs() < 1e5), "{name}={value}");
                }
            }
            for point in node.attribute("d").into_iter().flat_map(runs).flatten() {
                prop_assert!(point.iter().all(|c| c.abs() <= 1e5), "{point:?}");
            }
        }
    }
}
