//! A device's equations as filters run them: the step over an interval, and what is read.

use crate::estimate::driven::{ParameterStep, SegmentDrive};
use crate::estimate::{
    ContinuousMotion, DerivedQuantities, Sensor, StateName, Tracked, Transition, deviation,
};
use kalmems_core::augmentation::AddedState;
use kalmems_core::discretize::discretize;
use kalmems_core::filter::Pole;
use kalmems_core::{Covariance, Mat, Nodes, NoiseDensity, ProcessNoise};
use kalmems_equations::{
    Device, EquationError, MOST_STATES, Mode, Motion, NoiseKind, ProgramNumbers, Reading, ReadoutProgram,
    ResetPath, ResetStep, Resets, StepTables, modes,
};
use std::cell::{OnceCell, RefCell};
use std::rc::Rc;

/// How a step follows the equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepRule {
    /// By exponential time differencing of fourth order: exactly where the motion is linear.
    Exponential,
    /// By Euler's method.
    Euler,
}

/// A device with the values of its parameters, some of which may be states behind its own.
///
/// x = [states of the device, deviations of those parameters]: a parameter is its value there plus its scale times its
/// deviation.
pub struct EquationModel {
    motion: Motion,
    readouts: Vec<ReadoutProgram>,
    /// The expressions of all events.
    events: Vec<ReadoutProgram>,
    /// Those of what follows from the states.
    quantities: Vec<Reading>,
    /// Of each event, the states that it does not depend on, now or by its rates.
    apart: Vec<Vec<bool>>,
    work: RefCell<Vec<ProgramNumbers>>,
    /// What happens to the states at once, or the kinks of their rates.
    resets: Option<RefCell<Resets>>,
    /// Value and scale of each parameter that is a state, and how it drifts.
    free: Vec<(f64, AddedState<f64>)>,
    /// The power density of the noise of each state's rate; 0 of one that varies.
    density: Vec<f64>,
    /// The noises whose sizes depend on states or inputs.
    varying: VaryingNoises,
    /// The states that come round, and the period of each.
    periods: Vec<(usize, f64)>,
    /// Where the noise is linearised.
    rest: Vec<f64>,
    /// The states that no equation moves and on which the linear part of a step depends, each with what it is rounded to at least.
    held: Vec<(usize, f64)>,
    inputs: usize,
    rule: StepRule,
    /// Steps per second that follow its motion.
    pace: f64,
}

/// The states that an event does not depend on: neither by its expression nor by the rates of those that it depends on.
fn apart(motion: &Motion, event: &ReadoutProgram) -> Vec<bool> {
    let mut apart = vec![true; motion.moving()];
    let mut found: Vec<usize> = event.sparsity().collect();
    while let Some(state) = found.pop() {
        if let Some(is_apart) = apart.get_mut(state).filter(|is_apart| **is_apart) {
            *is_apart = false;
            found.extend(motion.sparsity().filter(|(row, _)| *row == state).map(|(_, column)| column));
        }
    }
    apart
}

/// The power density of the noise of a state's rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RateDensity {
    /// This one, in the state's unit² per s.
    Held(f64),
    /// The device's, which depends on states or inputs.
    Varying,
}

/// The noises of a device whose sizes depend on states or inputs: taken as they are where a step begins, and at the mean that a sample is
/// predicted from.
#[derive(Default)]
struct VaryingNoises {
    /// The states whose rates have such a noise, and its density.
    rates: Vec<(usize, RefCell<Reading>)>,
    /// The measurements that have such a noise, with its size at rest.
    measures: Vec<(usize, RefCell<Reading>, f64)>,
}

impl VaryingNoises {
    fn of(
        device: &Device,
        (values, places): (&[f64], &[usize]),
        (density, rest): (&[RateDensity], &[f64]),
    ) -> Result<Self, EquationError> {
        let mut all = Self::default();
        let inputs = vec![0.0; device.inputs().len()];
        for (kind, readout) in device.varying_noise(places)? {
            let mut reading = Reading::new(readout, values);
            match kind {
                NoiseKind::Rate { state } if density.get(state) == Some(&RateDensity::Varying) => {
                    all.rates.push((state, reading.into()));
                }
                NoiseKind::Variance { measure } | NoiseKind::Density { measure } => {
                    let at_rest = reading.read(rest, &inputs);
                    all.measures.push((measure, reading.into(), at_rest));
                }
                _ => {}
            }
        }
        Ok(all)
    }
}

/// One number for each state, with those that are parameters.
pub type StateNumbers = [f64; MOST_STATES];

