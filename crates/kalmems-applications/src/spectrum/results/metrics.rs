//! What is said of a spectrum.

use crate::config::Quantity;
use crate::spectrum::{
    CoaddedNoise, LineErrorContribution, MeasuredLine, PhaseCorrection, Recalibration, ScanCounts,
    SpectrumOutcome,
};
use kalmems_engines::topics::link;
use kalmems_figures::significant;
use serde::Serialize;

const PER_CM: f64 = 100.0;

/// What is said of a spectrum.
#[derive(Clone, Debug, Serialize)]
pub struct SpectrumMetrics {
    /// Its name.
    pub name: String,
    /// The result in sentences: each line that was asked for, or how fine the spectrum is.
    pub answer: Vec<String>,
    /// Scans that were added.
    pub scans: usize,
    /// Those in which the path grew.
    pub forward_scans: usize,
    /// What became of the samples, along a trajectory.
    pub samples: Option<ScanCounts>,
    /// Gaps in the trajectory, in which nothing was interpolated.
    pub gaps: usize,
    /// What a trajectory may be off by between its samples, in nm of position.
    pub interpolation_error_nm: Option<f64>,
    /// The position that counts as the zero path in mm.
    pub zero_path_mm: Option<f64>,
    /// The root mean square of where the scans' zero paths lie about their mean, in nm of path.
    pub misregistration_rms_nm: Option<f64>,
    /// How much later than taken the detector shows the motion, by what forward and backward scans differ by, in ns.
    pub residual_delay_ns: Option<f64>,
    /// The standard error of that.
    pub residual_delay_sd_ns: Option<f64>,
    /// Whether the detector's delay is taken away with the phase, so that there is none to be told.
    pub delay_is_hidden: bool,
    /// Whether the light lowers the detector's value.
    pub inverted: bool,
    /// The largest path difference in mm.
    pub largest_path_difference_mm: f64,
    /// The width of a line at half its height in 1/cm.
    pub resolution_per_cm: f64,
    /// From one value of the spectrum to the next, in 1/cm.
    pub step_per_cm: f64,
    /// The largest wavenumber that the samples can tell from lower ones where they are furthest apart, in 1/cm.
    pub limit_per_cm: f64,
    /// Whether wanted wavenumbers lie above that, so that lower ones may show there.
    pub band_beyond_limit: bool,
    /// The noise of the mean of the first scans.
    pub noise: Vec<CoaddedNoise>,
    /// The lines that were asked for.
    pub lines: Vec<LineMetrics>,
    /// The scale of positions by the lines that are known.
    pub recalibration: Option<Recalibration>,
    /// What to write in the experiment.
    pub correction: Option<CorrectionMetrics>,
    /// Against what it should be.
    pub reference: Option<SpectrumReferenceMetrics>,
    /// What was found in the files and does not keep them from being used.
    pub findings: Vec<String>,
}

/// What is said of a line.
#[derive(Clone, Debug, Serialize)]
pub struct LineMetrics {
    /// Where it was looked for, in 1/cm.
    pub asked_per_cm: f64,
    /// Where it is, in 1/cm; none where there is no line.
    pub found_per_cm: Option<f64>,
    /// The standard error of that according to the scatter of the scans, which is one entry of the budget.
    pub found_sd_per_cm: Option<f64>,
    /// How high it is, in the unit of the spectrum.
    pub height: Option<f64>,
    /// The standard error of that.
    pub height_sd: Option<f64>,
    /// Height over the noise of the mean.
    pub snr: Option<f64>,
    /// Found minus known, in 1/cm.
    pub from_known_per_cm: Option<f64>,
    /// Found minus where it is in the spectrum along the true trajectory, in 1/cm.
    pub shift_per_cm: Option<f64>,
    /// Its height over that in the spectrum along the true trajectory.
    pub relative_height: Option<f64>,
    /// What its wavenumber may be off by.
    pub budget: Vec<ContributionMetrics>,
    /// The root of the sum of the squares of the budget, in 1/cm.
    pub total_sd_per_cm: f64,
}

