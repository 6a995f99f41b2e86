//! Evaluation: trajectories against an independent reference.
//!
//! This is the only place that reads a reference. Nothing flows from here to an estimate.

mod angle;
mod beam;
mod budget;
mod channels;
mod claim;
mod edge;
mod grade;
mod innovations;
mod judge;
mod lag;
mod parameter;
mod parts;
mod pool;
mod reference;
mod reference_parts;
mod rejections;
mod smoothed;
mod step_errors;
mod value;

pub use angle::{
    AngleErrors, ComparisonExtent, ErrorSeries, MotionErrors, PhasePoint, evaluate_angles, evaluate_motion,
    mean_phase_shift,
};
pub use beam::BeamPosition;
pub use budget::{DeviceUncertainty, UncertaintyBudget};
pub use channels::{Instruments, ReferenceChannels};
pub use claim::{Accuracy, Claim, ErrorDecomposition};
pub use edge::EdgeVelocity;
pub use grade::Grade;
pub use innovations::{
    CycleEvidence, InnovationEvidence, InnovationHistogram, InnovationRecord, InnovationTest, SpectrumGroup,
    TestPlace, TestResult, WRONG, nis, normal_tail,
};
pub use judge::{Judgement, SegmentJudge};
pub use lag::ReferenceLag;
pub use parameter::{ParameterAnswer, ParameterFault};
pub use parts::PartErrors;
pub use reference::{ONE_ANGLE, ReferenceError, ReferenceMotion, ReferenceRecording};
pub use reference_parts::ReferenceParts;
pub use rejections::{OpenGate, Outlier, RejectionFault, Rejections};
pub use step_errors::{StepErrorRecord, StepErrors};
pub use value::{ErrorsByState, ValueErrors, ValueReference, ValueState, evaluate_values};

/// More digits of a probability mean nothing, and are not the same on every machine.
#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn three_digits<S: serde::Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(format!("{value:.2e}").parse().unwrap_or(*value))
}