impl EquationModel {
    /// With these values of all parameters; noise is discretised for the motion at `rest` under no input, and `about` is that place with a
    /// resonance that is a state where a filter of it begins.
    pub fn new(
        device: &Device,
        values: &[f64],
        tracked: &[Tracked],
        (density, rule): (&[RateDensity], StepRule),
        (rest, about, pace): (&[f64], &[f64], f64),
    ) -> Result<Self, EquationError> {
        let places: Vec<usize> =
            tracked.iter().filter_map(|tracked| device.parameter(tracked.parameter.name)).collect();
        let free = places
            .iter()
            .zip(tracked)
            .map(|(place, tracked)| (values.get(*place).copied().unwrap_or(f64::NAN), tracked.added));
        let free: Vec<_> = free.collect();
        let motion = device.motion(&places)?;
        let readouts: Vec<ReadoutProgram> =
            (0..device.measures().len()).map(|k| device.readout(k, &places)).collect::<Result<_, _>>()?;
        let events: Vec<ReadoutProgram> =
            (0..device.events().len()).map(|k| device.event(k, &places)).collect::<Result<_, _>>()?;
        let quantities = 0..device.quantities().len();
        let quantities = quantities.map(|k| Ok(Reading::new(device.quantity(k, &places)?, values)));
        let quantities = quantities.collect::<Result<_, EquationError>>()?;
        let resets = match device.resets(values, (&motion, &places))? {
            None if motion.has_kinks() && rule == StepRule::Exponential => device.sides(values, &places)?,
            resets => resets,
        };
        let resets = resets.map(RefCell::new);
        let apart = events.iter().map(|event| apart(&motion, event)).collect();
        let mut work = vec![motion.work(values)];
        work.extend(readouts.iter().chain(&events).map(|readout| readout.work(values)));
        let rest: Vec<f64> = rest.iter().copied().chain(free.iter().map(|(value, _)| *value)).collect();
        let (periods, inputs) = (device.periods(values)?, device.inputs().len());
        let at: Vec<f64> = about.iter().chain(rest.iter().skip(about.len())).copied().collect();
        let held = motion.held(&mut work[0], &at, &vec![0.0; inputs]);
        let varying = VaryingNoises::of(device, (values, &places), (density, &rest))?;
        let of_held = |density: &RateDensity| match density {
            RateDensity::Held(size) => *size,
            RateDensity::Varying => 0.0,
        };
        let density = density.iter().map(of_held).collect();
        Ok(Self {
            motion,
            readouts,
            events,
            quantities,
            apart,
            work: work.into(),
            resets,
            free,
            density,
            varying,
            periods,
            rest,
            held,
            inputs,
            rule,
            pace,
        })
    }

    /// The states that move by equations of their own.
    pub fn moving(&self) -> usize {
        self.motion.moving()
    }

    /// Whether the motion has kinks, such as that of a contact: how many steps follow it depends on where it is.
    pub fn has_kinks(&self) -> bool {
        self.rule == StepRule::Exponential && (self.motion.has_kinks() || self.resets.is_some())
    }

    /// How many resets happen to its states, of which paths keep the sides.
    pub fn resets(&self) -> usize {
        self.resets.as_ref().map_or(0, |resets| resets.borrow().kept())
    }

    /// Goes on along a path through resets, or by the signs of their expressions.
    pub fn set_path(&self, path: Option<ResetPath>) {
        if let Some(resets) = &self.resets {
            resets.borrow_mut().set_path(path);
        }
    }

    /// The path that was set, led on by the steps since then.
    pub fn path(&self) -> Option<ResetPath> {
        self.resets.as_ref().and_then(|resets| resets.borrow().path())
    }

    /// A path that begins at a state.
    pub fn path_from(&self, mean: &[f64], inputs: &[f64]) -> ResetPath {
        let of = |x: &[f64]| self.resets.as_ref().map(|resets| resets.borrow_mut().sides_at(x, inputs));
        self.with_values(mean, of).unwrap_or_default()
    }

    /// How far a mean is from a reset that can still happen on a path, with the derivatives by all states: see [`Resets::margin`].
    pub fn reset_margin(
        &self,
        of: (usize, &ResetPath),
        (mean, inputs): (&[f64], &[f64]),
        slopes: &mut [f64],
    ) -> Option<f64> {
        let resets = self.resets.as_ref()?;
        let margin = self.with_values(mean, |x| resets.borrow_mut().margin(of, (x, inputs), slopes))?;
        self.scale_parameters(slopes);
        Some(margin)
    }

    /// What passes zero where a reset happens, at a mean, with its derivatives by all states.
    pub fn reset_crossing(&self, reset: usize, (mean, inputs): (&[f64], &[f64]), slopes: &mut [f64]) -> f64 {
        let Some(resets) = &self.resets else { return f64::NAN };
        let value = self.with_values(mean, |x| resets.borrow_mut().crossing(reset, (x, inputs), slopes));
        self.scale_parameters(slopes);
        value
    }

    /// A root W of a covariance W·Wᵀ that is given by its lower triangle, and that covariance without what rounding has made negative.
    pub fn put_root(covariance: &mut [f64], root: &mut [f64], n: usize) {
        match n {
            0..=2 => rooted::<2>(covariance, root, n),
            3..=4 => rooted::<4>(covariance, root, n),
            5..=8 => rooted::<8>(covariance, root, n),
            9..=16 => rooted::<16>(covariance, root, n),
            _ => rooted::<MOST_STATES>(covariance, root, n),
        }
    }

