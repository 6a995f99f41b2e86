//! The same filter by the interpreter and the library's extended Kalman filter, in numbers of 64 bits.

use kalmems_core::{Covariance, Ekf, Filter, Mat, Nodes, NumericMeasurement, NumericProcess, ProcessNoise};
use kalmems_equations::{
    Device, EmitRequest, Motion, ProgramNumbers, ReadoutProgram, StepMethod, TestSample,
};
use std::cell::RefCell;

/// Every how many samples the events of a request are said to happen.
pub const EVENT_EVERY: usize = 400;
/// How long before a sample they were, in intervals.
pub const EVENT_AGO: f64 = 0.75;

/// The states behind each sample, of which the inputs and measurements are given, and their standard deviations.
pub fn states(device: &Device, request: &EmitRequest, samples: &[TestSample]) -> Vec<[Vec<f64>; 2]> {
    match request.states.len() + request.free.len() {
        2 => run::<2>(device, request, samples),
        3 => run::<3>(device, request, samples),
        4 => run::<4>(device, request, samples),
        5 => run::<5>(device, request, samples),
        6 => run::<6>(device, request, samples),
        7 => run::<7>(device, request, samples),
        size => panic!("no host filter of {size} states"),
    }
}

/// One step of the device's states and of the parameters behind them, without noise.
pub fn moved(
    motion: &Motion,
    work: &mut ProgramNumbers,
    (x, inputs): (&[f64], &[Vec<f64>; 3]),
    (method, interval): (StepMethod, f64),
) -> (Vec<f64>, Vec<f64>) {
    let n = x.len();
    let (mut next, mut jacobian) = (vec![0.0; n], vec![0.0; n * n]);
    match method {
        StepMethod::Euler => {
            let mut rates = vec![0.0; n];
            assert!(motion.linearize(work, x, &inputs[0], &mut rates, &mut jacobian), "{x:?}");
            for i in 0..n {
                next[i] = x[i] + interval * rates[i];
                for j in 0..n {
                    jacobian[i * n + j] = interval * jacobian[i * n + j] + f64::from(u8::from(i == j));
                }
            }
        }
        StepMethod::RungeKutta => {
            let nodes = Nodes { start: &inputs[0][..], middle: &inputs[1][..], end: &inputs[2][..] };
            let tables = motion.runge_kutta(interval);
            assert!(motion.linearized_step(work, x, &nodes, &tables, &mut next, &mut jacobian));
        }
    }
    (next, jacobian)
}

/// Whole periods taken off: within half of one of 0.
pub fn wrapped(x: f64, period: f64) -> f64 {
    if x > 0.5 * period {
        x - period
    } else if x < -0.5 * period {
        x + period
    } else {
        x
    }
}

struct Process<'a, const N: usize> {
    motion: Motion,
    work: RefCell<ProgramNumbers>,
    method: StepMethod,
    interval: f64,
    noise: ProcessNoise<f64, N>,
    periods: Vec<(usize, f64)>,
    samples: &'a [TestSample],
}

impl<const N: usize> NumericProcess<f64, N> for Process<'_, N> {
    type Input = usize;

    fn moved(&self, x: &[f64; N], sample: &usize) -> [f64; N] {
        self.linearized(x, sample).0
    }

    fn linearized(&self, x: &[f64; N], sample: &usize) -> ([f64; N], Mat<f64, N, N>) {
        let over = (&x[..], &self.samples[*sample].inputs);
        let (mut next, jacobian) =
            moved(&self.motion, &mut self.work.borrow_mut(), over, (self.method, self.interval));
        for (state, period) in &self.periods {
            next[*state] = wrapped(next[*state], *period);
        }
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| jacobian[i * N + j]));
        (next.try_into().unwrap(), Mat(rows))
    }

    fn noise_added(&self) -> &ProcessNoise<f64, N> {
        &self.noise
    }
}

/// In standard deviations of its noise, since the library's filter refuses variances such as 1e-34 F².
struct Sensor<'a> {
    readout: ReadoutProgram,
    sd: f64,
    work: RefCell<ProgramNumbers>,
    inputs: &'a [f64],
}

impl<const N: usize> NumericMeasurement<f64, N, 1> for Sensor<'_> {
    fn expected(&self, x: &[f64; N]) -> [f64; 1] {
        self.linearized(x).0
    }

    fn linearized(&self, x: &[f64; N]) -> ([f64; 1], Mat<f64, 1, N>) {
        let mut slopes = [0.0; N];
        let value = self.readout.linearize(&mut self.work.borrow_mut(), x, self.inputs, &mut slopes);
        ([value / self.sd], Mat([slopes.map(|slope| slope / self.sd)]))
    }
}

