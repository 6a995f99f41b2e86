//! Records under sines or sweeps with a reference in the same file: amplitude, phase and bandwidth (comparison with a reference transducer, ISO 16063-21).

use super::checks::CheckKind;
use super::error::CalibrationError;
use super::file::SineRecord;
use super::files::InputFiles;
use super::parts_of_vibration::still_in_vibration;
use super::quantities::{QuantityUnit, RecordOutcome, contribution, stated_contribution};
use super::rest::InertialSensor;
use super::sweep::{BandResponse, bands};
use super::tone::{AXES, AxisSignals, ToneError};
use super::unit_record::UnitSamples;
use crate::metrology::{Evaluation, Input};
use crate::signal::PortableComplex;
use kalmems_core::Portable;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use realfft::num_complex::Complex64;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Frequencies that differ by less than this part are the same.
const SAME: f64 = 5e-3;
/// The largest distortion of the reference (ISO 16063-21).
const DISTORTION: f64 = 0.05;
/// Parameters of a sine with two harmonics.
const PARAMETERS: usize = 8;

/// The quotient of both signals at one frequency.
struct Response {
    frequency_hz: f64,
    ratio: Complex64,
    /// The standard uncertainties of the amplitude, as a part of it, and of the phase in rad by the records; with degrees of freedom.
    deviations: [f64; 2],
    freedom: f64,
    records: usize,
    /// The largest distortion of the reference.
    distortion: f64,
}

/// The outcome of each record under sines.
pub(super) fn measure(files: &mut InputFiles) -> Result<Vec<RecordOutcome>, CalibrationError> {
    let file = files.file;
    files.each("sine", &file.sines, SineRecord::of_unit, |record, samples, shown| {
        shown.push(parts(record, samples));
        Ok(outcome(record, samples, &responses(record, samples)?))
    })
}

/// What the sensor shows.
fn sensor<'a>(record: &SineRecord, samples: &'a UnitSamples) -> Option<&'a [f64]> {
    let axis = record.axis.index();
    match record.sensor {
        InertialSensor::Gyroscope => samples.rates()[axis],
        InertialSensor::Accelerometer => samples.forces()[axis],
    }
}

fn responses(record: &SineRecord, samples: &UnitSamples) -> Result<Vec<Response>, CalibrationError> {
    let shown = sensor(record, samples);
    let mut found = Vec::new();
    for segment in samples.recording.segments() {
        let of = |values: &[f64]| Some(values.get(segment.rows.clone())?.to_vec());
        let signals = AxisSignals {
            time_s: segment.time.to_vec(),
            axes: [of(samples.further()), shown.and_then(of), None],
        };
        let place = || match segment.label.as_str() {
            "" => samples.place.clone(),
            label => format!("{}, record `{label}`", samples.place),
        };
        let failed = |fault: ToneError| CalibrationError::Tone { place: place(), fault };
        if record.sweep {
            found.extend(of_sweep(&signals, samples.time.interval_s).map_err(failed)?);
            continue;
        }
        let tone = signals.tone(None).map_err(failed)?;
        let [Some(reference), Some(shown), _] = tone.axes else { continue };
        let ratio = shown.phasor / reference.phasor;
        let part =
            |component: &super::tone::Component| component.deviation / component.phasor.portable_norm();
        let deviation = part(&reference).portable_hypot(part(&shown));
        found.push(Response {
            frequency_hz: tone.frequency_hz,
            ratio,
            deviations: [deviation; 2],
            freedom: segment.rows.len().saturating_sub(PARAMETERS).max(1) as f64,
            records: 1,
            distortion: reference.distortion,
        });
    }
    found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let groups = found.chunk_by(|a, b| b.frequency_hz <= (1.0 + SAME) * a.frequency_hz);
    Ok(groups.map(together).collect())
}

