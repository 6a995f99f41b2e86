//! Which samples of a signal are no samples of it: an innovation gate that cannot lock itself out.
//!
//! A sample is rejected where its normalised innovation squared z² is above the quantile L of χ² with one degree of freedom that a filter that
//! is right passes with the stated probability. Three rules keep a filter that is wrong from rejecting what would put it right:
//!
//! - Before the settling time nothing is rejected.
//! - The innovations are measured by themselves as well. m follows the median of z² over the accepted samples of the last hundred, and the
//!   bound is L·max(1, m/m₀) with the median m₀ of χ². Innovations that are all larger than claimed, because the noise is stated too small or
//!   the model is not quite the device, so are no outliers, and their mean NIS tells of it. A median does not move by outliers.
//! - A forgetting mean follows the share of the samples beyond the bound. Above [`OPENS`] the gate opens, and everything is accepted until the
//!   share is below [`CLOSES`]. With a memory of [`MEMORY_S`], but not below [`FEWEST`] samples, an uninterrupted burst is survived for
//!   −ln(1 − 1/8)·10 ms = 1.34 ms, and after a step of the signal the filter is corrected from then on; one outlier in twelve never opens it.

use super::transition::Sensor;
use kalmems_core::{FilterError, Innovation, Scalar};
use statrs::function::erf::{erf, erfc_inv};
use statrs::function::gamma::ln_gamma;
use std::f64::consts::{PI, SQRT_2, TAU};
use std::sync::Arc;

/// How improbable a sample of a filter that is right must be for it to be rejected, where the file does not say.
pub const FALSE_REJECTIONS: f64 = 1e-7;

/// The share of samples beyond the bound from which on they are accepted again, and below which they are not.
const OPENS: f64 = 0.125;
const CLOSES: f64 = 0.0625;

/// Over how long, in s, and over how many samples at least that share is taken.
const MEMORY_S: f64 = 10e-3;
const FEWEST: f64 = 64.0;

/// The place of what is no signal among the signals: an event, such as a crossing of a threshold.
pub const EVENTS: usize = usize::MAX;

/// How suspect a rejection makes the samples behind it, from where on they are, and at most. What comes in a burst and is near enough by
/// chance would be believed the more, the less is known by then; so of a burst's end so many samples are left out.
const SUSPECT: u32 = 2;
const SUSPECTED: u32 = 2;
const MOST_SUSPECT: u32 = 16;

/// The median of χ² with one degree of freedom.
const MEDIAN: f64 = 0.454_936_423_119_573;

/// How much the median is moved by a sample: e^(±1/64). The bound's standard deviation is 7 % of it then.
const UP: f64 = 1.015_747_708_586_685_7;
const DOWN: f64 = 0.984_496_437_005_408_5;

/// Events that the median of an event's z² is taken over; they are too few to follow one.
const EVENTS_BEFORE: usize = 9;

/// What a gate rejects of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejection {
    /// The sample, by its place in the trajectory.
    pub sample: usize,
    /// When, in s.
    pub time_s: f64,
    /// The signal: 0 for the first one, and further ones from 1 on.
    pub signal: usize,
    /// Measured minus predicted, in the signal's unit.
    pub innovation: f64,
    /// The standard deviation that the filter gives it.
    pub sd: f64,
}

impl Rejection {
    /// The innovation in standard deviations.
    pub fn size(&self) -> f64 {
        self.innovation / self.sd
    }
}

/// A time at which a gate began to accept what is beyond its bound, or ended to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateTurn {
    /// When, in s.
    pub time_s: f64,
    /// Whether it began.
    pub opens: bool,
}

/// How many samples of this interval in s a gate's memory goes back.
pub fn memory_samples(interval_s: f64) -> f64 {
    (MEMORY_S / interval_s).max(FEWEST)
}

/// The largest normalised innovation squared of a filter that is right but for this share of its samples.
pub fn largest_nis(false_rejections: f64) -> f64 {
    (SQRT_2 * erfc_inv(false_rejections)).powi(2)
}

/// What a sample is corrected with where its innovation is large.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum UpdateLaw {
    /// The noise is normally distributed.
    #[default]
    Normal,
    /// It is so up to this many standard deviations, and has exponential tails beyond (Huber).
    Huber(f64),
    /// It has Student's t distribution with so many degrees of freedom, the stated variance being the square of its scale.
    StudentT(f64),
}

