//! The equations of the device and of the filter, for those who read a source.

use super::request::{EmitGain, EmitRequest};
use crate::device::{Device, DeviceEquation};

/// The equations that the operations of a source are made from, and what its names stand for.
pub(super) fn lines(device: &Device, request: &EmitRequest) -> Vec<String> {
    let mut lines = vec!["The device, with rates f and measurements h, in SI:".to_owned()];
    for (left, right) in &device.equations {
        let right = match right {
            DeviceEquation::Text(text) => &text.entry.text,
            DeviceEquation::Law(formula) => *formula,
        };
        let right = right.split_whitespace().collect::<Vec<_>>().join(" ");
        lines.push(format!("- {left} = {right}"));
    }
    let filter: &[&str] = match request.gain {
        EmitGain::Covariance => &[
            "The filter, with the covariance P of the states x, the noise Q of a step and the noise R of a sample:",
            "- prediction: x = x + (integral of f over the step), F = (derivative of the new x by the old one), P = F P F' + Q",
            "- correction by a measurement y: S = H P H' + R with H = (derivative of h by x), k = P H'/S, x = x + k (y - h),",
            "  P = (1 - k H) P (1 - k H)' + k R k' = B + (k - B H') k' with B = P - k (P H')'",
            "Names: x_ is a mean, p0_1 an entry of P, f0_1 of F, fp0_1 of F P, b0_1 of B; h_ an entry of H, ph_ of P H', gain_ of k; variance is S,",
            "innovation y - h, and t0 a part of several of these. Noise and signal are in standard deviations of the noise, so that R = 1.",
        ],
        EmitGain::Settled(_) => &[
            "The filter, with a constant gain k:",
            "- prediction: x = x + (integral of f over the step)",
            "- correction by a measurement y: x = x + k (y - h)",
            "Names: x_ is a mean, innovation is y - h in standard deviations of the noise, and t0 a part of several results.",
        ],
    };
    lines.extend(filter.iter().map(|line| (*line).to_owned()));
    lines
}