    /// Whether a step is the same from everywhere, but for its inputs.
    fn is_the_same_everywhere(&self) -> bool {
        self.rule == StepRule::Exponential && self.motion.is_linear() && self.resets.is_none()
    }

    /// Whether shorter steps are closer to the motion: not where they are exact, or those of a published method.
    pub fn divides(&self) -> bool {
        let are_kinks = |resets: &RefCell<Resets>| resets.borrow().are_kinks();
        self.rule == StepRule::Exponential
            && !self.motion.is_linear()
            && self.resets.as_ref().is_none_or(are_kinks)
    }

    /// Where the motion is linearised for a state: at rest, with the states that no equation moves, such as a resonance, at their means, which
    /// are rounded, so that it is the same for many samples; parameters that are states are as stated. A function of the state alone.
    fn point(&self, mean: &[f64]) -> StateNumbers {
        let mut point = [0.0; MOST_STATES];
        let states = self.rest.len().min(MOST_STATES);
        point[..states].copy_from_slice(&self.rest[..states]);
        for (place, step) in &self.held {
            if let Some((to, mean)) = point.get_mut(*place).zip(mean.get(*place)) {
                *to = rounded(*mean, *step);
            }
        }
        point
    }

    /// What an interval is linearised to for a state with this mean.
    fn linearised(&self, interval: &Interval, mean: &[f64]) -> Rc<Linearised> {
        let mut kept = interval.linearised.borrow_mut();
        if self.held.is_empty() {
            if kept.is_empty() {
                kept.push(Rc::new(self.linearise(self.point(mean), interval.length_s)));
            }
            return kept[0].clone();
        }
        let point = self.point(mean);
        let is_here =
            |one: &Rc<Linearised>| self.held.iter().all(|(place, _)| one.point[*place] == point[*place]);
        if let Some(known) = kept.iter().find(|one| is_here(one)) {
            return known.clone();
        }
        let made = Rc::new(self.linearise(point, interval.length_s));
        if kept.len() == MOST_LINEARISED {
            kept.remove(0);
        }
        kept.push(made.clone());
        made
    }

    fn linearise(&self, point: StateNumbers, interval_s: f64) -> Linearised {
        let moving = self.moving();
        let states = moving + self.free.len();
        let held = ParameterStep::of(self.free.iter().map(|(_, added)| *added), interval_s);
        let (mut covariance, mut root) = (vec![0.0; states * states], vec![0.0; states * states]);
        let mut noise = |jacobian: &[f64]| match moving {
            0..=2 => self.write_noise::<2>(jacobian, interval_s, &held, (&mut covariance, &mut root)),
            3..=4 => self.write_noise::<4>(jacobian, interval_s, &held, (&mut covariance, &mut root)),
            5..=8 => self.write_noise::<8>(jacobian, interval_s, &held, (&mut covariance, &mut root)),
            9..=16 => self.write_noise::<16>(jacobian, interval_s, &held, (&mut covariance, &mut root)),
            _ => self.write_noise::<MOST_STATES>(jacobian, interval_s, &held, (&mut covariance, &mut root)),
        };
        let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
        self.with_work(0, |work| {
            let inputs = [0.0; MOST_STATES];
            let inputs = inputs.get(..self.inputs).unwrap_or_default();
            let at = point.get(..states).unwrap_or_default();
            self.motion.linearize(work, at, inputs, &mut rates, &mut jacobian);
        });
        noise(&jacobian);
        let of_rates = self.varying.rates.iter().map(|(state, _)| match moving {
            0..=2 => self.noise_of_rate::<2>(&jacobian, interval_s, *state),
            3..=4 => self.noise_of_rate::<4>(&jacobian, interval_s, *state),
            5..=8 => self.noise_of_rate::<8>(&jacobian, interval_s, *state),
            9..=16 => self.noise_of_rate::<16>(&jacobian, interval_s, *state),
            _ => self.noise_of_rate::<MOST_STATES>(&jacobian, interval_s, *state),
        });
        let of_rates = of_rates.collect();
        let mut tables = self.motion.tables();
        self.motion.set_tables(&mut tables, &jacobian, interval_s);
        let (of_half, interval_s) = (OnceCell::new(), 0.5 * interval_s);
        let whole = OnceCell::new();
        Linearised {
            point,
            tables,
            half: (of_half, interval_s),
            whole,
            jacobian,
            held,
            covariance,
            root,
            of_rates,
        }
    }

    /// ∂f/∂x of the moving states at rest, row by row: the linear part of a step there.
    pub fn linear_at_rest(&self) -> Vec<f64> {
        let (moving, states) = (self.moving(), self.rest.len());
        let at_rest = self.linearised(&Interval::of(1.0), self.rest.get(..moving).unwrap_or_default());
        at_rest
            .jacobian
            .chunks(states)
            .take(moving)
            .flat_map(|row| row.iter().take(moving).copied())
            .collect()
    }