/// The expression of an event some time before, as the state now says it by a step back.
struct Then<'a> {
    of: Sensor<'a>,
    motion: Motion,
    work: RefCell<ProgramNumbers>,
    ago_s: f64,
}

impl<const N: usize> NumericMeasurement<f64, N, 1> for Then<'_> {
    fn expected(&self, x: &[f64; N]) -> [f64; 1] {
        self.linearized(x).0
    }

    fn linearized(&self, x: &[f64; N]) -> ([f64; 1], Mat<f64, 1, N>) {
        let inputs = self.of.inputs.to_vec();
        let inputs = [inputs.clone(), inputs.clone(), inputs];
        let mut work = self.work.borrow_mut();
        let (then, back) =
            moved(&self.motion, &mut work, (x, &inputs), (StepMethod::RungeKutta, -self.ago_s));
        let (value, slopes): ([f64; 1], Mat<f64, 1, N>) = self.of.linearized(&then.try_into().unwrap());
        let slope = |j: usize| (0..N).map(|i| slopes.0[0][i] * back[i * N + j]).sum();
        (value, Mat([std::array::from_fn(slope)]))
    }
}

/// A covariance of the device's states with variances of the parameters behind.
fn covariance<const N: usize>(states: &[f64], count: usize, behind: &[f64]) -> Covariance<f64, N> {
    let entry = |i: usize, j: usize| {
        if i < count && j < count {
            states[i * count + j]
        } else if i == j {
            behind[i - count]
        } else {
            0.0
        }
    };
    Covariance::from_lower(Mat(std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))))
}

fn run<const N: usize>(device: &Device, request: &EmitRequest, samples: &[TestSample]) -> Vec<[Vec<f64>; 2]> {
    let free: Vec<usize> = request.free.iter().map(|free| free.parameter).collect();
    let count = request.states.len();
    let motion = device.motion(&free).unwrap();
    let work = RefCell::new(motion.work(&request.parameters));
    let walk: Vec<f64> = request.free.iter().map(|free| free.walk).collect();
    let noise: Covariance<f64, N> = covariance(&request.process_noise, count, &walk);
    let process = Process::<N> {
        motion,
        work,
        method: request.method,
        interval: request.interval_s,
        noise: noise.into(),
        periods: device.periods(&request.parameters).unwrap(),
        samples,
    };
    let mut mean: Vec<f64> = request.states.iter().map(|state| state.mean).collect();
    mean.extend(request.free.iter().map(|free| free.start));
    let start = covariance(&request.start_covariance, N, &[]);
    let mut filter = Ekf::<f64, N>::new(mean.try_into().unwrap(), start);
    let sensor = |readout: ReadoutProgram, variance: f64| {
        let work = RefCell::new(readout.work(&request.parameters));
        Sensor { readout, work, inputs: &[], sd: variance.sqrt() }
    };
    let measures = request.measures.iter();
    let mut sensors: Vec<Sensor<'_>> =
        measures.map(|m| sensor(device.readout(m.measure, &free).unwrap(), m.variance)).collect();
    let then = |of: Sensor<'static>| {
        let motion = device.motion(&free).unwrap();
        let work = RefCell::new(motion.work(&request.parameters));
        Then { of, motion, work, ago_s: EVENT_AGO * request.interval_s }
    };
    let events = request.events.iter().map(|e| (device.event(e.event, &free).unwrap(), e.variance));
    let mut events: Vec<Then<'_>> =
        events.map(|(readout, variance)| then(sensor(readout, variance))).collect();
    let mut states = Vec::with_capacity(samples.len());
    for (k, sample) in samples.iter().enumerate() {
        filter.predict(&process, &k).unwrap();
        for (sensor, seen) in sensors.iter_mut().zip(&sample.measured) {
            sensor.inputs = &sample.inputs[2];
            // A sample that is not a number is a gap.
            if seen.is_finite() {
                let seen = [seen / sensor.sd];
                let updated = filter.update(sensor, &seen, &Covariance::from_variances([1.0]));
                updated.unwrap_or_else(|error| panic!("{}, sample {k}: {error}", request.name));
            }
        }
        if (k + 1) % EVENT_EVERY == 0 {
            for event in &mut events {
                event.of.inputs = &sample.inputs[2];
                filter.update(event, &[0.0], &Covariance::from_variances([1.0])).unwrap();
            }
        }
        let p = filter.covariance();
        let sd = (0..N).map(|i| p.get(i, i).sqrt()).collect();
        states.push([filter.mean().to_vec(), sd]);
    }
    states
}
