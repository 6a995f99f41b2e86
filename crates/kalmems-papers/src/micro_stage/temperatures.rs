//! The gyroscope calibrated at two temperatures: by the vibrometer, by the stage, and by the stage that finds its gaps
//! again without a vibrometer.

use super::failed;
use super::gyroscope::unit;
use super::record_sets::{
    DRIVE_HZ, DRIVES_V, GAIN, GAP, NOISE_V, RATE_HZ, VOLTS_PER_RATE, angle, channels, experiment, records_of,
};
use crate::config::TrustedNumber;
use crate::program::significance::{LEVEL, p_words};
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use crate::progress::Silent;
use crate::signal::{PortableComplex, fit_sine_at};
use crate::simulate::{ComputedRecording, WhiteNoise, described};
use kalmems_applications::calibration::{AxisSignals, HALF_WINDOW, PeakToPeak, Vibration};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::capacitance::TiltingPlate;
use kalmems_models::readout::PlateCurrent;
use kalmems_rigs::Rig;
use kalmems_rigs::equations::PresetRig;
use kalmems_rigs::micro_stage::device::MicroStage;
use kalmems_rigs::micro_stage::identification::{
    ElectrodeUnknowns, WaveRecord, Waveforms, in_situ, motion_by, unknown,
};
use kalmems_rigs::published;
use kalmems_rigs::workflow;
use std::f64::consts::TAU;

/// The scale factors.
pub static HEAD: ItemHead = ItemHead {
    key: "table-3-6",
    title: "scale factor of the gyroscope at two temperatures",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "D", label: "Table 3.6", page: "page 49" },
        PaperPlace { paper: "D", label: "Figure 3.15", page: "page 49" },
    ],
    origin: ValueOrigin::Measured,
};

/// Beside other ways to calibrate in place.
pub static BENCHMARKS: ItemHead = ItemHead {
    key: "table-3-7",
    title: "error of a scale factor that is calibrated in place",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "D", label: "Table 3.7", page: "page 50" }],
    origin: ValueOrigin::Measured,
};

/// What is different at a temperature: gaps and gains by those at room temperature, and the gyroscope.
#[derive(Clone, Copy)]
struct Temperature {
    gap: f64,
    gain: f64,
    scale_factor: f64,
}

/// 22.9 and 35.7 °C. The gyroscope's scale factor by the vibrometer is printed; the stage's change is assumed.
const ROOM: Temperature = Temperature { gap: 1.0, gain: 1.0, scale_factor: 1.0 };
const WARM: Temperature = Temperature { gap: 1.003, gain: 1.0003, scale_factor: 0.945_71 };

/// D Table 3.6: the change in percent by vibrometer and stage, and the differences of the two in ppm.
const CHANGES: [f64; 2] = [-5.429, -5.375];
const PRINTED_PPM: [f64; 2] = [-340.0, 220.0];

/// Why changes agree.
const PUT_IN: &str = "the simulated gyroscope has the printed change";

/// Samples of the gyroscope in a record, a quarter of a second.
const GYROSCOPE_SAMPLES: u32 = 2000;

/// What the rate is known by.
const WAYS: [&str; 7] = [
    "22.9 °C, vibrometer",
    "22.9 °C, stage",
    "35.7 °C, vibrometer",
    "35.7 °C, stage, identified anew with the vibrometer",
    "35.7 °C, stage, gaps found in place, gains trusted",
    "35.7 °C, stage, gains found in place, gaps trusted",
    "35.7 °C, stage, as identified at 22.9 °C",
];

/// Gap in m and gain in V·Ω of each electrode.
type Electrodes = [[f64; 2]; 4];

/// A scale factor over its true value, less 1, in ppm.
#[derive(Clone, Copy)]
struct ScaleFactorErrors {
    /// By the amplitudes of fitted sines.
    by_sines: f64,
    /// From crest to trough with an intercept, as printed.
    as_printed: f64,
}

/// One set of records: the errors by each way, and [reference, gyroscope] from crest to trough in each record.
struct RecordSet {
    errors: Vec<ScaleFactorErrors>,
    crests: Vec<Vec<[f64; 2]>>,
}

