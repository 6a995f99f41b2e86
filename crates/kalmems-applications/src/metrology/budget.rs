//! Combining inputs.

use super::input::{Input, or_null};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// The inputs of one result, and how their errors hang together.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Budget {
    /// The inputs.
    pub inputs: Vec<Input>,
    /// Correlations other than 0: the places of two inputs, and their correlation.
    pub correlations: Vec<(usize, usize, f64)>,
}

/// An uncertainty in full.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Combined {
    /// u_c, the combined standard uncertainty.
    pub standard_uncertainty: f64,
    /// ν_eff, the effective degrees of freedom; `null` in JSON where they are infinite.
    #[serde(serialize_with = "or_null")]
    pub degrees_of_freedom: f64,
    /// The probability with which the interval holds the value.
    pub probability: f64,
    /// k, the quantile of the t distribution with ν_eff.
    pub coverage_factor: f64,
    /// U = k·u_c.
    pub expanded_uncertainty: f64,
}

/// The factor by which a standard uncertainty with these degrees of freedom becomes one that holds with this probability.
///
/// The two-sided quantile of the t distribution (JCGM 100, G.3.2); of the normal one from 10⁶ degrees of freedom on.
pub fn coverage_factor(probability: f64, degrees_of_freedom: f64) -> f64 {
    let part = 0.5 + 0.5 * probability;
    match StudentsT::new(0.0, 1.0, degrees_of_freedom) {
        Ok(law) if degrees_of_freedom < 1e6 => law.inverse_cdf(part),
        _ => Normal::standard().inverse_cdf(part),
    }
}

/// The probability with which an interval of so many standard uncertainties with these degrees of freedom holds the value.
pub fn coverage_probability(coverage_factor: f64, degrees_of_freedom: f64) -> f64 {
    let below = match StudentsT::new(0.0, 1.0, degrees_of_freedom) {
        Ok(law) if degrees_of_freedom < 1e6 => law.cdf(coverage_factor),
        _ => Normal::standard().cdf(coverage_factor),
    };
    2.0 * below - 1.0
}

impl Combined {
    /// A standard uncertainty with these degrees of freedom, expanded to this probability.
    pub fn of(standard_uncertainty: f64, degrees_of_freedom: f64, probability: f64) -> Self {
        let coverage_factor = coverage_factor(probability, degrees_of_freedom);
        Self {
            standard_uncertainty,
            degrees_of_freedom,
            probability,
            coverage_factor,
            expanded_uncertainty: coverage_factor * standard_uncertainty,
        }
    }
}

impl Budget {
    /// Whether an input is one whose error hangs together with that of another.
    fn is_correlated(&self, place: usize) -> bool {
        self.correlations.iter().any(|(i, j, r)| *r != 0.0 && (*i == place || *j == place))
    }

    /// u_c² = Σᵢ Σⱼ cᵢ·cⱼ·uᵢ·uⱼ·rᵢⱼ (JCGM 100, 5.2.2).
    pub fn variance(&self) -> f64 {
        let own: f64 = self.inputs.iter().map(|input| input.contribution().powi(2)).sum();
        let part = |place: usize| self.inputs.get(place).map_or(0.0, Input::contribution);
        let shared: f64 = self.correlations.iter().map(|(i, j, r)| 2.0 * r * part(*i) * part(*j)).sum();
        // Of a negative sum, which rounding leaves where errors cancel, there is no root.
        (own + shared).max(0.0)
    }

    /// The result's uncertainty.
    ///
    /// ν_eff = u_c⁴/Σ(uᵢ⁴/νᵢ) is the formula of Welch and Satterthwaite for independent inputs (JCGM 100, G.4.1). Correlated ones, for
    /// which the guide has none, count as one input with their common variance and the fewest degrees of freedom among them.
    pub fn combined(&self, probability: f64) -> Combined {
        let variance = self.variance();
        let fourth = |variance: f64, freedom: f64| variance * variance / freedom;
        let (mut alone, mut sum) = (0.0, 0.0);
        let mut fewest = f64::INFINITY;
        for (place, input) in self.inputs.iter().enumerate() {
            if self.is_correlated(place) {
                fewest = fewest.min(input.degrees_of_freedom);
            } else {
                let own = input.contribution().powi(2);
                alone += own;
                sum += fourth(own, input.degrees_of_freedom);
            }
        }
        sum += fourth((variance - alone).max(0.0), fewest);
        let freedom = if sum > 0.0 { variance * variance / sum } else { f64::INFINITY };
        Combined::of(variance.sqrt(), freedom, probability)
    }

    /// The inputs that make up most of the variance, by name, each with its part of u_c², largest first.
    pub fn shares(&self) -> Vec<(&str, f64)> {
        let all: f64 = self.inputs.iter().map(|input| input.contribution().powi(2)).sum();
        let mut shares: Vec<(&str, f64)> = self
            .inputs
            .iter()
            .map(|input| (input.name.as_str(), input.contribution().powi(2) / all.max(f64::MIN_POSITIVE)))
            .collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        shares
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Distribution, Evaluation};
    use super::*;

