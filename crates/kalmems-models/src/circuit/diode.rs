//! A diode that charges a capacitor.

use kalmems_core::Scalar;
use kalmems_macros::{Parameters, model};

/// C·v̇ = i(u − v) − v/R with the diode's current i(w) = max(0, w − V_f)/R_s.
///
/// The envelope detector with one diode (Chen, dissertation, 2018, Figure 2.2a). The diode is the one of two straight
/// lines: nothing below its drop, a resistance above it (Sedra and Smith, Microelectronic Circuits, section 4.3). It
/// charges the capacitor at the crests within R_s·C and leaves it to the load, R·C, between them.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DiodeEnvelope<P> {
    /// V_f in V: what the diode takes before it conducts.
    pub forward_drop: P,
    /// R_s in Ω: diode and source while it conducts.
    pub series_resistance: P,
    /// R in Ω.
    pub load_resistance: P,
    /// C in F.
    pub load_capacitance: P,
}

#[model]
impl<P: Scalar> DiodeEnvelope<P> {
    /// u − v − V_f in V: the diode conducts where it is above 0.
    pub fn forward(&self, input: P, output: P) -> P {
        input - output - self.forward_drop
    }

    /// v̇ in V/s.
    pub fn rate(&self, input: P, output: P) -> P {
        let forward = self.forward(input, output);
        let conducting = P::select(forward.gt(P::of(0.0)), forward, P::of(0.0));
        (conducting / self.series_resistance - output / self.load_resistance) / self.load_capacitance
    }
}

/// A [`DiodeEnvelope`], step by step.
///
/// Between two samples the input is a straight line and the circuit is linear as long as the diode stays as it is:
/// the step is exact there. Where the diode opens or closes within a step, the step is cut where a straight line
/// puts that; its current is 0 at the cut, so that little depends on it.
///
/// ```
/// use kalmems_models::circuit::{DiodeEnvelope, SampledDiode};
/// let diode = DiodeEnvelope {
///     forward_drop: 0.3_f64, series_resistance: 1.0, load_resistance: 1e4, load_capacitance: 1e-9,
/// };
/// let mut detector = SampledDiode::new(diode, 2e-8);
/// let crest = (0..10_000).map(|k| detector.step(2.0 * (0.0628 * f64::from(k)).sin())).last();
/// // The crest less the drop, less what the load takes between two crests.
/// assert!((crest.unwrap_or(0.0) - 1.6).abs() < 0.15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledDiode<P> {
    diode: DiodeEnvelope<P>,
    interval: P,
    input: P,
    output: P,
}

impl<P: Scalar> SampledDiode<P> {
    /// At rest with an input of 0.
    pub fn new(diode: DiodeEnvelope<P>, interval: P) -> Self {
        Self { diode, interval, input: P::of(0.0), output: P::of(0.0) }
    }

    /// One interval on, to where the input is `u`; the output there.
    pub fn step(&mut self, u: P) -> P {
        let before = self.diode.forward(self.input, self.output);
        let conducts = before.gt(P::of(0.0));
        let straight = self.piece(self.interval, u, conducts);
        let after = self.diode.forward(u, straight);
        self.output = if conducts == after.gt(P::of(0.0)) {
            straight
        } else {
            let part = before / (before - after);
            let middle = self.input + (u - self.input) * part;
            self.output = self.piece(self.interval * part, middle, conducts);
            self.input = middle;
            self.piece(self.interval * (P::of(1.0) - part), u, !conducts)
        };
        self.input = u;
        self.output
    }

    /// The output after an interval over which the input goes straight to `u` and the diode stays as it is.
    fn piece(&self, interval: P, u: P, conducts: bool) -> P {
        let d = &self.diode;
        let load = d.load_resistance.recip();
        if !conducts {
            return self.output * (-(interval * load / d.load_capacitance)).exp();
        }
        if !interval.gt(P::of(0.0)) {
            return self.output;
        }
        let series = d.series_resistance.recip();
        let (lag, gain) = (d.load_capacitance / (series + load), series / (series + load));
        let behind = (u - self.input) / interval * lag;
        let follows = |input: P| (input - d.forward_drop - behind) * gain;
        follows(u) + (self.output - follows(self.input)) * (-(interval / lag)).exp()
    }
}
