//! Measurements that come late: gone back for, or looked back at.

use kalmems_core::update::{History, HistoryError, Replay};
use kalmems_core::{
    Covariance, Delayed, Ekf, Filter, FilterError, LinearMeasurement, LinearProcess, Mat, Measurement,
    NoiseDensity, Over, Process, ProcessNoise, Scalar, SigmaPoints, Ukf,
};
use nalgebra::SMatrix;
use proptest::prelude::*;

/// A rate that drives an angle, with the angle's sine seen at each sample and the rate now and then.
struct Turning {
    noise: ProcessNoise<f64, 2>,
}

impl Process<f64, 2> for Turning {
    type Input = f64;
    fn step<S: Over<f64>>(&self, x: &[S; 2], torque: &f64) -> [S; 2] {
        [x[0] + x[1] * 0.1, x[1] + x[0].sin() * -0.3 + *torque]
    }
    fn noise(&self) -> &ProcessNoise<f64, 2> {
        &self.noise
    }
}

struct Sine;
impl<T: Scalar> Measurement<T, 2, 1> for Sine {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].sin()]
    }
}

/// One sample: what drove the step to it, and what was seen then.
#[derive(Clone, Copy, Debug)]
struct Sample {
    torque: f64,
    sine: Option<f64>,
    rate: Option<f64>,
}

impl<F: Filter<f64, 2>> Replay<F> for Turning {
    type Record = Sample;
    type Error = FilterError;
    fn replay(&self, filter: &mut F, sample: &Sample) -> Result<(), FilterError> {
        filter.predict(self, &sample.torque)?;
        if let Some(y) = sample.sine {
            filter.update(&Sine, &[y], &Covariance::from_variances([0.04]))?;
        }
        if let Some(y) = sample.rate {
            let rate = LinearMeasurement { matrix: Mat([[0.0, 1.0]]) };
            filter.update(&rate, &[y], &Covariance::from_variances([0.01]))?;
        }
        Ok(())
    }
}

fn turning() -> Turning {
    Turning { noise: Covariance::from_variances([1e-4, 1e-2]).into() }
}

fn bits<F: Filter<f64, 2>>(filter: &F) -> [u64; 5] {
    let p = filter.covariance();
    [filter.mean()[0], filter.mean()[1], p.get(0, 0), p.get(1, 0), p.get(1, 1)].map(f64::to_bits)
}

/// All samples as they would have been in time.
fn in_time<F: Filter<f64, 2> + Copy>(start: F, samples: &[Sample]) -> F {
    let mut filter = start;
    for sample in samples {
        turning().replay(&mut filter, sample).unwrap();
    }
    filter
}

/// The same with every rate late by its own number of samples; a rate that is too late is left out of both.
fn late<F: Filter<f64, 2> + Copy>(start: F, samples: &[Sample], delays: &[usize]) {
    let mut history = History::<F, _, 6>::new(start, turning());
    let mut known: Vec<Sample> = Vec::new();
    for (k, sample) in samples.iter().enumerate() {
        let at_once = delays[k] == 0;
        let first = Sample { rate: sample.rate.filter(|_| at_once), ..*sample };
        history.push(first).unwrap();
        known.push(first);
        for (then, delay) in delays.iter().enumerate().take(k + 1) {
            if *delay == 0 || then + delay != k {
                continue;
            }
            let amended = history.amend(*delay, |record| record.rate = samples[then].rate);
            if *delay < 6 {
                amended.unwrap();
                known[then].rate = samples[then].rate;
            } else {
                let kept = 6.min(k + 1);
                assert_eq!(amended, Err(HistoryError::TooOld { age: *delay, kept }));
            }
        }
        assert_eq!(bits(history.filter()), bits(&in_time(start, &known)), "{k}");
    }
}

/// A transition with singular values between 0.5 and 1.2, and its inverse.
fn transition() -> impl Strategy<Value = (Mat<f64, 3, 3>, SMatrix<f64, 3, 3>)> {
    let rotation = |a: [f64; 3]| *nalgebra::Rotation3::from_euler_angles(a[0], a[1], a[2]).matrix();
    (
        prop::array::uniform3(-3.0..3.0_f64),
        prop::array::uniform3(0.5..1.2_f64),
        prop::array::uniform3(-3.0..3.0_f64),
    )
        .prop_map(move |(a, s, b)| {
            let f = rotation(a) * SMatrix::from_diagonal(&s.into()) * rotation(b);
            (Mat::from_fn(|i, j| f[(i, j)]), f.try_inverse().unwrap())
        })
}

/// A linear system without process noise, seen at each sample, and by a second sensor now and then.
struct Noiseless {
    step: LinearProcess<f64, 3, 0>,
    always: LinearMeasurement<f64, 3, 1>,
    event: LinearMeasurement<f64, 3, 2>,
}