/// One contribution to a budget.
#[derive(Clone, Debug, Serialize)]
pub struct ContributionMetrics {
    /// What it is.
    pub of: String,
    /// By how much the line is shifted for certain, in 1/cm.
    pub shift_per_cm: f64,
    /// The standard deviation of what it may be shifted by, in 1/cm.
    pub sd_per_cm: f64,
    /// What is left of its height, at one standard deviation.
    pub height: f64,
}

/// What to write in an experiment.
#[derive(Clone, Debug, Serialize)]
pub struct CorrectionMetrics {
    /// The key.
    pub key: &'static str,
    /// What it is there.
    pub was: String,
    /// What to write.
    pub write: String,
    /// The standard error of that.
    pub sd: Option<String>,
}

/// Against what a spectrum should be.
#[derive(Clone, Debug, Serialize)]
pub struct SpectrumReferenceMetrics {
    /// Wavenumbers that were compared.
    pub points: usize,
    /// What the spectrum was multiplied by to be compared.
    pub scale: f64,
    /// The root mean square of the difference over the reference's largest value.
    pub rms_over_peak: f64,
    /// Where it differs most, in 1/cm.
    pub worst_at_per_cm: f64,
    /// By how much there, over the same.
    pub worst_over_peak: f64,
}

impl SpectrumMetrics {
    /// Of a spectrum.
    pub fn of(outcome: &SpectrumOutcome) -> Self {
        let processed = &outcome.processed;
        let scans = &processed.scans;
        let last = scans.grid.wavenumber(scans.grid.points.saturating_sub(1));
        let shifts = &processed.misregistration_m;
        let square = shifts.iter().map(|shift| shift * shift).sum::<f64>() / shifts.len().max(1) as f64;
        let noise = outcome.noise.last().map(|noise| noise.noise);
        let ideal = outcome.comparison.as_ref().map(|comparison| comparison.lines.as_slice());
        let lines = outcome.file.lines.iter().zip(&outcome.lines).zip(&outcome.budgets).enumerate();
        let lines = lines.map(|(index, ((asked, found), budget))| {
            let ideal = ideal.and_then(|lines| *lines.get(index)?);
            let known = asked.known.as_ref().map(Quantity::si);
            LineMetrics::of(asked.wavenumber.si(), known, found.as_ref(), ideal.as_ref(), (noise, budget))
        });
        let lines: Vec<LineMetrics> = lines.collect();
        Self {
            name: outcome.file.name.to_string(),
            answer: answer(&lines, resolution_per_cm(outcome), outcome.noise.last()),
            scans: scans.spectra.len(),
            forward_scans: scans.forward.iter().filter(|forward| **forward).count(),
            samples: processed.counts,
            gaps: outcome.gaps,
            interpolation_error_nm: outcome.interpolation_error_m.map(|error| error * 1e9),
            zero_path_mm: processed.counts.and(processed.zero_m).map(|zero| zero * 1e3),
            misregistration_rms_nm: (shifts.len() > 1).then(|| square.sqrt() * 1e9),
            residual_delay_ns: outcome.residual_delay_s.map(|(delay, _)| delay * 1e9),
            residual_delay_sd_ns: outcome.residual_delay_s.map(|(_, sd)| sd * 1e9),
            delay_is_hidden: outcome.file.transform.phase != PhaseCorrection::None && scans.spectra.len() > 1,
            inverted: processed.inverted,
            largest_path_difference_mm: processed.largest_m * 1e3,
            resolution_per_cm: resolution_per_cm(outcome),
            step_per_cm: scans.grid.step_per_m / PER_CM,
            limit_per_cm: processed.limit_per_m / PER_CM,
            band_beyond_limit: last > processed.limit_per_m * (1.0 + 1e-9),
            noise: outcome.noise.clone(),
            lines,
            recalibration: outcome.recalibration,
            correction: outcome.correction.as_ref().map(|correction| CorrectionMetrics {
                key: correction.key,
                was: correction.was.clone(),
                write: format!("{:.9} mm", correction.is_m * 1e3),
                sd: correction.sd_m.map(|sd| format!("{:.9} mm", sd * 1e3)),
            }),
            reference: outcome.comparison.as_ref().map(|comparison| SpectrumReferenceMetrics {
                points: comparison.ours.len(),
                scale: comparison.scale.recip(),
                rms_over_peak: comparison.rms_over_peak,
                worst_at_per_cm: comparison.worst.0 / PER_CM,
                worst_over_peak: comparison.worst.1,
            }),
            findings: outcome.findings.iter().map(|(file, finding)| format!("{file}: {finding}")).collect(),
        }
    }
}

