//! What the papers print. Every number as it stands there, in the unit that it has there.

/// The root mean square errors of one estimator, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedErrors {
    /// Of the angle.
    pub angle: f64,
    /// Of the phase shift.
    pub phase: f64,
}

/// S Table I.
pub mod s_table_i {
    /// Amplitude of the driving voltage in V; the same row says 0 V to 60 V.
    pub const DRIVE_V: f64 = 30.0;
    /// Amplitude of the carrier in V.
    pub const CARRIER_V: f64 = 6.0;
    /// Resonance in kHz.
    pub const RESONANCE_KHZ: f64 = 15.50;
    /// Lowest and highest frequency of the drive in kHz.
    pub const DRIVE_KHZ: [f64; 2] = [31.11, 31.50];
    /// Bias of the ring-down in V.
    pub const BIAS_V: f64 = 23.76;
}

/// The circuit in S Table I.
pub mod s_table_i_circuit {
    /// The carrier in Hz.
    pub const CARRIER_HZ: f64 = 500e3;
    /// The amplifier's feedback resistance in Ω.
    pub const FEEDBACK_OHM: f64 = 17.86e3;
    /// The cut-off of the high-pass in Hz.
    pub const HIGH_PASS_HZ: f64 = 482e3;
    /// The cut-offs of the low-pass stage and of the envelope detector in Hz.
    pub const LOW_PASS_HZ: [f64; 2] = [40.8e3, 41.1e3];
}

/// S Figure 10, section IV-C: the phases of x in degrees.
pub mod s_figure_10 {
    /// Of the calibration before the experiment.
    pub const CALIBRATED_DEG: f64 = 380.143;
    /// Tuned by hand.
    pub const TUNED_DEG: f64 = 379.398;
}

/// D Table 5.1 where it differs from S Table I, and the text above it.
pub mod d_table_5_1 {
    /// Lowest and highest frequency of the drive in kHz.
    pub const DRIVE_KHZ: [f64; 2] = [31.10, 31.15];
    /// Amplitude of the carrier in V, in section 5.4.2; the table says 6.
    pub const CARRIER_IN_TEXT_V: f64 = 12.0;
}

/// S Table II; D Table 5.2 prints the same values.
pub mod s_table_ii {
    /// k in 1e-4 N m.
    pub const STIFFNESS: f64 = 1.10;
    /// b in 1e-12 N m s.
    pub const DAMPING: f64 = 5.95;
    /// Q_θ in (rad/s²)² per sample; the table's unit is m/s².
    pub const PROCESS_NOISE: f64 = 1e11;
    /// θ₀ in rad.
    pub const ANGULAR_WIDTH: f64 = 0.2;
    /// C₀ in pF.
    pub const NOMINAL_PF: f64 = 5.71;
}

/// S Table III: actuator model alone, EKF and UKF.
pub mod s_table_iii {
    use super::PublishedErrors;
    /// ACM: the actuator model alone.
    pub const MODEL: PublishedErrors = PublishedErrors { angle: 2.89, phase: 2.73 };
    /// The extended filter.
    pub const EKF: PublishedErrors = PublishedErrors { angle: 0.89, phase: 0.68 };
    /// The unscented filter.
    pub const UKF: PublishedErrors = PublishedErrors { angle: 0.62, phase: 0.38 };
}

/// D Table 5.3: EKF and UKF.
pub mod d_table_5_3 {
    use super::PublishedErrors;
    /// The extended filter.
    pub const EKF: PublishedErrors = PublishedErrors { angle: 5.04, phase: 1.82 };
    /// The unscented filter.
    pub const UKF: PublishedErrors = PublishedErrors { angle: 0.63, phase: 0.39 };
}

/// S section II-A with equation 7, and section IV-C: target phase accuracy in degrees.
pub mod s_target {
    /// Pixels along a line of the image, pixels of shift, degrees.
    pub const TARGETS: [(u32, u32, f64); 4] =
        [(300, 1, 0.38), (300, 2, 0.76), (400, 1, 0.29), (400, 2, 0.57)];
}

/// D section 5.3.1, equation 79.
pub mod d_target {
    /// Sampling intervals that count as resolution.
    pub const INTERVALS: f64 = 2.0;
    /// Sampling rate in Hz.
    pub const SAMPLING_HZ: f64 = 10e6;
    /// Resonance in Hz.
    pub const RESONANCE_HZ: f64 = 15.5e3;
    /// The target that is printed, in degrees.
    pub const PRINTED_DEG: f64 = 0.18;
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// The paper's own percentages follow from its own table.
    #[test]
    fn the_reductions_that_are_printed_follow_from_the_table() {
        let reduced = |from: f64, to: f64| (1000.0 * (1.0 - to / from)).round() / 10.0;
        let (model, ekf, ukf) = (s_table_iii::MODEL, s_table_iii::EKF, s_table_iii::UKF);
        assert_eq!(reduced(model.angle, ekf.angle), 69.2);
        assert_eq!(reduced(model.phase, ekf.phase), 75.1);
        assert_eq!(reduced(model.angle, ukf.angle), 78.5);
        assert_eq!(reduced(model.phase, ukf.phase), 86.1);
    }