impl Replay<Ekf<f64, 3>> for Noiseless {
    type Record = (f64, Option<[f64; 2]>);
    type Error = FilterError;
    fn replay(&self, filter: &mut Ekf<f64, 3>, (y, event): &Self::Record) -> Result<(), FilterError> {
        filter.predict(&self.step, &[])?;
        filter.update(&self.always, &[*y], &Covariance::from_variances([0.5]))?;
        if let Some(event) = event {
            filter.update(&self.event, event, &Covariance::from_variances([0.1, 0.2]))?;
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn what_comes_late_is_as_if_it_had_come_in_time_to_the_bit(
        samples in prop::collection::vec(
            (-0.2..0.2_f64, prop::option::of(-1.0..1.0_f64), prop::option::of(-2.0..2.0_f64)), 1..20,
        ),
        delays in prop::collection::vec(0..8_usize, 20),
    ) {
        let samples: Vec<Sample> =
            samples.into_iter().map(|(torque, sine, rate)| Sample { torque, sine, rate }).collect();
        let start = Covariance::from_variances([0.3, 0.5]);
        late(Ekf::new([0.2, 0.0], start), &samples, &delays);
        late(Ukf::new([0.2, 0.0], start, SigmaPoints::standard()), &samples, &delays);
    }

    #[test]
    fn without_process_noise_looking_back_is_going_back(
        (f, inverse) in transition(),
        h in prop::array::uniform3(-1.0..1.0_f64),
        events in prop::array::uniform6(-1.0..1.0_f64),
        ys in prop::collection::vec(-3.0..3.0_f64, 10),
        event in prop::array::uniform2(-3.0..3.0_f64),
        delay in 0..8_usize,
    ) {
        let step = LinearProcess { transition: f, input: Mat::zero(), noise: ProcessNoise::none() };
        let always = LinearMeasurement { matrix: Mat([h]) };
        let sensor = LinearMeasurement { matrix: Mat::from_fn(|i, j| events[3 * i + j]) };
        let start = Ekf::new([1.0, -2.0, 0.5], Covariance::from_standard_deviations([1.0, 0.3, 2.0]));
        let mut history = History::<_, _, 10>::new(start, Noiseless { step, always, event: sensor });
        for y in ys {
            history.push((y, None)).unwrap();
        }
        let mut looking_back = *history.filter();
        let back = inverse.pow(u32::try_from(delay).unwrap());
        let delayed = Delayed { measurement: sensor, back: Mat::from_fn(|i, j| back[(i, j)]) };
        looking_back.update(&delayed, &event, &Covariance::from_variances([0.1, 0.2])).unwrap();
        history.amend(delay, |record| record.1 = Some(event)).unwrap();
        let going_back = history.filter();
        for i in 0..3 {
            let (a, b) = (looking_back.mean()[i], going_back.mean()[i]);
            prop_assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{a} {b}");
            for j in 0..=i {
                let (a, b) = (looking_back.covariance().get(i, j), going_back.covariance().get(i, j));
                prop_assert!((a - b).abs() <= 1e-9, "{a} {b}");
            }
        }
    }
}

#[test]
fn what_cannot_be_amended_changes_nothing() {
    let start = Ekf::new([0.2, 0.0], Covariance::from_variances([0.3, 0.5]));
    let mut history = History::<_, _, 4>::new(start, turning());
    assert_eq!(history.amend(0, |_| ()), Err(HistoryError::TooOld { age: 0, kept: 0 }));
    let sample = |k: u32| Sample { torque: 0.01, sine: Some(f64::from(k).sin() * 0.3), rate: None };
    for k in 0..6 {
        history.push(sample(k)).unwrap();
    }
    let before = bits(history.filter());
    let cause = FilterError::NonFiniteMeasurement;
    let push = history.push(Sample { sine: Some(f64::NAN), ..sample(6) });
    assert_eq!(push, Err(HistoryError::Replay { age: 0, cause }));
    let amend = history.amend(2, |record| record.rate = Some(f64::INFINITY));
    assert_eq!(amend, Err(HistoryError::Replay { age: 2, cause }));
    assert_eq!(history.amend(4, |_| ()), Err(HistoryError::TooOld { age: 4, kept: 4 }));
    assert_eq!(bits(history.filter()), before);
    // The records are as they were, too: all else goes on as if nothing had been tried.
    history.amend(3, |record| record.rate = Some(0.1)).unwrap();
    history.push(sample(6)).unwrap();
    let mut samples: Vec<Sample> = (0..7).map(sample).collect();
    samples[2].rate = Some(0.1);
    assert_eq!(bits(history.filter()), bits(&in_time(start, &samples)));
}

/// A mass that is pushed at random, its position seen roughly at each sample and exactly in every tenth.
struct Pushed {
    step: LinearProcess<f64, 2, 0>,
}

const POSITION: LinearMeasurement<f64, 2, 1> = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
const INTERVAL: f64 = 0.1;
const ROUGH: f64 = 0.2;
const EXACT: f64 = 0.02;

fn variance(deviation: f64) -> Covariance<f64, 1> {
    Covariance::from_standard_deviations([deviation])
}

impl Replay<Ekf<f64, 2>> for Pushed {
    type Record = (f64, Option<f64>);
    type Error = FilterError;
    fn replay(&self, filter: &mut Ekf<f64, 2>, (rough, exact): &Self::Record) -> Result<(), FilterError> {
        filter.predict(&self.step, &[])?;
        filter.update(&POSITION, &[*rough], &variance(ROUGH))?;
        if let Some(exact) = exact {
            filter.update(&POSITION, &[*exact], &variance(EXACT))?;
        }
        Ok(())
    }
}

/// Errors of the position, as roots of their mean squares.
#[derive(Debug)]
struct Errors {
    /// The late measurements are left out.
    without: f64,
    /// It is gone back for them.
    going: f64,
    /// They are looked back at.
    looking: f64,
    /// What the filter that looks back says its error is.
    claimed: f64,
}

/// The errors where the exact measurements come `delay` samples late.
fn errors(delay: usize) -> Errors {
    const SAMPLES: usize = 100_000;
    let a = Mat([[0.0, 1.0], [0.0, 0.0]]);
    let density = NoiseDensity::none().on::<1>(1.0);
    let pushed = || Pushed { step: LinearProcess::exact(&a, &Mat::zero(), &density, INTERVAL) };
    let root = *pushed().step.noise.root();
    let back = Mat([[1.0, -INTERVAL * delay as f64], [0.0, 1.0]]);
    let mut normal = Normal(11);
    let start = Ekf::new([0.0, 0.0], Covariance::from_variances([1.0, 1.0]));
    let mut truth = [normal.next(), normal.next()];
    let mut exact = Vec::new();
    let mut going = History::<_, _, 16>::new(start, pushed());
    let (mut without, mut looking) = (start, start);
    let mut sums = [0.0; 4];
    for k in 0..SAMPLES {
        let w = [normal.next(), normal.next()];
        truth = [
            truth[0] + INTERVAL * truth[1] + root[(0, 0)] * w[0],
            truth[1] + root[(1, 0)] * w[0] + root[(1, 1)] * w[1],
        ];
        exact.push(truth[0] + EXACT * normal.next());
        let rough = (truth[0] + ROUGH * normal.next(), None);
        going.push(rough).unwrap();
        pushed().replay(&mut without, &rough).unwrap();
        pushed().replay(&mut looking, &rough).unwrap();
        if let Some(then) = k.checked_sub(delay).filter(|then| then % 10 == 0) {
            going.amend(delay, |record| record.1 = Some(exact[then])).unwrap();
            let delayed = Delayed { measurement: POSITION, back };
            looking.update(&delayed, &[exact[then]], &variance(EXACT)).unwrap();
        }
        sums[0] += (without.mean()[0] - truth[0]).powi(2);
        sums[1] += (going.filter().mean()[0] - truth[0]).powi(2);
        sums[2] += (looking.mean()[0] - truth[0]).powi(2);
        sums[3] += looking.covariance().get(0, 0);
    }
    let [without, going, looking, claimed] = sums.map(|sum| (sum / SAMPLES as f64).sqrt());
    Errors { without, going, looking, claimed }
}

/// Normal numbers: a counter through the finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), and
/// Box–Muller.
struct Normal(u64);
impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// What looking back costs where there is process noise. Printed by `cargo test --workspace --test numerics late::
/// process_noise -- --nocapture`.
#[test]
fn process_noise_makes_looking_back_worse_with_the_delay() {
    println!("samples late   left out  going back  looking back  as it claims");
    let mut penalty = 0.99;
    for delay in [0, 1, 2, 5, 10, 15] {
        let e = errors(delay);
        println!("{delay:12}  {:9.4}  {:10.4}  {:12.4}  {:12.4}", e.without, e.going, e.looking, e.claimed);
        // Going back is never worse than leaving them out; looking back loses more with every sample.
        assert!(e.going < 1.001 * e.without, "{e:?}");
        assert!(e.looking / e.going > penalty, "{e:?}");
        penalty = e.looking / e.going;
        match delay {
            0 => assert!((penalty - 1.0).abs() < 1e-12, "{e:?}"),
            // A small delay costs almost nothing.
            1 | 2 => assert!(penalty < 1.02 && e.looking < e.without, "{e:?}"),
            // From a second on it is worse than no late measurement at all, and does not know.
            10.. => assert!(e.looking > 1.05 * e.without && e.looking > 1.15 * e.claimed, "{e:?}"),
            _ => (),
        }
    }
}
