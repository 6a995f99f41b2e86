//! Every filter on every model, corrected in every way, in f64 and f32.
//!
//! A device is simulated with its own process and noise, so that the truth is known and the model is right.

mod any;
mod banks;
#[path = "../../../kalmems-core/tests/chance/mod.rs"]
mod chance;
mod devices;
mod filters;
mod follow;
mod judge;
mod late;
mod nees;
mod others;
mod recording;
mod smoothing;
mod updates;

/// A test of each of these checks on each device, in each of these numbers.
macro_rules! checks {
    ($($name:ident: $device:expr, [$($test:ident: $check:ident::<$number:ty>),*];)*) => {$(
        mod $name {
            #[allow(unused_imports)]
            use super::{any::*, devices::*, late, smoothing, updates};
            $(
                #[test]
                fn $test() {
                    $check::check::<$number, _, _, _, _>(&$device, &$device);
                }
            )*
        }
    )*};
}

checks! {
    the_scanner: one(scanner(demodulated())), [
        updates: updates::<f64>, updates_in_f32: updates::<f32>,
        late: late::<f64>, late_in_f32: late::<f32>,
        smoothing: smoothing::<f64>, smoothing_in_f32: smoothing::<f32>
    ];
    the_scanner_and_its_angle: one(scanner(angle())), [updates: updates::<f64>];
    the_scanner_and_two_sensors: two(scanner(comb_and_light())), [
        updates: updates::<f64>, updates_in_f32: updates::<f32>,
        late: late::<f64>, smoothing: smoothing::<f64>
    ];
    the_scanner_by_euler: one(scanner_by_euler(demodulated())), [updates: updates::<f64>, updates_in_f32: updates::<f32>];
    the_scaled_scanner: one(scaled()), [updates: updates::<f64>, updates_in_f32: updates::<f32>, smoothing: smoothing::<f64>];
    the_scaled_process: one(scaled_process()), [updates: updates::<f64>];
    the_irregular_scanner: irregular_scanner(demodulated()), [
        updates: updates::<f64>, updates_in_f32: updates::<f32>,
        late: late::<f64>, smoothing: smoothing::<f64>
    ];
    the_augmented_scanner: augmented(), [
        updates: updates::<f64>, updates_in_f32: updates::<f32>,
        late: late::<f64>, smoothing: smoothing::<f64>,
        smoothing_in_f32: smoothing::<f32>
    ];
    a_duffing_resonator: one(duffing(angle())), [updates: updates::<f64>, updates_in_f32: updates::<f32>, late: late::<f64>];
    a_duffing_resonator_and_its_comb: one(duffing(demodulated())), [updates: updates::<f64>];
    a_duffing_resonator_and_two_sensors: two(duffing(angle_and_rate())), [updates: updates::<f64>];
    a_linear_resonator: one(resonator(angle())), [
        updates: updates::<f64>, updates_in_f32: updates::<f32>,
        late: late::<f64>, smoothing: smoothing::<f64>
    ];
    a_linear_resonator_and_its_comb: one(resonator(demodulated())), [updates: updates::<f64>];
    a_linear_resonator_and_two_sensors: two(resonator(angle_and_rate())), [updates: updates::<f64>, updates_in_f32: updates::<f32>];
}
