//! Which signs the signals of a device cannot tell.

use crate::common::{device, example};

#[test]
fn a_signal_that_is_even_in_an_angle_hides_its_sign() {
    // Angle and rate together; of two axes each by itself.
    assert_eq!(example("shared_scanner").hidden_signs(), [[0, 1]]);
    let two_axes = example("two_axes");
    let hidden = two_axes.hidden_signs();
    assert_eq!(hidden.len(), 2, "{hidden:?}");
    assert!(hidden.iter().all(|axis| axis.len() == 2) && hidden[0][0] != hidden[1][0], "{hidden:?}");
    // A threshold, a bias of both electrodes, a gap that has two ends: each tells the sign.
    for name in ["threshold_scanner", "micro_stage", "accelerometer", "piston_mirror"] {
        assert!(example(name).hidden_signs().is_empty(), "{name}: {:?}", example(name).hidden_signs());
    }
}

#[test]
fn choices_powers_and_functions_have_the_parity_of_what_they_are_made_of() {
    let of = |force: &str, signal: &str| {
        device(&format!(
            "[states]\nx = '1'\nv = '1/s'\n[inputs]\nu = '1'\n[derivative]\nx = 'v'\nv = '{force}'\n[measure]\ny = '{signal} in 1'\n"
        ))
        .hidden_signs()
    };
    let hidden: &[&[usize]] = &[&[0, 1]];
    let odd = [
        "-x",
        "-x*abs(x)",
        "-sin(x)*u^2",
        "if(x < 0, 1, -1)",
        "-x - sign(v*1[s])",
        "-asin(x) - atan(x)",
        "-atan2(x, 2 + x^2)",
        "-x*hypot(x, 1)",
    ];
    for force in odd.map(|force| format!("({force})*1[1/s^2]")) {
        let force = force.as_str();
        assert_eq!(of(force, "x^2"), hidden, "{force}");
        assert_eq!(of(force, "abs(x)"), hidden, "{force}");
        assert_eq!(of(force, "cos(x) + max(x, -x)"), hidden, "{force}");
        assert!(of(force, "x").is_empty() && of(force, "x^2 + x").is_empty(), "{force}");
    }
    for force in ["u - x", "1 - exp(x)", "max(x, 0)", "acos(x)", "floor(x)", "atan2(1, x)", "sign(x + 1)"] {
        let force = format!("({force})*1[1/s^2]");
        let force = force.as_str();
        assert!(of(force, "x^2").is_empty(), "{force}");
    }
}

/// A gain that is a state and what it multiplies have one sign too few: only a coupling that is known, or a drive through it, tells it.
#[test]
fn the_sign_of_a_gain_that_is_a_state_is_hidden_with_that_of_what_it_multiplies() {
    let of = |coupling: &str, states: &str, rates: &str| {
        device(&format!(
            "[states]\nx = '1'\nv = '1/s'\ngain = 'V'\n{states}[inputs]\nu = '1'\n[derivative]\nx = 'v'\nv = '-x*1[1/s^2] + {coupling}*u'\ngain = '0'\n{rates}[measure]\ny = 'gain*x in V'\n"
        ))
        .hidden_signs()
    };
    assert_eq!(of("c", "c = '1/s^2'\n", "c = '0'\n"), [[0, 1, 2, 3]]);
    assert_eq!(of("0[1/s^2]", "", ""), [[0, 1, 2]]);
    assert!(of("3[1/s^2]", "", "").is_empty());
}
