//! Orders and cut-offs from what is demanded of them.

use super::HighPass;
use crate::signal::PortableComplex;
use kalmems_core::Portable;
use kalmems_models::circuit::Cascade;

/// What the high-pass must keep out, and what it must not take.
///
/// Butterworth's response, |H|² = 1/(1 + (f_HP/f)²ⁿ), is solved for the cut-off at both demands; the lowest order at
/// which the two do not exclude each other is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveRejection {
    /// The highest line of the drive that must be kept out: f_dr, or 2·f_dr where V is not constant while C moves.
    pub drive_hz: f64,
    /// The lowest line of the motion beside the carrier, f_c − f_dr.
    pub side_band_hz: f64,
    /// How far below its size the drive's line must come, in dB.
    pub rejection_db: f64,
    /// How much of the side band may be lost, in dB.
    pub loss_db: f64,
}

/// A high-pass that does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HighPassDesign {
    /// The lowest order.
    pub order: usize,
    /// The lowest and the highest cut-off that serve.
    pub cutoff_hz: [f64; 2],
}

/// What is demanded of two equal low-pass poles behind the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demodulation {
    /// The motion's line, f_dr.
    pub signal_hz: f64,
    /// The lowest line that must go: f_c behind a diode or a detector with a linear part, 2·f_c behind a pure square or a
    /// multiplier.
    pub ripple_hz: f64,
    /// By how much, in dB.
    pub ripple_db: f64,
    /// How much of the motion's line may be lost, in dB.
    pub loss_db: f64,
    /// How far it may lag, in degrees of the motion's cycle, which is half of those of its line.
    pub lag_deg: f64,
}

/// Two equal poles that do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPassDesign {
    /// The lowest and the highest pole that serve.
    pub pole_hz: [f64; 2],
}

/// No filter does.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The side band is too near the drive.
    #[error(
        "no high-pass of up to {order} poles does: with the permitted loss one of {order} keeps the drive out by \
         {reached_db:.1} dB, not {rejection_db:.1} dB; take a higher carrier, or permit more loss"
    )]
    HighPass {
        /// The highest order there is.
        order: usize,
        /// What it reaches.
        reached_db: f64,
        /// What was demanded.
        rejection_db: f64,
    },
    /// The carrier is too near the motion's line.
    #[error(
        "two low-pass poles cannot do both: loss and lag demand them above {above_hz:.3e} Hz, the ripple below \
         {below_hz:.3e} Hz; take a higher carrier, permit more, or let the filter know the poles"
    )]
    LowPass {
        /// For loss and lag.
        above_hz: f64,
        /// For the ripple.
        below_hz: f64,
    },
}

/// (10^{dB/10} − 1)^{1/2n}: how far from the cut-off Butterworth's gain has fallen by this.
fn distance(decibels: f64, order: usize) -> f64 {
    (10_f64.portable_powf(decibels / 10.0) - 1.0).portable_powf(0.5 / order as f64)
}

impl DriveRejection {
    /// The high-pass of the lowest order.
    ///
    /// ```
    /// use kalmems_engines::circuit::DriveRejection;
    /// let demand = DriveRejection { drive_hz: 31.35e3, side_band_hz: 468.65e3, rejection_db: 90.0, loss_db: 4.0 };
    /// assert_eq!(demand.design().unwrap().order, 4);
    /// ```
    pub fn design(&self) -> Result<HighPassDesign, DesignError> {
        let highest = Cascade::<f64>::HIGHEST_ORDER;
        for order in 1..=highest {
            let cutoff_hz = [
                self.drive_hz * distance(self.rejection_db, order),
                self.side_band_hz * distance(self.loss_db, order),
            ];
            if cutoff_hz[0] <= cutoff_hz[1] {
                return Ok(HighPassDesign { order, cutoff_hz });
            }
        }
        let cutoff_hz = self.side_band_hz * distance(self.loss_db, highest);
        let gain =
            HighPass::new(highest, cutoff_hz).map_or(1.0, |h| h.response(self.drive_hz).portable_norm());
        let reached_db = -20.0 * gain.portable_log10();
        Err(DesignError::HighPass { order: highest, reached_db, rejection_db: self.rejection_db })
    }
}

impl Demodulation {
    /// The poles between which both stages serve.
    ///
    /// Each pole takes 10·lg(1 + (f/p)²) dB and arctan(f/p) of the line.
    pub fn design(&self) -> Result<LowPassDesign, DesignError> {
        let per_stage = |decibels: f64| (10_f64.portable_powf(decibels / 20.0) - 1.0).sqrt();
        let for_loss = self.signal_hz / per_stage(self.loss_db);
        let for_lag =
            if self.lag_deg < 90.0 { self.signal_hz / self.lag_deg.to_radians().portable_tan() } else { 0.0 };
        let (above_hz, below_hz) = (for_loss.max(for_lag), self.ripple_hz / per_stage(self.ripple_db));
        if above_hz <= below_hz {
            Ok(LowPassDesign { pole_hz: [above_hz, below_hz] })
        } else {
            Err(DesignError::LowPass { above_hz, below_hz })
        }
    }
}
