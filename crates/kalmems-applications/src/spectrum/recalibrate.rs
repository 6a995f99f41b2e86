//! The scale of positions from lines that are known.

use kalmems_core::Portable;
use serde::Serialize;

/// A line where it was found and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownLine {
    /// Where it was found, in 1/m.
    pub found_per_m: f64,
    /// The standard error of that, where it is known.
    pub found_sd_per_m: Option<f64>,
    /// Where it is.
    pub known_per_m: f64,
    /// The standard deviation of that.
    pub known_sd_per_m: f64,
}

/// What known lines say about positions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Recalibration {
    /// The true distances are the used ones times this.
    pub scale: f64,
    /// Its standard error, where those of the lines are known.
    pub scale_sd: Option<f64>,
    /// Lines it rests on.
    pub lines: usize,
    /// How far the lines disagree with one scale: Σ (s_i − s)²/σ_i², about one less than there are lines where they
    /// agree.
    pub disagreement: Option<f64>,
}

/// The scale s by which all distances are to be multiplied: a path that is taken too long by a share ε shows a line at
/// ν/(1 + ε), so that s = ν_found/ν. Lines count by their errors, and alike where those are not known.
///
/// Light that fills a cone with a half-angle of `half_angle_rad` goes a path shorter by α²/4 on the mean, which is taken off
/// first. From lines alone the two cannot be distinguished: both move every line by the same share. What the scale of the positions
/// may be off by in these scans, `scale_sd`, is common to all lines and does not average out. `None` without lines.
pub fn recalibrate(lines: &[KnownLine], half_angle_rad: f64, scale_sd: f64) -> Option<Recalibration> {
    let cone = 1.0 - half_angle_rad.powi(2) / 4.0;
    let each: Vec<(f64, Option<f64>)> = lines
        .iter()
        .map(|line| {
            let scale = line.found_per_m / (line.known_per_m * cone);
            let sd = line.found_sd_per_m.map(|sd| {
                scale * (sd / line.found_per_m).portable_hypot(line.known_sd_per_m / line.known_per_m)
            });
            (scale, sd.filter(|sd| *sd > 0.0))
        })
        .collect();
    let known = each.iter().all(|(_, sd)| sd.is_some());
    let weight = |sd: Option<f64>| sd.filter(|_| known).map_or(1.0, |sd| sd.powi(-2));
    let total: f64 = each.iter().map(|(_, sd)| weight(*sd)).sum();
    if each.is_empty() {
        return None;
    }
    let scale = each.iter().map(|(scale, sd)| scale * weight(*sd)).sum::<f64>() / total;
    let square: f64 = each.iter().map(|(found, sd)| (found - scale).powi(2) * weight(*sd)).sum();
    Some(Recalibration {
        scale,
        scale_sd: known.then(|| total.sqrt().recip().portable_hypot(scale * scale_sd)),
        lines: each.len(),
        disagreement: (known && each.len() > 1).then_some(square),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_count_by_their_errors_and_a_cone_is_taken_off() {
        let line = |known: f64, share: f64, sd: f64| KnownLine {
            found_per_m: known * (1.0 + share),
            found_sd_per_m: Some(sd * known),
            known_per_m: known,
            known_sd_per_m: 0.0,
        };
        let found = recalibrate(&[line(2e5, 3e-3, 1e-6), line(1e5, 3.4e-3, 2e-6)], 0.0, 0.0).unwrap();
        // Weights 4 : 1.
        assert!((found.scale - 1.00308).abs() < 1e-8, "{found:?}");
        assert!((found.scale_sd.unwrap() / 0.897e-6 - 1.0).abs() < 1e-2);
        assert!(found.disagreement.unwrap() > 1e4);
        let cone = recalibrate(&[line(2e5, -1e-4, 1e-6)], 0.02, 3e-6).unwrap();
        assert!((cone.scale - 1.0).abs() < 1e-7 && cone.disagreement.is_none());
        assert!((cone.scale_sd.unwrap() / 10_f64.sqrt() * 1e6 - 1.0).abs() < 1e-3);
        let unsure = KnownLine { found_sd_per_m: None, ..line(2e5, 3e-3, 0.0) };
        assert_eq!(recalibrate(&[unsure], 0.0, 0.0).unwrap().scale_sd, None);
        assert_eq!(recalibrate(&[], 0.0, 0.0), None);
    }
}
