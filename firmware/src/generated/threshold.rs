//! The filter of a threshold-sensing scanner and its detector, for a microcontroller.

// Made by kalmems 0.1.0 with `kalmems export`; not to be edited.
// Experiment `threshold_scanner`, sha256 d058834e39d7d1f1ca77fab91b398f706b0f1b3f922caae6d34f46076fc5c6fc, filter `Hybrid`.
// Sampling interval 2.0000000000002655e-6 s, corrected by every sample.

use kalmems_core::detect::{CubicDesign, CubicFit, Detector, SlopeKernel, Threshold, angle_at, angle_variance};
use kalmems_core::update::Always;
use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearProcess, Mat, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::readout::CurrentReadout;

/// The unit of the angle in rad.
pub const ANGLE_UNIT_RAD: f64 = 0.01834862385321101;
/// The unit of the rate in rad/s.
pub const RATE_UNIT_RAD_PER_S: f64 = 9174.311926604287;
/// What a signal of 1 V is, in standard deviations of its noise.
pub const PER_VOLT: f64 = 22.988505747126435;
/// How many samples after it happened a crossing is known.
pub const LOOK_AHEAD: usize = Finder::<f64>::LOOK_AHEAD;

/// What finds crossings.
type Finder<T> = Detector<T, 60, 150, 336>;

/// One step over one interval, and its noise.
#[inline(always)]
pub fn process<T: Scalar<Mask = bool>>() -> LinearProcess<T, 2, 0> {
    let of = T::of;
    LinearProcess {
        transition: Mat([[of(0.9999687030664928), of(0.9999373518726024)], [of(-6.259245101946826e-5), of(0.9998642740215946)]]),
        input: Mat([[], []]),
        noise: Covariance::from_lower(Mat([[of(3.7683108518370163e-11), of(0.0)], [of(5.652271524991622e-11), of(1.1304543067400899e-10)]])).into(),
    }
}

/// What is read, in standard deviations of its noise.
#[inline(always)]
pub fn readout<T: Scalar>() -> CurrentReadout<T> {
    let of = T::of;
    let comb = CombCurve {
        centre: of(0.41964999999999997),
        gain: of(653.8015395970871),
        steepness: of(1.0),
        shape: CurveShape::Logistic,
    };
    CurrentReadout { comb, offset: of(0.0) }
}

/// What smooths a signal and takes its slope.
#[inline(always)]
fn slope_kernel<T: Scalar>() -> SlopeKernel<T, 60> {
    let of = T::of;
    let weights = [
        of(0.0001180604139684427), of(0.00023455192457260226), of(0.0003479403256735696), of(0.00045675973287938993),
        of(0.0005596441052354045), of(0.0006553557170462312), of(0.0007428097523897153), of(0.0008210943452644325),
        of(0.0008894855623608015), of(0.0009474570150490172), of(0.0009946839836723405), of(0.0010310421318755628),
        of(0.0010566010731136168), of(0.0010716132180981727), of(0.0010764984743319862), of(0.0010718254820722723),
        of(0.001058290151703901), of(0.0010366923139551562), of(0.0010079113067219096), of(0.000972881302147199),
        of(0.0009325671281096762), of(0.0008879412636402968), of(0.0008399625931034815), of(0.0007895573948713315),
        of(0.0007376029225166851), of(0.0006849138159749093), of(0.0006322314620105122), of(0.0005802163123887195),
        of(0.0005294430683130885), of(0.00048039855395428147), of(0.00043348203230077903), of(0.00038900766418382363),
        of(0.00034720877633131537), of(0.00030824358604233487), of(0.0002722020272175758), of(0.00023911333317207782),
        of(0.00020895405366516285), of(0.00018165621446583437), of(0.00015711536502450519), of(0.00013519830100654543),
        of(0.00011575029130078092), of(9.860168164982022e-5), of(8.357378758211173e-5), of(7.048402653308977e-5),
        of(5.9150271960350955e-5), of(4.939444026999803e-5), of(4.104534418316056e-5), of(3.394086376882968e-5),
        of(2.792949896960378e-5), of(2.28713754497749e-5), of(1.8638779528512348e-5), of(1.5116298432942072e-5),
        of(1.2200639760884514e-5), of(9.800199523551904e-6), of(7.834442055460769e-6), of(6.233147988575607e-6),
        of(4.935578876877661e-6), of(3.889599334341652e-6), of(3.0507900406582915e-6), of(2.3815779225592975e-6),
    ];
    SlopeKernel::of_table(weights, [4.187524351733582e-5, 2.79167259264226e-7, 3.1018030950952635e-9])
}

