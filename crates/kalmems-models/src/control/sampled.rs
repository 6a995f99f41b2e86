//! The force-rebalance loop, sample by sample.

use super::{Complex, Margins, PiController, RebalanceLoop};
use crate::bisection::halved;
use crate::capacitance::FixedPlate;
use crate::dynamics::{Accelerometer, CarrierDriven};
use crate::readout::DifferentialReadout;
use core::f64::consts::{PI, TAU};
use core::fmt;
use kalmems_core::{Covariance, HeldEtdrk4, Mat, Nodes, NoiseDensity, Process, Rk4, Scalar, riccati};

/// An accelerometer in its loop, integrated between its samples.
///
/// At each sample the readout is read, and a feedback voltage is computed that is applied at once or, with a delay of
/// computation, from the next sample on; it is held until the one after. The open loop has a controller of zeros.
#[derive(Clone, Copy, Debug)]
pub struct SampledRebalance {
    device: CarrierDriven<f64>,
    readout: DifferentialReadout<f64>,
    controller: PiController<f64>,
    comparator: Option<Comparator>,
    is_late: bool,
    interval_s: f64,
    steps: u32,
    carrier: Option<SampledCarrier>,
    state: [f64; 2],
    integral: f64,
    seen: f64,
    waiting: f64,
    samples: u64,
}

/// What makes one bit of a controller's output: the loop is then a one-bit ΔΣ modulator whose noise the mass shapes
/// (Zhang 2010, section 1.2, names it as the alternative; Kraft 1997).
///
/// u = V_F·sgn(K_p·(y + τ·Δy/h) + K_i·∫y dt): of the two voltages ±V_F one is applied in each interval h. Two levels lie
/// on a line, however the force depends on the voltage, and v_F² is always the same. The mean of the bits is the
/// acceleration, in units of the full scale g·V_F/m. The lead τ makes up for the lag of an over-damped mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparator {
    /// V_F in V.
    pub level: f64,
    /// τ in s: about the decay time of the mass's faster motion.
    pub lead_s: f64,
}

/// The carrier of a run that does not average it.
#[derive(Clone, Copy, Debug)]
struct SampledCarrier {
    amplitude: f64,
    frequency_hz: f64,
}

/// Why a run of a loop ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoopStop {
    /// The mass has gone to a plate, and stays there.
    PulledIn {
        /// When, in s.
        time_s: f64,
        /// Which.
        plate: FixedPlate,
    },
}

impl fmt::Display for LoopStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::PulledIn { time_s, plate } = self;
        let plate = match plate {
            FixedPlate::First => "first",
            FixedPlate::Second => "second",
        };
        write!(f, "the mass was pulled in to the {plate} plate at {time_s} s")
    }
}

impl core::error::Error for LoopStop {}

/// The share of the gap at which stops end the motion: ASSUMED, the thesis says nothing of its stops.
pub const STOP: f64 = 0.9;

impl SampledRebalance {
    /// At rest, sampled every `interval_s`, with so many integration steps in between.
    ///
    /// The delay of `closed` is how late the computation is: none up to half an interval, which is the hold's, one
    /// interval above it.
    pub fn new(closed: &RebalanceLoop<f64>, interval_s: f64, steps: u32) -> Self {
        Self {
            device: CarrierDriven { device: closed.device },
            readout: closed.readout,
            controller: closed.controller,
            comparator: None,
            is_late: closed.delay > interval_s,
            interval_s,
            steps: steps.max(1),
            carrier: None,
            state: [0.0; 2],
            integral: 0.0,
            seen: 0.0,
            waiting: 0.0,
            samples: 0,
        }
    }

    /// With one bit of the controller's output in its place.
    #[must_use]
    pub fn with_comparator(self, comparator: Comparator) -> Self {
        Self { comparator: Some(comparator), ..self }
    }

    /// With the carrier in full, a sine of the readout's amplitude, in place of its mean square. The steps must be fine
    /// against its period.
    #[must_use]
    pub fn with_carrier(mut self, frequency_hz: f64) -> Self {
        self.carrier = Some(SampledCarrier { amplitude: self.readout.carrier_amplitude, frequency_hz });
        self.device.device.carrier_mean_square = 0.0;
        self
    }

    /// What is read now, with this noise in V.
    pub fn read(&self, noise: f64) -> f64 {
        self.readout.voltage(self.state[0]) + noise
    }

    /// What the loop applies from here to the next sample, in V, to a readout of `seen` V: what was read, or what an
    /// observer in the loop makes of it. Once per sample.
    pub fn answer(&mut self, seen: f64) -> f64 {
        let (linear, integral) = self.controller.step(self.integral, seen, self.interval_s);
        self.integral = integral;
        let computed = match self.comparator {
            Some(Comparator { level, lead_s }) => {
                let lead = self.controller.proportional * lead_s * (seen - self.seen) / self.interval_s;
                if linear + lead < 0.0 { -level } else { level }
            }
            None => linear,
        };
        self.seen = seen;
        let applied = if self.is_late { self.waiting } else { computed };
        self.waiting = computed;
        applied
    }

