//! Amplitude and phase of a parametrically driven motion, held by the frequency and the voltage of the drive.

use super::{Complex, Oscillator, PiController};
use core::f64::consts::PI;
use kalmems_core::Scalar;

/// What holds a parametric motion: a loop that holds its phase by the frequency of the drive, and one that holds its
/// amplitude by the drive's voltage, both acting on an estimate of the motion.
///
/// θ = A·cos(α − φ), where α is the phase of the [`Oscillator`]. Each sample the estimate is turned back,
/// z = (θ − j·θ̇/ω)·e^{−j(α − φ*)} = A·e^{−j(φ − φ*)}, and passes a low-pass of first order that takes out what harmonics
/// leave at multiples of 2ω. Its size is the amplitude, and −Im z/|z| = sin(φ − φ*) the error of the phase; where φ is
/// more than a quarter turn off, the motion is taken for its mirror image, which is the same motion to plant and sensor.
/// From there
///
/// ω = ω₀ − (K_p·e + K_i·∫e dt), e = sin(φ − φ*),  and  V_1 = V_0 − (K_p·d + K_i·∫d dt), d = A − A*,
///
/// where ω₀ and V_0 are what the drive had when the loops were closed.
///
/// Why the phase is held and not the frequency: a parametric motion has, at one frequency, up to two stable amplitudes and
/// an unstable one, and jumps to rest where the upper branch folds back. At one phase it has one amplitude alone. With
/// its phase held the motion cannot come to the fold, wherever the resonance wanders, and its amplitude follows the
/// voltage as that of a linear oscillator would.
///
/// Start-up: the voltage is set and the frequency swept down from above the resonance, which leads onto the upper branch.
/// When an estimate of a motion of the stated size has come, the loops close; the wanted amplitude climbs from there at a
/// stated rate. Where the sweep ends without a motion, or where the motion is lost, the sweep begins again.
///
/// Each limit is kept by stopping the integral that would go on beyond it.
///
/// ```
/// use kalmems_models::control::{Limits, PiController, Regulator, RegulatorSettings, RegulatorStage, StartUp, Tolerance};
/// let settings = RegulatorSettings {
///     interval: 1e-6,
///     amplitude: 0.19,
///     phase: 0.0,
///     phase_loop: PiController { proportional: 960.0, integral: 4e5 },
///     amplitude_loop: PiController { proportional: 370.0, integral: 1.3e5 },
///     smoothing_rate: 2e4,
///     offset: 90.0,
///     rate: Limits { lowest: 9.7e4, highest: 9.95e4 },
///     voltage: Limits { lowest: 20.0, highest: 100.0 },
///     start: StartUp { from: 9.92e4, to: 9.77e4, slope: 1e4, voltage: 90.0, caught: 0.06, climb: 5.0 },
///     tolerance: Tolerance { amplitude: 0.005, phase: 0.0017, lasting: 2e-3 },
/// };
/// let mut regulator = Regulator::new(settings);
/// let command = regulator.step(None);
/// // Nothing moves yet: the sweep has begun.
/// assert_eq!((regulator.stage(), command.voltage), (RegulatorStage::Sweeping, 90.0));
/// assert!(command.rate < 9.92e4 && command.rate > 9.9199e4);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Regulator<P> {
    settings: RegulatorSettings<P>,
    /// What is being synthesised, up to the sample that the next step is about.
    drive: Oscillator<P>,
    stage: RegulatorStage,
    /// z behind the low-pass.
    turned: Complex<P>,
    /// ω₀ and V_0.
    base: DriveCommand<P>,
    phase_integral: P,
    amplitude_integral: P,
    /// What the amplitude is to be now, on its way to A*.
    wanted: P,
    /// For how long both errors have been within their tolerance, in s.
    within: P,
    sweeps: u32,
}