impl Temperature {
    fn channels(self) -> [PlateCurrent<f64>; 4] {
        channels().map(|channel| PlateCurrent {
            plate: TiltingPlate { gap: GAP * self.gap, ..channel.plate },
            gain: GAIN * self.gain,
        })
    }

    /// Training records with the motion as the vibrometer's noise lets it be known.
    fn training(self, seed: u64) -> Vec<WaveRecord> {
        let mut records = records_of(&self.channels(), seed);
        let mut noise = WhiteNoise::new(seed, 1);
        for record in &mut records {
            let samples = record.time_s.len() as f64;
            let deviation = NOISE_V[1] / VOLTS_PER_RATE * (2.0 / samples).sqrt() / (TAU * DRIVE_HZ);
            record.angle.amplitude += deviation * noise.sample();
        }
        records
    }

    /// Test records: the gyroscope's, and the vibrometer's beside them.
    fn test(self, seed: u64) -> [Vec<AxisSignals>; 2] {
        let mut noise = WhiteNoise::new(seed, 2);
        let [mut shown, mut known] = [Vec::new(), Vec::new()];
        for volts in DRIVES_V {
            let vibration = Vibration {
                frequency_hz: DRIVE_HZ,
                amplitude: [0.0, angle(volts).amplitude * TAU * DRIVE_HZ, 0.0],
                phase_rad: [0.0, 0.3, 0.0],
            };
            let [rates, _] = unit(self.scale_factor).record(&vibration, GYROSCOPE_SAMPLES, &mut noise);
            let [_, y, _] = rates.axes;
            shown.push(AxisSignals { axes: [None, y, None], ..rates });
            let times = (0..2300_u32).map(|k| f64::from(k) / RATE_HZ);
            let deviation = NOISE_V[1] / VOLTS_PER_RATE;
            known.push(vibration.reference(times, [false, true, false], deviation, &mut noise));
        }
        [shown, known]
    }

    /// The rate in the test records as the stage estimates it, with what is believed of its gaps and gains.
    fn by_stage(self, believed: &Electrodes, seed: u64) -> Result<Vec<AxisSignals>, ReproduceError> {
        let truth = self.channels().map(|channel| [channel.plate.gap, channel.gain]);
        let mut all = Vec::new();
        for (index, volts) in DRIVES_V.into_iter().enumerate() {
            let seed = seed + 1000 * (1 + index as u64);
            let simulated = experiment(HEAD.key, volts, seed, &truth)?;
            let simulation = PresetRig::<MicroStage>::new().simulate(&simulated).map_err(failed(HEAD.key))?;
            let unwritten = ComputedRecording::of(simulation.as_ref(), &Silent).map_err(failed(HEAD.key))?;
            let estimated = experiment(HEAD.key, volts, seed, believed)?;
            let outcome = workflow::estimate_computed(
                published(),
                &described(&estimated, simulation.as_ref()),
                &unwritten,
                &Silent,
            );
            let outcome = outcome.map_err(failed(HEAD.key))?;
            for segment in outcome.recordings.iter().flat_map(|recording| &recording.segments) {
                let estimate = &segment.estimate;
                let Some(trajectory) = estimate.trajectories.first() else { continue };
                let Some(rate) = trajectory.state("rate") else { continue };
                let from = trajectory.time_s.partition_point(|t| *t < estimate.from_s());
                all.push(AxisSignals {
                    time_s: trajectory.time_s[from..].to_vec(),
                    axes: [None, Some(rate.mean[from..].to_vec()), None],
                });
            }
        }
        Ok(all)
    }

    /// What an identification with a vibrometer finds.
    fn identified(self, seed: u64) -> Result<Electrodes, ReproduceError> {
        let plates = channels().map(|channel| TiltingPlate { gap: 19e-6, ..channel.plate });
        let waveforms = Waveforms {
            plates: &plates,
            gains: &[0.95 * GAIN; 4],
            noise: &[NOISE_V[0]; 4],
            records: &self.training(seed),
            delay_s: 0.0,
            scale_known: true,
            unknowns: ElectrodeUnknowns::Both,
            feedthrough: false,
        };
        let fit = waveforms.fit().map_err(failed(HEAD.key))?;
        Ok([0, 1, 2, 3].map(|i| [unknown::gap(i), unknown::gain(i)].map(|index| fit.parameters[index])))
    }