    /// To the next sample under this feedback in V, an acceleration in m/s² that goes straight from one value to another,
    /// and a Brownian force in N on each integration step; none where there are fewer.
    pub fn advance(&mut self, feedback: f64, acceleration: [f64; 2], forces: &[f64]) -> Result<(), LoopStop> {
        let h = self.interval_s / f64::from(self.steps);
        let process = Rk4::new(self.device, h, &NoiseDensity::none(), (&[0.0; 2], &[0.0; 3]));
        let start = self.time_s();
        for step in 0..self.steps {
            let force = forces.get(step as usize).copied().unwrap_or(0.0);
            let pushed = force / self.device.device.mass.mass;
            let mut inputs = [[0.0; 3]; 3];
            for (input, half_steps) in inputs.iter_mut().zip([0.0, 1.0, 2.0]) {
                let passed = f64::from(step) + 0.5 * half_steps;
                let [from, to] = acceleration;
                let smooth = from + (to - from) * passed / f64::from(self.steps);
                *input = [smooth + pushed, feedback, self.carrier_at(start + h * passed)];
            }
            let [start_input, middle, end] = inputs;
            self.state = process.step(&self.state, &Nodes { start: start_input, middle, end });
            if let Some(plate) = self.device.device.plates.touched(self.state[0], STOP) {
                return Err(LoopStop::PulledIn { time_s: start + h * f64::from(step + 1), plate });
            }
        }
        self.samples += 1;
        Ok(())
    }

    /// The carrier in V, 0 where it is averaged.
    fn carrier_at(&self, time_s: f64) -> f64 {
        match self.carrier {
            Some(carrier) => carrier.amplitude * Scalar::sin(TAU * carrier.frequency_hz * time_s),
            None => 0.0,
        }
    }

    /// The standard deviation in N of a Brownian force that is held over one integration step, for a two-sided density
    /// in N²/Hz.
    pub fn force_sd(&self, density: f64) -> f64 {
        (density * f64::from(self.steps) / self.interval_s).sqrt()
    }

    /// When the sample is that is due, in s.
    pub fn time_s(&self) -> f64 {
        self.samples as f64 * self.interval_s
    }

    /// Displacement in m and velocity in m/s.
    pub fn state(&self) -> &[f64; 2] {
        &self.state
    }
}

/// A loop's mass and readout from one sample to the next, linear about rest.
struct Sampled {
    /// Of displacement and velocity.
    f: Mat<f64, 2, 2>,
    /// What a volt of feedback adds to them.
    per_volt: [f64; 2],
    /// Of the readout, in V/m.
    sensitivity: f64,
    controller: PiController<f64>,
    is_late: bool,
    interval_s: f64,
}

impl Sampled {
    /// L at this rate in rad/s.
    fn open_loop(&self, rate: f64) -> Complex<f64> {
        let z = Complex::turned(rate * self.interval_s);
        let [[a, b], [c, d]] = self.f.0;
        let [of_x, of_v] = self.per_volt;
        let (z_a, z_d) = (Complex { re: z.re - a, im: z.im }, Complex { re: z.re - d, im: z.im });
        // The first row of the adjugate of z·I − F, on g, over the determinant.
        let determinant = z_a * z_d + Complex::real(-b * c);
        let moved = (z_d * Complex::real(of_x) + Complex::real(b * of_v)) / determinant;
        let sum = Complex::real(self.interval_s) / Complex { re: z.re - 1.0, im: z.im };
        let PiController { proportional, integral } = self.controller;
        let law = Complex::real(proportional) + Complex::real(integral) * sum;
        let open = Complex::real(-self.sensitivity) * moved * law;
        if self.is_late { open / z } else { open }
    }
}

/// Frequencies that are looked at between two ends.
const GRID: u32 = 4000;
/// Halvings of the interval between two of them.
const HALVINGS: u32 = 60;

impl RebalanceLoop<f64> {
    /// By how much both gains of the controller may grow before the sampled loop is unstable; `None` where it is already,
    /// or where a million times more changes nothing.
    pub fn sampled_gain_margin(&self, interval_s: f64) -> Option<f64> {
        let holds = |factor: f64| {
            let PiController { proportional, integral } = self.controller;
            let louder = PiController { proportional: proportional * factor, integral: integral * factor };
            Self { controller: louder, ..*self }.is_stable(interval_s)
        };
        if !holds(1.0) {
            return None;
        }
        let (mut low, mut high) = (1.0, 2.0);
        while holds(high) {
            (low, high) = (high, 2.0 * high);
            if high > 1e6 {
                return None;
            }
        }
        // To the last digit of a decibel that anyone reads.
        Some(halved((low, high), 40, |factor| !holds(factor)).0)
    }

