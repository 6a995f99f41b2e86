//! Several models of the instrument side by side.

use super::course::unusual_interval;
use super::data::AccelerometerSegment;
use super::instrument::ScaledReadout;
use super::settings::AccelerometerHardware;
use super::varied_instrument::{Factors, VariedInstrument, VariedStep};
use crate::estimate::{
    AnyKnownStateStep, Course, Filtering, KnownStateStep, MeasurementSensor, SampleCounts, by_signal,
};
use kalmems_core::adapt::Bank;
use kalmems_core::{Covariance, Ekf, FilterError, Innovation, NotAScale};

/// Three values of each of three parameters.
const MODELS: usize = 27;

/// The filters of all models, and how likely each is.
pub type AccelerometerBank = Bank<Ekf<f64, 4>, f64, 4, MODELS>;

/// A bank on its way through a segment. The filter that is led through it takes over what the bank says.
pub struct AccelerometerBankCourse<'a> {
    hardware: &'a AccelerometerHardware,
    data: &'a AccelerometerSegment<'a>,
    factors: Vec<Factors<f64>>,
    bank: Box<AccelerometerBank>,
    /// The models as they begin.
    first: Box<AccelerometerBank>,
    processes: Box<[VariedStep<f64>; MODELS]>,
    readouts: [ScaledReadout<4>; MODELS],
    noise: [Covariance<f64, 1>; MODELS],
}

impl<'a> AccelerometerBankCourse<'a> {
    /// Each of spring, damping and mass as stated and off by its spread to both sides, in all combinations, all equally
    /// likely at first and from one start. A spread of 0 counts once.
    pub fn new(
        hardware: &'a AccelerometerHardware,
        data: &'a AccelerometerSegment<'a>,
        start: Ekf<f64, 4>,
        spread: &[f64; 3],
    ) -> Result<Self, NotAScale> {
        let digits = |model: usize| [model % 3, model / 3 % 3, model / 9];
        let factors: Vec<Factors<f64>> = (0..MODELS)
            .map(|model| {
                let steps = digits(model);
                let [spring, damping, mass] =
                    std::array::from_fn(|i| 1.0 + spread[i] * [0.0, -1.0, 1.0][steps[i]]);
                Factors { spring, damping, mass, noise: 1.0, acceleration: 1.0, bandwidth: 1.0 }
            })
            .collect();
        let varied = factors.iter().map(|factors| VariedInstrument::of(hardware, factors, data.interval_s));
        let varied = varied.collect::<Result<Vec<_>, _>>()?;
        // What does not differ from another model is none of its own.
        let prior = std::array::from_fn(|model| {
            let twice = digits(model).iter().zip(spread).any(|(digit, spread)| *digit > 0 && *spread == 0.0);
            if twice { 0.0 } else { 1.0 }
        });
        let first = Box::new(Bank::new([start; MODELS], prior));
        Ok(Self {
            hardware,
            data,
            bank: first.clone(),
            first,
            processes: Box::new(std::array::from_fn(|model| varied[model].process)),
            readouts: std::array::from_fn(|model| varied[model].readout),
            noise: std::array::from_fn(|model| varied[model].noise),
            factors,
        })
    }

    /// The same from where the models were left, if they were.
    #[must_use]
    pub fn continuing(self, models: Option<Box<AccelerometerBank>>) -> Self {
        Self { bank: models.unwrap_or(self.bank), ..self }
    }

    /// Where the models are now.
    pub fn into_models(self) -> Box<AccelerometerBank> {
        self.bank
    }
}

impl Course for AccelerometerBankCourse<'_> {
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let feedback = self.data.feedback(to - 1);
        match unusual_interval(self.data, to, counts) {
            None => self.bank.predict(&self.processes, &feedback)?,
            Some(interval) => {
                // The scales were found to be some with the bank.
                let over =
                    |model: usize| VariedInstrument::of(self.hardware, &self.factors[model], interval).ok();
                let other = std::array::from_fn(|model| {
                    over(model).map_or(self.processes[model], |varied| varied.process)
                });
                self.bank.predict(&other, &feedback)?
            }
        };
        filter.predict(&KnownStateStep::from(self.bank.mixture()))
    }

    /// All models begin again, as likely as at first.
    fn begin_again(&mut self, filter: &mut dyn Filtering, _: &AnyKnownStateStep) -> Result<(), FilterError> {
        self.bank.clone_from(&self.first);
        filter.predict(&KnownStateStep::from(self.bank.mixture()))
    }

    /// The innovation is that of the mixture.
    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let y = self.data.signal[k];
        let sensor = MeasurementSensor::<_, 4>(&self.readouts[0]);
        let innovation = by_signal(filter, y, (&sensor, self.noise[0].get(0, 0)))?;
        // What is rejected of the mixture is rejected of all models.
        if innovation.as_ref().is_some_and(|innovation| innovation.taken) {
            self.bank.update(&self.readouts, &[y], &self.noise)?;
            filter.predict(&KnownStateStep::from(self.bank.mixture()))?;
        }
        Ok(innovation)
    }
}