    /// The gaps again, without a vibrometer, where the gains of before are trusted; or the gains, where the gaps are.
    fn found_in_place(
        self,
        before: &Electrodes,
        trusted: TrustedNumber,
        seed: u64,
    ) -> Result<Electrodes, ReproduceError> {
        let mut plates = channels().map(|channel| channel.plate);
        for (plate, [gap, _]) in plates.iter_mut().zip(before) {
            plate.gap = *gap;
        }
        let gains = before.map(|[_, gain]| gain);
        let mut records = self.training(seed);
        for record in &mut records {
            if let Some(sine) = fit_sine_at(&record.time_s, &record.signals[0], DRIVE_HZ) {
                record.angle = motion_by(&plates[0], gains[0], &sine);
            }
        }
        let noise = [NOISE_V[0]; 4];
        let found = in_situ(&plates, &gains, &noise, &records, trusted, false);
        let found = found.map_err(failed(HEAD.key))?.electrodes;
        Ok([0, 1, 2, 3].map(|i| found[i].map(|value| value.value)))
    }
}

/// The scale factor of a gyroscope against a reference, record by record.
fn compare(
    truth: f64,
    shown: &[AxisSignals],
    known: &[AxisSignals],
) -> Result<(ScaleFactorErrors, Vec<[f64; 2]>), ReproduceError> {
    let (mut up, mut down) = (0.0, 0.0);
    let mut crests = Vec::new();
    let half = HALF_WINDOW / RATE_HZ * DRIVE_HZ;
    for (shown, known) in shown.iter().zip(known) {
        let mut amplitudes = [0.0; 2];
        let mut heights = [0.0; 2];
        for ((signals, amplitude), height) in
            [known, shown].into_iter().zip(&mut amplitudes).zip(&mut heights)
        {
            let tone = signals.tone(None).map_err(failed(HEAD.key))?;
            let phasor = tone.axes[1].map_or_else(Default::default, |axis| axis.phasor);
            *amplitude = phasor.portable_norm();
            let read = signals.crest_to_trough(1, tone.frequency_hz, phasor.portable_arg(), half);
            *height = read.unwrap_or(f64::NAN);
        }
        up += amplitudes[0] * amplitudes[1];
        down += amplitudes[0] * amplitudes[0];
        crests.push(heights);
    }
    let pairs: Vec<(f64, f64)> = crests.iter().map(|[x, y]| (*x, *y)).collect();
    let printed = PeakToPeak::of(&pairs).and_then(|found| found.slope).unwrap_or(f64::NAN);
    let ppm = |found: f64| 1e6 * (found / truth - 1.0);
    Ok((ScaleFactorErrors { by_sines: ppm(up / down), as_printed: ppm(printed) }, crests))
}

/// All the ways, with one set of records.
fn set(seed: u64) -> Result<RecordSet, ReproduceError> {
    let [room, warm] = [10 * seed, 10 * seed + 5];
    let known_at_room = ROOM.identified(room)?;
    let anew = WARM.identified(warm)?;
    let gaps_anew = WARM.found_in_place(&known_at_room, TrustedNumber::Gain, warm)?;
    let gains_anew = WARM.found_in_place(&known_at_room, TrustedNumber::Gap, warm)?;
    let mut set = RecordSet { errors: Vec::new(), crests: Vec::new() };
    let ways: [(Temperature, u64, &[Electrodes]); 2] =
        [(ROOM, room + 1, &[known_at_room]), (WARM, warm + 1, &[anew, gaps_anew, gains_anew, known_at_room])];
    for (temperature, seed, believed) in ways {
        let [shown, by_vibrometer] = temperature.test(seed);
        let mut references = vec![by_vibrometer];
        for believed in believed {
            references.push(temperature.by_stage(believed, seed)?);
        }
        for reference in &references {
            let (errors, crests) = compare(temperature.scale_factor, &shown, reference)?;
            set.errors.push(errors);
            set.crests.push(crests);
        }
    }
    Ok(set)
}

