//! Equations as they are written by hand.

use crate::common::example;
use kalmems_equations::{Description, Device};

#[test]
fn the_published_devices_read_as_in_their_papers() {
    for name in
        ["shared_scanner", "two_axes", "threshold_scanner", "accelerometer", "micro_stage", "piston_mirror"]
    {
        insta::assert_snapshot!(name, example(name).typeset().join("\n"));
    }
}

#[test]
fn conditions_stand_in_brackets_where_they_hold_together_less_tightly() {
    let text = "states = { x = \"m\" }\nderivative = { x = \"if((x > 1[m] or x < 0) and not (x < 2[m] and x > 3[m]), floor(x/1[m])*1[m/s], atan2(x, 1[m])*1[m/s])\" }\nmeasure = { signal = \"x in m\" }\n";
    let device = Device::of(&Description::read(text).unwrap()).unwrap();
    assert_eq!(
        device.typeset()[0],
        "dx/dt = {⌊x/1 m⌋·1 m/s if (1 m < x or x < 0) and not (x < 2 m and 3 m < x), atan2(x, 1 m)·1 m/s else}"
    );
}

#[test]
fn a_number_that_is_written_in_brackets_with_its_unit_stays_in_them() {
    let text = "states = { x = \"m\", v = \"m/s\" }\nderivative = { x = \"v\", v = \"-(10[1/s])^2*x\" }\nmeasure = { signal = \"x in m\" }\n";
    let device = Device::of(&Description::read(text).unwrap()).unwrap();
    let lines = device.typeset();
    assert!(lines[1].contains("(10 1/s)²"), "{lines:?}");
}