fn of_sweep(signals: &AxisSignals, interval_s: f64) -> Result<Vec<Response>, ToneError> {
    let [Some(reference), Some(shown), _] = &signals.axes else { return Ok(Vec::new()) };
    let missing = reference.iter().zip(shown).filter(|(x, y)| !(x.is_finite() && y.is_finite())).count();
    if missing > 0 {
        return Err(ToneError::Missing { samples: missing });
    }
    let found = bands(reference, shown, interval_s);
    if found.is_empty() {
        return Err(ToneError::NoBand);
    }
    let of = |BandResponse { frequency_hz, ratio, deviation, freedom, .. }: BandResponse| Response {
        frequency_hz,
        ratio,
        deviations: [deviation; 2],
        freedom,
        records: 1,
        distortion: 0.0,
    };
    Ok(found.into_iter().map(of).collect())
}

/// Records at one frequency: their means with the standard deviations by their scatter, which has the noise in it.
fn together(records: &[Response]) -> Response {
    let count = records.len() as f64;
    let mean = |of: &dyn Fn(&Response) -> f64| records.iter().map(of).sum::<f64>() / count;
    let amplitude = mean(&|record| record.ratio.portable_norm());
    // About the first one, so that phases at half a turn stay neighbours.
    let first = records.first().map_or(Complex64::ONE, |record| record.ratio);
    let off = mean(&|record| (record.ratio / first).portable_arg());
    let scatter = |of: &dyn Fn(&Response) -> f64| (mean(of) / (count - 1.0)).sqrt();
    let [deviations, freedom] = match records {
        [one] => [one.deviations, [one.freedom; 2]],
        _ => [
            [
                scatter(&|record| (record.ratio.portable_norm() / amplitude - 1.0).powi(2)),
                scatter(&|record| ((record.ratio / first).portable_arg() - off).powi(2)),
            ],
            [count - 1.0; 2],
        ],
    };
    Response {
        frequency_hz: mean(&|record| record.frequency_hz),
        ratio: Complex64::portable_polar(amplitude, first.portable_arg() + off),
        deviations,
        freedom: freedom[0],
        records: records.len(),
        distortion: records.iter().map(|record| record.distortion).fold(0.0, f64::max),
    }
}

const METHOD: &str = "Sines: at each frequency one sine of common frequency is fitted to the reference and to the sensor, which are sampled together, and \
    their quotient gives amplitude and phase (ISO 16063-21). Of several records at one frequency the scatter is the type A evaluation. The bandwidth is the \
    frequency at which the amplitude falls to 0.707 of that at the lowest frequency, on logarithmic scales by a polynomial through its neighbours.";

const OF_SWEEP: &str = "Sweep: the transforms of the reference and of the sensor over each record, which begins and ends at rest, are divided in bands of a sixth of an \
    octave; in each the quotient is a parabola over the frequency, and what it leaves is the noise. Of several records the scatter is the type A evaluation. \
    The bandwidth is the frequency at which the amplitude falls to 0.707 of that in the lowest band, on logarithmic scales by a polynomial through its neighbours.";

fn outcome(record: &SineRecord, samples: &UnitSamples, responses: &[Response]) -> RecordOutcome {
    let mut outcome = RecordOutcome::new(
        "sine",
        format!("Sines: {}", record.name),
        if record.sweep { OF_SWEEP } else { METHOD },
    );
    outcome.warnings.clone_from(&samples.remarks);
    let mut not_stated = |key: &str| outcome.not_stated.push(format!("{key} of the sines `{}`", record.name));
    if record.reference_uncertainty.is_none() {
        not_stated("reference_uncertainty");
    }
    if record.delay_uncertainty.is_none() {
        not_stated("delay_uncertainty");
    }
    if record.reproducibility.is_none() && responses.iter().any(|response| response.records == 1) {
        not_stated("reproducibility");
    }
    let sensor = match record.sensor {
        InertialSensor::Gyroscope => "gyroscope",
        InertialSensor::Accelerometer => "accelerometer",
    };
    let axis = AXES[record.axis.index()];
    let degrees = QuantityUnit::other("rad", 1.0_f64.to_degrees(), "deg");
    for response in responses {
        let at = format!("{axis}_at_{:.2}_hz", response.frequency_hz);
        let amplitude = response.ratio.portable_norm();
        let amplitudes = amplitude_inputs(record, response, amplitude);
        outcome.push_known(format!("{sensor}_scale_factor_{at}"), QuantityUnit::RATIO, amplitude, amplitudes);
        let mut inputs = vec![by_records(response.deviations[1], response)];
        if let Some(stated) = &record.delay_uncertainty {
            inputs.push(stated_contribution(
                "time between both samples",
                stated,
                TAU * response.frequency_hz,
            ));
        }
        outcome.push_known(format!("{sensor}_phase_{at}"), degrees, response.ratio.portable_arg(), inputs);
    }
    match bandwidth(responses) {
        Some((value, inputs)) => {
            let unit = QuantityUnit::other("Hz", 1.0, "Hz");
            outcome.push_known(format!("{sensor}_bandwidth_{axis}"), unit, value, inputs);
        }
        None => outcome.not_observed.push(format!(
            "the bandwidth of {axis}: the amplitude does not fall to 0.707 of that at the lowest frequency; take records up to higher frequencies"
        )),
    }
    judge(&mut outcome, record, responses);
    outcome.tables.push(table(record, responses));
    outcome.figures.push(figure(record, samples, responses));
    outcome
}

