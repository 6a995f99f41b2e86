//! The force-rebalance loop: its frequency response against published figures, its runs against both and against
//! closed forms.

use kalmems_models::capacitance::{DifferentialPlates, FixedPlate};
use kalmems_models::constants::{STANDARD_GRAVITY, VACUUM_PERMITTIVITY};
use kalmems_models::control::{
    Comparator, Complex, LoopStop, Margins, PiController, RebalanceLoop, SampledRebalance,
};
use kalmems_models::dynamics::{Accelerometer, ProofMass};
use kalmems_models::readout::DifferentialReadout;
use std::f64::consts::{PI, TAU};

/// Zhang 2010, Table I, with the bias for 10 g at v_F = V_B/2.
fn rebalanced(relative_permittivity: f64, proportional: f64) -> RebalanceLoop<f64> {
    let plates = DifferentialPlates {
        area: 1.86e-6,
        gap: 2.3e-6,
        permittivity: relative_permittivity * VACUUM_PERMITTIVITY,
    };
    let mass = ProofMass { mass: 3.8e-9, damping: 7e-4, squeezed: 0.0, spring: 3.0 };
    let unbiased = Accelerometer { mass, plates, carrier_mean_square: 0.18, bias: 0.0 };
    let bias = unbiased.bias_for(10.0 * STANDARD_GRAVITY);
    RebalanceLoop {
        device: Accelerometer { bias, ..unbiased },
        readout: DifferentialReadout { plates, carrier_amplitude: 0.6, feedback_capacitance: 20e-12 },
        controller: PiController { proportional, integral: if proportional == 0.0 { 0.0 } else { 1.0 } },
        delay: 0.0,
    }
}

fn open(relative_permittivity: f64) -> RebalanceLoop<f64> {
    let biased = rebalanced(relative_permittivity, 0.0);
    RebalanceLoop { device: Accelerometer { bias: 0.0, ..biased.device }, ..biased }
}

#[track_caller]
fn assert_close(ours: f64, theirs: f64, tolerance: f64) {
    assert!((ours / theirs - 1.0).abs() <= tolerance, "{ours} {theirs}");
}

/// Open loop 698 Hz without the plates' pull and 241 Hz with it; closed 9.7 kHz with K_p = 10, and the 80 kHz that the
/// thesis states with 137. The corner of its controller is at 0.1 rad/s.
#[test]
fn the_bandwidths_are_the_recomputed_ones() {
    let band = |closed: RebalanceLoop<f64>| closed.bandwidth(TAU, TAU * 1e6).unwrap() / TAU;
    let plain = open(4.0);
    let stiff = RebalanceLoop { device: Accelerometer { carrier_mean_square: 0.0, ..plain.device }, ..plain };
    assert_close(band(stiff), 698.0, 0.005);
    assert_close(band(plain), 241.0, 0.01);
    assert_close(band(rebalanced(4.0, 10.0)), 9.7e3, 0.02);
    assert_close(band(rebalanced(4.0, 137.0)), 80e3, 0.02);
    let corner = rebalanced(4.0, 10.0).controller.response(0.1);
    assert_eq!(corner.re, -corner.im);
}

/// Static displacements: 35 and 15 nm in the open loop at 1 g, 1.1 and 6.0 nm in the closed one, where the thesis has 70
/// and 4 nm; by the response at low frequency, and by runs that come to rest.
#[test]
fn the_mass_rests_where_the_springs_and_the_loop_hold_it() {
    for (permittivity, in_open, in_closed) in [(4.0, 35e-9, 1.1e-9), (1.0, 15e-9, 6.0e-9)] {
        for (closed, displacement) in
            [(open(permittivity), in_open), (rebalanced(permittivity, 10.0), in_closed)]
        {
            let low = closed.displacement(1e2).size() * STANDARD_GRAVITY;
            assert_close(low, displacement, 0.04);
            let mut run = SampledRebalance::new(&closed, 1e-6, 1);
            for _ in 0..10_000 {
                let feedback = run.answer(run.read(0.0));
                run.advance(feedback, [STANDARD_GRAVITY; 2], &[]).unwrap();
            }
            assert_close(run.state()[0], low, 0.01);
        }
    }
}

