//! Figures as data that the script of a page draws: axes, series, and their samples as text.

use crate::decimate::Thinning;
use crate::drawing::axis::Range;
use crate::drawing::layout::FigureLayout;
use crate::drawing::ruler::Ruler;
use crate::drawing::svg::hex;
use crate::figure::{Axis, AxisScale, Figure, SamplesPlace, Series, SeriesRole, Shape};
use crate::page::SamplesLink;
use crate::prefix::prefixed;
use crate::record::{Abscissae, PackedValues, Record, RecordValues, Track};
use crate::style;
use crate::text::with_printed_unit;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::{Compression, write::DeflateEncoder};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;

/// Numbers on a page: four bytes of text for each where nothing can be compressed.
const MOST: usize = 1_200_000;
/// A record is not made coarser than this.
const FEWEST: usize = 2_048;

/// The figures of a page that can be looked into, as data.
#[derive(Default)]
pub(crate) struct LiveFigures {
    figures: Vec<NumberedFigure>,
}

/// A figure with its number on the page and the group of time axes that it belongs to.
struct NumberedFigure {
    number: usize,
    group: String,
    panels: Vec<Panelled>,
}

struct Panelled {
    label: String,
    x: Value,
    y: Value,
    /// The x axis that it is linked by.
    link: String,
    /// Whether both axes have the same scale.
    is_isotropic: bool,
    series: Vec<LiveSeries>,
}

/// A series with what is known of it besides its samples.
struct LiveSeries {
    known: Value,
    record: Option<Arc<Record>>,
    /// Each sample of what is shown at first, if the picture has it.
    near: Option<Record>,
    place: Option<SamplesPlace>,
}

impl LiveSeries {
    /// Where all of its samples are, if the page has groups of them.
    fn place_of_more(&self) -> Option<&SamplesPlace> {
        self.place.as_ref().filter(|_| self.is_thinned())
    }

    /// Whether the page has groups of samples.
    fn is_thinned(&self) -> bool {
        self.record.as_ref().is_some_and(|record| record.per_group > 1)
    }
}

impl LiveFigures {
    /// Takes a figure, and says whether it can be looked into: every panel has a range and samples, and none is a map.
    pub(crate) fn take(&mut self, number: usize, group: &str, figure: &Figure) -> bool {
        let drawn = figure.panels.iter().flat_map(|panel| &panel.series);
        let is_flat = |s: &Series| !matches!(s.shape(), Shape::Map(_));
        if !drawn.clone().all(is_flat) || !drawn.clone().any(|s| s.record().is_some()) {
            return false;
        }
        let layout = FigureLayout::of(figure, &Ruler::new());
        // Panels that share an x axis are above the one that has its labels.
        let mut axes_above = 0;
        let panels: Option<Vec<Panelled>> = layout
            .places
            .iter()
            .map(|place| {
                let of_figure = axes_above;
                axes_above += u32::from(place.labels_x);
                let colours = style::colours(&place.panel.series);
                let series = place.panel.series.iter().zip(colours);
                let order = |drawn: &(&Series, _)| style::layer(drawn.0);
                let mut series: Vec<_> = series.collect();
                series.sort_by_key(order);
                let x_axis = &place.panel.x;
                let link = format!("{} {}", x_axis.label, x_axis.unit);
                Some(Panelled {
                    label: place.panel.y.label.clone(),
                    x: axis(x_axis, place.x?),
                    y: axis(&place.panel.y, place.y?),
                    link: if x_axis.label == "time" {
                        format!("{group} {link}")
                    } else {
                        format!("{number} {of_figure} {link}")
                    },
                    is_isotropic: place.is_isotropic,
                    series: series
                        .into_iter()
                        .map(|(series, colour)| drawn_as(series, &hex(colour)))
                        .collect(),
                })
            })
            .collect();
        let Some(panels) = panels else { return false };
        self.figures.push(NumberedFigure { number, group: group.to_owned(), panels });
        true
    }

    /// Whether the page has groups of samples where a file beside it would have each.
    pub(crate) fn leaves_out_samples(mut self) -> bool {
        self.fit();
        let mut series =
            self.figures.iter().flat_map(|figure| &figure.panels).flat_map(|panel| &panel.series);
        series.any(|series| series.place_of_more().is_some())
    }

