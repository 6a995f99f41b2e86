//! A motion that is a sine by its table: what of an own device follows from that.

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, Verdict};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::estimate_computed;
use std::path::Path;

/// A voltage that is the square of a sine about a level: the quantity is inverted, and no state is read alone.
const TEXT: &str = r#"
name = "sine"
[device.equations.states]
size = "mm"
pitch = "Hz"
turn = "rad"
middle = "mm"
[device.equations.parameters]
gain = "0.5 V/mm^2"
[device.equations.derivative]
size = "0"
pitch = "0"
turn = "2*pi*pitch"
middle = "0"
[device.equations.quantities]
place = "middle + size*cos(turn) in mm"
speed = "-2*pi*pitch*size*sin(turn) in mm/s"
[device.equations.measure]
signal = "gain*(middle + size*cos(turn))^2 in V"
[device.equations.sine]
of = "place"
rate = "speed"
offset = "middle"
amplitude = "size"
frequency = "pitch"
phase = "turn"
[device.equations.cyclic]
turn = "2*pi"
[device.equations.noise]
signal = "1e-6[V^2]"
[device.equations.range.place]
from = "0 mm"
to = "4 mm"
[simulate]
duration = "0.5 s"
sampling_rate = "10 kHz"
integration_rate = "10 kHz"
seed = 3
drive = { prescribed = {} }
start = { size = "0.8 mm", pitch = "123 Hz", turn = "1 rad", middle = "2 mm" }
[estimate]
skip = "0.2 s"
process_noise = { size = "1e-10 mm^2/s", pitch = "1e-8 Hz^2/s", middle = "1e-10 mm^2/s" }
[[estimate.filter]]
name = "filter"
method = "ekf"
start = "from_signal"
[[estimate.filter]]
name = "loop"
method = "steady_state"
start = "from_signal"
[[estimate.filter]]
name = "cycles"
method = "lock_in"
[[estimate.filter]]
name = "each"
method = "direct_inversion"
"#;

fn parsed(text: &str) -> Experiment {
    published().parse(text, Path::new("nowhere/sine.toml")).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The filter and the loop find the motion from the signal alone and claim what they know; a sine through each cycle and each sample by itself are
/// the coarser answers that they are: 1 mV over the slope 2·gain·place of 1.2 to 2.8 V/mm is 0.5 µm, and √(2/81) of that over a cycle.
#[test]
fn a_sine_is_found_from_the_signal_by_every_method() {
    let experiment = parsed(TEXT);
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let told = described(&experiment, &*simulation);
    let metrics = Metrics::of(&estimate_computed(published(), &told, &simulated, &Silent).unwrap());
    let of = |key: &str| metrics.estimators().find(|one| one.key == key).unwrap();
    for key in ["filter", "loop", "cycles", "each"] {
        println!("{key}: {:.3e} m, {:?}", of(key).values["place"].rmse, of(key).verdict);
    }
    for key in ["filter", "loop"] {
        assert_eq!(of(key).verdict, Verdict::Consistent, "{key}");
        assert!(of(key).values["place"].rmse < 5e-8, "{key}");
    }
    assert!((4e-7..8e-7).contains(&of("each").values["place"].rmse));
    assert!((4e-8..1.5e-7).contains(&of("cycles").values["place"].rmse));
    assert!(of("cycles").values.contains_key("speed"));
}

#[test]
fn mistakes_in_the_table_of_a_sine_are_named() {
    for (from, to, expected) in [
        ("of = \"place\"", "of = \"plaice\"", "`plaice` is not in the table `quantities`"),
        ("offset = \"middle\"", "offset = \"size\"", "`place` is not size + size*cos(turn)"),
        (
            "phase = \"turn\"",
            "phase = \"angle\"",
            "`angle` is not a state; the states are `size`, `pitch`, `turn`, `middle`",
        ),
        (
            "(middle + size*cos(turn))^2 in V",
            "(middle + 2*size*cos(turn))^2 in V",
            "no measurement is one of `place` alone",
        ),
        ("from = \"0 mm\"", "from = \"5 mm\"", "its end is not above its beginning"),
        ("[device.equations.range.place]", "[device.equations.range.plaice]", "plaice"),
    ] {
        assert!(TEXT.contains(from), "{from}");
        let told = TEXT.replace(from, to)
            + "[[recording]]\nrole = \"test\"\nfile = \"a.csv\"\nclock = { column = \"t\" }\nchannels = { signal = \"y_V\" }\n";
        let experiment = published().parse(&told, Path::new("nowhere/sine.toml"));
        let why =
            experiment.and_then(|experiment| published().rig(&experiment)?.wanted(&experiment)).unwrap_err();
        assert!(why.to_string().contains(expected), "{why}");
    }
}