/// Both items.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let count = if work.effort == Effort::Quick { 2 } else { 24 };
    let seed = work.seed;
    let sets = work.map("two temperatures", (count, 1), |index, _| Some(set(seed + index as u64)))?;
    let sets: Vec<RecordSet> = sets.into_iter().collect::<Result<_, _>>()?;
    let over =
        |of: &dyn Fn(&[ScaleFactorErrors]) -> f64| SeedSpread::of(sets.iter().map(|set| of(&set.errors)));
    let mut table = TextTable::new(
        "Error of the scale factor, simulated: median and ends over the sets of records",
        [
            ColumnHead::text("temperature and reference"),
            ColumnHead::number("by fitted sines", "ppm"),
            ColumnHead::number("crest to trough, as printed", "ppm"),
        ],
    );
    for (way, name) in WAYS.into_iter().enumerate() {
        let [sines, printed] = [over(&|e| e[way].by_sines), over(&|e| e[way].as_printed)];
        table.push([name.to_owned(), sines.to_text(), printed.to_text()]);
    }
    // In percent, from room temperature to the other one.
    let change = |way: usize, room: usize| {
        over(&|e| {
            let [room, warm] = [e[room], e[way]].map(|errors| 1.0 + 1e-6 * errors.as_printed);
            100.0 * (WARM.scale_factor / ROOM.scale_factor * warm / room - 1.0)
        })
    };
    let [room, warm] = [1, 3].map(|way| over(&|e| (e[way].by_sines - e[way - 1].by_sines).abs()));
    let (in_place, stale) = (over(&|e| e[4].by_sines.abs()), over(&|e| e[6].by_sines.abs()));
    let item = Item::new(&HEAD)
        .check(Check::value("change by the vibrometer", "%", CHANGES[0], change(2, 0), CheckTolerance::difference(0.02, "noise of the records, 100 ppm at either temperature")).circular(PUT_IN))
        .check(Check::value("change by the stage", "%", CHANGES[1], change(3, 1), CheckTolerance::difference(0.112, "twice what the printed differences add up to")).circular(PUT_IN))
        .check(Check::claim(
            "stage and vibrometer differ by some hundred ppm at most",
            format!("{} and {} ppm", PRINTED_PPM[0], PRINTED_PPM[1]),
            format!("{} and {} ppm, by fitted sines", room.to_text(), warm.to_text()),
            "less than the larger of the two printed",
            room.median < 340.0 && warm.median < 340.0,
        ))
        .check(Check::claim(
            "found again in place the gaps make up for most of what the temperature did",
            "detect and compensate for effects from environmental perturbations",
            format!("{} ppm instead of {}", in_place.to_text(), stale.to_text()),
            "less than a quarter of what it is without",
            in_place.median < 0.25 * stale.median,
        ))
        .remark(
            "The scale factors of the simulated gyroscope are the printed ones by the vibrometer, so that only their differences \
             are found. The gaps grow by 0.3 % and the gains by 0.03 %, which nobody measured. At 35.7 °C the dissertation \
             identifies the stage anew with the vibrometer. Without one the gains are trusted: their own error, and what the \
             temperature did to them, are in the rate in full; whoever trusts the gaps, which moved, has that in it.",
        )
        .remark(
            "The regression over crests and troughs has an intercept that a scale factor does not need; it makes the errors \
             several times larger than fitted sines do.",
        )
        .table(table);
    let item = match sets.first() {
        Some(first) => item.figure(figure(&first.crests)),
        None => item,
    };
    let root = |of: &dyn Fn(&ScaleFactorErrors) -> f64| over(&|e| root_of(e, of));
    let (printed, sines) = (root(&|e| e.as_printed), root(&|e| e.by_sines));
    let roots = sets.iter().map(|set| root_of(&set.errors, &|e| e.as_printed));
    let rms = (roots.map(|root| root * root).sum::<f64>() / sets.len() as f64).sqrt();
    let chance = chance_of_two(PRINTED_PPM, rms, sets.len());
    let benchmarks = Item::new(&BENCHMARKS)
        .check(Check::claim(
            "stage and vibrometer differ as much as printed",
            format!("{} and {} ppm, 286 rms", PRINTED_PPM[0], PRINTED_PPM[1]),
            format!("{} ppm rms in {} differences, {}", significant(rms), 2 * sets.len(), p_words(chance)),
            "the two printed differences can have the variance of ours, by an F test at 5 % on either side",
            chance > LEVEL,
        ))
        .check(Check::claim(
            "closer than a virtual input rate, and than the actuator alone",
            "286 ppm; 350 ppm and 1 % by others",
            format!("{} ppm; by fitted sines {}", printed.to_text(), sines.to_text()),
            "less than the 350 ppm of others",
            printed.median < 350.0,
        ))
        .remark(
            "What others report is from their papers and is not computed here: 350 ppm and 0.35 % by a virtual input rate, 1200 \
             ppm by hand, 1 % and 258 ppm by a stage that is measured by optics.",
        );
    Ok(vec![item, benchmarks])
}