/// How a filter takes its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GateMode {
    /// The largest normalised innovation squared that is believed, where there is a gate.
    pub largest_nis: Option<f64>,
    /// How long the filter has to settle, in s.
    pub after_s: f64,
    /// The law of the noise.
    pub law: UpdateLaw,
}

/// A gate of events on its way.
#[derive(Clone, Copy, Debug)]
struct EventGate {
    /// z² of the last ones, taken or not, the oldest to be replaced next; infinite before there were as many.
    last: [f64; EVENTS_BEFORE],
    next: usize,
}

impl EventGate {
    const NEW: Self = Self { last: [f64::INFINITY; EVENTS_BEFORE], next: 0 };

    /// The largest z² that is believed.
    fn bound(&self, largest_nis: f64) -> f64 {
        let mut sorted = self.last;
        sorted.sort_by(f64::total_cmp);
        largest_nis * (sorted[EVENTS_BEFORE / 2] / MEDIAN).max(1.0)
    }

    fn note(&mut self, nis: f64) {
        self.last[self.next] = nis;
        self.next = (self.next + 1) % EVENTS_BEFORE;
    }
}

/// Rejections by another filter: of each the time in s and the signal, in that order.
pub type Decisions = Arc<[(f64, usize)]>;

/// A gate of one signal on its way.
#[derive(Clone, Copy, Debug)]
struct SignalGate {
    /// The share of samples beyond the bound.
    share: f64,
    /// The median of z².
    median: f64,
    is_open: bool,
    /// How suspect the next sample is.
    suspect: u32,
    /// Samples of the settling time.
    settling: u32,
    /// All samples, and those beyond the bound.
    samples: f64,
    beyond: f64,
}

/// Numbers of a gate.
const GATE_NUMBERS: usize = 7;

impl SignalGate {
    const NEW: Self = Self {
        share: 0.0,
        median: MEDIAN,
        is_open: false,
        suspect: 0,
        settling: 0,
        samples: 0.0,
        beyond: 0.0,
    };

    /// ln p of an innovation by what the gate takes samples for: a share o of them is disturbed, and twice as many as lie beyond the bound L were
    /// before. A disturbance z standard deviations large has the density 1/(4·√L) within the bound and √L/(4·z²) beyond, where half of them are; all other
    /// samples have that of the noise, whose logarithm is `normal`.
    fn log_density(&self, normal: f64, (nis, total): (f64, f64), bound: f64) -> f64 {
        // Half a sample is disturbed before the first (Krichevsky & Trofimov): what is foreseen depends on the past alone.
        let [disturbed, others] =
            [2.0 * self.beyond, self.samples - 2.0 * self.beyond].map(|n| n.max(0.0) + 0.5);
        let disturbed = disturbed / (disturbed + others);
        let of_disturbance = (bound / nis).min(1.0) / (4.0 * (bound * total).sqrt());
        Scalar::ln((1.0 - disturbed) * Scalar::exp(normal) + disturbed * of_disturbance)
    }

    /// The largest z² that is no outlier.
    fn bound(&self, largest_nis: f64) -> f64 {
        largest_nis * (self.median / MEDIAN).max(1.0)
    }

    /// Takes notice of a sample; `forgets` is the share of the memory that one is.
    fn note(&mut self, nis: f64, (is_beyond, is_taken): (bool, bool), has_settled: bool, forgets: f64) {
        self.samples += 1.0;
        self.beyond += f64::from(u8::from(is_beyond));
        // At the end of the settling time the share is that of its last quarter: a filter that is lost by then is not kept so.
        let forgets = if has_settled { forgets } else { forgets.max(4.0 / (4.0 + f64::from(self.settling))) };
        self.settling = self.settling.saturating_add(u32::from(!has_settled));
        self.share += (f64::from(u8::from(is_beyond)) - self.share) * forgets;
        self.is_open = self.share > if self.is_open { CLOSES } else { OPENS };
        self.suspect = match (self.is_open, is_beyond) {
            (true, _) => 0,
            (_, true) => (self.suspect + SUSPECT).min(MOST_SUSPECT),
            _ => self.suspect.saturating_sub(1),
        };
        if is_taken {
            let by = if nis > self.median { UP } else { DOWN };
            // A careful filter's median is not followed to nothing, so that it is back in time.
            self.median = (self.median * by).max(0.25 * MEDIAN);
        }
    }
}