    fn input(name: &str, sensitivity: f64, standard_uncertainty: f64, degrees_of_freedom: f64) -> Input {
        Input {
            name: name.to_owned(),
            unit: "1",
            value: 1.0,
            standard_uncertainty,
            distribution: Distribution::Normal,
            degrees_of_freedom,
            evaluation: Evaluation::B,
            source: String::new(),
            sensitivity,
        }
    }

    fn of(inputs: Vec<Input>) -> Budget {
        Budget { inputs, correlations: Vec::new() }
    }

    /// JCGM 100:2008, H.1: the end gauge, in nm and as in Table H.1: u_c = 32 nm, ν_eff = 16, t₉₉ = 2.92, U₉₉ = 93 nm.
    #[test]
    fn the_end_gauge_of_the_guide_comes_out_as_printed() {
        let parts = [
            ("standard", 25.0, 18.0),
            ("repeated readings", 5.8, 24.0),
            ("comparator, random", 3.9, 5.0),
            ("comparator, systematic", 6.7, 8.0),
            ("expansion coefficient", 2.9, 50.0),
            ("temperatures", 16.6, 2.0),
        ];
        let inputs = parts.map(|(name, u, freedom)| input(name, 1.0, u, freedom)).to_vec();
        let found = of(inputs).combined(0.99);
        assert!((found.standard_uncertainty - 31.7).abs() < 0.5, "{found:?}");
        // The guide truncates to 16.
        assert!((16.0..17.5).contains(&found.degrees_of_freedom), "{found:?}");
        assert!((coverage_factor(0.99, 16.0) - 2.92).abs() < 0.005);
        assert!((found.expanded_uncertainty - 93.0).abs() < 2.0, "{found:?}");
    }

    /// JCGM 100:2008, H.2: resistance, reactance and impedance from the same five readings, with the correlations of Table H.2:
    /// u_c(R) = 0.071 Ω, u_c(X) = 0.295 Ω, u_c(Z) = 0.236 Ω.
    #[test]
    fn the_impedance_of_the_guide_comes_out_with_its_correlations() {
        let (v, i, phi) = (4.9990_f64, 19.6610e-3_f64, 1.044_46_f64);
        let u = [0.0032, 9.471e-6, 752.1e-6];
        let correlations = vec![(0, 1, -0.355), (0, 2, 0.858), (1, 2, -0.645)];
        let uncertainty = |c: [f64; 3]| {
            let inputs = (0..3).map(|k| input(["V", "I", "phi"][k], c[k], u[k], f64::INFINITY)).collect();
            Budget { inputs, correlations: correlations.clone() }.combined(0.95).standard_uncertainty
        };
        let (sine, cosine) = phi.sin_cos();
        let of_r = uncertainty([cosine / i, -v * cosine / (i * i), -v / i * sine]);
        let of_x = uncertainty([sine / i, -v * sine / (i * i), v / i * cosine]);
        let of_z = uncertainty([1.0 / i, -v / (i * i), 0.0]);
        for (found, printed) in [(of_r, 0.071), (of_x, 0.295), (of_z, 0.236)] {
            assert!((found / printed - 1.0).abs() < 0.01, "{found} {printed}");
        }
    }

    #[test]
    fn one_input_has_its_own_degrees_of_freedom_and_exact_ones_have_the_normal_factor() {
        let found = of(vec![input("a", 2.0, 3.0, 7.0)]).combined(0.95);
        assert!((found.degrees_of_freedom - 7.0).abs() < 1e-12 && found.standard_uncertainty == 6.0);
        assert!((found.coverage_factor - 2.364_624_25).abs() < 1e-6, "{found:?}");
        let found = of(vec![input("a", 1.0, 1.0, f64::INFINITY)]).combined(0.95);
        assert!((found.coverage_factor - 1.959_964).abs() < 1e-6 && found.degrees_of_freedom.is_infinite());
        assert!(of(Vec::new()).combined(0.95).expanded_uncertainty == 0.0);
    }

    #[test]
    fn errors_that_cancel_leave_nothing() {
        let mut budget = of(vec![input("a", 1.0, 2.0, 5.0), input("b", -1.0, 2.0, 9.0)]);
        budget.correlations.push((0, 1, 1.0));
        assert!(budget.combined(0.95).standard_uncertainty < 1e-12);
        budget.correlations[0].2 = -1.0;
        let found = budget.combined(0.95);
        assert!((found.standard_uncertainty - 4.0).abs() < 1e-12);
        // As one input, with the fewest degrees of freedom.
        assert!((found.degrees_of_freedom - 5.0).abs() < 1e-12, "{found:?}");
        assert_eq!(budget.shares()[0].1, 0.5);
    }
}
