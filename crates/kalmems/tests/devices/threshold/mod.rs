//! Experiments with the threshold-sensing scanner, recorded or simulated.

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;
use kalmems::workflow::{estimate, estimate_computed};
use std::path::{Path, PathBuf};

pub const USUAL_CROSSINGS: &str = "{ width = \"30 us\", separation = \"300 us\", threshold = 4 }";

/// What a filter is told, and how it estimates.
#[derive(Clone)]
pub struct Case {
    pub gain: &'static str,
    pub steepness: &'static str,
    pub natural_hz: &'static str,
    pub centre: &'static str,
    pub feedthrough: &'static str,
    pub density: &'static str,
    pub crossings: &'static str,
    pub reference: &'static str,
    pub driven: bool,
    pub filter: String,
    pub second: Option<String>,
}

impl Default for Case {
    fn default() -> Self {
        Self {
            gain: "2.82e-3",
            steepness: "76",
            natural_hz: "624.6",
            centre: "0.0037",
            feedthrough: "0 F",
            density: "1e3",
            crossings: USUAL_CROSSINGS,
            reference: "file = \"truth.csv\"\nchannels = { angle = \"angle_rad\", rate = \"rate_rad_per_s\" }",
            driven: false,
            filter: String::new(),
            second: None,
        }
    }
}