/// Who decides what is rejected.
#[derive(Clone, Debug, Default)]
enum RejectionSource {
    /// The gate itself.
    #[default]
    Itself,
    /// Another run of the filter, of all samples.
    Before(Decisions),
    /// Another filter beside, of the present sample: the signals that it rejected.
    Beside(Vec<usize>),
}

/// How a filter on its way takes its samples.
#[derive(Clone, Debug)]
pub struct SampleGate {
    taking: GateMode,
    /// From when on it may reject, in s.
    from_s: f64,
    /// The share of the memory that a sample is.
    forgets: f64,
    /// One for each signal.
    gates: Vec<SignalGate>,
    events: EventGate,
    decided: RejectionSource,
    /// The time of the present sample in s, what was rejected of it, and whether a gate turned.
    now_s: f64,
    rejected: Vec<(usize, f64, f64)>,
    turned: Option<bool>,
    /// Σ ln p over the signals of the present sample by what each is taken for; none before the first of them.
    log_density: Option<f64>,
    /// Those of them that were taken.
    taken: Vec<Innovation<f64, 1>>,
}

impl SampleGate {
    /// From a segment's beginning in s on, with samples in this interval in s.
    pub(super) fn new(taking: GateMode, start_s: f64, interval_s: f64) -> Self {
        // Half an ulp of a decimal time must not decide about a sample.
        let from_s = start_s + taking.after_s * (1.0 - 1e-12);
        let memory = memory_samples(interval_s);
        let (gates, rejected, events) = (Vec::new(), Vec::new(), EventGate::NEW);
        Self {
            taking,
            from_s,
            forgets: memory.recip(),
            gates,
            events,
            decided: RejectionSource::Itself,
            now_s: f64::NAN,
            rejected,
            turned: None,
            log_density: None,
            taken: Vec::new(),
        }
    }

    /// Follows what another run of the filter decided, or decides by itself.
    pub(super) fn follow(&mut self, decided: Option<&Decisions>) {
        self.decided =
            decided.map_or(RejectionSource::Itself, |decided| RejectionSource::Before(Arc::clone(decided)));
    }

    /// Comes to the present sample of a filter that says what several do, of which this one decides for all.
    pub(super) fn lead(&mut self, led: &Self) {
        self.at(led.now_s);
        self.decided = match &led.decided {
            RejectionSource::Before(decided) => RejectionSource::Before(Arc::clone(decided)),
            RejectionSource::Itself | RejectionSource::Beside(_) => RejectionSource::Itself,
        };
    }

    /// Comes to the present sample of such a filter, and follows what was decided.
    pub(super) fn follow_other(&mut self, led: &Self) {
        self.at(led.now_s);
        if !matches!(self.decided, RejectionSource::Beside(_)) {
            self.decided = RejectionSource::Beside(Vec::new());
        }
        if let RejectionSource::Beside(signals) = &mut self.decided {
            signals.clear();
            signals.extend(led.rejected.iter().map(|(signal, ..)| *signal));
        }
    }

    /// Says what the one that decides did with the present sample.
    pub(super) fn adopt_decisions(&mut self, leader: &Self) {
        self.rejected.clone_from(&leader.rejected);
        self.turned = leader.turned;
    }

    /// Σ ln p over the signals of the present sample by what the filter takes each for: densities, so that filters of every law are compared
    /// by the same samples. `None` where no signal was taken through this gate.
    pub(super) fn log_density(&self) -> Option<f64> {
        self.log_density
    }

    /// Σ ln p by the normal law over the signals of the present sample that were taken.
    pub(super) fn taken_log_likelihood(&self) -> f64 {
        self.taken.iter().fold(0.0, |sum, found| sum + found.log_likelihood())
    }

    /// Of a filter that says what several do: ln p of the present sample by all of them.
    pub(super) fn set_log_density(&mut self, density: f64) {
        self.log_density = Some(density);
    }

