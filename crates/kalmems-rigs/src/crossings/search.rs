//! The search for crossings while the rows of a segment come.

use super::crossing::{CrossingReading, LevelCrossing};
use super::fallback::{CrossingPlace, Fallback};
use super::kernel::{CrossingKernel, KernelWindow, kernel};
use super::line::{CombWaveform, CrossingWaveform};
use super::settings::{Acceptance, DetectorSettings};
use crate::signal::GAP;
use kalmems_core::detect::{DetectError, HoldLevel, Peak, Threshold, angle_variance, peaks};
use kalmems_models::capacitance::CombCurve;
use kalmems_models::dynamics::MirrorResonator;
use std::sync::Arc;

/// What is known of a signal in which crossings of a level are looked for.
#[derive(Clone)]
pub struct SearchedSignal {
    /// The usual interval in s.
    pub interval_s: f64,
    /// The variance of one sample in the signal's unit².
    pub noise_variance: f64,
    /// The level that is crossed.
    pub level: CrossingLevel,
    /// Whether the signal falls where it crosses the level.
    pub falls: bool,
    /// How often it crosses the level while the device moves, per s.
    pub passes_hz: f64,
    /// The signal around a crossing as a model gives it, where there is one.
    pub line: Option<Arc<dyn CrossingWaveform>>,
}

/// The level that a signal crosses.
#[derive(Clone, Copy, Debug)]
pub struct CrossingLevel {
    /// What it is, as far as is known.
    pub value: f64,
    /// Whether it is, from the first crossing on, the mean of the signal since then: of a current, which adds up to nothing from one
    /// crossing to the next, the offset.
    pub follows_mean: bool,
}

impl SearchedSignal {
    /// In the signal of a comb, with this interval in s, variance of one sample in V² and offset in V.
    pub fn of_comb(
        (interval_s, noise_variance, offset): (f64, f64, f64),
        comb: CombCurve<f64>,
        resonator: MirrorResonator<f64>,
    ) -> Self {
        let line = CombWaveform { resonator, comb, interval_s };
        Self {
            interval_s,
            noise_variance,
            level: CrossingLevel { value: offset, follows_mean: true },
            falls: comb.steepest() < 0.0,
            passes_hz: line.passes_hz(),
            line: Some(Arc::new(line)),
        }
    }
}

/// Rows of a signal.
#[derive(Clone, Copy)]
pub struct SignalRows<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The signal, without what the drive adds.
    pub volts: &'a [f64],
    /// Which row of the segment the first one is.
    pub first: usize,
}

impl SignalRows<'_> {
    fn end(&self) -> usize {
        self.first + self.volts.len()
    }

    /// The rows from one row of the segment up to another one that do not follow the row before them in time: samples are missing.
    fn behind_gaps(&self, from: usize, to: usize, interval_s: f64) -> impl Iterator<Item = usize> {
        let place = |row: usize| row.saturating_sub(self.first).min(self.time_s.len());
        let (first, from) = (self.first, place(from));
        let steps = self.time_s[from..place(to).max(from)].windows(2).enumerate();
        steps
            .filter(move |(_, times)| times[1] - times[0] > GAP * interval_s)
            .map(move |(i, _)| first + from + i + 1)
    }

    /// The volts of some rows of the segment, as far as they are there.
    fn volts(&self, from: usize, to: usize) -> &[f64] {
        let place = |row: usize| row.saturating_sub(self.first).min(self.volts.len());
        &self.volts[place(from)..place(to).max(place(from))]
    }
}

/// A variance of 1/12 sample²: a time that is known to the sample.
const OF_A_SAMPLE: f64 = 1.0 / 12.0;

/// A search on its way through a segment.
///
/// A row is decided on when [`KernelWindow::look_ahead`] rows after it are there, or the segment has ended, and by these alone; so the
/// crossings do not depend on how many rows come at a time.
pub struct CrossingSearch {
    sought: SearchedSignal,
    kernel: Box<dyn CrossingKernel + Send>,
    window: KernelWindow,
    fallback: Option<Fallback>,
    threshold: Threshold<f64>,
    /// The standard deviation of the response to noise.
    deviation: f64,
    /// Rows of the segment that were taken, and those of them that are decided on.
    rows: usize,
    decided: usize,
    /// The last crossing.
    last: Option<u64>,
    offset: Offset,
    /// The responses from a row on that the next rows are compared with.
    responses: Vec<f64>,
    first_response: usize,
    spare: Vec<f64>,
    /// The largest response of either sign.
    rising: f64,
    falling: f64,
    found: usize,
}

