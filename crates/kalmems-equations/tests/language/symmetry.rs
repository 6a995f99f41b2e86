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
    // The amplitude of a sine with its rate, and half a turn of its phase.
    assert_eq!(example("piston_mirror").hidden_signs(), [[0, 2, 4]]);
    // A threshold, a bias of both electrodes, a gap that has two ends: each tells the sign.
    for name in ["threshold_scanner", "micro_stage", "accelerometer"] {
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

/// A cos φ is −A cos(φ + π): (−1)·(−1) = 1.
#[test]
fn half_a_turn_of_a_phase_is_hidden_with_the_sign_of_its_amplitude() {
    let of = |period: &str, signal: &str| {
        device(&format!(
            "[states]\nsize = '1'\nphi = 'rad'\nrate = 'Hz'\n[derivative]\nsize = '-size*1[1/s]'\nphi = '2*pi*rate'\nrate = '0'\n[cyclic]\nphi = '{period}'\n[measure]\ny = '{signal} in 1'\n"
        ))
        .hidden_signs()
    };
    for signal in ["size*cos(phi)", "size*sin(phi + 0.3)", "size^3*cos(3*phi)", "2 + size*tanh(cos(phi))"] {
        assert_eq!(of("2*pi", signal), [[0, 1]], "{signal}");
    }
    // Each by itself.
    assert_eq!(of("2*pi", "size^2*cos(2*phi)"), [[0], [1]]);
    assert_eq!(of("2*pi", "size*cos(phi)^2"), [[1]]);
    assert_eq!(of("2*pi", "size*cos(2*phi)"), [[1]]);
    // Half of two turns is a whole one.
    assert_eq!(of("4*pi", "size*cos(phi)"), [[1]]);
    let told = [
        "size*cos(phi) + cos(phi)",
        "size*cos(phi) + size*cos(2*phi)",
        "size*cos(phi) + size",
        "size*cos(phi)*phi",
    ];
    for signal in told {
        assert!(of("2*pi", signal).is_empty(), "{signal}: {:?}", of("2*pi", signal));
    }
    assert!(of("3", "size*cos(phi)").is_empty());
}

/// An input is known: the mirrored motion would need the mirrored input.
#[test]
fn an_input_that_enters_with_a_sign_tells_that_of_the_motion() {
    let of = |force: &str, signal: &str| {
        let hidden = device(&format!(
            "[states]\nx = '1'\nv = '1/s'\n[inputs]\nu = '1'\n[derivative]\nx = 'v'\nv = '({force})*1[1/s^2]'\n[measure]\ny = '{signal} in 1'\n"
        ))
        .hidden_signs();
        !hidden.is_empty()
    };
    for (force, signal) in [("-x*u^2", "x^2"), ("-x*abs(u)", "x^2"), ("-x*u", "u*x^2"), ("-x", "x^2 + u")] {
        assert!(of(force, signal), "{force}, {signal}");
    }
    for (force, signal) in [("-x + u", "x^2"), ("-x + u^2", "x^2"), ("-x", "x^2 + u*x"), ("-abs(x)*u", "x^2")]
    {
        assert!(!of(force, signal), "{force}, {signal}");
    }
}