/// What a noise of the readout looks like at the input is the same with and without the loop, and at rest (k − k_el)/(m·S).
#[test]
fn the_loop_changes_nothing_about_signal_and_noise() {
    let closed = rebalanced(4.0, 10.0);
    let still = RebalanceLoop { controller: PiController { proportional: 0.0, integral: 0.0 }, ..closed };
    for rate in [10.0, 1e3, 1e5] {
        // The noise reaches the output by 1/(1 + L), the acceleration by `response`.
        for either in [closed, still] {
            let referred = either.sensitivity(rate).size() / either.response(rate).size();
            assert_close(referred, closed.input_referred(rate), 1e-12);
        }
    }
    let spring = closed.device.softened_spring(0.0);
    assert_close(closed.input_referred(1e-3), spring / 3.8e-9 / closed.readout.sensitivity(), 1e-9);
}

/// Crossover, phase margin and gain margin against what they mean: at the crossover |L| = 1; a delay of the phase margin
/// over the crossover, and a gain that is higher by the gain margin, put L at −1.
#[test]
fn the_margins_lead_to_the_edge_of_stability() {
    let closed = rebalanced(4.0, 137.0);
    let margins = closed.margins(1.0, TAU * 1e7);
    let crossover = margins.crossover.unwrap();
    assert_close(closed.open_loop(crossover).size(), 1.0, 1e-9);
    assert_eq!(margins.gain, None, "two poles alone never turn by half a cycle");
    let late = RebalanceLoop { delay: margins.phase.unwrap() / crossover, ..closed };
    let at_edge = late.open_loop(crossover);
    assert!((at_edge.re + 1.0).abs() < 1e-9 && at_edge.im.abs() < 1e-9, "{at_edge:?}");
    assert!(late.margins(1.0, TAU * 1e7).phase.unwrap().abs() < 1e-9);

    let delayed = RebalanceLoop { delay: 0.5e-6, ..closed };
    let margins = delayed.margins(1.0, TAU * 1e7);
    let gain = margins.gain.unwrap();
    let louder = PiController { proportional: 137.0 * gain, integral: gain };
    let louder = RebalanceLoop { controller: louder, ..delayed };
    let edge = louder.margins(1.0, TAU * 1e7);
    assert_close(edge.gain.unwrap(), 1.0, 1e-6);
    assert!(edge.phase.unwrap().abs() < 1e-4 && margins.peak_sensitivity > 1.0, "{edge:?}");
    // Where the loop is far from −1, its sensitivity is near 1.
    assert!(rebalanced(4.0, 0.01).margins(1.0, TAU * 1e7).peak_sensitivity < 1.0 + 1e-3);
}

