//! What later samples add to both axes.

use super::{Recorded, TRUTH, Told, errors, from_signal, record, run, told};

/// The example's EKF, smoothed over all of the recording and by 300 µs, its stiffness of x 0.3 % wrong and a state.
fn smoothed(skip_s: f64, density: f64) -> String {
    let lines = "smooth = true\nsmooth_lag = \"300 us\"\n\
                 states = { stiffness_x = { start_sd = \"1 %\", drift = \"1e-7 1/s\" } }\n";
    let model = Told { stiffness: [1.003, 1.0], skip_s, density, ..TRUTH };
    told(&model, &from_signal("EKF", "ekf", lines))
}

fn moving(samples: usize) -> Recorded {
    record(super::hardware().scanner, [-0.117, -12.8e3, 0.082, 4.1e3], 10_000, samples, 5)
}

/// The smoothed state of sample k with a lag of L is what smoothing all of a recording that ends at k + L says.
#[test]
fn a_fixed_lag_of_both_axes_equals_the_smoother_of_a_shorter_recording() {
    let (text, long) = (smoothed(1e-3, 1e4), moving(5000));
    let [_, whole, lagged] = <[_; 3]>::try_from(run(&text, &long)).unwrap();
    assert_eq!((whole.key.as_str(), lagged.key.as_str()), ("ekf_smoothed", "ekf_lagged"));
    for end in [4000, 4777] {
        let cut = |values: &[f64]| values[..end].to_vec();
        let short = Recorded {
            time_s: cut(&long.time_s),
            drive: cut(&long.drive),
            signal: cut(&long.signal),
            states: long.states.clone(),
        };
        let shorter = run(&text, &short);
        let k = end - 1 - 300;
        for (a, b) in shorter[1].states.iter().zip(&lagged.states) {
            let off = (a.mean[k] - b.mean[k]) / a.sd[k];
            assert!(off.abs() < 1e-4 && (a.sd[k] / b.sd[k] - 1.0).abs() < 1e-4, "{end} {}: {off}", a.name);
        }
    }
    for (a, b) in whole.states.iter().zip(&lagged.states) {
        assert!(((a.mean[4800] - b.mean[4800]) / a.sd[4800]).abs() < 1e-4, "{}", a.name);
    }
}

/// The stiffness that is told wrong is found.
#[test]
fn a_wrong_stiffness_of_one_axis_is_found() {
    let (text, recorded) = (smoothed(6e-3, 1e4), moving(12_000));
    let [filtered, whole, _] = <[_; 3]>::try_from(run(&text, &recorded)).unwrap();
    // Not before 1000: over the samples of the start its own answer stands, which later ones do not change.
    for (trajectory, k) in [(&filtered, 11_999), (&whole, 1000)] {
        let state = trajectory.state("stiffness_x").unwrap();
        let (found, sd) = (state.mean[k], state.sd[k]);
        println!("stiffness of x: {found:+.5} ± {sd:.5}");
        // Told 0.3 % too much.
        assert!((found - (1.0 / 1.003 - 1.0)).abs() < 4.0 * sd && sd < 1e-4);
    }
    let online = errors(&filtered, &recorded, 6_000..12_000);
    assert!(online.iter().all(|e| *e < 0.02), "{online:?} deg");
    let consistency = filtered.consistency(filtered.scored(6e-3)).unwrap();
    assert!((consistency.mean_nis - 1.0).abs() < 0.1, "{consistency:?}");
}

/// Where the errors are those of the noise, and not of a few long waves, later samples are seen to help both axes: by as
/// much as the standard deviations say.
#[test]
fn later_samples_help_both_axes() {
    let (text, recorded) = (smoothed(2e-3, 1e8), moving(6_000));
    let trajectories = run(&text, &recorded);
    let over = 2_000..5_000;
    let [online, whole, lagged] = [0, 1, 2].map(|i| errors(&trajectories[i], &recorded, over.clone()));
    println!("online {online:?} deg, smoothed {whole:?} deg, with a lag of 300 us {lagged:?} deg");
    for axis in [0, 1] {
        let claimed = |i: usize| {
            let sd = &trajectories[i].states[2 * axis].sd[over.clone()];
            (sd.iter().map(|sd| sd * sd).sum::<f64>() / sd.len() as f64).sqrt().to_degrees()
        };
        assert!(whole[axis] < 0.8 * online[axis] && lagged[axis] < 0.9 * online[axis]);
        for (i, error) in [(0, online[axis]), (1, whole[axis]), (2, lagged[axis])] {
            assert!((0.5..1.5).contains(&(error / claimed(i))), "{i}: {error} for {}", claimed(i));
        }
    }
}
