//! Lanes against single numbers, bit for bit, with every instruction set of the machine.

use kalmems_core::lanes::{Isa, Kernel, Lane, Real};
use kalmems_core::{Dual, Mask, Scalar};

/// Everything that a scalar can do with two others, by number.
const OPERATIONS: usize = 24;

#[inline(always)]
fn operate<S: Scalar>(operation: usize, a: S, b: S) -> S {
    match operation {
        0 => a + b,
        1 => a - b,
        2 => a * b,
        3 => a / b,
        4 => -a,
        5 => a.abs(),
        6 => a.sqrt(),
        7 => a.exp(),
        8 => a.ln(),
        9 => a.sin(),
        10 => a.cos(),
        11 => a.atanh(),
        12 => S::select(a.lt(b), a, b),
        13 => S::select(a.gt(b), a, b),
        14 => S::select(a.is_finite(), a, b),
        15 => S::select(a.lt(b).and(b.is_finite()), a, b),
        16 => S::select(a.lt(b).or(b.is_finite().not()), a, b),
        17 => a.mac(a, b),
        18 => a.recip(),
        19 => a.sq(),
        20 => a.twice(),
        21 => a.half(),
        22 => (Dual::<S, 1>::variable(a, 0).sin() * Dual::constant(b)).gradient()[0],
        _ => S::of(0.1),
    }
}

/// One operation on two columns.
struct Columns<'a, F> {
    operation: usize,
    a: &'a [F],
    b: &'a [F],
}

impl<F: Real> Kernel<F> for Columns<'_, F> {
    type Output = Vec<F>;
    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Vec<F> {
        let mut results = vec![F::of(0.0); self.a.len()];
        let rows = self.a.chunks(L::WIDTH).zip(self.b.chunks(L::WIDTH));
        for ((a, b), result) in rows.zip(results.chunks_mut(L::WIDTH)) {
            operate(self.operation, L::load(a, F::of(1.0)), L::load(b, F::of(1.0))).store(result);
        }
        results
    }
}

/// Well-mixed bits, the same in every run (Steele, Lea and Flood, OOPSLA 2014).
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

macro_rules! every_operation {
    ($test:ident, $float:ident, $bits:ident) => {
        #[test]
        #[allow(clippy::cast_possible_truncation)] // random bits
        fn $test() {
            let mut special =
                vec![0.0, 1.0, 0.5, 1e-30, 1e30, 0.999, 88.7, 104.0, 709.7, 745.0, 1e6, 2e6, 6433.5];
            special.extend([
                $float::MIN_POSITIVE,
                $float::MAX,
                $float::INFINITY,
                $float::NAN,
                $float::EPSILON,
            ]);
            special.extend([
                $float::from_bits(1),
                std::f64::consts::FRAC_PI_2 as $float,
                (1.0 as $float).next_up(),
            ]);
            special.extend(special.clone().iter().map(|x| -x));
            let mut a: Vec<$float> = special.iter().flat_map(|x| vec![*x; special.len()]).collect();
            let mut b: Vec<$float> = special.iter().cycle().take(a.len()).copied().collect();
            let mut state = 7;
            for _ in 0..40_000 {
                // Any bits, and numbers of everyday size.
                a.extend([
                    $float::from_bits(random(&mut state) as $bits),
                    (random(&mut state) % 4096) as $float / 512.0,
                ]);
                b.extend([
                    $float::from_bits(random(&mut state) as $bits),
                    (random(&mut state) % 4096) as $float / 64.0 - 32.0,
                ]);
            }
            for operation in 0..OPERATIONS {
                let expected: Vec<$float> =
                    a.iter().zip(&b).map(|(a, b)| operate(operation, *a, *b)).collect();
                for isa in Isa::available() {
                    let found = isa.run(Columns { operation, a: &a, b: &b }).expect("it is available");
                    for (i, (x, y)) in expected.iter().zip(&found).enumerate() {
                        let same = x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan();
                        assert!(
                            same,
                            "{isa:?}, operation {operation} on {:e} and {:e}: {x:e}, {y:e}",
                            a[i], b[i]
                        );
                    }
                }
            }
        }
    };
}

every_operation!(every_operation_agrees_in_f64, f64, u64);
every_operation!(every_operation_agrees_in_f32, f32, u32);

/// What masks say, lane by lane and all together.
struct Masks;

impl Kernel<f64> for Masks {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let w = L::WIDTH;
        let index = L::from_fn(|i| i as f64);
        for edge in 0..=w {
            let below = index.lt(L::splat(edge as f64));
            for i in 0..w {
                assert_eq!(L::is_set(below, i), i < edge);
                assert_eq!(L::is_set(below.not(), i), i >= edge);
            }
            assert_eq!((below.any(), below.all()), (edge > 0, edge == w));
            assert_eq!((below.not().any(), below.not().all()), (edge < w, edge == 0));
            assert!(!below.and(below.not()).any() && below.or(below.not()).all());
        }
        let all = index.is_finite();
        assert!(all.all() && L::is_set(all, w - 1) && !L::is_set(all, w) && !L::is_set(all, usize::MAX));
        assert!(!index.lt(L::splat(f64::NAN)).any() && !L::splat(f64::NAN).lt(index).any());
    }
}

/// What slices that are too short and too long do.
struct Slices;

impl Kernel<f32> for Slices {
    type Output = ();
    #[inline(always)]
    fn run<L: Lane<f32>>(self) {
        let w = L::WIDTH;
        let values: Vec<f32> = (0..2 * w).map(|i| i as f32).collect();
        for length in 0..=2 * w {
            let lanes = L::load(&values[..length], -1.0);
            for i in 0..w {
                assert_eq!(lanes.lane(i), Some(if i < length { i as f32 } else { -1.0 }));
            }
            assert_eq!((lanes.lane(w), lanes.lane(usize::MAX)), (None, None));
            let mut stored = vec![-2.0; length];
            L::from_fn(|i| i as f32).store(&mut stored);
            for (i, x) in stored.iter().enumerate() {
                assert_eq!(*x, if i < w { i as f32 } else { -2.0 });
            }
        }
    }
}

#[test]
fn masks_and_slices_are_lane_by_lane() {
    for isa in Isa::available() {
        isa.run(Masks).expect("it is available");
        isa.run(Slices).expect("it is available");
    }
    Masks.run::<f64>();
    Slices.run::<f32>();
}

#[test]
fn what_the_machine_has_not_is_not_run() {
    assert!(Isa::Portable.is_available() && Isa::available().next() == Some(Isa::Portable));
    assert!(Isa::best().is_available() && Isa::available().last() == Some(Isa::best()));
    #[cfg(target_arch = "x86_64")]
    assert_eq!(
        (Isa::Avx2.is_available(), Isa::Avx512.is_available()),
        (
            std::is_x86_feature_detected!("avx2"),
            std::is_x86_feature_detected!("avx512f") && std::is_x86_feature_detected!("avx512dq")
        )
    );
    for isa in [Isa::Portable, Isa::Avx2, Isa::Avx512] {
        assert_eq!(isa.run(Masks).is_some(), isa.is_available());
    }
}
