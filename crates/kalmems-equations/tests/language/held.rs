//! How finely a state that no equation moves has to be known for the linear part of a step.

use crate::common::{device, example};

/// What a state of this place may be off by about a point.
fn held(text: &str, at: &[f64]) -> Vec<(usize, f64)> {
    let device = device(text);
    let motion = device.motion(&[]).unwrap();
    motion.held(&mut motion.work(&device.values()), at, &[])
}

#[test]
fn a_linear_part_that_no_state_changes_needs_none() {
    let device = example("piston_mirror");
    let motion = device.motion(&[]).unwrap();
    assert_eq!(motion.held(&mut motion.work(&device.values()), &[0.0; 5], &[]), []);
}

#[test]
fn a_turning_rate_is_as_fine_as_it_counts_beside_the_resonance() {
    let text = "[states]\nturning = 'rad/s'\nx = 'm'\nv = 'm/s'\ny = 'm'\nw = 'm/s'\n[derivative]\nturning = '0'\nx = 'v'\n\
                v = '-(47000[rad/s])^2*x + 1.5*turning*w'\ny = 'w'\nw = '-(47000[rad/s])^2*y - 1.5*turning*v'\n";
    for turning in [0.0, 3.0] {
        let [(0, step)] = held(text, &[turning, 0.0, 0.0, 0.0, 0.0])[..] else { panic!("one state is held") };
        // 2⁻¹⁶ of the resonance, to a factor of two of the step and two of what balancing leaves.
        let expected = 47_000.0 / 65536.0 / 1.5;
        assert!((expected / 4.0..expected * 2.0).contains(&step), "{step} {expected}");
    }
}

#[test]
fn a_resonance_is_as_fine_as_its_own_size_tells() {
    let text =
        "[states]\nf0 = 'Hz'\nx = 'm'\nv = 'm/s'\n[derivative]\nf0 = '0'\nx = 'v'\nv = '-(2*pi*f0)^2*x'\n";
    let [(0, step)] = held(text, &[1e4, 0.0, 0.0])[..] else { panic!("one state is held") };
    // (ω + δ)² − ω² is 2⁻¹⁶ of ω² at δ/ω = 2⁻¹⁷.
    let expected = 1e4 / 131_072.0;
    assert!((expected / 4.0..expected * 2.0).contains(&step), "{step} {expected}");
    // Without a resonance there is nothing to compare with.
    assert_eq!(held(text, &[0.0; 3]), [(0, 0.0)]);
}