    /// Enters a signal of the present sample.
    fn enter(&mut self, density: f64, found: &Innovation<f64, 1>) {
        self.log_density = Some(self.log_density.unwrap_or(0.0) + density);
        if found.taken {
            self.taken.push(*found);
        }
    }

    /// Comes to a sample.
    #[inline]
    pub(super) fn at(&mut self, time_s: f64) {
        self.now_s = time_s;
        self.rejected.clear();
        self.turned = None;
        self.log_density = None;
        self.taken.clear();
    }

    /// What was rejected of the present sample: the signal, innovation and standard deviation.
    pub(super) fn rejected(&self) -> &[(usize, f64, f64)] {
        &self.rejected
    }

    /// Whether a signal of it was.
    pub(super) fn rejects(&self, signal: usize) -> bool {
        self.rejected.iter().any(|(of, ..)| *of == signal)
    }

    /// Whether a gate turned at the present sample, and to which side.
    pub(super) fn turned(&self) -> Option<GateTurn> {
        self.turned.map(|opens| GateTurn { time_s: self.now_s, opens })
    }

    /// As numbers, for another run to go on from.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let of_gate = |gate: &SignalGate| {
            let (open, suspect) = (f64::from(u8::from(gate.is_open)), f64::from(gate.suspect));
            [gate.share, gate.median, open, suspect, f64::from(gate.settling), gate.samples, gate.beyond]
        };
        let of_events = self.events.last.iter().cycle().skip(self.events.next).take(EVENTS_BEFORE).copied();
        std::iter::once(self.from_s).chain(of_events).chain(self.gates.iter().flat_map(of_gate)).collect()
    }

    /// Goes on from such numbers.
    pub(super) fn resume(&mut self, numbers: &[f64]) {
        let Some((from_s, rest)) = numbers.split_first() else { return };
        let Some((events, gates)) = rest.split_first_chunk() else { return };
        self.from_s = *from_s;
        self.events = EventGate { last: *events, next: 0 };
        let of_gate = |numbers: &[f64]| match *numbers {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small counts
            [share, median, open, suspect, settling, samples, beyond] => Some(SignalGate {
                share,
                median,
                is_open: open != 0.0,
                suspect: suspect as u32,
                settling: settling as u32,
                samples,
                beyond,
            }),
            _ => None,
        };
        self.gates = gates.chunks(GATE_NUMBERS).filter_map(of_gate).collect();
    }

    /// Whether nothing has to be looked at.
    fn is_off(&self) -> bool {
        self.taking == GateMode { after_s: self.taking.after_s, ..GateMode::default() }
            && matches!(self.decided, RejectionSource::Itself)
    }

    /// Takes what an event says. Its size is known by those before it: a filter that is wrong, and to which events tell so, believes them.
    fn take_event(
        &mut self,
        (sensor, y, variance): (&dyn Sensor, f64, f64),
        mut update: impl FnMut(&dyn Sensor, f64, f64, f64) -> Result<Innovation<f64, 1>, FilterError>,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let largest = match self.taking.largest_nis {
            Some(largest) if self.now_s >= self.from_s => self.events.bound(largest),
            _ => f64::INFINITY,
        };
        let found = update(sensor, y, variance, largest)?;
        self.events.note(found.nis);
        Ok(found)
    }

    /// Takes a sample of a signal by a filter's own update, which is given a sensor, the sample, its variance and the largest
    /// normalised innovation squared that it may take.
    pub(super) fn take(
        &mut self,
        signal: usize,
        (sensor, y, variance): (&dyn Sensor, f64, f64),
        mut update: impl FnMut(&dyn Sensor, f64, f64, f64) -> Result<Innovation<f64, 1>, FilterError>,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        if self.is_off() {
            let found = update(sensor, y, variance, f64::INFINITY)?;
            if signal != EVENTS {
                self.enter(found.log_likelihood(), &found);
            }
            return Ok(found);
        }
        if signal == EVENTS {
            return self.take_event((sensor, y, variance), update);
        }
        while self.gates.len() <= signal {
            self.gates.push(SignalGate::NEW);
        }
        let gate = self.gates[signal];
        let has_settled = self.now_s >= self.from_s;
        let bound = self.taking.largest_nis.map_or(f64::INFINITY, |largest| gate.bound(largest));
        let rejects = |rejects: bool| if rejects { NEVER } else { f64::INFINITY };
        let believed = match has_settled && !gate.is_open {
            false => f64::INFINITY,
            true if gate.suspect > SUSPECTED && bound.is_finite() => NEVER,
            true => bound,
        };
        let largest = match &self.decided {
            RejectionSource::Before(decided) => rejects(
                decided
                    .binary_search_by(|(time_s, of)| time_s.total_cmp(&self.now_s).then(of.cmp(&signal)))
                    .is_ok(),
            ),
            RejectionSource::Beside(signals) => rejects(signals.contains(&signal)),
            RejectionSource::Itself => believed,
        };
        let law = self.taking.law;
        let mut found = update(sensor, y, variance, largest.min(law.bulk()))?;
        let (residual, total) = (found.residual[0], found.covariance.get(0, 0));
        let of_law = law.log_density((residual, total), variance);
        if !found.taken && law != UpdateLaw::Normal {
            let weighed = law.weigh((found.residual[0], found.covariance.get(0, 0)), variance);
            if weighed.deviance <= largest {
                found.taken = update(sensor, y, variance / weighed.weight, f64::INFINITY)?.taken;
            }
            found.nis = weighed.deviance;
            found.residual[0] =
                (weighed.deviance * found.covariance.get(0, 0)).sqrt().copysign(found.residual[0]);
        }
        let density = match self.taking.largest_nis {
            Some(_) => self.gates[signal].log_density(of_law, (residual * residual / total, total), bound),
            None => of_law,
        };
        self.enter(density, &found);
        let is_rejected = !found.taken && found.nis > largest;
        if is_rejected {
            let sd = found.covariance.standard_deviation(0);
            self.rejected.push((signal, found.residual[0], sd));
        }
        let gate = &mut self.gates[signal];
        let was_open = gate.is_open;
        gate.note(found.nis, (found.nis > bound, !is_rejected), has_settled, self.forgets);
        if has_settled && gate.is_open != was_open && self.taking.largest_nis.is_some() {
            self.turned = Some(gate.is_open);
        }
        Ok(found)
    }
}