    /// The tables of half of an interval.
    fn half<'a>(&self, of: &'a Linearised) -> &'a StepTables {
        let (tables, interval_s) = &of.half;
        tables.get_or_init(|| {
            let mut tables = self.motion.tables();
            self.motion.set_tables(&mut tables, &of.jacobian, *interval_s);
            tables
        })
    }

    /// An entry of the covariance that the noise adds over an interval at rest.
    pub fn covariance(&self, interval: &Interval, (i, j): (usize, usize)) -> f64 {
        let at_rest = self.linearised(interval, self.rest.get(..self.moving()).unwrap_or_default());
        let (i, j) = (i.max(j), i.min(j));
        at_rest.covariance.get(i * self.rest.len() + j).copied().unwrap_or(0.0)
    }

    fn write_noise<const M: usize>(
        &self,
        jacobian: &[f64],
        interval_s: f64,
        held: &ParameterStep,
        (covariance, root): (&mut [f64], &mut [f64]),
    ) {
        let density = |i: usize| self.density.get(i).copied().unwrap_or(0.0);
        let noise = self.discretized::<M>(jacobian, interval_s, density);
        held.noise((&ProcessNoise::from(noise), self.moving()), covariance, root);
    }

    /// What a density of 1 of a state's rate adds to the covariance of the moving states over an interval, row by row.
    fn noise_of_rate<const M: usize>(&self, jacobian: &[f64], interval_s: f64, state: usize) -> Vec<f64> {
        let moving = self.moving();
        let density = |i: usize| if i == state { 1.0 } else { 0.0 };
        let noise = self.discretized::<M>(jacobian, interval_s, density);
        (0..moving * moving).map(|place| noise.get(place / moving, place % moving)).collect()
    }

    /// The covariance that noises of these densities add over an interval where the motion has these slopes.
    fn discretized<const M: usize>(
        &self,
        jacobian: &[f64],
        interval_s: f64,
        density: impl Fn(usize) -> f64,
    ) -> Covariance<f64, M> {
        let (moving, states) = (self.moving(), self.rest.len());
        let entry = |i: usize, j: usize| {
            let known = jacobian.get(i * states + j).filter(|_| i < moving && j < moving);
            // At a place where the motion cannot be linearised, as that of a device without a rest, noise goes into its own state.
            known.copied().filter(|slope| slope.is_finite()).unwrap_or(0.0)
        };
        let a = Mat::<f64, M, M>::from_fn(entry);
        let density = Mat::<f64, M, M>::from_fn(|i, j| if i == j { density(i) } else { 0.0 });
        discretize(&a, &NoiseDensity::from_lower(density), interval_s).noise
    }

    /// Adds the noises that vary to the covariance of a step, with its root.
    fn write_varying<const M: usize>(
        &self,
        (linearised, sizes): (&Linearised, &StateNumbers),
        covariance: &mut [f64],
        root: &mut [f64],
    ) {
        let (moving, states) = (self.moving(), self.rest.len());
        let entry = |i: usize, j: usize| {
            let (i, j) = (i.max(j), i.min(j));
            if i >= moving {
                return 0.0;
            }
            let base = linearised.covariance.get(i * states + j).copied().unwrap_or(0.0);
            let each = linearised.of_rates.iter().zip(sizes);
            base + each.map(|(of, size)| size * of.get(i * moving + j).copied().unwrap_or(0.0)).sum::<f64>()
        };
        let noise = Covariance::from_lower(Mat::<f64, M, M>::from_fn(entry));
        linearised.held.noise((&ProcessNoise::from(noise), moving), covariance, root);
    }

    /// The variance of a measurement's noise over that at rest, at a mean and under inputs; 1 of one that does not vary.
    pub fn noise_ratio(&self, measure: usize, mean: &[f64], inputs: &[f64]) -> f64 {
        let Some((_, reading, at_rest)) = self.varying.measures.iter().find(|(of, ..)| *of == measure) else {
            return 1.0;
        };
        self.with_values(mean, |x| reading.borrow_mut().read(x, inputs)) / at_rest
    }

    /// This step under inputs, from a state with this mean: whole turns of what comes round are taken off. What of the mean it needs is kept in
    /// `room`.
    pub fn under<'a>(
        &'a self,
        interval: &'a Interval,
        inputs: Nodes<&'a [f64]>,
        mean: &[f64],
        room: &'a mut StepRoom,
    ) -> UnderInputs<'a> {
        for (state, period) in &self.periods {
            if let Some((turn, at)) = room.turns.get_mut(*state).zip(mean.get(*state)) {
                *turn = period * (at / period).floor();
            }
        }
        let linearised = self.linearised(interval, mean);
        if !self.varying.rates.is_empty() {
            self.with_values(mean, |x| {
                for (size, (_, reading)) in room.sizes.iter_mut().zip(&self.varying.rates) {
                    *size = reading.borrow_mut().read(x, inputs.start);
                }
            });
        }
        UnderInputs { model: self, length_s: interval.length_s, linearised, inputs, room }
    }

    /// A measurement under inputs.
    pub fn sensor<'a>(&'a self, measure: usize, inputs: &'a [f64]) -> MeasurementUnderInputs<'a> {
        MeasurementUnderInputs { model: self, measure, inputs }
    }

    /// The power density of the noise of each state's rate, 0 where it varies.
    pub fn rate_densities(&self) -> &[f64] {
        &self.density
    }

    /// Where it rests under no input, with the parameters that are states by their values behind the states.
    pub fn rest(&self) -> &[f64] {
        &self.rest
    }

    /// Steps per second that follow its motion.
    pub fn pace(&self) -> f64 {
        self.pace
    }

    /// The states that an event does not depend on.
    pub fn apart_from(&self, event: usize) -> &[bool] {
        self.apart.get(event).map_or(&[], Vec::as_slice)
    }

    /// The tables of a step back in time, by Runge and Kutta's method whatever the rule of the filter.
    pub fn tables_back(&self, step_s: f64) -> StepTables {
        self.motion.runge_kutta(step_s)
    }

    /// One step of the motion back in time, with its derivatives where there is room; parameters are states by their values.
    pub fn step_back(
        &self,
        at: &[f64],
        (inputs, tables): (&Nodes<&[f64]>, &StepTables),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) {
        let finite = self.with_work(0, |work| {
            if jacobian.is_empty() {
                self.motion.step(work, at, inputs, tables, to)
            } else {
                self.motion.linearized_step(work, at, inputs, tables, to, jacobian)
            }
        });
        if finite != Some(true) {
            to.fill(f64::NAN);
        }
    }

    /// The expression of an event at a state with parameters by their values, with its derivatives where there is room.
    pub fn event(&self, event: usize, at: &[f64], inputs: &[f64], slopes: &mut [f64]) -> f64 {
        let of = |readout: &ReadoutProgram| {
            self.with_work(1 + self.readouts.len() + event, |work| {
                if slopes.is_empty() {
                    readout.read(work, at, inputs)
                } else {
                    readout.linearize(work, at, inputs, slopes)
                }
            })
        };
        self.events.get(event).and_then(of).unwrap_or(f64::NAN)
    }

    /// How fast what has these derivatives grows per s at a state with parameters by their values.
    pub fn growth(&self, at: &[f64], inputs: &[f64], slopes: &[f64]) -> f64 {
        let mut rates = [0.0; MOST_STATES];
        let Some(rates) = rates.get_mut(..at.len()) else { return f64::NAN };
        self.with_work(0, |work| self.motion.rates(work, at, inputs, rates));
        rates.iter().zip(slopes).map(|(rate, slope)| rate * slope).sum()
    }

    /// Derivatives by the values of parameters that are states as those by their deviations.
    pub fn scale_parameters(&self, slopes: &mut [f64]) {
        let moving = self.moving();
        for (k, (_, added)) in self.free.iter().enumerate() {
            if let Some(slope) = slopes.get_mut(moving + k) {
                *slope *= added.scale;
            }
        }
    }

    fn with_work<R>(&self, place: usize, with: impl FnOnce(&mut ProgramNumbers) -> R) -> Option<R> {
        self.work.borrow_mut().get_mut(place).map(with)
    }

    /// The states with the values of the parameters behind them.
    pub fn valued(&self, x: &[f64]) -> StateNumbers {
        valued(x, self.moving(), &self.free)
    }

    /// Does something with these: with the states as they are where no parameter is one.
    fn with_values<R>(&self, x: &[f64], with: impl FnOnce(&[f64]) -> R) -> R {
        if self.free.is_empty() {
            return with(x);
        }
        with(self.valued(x).get(..x.len()).unwrap_or_default())
    }

    /// The places of the quantities that follow from stated parameters alone, of which nothing is estimated.
    pub fn stated_quantities(&self) -> impl Iterator<Item = usize> {
        self.quantities
            .iter()
            .enumerate()
            .filter(|(_, reading)| !reading.is_estimated())
            .map(|(place, _)| place)
    }

    /// What follows from the states, and from the inputs of each row, one row behind the other, by the expressions of the device, under these
    /// names; `None` where there is nothing.
    pub fn derived(&self, names: Vec<StateName>, of_rows: Vec<f64>) -> Option<DerivedQuantities> {
        if self.quantities.is_empty() {
            return None;
        }
        let (moving, free) = (self.moving(), self.free.clone());
        let readings = RefCell::new(self.quantities.clone());
        let (size, inputs) = (moving + free.len(), self.inputs);
        Some(DerivedQuantities::new(names, move |row, mean, covariance, to| {
            let inputs = of_rows.get(row * inputs..(row + 1) * inputs).unwrap_or_default();
            let (x, mut slopes) = (valued(mean, moving, &free), [0.0; MOST_STATES]);
            let Some((x, slopes)) = x.get(..size).zip(slopes.get_mut(..size)) else { return };
            for (place, reading) in readings.borrow_mut().iter_mut().enumerate() {
                let value = reading.linearize(x, inputs, slopes);
                for (slope, (_, added)) in slopes.iter_mut().skip(moving).zip(&free) {
                    *slope *= added.scale;
                }
                to(place, (value, deviation(slopes, covariance)));
            }
        }))
    }
}

