//! Tilting plates against the printed integrals in 80 digits and more, from rest to 99 % of contact.
//!
//! The values were computed with mpmath from the closed forms of the integral (Chen, dissertation, 2018, (40)), which
//! in so many digits do not cancel, at the numbers that these literals are.

#![allow(clippy::unreadable_literal)] // all of their digits

use approx::assert_relative_eq;
use kalmems_core::Dual;
use kalmems_models::capacitance::{Contact, TiltingPlate};
use proptest::prelude::*;

/// Stator 2A of the micro-stage.
const PLATE: TiltingPlate<f64> =
    TiltingPlate { w1: 0.99e-3, w2: 1.39e-3, w3: -0.2e-3, w4: 0.2e-3, gap: 19e-6, permittivity: 8.8542e-12 };

/// θ_Y in rad, C in F, dC/dθ_Y in F/rad; the last two at 99 % of contact and as far the other way.
const ABOUT_ONE: [(f64, f64, f64); 12] = [
    (0.0, 7.456168421052631e-14, 4.6699160110803316e-12),
    (1e-12, 7.456168421519622e-14, 4.669916011670808e-12),
    (1e-08, 7.456173090971594e-14, 4.669921915848132e-12),
    (1e-05, 7.460841291329774e-14, 4.675826429408054e-12),
    (0.001, 7.95469728179965e-14, 5.3221825496938435e-12),
    (-0.001, 7.016930721760439e-14, 4.131467745245588e-12),
    (0.005, 1.0877089084671313e-13, 1.0043483530105815e-11),
    (0.008, 1.5088502558458287e-13, 1.9677987036135202e-11),
    (0.012, 3.3101479451734503e-13, 1.0827543409826844e-10),
    (-0.012, 4.2641420045577504e-14, 1.517859950773563e-12),
    (0.013531531383906172, 8.856333878232489e-13, 1.803089668067725e-09),
    (-0.013531531383906172, 4.043724751553686e-14, 1.3646196442006891e-12),
];

/// θ_X and θ_Y in rad, C in F and its derivatives by both in F/rad; the nearest corner 0.9 to 136 % of the gap away.
const ABOUT_BOTH: [([f64; 2], [f64; 3]); 11] = [
    ([1e-09, 1e-09], [7.456168888044262e-14, 5.507789342217997e-21, 4.669916601556603e-12]),
    ([1e-06, 0.003], [9.185921395798191e-14, 1.0314674702628114e-17, 7.122537710312002e-12]),
    ([0.003, 1e-09], [7.45864889217825e-14, 1.6543360932472997e-14, 4.674578259405111e-12]),
    ([-0.002, 0.005], [1.0880531056500119e-13, -3.4439573860730675e-14, 1.0053140386023987e-11]),
    ([0.005, -0.008], [4.9745289744713787e-14, 8.20634897265521e-15, 2.068723384884297e-12]),
    ([0.02, 0.008], [1.6156658704127194e-13, 1.2192659908018423e-12, 2.4462812280863464e-11]),
    ([-0.05, -0.001], [7.695007396866965e-14, -3.222396970895324e-13, 5.475913100501092e-12]),
    ([0.045, 0.001], [8.760773882411273e-14, 4.2898078929558667e-13, 7.154615239534735e-12]),
    ([0.0001, 0.01353], [8.833617480068159e-13, 9.502999239969894e-12, 1.7891395186930855e-09]),
    ([-0.008, 0.01235], [4.228230818790255e-13, -1.872265815776183e-11, 2.583698193930002e-10]),
    ([0.03, -1e-07], [7.720111147719228e-14, 1.8759877108961263e-13, 5.18747110111958e-12]),
];

/// What the input's last digit may change: near contact a rounding of the angle is a hundred of the clearance.
fn rounding(clearance: f64) -> f64 {
    1e-14 + 4.0 * f64::EPSILON * PLATE.gap / clearance
}

