//! The steps of a filter as the source takes them, the loss of its signal included.

use super::{POINTS, Rehearsal, RehearsedEstimate, RehearsedState, narrow, rounded};
use crate::emit::names::SourceNames;
use crate::emit::request::TestSample;
use crate::emit::routine::{Routine, StorageArray};
use crate::emit::watch::{Beginning, InnovationWatch, KeptRecord, LossOutcome, is_alike};
use std::collections::HashMap;

impl RehearsedEstimate {
    fn is_finite(&self) -> bool {
        self.mean.iter().chain(&self.covariance).all(|value| value.is_finite())
    }
}

impl Rehearsal<'_> {
    /// Before the first sample.
    pub(super) fn first(&self) -> RehearsedState {
        let start = self.start();
        RehearsedState {
            kept: start.clone(),
            estimate: start,
            record: KeptRecord::NONE,
            watches: vec![InnovationWatch::NEW; self.request.measures.len()],
            left: 0,
        }
    }

    fn start(&self) -> RehearsedEstimate {
        let ((mean, covariance), widths) = (&self.program.start, self.program.widths);
        RehearsedEstimate {
            mean: mean.iter().map(|value| rounded(*value, widths.mean)).collect(),
            covariance: covariance.iter().map(|value| rounded(*value, widths.covariance)).collect(),
        }
    }

    /// A prediction, the corrections by events and those by measurements; what is not finite is not taken.
    pub(super) fn step(&self, state: &mut RehearsedState, sample: &TestSample) {
        let measures = self.request.measures.len();
        let mut next = state.estimate.clone();
        self.predict(&mut next, sample);
        let events = self.program.updates.iter().skip(measures).zip(&sample.events);
        for (event, ago_s) in events {
            if let Some(ago_s) = ago_s {
                self.apply(&mut next, event, &sample.inputs, Some(*ago_s), None);
            }
        }
        if state.left > 0 {
            state.left -= 1;
            if state.record.is_kept(&self.rules) {
                self.predict(&mut state.kept, sample);
            }
            self.take(state, next, sample);
            return;
        }
        state.left = self.request.update_every - 1;
        for (place, watch) in state.watches.iter_mut().enumerate() {
            self.correct(&mut next, place, sample, watch);
        }
        let begins_again = self.request.begins_again();
        if begins_again && state.record.is_open(&state.watches) {
            self.go_on(state, sample);
        }
        self.take(state, next, sample);
        if begins_again && state.record.is_open(&state.watches) {
            self.recover(state);
        }
    }

    /// Takes over a state that is finite, or else the prediction alone; begins again if that is not finite either.
    fn take(&self, state: &mut RehearsedState, mut next: RehearsedEstimate, sample: &TestSample) {
        if !next.is_finite() {
            next.clone_from(&state.estimate);
            self.predict(&mut next, sample);
        }
        if next.is_finite() {
            state.estimate = next;
        } else {
            self.restart(state);
        }
    }

    /// Goes on with what is kept by a sample, and keeps the filter as it was before the correction with which its gate has opened.
    fn go_on(&self, state: &mut RehearsedState, sample: &TestSample) {
        if state.record.opens(&self.rules, &state.watches) {
            state.kept.clone_from(&state.estimate);
        }
        if state.record.is_kept(&self.rules) {
            self.predict(&mut state.kept, sample);
            for place in 0..state.watches.len() {
                let mut look = state.record.look(&self.rules);
                self.correct(&mut state.kept, place, sample, &mut look);
                state.record.looked(&look);
            }
        }
    }

    fn recover(&self, state: &mut RehearsedState) {
        let is_finite = state.kept.is_finite();
        #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
        let means = |(own, kept): (&f64, &f64)| [*own as f32, *kept as f32];
        let is_alike = is_alike(state.estimate.mean.iter().zip(&state.kept.mean).map(means));
        match state.record.recovery(&self.rules, &state.watches, is_finite, is_alike) {
            LossOutcome::None | LossOutcome::GivenUp => {}
            LossOutcome::Kept => {
                state.estimate.clone_from(&state.kept);
                state.watches.fill(self.rules.settled());
            }
            LossOutcome::Again => self.restart(state),
        }
    }

    fn restart(&self, state: &mut RehearsedState) {
        state.estimate = self.start();
        state.left = 0;
        let is_finite = state.kept.is_finite();
        let watch = match state.record.begins(&self.rules, is_finite) {
            Beginning::Kept => {
                state.estimate.mean.clone_from(&state.kept.mean);
                self.rules.anew()
            }
            Beginning::Start | Beginning::Unknown => InnovationWatch::NEW,
        };
        state.watches.fill(watch);
    }

    /// The interval before a sample.
    fn predict(&self, estimate: &mut RehearsedEstimate, sample: &TestSample) {
        for part in 0..self.request.parts {
            self.apply(estimate, &self.program.predict, &self.inputs_of_part(sample, part), None, None);
        }
    }

    /// A correction by a measurement of a sample.
    fn correct(
        &self,
        estimate: &mut RehearsedEstimate,
        place: usize,
        sample: &TestSample,
        watch: &mut InnovationWatch,
    ) {
        let range = self.request.measures.get(place).and_then(|measure| measure.range);
        let is_at_end = |seen: f64| range.is_some_and(|[low, high]| seen <= low || seen >= high);
        let seen = sample.measured.get(place).map(|seen| if is_at_end(*seen) { f64::NAN } else { *seen });
        if let (Some(update), Some(_)) = (self.program.updates.get(place), seen) {
            self.apply(estimate, update, &sample.inputs, seen, Some(watch));
        }
    }

    /// What a routine makes of a state; nothing where its sample is refused.
    fn apply(
        &self,
        estimate: &mut RehearsedEstimate,
        routine: &Routine,
        inputs: &[Vec<f64>; 3],
        seen: Option<f64>,
        watch: Option<&mut InnovationWatch>,
    ) {
        let mut names: HashMap<String, f64> = HashMap::new();
        let program = self.program;
        for (k, mean) in estimate.mean.iter().enumerate() {
            names.insert(program.names.state(k), *mean);
        }
        for i in 0..estimate.mean.len() {
            for j in 0..=i {
                if let Some(entry) = estimate.covariance.get(i * (i + 1) / 2 + j) {
                    names.insert(SourceNames::covariance(i, j), *entry);
                }
            }
        }
        for ((point, _), inputs) in POINTS.iter().zip(inputs) {
            for (k, input) in inputs.iter().enumerate().take(self.device.inputs().len()) {
                names.insert(program.names.input(k, point), narrow(*input));
            }
        }
        for (k, constant) in self.constants.iter().enumerate() {
            names.insert(format!("c{k}"), *constant);
        }
        if let Some(seen) = seen {
            names.insert("seen".to_owned(), narrow(seen));
        }
        let (outputs, innovation) = self.outputs(routine, &names);
        #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
        if let (Some([residual, variance]), Some(watch)) = (innovation, watch)
            && !watch.believes(&self.rules, residual as f32, variance as f32)
        {
            return;
        }
        for (array, place, value) in outputs {
            let slot = match array {
                StorageArray::Mean => estimate.mean.get_mut(place),
                StorageArray::Covariance => estimate.covariance.get_mut(place),
                StorageArray::Constants | StorageArray::Stage => None,
            };
            if let Some(slot) = slot {
                *slot = value;
            }
        }
    }
}
