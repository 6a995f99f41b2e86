//! What the thesis prints.

/// Table I and what it is said to lead to.
pub mod device {
    /// Real parts of both eigenvalues in rad/s (equation 5-4).
    pub const EIGENVALUES: [f64; 2] = [-0.0439e5, -1.7982e5];
    /// Figure 8, in Hz: "around 500 rad/s or 80 Hz".
    pub const OPEN_BANDWIDTH_HZ: f64 = 80.0;
    /// Figure 10, in Hz.
    pub const CLOSED_BANDWIDTH_HZ: f64 = 80e3;
    /// Section 2.2.5, in V/g: "about 1 mV/g".
    pub const CLOSED_SENSITIVITY_V_PER_G: f64 = 1e-3;
    /// Section 5.1, in g/√Hz.
    pub const BROWNIAN_G: f64 = 500e-6;
    /// Section 5.1, in g.
    pub const ELECTRONIC_G: f64 = 0.02;
    /// Section 3.1.2, in g/√Hz.
    pub const ELECTRONIC_G_PER_ROOT_HZ: f64 = 20e-6;
    /// From where on the open loop is "unstable", in g.
    pub const PULL_IN_G: f64 = 5.0;
}

/// Table II; both as they enter a filter.
pub mod noise {
    /// Q as the density of a force, in N²/Hz, two-sided; printed in N.
    pub const Q: f64 = 3.35e-23;
    /// R as the variance of a sample, in V²; printed in V.
    pub const R: f64 = 4.88e-8;
}

/// A row of Table III: the acceleration in g, then SNR in dB and largest displacement in m for each structure.
pub struct Structures {
    pub amplitude_g: f64,
    pub open: Option<(f64, f64)>,
    pub closed: Option<(f64, f64)>,
    pub observed: Option<(f64, f64)>,
}

/// Table III; ">40 dB" stands as 40.
pub const STRUCTURES: [Structures; 4] = [
    Structures {
        amplitude_g: 0.1,
        open: Some((40.0, 7e-9)),
        closed: Some((4.0, 4e-10)),
        observed: Some((12.0, 4e-10)),
    },
    Structures {
        amplitude_g: 1.0,
        open: Some((40.0, 7e-8)),
        closed: Some((24.0, 4e-9)),
        observed: Some((32.0, 4e-9)),
    },
    Structures { amplitude_g: 5.0, open: None, closed: None, observed: None },
    Structures { amplitude_g: 10.0, open: None, closed: Some((40.0, 4e-8)), observed: Some((40.0, 4e-8)) },
];

/// A row of Table IV.
pub struct Tuning {
    pub words: &'static str,
    /// By how much Q and R are off.
    pub factors: [f64; 2],
    pub snr_db: f64,
    /// The largest error of the displacement, in pm.
    pub largest_pm: f64,
    /// Its standard deviation, in pm.
    pub sd_pm: f64,
}

/// Table IV; ">40 dB" stands as 40.
pub const TUNINGS: [Tuning; 6] = [
    Tuning { words: "exact Q, R", factors: [1.0, 1.0], snr_db: 12.0, largest_pm: 400.0, sd_pm: 28.023 },
    Tuning { words: "Q × 10", factors: [10.0, 1.0], snr_db: 10.0, largest_pm: 200.0, sd_pm: 51.756 },
    Tuning { words: "Q / 10", factors: [0.1, 1.0], snr_db: 24.0, largest_pm: 45.0, sd_pm: 11.336 },
    Tuning { words: "R × 10", factors: [1.0, 10.0], snr_db: 24.0, largest_pm: 15.0, sd_pm: 11.943 },
    Tuning { words: "R / 10", factors: [1.0, 0.1], snr_db: 10.0, largest_pm: 500.0, sd_pm: 52.502 },
    Tuning { words: "R × 10, Q / 10", factors: [0.1, 10.0], snr_db: 40.0, largest_pm: 10.0, sd_pm: 2.7512 },
];