#[test]
fn about_one_axis() {
    for (angle, capacitance, slope) in ABOUT_ONE {
        assert_relative_eq!(PLATE.capacitance(angle), capacitance, max_relative = 1e-12);
        assert_relative_eq!(PLATE.slope(angle), slope, max_relative = 1e-12);
        // What the first two digits of the tolerance are for.
        let bound = rounding(PLATE.clearance(0.0, angle));
        assert!((PLATE.capacitance(angle) / capacitance - 1.0).abs() <= bound, "{angle}");
        assert!((PLATE.slope(angle) / slope - 1.0).abs() <= 4.0 * bound, "{angle}");
    }
}

#[test]
fn about_both_axes() {
    for ([about_x, about_y], [capacitance, by_x, by_y]) in ABOUT_BOTH {
        let x = Dual::<f64, 2>::variable(about_x, 0);
        let y = Dual::<f64, 2>::variable(about_y, 1);
        let both = PLATE.capacitance_of_both(x, y);
        assert_relative_eq!(both.value(), capacitance, max_relative = 1e-12);
        let [found_x, found_y] = both.gradient();
        assert_relative_eq!(found_y, by_y, max_relative = 1e-12);
        // Even in θ_X without offset, so that its derivative passes through 0: relative to what it is made of.
        assert_relative_eq!(found_x, by_x, max_relative = 1e-12, epsilon = 1e-15 * by_y);
    }
}

/// f32 keeps its own digits.
#[test]
fn in_single_precision() {
    let narrow = |x: f64| {
        #[allow(clippy::cast_possible_truncation)]
        let x = x as f32;
        x
    };
    let plate = TiltingPlate {
        w1: narrow(PLATE.w1),
        w2: narrow(PLATE.w2),
        w3: narrow(PLATE.w3),
        w4: narrow(PLATE.w4),
        gap: narrow(PLATE.gap),
        permittivity: narrow(PLATE.permittivity),
    };
    for (angle, capacitance, slope) in ABOUT_ONE.into_iter().take(8) {
        assert_relative_eq!(f64::from(plate.capacitance(narrow(angle))), capacitance, max_relative = 1e-6);
        assert_relative_eq!(f64::from(plate.slope(narrow(angle))), slope, max_relative = 3e-6);
    }
}

#[test]
fn contact_is_an_error() {
    let touching = (PLATE.gap / PLATE.w2).atan();
    assert!(PLATE.checked(0.0, touching * (1.0 - 1e-9)).is_ok_and(f64::is_finite));
    assert!(PLATE.checked(0.0, touching * (1.0 + 1e-9)).is_err_and(|contact| contact.clearance <= 0.0));
    // The other way the plate is free until it stands.
    assert!(PLATE.checked(0.0, -1.5).is_ok());
    assert!(PLATE.checked(f64::NAN, 0.0).is_err_and(|Contact { about_x, .. }| about_x.is_nan()));
}

proptest! {
    /// The derivatives by dual numbers are those that are written, and both ways of computing agree where they meet.
    #[test]
    fn derivatives_and_axes_agree(share in -0.99..0.99_f64, side in -0.9..0.9_f64) {
        let angle = share * (PLATE.gap / PLATE.w2).atan();
        let dual = PLATE.capacitance(Dual::<f64, 1>::variable(angle, 0));
        let slope = PLATE.slope(angle);
        prop_assert!((dual.gradient()[0] / slope - 1.0).abs() < 1e-12);
        let both = PLATE.capacitance_of_both(0.0, angle);
        prop_assert!((both / PLATE.capacitance(angle) - 1.0).abs() < 1e-12);

        // A plate is the sum of its halves, whichever way each of them is computed.
        let about_x = side * PLATE.clearance(0.0, angle) / PLATE.w4;
        let half = TiltingPlate { w4: 0.0, ..PLATE };
        let other = TiltingPlate { w3: 0.0, ..PLATE };
        let [whole, low, high] = [PLATE, half, other].map(|plate| plate.capacitance_of_both(about_x, angle));
        prop_assert!(((low + high) / whole - 1.0).abs() < 1e-12, "{} {} {}", whole, low, high);
        prop_assert!(PLATE.checked(about_x, angle).is_ok_and(|capacitance| capacitance > 0.0));
    }
}
