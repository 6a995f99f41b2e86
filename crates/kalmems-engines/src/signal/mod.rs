//! What is read off a periodic signal, its sine, its cycles, its turning points; a signal between its samples; and how
//! the mean of a signal at rest wanders.

mod allan;
mod band_limited;
mod complex;
mod confidence;
mod cubic;
mod cycles;
mod extremes;
mod fourier;
mod interval;
mod normal_equations;
mod octave_sums;
mod sample_slopes;
mod sine;
mod white_noise;

pub use allan::{AllanDeviation, Deviation, octaves};
pub use band_limited::band_limited;
pub use complex::PortableComplex;
pub use confidence::Confident;
pub use cubic::{cubic_between, hermite, polynomial_between, quintic_between, quintic_middle};
pub(crate) use cycles::fit_cycles_until;
pub use cycles::{Cycle, fit_cycles};
pub use extremes::{Extreme, extremes_of_angle, extremes_of_rate};
pub use fourier::fourier_transform;
pub(crate) use fourier::fourier_transform_by;
pub use interval::{GAP, usual_interval};
pub(crate) use normal_equations::NormalEquations;
pub use octave_sums::OctaveSums;
pub use sample_slopes::{SLOPE_REACH, sample_slopes};
pub(crate) use sine::largest_line;
pub use sine::least_squares;
pub use sine::{Sine, fit_sine, fit_sine_at, fit_sine_near, fit_sine_until};
pub use white_noise::white_noise_variance;
