//! Models of one device with other parameters, side by side.

use super::PlainModel;
use crate::estimate::{DeviceParameter, Tracked};
use kalmems_core::Parameters;

/// Where a parameter enters a motion, and where a readout.
pub type ParameterPlaces = [fn(&DeviceParameter) -> Option<&'static str>; 2];

/// By how much each of these parameters is off in each of several models: as stated, and by its deviation to both sides, in all
/// combinations.
pub fn combinations(tracked: &[Tracked]) -> Vec<Vec<f64>> {
    let mut shifts: Vec<Vec<f64>> = vec![Vec::new()];
    for tracked in tracked {
        let off = tracked.sd * tracked.added.scale;
        shifts = [0.0, -off, off]
            .into_iter()
            .flat_map(|shift| shifts.iter().map(move |before| [&before[..], &[shift]].concat()))
            .collect();
    }
    shifts
}

/// A model whose parameters are off by so much; `place` says where each enters it, if it does.
pub fn shifted<M: Parameters<f64, Of<f64> = M>>(
    model: &M,
    (tracked, shifts): (&[Tracked], &[f64]),
    place: fn(&DeviceParameter) -> Option<&'static str>,
) -> M {
    let enters = |parameter: &DeviceParameter| place(parameter).and_then(M::index_of);
    let off = |index: usize| -> f64 {
        let moved = tracked.iter().zip(shifts).filter(|(t, _)| enters(t.parameter) == Some(index));
        moved.map(|(_, shift)| shift).sum()
    };
    model.map(|index, value| value + off(index))
}

/// The model with these parameters in all [`combinations`].
pub fn side_by_side<D, H, const M: usize>(
    plain: &PlainModel<D, H, M>,
    tracked: &[Tracked],
    [in_motion, in_readout]: ParameterPlaces,
) -> Vec<PlainModel<D, H, M>>
where
    D: Parameters<f64, Of<f64> = D>,
    H: Parameters<f64, Of<f64> = H>,
{
    let one = |shifts: Vec<f64>| PlainModel {
        dynamics: shifted(&plain.dynamics, (tracked, &shifts), in_motion),
        readout: shifted(&plain.readout, (tracked, &shifts), in_readout),
        noise: plain.noise,
    };
    combinations(tracked).into_iter().map(one).collect()
}
