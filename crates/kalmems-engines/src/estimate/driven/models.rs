//! Models of one device with other parameters, side by side.

use super::Plain;
use crate::estimate::{Parameter, Tracked};
use kalmems_core::Parameters;

/// Where a parameter enters a motion, and where a readout.
pub type Enters = [fn(&Parameter) -> Option<&'static str>; 2];

/// The model with each of these parameters as stated, and off by its deviation to both sides, in all combinations.
pub fn side_by_side<D, H, const M: usize>(
    plain: &Plain<D, H, M>,
    tracked: &[Tracked],
    [in_motion, in_readout]: Enters,
) -> Vec<Plain<D, H, M>>
where
    D: Parameters<f64, Of<f64> = D>,
    H: Parameters<f64, Of<f64> = H>,
{
    let mut shifts: Vec<Vec<f64>> = vec![Vec::new()];
    for tracked in tracked {
        let off = tracked.sd * tracked.added.scale;
        shifts = [0.0, -off, off]
            .into_iter()
            .flat_map(|shift| shifts.iter().map(move |before| [&before[..], &[shift]].concat()))
            .collect();
    }
    let one = |shifts: &Vec<f64>| {
        let off = |index: usize, place: &dyn Fn(&Parameter) -> Option<usize>| -> f64 {
            let moved = tracked.iter().zip(shifts).filter(|(t, _)| place(t.parameter) == Some(index));
            moved.map(|(_, shift)| shift).sum()
        };
        let motion = |parameter: &Parameter| in_motion(parameter).and_then(D::index_of);
        let readout = |parameter: &Parameter| in_readout(parameter).and_then(H::index_of);
        Plain {
            dynamics: plain.dynamics.map(|index, value| value + off(index, &motion)),
            readout: plain.readout.map(|index, value| value + off(index, &readout)),
            noise: plain.noise,
        }
    };
    shifts.iter().map(one).collect()
}