/// The states, of which those behind the first so many are the deviations of parameters, with their values in the deviations' place.
fn valued(x: &[f64], moving: usize, free: &[(f64, AddedState<f64>)]) -> StateNumbers {
    let mut valued = [0.0; MOST_STATES];
    let count = x.len().min(MOST_STATES);
    valued[..count].copy_from_slice(&x[..count]);
    for (k, (value, added)) in free.iter().enumerate() {
        if let Some(to) = valued.get_mut(moving + k) {
            *to = value + *to * added.scale;
        }
    }
    valued
}

fn rooted<const M: usize>(covariance: &mut [f64], root: &mut [f64], n: usize) {
    let entry = |i: usize, j: usize| if i < n && j <= i { covariance[i * n + j] } else { 0.0 };
    let noise = ProcessNoise::from(Covariance::from_lower(Mat::<f64, M, M>::from_fn(entry)));
    for i in 0..n {
        for j in 0..n {
            root[i * n + j] = noise.root()[(i, j)];
        }
    }
    for i in 0..n {
        for j in 0..=i {
            covariance[i * n + j] = (0..=j).map(|k| root[i * n + k] * root[j * n + k]).sum();
        }
    }
}

/// What is made once for an interval, and for each place where the motion is linearised.
pub struct Interval {
    length_s: f64,
    linearised: RefCell<Vec<Rc<Linearised>>>,
}