/// The root mean square, over both temperatures, of what the stage differs from the vibrometer by.
fn root_of(errors: &[ScaleFactorErrors], of: &dyn Fn(&ScaleFactorErrors) -> f64) -> f64 {
    let apart = [1, 3].map(|way| (of(&errors[way]) - of(&errors[way - 1])).powi(2));
    (0.5 * (apart[0] + apart[1])).sqrt()
}

/// How probable it is that two differences are as far from what `rms`, of twice `pairs` differences, lets expect, or further: by
/// Snedecor's F of 2 and twice `pairs` degrees of freedom, whose tail is (1 + F/pairs)^−pairs.
fn chance_of_two(two: [f64; 2], rms: f64, pairs: usize) -> f64 {
    let ratio = 0.5 * (two[0].powi(2) + two[1].powi(2)) / (rms * rms);
    let factor = 1.0 / (1.0 + ratio / pairs as f64);
    let above = (0..pairs).fold(1.0, |product, _| product * factor);
    2.0 * above.min(1.0 - above)
}

fn figure(crests: &[Vec<[f64; 2]>]) -> Figure {
    let of = |way: usize, label: &str, role: SeriesRole, is_line: bool| {
        let points: Vec<(f64, f64)> = crests[way].iter().map(|[x, y]| (*x, *y)).collect();
        if is_line { Series::line(label, role, points) } else { Series::points(label, role, points) }
    };
    let panel = Panel::new(
        Axis::new("reference, from crest to trough", "rad/s"),
        Axis::new("gyroscope, from crest to trough", "rad/s"),
    )
    .with(of(0, "22.9 °C, vibrometer", SeriesRole::Reference, true))
    .with(of(1, "22.9 °C, stage", SeriesRole::Estimate, false))
    .with(of(2, "35.7 °C, vibrometer", SeriesRole::Input, true))
    .with(of(3, "35.7 °C, stage", SeriesRole::Measured, false));
    Figure::new(
        "table-3-6_crests",
        "Gyroscope over reference at two temperatures",
        "As D Figure 3.15, of one set of records: the slopes are the scale factors.",
    )
    .with(panel)
}

#[cfg(test)]
mod tests {
    use super::chance_of_two;

    /// F of 2 and 24 degrees of freedom is above 3.403 in 5 %, and above 4.319 in 2.5 % of all cases (any table of F).
    #[test]
    fn two_differences_are_judged_by_the_distribution_of_f() {
        let at = |f: f64| chance_of_two([f.sqrt(), f.sqrt()], 1.0, 12);
        assert!((at(3.403) - 0.1).abs() < 1e-3 && (at(4.319) - 0.05).abs() < 1e-3);
        assert!(at(1e-3) < 0.01 && at(0.7) > 0.9);
    }
}
