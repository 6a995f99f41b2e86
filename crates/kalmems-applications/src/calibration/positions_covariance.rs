//! The covariance matrix of the numbers that positions determine.

use super::positions::{Dual9, GyroscopeFit, accelerometer_matrix, alignment_numbers, gyroscope_matrix};
use super::quantities::{CalibratedQuantity, QuantityCovariance};
use super::tone::AXES;
use crate::fit::Fit;
use crate::metrology::{Evaluation, Input};

/// The pairs of axes of the three angles between them.
pub(super) const PAIRS: [&str; 3] = ["xy", "xz", "yz"];

/// A number as a linear function of errors that are independent of one another but for the covariances of each fit.
struct LinearNumber {
    name: String,
    /// The derivatives by the accelerometers' parameters, and by the gyroscopes' parameters as far as the motions determine them.
    by_forces: [f64; 9],
    by_motions: [f64; 9],
    /// The axis of a gyroscope and the parameter of the fit of its means at rest.
    of_rest: Option<[usize; 2]>,
}

/// The covariances of the numbers of a record of positions, from their fits; of inputs from elsewhere, one with the same name is the same error.
pub(super) fn covariance_of_positions(
    quantities: &[CalibratedQuantity],
    forces: &Fit<9>,
    motions: Option<&GyroscopeFit>,
    rests: Option<&[Fit<4>; 3]>,
) -> QuantityCovariance {
    let numbers = linear_numbers(forces, motions);
    let known: Vec<(&CalibratedQuantity, &LinearNumber)> = quantities
        .iter()
        .filter_map(|own| Some((own, numbers.iter().find(|number| number.name == own.name)?)))
        .collect();
    let entry = |(first, a): &(&CalibratedQuantity, &LinearNumber),
                 (second, b): &(&CalibratedQuantity, &LinearNumber)| {
        let mut sum = 0.0;
        for i in 0..9 {
            for j in 0..9 {
                sum += a.by_forces[i] * forces.covariance.get(i, j) * b.by_forces[j];
                if let Some(motions) = motions {
                    sum += a.by_motions[i] * motions.fit.covariance.get(i, j) * b.by_motions[j];
                }
            }
        }
        if let (Some(rests), Some([axis, i]), Some([other, j])) = (rests, a.of_rest, b.of_rest)
            && axis == other
        {
            sum += rests[axis].covariance.get(i, j);
        }
        for input in first.budget.iter().filter(|input| input.evaluation == Evaluation::B) {
            let same = second.budget.iter().find(|other| other.name == input.name);
            let size = |of: &Input| of.sensitivity * of.standard_uncertainty;
            sum += same.map_or(0.0, |same| size(input) * size(same));
        }
        sum
    };
    QuantityCovariance {
        parameters: known.iter().map(|(own, _)| own.name.clone()).collect(),
        matrix: known.iter().map(|own| known.iter().map(|other| entry(own, other)).collect()).collect(),
    }
}

/// All numbers of positions with their derivatives.
fn linear_numbers(forces: &Fit<9>, motions: Option<&GyroscopeFit>) -> Vec<LinearNumber> {
    let mut numbers = Vec::new();
    let at = Dual9::variables(&forces.parameters);
    let mut push = |name: String, by_forces: [f64; 9], by_motions: [f64; 9], of_rest| {
        numbers.push(LinearNumber { name, by_forces, by_motions, of_rest });
    };
    let kinds = [("scale_factor", AXES), ("non_orthogonality", PAIRS), ("mounting", AXES)];
    let of_forces = alignment_numbers(&accelerometer_matrix(&at));
    for ((what, names), row) in kinds.into_iter().zip(of_forces).take(2) {
        for (name, number) in names.into_iter().zip(row) {
            push(format!("accelerometer_{what}_{name}"), number.gradient(), [0.0; 9], None);
        }
    }
    for (axis, name) in AXES.into_iter().enumerate() {
        push(format!("accelerometer_bias_{name}"), at[6 + axis].gradient(), [0.0; 9], None);
    }
    if let Some(motions) = motions {
        let of_motions = alignment_numbers(&gyroscope_matrix(&Dual9::variables(&motions.fit.parameters)));
        for ((what, names), row) in kinds.into_iter().zip(of_motions) {
            for (name, number) in names.into_iter().zip(row) {
                let gradient = number.gradient();
                let by_forces =
                    std::array::from_fn(|j| (0..9).map(|i| gradient[i] * motions.response.0[i][j]).sum());
                push(format!("gyroscope_{what}_{name}"), by_forces, gradient, None);
            }
        }
    }
    for (axis, name) in AXES.into_iter().enumerate() {
        push(format!("gyroscope_bias_{name}"), [0.0; 9], [0.0; 9], Some([axis, 0]));
        for (place, along) in AXES.into_iter().enumerate() {
            let name = format!("gyroscope_force_sensitivity_{name}{along}");
            push(name, [0.0; 9], [0.0; 9], Some([axis, 1 + place]));
        }
    }
    numbers
}