fn reference_folder() -> PathBuf {
    let root = std::env::var("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    Path::new(&root).join("recordings/threshold-nominal")
}

/// What the independent estimator reached.
pub fn expected() -> serde_json::Value {
    let text = std::fs::read_to_string(reference_folder().join("expected.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

impl Case {
    /// A mismatch that leads to the published errors.
    pub fn published_level_a() -> Self {
        Self {
            gain: "3.098898e-3",
            steepness: "54.4844",
            natural_hz: "629.5968",
            centre: "0.0077",
            density: "4758",
            ..Self::default()
        }
    }

    /// Another one.
    pub fn published_level_b() -> Self {
        Self {
            gain: "3.06816e-3",
            steepness: "57.912",
            natural_hz: "629.15958",
            centre: "0",
            density: "2339",
            ..Self::default()
        }
    }

    /// The experiment; its recording is beside it, or simulated.
    pub fn experiment(&self) -> Experiment {
        self.at(Path::new("experiment.toml"))
    }

    fn at(&self, path: &Path) -> Experiment {
        let device = device(self);
        let (reference, density) = (self.reference, self.density);
        let crossings = match self.crossings {
            "" => String::new(),
            crossings => format!("crossings = {crossings}\n"),
        };
        let start = if self.driven {
            // Near the motion that `driven` settles to.
            "start = { angle = \"0.09 rad\", rate = \"490 rad/s\" }\nstart_sd = { angle = \"5 mrad\", rate = \"20 rad/s\" }"
        } else {
            "start = { angle = \"-0.10193 rad\", rate = \"413.356 rad/s\" }\n\
             start_sd = { angle = \"5 mrad\", rate = \"20 rad/s\" }"
        };
        let filters: Vec<String> = [("first", Some(&self.filter)), ("second", self.second.as_ref())]
            .into_iter()
            .filter_map(|(name, settings)| settings.map(|settings| (name, settings)))
            .map(|(name, settings)| {
                format!("\n[[estimate.filter]]\nname = \"{name}\"\nmethod = \"ekf\"\n{start}\n{settings}\n")
            })
            .collect();
        let text = format!(
            "{device}\n[[recording]]\nrole = \"ring_down\"\nfile = \"recording.csv\"\nclock = {{ column = \"time_s\" }}\n\
             channels = {{ drive = \"drive_V\", signal = \"cap_V\" }}\n[recording.reference]\n{reference}\n\
             [estimate]\nskip = \"0 s\"\nparts = 4\n{crossings}\
             process_noise = {{ angular_acceleration = \"{density} rad^2/s^3\" }}\n{}",
            filters.concat()
        );
        published().parse(&text, path).unwrap_or_else(|e| panic!("{e}"))
    }

    /// The figures on the reference recording.
    pub fn metrics(&self) -> Metrics {
        let experiment = self.at(&reference_folder().join("experiment.toml"));
        Metrics::of(&estimate(published(), &experiment, &Silent).unwrap())
    }

    /// The errors on the reference recording in rad, part by part and as a whole.
    pub fn run_reference(&self) -> Vec<f64> {
        let metrics = self.metrics();
        let errors = metrics.estimators().next().unwrap().errors.clone().unwrap();
        let parts = errors.parts.iter().map(|part| part.rmse_deg);
        parts.chain([errors.angle.rmse_deg]).map(f64::to_radians).collect()
    }
}

fn device(case: &Case) -> String {
    let Case { gain, steepness, natural_hz, centre, feedthrough, .. } = case;
    let drive =
        if case.driven { "[device.threshold_scanner.drive]\ngain = \"60 rad/s^2/V^2\"\n" } else { "" };
    format!(
        "name = \"threshold\"\n\
         [device.threshold_scanner.resonator]\nnatural_frequency = \"{natural_hz} Hz\"\ndamping_ratio = 0.0066\n\
         [device.threshold_scanner.comb]\nthreshold_angle = \"{centre} rad\"\ngain = \"{gain} V s/rad\"\n\
         steepness = \"{steepness} 1/rad\"\n\
         [device.threshold_scanner.readout]\nfeedback_resistance = \"10 Mohm\"\nbias = \"10 V\"\noffset = \"0 V\"\n\
         feedthrough_capacitance = \"{feedthrough}\"\nnoise_variance = \"1.89225e-3 V^2\"\n\
         [device.threshold_scanner.position_detector]\ngain = \"0.5 mm/V\"\ndistance = \"32.7 mm\"\n\
         noise_variance = \"2.5e-5 V^2\"\n{drive}"
    )
}

/// The true device and its simulation, but for the drive; a driven one where its feedthrough is not 0.
pub fn text(feedthrough: &'static str) -> String {
    let is_driven = !feedthrough.is_empty();
    let case =
        Case { feedthrough: if is_driven { feedthrough } else { "0 F" }, driven: true, ..Case::default() };
    format!(
        "{}\n[simulate]\nduration = \"80 ms\"\nsampling_rate = \"500 kHz\"\nintegration_rate = \"500 kHz\"\n\
         start = {{ angle = \"-0.105 rad\", rate = \"420 rad/s\" }}\nseed = 1\n",
        device(&case)
    )
}

fn run(text: &str) -> ComputedRecording {
    let experiment = published().parse(text, Path::new("simulation.toml")).unwrap_or_else(|e| panic!("{e}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    ComputedRecording::of(&*simulation, &Silent).unwrap()
}

/// A free decay as that of the reference recording; `more` are keys of `[simulate]`, or `still` for no motion.
pub fn simulated(seed: u64, more: &str) -> ComputedRecording {
    let mut text = text("").replace("seed = 1", &format!("seed = {seed}"));
    if more == "still" {
        text = text.replace("\"-0.105 rad\", rate = \"420 rad/s\"", "\"0 rad\", rate = \"0 rad/s\"");
    } else {
        text += more;
    }
    run(&(text + "\n[simulate.drive.constant]\nvoltage = \"0 V\"\n"))
}

/// 80 ms of steady motion under a raised cosine of 60 V, with a feedthrough of 0.2 pF.
pub fn driven(seed: u64) -> ComputedRecording {
    driven_with(seed, "")
}

/// The same with more keys of `[simulate.drive.capture]`.
pub fn driven_with(seed: u64, more: &str) -> ComputedRecording {
    let text = text("0.2 pF").replace("seed = 1", &format!("seed = {seed}"));
    let drive = "\n[simulate.drive.capture]\nvoltage = \"60 V\"\nfrom = \"1600 Hz\"\nto = \"1266 Hz\"\nsweep = \"2 s\"\n\
                 hold = \"0.3 s\"\n";
    run(&(text.replace("\"-0.105 rad\", rate = \"420 rad/s\"", "\"1 mrad\", rate = \"0 rad/s\"")
        + drive
        + more))
}

pub fn metrics_of(case: &Case, recording: &ComputedRecording) -> Metrics {
    let named = "file = \"reference.csv\"\nchannels = { angle = \"angle_rad\", rate = \"rate_rad_per_s\" }\n";
    let late = if case.reference.starts_with("delay") { case.reference } else { "" };
    let reference = Box::leak((named.to_owned() + late).into_boxed_str());
    let experiment = Case { reference, ..case.clone() }.experiment();
    Metrics::of(&estimate_computed(published(), &experiment, recording, &Silent).unwrap())
}

/// The error of the first filter's angle over the whole recording, in rad.
pub fn rmse_rad(case: &Case, recording: &ComputedRecording) -> f64 {
    let metrics = metrics_of(case, recording);
    let estimator = metrics.estimators().next().unwrap();
    assert!(estimator.failure.is_none(), "{:?}", estimator.failure);
    estimator.errors.as_ref().unwrap().angle.rmse_deg.to_radians()
}

/// The crossings that the first filter was told of.
pub fn crossings_at(case: &Case, recording: &ComputedRecording) -> usize {
    metrics_of(case, recording).estimators().next().unwrap().counts.crossings
}
