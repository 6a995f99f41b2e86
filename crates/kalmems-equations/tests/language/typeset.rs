//! Equations as they are written by hand.

use crate::common::example;

#[test]
fn the_published_devices_read_as_in_their_papers() {
    for name in
        ["shared_scanner", "two_axes", "threshold_scanner", "accelerometer", "micro_stage", "piston_mirror"]
    {
        insta::assert_snapshot!(name, example(name).typeset().join("\n"));
    }
}