impl Interval {
    /// Of this length in s.
    pub fn of(length_s: f64) -> Self {
        Self { length_s, linearised: RefCell::default() }
    }
}

/// Places that are kept at once.
const MOST_LINEARISED: usize = 8;

/// A step over an interval for one place where the motion is linearised.
struct Linearised {
    /// The states there, parameters by their values.
    point: StateNumbers,
    tables: StepTables,
    /// The same for half of the interval, once they are asked for, and that half in s.
    half: (OnceCell<StepTables>, f64),
    /// The step itself, once it is asked for, of a motion that is linear and has no input: what it adds, and its Jacobian row by row.
    whole: OnceCell<Option<(Vec<f64>, Vec<f64>)>>,
    /// ∂f/∂x, row by row.
    jacobian: Vec<f64>,
    held: ParameterStep,
    covariance: Vec<f64>,
    root: Vec<f64>,
    /// What a density of 1 of each rate whose noise varies adds to the covariance of the moving states, row by row.
    of_rates: Vec<Vec<f64>>,
}

/// A number to twelve binary digits, or to a multiple of a step where that is coarser: what a step's linear part is off by then costs the step
/// less than a thousandth of a claimed standard deviation, and is the same for many samples.
fn rounded(x: f64, step: f64) -> f64 {
    const DROPPED: u32 = f64::MANTISSA_DIGITS - 12;
    const STEPS: f64 = 2048.0;
    if x.abs() < STEPS * step {
        return (x / step).round() * step;
    }
    let half = 1_u64 << (DROPPED - 1);
    f64::from_bits((x.to_bits() + half) & !((1 << DROPPED) - 1))
}

/// A step under inputs.
pub struct UnderInputs<'a> {
    model: &'a EquationModel,
    length_s: f64,
    linearised: Rc<Linearised>,
    inputs: Nodes<&'a [f64]>,
    room: &'a StepRoom,
}

/// What a step takes of the mean that it begins from. It is kept by who takes the steps: most devices have nothing of it, and as a part of each step it
/// would be written and moved for each of them.
#[derive(Default)]
pub struct StepRoom {
    /// The whole turns of what comes round, by the places of the states.
    turns: StateNumbers,
    /// The densities of the rates whose noise varies.
    sizes: StateNumbers,
}