    /// All of it as JSON that can stand in HTML and in XML; none where there is no figure. `beside` is the file that has each sample.
    pub(crate) fn into_json(mut self, beside: Option<&SamplesLink>) -> Option<String> {
        if self.figures.is_empty() {
            return None;
        }
        self.fit();
        let mut blobs = Blobs::default();
        let figures: Vec<Value> = (self.figures.iter())
            .map(|figure| {
                let panels: Vec<Value> = (figure.panels.iter())
                    .map(|panel| {
                        let series: Vec<Value> = (panel.series.iter())
                            .map(|drawn| {
                                let mut known = drawn.known.clone();
                                if let (Some(record), Some(known)) = (&drawn.record, known.as_object_mut()) {
                                    known.insert("data".to_owned(), blobs.record(record));
                                    if let Some(near) = drawn.near.as_ref().filter(|_| drawn.is_thinned()) {
                                        known.insert("near".to_owned(), blobs.record(near));
                                    }
                                    if let (Some(place), Some(_)) = (drawn.place_of_more(), beside) {
                                        known.insert("track".to_owned(), json!(&*place.track));
                                        known.insert("isBand".to_owned(), json!(place.is_band));
                                    }
                                }
                                known
                            })
                            .collect();
                        json!({ "label": panel.label, "x": panel.x, "y": panel.y, "link": panel.link, "isIsotropic": panel.is_isotropic, "series": series })
                    })
                    .collect();
                json!({ "number": figure.number, "group": figure.group, "panels": panels })
            })
            .collect();
        let beside = beside.map(|it| json!({ "file": it.file, "bytes": it.bytes, "crc32": it.crc32 }));
        let all = json!({ "figures": figures, "blobs": blobs.texts, "samples": beside });
        // Neither the end of the script nor markup can stand in it.
        Some(all.to_string().replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026"))
    }

    /// Makes the largest records coarser until all of them fit.
    fn fit(&mut self) {
        let mut records: Vec<&mut Arc<Record>> = (self.figures.iter_mut())
            .flat_map(|figure| &mut figure.panels)
            .flat_map(|panel| panel.series.iter_mut().filter_map(|drawn| drawn.record.as_mut()))
            .collect();
        let sizes: Vec<usize> = records.iter().map(|record| record.size()).collect();
        let mut limit = usize::MAX;
        while sizes.iter().map(|size| *size.min(&limit)).sum::<usize>() > MOST && limit > FEWEST {
            limit = if limit == usize::MAX { 1 << 17 } else { limit / 2 };
        }
        for (record, size) in records.iter_mut().zip(sizes).filter(|(_, size)| *size > limit) {
            // What has had a number for each sample has two for each group.
            let numbers = if matches!(record.values, RecordValues::Samples(_)) { 2 * size } else { size };
            if let Some(coarser) = record.coarser(numbers.div_ceil(limit).next_power_of_two()) {
                **record = Arc::new(coarser);
            }
        }
    }
}

/// An axis with what it shows at first, and the unit that its numbers are shown in.
fn axis(axis: &Axis, range: Range) -> Value {
    let largest = range.low.abs().max(range.high.abs());
    let prefix =
        if axis.scale == AxisScale::Log { prefixed(&axis.unit, 1.0) } else { prefixed(&axis.unit, largest) };
    let unit = if prefix.is_power { format!("·{}", prefix.unit) } else { prefix.unit.clone() };
    let mut shown = json!({
        "title": with_printed_unit(&axis.label, &prefix.unit),
        "unit": unit,
        "exponent": prefix.exponent,
        "log": axis.scale == AxisScale::Log,
        "from": range.low,
        "to": range.high,
        "fixed": axis.range.is_some(),
    });
    if !axis.names.is_empty() {
        shown["names"] = json!(axis.names);
    }
    shown
}

fn drawn_as(series: &Series, colour: &str) -> LiveSeries {
    let stroke = style::stroke(series.role(), crate::scene::Colour(0, 0, 0));
    let (kind, level) = match series.shape() {
        Shape::Line(_) => ("line", None),
        Shape::Points(_) if style::is_crossed(series.role()) => ("crosses", None),
        Shape::Points(_) => ("points", None),
        // Extremes of one value stand for a line.
        Shape::Band(_) if series.record().is_some_and(|record| record.is_single) => ("line", None),
        Shape::Band(_) => ("band", None),
        Shape::Level(level) => ("level", Some(*level)),
        Shape::Map(_) => ("map", None),
    };
    let links = series.links().iter().map(|link| json!([link.at[0], link.at[1], link.anchor, link.text]));
    let written = series.texts().iter().map(|one| json!([one.at[0], one.at[1], one.text]));
    let known = json!({
        "links": links.collect::<Vec<Value>>(),
        "written": written.collect::<Vec<Value>>(),
        "label": series.label(),
        "kind": kind,
        "level": level,
        "colour": colour,
        "width": stroke.width,
        "dashed": stroke.dashed,
        "faint": matches!(series.role(), SeriesRole::Measured | SeriesRole::Reference),
    });
    let (record, place) = (series.record().cloned(), series.place().cloned());
    LiveSeries { known, record, near: near(series), place }
}

/// The samples that the picture shows, if it shows each of them: what a page shows at first keeps its resolution however long the record is.
fn near(series: &Series) -> Option<Record> {
    /// More of them are drawn column by column in any case.
    const MOST_NEAR: usize = 4_096;
    let (mut track, channels) = match series.shape() {
        Shape::Line(_) | Shape::Points(_) => (Track::new(1), [0, 0]),
        Shape::Band(_) => (Track::new(2), [0, 1]),
        Shape::Level(_) | Shape::Map(_) => return None,
    };
    let mut last = None;
    let mut run = |points: &mut dyn Iterator<Item = (f64, [f64; 2])>| {
        // Between two runs there is a gap.
        if let Some(x) = last {
            track.push(x, &[f64::NAN; 2]);
        }
        for (x, values) in points {
            track.push(x, &values);
            last = Some(x);
        }
    };
    match series.shape() {
        Shape::Line(runs) => {
            for one in runs {
                run(&mut one.iter().map(|[x, y]| (*x, [*y; 2])));
            }
        }
        Shape::Points(points) => run(&mut points.iter().map(|[x, y]| (*x, [*y; 2]))),
        Shape::Band(runs) => {
            for one in runs {
                run(&mut one.iter().map(|[x, low, high]| (*x, [*low, *high])));
            }
        }
        Shape::Level(_) | Shape::Map(_) => {}
    }
    let is_each = series.thinning() == Thinning::None && (1..=MOST_NEAR).contains(&track.samples());
    track.record(channels).filter(|_| is_each)
}

/// Texts of samples, each once.
#[derive(Default)]
struct Blobs {
    texts: Vec<String>,
    places: BTreeMap<Vec<u8>, usize>,
}

impl Blobs {
    fn record(&mut self, record: &Record) -> Value {
        let x = match &record.x {
            Abscissae::Equal(first, step, count) => json!({ "first": first, "step": step, "count": count }),
            Abscissae::Each(x) => {
                let bytes: Vec<[u8; 8]> = x.iter().map(|x| x.to_be_bytes()).collect();
                json!({ "blob": self.place(planes(&bytes)), "count": x.len() })
            }
        };
        let (kind, values) = match &record.values {
            RecordValues::Samples(values) => ("samples", vec![self.values(values)]),
            RecordValues::Band { middle, half } => ("band", vec![self.values(middle), self.values(half)]),
            RecordValues::Extremes { low, high } => ("extremes", vec![self.values(low), self.values(high)]),
        };
        json!({
            "x": x,
            "last": record.last_x,
            "per": record.per_group,
            "samples": record.samples,
            "rises": record.rises,
            "kind": kind,
            "values": values,
        })
    }