fn by_records(size: f64, response: &Response) -> Input {
    let name = if response.records > 1 { "scatter of the records" } else { "noise of the record" };
    contribution(name, size, response.freedom, Evaluation::A)
}

fn amplitude_inputs(record: &SineRecord, response: &Response, amplitude: f64) -> Vec<Input> {
    let mut inputs = vec![by_records(response.deviations[0] * amplitude, response)];
    if let Some(stated) = &record.reference_uncertainty {
        inputs.push(stated_contribution("reference", stated, amplitude));
    }
    if let Some(stated) = record.reproducibility.as_ref().filter(|_| response.records == 1) {
        inputs.push(stated_contribution("reproducibility", stated, amplitude));
    }
    inputs
}

/// Where the amplitude first falls to 1/√2 of the first one: by the polynomial of the logarithm of the frequency through both neighbours and, where the
/// amplitude falls there as well, one frequency more. What the one after that changes says how far it may be off.
fn bandwidth(responses: &[Response]) -> Option<(f64, Vec<Input>)> {
    let first = responses.first()?;
    let level = FRAC_1_SQRT_2 * first.ratio.portable_norm();
    let above = |response: &Response| response.ratio.portable_norm() > level;
    let after = responses.iter().position(|response| !above(response))?;
    let before = after.checked_sub(1)?;
    let log = |place: usize| {
        let response = &responses[place];
        [(response.ratio.portable_norm() / level).portable_ln(), response.frequency_hz.portable_ln()]
    };
    let ([high, from], [low, to]) = (log(before), log(after));
    let slope = (to - from) / (low - high);
    let outer = [before.checked_sub(1), Some(after + 1).filter(|place| *place < responses.len())];
    let is_falling =
        |place: &usize| if *place < before { log(*place)[0] > high } else { log(*place)[0] < low };
    let mut nodes = vec![[high, from], [low, to]];
    let mut found = vec![from - high * slope];
    for place in outer.into_iter().flatten().filter(is_falling) {
        nodes.push(log(place));
        found.push(at_zero(&nodes));
    }
    let used = found.len().saturating_sub(2);
    let value = found[used].portable_exp();
    let share = -high / (low - high);
    let moved = |place: usize, part: f64| part * slope * responses[place].deviations[0] * value;
    let fewest =
        [0, before, after].map(|place| responses[place].freedom).into_iter().fold(f64::INFINITY, f64::min);
    let size = [moved(before, 1.0 - share), moved(after, share), moved(0, 1.0)]
        .into_iter()
        .fold(0.0, f64::portable_hypot);
    let mut inputs = vec![contribution("amplitudes", size, fewest, Evaluation::A)];
    let off = found.get(used + 1).map_or(0.5 * (to - from), |next| next - found[used]);
    let off = off.abs() * value / 3.0_f64.sqrt();
    inputs.push(contribution("curvature between the frequencies", off, f64::INFINITY, Evaluation::B));
    value.is_finite().then_some((value, inputs))
}

/// The polynomial through these points at 0 (Neville).
fn at_zero(points: &[[f64; 2]]) -> f64 {
    let mut values: Vec<f64> = points.iter().map(|[_, y]| *y).collect();
    for span in 1..points.len() {
        for k in 0..points.len() - span {
            let ([left, _], [right, _]) = (points[k], points[k + span]);
            values[k] = (right * values[k] - left * values[k + 1]) / (right - left);
        }
    }
    values[0]
}