impl UnderInputs<'_> {
    /// The step of a motion that is linear and has neither inputs nor parameters that are states: it is the same from everywhere.
    fn whole(&self) -> Option<&(Vec<f64>, Vec<f64>)> {
        let model = self.model;
        if self.inputs.start.len() + model.free.len() > 0 || !model.is_the_same_everywhere() {
            return None;
        }
        let made = self.linearised.whole.get_or_init(|| {
            let states = model.rest.len();
            let (mut adds, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
            let (zero, tables) = (vec![0.0; states], &self.linearised.tables);
            let step = |work: &mut ProgramNumbers| {
                model.motion.linearized_step(work, &zero, &self.inputs, tables, &mut adds, &mut jacobian)
            };
            (model.with_work(0, step) == Some(true)).then_some((adds, jacobian))
        });
        made.as_ref()
    }

    /// Moves the states, with the derivatives by all of them where there is room for these.
    #[allow(clippy::needless_range_loop)] // for each sample: an adapter of iterators is a call
    fn moved(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        let model = self.model;
        if let Some((adds, whole)) = self.whole() {
            let n = x.len();
            for i in 0..n.min(adds.len()) {
                let row = &whole[i * n..(i + 1) * n];
                let mut sum = adds[i];
                for j in 0..n {
                    sum += row[j] * x[j];
                }
                to[i] = sum;
            }
            if !jacobian.is_empty() {
                jacobian.copy_from_slice(whole);
            }
            return self.concluded(Some(to.iter().all(|x| x.is_finite())), x, to);
        }
        let finite = model.with_values(x, |at| {
            model.with_work(0, |work| match model.rule {
                StepRule::Exponential => {
                    let part = (&self.inputs, &self.linearised.tables, self.length_s);
                    self.by_exponential(work, at, part, to, jacobian)
                }
                StepRule::Euler => self.by_euler(work, at, to, jacobian),
            })
        });
        self.concluded(finite, x, to);
    }

    /// One step under inputs over an interval in s of these tables, with the resets and the kinks within it.
    fn by_exponential(
        &self,
        work: &mut ProgramNumbers,
        at: &[f64],
        (inputs, tables, length_s): (&Nodes<&[f64]>, &StepTables, f64),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        let (motion, resets) = (&self.model.motion, self.model.resets.as_ref());
        let slopes = &self.linearised.jacobian;
        let mut set_tables =
            |tables: &mut StepTables, length_s: f64| motion.set_tables(tables, slopes, length_s);
        let mut follow = |work: &mut ProgramNumbers, to: &mut [f64], jacobian: &mut [f64]| {
            let set_tables = &mut set_tables;
            let mut step = ResetStep { motion, work, inputs, tables, length_s, set_tables };
            resets.is_none_or(|resets| resets.borrow_mut().follow(&mut step, at, to, jacobian))
        };
        let are_kinks = resets.is_some_and(|resets| resets.borrow().are_kinks());
        if are_kinks && follow(work, to, jacobian) {
            return true;
        }
        let finite = if jacobian.is_empty() {
            motion.step(work, at, inputs, tables, to)
        } else {
            motion.linearized_step(work, at, inputs, tables, to, jacobian)
        };
        // Kinks that are passed too often, as by what rests on one, are stepped over.
        finite && (are_kinks || follow(work, to, jacobian))
    }

    /// Takes whole turns off, and moves the parameters; no numbers where the step is not finite.
    fn concluded(&self, finite: Option<bool>, x: &[f64], to: &mut [f64]) {
        if finite != Some(true) {
            to.fill(f64::NAN);
        }
        let mut turns = false;
        for (state, _) in &self.model.periods {
            if let Some(to) = to.get_mut(*state) {
                *to -= self.room.turns[*state];
                turns |= self.room.turns[*state] != 0.0;
            }
        }
        if !self.model.free.is_empty() {
            self.linearised.held.advance(self.model.moving(), x, to);
        }
        if turns && let Some(path) = self.model.path() {
            // It is on other sides without a motion.
            let now = self.model.path_from(to, self.inputs.end);
            self.model.set_path(Some(path.with_sides_of(&now)));
        }
    }

    /// The inputs over one of so many parts of the interval.
    fn inputs_of_part<'b>(
        &self,
        step: usize,
        steps: usize,
        nodes: &'b mut [StateNumbers; 3],
    ) -> Nodes<&'b [f64]> {
        set_part(&self.inputs, (step, steps), nodes);
        let count = self.inputs.start.len().min(MOST_STATES);
        let [start, middle, end] = nodes;
        Nodes { start: &start[..count], middle: &middle[..count], end: &end[..count] }
    }

    fn by_euler(&self, work: &mut ProgramNumbers, at: &[f64], to: &mut [f64], jacobian: &mut [f64]) -> bool {
        let (motion, interval_s) = (&self.model.motion, self.length_s);
        let finite = if jacobian.is_empty() {
            motion.rates(work, at, self.inputs.start, to)
        } else {
            motion.linearize(work, at, self.inputs.start, to, jacobian)
        };
        for (to, at) in to.iter_mut().zip(at) {
            *to = at + interval_s * *to;
        }
        for (place, slope) in jacobian.iter_mut().enumerate() {
            *slope *= interval_s;
            if place % (at.len() + 1) == 0 {
                *slope += 1.0;
            }
        }
        finite
    }
}

/// Writes the inputs over one of so many parts of an interval.
#[allow(clippy::needless_range_loop)] // for each step: an adapter of iterators is a call
pub fn set_part(
    Nodes { start, middle, end }: &Nodes<&[f64]>,
    (step, steps): (usize, usize),
    nodes: &mut [StateNumbers; 3],
) {
    for k in 0..start.len().min(MOST_STATES) {
        let whole = Nodes { start: start[k], middle: middle[k], end: end[k] };
        let part = SegmentDrive::nodes_of_part(&whole, step, steps);
        nodes[0][k] = part.start;
        nodes[1][k] = part.middle;
        nodes[2][k] = part.end;
    }
}

/// The derivatives of two steps, from those of the first and those of the one behind it, column by column; the rows of states that
/// do not move stay.
#[allow(clippy::needless_range_loop)] // for each step: an adapter of iterators is a call
pub fn chain(before: &mut [f64], step: &[f64], moving: usize, size: usize) {
    let mut column = [0.0; MOST_STATES];
    for j in 0..size {
        for k in 0..size {
            column[k] = before[k * size + j];
        }
        for i in 0..moving {
            let row = &step[i * size..(i + 1) * size];
            let mut sum = row[0] * column[0];
            for k in 1..size {
                sum += row[k] * column[k];
            }
            before[i * size + j] = sum;
        }
    }
}