    fn values(&mut self, values: &PackedValues) -> Value {
        let bytes: Vec<[u8; 3]> = (values.multiples.iter())
            .map(|bits| {
                let [first, second, third, _] = bits.to_be_bytes();
                [first, second, third]
            })
            .collect();
        json!({ "blob": self.place(planes(&bytes)), "offset": values.offset, "unit": values.unit })
    }

    fn place(&mut self, plain: Vec<u8>) -> usize {
        if let Some(place) = self.places.get(&plain) {
            return *place;
        }
        let mut packed = DeflateEncoder::new(Vec::new(), Compression::fast());
        // Memory takes all that is written.
        let packed = packed.write_all(&plain).and_then(|()| packed.finish()).unwrap_or_default();
        self.texts.push(STANDARD.encode(packed));
        let place = self.texts.len() - 1;
        self.places.insert(plain, place);
        place
    }
}

/// All first bytes, then all second ones, and so on: like stands beside like and is short when it is compressed.
fn planes<const N: usize>(numbers: &[[u8; N]]) -> Vec<u8> {
    (0..N).flat_map(|place| numbers.iter().map(move |number| number[place])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Panel;
    use flate2::read::DeflateDecoder;
    use std::io::Read;

    /// The numbers of a text, as the script of a page reads them.
    fn numbers(all: &Value, known: &Value) -> Vec<f64> {
        let text = all["blobs"][usize::try_from(known["blob"].as_u64().unwrap()).unwrap()].as_str().unwrap();
        let mut bytes = Vec::new();
        DeflateDecoder::new(STANDARD.decode(text).unwrap().as_slice()).read_to_end(&mut bytes).unwrap();
        let count = bytes.len() / 3;
        let bits = |i: usize| u32::from_be_bytes([bytes[i], bytes[count + i], bytes[2 * count + i], 0]);
        let (offset, unit) = (known["offset"].as_f64().unwrap(), known["unit"].as_f64().unwrap());
        (0..count).map(|i| offset + unit * f64::from(f32::from_bits(bits(i)))).collect()
    }

    fn value(i: u32) -> f64 {
        2.0 + 1e-3 * f64::from(i.wrapping_mul(2_654_435_761) >> 12)
    }

    fn figure(samples: u32, series: usize) -> Figure {
        let points = (0..samples).map(|i| (1e-6 * f64::from(i), value(i)));
        let band = (0..samples).map(|i| (1e-6 * f64::from(i), value(i) - 0.5, value(i) + 0.5));
        let mut panel = Panel::new(Axis::new("time", "s"), Axis::new("value", "V")).with(Series::band(
            "±σ",
            SeriesRole::Estimate,
            band,
        ));
        for k in 0..series {
            let points = points.clone().map(move |(t, v)| (t, v + (k * k) as f64));
            panel = panel.with(Series::line("estimate", SeriesRole::Estimate, points));
        }
        Figure::new("figure", "", "").with(panel)
    }

    #[test]
    fn every_sample_is_on_the_page_within_a_ten_thousandth_of_the_range_and_a_band_goes_along_its_line() {
        let mut live = LiveFigures::default();
        assert!(live.take(1, "", &figure(24_000, 1)));
        let all: Value = serde_json::from_str(&live.into_json(None).unwrap()).unwrap();
        let series = &all["figures"][0]["panels"][0]["series"];
        let (band, line) = (&series[0]["data"], &series[1]["data"]);
        assert_eq!((line["per"].as_u64(), line["x"]["count"].as_u64()), (Some(1), Some(24_000)));
        let range = (0..24_000).map(value).fold(0.0, f64::max);
        for (i, found) in (0..).zip(numbers(&all, &line["values"][0])) {
            assert!((found - value(i)).abs() < 1e-4 * range, "{i}");
        }
        // The middle of the band is kept once, with the line.
        assert_eq!(band["values"][0]["blob"], line["values"][0]["blob"]);
        assert!(numbers(&all, &band["values"][1]).iter().all(|half| (half - 0.5).abs() < 1e-4));
    }

    #[test]
    fn a_page_has_a_bound_whatever_the_number_of_series_and_samples() {
        let mut live = LiveFigures::default();
        for number in 1..=20 {
            assert!(live.take(number, "", &figure(30_000, 5)));
        }
        let text = live.into_json(None).unwrap();
        assert!(text.len() < 5_500_000, "{}", text.len());
        let all: Value = serde_json::from_str(&text).unwrap();
        let line = &all["figures"][19]["panels"][0]["series"][5]["data"];
        assert!(line["per"].as_u64().unwrap() > 1);
        assert_eq!(line["samples"].as_u64(), Some(30_000));
    }

    #[test]
    fn a_series_of_groups_names_the_track_that_has_each_of_its_samples() {
        let link = SamplesLink { file: "samples.bin".to_owned(), bytes: 7, crc32: 8 };
        for (samples, is_thinned) in [(24_000, false), (100_000, true)] {
            let points = (0..samples).map(|i| (1e-6 * f64::from(i), value(i)));
            let place = SamplesPlace { track: "ekf, angle".into(), is_band: false };
            let series = Series::line("estimate", SeriesRole::Estimate, points).with_samples_in(place);
            let panel = Panel::new(Axis::new("time", "s"), Axis::new("value", "V")).with(series);
            let taken = || {
                let mut live = LiveFigures::default();
                assert!(live.take(1, "", &Figure::new("figure", "", "").with(panel.clone())));
                live
            };
            assert_eq!(taken().leaves_out_samples(), is_thinned);
            let known =
                |beside| -> Value { serde_json::from_str(&taken().into_json(beside).unwrap()).unwrap() };
            let track = |all: &Value| all["figures"][0]["panels"][0]["series"][0]["track"].clone();
            let expected = if is_thinned { json!("ekf, angle") } else { Value::Null };
            let all = known(Some(&link));
            assert_eq!((track(&all), &all["samples"]["bytes"]), (expected, &json!(7)));
            assert_eq!(track(&known(None)), Value::Null);
        }
    }

    #[test]
    fn axes_of_time_are_linked_throughout_a_recording_and_others_where_panels_share_them() {
        let links = |label: &str, groups: [&str; 2]| {
            let mut live = LiveFigures::default();
            for (number, group) in (1..).zip(groups) {
                let panel = Panel::new(Axis::new(label, "s"), Axis::new("value", "V"));
                let panel = panel.with(Series::line("", SeriesRole::Other, [(0.0, 1.0), (1.0, 2.0)]));
                assert!(live.take(number, group, &Figure::new("figure", "", "").with(panel)));
            }
            let all: Value = serde_json::from_str(&live.into_json(None).unwrap()).unwrap();
            all["figures"][0]["panels"][0]["link"] == all["figures"][1]["panels"][0]["link"]
        };
        assert!(links("time", ["a", "a"]));
        assert!(!links("time", ["a", "b"]));
        assert!(!links("averaging time", ["a", "a"]));
        let panel = || {
            let panel = Panel::new(Axis::new("wavenumber", "cm^-1"), Axis::new("value", "V"));
            panel.with(Series::line("", SeriesRole::Other, [(0.0, 1.0), (1.0, 2.0)]))
        };
        let mut live = LiveFigures::default();
        let below = Panel { shares_x: true, ..panel() };
        let figure = Figure::new("figure", "", "").with(panel()).with(below).with(panel());
        assert!(live.take(1, "a", &figure));
        let all: Value = serde_json::from_str(&live.into_json(None).unwrap()).unwrap();
        let link = |place: usize| &all["figures"][0]["panels"][place]["link"];
        assert!(link(0) == link(1) && link(1) != link(2));
    }

    #[test]
    fn what_is_shown_at_first_keeps_each_sample_however_long_the_record_is() {
        let mut track = Track::new(1);
        (0..450_000).for_each(|i| track.push(1e-6 * f64::from(i), &[value(i)]));
        let last = (449_744..450_000).map(|i| (1e-6 * f64::from(i), value(i)));
        let line = Series::line("estimate", SeriesRole::Estimate, last).of_all(&track, [0, 0]);
        let panel = Panel::new(Axis::new("time", "s"), Axis::new("value", "V")).with(line);
        let mut live = LiveFigures::default();
        assert!(live.take(1, "", &Figure::new("figure", "", "").with(panel)));
        let all: Value = serde_json::from_str(&live.into_json(None).unwrap()).unwrap();
        let series = &all["figures"][0]["panels"][0]["series"][0];
        assert!(series["data"]["per"].as_u64().unwrap() > 1);
        let near = numbers(&all, &series["near"]["values"][0]);
        assert_eq!((series["near"]["per"].as_u64(), near.len()), (Some(1), 256));
        let span = (449_744..450_000).map(value).fold(0.0, f64::max);
        for (found, i) in near.iter().zip(449_744..) {
            assert!((found - value(i)).abs() < 1e-4 * span, "{i}: {found}");
        }
    }
}