/// A small kick dies away where the eigenvalues say so, and grows where they do not: at the edge, from both sides.
#[test]
fn a_sampled_loop_is_stable_where_its_kick_dies_away() {
    let interval = 5e-6;
    let grows = |closed: &RebalanceLoop<f64>| {
        let mut run = SampledRebalance::new(closed, interval, 20);
        let mut sizes = [0.0_f64; 2];
        for k in 0..4000 {
            let feedback = run.answer(run.read(0.0));
            let kick = if k == 0 { 0.01 } else { 0.0 };
            if run.advance(feedback, [kick; 2], &[]).is_err() {
                return true;
            }
            if k >= 1000 {
                let half = usize::from(k >= 2500);
                sizes[half] = sizes[half].max(run.state()[0].abs());
            }
        }
        sizes[1] > sizes[0]
    };
    for delay in [0.0, 1.5 * interval] {
        let with_gain = |gain| {
            let controller = PiController { proportional: gain, integral: 0.0 };
            RebalanceLoop { controller, delay, ..rebalanced(4.0, 10.0) }
        };
        let edge = 10.0 * with_gain(10.0).sampled_gain_margin(interval).unwrap();
        assert!(edge > 20.0 && edge < 9e3, "{edge}");
        assert!(!grows(&with_gain(0.97 * edge)), "{delay} {edge}");
        assert!(grows(&with_gain(1.03 * edge)), "{delay} {edge}");
    }
    // The phase margin goes through 0 where the gain margin does, and disturbances are amplified without a bound there; sampled fast, all of it is
    // that of the continuous loop.
    for delay in [0.0, 1.5 * interval] {
        let with_gain = |gain| {
            let controller = PiController { proportional: gain, integral: 0.0 };
            RebalanceLoop { controller, delay, ..rebalanced(4.0, 10.0) }
        };
        let edge = 10.0 * with_gain(10.0).sampled_gain_margin(interval).unwrap();
        let at = |share: f64| with_gain(share * edge).sampled_margins(1.0, interval);
        let (inside, outside) = (at(0.999), at(1.001));
        let degrees = |margins: &Margins<f64>| margins.phase.unwrap().to_degrees();
        assert!(
            (0.0..0.1).contains(&degrees(&inside)) && (-0.1..0.0).contains(&degrees(&outside)),
            "{delay} {edge}"
        );
        assert!(inside.peak_sensitivity > 500.0, "{}", inside.peak_sensitivity);
        assert!((inside.gain.unwrap() * 0.999 - 1.0).abs() < 1e-6 && outside.gain.is_none());
    }
    let (fast, closed) = (1e-8, RebalanceLoop { delay: 0.5e-8, ..rebalanced(4.0, 10.0) });
    let (sampled, continuous) = (closed.sampled_margins(1.0, fast), closed.margins(1.0, 3e8));
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
    assert!(close(sampled.crossover.unwrap(), continuous.crossover.unwrap()));
    assert!(close(sampled.phase.unwrap(), continuous.phase.unwrap()));
    assert!(close(sampled.peak_sensitivity, continuous.peak_sensitivity));
    // The wrong sign pushes further away.
    assert!(!rebalanced(4.0, -10.0).is_stable(interval) && rebalanced(4.0, 10.0).is_stable(interval));
}

/// Each ends in pull-in, to the plate that it is pushed to; what is held does not.
#[test]
fn pull_in_during_a_run_is_named() {
    let end = |closed: &RebalanceLoop<f64>, acceleration: f64| {
        let mut run = SampledRebalance::new(closed, 1e-6, 2);
        for _ in 0..50_000 {
            let feedback = run.answer(run.read(0.0));
            run.advance(feedback, [acceleration * STANDARD_GRAVITY; 2], &[])?;
        }
        Ok(run.state()[0])
    };
    // Open loop: 12 g is the edge, a step overshoots nothing in an over-damped device.
    assert!(end(&open(4.0), 11.5).is_ok());
    for (closed, acceleration, expected) in [
        (open(4.0), 12.5, FixedPlate::First),
        (open(4.0), -12.5, FixedPlate::Second),
        (rebalanced(4.0, -10.0), 0.01, FixedPlate::First),
    ] {
        let Err(LoopStop::PulledIn { time_s, plate }) = end(&closed, acceleration) else {
            panic!("{acceleration}")
        };
        assert_eq!(plate, expected);
        assert!(time_s > 0.0 && time_s < 0.05);
    }
    // The loop holds at 10 g what the open one would hold too, and with a tenth of the displacement.
    let held = end(&rebalanced(4.0, 10.0), 10.0).unwrap();
    assert!(held < 0.1 * end(&open(4.0), 10.0).unwrap(), "{held}");
}

/// With the carrier in full, 32 steps to its period.
///
/// The open loop moves as under the averaged carrier. In the closed one the carrier beats with the feedback, a force
/// 2·ε·A·V₁·v_F/d₀²·sin(ωt), whose mean is zero for a feedback that stands still; of one that changes while the carrier
/// is in step with the sampler there is left 2·ε·A·V₁/d₀²·v̇_F/ω: a phase of (V₁/V_B)·(f/f_c) of what is fed back.
#[test]
fn the_averaged_carrier_is_the_full_one_but_for_a_beat() {
    let worst = |closed: RebalanceLoop<f64>, signal_hz: f64| {
        let mut averaged = SampledRebalance::new(&closed, 1e-6, 32);
        let mut full = averaged.with_carrier(1e6);
        let (mut worst, mut most) = (0.0_f64, 0.0_f64);
        for k in 0..3000 {
            let a = |k: f64| 3.0 * STANDARD_GRAVITY * (TAU * signal_hz * k * 1e-6).sin();
            for run in [&mut averaged, &mut full] {
                let feedback = run.answer(run.read(0.0));
                run.advance(feedback, [a(f64::from(k)), a(f64::from(k) + 1.0)], &[]).unwrap();
            }
            if k > 1000 {
                worst = worst.max((averaged.state()[0] - full.state()[0]).abs());
                most = most.max(averaged.state()[0].abs());
            }
        }
        worst / most
    };
    assert!(worst(open(4.0), 2e3) < 1e-4, "{}", worst(open(4.0), 2e3));
    let closed = rebalanced(4.0, 10.0);
    for signal_hz in [1e3, 2e3] {
        let beat = 0.6 / closed.device.bias * signal_hz / 1e6;
        assert_close(worst(closed, signal_hz), beat, 0.1);
    }
}