/// A normalised innovation squared that no innovation is below.
pub const NEVER: f64 = -1.0;

/// How much of a sample is believed.
struct SampleWeight {
    /// The variance is divided by it.
    weight: f64,
    /// Twice the logarithm by which the density is below its largest: the square of the innovation that is as improbable of normal noise.
    deviance: f64,
}

/// Iterations of the weight of Student's t at most, and when it has settled.
const ITERATIONS: usize = 20;
const SETTLED: f64 = 1e-9;

impl UpdateLaw {
    /// The normalised innovation squared below which a sample is surely taken as one of normal noise.
    fn bulk(self) -> f64 {
        match self {
            Self::Normal => f64::INFINITY,
            Self::Huber(bound) => bound * bound,
            Self::StudentT(_) => NEVER,
        }
    }

    /// ln p of an innovation r of the variance S, of which R is that of the noise: of Huber's law e^(−d/2) with the deviance d of
    /// [`weigh`](Self::weigh), whose integral is √(2πS)·erf(k·√(S/2R)) + 2·√R/k·e^(−k²·S/2R); of Student's t with its scale √S.
    fn log_density(self, (residual, total): (f64, f64), noise: f64) -> f64 {
        let square = residual * residual / total;
        let normal = -0.5 * (square + Scalar::ln(TAU * total));
        match self {
            Self::Normal => normal,
            Self::Huber(bound) => {
                let edge = bound * bound * total / noise;
                let within = (TAU * total).sqrt() * erf((0.5 * edge).sqrt());
                let beyond = 2.0 * noise.sqrt() / bound * Scalar::exp(-0.5 * edge);
                -0.5 * self.weigh((residual, total), noise).deviance - Scalar::ln(within + beyond)
            }
            Self::StudentT(freedom) => {
                let half = 0.5 * (freedom + 1.0);
                ln_gamma(half)
                    - ln_gamma(0.5 * freedom)
                    - 0.5 * Scalar::ln(freedom * PI * total)
                    - half * Scalar::ln(1.0 + square / freedom)
            }
        }
    }