/// Each line, or without any what can be told apart in the spectrum and above which noise.
fn answer(lines: &[LineMetrics], resolution_per_cm: f64, noise: Option<&CoaddedNoise>) -> Vec<String> {
    if !lines.is_empty() {
        return lines.iter().map(LineMetrics::headline).collect();
    }
    let noise = noise
        .map_or_else(String::new, |of| format!("; noise of the mean of {} scans {:.3e}", of.scans, of.noise));
    vec![format!("lines are {resolution_per_cm:.3} 1/cm wide{noise}")]
}

/// The width of a line at half its height in 1/cm.
pub(super) fn resolution_per_cm(outcome: &SpectrumOutcome) -> f64 {
    outcome.file.transform.apodisation.line_width() / outcome.processed.largest_m / PER_CM
}

impl LineMetrics {
    fn of(
        asked_per_m: f64,
        known_per_m: Option<f64>,
        found: Option<&MeasuredLine>,
        ideal: Option<&MeasuredLine>,
        (noise, budget): (Option<f64>, &[LineErrorContribution]),
    ) -> Self {
        let line = found.map(|found| found.line);
        let error = found.and_then(|found| found.standard_error);
        let ideal = ideal.map(|ideal| ideal.line);
        let nu = line.map(|line| line.wavenumber_per_m);
        let total: f64 = budget.iter().map(|entry| entry.sd_per_m.powi(2)).sum();
        let both = line.zip(ideal);
        Self {
            asked_per_cm: asked_per_m / PER_CM,
            found_per_cm: nu.map(|nu| nu / PER_CM),
            found_sd_per_cm: error.map(|error| error.wavenumber_per_m / PER_CM),
            height: line.map(|line| line.height),
            height_sd: error.map(|error| error.height),
            snr: line
                .zip(noise)
                .filter(|(_, noise)| *noise > 0.0)
                .map(|(line, noise)| line.height.abs() / noise),
            from_known_per_cm: nu.zip(known_per_m).map(|(nu, known)| (nu - known) / PER_CM),
            shift_per_cm: both.map(|(l, i)| (l.wavenumber_per_m - i.wavenumber_per_m) / PER_CM),
            relative_height: both.map(|(line, ideal)| line.height / ideal.height),
            budget: budget
                .iter()
                .map(|entry| ContributionMetrics {
                    of: entry.of.text().to_owned(),
                    shift_per_cm: entry.shift_per_m / PER_CM,
                    sd_per_cm: entry.sd_per_m / PER_CM,
                    height: entry.height,
                })
                .collect(),
            total_sd_per_cm: total.sqrt() / PER_CM,
        }
    }

    /// Where it is, how high, and how far that can be trusted.
    fn headline(&self) -> String {
        let Some(found) = self.found_per_cm else {
            return format!("line near {} 1/cm: there is none", self.asked_per_cm);
        };
        let mut text = format!("line {found:.4}");
        if self.total_sd_per_cm > 0.0 {
            text += &format!(" ± {:.4}", self.total_sd_per_cm);
        }
        text += " 1/cm";
        if let Some(height) = self.height {
            text += &format!(", height {height:.4e}");
        }
        if let Some(sd) = self.height_sd {
            text += &format!(" ± {sd:.1e}");
        }
        if let Some(snr) = self.snr {
            text += &format!(", {} times the noise", significant(snr));
        }
        if let Some(off) = self.from_known_per_cm {
            text += &format!("; {off:+.4} from where it is known to be");
        }
        if let (Some(shift), Some(height)) = (self.shift_per_cm, self.relative_height) {
            text += &format!("; {shift:+.4} 1/cm and {height:.5} of the height along the true positions");
        }
        text
    }

    fn to_text(&self) -> String {
        let mut text = self.headline() + "\n";
        if self.found_per_cm.is_none() {
            return text;
        }
        for entry in &self.budget {
            text += &format!("  {:<28}", entry.of);
            if entry.shift_per_cm != 0.0 {
                text += &format!(" shifts it by {:+.4} 1/cm, which is not corrected", entry.shift_per_cm);
            }
            if entry.sd_per_cm != 0.0 {
                text += &format!(" ± {} 1/cm", significant(entry.sd_per_cm));
            }
            if entry.height != 1.0 {
                text += &format!(" leaves {:.4} of the height", entry.height);
            }
            text += "\n";
        }
        text
    }
}