/// What a [`Regulator`] goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegulatorSettings<P> {
    /// Between two samples, in s.
    pub interval: P,
    /// A* in rad.
    pub amplitude: P,
    /// φ* in rad.
    pub phase: P,
    /// From the phase's error in rad to ω in rad/s; gains of 0 leave the frequency as the sweep left it.
    pub phase_loop: PiController<P>,
    /// From the amplitude's error in rad to V_1 in V.
    pub amplitude_loop: PiController<P>,
    /// The corner of the low-pass in rad/s: well above the loops, well below the motion.
    pub smoothing_rate: P,
    /// V_o in V.
    pub offset: P,
    /// The limits of ω in rad/s.
    pub rate: Limits<P>,
    /// The limits of V_1 in V.
    pub voltage: Limits<P>,
    /// How the motion is started.
    pub start: StartUp<P>,
    /// What counts as regulated.
    pub tolerance: Tolerance<P>,
}

/// The limits of what is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<P> {
    /// The lowest that is allowed.
    pub lowest: P,
    /// The highest.
    pub highest: P,
}

/// How a motion is started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartUp<P> {
    /// Where the sweep begins, as a rate of the motion in rad/s.
    pub from: P,
    /// Where it ends, below that.
    pub to: P,
    /// How fast, in rad/s²; positive.
    pub slope: P,
    /// V_1 during the sweep, in V.
    pub voltage: P,
    /// The amplitude in rad from which a motion is taken over. One of less than half of it is lost.
    pub caught: P,
    /// How fast the wanted amplitude changes, in rad/s.
    pub climb: P,
}

/// Within what a motion counts as regulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance<P> {
    /// Relative to A*.
    pub amplitude: P,
    /// In rad.
    pub phase: P,
    /// For how long, in s.
    pub lasting: P,
}

/// What a regulator is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegulatorStage {
    /// The frequency is swept; no motion is there yet.
    Sweeping,
    /// Both loops are closed, and the motion is on its way to what is wanted.
    Closing,
    /// The motion is, and has been for a while, within the tolerance.
    Regulated,
}

/// What the drive is to do from the next sample on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand<P> {
    /// ω in rad/s: π times the frequency of the drive in Hz.
    pub rate: P,
    /// V_1 in V.
    pub voltage: P,
}

impl<P: Scalar> Regulator<P> {
    /// At rest, at the beginning of the sweep.
    pub fn new(settings: RegulatorSettings<P>) -> Self {
        let (zero, start) = (P::of(0.0), &settings.start);
        let base = DriveCommand { rate: start.from, voltage: start.voltage };
        Self {
            drive: Oscillator {
                offset: settings.offset,
                amplitude: base.voltage,
                rate: base.rate,
                phase: zero,
            },
            settings,
            stage: RegulatorStage::Sweeping,
            turned: Complex::real(zero),
            base,
            phase_integral: zero,
            amplitude_integral: zero,
            wanted: settings.amplitude,
            within: zero,
            sweeps: 0,
        }
    }

    /// What drives the device up to the next sample, and its phase now.
    pub fn drive(&self) -> &Oscillator<P> {
        &self.drive
    }

    /// What it is doing.
    pub fn stage(&self) -> RegulatorStage {
        self.stage
    }

    /// A as it is regulated, in rad; 0 during a sweep.
    pub fn amplitude(&self) -> P {
        self.turned.size()
    }

    /// φ as it is regulated, in rad.
    pub fn phase(&self) -> P {
        self.settings.phase + self.error_of_phase()
    }

    /// How many sweeps have ended without a motion, or begun again because it was lost.
    pub fn sweeps_again(&self) -> u32 {
        self.sweeps
    }

    /// One sample: the estimate of angle in rad and rate in rad/s now, where there is one, gives what the drive does from
    /// the next sample on. What it does up to there was said a sample before, so that a whole interval is left to
    /// compute in.
    pub fn step(&mut self, motion: Option<[P; 2]>) -> DriveCommand<P> {
        let command = match (self.stage, motion.map(|motion| self.turned_back(motion))) {
            (RegulatorStage::Sweeping, Some(z)) if z.size().gt(self.settings.start.caught) => {
                self.close(z);
                self.regulate(z)
            }
            (RegulatorStage::Sweeping, _) => self.sweep(),
            (_, Some(z)) => self.regulate(z),
            (_, None) => self.sweep_again(),
        };
        self.drive.advance(self.settings.interval);
        (self.drive.rate, self.drive.amplitude) = (command.rate, command.voltage);
        command
    }

