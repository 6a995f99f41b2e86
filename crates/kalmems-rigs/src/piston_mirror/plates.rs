//! The electrodes, and the distance that a capacitance means.

use kalmems_models::capacitance::DistanceSeries;

/// The most coefficients that a series may have here: powers 0 to 8.
pub const COEFFICIENTS: usize = 9;

/// C(d) of the device.
pub type Plates = DistanceSeries<f64, COEFFICIENTS>;

/// The farthest that plates can be in reference distances, and the nearest: 1/64.
const REACH: f64 = 64.0;
/// The factor between two distances of the search outwards.
const STRIDE: f64 = 1.25;
/// Enough halvings to separate all numbers of that range.
const STEPS: usize = 200;

/// The distance in m at which the plates have this capacitance in F: two distances around it are searched outwards from
/// that of the reference, and Newton's method goes on between them. `None` where the capacitance stops to fall with
/// the distance before it is reached, as a series does somewhere outside its table, or beyond 1/64 to 64 times the
/// reference distance.
pub fn distance_at(plates: &Plates, capacitance: f64) -> Option<f64> {
    let unit = plates.reference_distance;
    let falls = |distance: f64| plates.slope(distance) < 0.0;
    if !(capacitance.is_finite() && falls(unit)) {
        return None;
    }
    let (mut near, mut far) = (unit, unit);
    while plates.capacitance(near) < capacitance {
        near /= STRIDE;
        if !falls(near) || near * REACH < unit {
            return None;
        }
    }
    while plates.capacitance(far) > capacitance {
        far *= STRIDE;
        if !falls(far) || far > unit * REACH {
            return None;
        }
    }
    let mut distance = near.midpoint(far);
    // In the inverse distance the law is nearly straight.
    for _ in 0..STEPS {
        let excess = plates.capacitance(distance) - capacitance;
        if excess > 0.0 {
            near = distance;
        } else {
            far = distance;
        }
        // dC/d(1/d) = −d²·dC/dd.
        let slope = -distance * distance * plates.slope(distance);
        let newton = (distance.recip() - excess / slope).recip();
        let next = if newton > near && newton < far { newton } else { near.midpoint(far) };
        if (next - distance).abs() <= 1e-15 * distance {
            return (slope > 0.0).then_some(next);
        }
        distance = next;
    }
    (plates.slope(distance) < 0.0).then_some(distance)
}

/// The least and the largest capacitance in F that the plates have between two distances in m, or, where one is without
/// limit, as far as [`distance_at`] looks.
pub fn capacitance_range(plates: &Plates, [nearest, farthest]: [f64; 2]) -> [f64; 2] {
    let unit = plates.reference_distance;
    let end = |stride: f64, limit: f64| {
        let mut distance = unit;
        loop {
            let next = distance * stride;
            let beyond = if stride < 1.0 { next < limit } else { next > limit };
            if beyond || plates.slope(next) >= 0.0 {
                return if beyond { limit } else { distance };
            }
            distance = next;
        }
    };
    [end(STRIDE, farthest.min(unit * REACH)), end(STRIDE.recip(), nearest.max(unit / REACH))]
        .map(|distance| plates.capacitance(distance))
}

/// What leaving the last term of a series out does at a distance, as an error of the distance in m: how far the series may
/// be wrong outside its table, about.
pub fn last_term_m(plates: &Plates, distance: f64) -> f64 {
    let mut shorter = *plates;
    if let Some(last) = shorter.coefficients.iter_mut().rev().find(|c| **c != 0.0) {
        *last = 0.0;
    }
    ((plates.capacitance(distance) - shorter.capacitance(distance)) / plates.slope(distance)).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_is_found_again() {
        let mut coefficients = [0.0; COEFFICIENTS];
        for plates in [[0.0, 109.3e-15, 0.0, 0.0], [3e-15, 95e-15, 12e-15, -1e-15]] {
            coefficients[..4].copy_from_slice(&plates);
            let plates = Plates { reference_distance: 1e-3, coefficients };
            for micrometre in [120.0, 500.0, 999.0, 1500.0, 4000.0] {
                let distance = micrometre * 1e-6;
                let found = distance_at(&plates, plates.capacitance(distance)).unwrap();
                assert!((found - distance).abs() < 1e-14 * distance, "{micrometre} µm: {found}");
            }
        }
        let plates = Plates { reference_distance: 1e-3, coefficients };
        for capacitance in [-1e-15, 0.0, 1.0, f64::NAN] {
            assert_eq!(distance_at(&plates, capacitance), None);
        }
    }
}