impl SpectrumMetrics {
    /// For a reader.
    pub fn to_text(&self) -> String {
        let mut text: String = self.lines.iter().map(LineMetrics::to_text).collect();
        if self.lines.is_empty() {
            text += &(self.answer.join("\n") + "\n");
        }
        text += &format!("{} scans, {} of them forward", self.scans, self.forward_scans);
        if let Some(counts) = &self.samples {
            text += &format!(
                "; {} of {} samples used, in gaps of the trajectory {}, before or after it {}, without value {}; passes \
                 left out as incomplete {}, as unwanted {}",
                counts.used,
                counts.samples,
                counts.in_gap,
                counts.beyond_trajectory,
                counts.without_value,
                counts.incomplete_scans,
                counts.unwanted_scans
            );
        }
        text += &format!(
            "\npath difference {:.4} mm: lines are {:.3} 1/cm wide, one value each {:.4} 1/cm\n",
            self.largest_path_difference_mm, self.resolution_per_cm, self.step_per_cm
        );
        if self.band_beyond_limit {
            text += &format!(
                "WARNING: the samples are too far apart for wavenumbers above {:.1} 1/cm, which appear at lower ones{}\n",
                self.limit_per_cm,
                link("applications")
            );
        }
        if let Some(zero) = self.zero_path_mm {
            text += &format!("zero path at {zero:.6} mm");
            if let Some(error) = self.interpolation_error_nm {
                text += &format!("; the trajectory is interpolated within {error:.4} nm");
            }
            text += "\n";
        }
        if let Some(rms) = self.misregistration_rms_nm {
            text += &format!("zero paths of the scans lie {} nm rms about their mean", significant(rms));
            if let (Some(delay), Some(sd)) = (self.residual_delay_ns, self.residual_delay_sd_ns) {
                text += &format!("; the detector is {delay:+.2} ± {sd:.2} ns later than taken");
            }
            text += "\n";
        }
        if self.delay_is_hidden {
            text += "the delay of the detector is not determined, as the correction of the phase removes it as well; `phase = \"none\"` determines it\n";
        }
        if self.inverted {
            text += "the light lowers the detector's value: the sign was turned\n";
        }
        for noise in &self.noise {
            text += &format!("noise of {} scans: {:.3e}\n", noise.scans, noise.noise);
        }
        if let Some(recalibration) = &self.recalibration {
            text += &format!("true distances are {:.8}", recalibration.scale);
            if let Some(sd) = recalibration.scale_sd {
                text += &format!(" ± {}", significant(sd));
            }
            text += &format!(" times the used ones, by {} known line", recalibration.lines);
            text += if recalibration.lines == 1 { "\n" } else { "s\n" };
            if let Some(disagreement) = recalibration.disagreement {
                text += &format!(
                    "  they disagree by {} (sum of squares over variances; expected about {})\n",
                    significant(disagreement),
                    recalibration.lines - 1
                );
            }
            text += "  not determined by lines: where the electrode is (a constant is lost in the zero path), gain and reference \
                     distance apart (they are one factor), a cone of light (state `half_angle`)\n";
        }
        if let Some(correction) = &self.correction {
            // With its uncertainty, so that a filter that is told so considers it.
            let sd = correction.sd.as_ref().map_or_else(String::new, |sd| format!(" ± {sd}"));
            let (key, write, was) = (correction.key, &correction.write, &correction.was);
            text += &format!("  write `{key} = \"{write}{sd}\"` instead of `\"{was}\"`\n");
        }
        if let Some(reference) = &self.reference {
            text += &format!(
                "against the reference at {} wavenumbers: {:.3} % of its peak, rms; {:+.3} % where it is worst, at {:.3} 1/cm\n",
                reference.points,
                100.0 * reference.rms_over_peak,
                100.0 * reference.worst_over_peak,
                reference.worst_at_per_cm
            );
        }
        for finding in &self.findings {
            text += &format!("note: {finding}\n");
        }
        text
    }
}
