//! The published devices from their texts: each is estimated as by its own rig.
//!
//! The recordings are those of the examples; the texts are those of `examples/equations`, with what an example says differently.

use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::recording::Recording;
use kalmems::rigs::published;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file)
}

fn read(file: &str) -> Table {
    std::fs::read_to_string(example(file)).unwrap().parse().unwrap()
}

/// A published device and its text.
struct Preset {
    example: &'static str,
    text: &'static str,
    /// What the example says differently, below the table of the equations.
    says: &'static [[&'static str; 3]],
    /// The recording of the example, by its place, its segment, and what its channels are in the text.
    recording: (usize, &'static str, &'static [[&'static str; 2]]),
    /// The settling time, and the process noise in the words of the rig and of the text.
    skip: &'static str,
    noise: [&'static str; 2],
    /// Where the filters start, likewise.
    start: [&'static str; 2],
    sd: [&'static str; 2],
    /// Parameters as states, likewise, where they are compared.
    states: [&'static str; 2],
    /// The states of the rig and what they are in the text.
    compared: &'static [[&'static str; 2]],
    methods: &'static [&'static str],
    /// How close both are, relative to the largest value.
    close: f64,
}

const FILTERS: [&str; 8] = [
    "model",
    "ekf",
    "ukf",
    "square_root_ekf",
    "square_root_ukf",
    "iterated_ekf",
    "hybrid_ekf",
    "steady_state",
];

const PRESETS: [Preset; 5] = [
    Preset {
        example: "shared_scanner/experiment.toml",
        text: "equations/shared_scanner.toml",
        says: &[["parameters", "k", "1.1033e-4 N m"], ["noise", "signal", "1.92e-4[V^2]"]],
        recording: (0, "", &[["drive", "V"], ["signal", "signal"]]),
        skip: "8 ms",
        noise: ["{ angular_acceleration = \"1e8 rad^2/s^3\" }", "{ omega = \"1e8 rad^2/s^3\" }"],
        start: [
            "{ angle = \"0.05 rad\", rate = \"0 rad/s\" }",
            "{ theta = \"0.05 rad\", omega = \"0 rad/s\" }",
        ],
        sd: [
            "{ angle = \"0.05 rad\", rate = \"5e3 rad/s\" }",
            "{ theta = \"0.05 rad\", omega = \"5e3 rad/s\" }",
        ],
        states: [
            "{ stiffness = { start_sd = \"1 %\" }, gain = { start_sd = \"2 %\" }, offset = { start_sd = \"20 mV\" } }",
            "{ k = { start_sd = \"1 %\" }, gain = { start_sd = \"2 %\" }, offset = { start_sd = \"20 mV\" } }",
        ],
        compared: &[["angle", "theta"], ["rate", "omega"]],
        methods: &[
            "model",
            "ekf",
            "ukf",
            "square_root_ekf",
            "square_root_ukf",
            "iterated_ekf",
            "hybrid_ekf",
            "euler_ekf",
        ],
        close: 1e-12,
    },
    Preset {
        example: "accelerometer/experiment.toml",
        text: "equations/accelerometer.toml",
        says: &[
            ["parameters", "prior_damping", "0.7071"],
            ["parameters", "permittivity", "35.4167512512 pF/m"],
            // Without a loop there is no feedback, and no bias for it.
            ["parameters", "feedback", "0 V"],
            ["parameters", "bias", "0 V"],
            ["parameters", "squeezed", "0"],
            ["parameters", "mass_temperature", "300 K"],
            ["parameters", "boltzmann", "1.380649e-23 N m/K"],
            // Its rig has the Brownian force of the gas as well.
            ["noise", "v", "2*boltzmann*mass_temperature*damping/m^2"],
        ],
        recording: (0, "", &[["signal", "output"]]),
        skip: "20 ms",
        noise: ["", ""],
        start: [
            "{ displacement = \"0 m\", velocity = \"0 m/s\", acceleration = \"0 m/s^2\", jerk = \"0 m/s^3\" }",
            "{ x = \"0 m\", v = \"0 m/s\", a = \"0 m/s^2\", jerk = \"0 m/s^3\" }",
        ],
        sd: [
            "{ displacement = \"10 nm\", velocity = \"10 um/s\", acceleration = \"1 gn\", jerk = \"314 gn/s\" }",
            "{ x = \"10 nm\", v = \"10 um/s\", a = \"1 gn\", jerk = \"314 gn/s\" }",
        ],
        states: ["", ""],
        compared: &[["acceleration", "a"], ["displacement", "x"]],
        methods: &FILTERS,
        // Its rig solves for mean and covariance in continuous time between two samples.
        close: 1e-4,
    },
    Preset {
        example: "micro_stage/experiment.toml",
        text: "equations/micro_stage.toml",
        says: &[],
        recording: (
            1,
            "test1",
            &[
                ["drive", "V"],
                ["signal_1A", "1A"],
                ["signal_1B", "1B"],
                ["signal_2A", "2A"],
                ["signal_2B", "2B"],
            ],
        ),
        skip: "0.6 ms",
        noise: ["{ angular_acceleration = \"20 rad^2/s^3\" }", "{ omega = \"20 rad^2/s^3\" }"],
        start: ["{ angle = \"0 rad\", rate = \"0 rad/s\" }", "{ theta = \"0 rad\", omega = \"0 rad/s\" }"],
        sd: ["{ angle = \"1 mrad\", rate = \"10 rad/s\" }", "{ theta = \"1 mrad\", omega = \"10 rad/s\" }"],
        states: [
            "{ natural_frequency = { start_sd = \"0.1 %\" } }",
            "{ natural_frequency = { start_sd = \"0.1 %\" } }",
        ],
        compared: &[["angle", "theta"], ["rate", "omega"]],
        methods: &["model", "ekf", "ukf", "iterated_ekf"],
        // Its rig takes the drive in the middle of an interval as the mean of both ends, a cubic is taken here; a model alone adds that up.
        close: 1e-3,
    },
    Preset {
        example: "threshold_scanner/experiment.toml",
        text: "equations/threshold_scanner.toml",
        says: &[
            ["parameters", "natural_frequency", "629.6 Hz"],
            ["parameters", "threshold", "7.7 mrad"],
            ["parameters", "gain", "3.1 mV s/rad"],
            ["parameters", "steepness", "54.5 1/rad"],
            ["parameters", "offset", "0 V"],
        ],
        recording: (0, "", &[["drive", "V"], ["signal", "current"]]),
        skip: "2 ms",
        noise: ["{ angular_acceleration = \"4758 rad^2/s^3\" }", "{ omega = \"4758 rad^2/s^3\" }"],
        start: [
            "{ angle = \"-0.102 rad\", rate = \"413 rad/s\" }",
            "{ theta = \"-0.102 rad\", omega = \"413 rad/s\" }",
        ],
        sd: ["{ angle = \"5 mrad\", rate = \"20 rad/s\" }", "{ theta = \"5 mrad\", omega = \"20 rad/s\" }"],
        states: [
            "{ natural_frequency = { start_sd = \"1 %\" } }",
            "{ natural_frequency = { start_sd = \"1 %\" } }",
        ],
        compared: &[["angle", "theta"], ["rate", "omega"]],
        methods: &["model", "ekf", "ukf", "square_root_ekf", "iterated_ekf"],
        close: 1e-12,
    },
    Preset {
        example: "piston_mirror/experiment.toml",
        text: "equations/piston_mirror.toml",
        says: &[
            ["parameters", "C_fixed", "0 F"],
            ["parameters", "C_plate", "109.3 fF"],
            ["parameters", "C_fringe", "0 F"],
        ],
        recording: (0, "", &[["signal", "capacitance"]]),
        skip: "0.2 s",
        noise: [
            "{ frequency = \"1e-8 Hz^2/s\", offset = \"1e-19 m^2/s\", amplitude_rate = \"1e-14 m^2/s^3\" }",
            "{ f = \"1e-8 Hz^2/s\", d0 = \"1e-19 m^2/s\", A_rate = \"1e-14 m^2/s^3\" }",
        ],
        start: [
            "{ amplitude = \"0.45 mm\", frequency = \"500.01 Hz\", phase = \"0.3 rad\", offset = \"0.99 mm\", amplitude_rate = \"0 m/s\" }",
            "{ A = \"0.45 mm\", f = \"500.01 Hz\", phi = \"0.3 rad\", d0 = \"0.99 mm\", A_rate = \"0 m/s\" }",
        ],
        sd: [
            "{ amplitude = \"50 um\", frequency = \"0.1 Hz\", phase = \"0.5 rad\", offset = \"20 um\", amplitude_rate = \"1 mm/s\" }",
            "{ A = \"50 um\", f = \"0.1 Hz\", phi = \"0.5 rad\", d0 = \"20 um\", A_rate = \"1 mm/s\" }",
        ],
        states: ["", ""],
        compared: &[["amplitude", "A"], ["frequency", "f"], ["offset", "d0"]],
        methods: &["ekf", "ukf", "iterated_ekf"],
        // Its rig turns a phasor; here the phase is added up, whole turns taken off.
        close: 1e-10,
    },
];

impl Preset {
    /// The example, or the same with its text for a device, with these filters.
    fn with(&self, side: usize) -> Experiment {
        let mut file = read(self.example);
        let own = side == 1;
        if own {
            let mut device = read(self.text);
            for [table, name, value] in self.says {
                device[*table].as_table_mut().unwrap().insert((*name).into(), Value::String((*value).into()));
            }
            let inputs = device.get_mut("inputs").and_then(Value::as_table_mut);
            let is_input = |name: &str| self.recording.2.iter().any(|[_, own]| *own == name);
            inputs.into_iter().for_each(|inputs| inputs.retain(|name, _| is_input(name)));
            let device = Table::from_iter([("equations".to_owned(), Value::Table(device))]);
            file.insert("device".into(), Value::Table(device));
        }
        let electrodes = file["device"].get_mut("micro_stage").and_then(|stage| stage.get_mut("electrodes"));
        if let Some(electrodes) = electrodes.and_then(Value::as_table_mut) {
            // Stated, so that no recording without a bias is asked for.
            let none = Value::Table("gain = 0.0\nslope = \"0 s\"".parse().unwrap());
            for (_, electrode) in electrodes.iter_mut() {
                electrode.as_table_mut().unwrap().insert("feedthrough".into(), none.clone());
            }
        }
        file.remove("identify");
        let (place, _, channels) = self.recording;
        let mut recording = file["recording"].as_array().unwrap()[place].as_table().unwrap().clone();
        recording.remove("reference");
        recording.insert("role".into(), Value::String("test".into()));
        if own {
            let old = recording["channels"].as_table().unwrap();
            let new = channels.iter().map(|[rig, text]| ((*text).to_owned(), old[*rig].clone())).collect();
            recording.insert("channels".into(), Value::Table(new));
        }
        file.insert("recording".into(), Value::Array(vec![Value::Table(recording)]));
        let mut estimate = format!("skip = \"{}\"\n", self.skip);
        if self.example.starts_with("shared") && !own {
            estimate += "first_peak = \"positive\"\n";
        }
        if !self.noise[side].is_empty() {
            estimate += &format!("process_noise = {}\n", self.noise[side]);
        }
        if !own && self.example.starts_with("threshold") {
            estimate += "crossings = { width = \"30 us\", separation = \"300 us\", threshold = 4 }\n";
        }
        let mut filters = String::new();
        let mut filter = |name: &str, method: &str, more: &str| {
            filters += &format!(
                "[[filter]]\nname = \"{name}\"\nmethod = \"{method}\"\nstart = {}\n",
                self.start[side]
            );
            if method != "model" {
                filters += &format!("start_sd = {}\n", self.sd[side]);
            }
            filters += more;
        };
        for method in self.methods {
            filter(method, method, "");
        }
        if !self.states[side].is_empty() {
            filter("with-states", "ekf", &format!("states = {}\nsmooth = true\n", self.states[side]));
        }
        file.insert("estimate".into(), Value::Table((estimate + &filters).parse().unwrap()));
        let text = toml::to_string(&file).unwrap();
        published().parse(&text, &example(self.example)).unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    fn trajectories(&self, side: usize) -> Vec<Trajectory> {
        let experiment = self.with(side);
        let rig = published().rig(&experiment).unwrap();
        let file = experiment.resolve(&experiment.recording(0).unwrap().file);
        let recording = Recording::read(&file, &rig.layout(&experiment, 0).unwrap()).unwrap();
        let estimates = rig.estimate(&experiment, 0, &recording, &Silent).unwrap();
        let found = estimates.into_iter().find(|estimate| estimate.segment.label.contains(self.recording.1));
        found.unwrap().trajectories
    }
}

/// The largest difference of two states, means and standard deviations, by the largest value of the first.
fn apart(rig: &Trajectory, text: &Trajectory, [of_rig, of_text]: [&str; 2]) -> [f64; 2] {
    let (a, b) = (rig.state(of_rig).unwrap(), text.state(of_text).unwrap());
    // A motion that is mirrored by its first peak is the same motion.
    let sign = if rig.mirrored { -1.0 } else { 1.0 };
    let of = |a: &[f64], b: &[f64], sign: f64| {
        assert_eq!(a.len(), b.len());
        let size = a.iter().filter(|x| x.is_finite()).fold(0.0_f64, |most, x| most.max(x.abs()));
        assert!(a.iter().chain(b).all(|x| x.is_finite()), "{} {of_rig}", rig.key);
        let off = a.iter().zip(b).map(|(a, b)| (sign * a - b).abs()).fold(0.0_f64, f64::max);
        if size > 0.0 { off / size } else { off }
    };
    let sd = if rig.key == "model" { 0.0 } else { of(&a.sd, &b.sd, 1.0) };
    [of(&a.mean, &b.mean, sign), sd]
}

#[test]
fn published_devices_are_estimated_from_their_texts_as_by_their_rigs() {
    let mut problems = Vec::new();
    for preset in &PRESETS {
        let (rig, text) = (preset.trajectories(0), preset.trajectories(1));
        assert_eq!(rig.len(), text.len(), "{}", preset.text);
        for (rig, text) in rig.iter().zip(&text) {
            for names in preset.compared {
                let [mean, sd] = apart(rig, text, *names);
                println!("{:32} {:24} {:12} mean {mean:.1e} sd {sd:.1e}", preset.text, rig.key, names[0]);
                if !(mean < preset.close && sd < preset.close) {
                    problems.push(format!("{} {} {}: {mean:.1e} {sd:.1e}", preset.text, rig.key, names[0]));
                }
            }
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}
