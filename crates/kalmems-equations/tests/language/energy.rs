//! The check of the energy that a device states: what is right passes, and each mistake that units cannot see is found.

use crate::common::{device, example, example_text};
use kalmems_equations::{Device, EnergyCheck};

/// Sizes of the states and inputs of the two scanners.
const SCANNER: (&[f64], &[f64]) = (&[0.3, 3e4], &[100.0]);
const TWO_AXES: (&[f64], &[f64]) = (&[0.3, 3e4, 0.2, 8e3], &[100.0]);

fn check(device: &Device, (states, inputs): (&[f64], &[f64])) -> EnergyCheck {
    device.check_energy(states, inputs).unwrap().unwrap()
}

/// The example with some text in another's place.
fn changed(name: &str, from: &str, to: &str) -> Device {
    let text = example_text(name);
    assert!(text.contains(from), "{from}");
    device(&text.replacen(from, to, 1))
}

#[test]
fn the_published_scanners_keep_their_energy() {
    for (name, sizes) in [("shared_scanner", SCANNER), ("two_axes", TWO_AXES)] {
        let check = check(&example(name), sizes);
        assert!(check.holds() && check.is_damped && check.imbalance < 1e-12, "{name}: {check:?}");
    }
    let check = check(&example("two_axes"), TWO_AXES);
    assert_eq!(check.velocities, ["omega_x", "omega_y"]);
}

#[test]
fn without_damping_nothing_changes_the_energy() {
    let undamped = changed("shared_scanner", "- b*omega", "");
    let check = check(&undamped, SCANNER);
    assert!(check.holds() && !check.is_damped);
    insta::assert_snapshot!(check.to_string().replace(&format!("{:.0e}", check.imbalance.max(1e-16)), "ROUNDING"), @"energy: kept by the equations to ROUNDING; nothing changes it.");
}

/// A lost ½ has the right unit.
#[test]
fn a_lost_half_is_found() {
    let lost = changed("shared_scanner", "electrostatic_force(d(C, theta), square)", "d(C, theta)*square");
    let found = check(&lost, SCANNER);
    // The comb's torque is about a hundredth of the spring's.
    assert!(!found.holds() && (1e-3..1e-1).contains(&found.imbalance), "{found:?}");
    let message = found.to_string();
    assert!(message.starts_with("energy: the equations do not keep it; without damping 0."), "{message}");
    assert!(message.contains("by the rate of `omega`: ") && message.contains("a lost 1/2"), "{message}");
    // In the energy as well.
    assert!(!check(&changed("shared_scanner", "0.5*k*theta^2", "k*theta^2"), SCANNER).holds());
}

/// A comb of 0.2 rad is met by a state that is not said to be small.
#[test]
fn a_lost_half_is_found_where_no_size_is_known() {
    let unknown: (&[f64], &[f64]) = (&[0.0, 0.0], &[1.0]);
    assert!(check(&example("shared_scanner"), unknown).holds());
    let lost = changed("shared_scanner", "electrostatic_force(d(C, theta), square)", "d(C, theta)*square");
    assert!(!check(&lost, unknown).holds());
}

#[test]
fn signs_and_one_sided_couplings_are_found() {
    for (name, sizes, from, to) in [
        ("shared_scanner", SCANNER, "- k*theta)/J", "+ k*theta)/J"),
        ("shared_scanner", SCANNER, "(electrostatic_force", "(-electrostatic_force"),
        ("two_axes", TWO_AXES, "swing*omega_y^2)", "0*swing*omega_y^2)"),
        ("two_axes", TWO_AXES, "- 2*swing*omega_x*omega_y", "- swing*omega_x*omega_y"),
        ("two_axes", TWO_AXES, "- k_y*theta_y", "- k_x*theta_y"),
    ] {
        let found = check(&changed(name, from, to), sizes);
        assert!(!found.holds(), "{name}: {to}: {found:?}");
    }
}

#[test]
fn a_damping_with_the_wrong_sign_is_found() {
    let found = check(&changed("shared_scanner", "- b*omega", "+ b*omega"), SCANNER);
    assert!(found.gains && !found.holds());
    insta::assert_snapshot!(found, @"energy: it grows by itself at some points; look for the sign of a damping, or for a coupling that stands in one equation alone.");
}

/// The work of a force that the energy does not contain is not the equations' mistake.
#[test]
fn an_input_that_the_energy_does_not_contain_is_at_rest() {
    let text = "energy = '0.5*m*v^2 + 0.5*k*x^2'\n[states]\nx = 'm'\nv = 'm/s'\n[inputs]\nforce = 'N'\n\
                [parameters]\nm = '1 g'\nk = '3 N/m'\nb = '1e-3 N s/m'\n[derivative]\nx = 'v'\nv = '(force - b*v*abs(v)*1[s/m] - k*x)/m'\n";
    let check = check(&device(text), (&[1e-6, 1e-3], &[1e-6]));
    assert!(check.holds() && check.is_damped);
    assert_eq!(check.inputs_at_rest, ["force"]);
}

#[test]
fn a_device_without_an_energy_is_not_checked() {
    assert_eq!(example("accelerometer").check_energy(&[1e-6; 4], &[0.1]).unwrap(), None);
}
