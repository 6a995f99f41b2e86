//! The laws of `kalmems-models` with their derivatives.

use super::{LawId, disks};
use crate::numeric;
use kalmems_core::{Dual, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape, GaussianComb, TiltingPlate};
use kalmems_models::readout::CarrierDivider;

/// The most arguments of a law.
pub(crate) const MOST_ARGUMENTS: usize = 7;

/// The arguments of a law; those that it does not have are 0.
pub(crate) type LawArguments<S> = [S; MOST_ARGUMENTS];

/// A law over any numbers.
trait LawForm {
    /// Its value.
    fn value<S: Scalar>(a: &LawArguments<S>) -> S;

    /// Its derivative by the first argument.
    fn slope<S: Scalar>(a: &LawArguments<S>) -> S {
        let [slope] = Self::value(&seeded(a, 0)).gradient();
        slope
    }

    /// Its value and its first two derivatives by the first argument.
    fn along_first(a: &LawArguments<f64>) -> [f64; 3] {
        let slope = Self::slope(&seeded(a, 0));
        let [bend] = slope.gradient();
        [Self::value(a), slope.value(), bend]
    }
}

/// The arguments as dual numbers, of which one is the variable.
fn seeded<S: Scalar>(a: &LawArguments<S>, variable: u8) -> LawArguments<Dual<S, 1>> {
    let mut seeded = a.map(Dual::constant);
    if let Some((dual, value)) = seeded.get_mut(usize::from(variable)).zip(a.get(usize::from(variable))) {
        *dual = Dual::variable(*value, 0);
    }
    seeded
}

struct GaussianLaw;

fn gaussian<S: Scalar>(a: &LawArguments<S>) -> GaussianComb<S> {
    GaussianComb { nominal: a[1], angular_width: a[2], bias: a[3] }
}

impl LawForm for GaussianLaw {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        gaussian(a).capacitance(a[0])
    }
    fn slope<S: Scalar>(a: &LawArguments<S>) -> S {
        gaussian(a).slope(a[0])
    }
    fn along_first(a: &LawArguments<f64>) -> [f64; 3] {
        gaussian_along_first(a[0], a[1], a[2], a[3])
    }
}

/// The value, slope and curvature of the comb.
#[inline(always)]
#[allow(clippy::inline_always)] // within the interpreter's loop, where a call would cost as much as the rest
pub(crate) fn gaussian_along_first(angle: f64, nominal: f64, angular_width: f64, bias: f64) -> [f64; 3] {
    let comb = GaussianComb { nominal, angular_width, bias };
    [comb.capacitance(angle), comb.slope(angle), comb.curvature(angle)]
}

fn logistic<S: Scalar>(a: &LawArguments<S>) -> CombCurve<S> {
    CombCurve { centre: a[1], gain: a[2], steepness: a[3], shape: CurveShape::Logistic }
}

struct Logistic;

impl LawForm for Logistic {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        logistic(a).sensitivity(a[0])
    }
    fn along_first(a: &LawArguments<f64>) -> [f64; 3] {
        // Of s and its derivatives by u, s′ = e^{−|u|}/(1 + e^{−|u|})² and s″ = −2·s·s′: one exponential for all.
        let [angle, centre, gain, steepness, ..] = *a;
        let u = (angle - centre) * steepness;
        let left = Scalar::exp(-u.abs());
        let form = ((1.0 - left) / (1.0 + left)).half().copysign(u);
        let slope = gain * steepness * (left / ((1.0 + left) * (1.0 + left)));
        [form * gain, slope, -2.0 * steepness * form * slope]
    }
}

struct LogisticChange;

impl LawForm for LogisticChange {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        logistic(a).capacitance_change(a[0], a[4])
    }
    fn slope<S: Scalar>(a: &LawArguments<S>) -> S {
        logistic(a).slope(a[0], a[4])
    }
}

struct Tilting;