/// What a search found so far, as far as it tells whether the signal is that of the comb.
#[derive(Clone, Copy, Debug)]
pub struct SearchTally {
    /// How many crossings.
    pub count: usize,
    /// The largest response in standard deviations of that to noise.
    pub rising: f64,
    /// The largest response of the other sign.
    pub falling: f64,
    /// The smallest response that counts.
    pub threshold: f64,
    /// How many crossings noise alone would be taken for.
    pub by_noise: f64,
}

/// The numbers of a search, besides its crossings.
pub const NUMBERS: usize = 8;

impl CrossingSearch {
    /// Before the first row of a segment.
    pub fn new(sought: SearchedSignal, settings: &DetectorSettings) -> Result<Self, DetectError> {
        let width = settings.width_s / sought.interval_s;
        let window = settings.window(sought.interval_s);
        let mut kernel = kernel(window, width)?;
        let noise = sought.noise_variance.sqrt();
        let deviation = kernel.noise_deviation(noise);
        let threshold = match settings.acceptance {
            Acceptance::Deviations(deviations) => Threshold::fixed(deviations * deviation),
            Acceptance::FalseAlarms { per_s, keep } => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating
                let samples = (2.0 / (sought.passes_hz * sought.interval_s)) as u32;
                let hold = keep.map(|deviations| HoldLevel { deviations, samples });
                kernel.threshold(noise, per_s * sought.interval_s, window.reach, hold)?
            }
        };
        if sought.falls {
            kernel.falling();
        }
        let of_line = |line| {
            Fallback::new(line, (window, width), (sought.noise_variance, deviation, sought.interval_s))
        };
        Ok(Self {
            kernel,
            window,
            fallback: sought.line.clone().map(of_line),
            threshold,
            deviation,
            rows: 0,
            decided: 0,
            last: None,
            offset: Offset::new(sought.level),
            sought,
            responses: Vec::new(),
            first_response: 0,
            spare: Vec::new(),
            rising: 0.0,
            falling: 0.0,
            found: 0,
        })
    }

    /// Where another run left it, with these [`numbers`](Self::numbers), when it is given rows from this one on.
    pub fn resumed(mut self, numbers: &[f64; NUMBERS], first: usize) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts of rows
        let row = |number: f64| number as usize;
        let [decided, last, begun, sum, count, rising, falling, found] = *numbers;
        self.decided = row(decided);
        self.last = last.is_finite().then(|| row(last) as u64);
        self.offset = Offset { begun: begun > 0.0, sum, count: row(count), ..self.offset };
        (self.rising, self.falling, self.found) = (rising, falling, row(found));
        // The rows that are given again are taken again, for the responses to them alone.
        self.rows = first;
        self.first_response = self.rows.saturating_sub(self.window.half);
        self
    }

    /// What another run needs to go on from here, but for the rows and the crossings.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        [
            self.decided as f64,
            self.last.map_or(f64::NAN, |last| last as f64),
            f64::from(u8::from(self.offset.begun)),
            self.offset.sum,
            self.offset.count as f64,
            self.rising,
            self.falling,
            self.found as f64,
        ]
    }

    /// The standard deviation of a sample's noise.
    pub fn noise(&self) -> f64 {
        self.sought.noise_variance.sqrt()
    }

    /// What was found so far.
    pub fn tally(&self) -> SearchTally {
        let threshold = self.threshold.acquire() / self.deviation;
        SearchTally {
            count: self.found,
            rising: self.rising / self.deviation,
            falling: self.falling / self.deviation,
            threshold,
            by_noise: self.kernel.detections(threshold, self.window.reach) * self.rows as f64,
        }
    }

    /// The crossings that rows bring out. They are the next ones, and [`KernelWindow::look_back`] before them as far as the segment has
    /// these; `ends` says that no further ones come.
    pub fn take(&mut self, rows: &SignalRows, ends: bool) -> Vec<LevelCrossing> {
        self.respond(rows, ends);
        let end = rows.end();
        let until = if ends { end } else { end.saturating_sub(self.window.look_ahead()).max(self.decided) };
        let mut crossings = Vec::new();
        for peak in self.peaks(until) {
            if self.threshold.takes(&peak, self.last) {
                self.last = Some(peak.index);
                crossings.push(self.crossing(&peak, rows));
            }
        }
        self.offset.advance(rows, self.decided, until);
        self.found += crossings.len();
        (self.rows, self.decided) = (end, until);
        let needed = until.saturating_sub(self.window.reach + 1);
        if needed > self.first_response {
            self.responses.drain(..(needed - self.first_response).min(self.responses.len()));
            self.first_response = needed;
        }
        crossings
    }

    /// Computes the responses that new rows bring out.
    fn respond(&mut self, rows: &SignalRows, ends: bool) {
        let half = self.window.half;
        let from = self.rows.saturating_sub(2 * half).max(rows.first);
        let signal = rows.volts(from, rows.end());
        self.spare.resize(signal.len(), f64::NAN);
        self.kernel.responses(signal, &mut self.spare);
        // The signal on the one side of a gap and on the other is no slope: nothing is said where both are seen.
        for behind in rows.behind_gaps(from, rows.end(), self.sought.interval_s) {
            let seen = behind.saturating_sub(half).max(from)..(behind + half).min(rows.end());
            self.spare[seen.start - from..seen.end - from].fill(f64::NAN);
        }
        let until = if ends { rows.end() } else { rows.end().saturating_sub(half) };
        for row in self.first_response + self.responses.len()..until {
            let response = row.checked_sub(from).and_then(|k| self.spare.get(k)).copied().unwrap_or(f64::NAN);
            self.responses.push(response);
            // Those that another run saw are in its largest ones.
            self.rising = self.rising.max(response);
            self.falling = self.falling.max(-response);
        }
    }

    /// The maxima among the rows from the decided ones to this one that no other one near outdoes.
    fn peaks(&self, until: usize) -> Vec<Peak<f64>> {
        let KernelWindow { reach, .. } = self.window;
        let place = |row: usize| row.saturating_sub(self.first_response).min(self.responses.len());
        let keep = self.threshold.keep();
        if !self.responses[place(self.decided)..place(until)].iter().any(|response| *response > keep) {
            return Vec::new();
        }
        let from = place(self.decided.saturating_sub(reach + 1));
        let near = &self.responses[from..place(until + reach + 1)];
        let first = self.first_response + from;
        peaks(near, reach, Threshold::fixed(keep))
            .map(|peak| Peak { index: peak.index + first as u64, ..peak })
            .filter(|peak| (self.decided as u64..until as u64).contains(&peak.index))
            .collect()
    }

    /// The crossing at a maximum.
    fn crossing(&mut self, peak: &Peak<f64>, rows: &SignalRows) -> LevelCrossing {
        let SearchedSignal { interval_s, noise_variance, line, falls, .. } = self.sought.clone();
        let sign = if falls { -1.0 } else { 1.0 };
        #[allow(clippy::cast_possible_truncation)] // an index of the signal
        let index = peak.index as usize;
        let offset = self.offset.at(rows, self.decided, index);
        let here_s = rows.time_s.get(index - rows.first).copied().unwrap_or(f64::NAN);
        let instant = |after: f64, slope: f64, variance: f64| CrossingReading {
            time_s: here_s + after * interval_s,
            sd_s: variance.sqrt() * interval_s,
            angle_variance: line
                .as_ref()
                .map_or(f64::NAN, |line| angle_variance(variance, line.rate(slope), interval_s)),
            volts_per_s: slope * sign / interval_s,
        };
        let jitter = self.kernel.timing_variance(noise_variance, peak.curvature);
        let known_at = index + self.window.look_ahead();
        // As far as the samples follow each other.
        let reach = self.window.look_ahead().max(2 * self.window.fit);
        let (mut from, mut until) = (index.saturating_sub(reach).max(rows.first), known_at + 1);
        for behind in rows.behind_gaps(from, until, interval_s) {
            if behind <= index {
                from = behind;
            } else {
                until = until.min(behind);
            }
        }
        let near = rows.volts(from, until);
        let fitted_from = from.max(index.saturating_sub(2 * self.window.fit));
        let fitted = rows.volts(fitted_from, until);
        let zero = self.kernel.crossing(fitted, index - fitted_from, offset, noise_variance);
        let kernel = &*self.kernel;
        let fallback = self.fallback.as_mut().and_then(|fallback| {
            let is_told = zero.is_some() && fallback.is_clear(kernel, peak.height);
            (!is_told).then(|| fallback.place(kernel, peak, near, index - from))
        });
        LevelCrossing {
            sample: instant(0.0, peak.height, jitter + OF_A_SAMPLE),
            parabola: instant(peak.fraction, peak.height, jitter),
            fallback: fallback.map(|CrossingPlace { displacement, variance, slope }| {
                instant(displacement, slope, variance)
            }),
            zero: zero.map(|zero| instant(zero.displacement, zero.slope, zero.timing_variance)),
            index,
            known_at,
        }
    }
}

