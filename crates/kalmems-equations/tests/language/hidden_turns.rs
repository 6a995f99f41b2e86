//! Which turns of states the signals of a device cannot tell.

use crate::common::{device, example};
use kalmems_equations::StateTurn;

/// The turns of a point in a plane, with its angles `phi` and `psi` about two other axes.
fn of(force: [&str; 2], signal: &str, noise: [&str; 2]) -> Vec<Vec<StateTurn>> {
    let [along, across] = force;
    device(&format!(
        "[states]\nx = 'um'\ny = 'um'\nu = 'm/s'\nv = 'm/s'\nphi = 'rad'\npsi = 'rad'\n[inputs]\ndrive = 'V'\n[parameters]\nk = '2e6 1/s^2'\nb = '30 1/s'\n[derivative]\nx = 'u'\ny = 'v'\nu = '-k*x - b*u + {along}'\nv = '-k*y - b*v + {across}'\nphi = '7[rad/s]'\npsi = '9[rad/s]'\n[cyclic]\nphi = '2*pi'\npsi = '2*pi'\n[noise]\nu = '{} [m^2/s^3]'\nv = '{} [m^2/s^3]'\n[measure]\nz = '{signal} in m^2'\n",
        noise[0], noise[1]
    ))
    .hidden_turns()
}

fn turn(all: &[([usize; 2], f64)]) -> Vec<StateTurn> {
    all.iter().map(|(places, rate)| StateTurn { places: *places, rate: *rate }).collect()
}

const RADIUS: &str = "x^2 + y^2";
const PLANE: [([usize; 2], f64); 2] = [([0, 1], 1.0), ([2, 3], 1.0)];

#[test]
fn the_direction_of_a_motion_in_a_plane_is_hidden_where_the_signal_has_its_distance_alone() {
    let free = ["0[m/s^2]", "0[m/s^2]"];
    let gyroscope = ["40[1/s]*v", "-40[1/s]*u"];
    let central = [
        "x*drive^2*3[1/(s^2 V^2)] - x*(x^2 + y^2)*4[1/(m^2 s^2)]",
        "y*drive^2*3[1/(s^2 V^2)] - y*(x^2 + y^2)*4[1/(m^2 s^2)]",
    ];
    for force in [free, gyroscope, central] {
        for signal in [RADIUS, "sqrt(x^2 + y^2)*1[m]", "x^2 + y^2 + 3[s^2]*(u^2 + v^2) + 2[s]*(x*v - y*u)"] {
            assert_eq!(of(force, signal, ["1", "1"]), [turn(&PLANE)], "{force:?}, {signal}");
        }
    }
    // A force along one of the axes, another stiffness, a coupling, a product of both, another noise: each tells the direction.
    for force in [
        ["drive*1e-3[m/(s^2 V)]", "0[m/s^2]"],
        ["0[m/s^2]", "-y*1e-3[1/s^2]"],
        ["40[1/s]*v", "40[1/s]*u"],
        ["-1e3[1/(m^2 s^2)]*x*y^2", "0[m/s^2]"],
        ["0[m/s^2]", "-1e-8[s/m^2]*v^3"],
    ] {
        assert!(of(force, RADIUS, ["1", "1"]).is_empty(), "{force:?}");
    }
    for signal in ["x^2 + 1.001*y^2", "x^2 + y^2 + 1e-3*x*y", "x^2", "x^2 + y^2 + u*1e-6[m s]"] {
        assert!(of(free, signal, ["1", "1"]).is_empty(), "{signal}");
    }
    assert!(of(free, RADIUS, ["1", "2"]).is_empty());
}

#[test]
fn phases_turn_with_what_they_are_compared_with() {
    let free = ["0[m/s^2]", "0[m/s^2]"];
    let plane = |rate: f64| [([0, 1], rate), ([2, 3], rate)];
    let with = |phases: &[([usize; 2], f64)], rate: f64| turn(&[&plane(rate), phases].concat());
    let radial = "(x*cos(phi) + y*sin(phi))^2";
    assert_eq!(of(free, radial, ["1", "1"]), [with(&[([4, 4], 1.0)], 1.0)]);
    assert_eq!(of(free, "(x*cos(phi) - y*sin(phi))^2", ["1", "1"]), [with(&[([4, 4], -1.0)], 1.0)]);
    let difference = "x*1[m]*cos(phi - psi)";
    assert_eq!(of(free, difference, ["1", "1"]), [turn(&[([4, 4], 1.0), ([5, 5], 1.0)])]);
    assert_eq!(of(free, "x*1[m]*cos(phi + 2*psi)", ["1", "1"]), [turn(&[([4, 4], 1.0), ([5, 5], -0.5)])]);
    assert!(of(free, "x*1[m]*cos(phi)*cos(psi)", ["1", "1"]).is_empty());
}

#[test]
fn no_example_has_a_turn_that_its_signals_do_not_tell() {
    for name in
        ["shared_scanner", "two_axes", "threshold_scanner", "micro_stage", "accelerometer", "piston_mirror"]
    {
        assert!(example(name).hidden_turns().is_empty(), "{name}: {:?}", example(name).hidden_turns());
    }
}