    /// Every constant stands in the text of its paper, in its row.
    #[test]
    #[ignore = "needs the papers: KALMEMS_REFERENCE_DATA"]
    fn the_papers_print_these_numbers() {
        let folder = PathBuf::from(std::env::var_os("KALMEMS_REFERENCE_DATA").unwrap()).join("papers");
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
        let (s, d) = (read("chen-2020-shared-electrodes.txt"), read("chen-2018-dissertation.txt"));
        let (model, ekf, ukf) = (s_table_iii::MODEL, s_table_iii::EKF, s_table_iii::UKF);
        let [low, high] = s_table_i::DRIVE_KHZ;
        let mut expected = vec![
            format!("{:.0} V (0 V to {:.0}V)", s_table_i::DRIVE_V, 2.0 * s_table_i::DRIVE_V),
            format!("Amplitude of carrier voltage\t{:.0} V", s_table_i::CARRIER_V),
            format!("Resonant frequency of micro-scanner\t{:.2} kHz", s_table_i::RESONANCE_KHZ),
            format!("Frequency of driving voltage\t{low:.2} to {high:.2} kHz"),
            format!("Bias voltage\t{:.2} V", s_table_i::BIAS_V),
            format!("Frequency of carrier voltage\t{} kHz", s_table_i_circuit::CARRIER_HZ / 1e3),
            format!("Feedback resistors\t{} kohm", s_table_i_circuit::FEEDBACK_OHM / 1e3),
            format!("HPF cut-off frequency\t{} kHz", s_table_i_circuit::HIGH_PASS_HZ / 1e3),
            format!("LPF cut-off frequency\t{} kHz", s_table_i_circuit::LOW_PASS_HZ[0] / 1e3),
            format!("Envelop detector LPF cut-off\t{} kHz", s_table_i_circuit::LOW_PASS_HZ[1] / 1e3),
            format!("{} degree for x-axis and", s_figure_10::CALIBRATED_DEG),
            format!("({} degree for x-axis)", s_figure_10::TUNED_DEG),
            format!("Spring constant\t{:.2} × 10⁻⁴ N m", s_table_ii::STIFFNESS),
            format!("Viscous damping coefficient\t{:.2} × 10⁻¹² N m/s", s_table_ii::DAMPING),
            "Noise variance of angular position\t10¹¹ m/s".to_owned(),
            format!("Nominal angular displacement\t{} rad", s_table_ii::ANGULAR_WIDTH),
            format!("Nominal capacitance\t{} pF", s_table_ii::NOMINAL_PF),
            format!("ACM\t{}\t{}", model.angle, model.phase),
            format!("EKF\t{} (reduced 69.2%)\t{} (reduced 75.1%)", ekf.angle, ekf.phase),
            format!("UKF\t{} (reduced 78.5%)\t{} (reduced 86.1%)", ukf.angle, ukf.phase),
        ];
        for (_, _, degrees) in s_target::TARGETS {
            expected.push(format!("{degrees} deg"));
        }
        // The text sets some exponents apart.
        let s = s.replace("<sup>", "").replace("</sup>", "").replace(" ⁻", "⁻").replace(" ¹", "¹");
        for row in expected {
            assert!(s.contains(&row), "not in the paper: {row}");
        }
        assert_eq!(s_table_ii::PROCESS_NOISE, 1e11);

        let [low, high] = d_table_5_1::DRIVE_KHZ;
        let (ekf, ukf) = (d_table_5_3::EKF, d_table_5_3::UKF);
        for row in [
            format!("Frequency of driving voltage\t{low:.2} to {high:.2} kHz"),
            format!("500 kHz in and {:.0} V amplitude", d_table_5_1::CARRIER_IN_TEXT_V),
            format!("Amplitude of carrier voltage\t{:.0} V", s_table_i::CARRIER_V),
            format!("EKF\t{}\t{}", ekf.angle, ekf.phase),
            format!("UKF\t{}\t{}", ukf.angle, ukf.phase),
            format!("to be {:.0} MHz", d_target::SAMPLING_HZ / 1e6),
            format!("to be {} kHz", d_target::RESONANCE_HZ / 1e3),
            format!("$\\alpha$  to be {}", d_target::INTERVALS),
            format!("computed to be {} degrees", d_target::PRINTED_DEG),
        ] {
            assert!(d.contains(&row), "not in the dissertation: {row}");
        }
    }
}