/// The level of a signal, from what came before.
///
/// From one crossing of a comb to the next the capacitance returns to its peak, so that the current in between adds up to nothing:
/// the mean of the signal from the first crossing on is its offset.
#[derive(Clone, Copy)]
struct Offset {
    known: CrossingLevel,
    /// Whether there was a crossing.
    begun: bool,
    sum: f64,
    count: usize,
    /// The row that the sum goes to, where that is beyond the decided ones.
    next: usize,
}

impl Offset {
    fn new(known: CrossingLevel) -> Self {
        Self { known, begun: false, sum: 0.0, count: 0, next: 0 }
    }

    /// At a crossing, each of which is later than the one before; `decided` is the row that the last rows were decided to.
    fn at(&mut self, rows: &SignalRows, decided: usize, index: usize) -> f64 {
        if !self.begun {
            self.begun = true;
            self.next = index;
            return self.known.value;
        }
        self.advance(rows, decided, index);
        if self.count == 0 { self.known.value } else { self.sum / self.count as f64 }
    }

    /// Adds the rows before one.
    fn advance(&mut self, rows: &SignalRows, decided: usize, until: usize) {
        if !(self.begun && self.known.follows_mean) {
            return;
        }
        for y in rows.volts(self.next.max(decided), until) {
            if y.is_finite() {
                self.sum += y;
                self.count += 1;
            }
        }
        self.next = self.next.max(until);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crossings::find;
    use crate::simulate::WhiteNoise;
    use kalmems_core::detect::{CubicFit, Detector, SlopeKernel};
    use kalmems_models::capacitance::CurveShape;

    const RATE: f64 = 3924.5;
    const NOISE: f64 = 0.0435;
    const DECAY: f64 = 26.0;

    fn comb() -> CombCurve<f64> {
        CombCurve { centre: 0.0037, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic }
    }

    fn sought() -> SearchedSignal {
        let resonator = MirrorResonator { natural_rate: RATE, damping_ratio: DECAY / RATE };
        SearchedSignal::of_comb((2e-6, NOISE * NOISE, 0.0), comb(), resonator)
    }

    /// Times in s and volts of a decay with a gap.
    fn decay() -> (Vec<f64>, Vec<f64>) {
        let interval_s = sought().interval_s;
        let mut white = WhiteNoise::new(3, 0);
        let time_s: Vec<f64> = (0..40_000).map(|k| f64::from(k) * interval_s).collect();
        let volts = |t: &f64| {
            let (sine, cosine) = (RATE * t).sin_cos();
            let amplitude = 0.15 * (-DECAY * t).exp();
            comb().sensitivity(amplitude * sine) * amplitude * RATE * cosine + 0.01 + NOISE * white.sample()
        };
        let mut volts: Vec<f64> = time_s.iter().map(volts).collect();
        volts[20_000..20_050].fill(f64::NAN);
        (time_s, volts)
    }

    const ACCEPTANCES: [Acceptance; 3] = [
        Acceptance::Deviations(2.0),
        Acceptance::Deviations(4.0),
        Acceptance::FalseAlarms { per_s: 10.0, keep: Some(2.0) },
    ];

    /// A detector of the core that runs with the signal finds the same, bit by bit, at the sample that the rig tells its filters.
    #[test]
    fn a_detector_in_constant_memory_finds_the_same_at_the_same_sample() {
        type Stream = Detector<f64, 60, 150, 400>;
        let (time_s, volts) = decay();
        let SearchedSignal { interval_s, noise_variance, .. } = sought();
        for acceptance in ACCEPTANCES {
            let settings = DetectorSettings { width_s: 30e-6, separation_s: 300e-6, acceptance };
            let rows = SignalRows { time_s: &time_s, volts: &volts, first: 0 };
            let batch = find(rows, sought(), &settings).unwrap();
            let kernel = SlopeKernel::<f64, 60>::new(15.0).unwrap();
            let threshold = match acceptance {
                Acceptance::Deviations(sds) => Threshold::fixed(sds * kernel.noise_deviation(NOISE)),
                Acceptance::FalseAlarms { per_s, keep } => {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundreds
                    let samples = (2.0 / (sought().passes_hz * interval_s)) as u32;
                    let hold = keep.map(|deviations| HoldLevel { deviations, samples });
                    Threshold::for_false_alarms(&kernel, NOISE, per_s * interval_s, 150, hold).unwrap()
                }
            };
            let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
            let mut stream = Stream::new(kernel, threshold, noise_variance);
            let (mut found, mut first) = (0, None);
            for (k, volts_now) in volts.iter().chain([f64::NAN; Stream::LOOK_AHEAD].iter()).enumerate() {
                let Some(detection) = stream.push(*volts_now) else { continue };
                let mine = &batch[found];
                found += 1;
                let index = usize::try_from(detection.index).unwrap();
                assert_eq!((mine.index, mine.known_at), (index, k));
                assert_eq!(mine.sample.time_s, time_s[index]);
                assert!(
                    (mine.parabola.time_s - time_s[index] - detection.fraction * interval_s).abs() < 1e-12
                );
                let between: Vec<f64> = (volts[*first.get_or_insert(index)..index].iter())
                    .filter(|y| y.is_finite())
                    .copied()
                    .collect();
                // Near the ends of the recording the memory of the stream is not full.
                if (400..volts.len()).contains(&k) {
                    let mean = between.iter().sum::<f64>() / between.len() as f64;
                    let zero = stream.crossing(&fit, if between.is_empty() { 0.0 } else { mean });
                    // Beside the gap neither has one.
                    assert_eq!(zero.is_some(), mine.zero.is_some(), "{index}");
                    let Some((zero, mine)) = zero.zip(mine.zero) else { continue };
                    let apart_s = mine.time_s - time_s[index] - zero.displacement * interval_s;
                    assert!(apart_s.abs() < 1e-12, "{index}: {apart_s:e}");
                    assert!((mine.sd_s / interval_s - zero.timing_variance.sqrt()).abs() < 1e-9);
                }
            }
            assert_eq!(found, batch.len());
            assert!(found > 60, "{found}");
        }
    }

    /// However many rows come at a time, and wherever another run takes over: the same crossings, bit by bit, each as soon as it
    /// is known.
    #[test]
    fn crossings_do_not_depend_on_how_the_rows_come() {
        let (time_s, volts) = decay();
        let many = (Acceptance::Deviations(0.2), 60e-6);
        for (acceptance, separation_s) in ACCEPTANCES.map(|a| (a, 300e-6)).into_iter().chain([many]) {
            let settings = DetectorSettings { width_s: 30e-6, separation_s, acceptance };
            let whole =
                find(SignalRows { time_s: &time_s, volts: &volts, first: 0 }, sought(), &settings).unwrap();
            let window = settings.window(sought().interval_s);
            for length in [1, 37, 500, 39_000] {
                let mut search = CrossingSearch::new(sought(), &settings).unwrap();
                let (mut found, mut from) = (Vec::new(), 0);
                while from < volts.len() {
                    let end = (from + length).min(volts.len());
                    let first = from.saturating_sub(window.look_back());
                    if from % 31 == 5 {
                        search = CrossingSearch::new(sought(), &settings)
                            .unwrap()
                            .resumed(&search.numbers(), first);
                    }
                    let rows = SignalRows { time_s: &time_s[first..end], volts: &volts[first..end], first };
                    let new = search.take(&rows, end == volts.len());
                    assert!(new.iter().all(|c| end == volts.len() || (from..end).contains(&c.known_at)));
                    found.extend(new);
                    from = end;
                }
                assert_eq!(found, whole, "{length} {acceptance:?}");
                assert_eq!(search.tally().count, whole.len());
            }
            for crossing in &whole {
                assert_eq!(
                    LevelCrossing::of_numbers(&crossing.numbers()).numbers().map(f64::to_bits),
                    crossing.numbers().map(f64::to_bits)
                );
            }
        }
    }
}