impl Transition for UnderInputs<'_> {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        self.moved(x, to, &mut []);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        self.moved(x, to, jacobian);
        let (moving, states) = (self.model.moving(), x.len());
        if self.model.free.is_empty() {
            return;
        }
        for row in 0..moving {
            self.model.scale_parameters(&mut jacobian[row * states..(row + 1) * states]);
        }
        self.linearised.held.linearize(moving, states, jacobian);
    }

    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        let model = self.model;
        if !model.divides() {
            return false;
        }
        let tables = model.half(&self.linearised);
        let mut middle = [0.0; MOST_STATES];
        let Some(middle) = middle.get_mut(..x.len()) else { return false };
        let finite = model.with_values(x, |at| {
            model.with_work(0, |work| {
                let (mut nodes, length_s) = ([[0.0; MOST_STATES]; 3], 0.5 * self.length_s);
                let first = (&self.inputs_of_part(0, 2, &mut nodes), tables, length_s);
                let first = self.by_exponential(work, at, first, middle, &mut []);
                let second = (&self.inputs_of_part(1, 2, &mut nodes), tables, length_s);
                first && self.by_exponential(work, middle, second, to, &mut [])
            })
        });
        self.concluded(finite, x, to);
        true
    }

    fn is_smooth(&self) -> bool {
        !self.model.has_kinks()
    }

    fn continuous(&self) -> Option<ContinuousMotion> {
        let (slopes, moving) = (self.model.linear_at_rest(), self.model.moving());
        let poles = modes(&slopes, moving)?;
        // Of a pair the second one says the same.
        let poles = poles.iter().filter(|mode| mode.rate >= 0.0).map(|mode| {
            let (real, imaginary) = (mode.growth, mode.rate);
            if mode.oscillates() { Pole::Pair { real, imaginary } } else { Pole::Real(real) }
        });
        Some(ContinuousMotion {
            poles: poles.collect(),
            densities: self.model.rate_densities().to_vec(),
            slopes,
        })
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        if !self.model.varying.rates.is_empty() {
            let of = (&*self.linearised, &self.room.sizes);
            return match self.model.moving() {
                0..=2 => self.model.write_varying::<2>(of, covariance, root),
                3..=4 => self.model.write_varying::<4>(of, covariance, root),
                5..=8 => self.model.write_varying::<8>(of, covariance, root),
                9..=16 => self.model.write_varying::<16>(of, covariance, root),
                _ => self.model.write_varying::<MOST_STATES>(of, covariance, root),
            };
        }
        covariance.copy_from_slice(&self.linearised.covariance);
        root.copy_from_slice(&self.linearised.root);
    }

    fn moving(&self, _: usize) -> usize {
        self.model.moving()
    }
}

/// A measurement under inputs.
pub struct MeasurementUnderInputs<'a> {
    model: &'a EquationModel,
    measure: usize,
    inputs: &'a [f64],
}

impl MeasurementUnderInputs<'_> {
    fn of<R>(
        &self,
        x: &[f64],
        with: impl FnOnce(&ReadoutProgram, &mut ProgramNumbers, &[f64]) -> R,
    ) -> Option<R> {
        let readout = self.model.readouts.get(self.measure)?;
        self.model.with_values(x, |x| self.model.with_work(self.measure + 1, |work| with(readout, work, x)))
    }
}

impl Sensor for MeasurementUnderInputs<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        self.of(x, |readout, work, x| readout.read(work, x, self.inputs)).unwrap_or(f64::NAN)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let read = self.of(x, |readout, work, x| readout.linearize(work, x, self.inputs, slopes));
        self.model.scale_parameters(slopes);
        read.unwrap_or(f64::NAN)
    }
}

/// Steps for one interval at most.
const MOST_STEPS: usize = 1024;

/// How far a mode may be followed wrongly, as a part of it: 10⁻⁶ at most, and of one that rings sharply a part of its width.
const WRONG: f64 = 1e-6;
const WRONG_IN_WIDTHS: f64 = 2e-4;
const LEAST_WRONG: f64 = 1e-10;

/// The steps per second of Runge and Kutta's method that follow these modes: what the method leaves out of a mode λ in a step h is
/// (|λ|·h)⁴/120 of its decay and its rate, and what counts of it is how it compares with the width 2ζ of the resonance.
pub fn pace(modes: &[Mode]) -> f64 {
    let of = |mode: &Mode| {
        let width = (2.0 * mode.damping_ratio().abs() * WRONG_IN_WIDTHS).clamp(LEAST_WRONG, WRONG);
        mode.size() / (120.0 * width).sqrt().sqrt()
    };
    modes.iter().filter(|mode| mode.size() > 0.0).map(of).fold(0.0, f64::max)
}

/// The steps in which an interval in s is followed at this pace; `None` where these are more than a sample is worth.
pub fn steps_over(pace: f64, interval_s: f64) -> Option<usize> {
    let steps = (pace * interval_s).ceil().max(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive count
    (steps <= MOST_STEPS as f64).then_some(steps as usize)
}
