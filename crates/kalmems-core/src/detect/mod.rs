//! When a signal crosses a threshold: rising edges in noise, and their times with variances.
//!
//! A sensor whose gain changes sign at a known angle, such as comb fingers that pass each other, gives a signal that
//! rises through zero each time that angle is passed. The time of such a crossing is a measurement of the angle that
//! knows nothing of gain and offset drift. Found late, it is applied to the state it speaks of: see [`angle_at`].
//!
//! - [`SlopeKernel`]: the signal's slope, smoothed by a Gaussian (derivative of Gaussian, Canny 1986).
//! - [`Threshold`]: how large a maximum of it must be; from a rate of false alarms by [`NoiseMaxima`].
//! - [`Detector`]: both over a stream; [`responses`](SlopeKernel::responses) and [`peaks`] the same over a slice.
//! - [`CubicFit`]: the zero crossing of the smoothed signal near a detection, free of the maximum's bias.
//!
//! ```
//! use kalmems_core::detect::{Detector, SlopeKernel, Threshold, peaks};
//! let kernel = SlopeKernel::<f64, 20>::new(5.0)?;
//! // A step between samples 99 and 100, seen without noise; 1 is the standard deviation that is told.
//! let signal: Vec<f64> = (0..200).map(|k| if k < 100 { -8.0 } else { 8.0 }).collect();
//! let threshold = Threshold::fixed(4.0 * kernel.noise_deviation(1.0));
//! let mut detector = Detector::<f64, 20, 50, 100>::new(kernel, threshold, 1.0);
//! let found: Vec<_> = signal.iter().filter_map(|sample| detector.push(*sample)).collect();
//! assert_eq!(found.len(), 1);
//! assert!((found[0].index as f64 + found[0].fraction - 99.5).abs() < 1e-6);
//!
//! let mut slope = vec![0.0; 200];
//! kernel.responses(&signal, &mut slope);
//! let batch: Vec<_> = peaks(&slope, 50, threshold).collect();
//! assert_eq!(batch[0].index, found[0].index);
//! # Ok::<(), kalmems_core::detect::DetectError>(())
//! ```

mod crossing;
mod detector;
mod error;
mod false_alarms;
mod kernel;
mod maxima;
mod past;
mod threshold;
mod window;

pub use crossing::{Crossing, CubicDesign, CubicFit};
pub use detector::{Detection, Detector};
pub use error::DetectError;
pub use false_alarms::NoiseMaxima;
pub use kernel::{SlopeDesign, SlopeKernel};
pub use maxima::{Peak, Peaks, peaks};
pub use past::{angle_at, angle_variance};
pub use threshold::{HoldLevel, Threshold};