    /// The weight of a sample with this innovation r of the variance S, of which R is that of the noise.
    ///
    /// Huber: the most probable state given the prediction and the sample, whose residual e costs k·|e|/√R − k²/2 beyond k·√R, is that of an
    /// update with R′ = |r|·√R/k − (S − R), in closed form because the signal is one number; all it costs is k·(2·|r|/√R − k·S/R)/2.
    ///
    /// Student's t: noise of the variance R/λ with λ of a gamma distribution. The update and the mean of λ are found in turn (variational
    /// Bayes: Agamennoni, Nieto & Nebot, IEEE Trans. Signal Process. 60, 5024, 2012), λ = (ν + 1)/(ν + ⟨e²⟩/R), with ⟨e²⟩ = (r·R′/S′)² + (S − R)·R′/S′
    /// of the residual after the update, R′ = R/λ and S′ = S − R + R′.
    fn weigh(self, (residual, total): (f64, f64), noise: f64) -> SampleWeight {
        let spread = (total - noise).max(0.0);
        let square = residual * residual / total;
        match self {
            Self::Normal => SampleWeight { weight: 1.0, deviance: square },
            Self::Huber(bound) => {
                let left = residual.abs() * noise.sqrt() / bound - spread;
                if left <= noise {
                    return SampleWeight { weight: 1.0, deviance: square };
                }
                let deviance = bound * (2.0 * residual.abs() / noise.sqrt() - bound * total / noise);
                SampleWeight { weight: noise / left, deviance }
            }
            Self::StudentT(freedom) => {
                let mut weight = 1.0;
                for _ in 0..ITERATIONS {
                    let noise_then = noise / weight;
                    let kept = noise_then / (spread + noise_then);
                    let error = (residual * kept).powi(2) + spread * kept;
                    let next = (freedom + 1.0) / (freedom + error / noise);
                    let moved = (next - weight).abs();
                    weight = next;
                    if moved <= SETTLED * weight {
                        break;
                    }
                }
                SampleWeight { weight, deviance: normal_score(square, freedom) }
            }
        }
    }
}

/// The square of the normal number that is as probable as one of Student's distribution with this square (Wallace, Ann. Math. Statist. 30,
/// 1121, 1959): right to 0.02 up to the tails.
fn normal_score(square: f64, freedom: f64) -> f64 {
    ((8.0 * freedom + 1.0) / (8.0 * freedom + 3.0)).powi(2) * freedom * Scalar::ln(1.0 + square / freedom)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ e^f over ±span by Simpson's rule, and twice the tail c/(2z²) beyond where there is one.
    fn integral(mut f: impl FnMut(f64) -> f64, span: f64) -> f64 {
        const STEPS: u32 = 400_000;
        let h = 2.0 * span / f64::from(STEPS);
        let weight = |k: u32| {
            if k == 0 || k == STEPS {
                1.0
            } else if k % 2 == 1 {
                4.0
            } else {
                2.0
            }
        };
        (0..=STEPS).map(|k| weight(k) * f(f64::from(k).mul_add(h, -span)).exp()).sum::<f64>() * h / 3.0
    }

    /// A likelihood by which filters are chosen is a density of the sample: it integrates to 1, whatever the law.
    #[test]
    fn what_a_sample_is_taken_for_is_a_density() {
        for (total, noise) in [(1.0, 0.9), (4.0, 0.5)] {
            for law in [UpdateLaw::Normal, UpdateLaw::Huber(1.5), UpdateLaw::StudentT(4.0)] {
                let all = integral(|r| law.log_density((r, total), noise), 400.0);
                assert!((all - 1.0).abs() < 1e-5, "{law:?} {total}: {all}");
            }
            let gate = SignalGate { samples: 100.0, beyond: 3.0, ..SignalGate::NEW };
            let bound = 6.0;
            let of = |r: f64| {
                let nis = r * r / total;
                gate.log_density(UpdateLaw::Normal.log_density((r, total), noise), (nis, total), bound)
            };
            let span = 1000.0;
            // What is beyond the span: both tails of √L/(4z²) of the 6.5 disturbances in 101 samples.
            let tails = 6.5 / 101.0 * 0.5 * bound.sqrt() * total.sqrt() / span;
            let all = integral(of, span) + tails;
            assert!((all - 1.0).abs() < 2e-3, "{total}: {all}");
        }
    }
}
