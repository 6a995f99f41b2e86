//! Estimation: from samples to trajectories.
//!
//! Nothing here, and nothing that calls it, reads a reference: see [`crate::evaluate`].

mod answers;
mod any_filter;
mod bank;
mod batch_start;
mod bridge;
mod considered;
mod constant_gain;
pub mod driven;
mod engine;
mod error;
mod error_memory;
mod filter_basics;
mod from_signal;
mod gate;
mod hidden_sign;
mod hidden_turn;
mod known_state;
mod linked;
mod lock;
mod lock_in;
mod loss_watch;
mod model_alone;
mod noise_estimate;
mod over_rows;
mod part;
mod past;
mod phase_prediction;
mod readout_states;
mod recovery;
mod segments;
mod signal_watch;
mod smoothing;
mod solved_gain;
mod start_turns;
mod step_watch;
mod stretches;
mod tracked;
mod trajectory;
mod transition;

pub use answers::{SampleSelection, answers, follow};
pub use any_filter::{
    AnyFilter, FilterKind, MOST_OF_EVERY_METHOD, MOST_STATES, MeanAndCovariance, StateFilter, butterworth,
};
pub use bank::{MOST_MODELS, answers_of_bank};
pub use batch_start::{BatchStart, NoBatchStart, StartSearch, StatePrior, batch_start};
pub use bridge::{Bridge, MOST_STEPS};
pub use considered::Contribution;
pub(crate) use considered::DirectionInformation;
pub use constant_gain::{ConstantGain, GainOf, Never};
pub use engine::{
    Compute, Course, DerivedQuantities, Filtering, StateName, by_signal, by_signal_taken_for, by_signals,
    deviation,
};
pub use error::EstimateError;
pub use error_memory::ErrorSpan;
pub use filter_basics::{FilterBasics, process_noise, refuse_demodulator};
pub use from_signal::{
    HiddenSwing, SignalStart, StartAgain, StartedCourse, batch_start_with, begun, rows_for_start,
    rows_to_start_again, start_again_from_signal, start_from_signal,
};
pub use gate::{
    Decisions, EVENTS, FALSE_REJECTIONS, GateMode, GateTurn, NEVER, Rejection, SampleGate, UpdateLaw,
    largest_nis, memory_samples,
};
pub use hidden_sign::{BranchAlignment, StatedSign, are_opposite};
pub(crate) use hidden_turn::KnownState;
pub use hidden_turn::TurnedStates;
pub use known_state::{AnyKnownStateStep, KnownStateStep};
pub use lock::is_the_only_one;
pub use lock::{Lock, LockEvent, MotionRate, judge_lock};
pub use lock_in::{LockInWindows, Swing, amplitude_of_line, inversion, lock_in};
pub use loss_watch::{DISTURBANCE, Reacquisition};
pub use model_alone::ModelAlone;
pub use noise_estimate::NoiseEstimate;
pub use over_rows::RowFilter;
pub use part::{RowsAround, SegmentPart};
pub(crate) use past::NumberBits;
pub use past::{AnswerPast, FilterPast, Past, PastState};
pub use phase_prediction::{
    FilterSideOutputs, PhasePrediction, PhasePredictionCounts, PhasePredictor, PredictedPhase, SideOutputs,
    StatePropagation,
};
pub use readout_states::{ReadoutState, WithReadout};
pub use recovery::FilterStop;
pub use segments::{AngleAxis, PassedMark, RecordedPassing, SegmentEstimate, SignalSegment};
pub use step_watch::{StepCounts, StepError, StepFigure};
pub use stretches::{SkippedStretch, StretchAnswer, StretchJudge, StretchSummary, of_whole_segment};
pub(crate) use tracked::is_at;
pub use tracked::{DeviceParameter, Tracked};
pub use trajectory::{
    FilterFailure, FurtherSignal, NisConsistency, PHASE, ParameterCorrelation, Restart, SampleCounts,
    SignalConsistency, SignalName, StateSeries, TrackedPrior, Trajectory, TrajectoryKind,
};
pub use transition::{ContinuousMotion, MeasurementSensor, ProcessTransition, Sensor, Transition};