fn tilting<S: Scalar>(a: &LawArguments<S>) -> TiltingPlate<S> {
    // Along the axis the length alone counts while the plate tilts about that axis.
    let half = a[3].half();
    TiltingPlate { w1: a[1], w2: a[2], w3: -half, w4: half, gap: a[4], permittivity: a[5] }
}

impl LawForm for Tilting {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        tilting(a).capacitance(a[0])
    }
    fn slope<S: Scalar>(a: &LawArguments<S>) -> S {
        tilting(a).slope(a[0])
    }
    fn along_first(a: &LawArguments<f64>) -> [f64; 3] {
        // Of the angle alone: the plate is not seeded.
        let plate = tilting(a);
        let slope = plate.slope(Dual::<f64, 1>::variable(a[0], 0));
        let [bend] = slope.gradient();
        [plate.capacitance(a[0]), slope.value(), bend]
    }
}

struct CarrierLaw;

impl LawForm for CarrierLaw {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        let divider = CarrierDivider {
            excitation: a[1],
            carrier_rate: a[2],
            shunt_conductance: a[3],
            parallel_capacitance: a[4],
            input_conductance: a[5],
            blocking_capacitance: a[6],
        };
        divider.voltage(a[0])
    }
}

struct Disks;

impl LawForm for Disks {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        disks::capacitance(a[0], a[1])
    }
}

struct Atanhc;

impl LawForm for Atanhc {
    fn value<S: Scalar>(a: &LawArguments<S>) -> S {
        numeric::atanhc(a[0])
    }
}

macro_rules! of_law {
    ($law:expr, $function:ident, $arguments:expr) => {
        match $law {
            LawId::GaussianComb => GaussianLaw::$function($arguments),
            LawId::LogisticComb => Logistic::$function($arguments),
            LawId::LogisticCombChange => LogisticChange::$function($arguments),
            LawId::TiltingPlate => Tilting::$function($arguments),
            LawId::Carrier => CarrierLaw::$function($arguments),
            LawId::Disks => Disks::$function($arguments),
            LawId::Atanhc => Atanhc::$function($arguments),
        }
    };
}

/// The value and the first two derivatives by the first argument.
#[inline(never)]
pub(crate) fn along_first(law: LawId, a: &LawArguments<f64>) -> [f64; 3] {
    of_law!(law, along_first, a)
}

/// The same of a law with four arguments or fewer.
#[inline(never)]
pub(crate) fn along_first_of_four(law: LawId, a: f64, b: f64, c: f64, d: f64) -> [f64; 3] {
    of_law!(law, along_first, &[a, b, c, d, 0.0, 0.0, 0.0])
}

/// A derivative by the arguments that `by` lists in order; not a number where there is none of this order.
#[inline(never)]
pub(crate) fn partial(law: LawId, by: &[u8], a: &LawArguments<f64>) -> f64 {
    let first = |dual: Dual<f64, 1>| dual.gradient()[0];
    let second = |dual: Dual<Dual<f64, 1>, 1>| dual.gradient()[0].gradient()[0];
    match *by {
        [] => of_law!(law, value, a),
        [0] => of_law!(law, slope, a),
        [i] => first(of_law!(law, value, &seeded(a, i))),
        [0, i] => first(of_law!(law, slope, &seeded(a, i))),
        [i, j] => second(of_law!(law, value, &seeded(&seeded(a, i), j))),
        [0, i, j] => second(of_law!(law, slope, &seeded(&seeded(a, i), j))),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logistic_comb_at_once_is_that_of_dual_numbers() {
        for angle in [-9.0, -0.7, -0.02, 0.0037, 0.0038, 0.05, 3.0] {
            let arguments = [angle, 0.0037, 2.82e-3, -76.0, 0.0, 0.0, 0.0];
            let by = |by: &[u8]| partial(LawId::LogisticComb, by, &arguments);
            let expected = [by(&[]), by(&[0]), by(&[0, 0])];
            for (found, expected) in Logistic::along_first(&arguments).into_iter().zip(expected) {
                let error = (found - expected).abs();
                assert!(error <= 4e-14 * expected.abs(), "{angle}: {found} and not {expected}");
            }
        }
    }
}
