use super::*;
use approx::assert_relative_eq;
use kalmems_core::{Over, Scalar};

/// y = a·e^{−b·t} + c, where a product a·d stands for a if asked.
struct ExponentialDecay {
    y: Vec<f64>,
}

impl ExponentialDecay {
    fn new(noise: f64) -> Self {
        // A fixed wave instead of random numbers: what matters is that it is no decay.
        let y = (0..60)
            .map(|k| {
                let t = 0.1 * f64::from(k);
                2.0 * (-0.8 * t).exp() + 0.5 + noise * (1.7 * f64::from(k * k)).sin()
            })
            .collect();
        Self { y }
    }
}

impl ResidualLaw<3> for ExponentialDecay {
    fn residuals<S: Over<f64>>(&self, p: &[S; 3], each: &mut impl FnMut(S)) {
        for (k, y) in self.y.iter().enumerate() {
            each(p[0] * (-(p[1] * (0.1 * k as f64))).exp() + p[2] - *y);
        }
    }
}

/// The same with an amplitude that is a product: one of the two cannot be known.
struct Product(ExponentialDecay);

impl ResidualLaw<4> for Product {
    fn residuals<S: Over<f64>>(&self, p: &[S; 4], each: &mut impl FnMut(S)) {
        self.0.residuals(&[p[0] * p[3], p[1], p[2]], each);
    }
}

/// A line that no number tells the squares of.
struct Steep;

impl ResidualLaw<1> for Steep {
    fn residuals<S: Over<f64>>(&self, p: &[S; 1], each: &mut impl FnMut(S)) {
        (0..60).for_each(|_| each(p[0] * 1e200 - 1.0));
    }
}

const TRUTH: [f64; 3] = [2.0, 0.8, 0.5];

#[test]
fn a_held_parameter_stays_and_has_no_deviation() {
    let settings = FitSettings { free: [true, false, true], ..FitSettings::from_start([1.0, 0.8, 0.0]) };
    let found = fit(&ByDual(ExponentialDecay::new(0.0)), &settings).unwrap();
    for (ours, truth) in found.parameters.iter().zip(TRUTH) {
        assert_relative_eq!(*ours, truth, max_relative = 1e-12);
    }
    assert_eq!(found.covariance.get(1, 1), 0.0);
    assert_eq!(found.degrees_of_freedom, 58);
}

#[test]
fn a_bound_stops_a_parameter_and_the_others_go_on() {
    let mut settings = FitSettings::from_start([1.0, 0.3, 0.0]);
    settings.bounds[1] = ParameterBounds { low: 0.0, high: 0.6 };
    let found = fit(&ByDual(ExponentialDecay::new(0.0)), &settings).unwrap();
    assert_eq!(found.parameters[1], 0.6);
    assert_eq!(found.at_bound, [false, true, false]);
    // The best of the rest is that of a fit with the parameter held there.
    let held = FitSettings { free: [true, false, true], ..FitSettings::from_start([1.0, 0.6, 0.0]) };
    let there = fit(&ByDual(ExponentialDecay::new(0.0)), &held).unwrap();
    assert_relative_eq!(found.parameters[0], there.parameters[0], max_relative = 1e-9);
    assert_relative_eq!(found.parameters[2], there.parameters[2], max_relative = 1e-9);
    // A bound that does not bind changes nothing.
    settings.bounds[1].high = 2.0;
    let inside = fit(&ByDual(ExponentialDecay::new(0.0)), &settings).unwrap();
    assert_relative_eq!(inside.parameters[1], 0.8, max_relative = 1e-10);
    assert_eq!(inside.at_bound, [false; 3]);
}

