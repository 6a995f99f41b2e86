//! Steps through places at which the rates jump.

use crate::common::device;
use kalmems_core::Nodes;
use kalmems_equations::ResetStep;

const JUMP: &str = "[states]\nx = 'm'\nv = 'm/s'\n[inputs]\nu = 'm'\n[derivative]\nx = 'v'\nv = '-4[1/s^2]*x + if(x < u, 3[m/s^2], -2[m/s^2])'\n";

/// Where a step from a state leads to under an input that moves, with its derivatives by the state, row by row.
fn step(x: [f64; 2], slopes: &mut [f64]) -> [f64; 2] {
    let device = device(JUMP);
    let motion = device.motion(&[]).unwrap();
    let mut sides = device.sides(&device.values(), &[]).unwrap().unwrap();
    let mut work = motion.work(&device.values());
    let linear = [0.0, 1.0, -4.0, 0.0];
    let mut tables = motion.tables();
    motion.set_tables(&mut tables, &linear, 0.1);
    let mut set_tables = |tables: &mut _, length_s: f64| motion.set_tables(tables, &linear, length_s);
    let inputs = Nodes { start: &[0.4][..], middle: &[0.58][..], end: &[0.7][..] };
    let mut step = ResetStep {
        motion: &motion,
        work: &mut work,
        inputs: &inputs,
        tables: &tables,
        length_s: 0.1,
        set_tables: &mut set_tables,
    };
    let mut to = [0.0; 2];
    assert!(sides.follow(&mut step, &x, &mut to, slopes));
    to
}

/// The time at which a state passes a moving input changes with the state by the difference of their rates.
#[test]
fn a_jump_at_a_moving_input_has_the_derivatives_of_differences() {
    let x = [0.55, 0.3];
    let mut slopes = [0.0; 4];
    step(x, &mut slopes);
    for column in 0..2 {
        let moved = |by: f64| {
            let mut moved = x;
            moved[column] += by;
            step(moved, &mut [])
        };
        let (ahead, behind) = (moved(1e-6), moved(-1e-6));
        for row in 0..2 {
            let by_difference = (ahead[row] - behind[row]) / 2e-6;
            let found = slopes[2 * row + column];
            assert!((found - by_difference).abs() < 1e-6, "{row} {column}: {found} {by_difference}");
        }
    }
}