    /// z of one sample.
    fn turned_back(&self, [angle, rate]: [P; 2]) -> Complex<P> {
        let z = Complex { re: angle, im: -(rate / self.drive.rate) };
        z * Complex::turned(self.settings.phase - self.drive.phase)
    }

    fn sweep(&mut self) -> DriveCommand<P> {
        let start = &self.settings.start;
        let rate = self.drive.rate - start.slope * self.settings.interval;
        if rate.lt(start.to) {
            return self.sweep_again();
        }
        DriveCommand { rate, voltage: start.voltage }
    }

    /// From its beginning.
    fn sweep_again(&mut self) -> DriveCommand<P> {
        let (again, start) = (self.sweeps.saturating_add(1), &self.settings.start);
        let command = DriveCommand { rate: start.from, voltage: start.voltage };
        let drive = self.drive;
        *self = Self { drive, sweeps: again, ..Self::new(self.settings) };
        command
    }

    /// The loops begin where the sweep is.
    fn close(&mut self, z: Complex<P>) {
        self.stage = RegulatorStage::Closing;
        self.turned = z;
        self.wanted = z.size();
        self.base = DriveCommand { rate: self.drive.rate, voltage: self.drive.amplitude };
    }

    fn regulate(&mut self, z: Complex<P>) -> DriveCommand<P> {
        let s = self.settings;
        let share = s.smoothing_rate * s.interval;
        let share = share / (P::of(1.0) + share);
        self.turned = self.turned + Complex::real(share) * (z + Complex::real(P::of(-1.0)) * self.turned);
        let amplitude = self.turned.size();
        // Not a number is lost too.
        if !amplitude.gt(s.start.caught.half()) {
            return self.sweep_again();
        }
        self.wanted = toward(self.wanted, s.amplitude, s.start.climb * s.interval);
        let (off_phase, off_amplitude) = (self.error_of_phase(), amplitude - self.wanted);
        let rate = limited(
            &s.phase_loop,
            &mut self.phase_integral,
            (self.base.rate, -off_phase),
            (s.interval, &s.rate),
        );
        let voltage = limited(
            &s.amplitude_loop,
            &mut self.amplitude_integral,
            (self.base.voltage, -off_amplitude),
            (s.interval, &s.voltage),
        );
        let near = !(amplitude - s.amplitude).abs().gt(s.tolerance.amplitude * s.amplitude)
            && !off_phase.abs().gt(s.tolerance.phase);
        self.within = if near { self.within + s.interval } else { P::of(0.0) };
        if self.within.gt(s.tolerance.lasting) {
            self.stage = RegulatorStage::Regulated;
        }
        DriveCommand { rate, voltage }
    }

    /// sin(φ − φ*), of the mirror image where that is nearer.
    fn error_of_phase(&self) -> P {
        let (z, size) = (self.turned, self.turned.size());
        if !size.gt(P::of(0.0)) {
            return size;
        }
        let sine = -(z.im / size);
        if z.re.lt(P::of(0.0)) { -sine } else { sine }
    }
}

impl<P: Scalar> RegulatorSettings<P> {
    /// ω of the drive of this frequency in Hz.
    pub fn rate_of(drive_hz: P) -> P {
        drive_hz * P::of(PI)
    }
}

/// A value that goes to another by no more than a step.
fn toward<P: Scalar>(from: P, to: P, step: P) -> P {
    let by = to - from;
    if by.abs().gt(step) { if by.lt(P::of(0.0)) { from - step } else { from + step } } else { to }
}

/// base + K_p·y + K_i·∫y within limits. The integral takes in what does not lead further beyond them.
fn limited<P: Scalar>(
    controller: &PiController<P>,
    integral: &mut P,
    (base, y): (P, P),
    (interval, limits): (P, &Limits<P>),
) -> P {
    let (by, next) = controller.step(*integral, y, interval);
    let (wanted, zero) = (base + by, P::of(0.0));
    let (above, below) = (wanted.gt(limits.highest), wanted.lt(limits.lowest));
    let further = (above && y.gt(zero)) || (below && y.lt(zero));
    if !further {
        *integral = next;
    }
    if above {
        limits.highest
    } else if below {
        limits.lowest
    } else {
        wanted
    }
}
