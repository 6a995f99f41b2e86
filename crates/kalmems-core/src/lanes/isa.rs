//! Which instructions a kernel runs with.

use super::Lane;
use super::packed::Packed;
use super::pair::Pair;
#[cfg(target_arch = "x86_64")]
use super::x86;
use crate::Scalar;

/// Work on lanes of type `F`, written for any number of them.
///
/// Put `#[inline(always)]` on `run`, and on every function of yours that computes with lanes: an instruction of the
/// wider sets is only used within the one function that [`Isa::run`] makes of the kernel, and any part of it that is
/// not inlined there calls a function for each of its operations.
///
/// What leaves a kernel are plain numbers. A kernel can be run again on what it kept, but lanes themselves cannot be
/// named outside.
///
/// ```
/// use kalmems_core::Scalar;
/// use kalmems_core::lanes::{Isa, Kernel, Lane};
/// /// Square roots of a slice, as many at once as there are lanes.
/// struct Roots<'a>(&'a mut [f64]);
/// impl Kernel<f64> for Roots<'_> {
///     type Output = ();
///     #[inline(always)]
///     fn run<L: Lane<f64>>(self) {
///         for group in self.0.chunks_mut(L::WIDTH) {
///             L::load(group, 0.0).sqrt().store(group);
///         }
///     }
/// }
/// let mut numbers = [1.0, 4.0, 9.0, 16.0, 25.0];
/// Isa::best().run(Roots(&mut numbers));
/// assert_eq!(numbers, [1.0, 2.0, 3.0, 4.0, 5.0]);
/// ```
pub trait Kernel<F: Real> {
    /// What it gives.
    type Output;

    /// Does the work with lanes of this kind.
    fn run<L: Lane<F>>(self) -> Self::Output;
}

/// A set of instructions for lanes.
///
/// | lanes | f64 | f32 |
/// |---|---|---|
/// | `Portable` | 4 | 8 |
/// | `Avx2` | 8 | 16 |
/// | `Avx512` | 16 | 32 |
///
/// ```
/// use kalmems_core::lanes::{Isa, Kernel, Lane};
/// struct Width;
/// impl Kernel<f64> for Width {
///     type Output = usize;
///     #[inline(always)]
///     fn run<L: Lane<f64>>(self) -> usize {
///         L::WIDTH
///     }
/// }
/// for isa in Isa::available() {
///     println!("{isa:?} has {:?} lanes", isa.run(Width));
/// }
/// assert_eq!(Isa::Portable.run(Width), Some(4));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// What every machine of the target has.
    Portable,
    /// Intel's and AMD's registers of 256 bits.
    Avx2,
    /// Intel's and AMD's registers of 512 bits: AVX-512F and AVX-512DQ.
    Avx512,
}

impl Isa {
    /// Those that this machine and its operating system have, the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        [Self::Portable, Self::Avx2, Self::Avx512].into_iter().filter(|isa| isa.is_available())
    }

    /// The widest that this machine has.
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::Portable)
    }

    /// Whether this machine has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::has_avx2(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86::has_avx512(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Runs a kernel with it; `None`, and nothing is run, where this machine has it not.
    #[inline]
    pub fn run<F: Real, K: Kernel<F>>(self, kernel: K) -> Option<K::Output> {
        F::run(self, kernel)
    }
}

/// A type of number that lanes can hold: `f64` and `f32`. Each is a lane of its own as well, so that a kernel is also
/// the loop over single numbers.
///
/// ```
/// use kalmems_core::lanes::{Kernel, Lane, Real};
/// struct Width;
/// impl<F: Real> Kernel<F> for Width {
///     type Output = usize;
///     #[inline(always)]
///     fn run<L: Lane<F>>(self) -> usize {
///         L::WIDTH
///     }
/// }
/// assert_eq!(Kernel::<f32>::run::<f32>(Width), 1);
/// ```
pub trait Real: Scalar + Lane<Self> + Dispatch {}

impl Real for f64 {}
impl Real for f32 {}

/// From an instruction set to lanes. Not public, and without an associated type: it must name no lanes.
pub trait Dispatch: Sized {
    /// See [`Isa::run`].
    fn run<K: Kernel<Self>>(isa: Isa, kernel: K) -> Option<K::Output>
    where
        Self: Real;
}

macro_rules! dispatch {
    ($float:ident, $portable:ty, $avx2:ident, $avx512:ident) => {
        impl Dispatch for $float {
            #[inline]
            fn run<K: Kernel<Self>>(isa: Isa, kernel: K) -> Option<K::Output> {
                match isa {
                    Isa::Portable => Some(kernel.run::<Packed<$portable>>()),
                    #[cfg(target_arch = "x86_64")]
                    Isa::Avx2 => x86::$avx2(kernel),
                    #[cfg(target_arch = "x86_64")]
                    Isa::Avx512 => x86::$avx512(kernel),
                    #[cfg(not(target_arch = "x86_64"))]
                    Isa::Avx2 | Isa::Avx512 => None,
                }
            }
        }
    };
}

dispatch!(f64, Pair<Pair<f64>>, run_avx2_f64, run_avx512_f64);
dispatch!(f32, Pair<Pair<Pair<f32>>>, run_avx2_f32, run_avx512_f32);