    /// The margins of the sampled loop, sought from `from` in rad/s to half the sampling rate.
    ///
    /// With x_{k+1} = F·x_k + g·u_k over an interval h and y_k = S·x_k the loop broken at its output has the transfer function
    /// L(z) = −S·\[1 0\]·(z·I − F)⁻¹·g·(K_p + K_i·h/(z − 1)), with one more z⁻¹ where the computation is late, at z = e^{jωh}
    /// (Franklin, Powell, Workman, *Digital Control of Dynamic Systems*, 3rd edition, section 7.4). A hold is in F and g: near half the
    /// sampling rate it is more than the delay of half an interval.
    pub fn sampled_margins(&self, from: f64, interval_s: f64) -> Margins<f64> {
        let sampled = self.over(interval_s);
        let to = PI / interval_s;
        let at = |step: u32| from * Scalar::exp((to / from).ln() * f64::from(step) / f64::from(GRID));
        let size = |rate: f64| sampled.open_loop(rate).size();
        let is_loud = |rate: f64| size(rate) > 1.0;
        let quiet = (0..=GRID).find(|step| !is_loud(at(*step)));
        let crossover = quiet
            .filter(|step| *step > 0)
            .map(|step| halved((at(step - 1), at(step)), HALVINGS, |rate| !is_loud(rate)).1);
        let phase = crossover.map(|rate| {
            let open = sampled.open_loop(rate);
            Complex { re: -open.re, im: -open.im }.angle()
        });
        let sensitivity = |rate: f64| {
            let open = sampled.open_loop(rate);
            Complex { re: 1.0 + open.re, im: open.im }.size().recip()
        };
        // A loop near its edge has a peak that is narrower than the grid: between the neighbours of the largest it is sought by thirds.
        let peak = (0..=GRID)
            .fold(0, |best, step| if sensitivity(at(step)) > sensitivity(at(best)) { step } else { best });
        let (mut low, mut high) = (at(peak.saturating_sub(1)), at((peak + 1).min(GRID)));
        for _ in 0..2 * HALVINGS {
            let third = (high - low) / 3.0;
            if sensitivity(low + third) < sensitivity(high - third) {
                low += third;
            } else {
                high -= third;
            }
        }
        Margins {
            crossover,
            phase,
            gain: self.sampled_gain_margin(interval_s),
            peak_sensitivity: sensitivity(0.5 * (low + high)).max(sensitivity(at(peak))),
        }
    }

    /// Mass and readout over an interval.
    fn over(&self, interval_s: f64) -> Sampled {
        let none = NoiseDensity::none();
        let process = HeldEtdrk4::new(self.device, interval_s, &none, (&[0.0; 2], &[0.0; 2]));
        let (_, f) = process.linearize(&[0.0; 2], &[0.0; 2]);
        let volt = 1e-6;
        let pushed: [f64; 2] = process.step(&[0.0; 2], &[0.0, volt]);
        Sampled {
            f,
            per_volt: pushed.map(|entry| entry / volt),
            sensitivity: self.readout.sensitivity(),
            controller: self.controller,
            is_late: self.delay > interval_s,
            interval_s,
        }
    }

    /// Whether the sampled loop is stable about rest: its states are [x, ẋ, ∫y, the voltage that waits].
    pub fn is_stable(&self, interval_s: f64) -> bool {
        let device: Accelerometer<f64> = self.device;
        let Sampled { f, per_volt, sensitivity: s, .. } = self.over(interval_s);
        let c = &self.controller;
        // u = K_p·S·x + K_i·∫y, applied now or an interval later.
        let law = [c.proportional * s, 0.0, c.integral, 0.0];
        let applied = if self.delay > interval_s { [0.0, 0.0, 0.0, 1.0] } else { law };
        let mut a = Mat::<f64, 4, 4>::zero();
        for j in 0..4 {
            for (i, per_volt) in per_volt.iter().enumerate() {
                a.0[i][j] = per_volt * applied[j] + if j < 2 { f.0[i][j] } else { 0.0 };
            }
            a.0[3][j] = law[j];
        }
        a.0[2] = [s * interval_s, 0.0, 1.0, 0.0];
        // Without integral action the integral does nothing, and does not decay.
        if c.integral == 0.0 {
            a.0[2][2] = 0.0;
        }
        // In units of what a volt is, of the mass at its own rate.
        let length = s.recip();
        let sizes = [length, length * device.mass.natural_rate(device.mass.spring), interval_s, 1.0];
        let scaled = Mat::from_fn(|i, j| a.0[i][j] * sizes[j] / sizes[i]);
        riccati::discrete_lyapunov(&scaled, &Covariance::from_variances([1.0; 4])).is_ok()
    }
}