#[test]
fn what_is_not_determined_is_named() {
    let law = ByDual(Product(ExponentialDecay::new(0.01)));
    let found = fit(&law, &FitSettings::from_start([1.0, 1.0, 0.0, 1.5])).unwrap();
    assert_eq!(found.undetermined.len(), 1);
    // The two columns are proportional: the direction takes one up and the other down by as much.
    let parts = found.undetermined[0].parts;
    assert_relative_eq!(parts[0], -parts[3], max_relative = 1e-6);
    assert_relative_eq!(parts[0].abs(), 0.5_f64.sqrt(), max_relative = 1e-6);
    assert!(parts[1].abs() < 1e-7 && parts[2].abs() < 1e-7);
    assert_eq!(found.parameter(0).deviation, f64::INFINITY);
    assert_eq!(found.parameter(3).deviation, f64::INFINITY);
    // What is determined is known as well as without the double parameter.
    let plain = fit(&ByDual(ExponentialDecay::new(0.01)), &FitSettings::from_start([1.0, 1.0, 0.0])).unwrap();
    let ratio = plain.degrees_of_freedom as f64 / found.degrees_of_freedom as f64;
    assert_relative_eq!(
        found.parameter(1).deviation,
        plain.parameter(1).deviation * ratio.sqrt(),
        max_relative = 1e-4
    );
    assert_relative_eq!(found.parameters[0] * found.parameters[3], plain.parameters[0], max_relative = 1e-6);
}

#[test]
fn a_derived_number_carries_the_correlation() {
    let found = fit(&ByDual(ExponentialDecay::new(0.05)), &FitSettings::from_start([1.0, 1.0, 0.0])).unwrap();
    let sum = found.derived(|p| p[0] + p[2].twice());
    let c = &found.covariance;
    assert_relative_eq!(
        sum.deviation,
        (c.get(0, 0) + 4.0 * c.get(0, 2) + 4.0 * c.get(2, 2)).sqrt(),
        max_relative = 1e-12
    );
}

#[test]
fn a_profile_of_a_linear_parameter_is_its_deviation() {
    // c enters linearly and a does with b held: there the sum of squares is a parabola.
    let law = ByDual(ExponentialDecay::new(0.05));
    let settings = FitSettings { free: [true, false, true], ..FitSettings::from_start([1.0, 0.8, 0.0]) };
    let found = fit(&law, &settings).unwrap();
    for deviations in [1.0, 2.0] {
        let [low, high] = profile(&law, &settings, &found, 2, deviations).unwrap();
        let half = deviations * found.parameter(2).deviation;
        assert_relative_eq!(low.unwrap(), found.parameters[2] - half, max_relative = 1e-5);
        assert_relative_eq!(high.unwrap(), found.parameters[2] + half, max_relative = 1e-5);
    }
    // The rate is nonlinear: its interval is lopsided, longer upwards.
    let all = FitSettings::from_start([1.0, 1.0, 0.0]);
    let found = fit(&law, &all).unwrap();
    let [low, high] = profile(&law, &all, &found, 1, 2.0).unwrap().map(Option::unwrap);
    assert!(high - found.parameters[1] > 1.01 * (found.parameters[1] - low));
    // What the data do not determine has no end.
    let product = ByDual(Product(ExponentialDecay::new(0.05)));
    let all = FitSettings::from_start([1.0, 1.0, 0.0, 1.5]);
    let found = fit(&product, &all).unwrap();
    assert_eq!(profile(&product, &all, &found, 3, 1.0).unwrap()[1], None);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let law = ByDual(ExponentialDecay { y: vec![1.0, 2.0] });
    let from = FitSettings::from_start;
    assert_eq!(fit(&law, &from([1.0; 3])), Err(FitError::TooFew { residuals: 2, parameters: 3 }));
    let mut y = vec![1.0; 10];
    y[4] = f64::NAN;
    let refused = fit(&ByDual(ExponentialDecay { y }), &from([1.0; 3])).unwrap_err();
    assert_eq!(refused, FitError::NotFiniteAtStart { index: 4, start: vec![1.0; 3] });
    let mut settings = from([1.0; 3]);
    settings.bounds[2] = ParameterBounds { low: 2.0, high: 3.0 };
    let refused = fit(&ByDual(ExponentialDecay::new(0.0)), &settings).unwrap_err();
    assert_eq!(refused, FitError::OutsideBounds { index: 2, start: 1.0, low: 2.0, high: 3.0 });
    // Slopes whose length no number holds give no step a length.
    assert!(matches!(
        fit(&ByDual(Steep), &FitSettings::from_start([0.0])),
        Err(FitError::NotConverged { .. })
    ));
    let hurried = FitSettings { iterations: 1, ..from([20.0, 5.0, 9.0]) };
    assert!(matches!(fit(&ByDual(ExponentialDecay::new(0.0)), &hurried), Err(FitError::NotConverged { .. })));
}
