//! What the papers print. Every number as it stands there, in the unit that it has there.

/// T Table III, D Table 4.3: root mean square errors of the angle in rad, at the signal-to-noise ratios 85, 22, 5 and 1 and
/// over all.
pub mod table_4_3 {
    /// The heads of the columns.
    pub const HEADS: [&str; 5] = ["SNR 85", "SNR 22", "SNR 5", "SNR 1", "overall"];
    /// EKF.
    pub const EKF: [f64; 5] = [0.0050, 0.0029, 0.0026, 0.0025, 0.0034];
    /// HYB.
    pub const HYBRID: [f64; 5] = [0.0047, 0.0023, 0.0019, 0.0018, 0.0029];
    /// EKF, over the 50 samples after each detection.
    pub const EKF_AFTER: [f64; 5] = [0.0055, 0.0051, 0.0050, 0.0049, 0.0051];
    /// HYB, over the 50 samples after each detection.
    pub const HYBRID_AFTER: [f64; 5] = [0.0041, 0.0045, 0.0049, 0.0045, 0.0045];
    /// By how much HYB is below EKF, in per cent.
    pub const REDUCED: [f64; 5] = [6.9, 21.4, 27.6, 30.3, 15.1];
}

/// T Section IV-B, D Section 4.4.2.
pub mod identified {
    /// f_n in Hz.
    pub const NATURAL_HZ: f64 = 624.6;
    /// ζ.
    pub const DAMPING_RATIO: f64 = 0.0066;
    /// θ_th in rad.
    pub const THRESHOLD: f64 = 0.0037;
}

/// T Section V-A, D Section 4.5.1.
pub mod rates {
    /// The slowest and the fastest sampling rate in kHz.
    pub const SWEPT_KHZ: [f64; 2] = [50.0, 5000.0];
    /// Below this rate the variance rises, in kHz.
    pub const BEST_KHZ: f64 = 1250.0;
    /// Factors of the noise.
    pub const NOISES: [f64; 3] = [0.1, 1.0, 10.0];
}

/// T Section V-B, D Section 4.5.2: factors of N_θ.
pub const STEEPNESS_FACTORS: [f64; 2] = [0.2, 5.0];

/// T Section VI-A, D Section 4.6.1: the narrowest and the widest filter in samples.
pub mod filter {
    /// The Gaussian's standard deviation.
    pub const SIGMA: [f64; 2] = [1.5, 45.0];
    /// Its width as a whole.
    pub const WIDTH: [u32; 2] = [80, 400];
}

/// T Section IV-A: trials of the experiment.
pub const TRIALS: u32 = 10;

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// Every constant stands in the text of its paper.
    #[test]
    #[ignore = "needs the papers: KALMEMS_REFERENCE_DATA"]
    fn the_papers_print_these_numbers() {
        let folder = PathBuf::from(std::env::var_os("KALMEMS_REFERENCE_DATA").unwrap()).join("papers");
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
        let (t, d) = (read("chen-2019-threshold.txt"), read("chen-2018-dissertation.txt"));
        let row = |values: [f64; 5]| values.map(|value| format!("{value:.4}")).join(" ");
        for text in [&t, &d] {
            let text = text.replace('\t', " ");
            for values in [table_4_3::EKF, table_4_3::HYBRID, table_4_3::EKF_AFTER, table_4_3::HYBRID_AFTER] {
                assert!(text.contains(&row(values)), "{}", row(values));
            }
            for words in [
                format!("{} Hz and {}", identified::NATURAL_HZ, identified::DAMPING_RATIO),
                format!("calibrated to be {} rad", identified::THRESHOLD),
                format!("swept from {} kHz to {} MHz", rates::SWEPT_KHZ[0], rates::SWEPT_KHZ[1] / 1e3),
                format!("slower than {} kHz", rates::BEST_KHZ),
                format!("factors of {} and {}", rates::NOISES[0], rates::NOISES[2]),
                format!("swept from {} to {}", STEEPNESS_FACTORS[0], STEEPNESS_FACTORS[1]),
                format!("{} sample points to {}", filter::WIDTH[0], filter::WIDTH[1]),
                format!("swept from {} to {}", filter::SIGMA[0], filter::SIGMA[1]),
            ] {
                assert!(text.contains(&words), "{words}");
            }
        }
        assert!(t.contains(&format!("total {TRIALS} trials")));
        let percent = table_4_3::REDUCED.map(|value| format!("{value}%")).join(" ");
        assert!(t.contains(&format!("θRMSE reduced {percent}")));
    }
}
