//! Bytes as a device's equations.

use kalmems_core::Nodes;
use kalmems_equations::{Description, Device};

/// Reads the text, and makes of a device all that is made of one: programs with and without parameters as states, a step,
/// measurements, noise, the check of the energy, typeset equations.
///
/// A step by the program alone and one with its Jacobian are the same to the last bit, and so are those of a program made
/// again.
pub fn read(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let device = match Description::read(text).and_then(|description| Device::of(&description)) {
        Ok(device) => device,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let _ = device.typeset();
    for notice in device.notices() {
        let _ = notice.to_string();
    }
    let values = device.values();
    let _ = device.noise(&values, &vec![0.1; device.states().len()]);
    let _ = device.periods(&values);
    let _ = device.check_energy(&vec![0.1; device.states().len()], &vec![1.0; device.inputs().len()]);
    let inputs = vec![0.5; device.inputs().len()];
    let nodes = Nodes::held(&inputs[..]);
    for free in [&[][..], &[0]] {
        if free.len() > values.len() {
            continue;
        }
        let Ok(motion) = device.motion(free) else { continue };
        let again = device.motion(free).expect("it was made once");
        let n = motion.states();
        let mut x = vec![0.2; n];
        for (x, index) in x[motion.moving()..].iter_mut().zip(free) {
            *x = values[*index];
        }
        let steps = [&motion, &again].map(|motion| {
            let (mut work, tables) = (motion.work(&values), motion.runge_kutta(1e-3));
            let (mut next, mut alone, mut jacobian) = (vec![0.0; n], vec![0.0; n], vec![0.0; n * n]);
            motion.linearized_step(&mut work, &x, &nodes, &tables, &mut next, &mut jacobian);
            motion.step(&mut work, &x, &nodes, &tables, &mut alone);
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            let is_number = next.iter().all(|x| !x.is_nan());
            assert!(!is_number || bits(&next) == bits(&alone));
            is_number.then(|| [bits(&next), bits(&jacobian)].concat())
        });
        // Not a number has many forms, which the processor may choose among.
        if jacobian_is_comparable(&steps) {
            assert_eq!(steps[0], steps[1]);
        }
        for measure in 0..device.measures().len() {
            let Ok(readout) = device.readout(measure, free) else { continue };
            let mut slopes = vec![0.0; n];
            let _ = readout.linearize(&mut readout.work(&values), &x, &inputs, &mut slopes);
        }
    }
}

fn jacobian_is_comparable(steps: &[Option<Vec<u64>>; 2]) -> bool {
    steps.iter().flatten().all(|bits| bits.iter().all(|bits| !f64::from_bits(*bits).is_nan()))
}
