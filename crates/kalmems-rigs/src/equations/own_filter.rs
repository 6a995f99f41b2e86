//! A filter of the caller's own instead of the experiment's.

use super::segment::EquationEstimator;
use crate::config::{Experiment, Method};
use crate::estimate::{AnyFilter, EstimateError, MeanAndCovariance, SegmentEstimate, StateFilter};
use crate::progress::Progress;
use crate::recording::SampledRecording;
use kalmems_core::{Covariance, Gaussian, SigmaPoints};
use kalmems_engines::rig::estimate_by;
use std::cell::RefCell;

/// What makes it from what is known first.
pub type OwnFilter = RefCell<Option<Box<dyn FnOnce(MeanAndCovariance) -> AnyFilter>>>;

/// Follows a filter of the caller's own over a recording, instead of the experiment's one filter.
///
/// All but the filter is as the experiment has it: the device with its process noise, the inputs between the samples, samples that are missing,
/// name and start of the filter, its smoothers, the sign of the motion and the judgement of its lock. `make` makes the filter from the first mean
/// and covariance, and from how the experiment's filter spreads sigma points. A filter of another kind, or with another rule of adaptation, is so compared with those of the program by itself alone.
///
/// # Errors
///
/// Those of an estimate, and a table of filters that is not of one filter with a process and as many states.
///
/// ```
/// use kalmems_core::SquareRootEkf;
/// use kalmems_engines::{progress::Silent, recording::SampledRecording};
/// use kalmems_rigs::equations::estimate_with;
/// # use std::path::Path;
///
/// # let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// let mut experiment = kalmems_rigs::published().load(&root.join("examples/shared_scanner/experiment.toml"))?;
/// experiment.estimate.iter_mut().for_each(|estimate| estimate.filters.retain(|filter| filter.name.as_str() == "EKF"));
/// let file = experiment.resolve(&experiment.recording(0)?.file);
/// let recording = SampledRecording::read(&file, &kalmems_rigs::published().rig(&experiment)?.layout(&experiment, 0)?)?;
/// let found = estimate_with::<_, 2>(&experiment, 0, &recording, |mean, covariance, _| SquareRootEkf::new(mean, covariance), &Silent)?;
/// assert!(found[0].trajectories[0].failure.is_none() && found[0].trajectories[0].lock.events.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn estimate_with<F: StateFilter<N> + 'static, const N: usize>(
    experiment: &Experiment,
    index: usize,
    recording: &SampledRecording,
    make: impl FnOnce([f64; N], Covariance<f64, N>, SigmaPoints<f64>) -> F + 'static,
    progress: &dyn Progress,
) -> Result<Vec<SegmentEstimate>, EstimateError>
where
    AnyFilter: From<Box<dyn StateFilter<N>>>,
{
    let mut estimator = EquationEstimator::of(experiment, index, progress)?;
    let wrong = |filter: &str, found: String| EstimateError::OtherStates {
        filter: filter.to_owned(),
        found,
        expected: N,
    };
    let [filter] = &*estimator.settings.filters else {
        let names: Vec<&str> = estimator.settings.filters.iter().map(|filter| &*filter.basics.name).collect();
        return Err(wrong(&names.join("`, `"), format!("{} filters", names.len())));
    };
    let basics = &filter.basics;
    let states = basics.states(filter.own.states()).len();
    let found = match basics.method {
        _ if !basics.method.claims() => Some("a method without a process".to_owned()),
        Method::Bank => Some("several models".to_owned()),
        _ if states != N => Some(format!("{states} states")),
        _ => None,
    };
    if let Some(found) = found {
        return Err(wrong(&basics.name, found));
    }
    let points = basics.points;
    estimator.own_filter = RefCell::new(Some(Box::new(move |first: MeanAndCovariance| {
        let Gaussian { mean, covariance } = first.gaussian();
        AnyFilter::this(make(mean, covariance, points))
    })));
    Ok(estimate_by(&mut estimator, recording)?.0)
}