/// The phase is that of the response, turn by turn; that of the device alone is the one of its two real poles.
#[test]
fn the_phase_is_that_of_the_response() {
    let loops = [rebalanced(4.0, 10.0), RebalanceLoop { delay: 1e-6, ..rebalanced(4.0, 137.0) }];
    for closed in loops {
        let mut last = 0.0;
        for step in 0..600 {
            let rate = TAU * 10_f64.powf(f64::from(step) / 100.0);
            let (phase, response) = (closed.phase(rate), closed.response(rate));
            let wrapped = (phase - response.im.atan2(response.re)) / TAU;
            assert!(
                (wrapped - wrapped.round()).abs() < 1e-12 && (phase - last).abs() < 0.3,
                "{rate} {phase}"
            );
            last = phase;
        }
    }
    let plain = open(4.0);
    let [slow, fast] = plain.device.mass.eigenvalues(plain.device.softened_spring(0.0));
    let expected = -(1e5 / -slow.0).atan() - (1e5 / -fast.0).atan();
    assert_close(plain.phase(1e5), expected, 1e-12);
}

/// What a run does with an acceleration of this frequency, in V per m/s²: the loop is computed at every interval, and
/// its output correlated over whole periods after it has settled.
fn driven(closed: &RebalanceLoop<f64>, (interval, signal_hz): (f64, f64)) -> Complex<f64> {
    let mut run = SampledRebalance::new(closed, interval, 1);
    let per_period = (1.0 / signal_hz / interval).round();
    let (mut re, mut im) = (0.0, 0.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rounded and positive
    let samples = 40 * per_period as u32;
    for k in 0..samples {
        let angle = |k: u32| TAU * f64::from(k) / per_period;
        let output = run.read(0.0);
        if k >= samples / 2 {
            let share = 2.0 / f64::from(samples / 2);
            (re, im) = (re + share * output * angle(k).sin(), im + share * output * angle(k).cos());
        }
        let feedback = run.answer(output);
        run.advance(feedback, [angle(k).sin(), angle(k + 1).sin()], &[]).unwrap();
    }
    Complex { re, im }
}

/// Computed at every step of the integration the loop is a continuous one: without a delay, and at 5 µs per sample with
/// that of the hold, or of the hold and the computation.
#[test]
fn a_loop_that_is_computed_often_is_the_continuous_one() {
    for (interval, late) in [(1e-7, 0.5), (5e-6, 0.5), (5e-6, 1.5)] {
        let closed = RebalanceLoop { delay: late * interval, ..rebalanced(4.0, 10.0) };
        for signal_hz in [1e3, 1e4] {
            let ours = driven(&closed, (interval, signal_hz));
            // The loop at 0.1 µs is set against one without any delay.
            let expected =
                RebalanceLoop { delay: if interval < 1e-6 { 0.0 } else { closed.delay }, ..closed };
            let expected = expected.response(TAU * signal_hz);
            let off = Complex { re: ours.re - expected.re, im: ours.im - expected.im };
            assert!(
                off.size() < 0.01 * expected.size(),
                "{interval} {late} {signal_hz} {ours:?} {expected:?}"
            );
        }
    }
}

/// One bit at 1 MHz: the bits under a constant acceleration, and the mean displacement over the second half.
fn one_bit(
    closed: &RebalanceLoop<f64>,
    comparator: Comparator,
    gn: f64,
) -> Result<(Vec<f64>, f64), LoopStop> {
    let mut run = SampledRebalance::new(closed, 1e-6, 2).with_comparator(comparator);
    let (mut bits, mut displacement) = (Vec::new(), 0.0);
    for k in 0..80_000 {
        let feedback = run.answer(run.read(0.0));
        bits.push(feedback / comparator.level);
        if k >= 40_000 {
            displacement += run.state()[0] / 4e4;
        }
        run.advance(feedback, [gn * STANDARD_GRAVITY; 2], &[])?;
    }
    Ok((bits, displacement))
}

/// The loop of one bit at 10 g full scale.
fn with_one_bit(integral: f64, lead_s: f64) -> (RebalanceLoop<f64>, Comparator) {
    let closed = rebalanced(4.0, 10.0);
    let controller = PiController { proportional: 10.0, integral };
    (RebalanceLoop { controller, ..closed }, Comparator { level: 0.5 * closed.device.bias, lead_s })
}

/// Momentum: what the bits and the springs push on average is what the acceleration does, up to the last few bits of
/// 40 000. Without an integral the mass rests where the springs take their part; with one it does not.
#[test]
fn the_mean_of_the_bits_is_the_acceleration() {
    for (integral, lead_s) in [(0.0, 0.0), (0.0, 5.6e-6), (1e5, 5.6e-6)] {
        let (closed, comparator) = with_one_bit(integral, lead_s);
        let spring = closed.device.softened_spring(comparator.level);
        for gn in [0.0123, 1.0, -5.0, 9.9] {
            let (bits, displacement) = one_bit(&closed, comparator, gn).unwrap();
            let pushed = 10.0 * bits[40_000..].iter().sum::<f64>() / 4e4;
            let held = spring * displacement / closed.device.mass.mass / STANDARD_GRAVITY;
            assert!((pushed + held - gn).abs() < 2e-3, "{integral} {lead_s} {gn}: {pushed} {held}");
            assert!(integral == 0.0 || held.abs() < 1e-5, "{held}");
            assert!(bits.iter().all(|bit| bit.abs() == 1.0));
        }
        // Beyond its full scale it says no more than that.
        let (bits, displacement) = one_bit(&closed, comparator, 11.0).unwrap();
        assert!(bits[40_000..].iter().all(|bit| *bit == 1.0) && displacement > 50e-9);
    }
}

/// Means of ten times more bits scatter about ten times less, where those of independent bits would by √10; and a lead
/// halves what is left.
#[test]
fn the_noise_of_the_bits_is_shaped() {
    let scatter = |lead_s: f64, count: usize| {
        let (closed, comparator) = with_one_bit(0.0, lead_s);
        let squares = [0.123, 1.357, 4.321].map(|gn| {
            let (bits, _) = one_bit(&closed, comparator, gn).unwrap();
            let means: Vec<f64> =
                bits[40_000..].chunks(count).map(|chunk| chunk.iter().sum::<f64>() / count as f64).collect();
            let middle = means.iter().sum::<f64>() / means.len() as f64;
            means.iter().map(|mean| (mean - middle).powi(2)).sum::<f64>() / means.len() as f64
        });
        (squares.iter().sum::<f64>() / 3.0).sqrt()
    };
    let (short, long) = (scatter(5.6e-6, 50), scatter(5.6e-6, 500));
    println!("50 bits {short}, 500 bits {long}, without a lead {}", scatter(0.0, 500));
    assert!(long < 0.15 * short, "{short} {long}");
    assert!(long < 0.7 * scatter(0.0, 500), "{long}");
}

/// e^{jφ} and quotients against the closed forms.
#[test]
fn complex_numbers() {
    let turned = Complex::turned(PI / 3.0);
    assert!((turned.re - 0.5).abs() < 1e-15 && (turned.im - 0.75_f64.sqrt()).abs() < 1e-15);
    let z = Complex { re: 1.0_f64, im: 2.0 } / Complex { re: 3.0, im: -4.0 };
    assert!((z.re + 0.2).abs() < 1e-15 && (z.im - 0.4).abs() < 1e-15);
}
