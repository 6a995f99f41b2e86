//! How large a filter is in memory.

use super::filter::FilterProgram;
use super::interface::Interface;
use super::request::EmitRequest;
use crate::device::Device;

/// Bytes of a number or a count of 32 bits.
const WORD: usize = 4;
/// Numbers and counts of the watch over a measurement.
const OF_WATCH: usize = 10;
/// Counts of what is kept through a loss.
const OF_KEPT: usize = 4;

/// The size of the structure in C in bytes, where an `unsigned` has four.
pub(super) fn bytes(device: &Device, request: &EmitRequest, program: &FilterProgram) -> usize {
    let of = |count: usize, wide: bool| if wide { 2 * WORD * count } else { WORD * count };
    let widths = program.widths;
    let align = if widths.mean || widths.covariance { 2 * WORD } else { WORD };
    let state = of(program.start.0.len(), widths.mean) + of(program.start.1.len(), widths.covariance);
    let state = state.next_multiple_of(align);
    let measures = request.measures.len();
    let mut bytes = state + WORD * (OF_WATCH * measures + 1);
    if request.begins_again() {
        bytes = bytes.next_multiple_of(align) + (state + WORD * OF_KEPT).next_multiple_of(align);
    }
    if request.has_range() {
        bytes += WORD * measures;
    }
    if request.update_every > 1 {
        bytes += WORD;
    }
    if let Some(configure) = &program.configure {
        let wide = widths.constants;
        bytes = if wide { bytes.next_multiple_of(2 * WORD) } else { bytes }
            + of(configure.outputs.len().max(1), wide);
    }
    let inputs = Interface::of(device, request, program).step.len();
    if inputs > 0 {
        bytes += WORD * (inputs + 1);
    }
    bytes.next_multiple_of(align)
}