fn judge(outcome: &mut RecordOutcome, record: &SineRecord, responses: &[Response]) {
    let Some(first) = responses.first() else { return };
    let place = format!("sines `{}`", record.name);
    let follows = first.ratio.re > 0.5 * first.ratio.portable_norm()
        && (0.5..2.0).contains(&first.ratio.portable_norm());
    let found = format!(
        "{:.4} times the reference with a phase of {:+.1} deg at {:.2} Hz",
        first.ratio.portable_norm(),
        first.ratio.portable_arg().to_degrees(),
        first.frequency_hz
    );
    outcome.check(CheckKind::FollowedReference, &place, follows, found.clone());
    if !follows {
        outcome.warnings.push(format!(
            "sines `{}`: the sensor shows {found}: its sign is turned, another axis lies along that of the reference, or its unit is wrong; correct `axis`, \
             or `scale` of its column",
            record.name
        ));
    }
    if record.sweep {
        return;
    }
    let distortion = responses.iter().map(|response| response.distortion).fold(0.0, f64::max);
    outcome.check(
        CheckKind::ReferenceHarmonics,
        &place,
        distortion <= DISTORTION,
        format!("{:.2} %", 100.0 * distortion),
    );
}

fn table(record: &SineRecord, responses: &[Response]) -> TextTable {
    let columns = [
        ColumnHead::number("frequency", "Hz"),
        ColumnHead::number("records", ""),
        ColumnHead::number("amplitude", ""),
        ColumnHead::number("standard uncertainty by the records", "ppm"),
        ColumnHead::number("phase", "deg"),
        ColumnHead::number("standard uncertainty by the records", "mdeg"),
    ];
    let mut table = TextTable::new(format!("Response by frequency: {}", record.name), columns);
    for response in responses {
        table.push([
            format!("{:.3}", response.frequency_hz),
            response.records.to_string(),
            format!("{:.6}", response.ratio.portable_norm()),
            format!("{:.1}", 1e6 * response.deviations[0]),
            format!("{:+.4}", response.ratio.portable_arg().to_degrees()),
            format!("{:.2}", 1e3 * response.deviations[1].to_degrees()),
        ]);
    }
    table
}

/// Reference and sensor with the parts in which both are still.
fn parts(record: &SineRecord, samples: &UnitSamples) -> Figure {
    let (what, factor) = match record.sensor {
        InertialSensor::Gyroscope => (Axis::new("rate", "deg/s"), 1.0_f64.to_degrees()),
        InertialSensor::Accelerometer => (Axis::new("acceleration", "m/s^2"), 1.0),
    };
    let columns = [("reference", Some(samples.further())), ("sensor", sensor(record, samples))];
    let there = || columns.iter().filter_map(|(name, values)| Some((*name, (*values)?)));
    let all: Vec<&[f64]> = there().map(|(_, values)| values).collect();
    let still = still_in_vibration(&all, samples.time.interval_s);
    let above = samples.panel_of_parts(
        what,
        there().map(|(name, values)| (name, values.iter().map(|value| factor * value).collect())),
        "taken as still",
        still.into_iter().map(|rows| (rows, 0.0)),
    );
    Figure::new(
        format!("sine-{}", record.name),
        format!("Sines: {}", record.name),
        "The reference and the sensor with the parts in which both are still, the amplitude of the sensor by that of the reference, and the phase between \
         them.",
    )
    .with(above)
}

/// The parts above the response.
fn figure(record: &SineRecord, samples: &UnitSamples, responses: &[Response]) -> Figure {
    let panel = |name: &str, unit: &'static str, of: &dyn Fn(&Response) -> f64| {
        let points: Vec<(f64, f64)> =
            responses.iter().map(|response| (response.frequency_hz, of(response))).collect();
        Panel::new(Axis::new("frequency", "Hz").log(), Axis::new(name, unit)).with(Series::points(
            name,
            SeriesRole::Measured,
            points,
        ))
    };
    parts(record, samples)
        .with(panel("amplitude", "", &|response| response.ratio.portable_norm()))
        .with(panel("phase", "deg", &|response| response.ratio.portable_arg().to_degrees()))
}