/// The cubic around a crossing.
#[inline(always)]
fn cubic_fit<T: Scalar<Mask = bool>>() -> CubicFit<T, 90> {
    let of = T::of;
    let weights = [
        of(0.999444598736858), of(0.9977802450856058), of(0.995012479192681), of(0.9911505004882826),
        of(0.9862071167439126), of(0.9801986733067501), of(0.973144963058044), of(0.9650691177896713),
        of(0.9559974818330885), of(0.9459594689067515), of(0.9349874032704364), of(0.9231163463866162),
        of(0.9103839103891196), of(0.8968300597468428), of(0.8824969025845661), of(0.867428473183378),
        of(0.8516705072294046), of(0.835270211411232), of(0.8182760289835056), of(0.8007374029167609),
        of(0.7827045382418173), of(0.764228165171436), of(0.7453593045429223), of(0.7261490370736292),
        of(0.706648277857651), of(0.6869075574573194), of(0.6669768108584027), of(0.6469051754642775),
        of(0.6267407992029153), of(0.6065306597125529), of(0.5863203954586155), of(0.566154149517112),
        of(0.5460744266396218), of(0.5261219640933668), of(0.5063356166480092), of(0.48675225595987853),
        of(0.46740668448552447), of(0.44833156394084744), of(0.4295573582106428), of(0.41111229050709047),
        of(0.3930223144754115), of(0.3753110988513019), of(0.35800002518850205), of(0.3411081980964947),
        of(0.3246524673582527), of(0.3086474612365226), of(0.29310563022450314), of(0.27803730045309966),
        of(0.2634507359321634), of(0.24935220877720424), of(0.23574607655577307), of(0.2226348658788021),
        of(0.2100193613613012), of(0.19789869908352953), of(0.1862704636976178), of(0.17513078834506995),
        of(0.1644744565770761), of(0.15429500550149175), of(0.14458482941708292), of(0.13533528323654082),
        of(0.12653678504420235), of(0.1181789171817136), of(0.11025052530442064), of(0.10273981490243225),
        of(0.09563444483247902), of(0.08892161745932925), of(0.08258816505806027), of(0.07662063218044123),
        of(0.07100535373958712), of(0.06572852861648298), of(0.060776288639579006), of(0.05613476283409077),
        of(0.05179013688063275), of(0.0477287077631256), of(0.04393693362337097), of(0.04040147887412879),
        of(0.03710925465387243), of(0.034047454734568786), of(0.03120358701882038), of(0.028565500784523423),
        of(0.026121409853892944), of(0.023859911879356578), of(0.021770003951526243), of(0.019841094744349645),
        of(0.018063013419762023), of(0.01642601551886763), of(0.014920786069051183), of(0.013538440136636905),
        of(0.012270521052963907), of(0.011108996538229027),
    ];
    let moments = [75.00675055165075, 73.09489226800578, 201.88354423564576, 851.0445314637046];
    CubicFit::of_table(weights, &CubicDesign { width: 29.999999999996017, moments, noise_gain: 0.016611577528775887 })
}

/// The detector and the filter on their way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T: Scalar> {
    finder: Finder<T>,
    fit: CubicFit<T, 90>,
    filter: Ekf<T, 2>,
    crossings: u32,
}

impl<T: Scalar<Mask = bool>> Estimator<T> {
    /// Before the first sample.
    pub fn new() -> Self {
        let of = T::of;
        let kernel = slope_kernel();
        let threshold = Threshold::fixed(kernel.noise_deviation(of(1.0)) * of(4.0));
        let start = Covariance::from_standard_deviations([of(0.27249999999999996), of(0.0021800000000002893)]);
        Self {
            finder: Finder::new(kernel, threshold, of(1.0)),
            fit: cubic_fit(),
            filter: Ekf::new([of(-5.558999999999999), of(0.045017000000005976)], start),
            crossings: 0,
        }
    }

    /// Goes on to the next sample, a signal in V; the first is at the start.
    #[inline(always)]
    pub fn step(&mut self, signal_v: T, is_first: bool) -> Result<(), FilterError> {
        let signal = signal_v * T::of(PER_VOLT);
        if !is_first {
            self.filter.predict(&process(), &[])?;
        }
        if self.finder.push(signal).is_some() {
            self.cross()?;
        }
        self.filter.update(&readout(), &[signal], &Covariance::from_variances([T::of(1.0)])).map(drop)
    }

    /// Corrects by a crossing that is known now, where the signal has a zero there.
    #[inline(never)]
    fn cross(&mut self) -> Result<(), FilterError> {
        let of = T::of;
        let Some(crossing) = self.finder.crossing(&self.fit, of(0.0)) else { return Ok(()) };
        let free = Mat([[of(0.0), of(1.0)], [of(-6.259637256499136e-5), of(-0.00010443558759218092)]]);
        let past = angle_at(&free, of(211.0) - crossing.displacement);
        // y′ = h′·ω² where h is 0.
        let rate = (crossing.slope.abs() * of(0.006118064516129844)).sqrt();
        let variance = angle_variance(crossing.timing_variance, rate, of(1.0)) + of(2.97025e-7);
        self.crossings += 1;
        self.filter
            .update_where(&past, &[of(0.20165)], &Covariance::from_variances([variance]), &Always)
            .map(drop)
    }

    /// How many crossings there were.
    #[inline(always)]
    pub fn crossings(&self) -> u32 {
        self.crossings
    }

    /// Angle and rate, in their units.
    #[inline(always)]
    pub fn mean(&self) -> [T; 2] {
        *self.filter.mean()
    }

    /// Their covariance, in their units.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, 2> {
        self.filter.covariance()
    }
}
