//! The filter of a threshold-sensing scanner and its detector, for a microcontroller.

// Made by kalmems 0.1.0 with `kalmems export`; not to be edited.
// Experiment `threshold_scanner`, sha256 d058834e39d7d1f1ca77fab91b398f706b0f1b3f922caae6d34f46076fc5c6fc, filter `Hybrid`.
// Sampling interval 2.0000000000000486e-6 s, corrected by every sample.

use kalmems_core::detect::{CubicDesign, CubicFit, Detector, SlopeKernel, Threshold, angle_at, angle_variance};
use kalmems_core::update::Always;
use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearProcess, Mat, ProcessNoise, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::readout::CurrentReadout;

/// The unit of the angle in rad.
pub const ANGLE_UNIT_RAD: f64 = 0.01834862385321101;
/// The unit of the rate in rad/s.
pub const RATE_UNIT_RAD_PER_S: f64 = 9174.311926605282;
/// What a signal of 1 V is, in standard deviations of its noise.
pub const PER_VOLT: f64 = 22.988505747126435;
/// How many samples after it happened a crossing is known.
pub const LOOK_AHEAD: usize = Finder::<f64>::LOOK_AHEAD;

/// What finds crossings.
type Finder<T> = Detector<T, 60, 150, 336>;

/// One step over one interval, and its noise.
#[inline(always)]
pub fn process<T: Scalar>() -> LinearProcess<T, 2, 0> {
    let of = T::of;
    LinearProcess {
        transition: Mat([[of(0.9999687030664928), of(0.9999373518726021)], [of(-6.259245101945472e-5), of(0.9998642740215946)]]),
        input: Mat([[], []]),
        // With its root, which is not found anew with each step.
        noise: ProcessNoise::with_root(
            Mat([[of(3.7683108518357885e-11), of(0.0)], [of(5.652271524989783e-11), of(1.1304543067397221e-10)]]),
            Mat([[of(6.138656898569742e-6), of(0.0)], [of(9.207668091544125e-6), of(5.316415991053783e-6)]]),
        ),
    }
}

/// What is read, in standard deviations of its noise.
#[inline(always)]
pub fn readout<T: Scalar>() -> CurrentReadout<T> {
    let of = T::of;
    let comb = CombCurve {
        centre: of(0.41964999999999997),
        gain: of(653.8015395971579),
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
        of(0.00011806041396840452), of(0.00023455192457252675), of(0.00034794032567345834), of(0.0004567597328792455),
        of(0.0005596441052352299), of(0.0006553557170460303), of(0.0007428097523894923), of(0.0008210943452641918),
        of(0.0008894855623605482), of(0.0009474570150487559), of(0.0009946839836720762), of(0.0010310421318753004),
        of(0.0010566010731133605), of(0.0010716132180979268), of(0.0010764984743317544), of(0.0010718254820720576),
        of(0.0010582901517037057), of(0.0010366923139549828), of(0.0010079113067217582), of(0.0009728813021470713),
        of(0.0009325671281095726), of(0.0008879412636402163), of(0.0008399625931034238), of(0.0007895573948712946),
        of(0.0007376029225166683), of(0.0006849138159749109), of(0.0006322314620105297), of(0.0005802163123887509),
        of(0.0005294430683131317), of(0.00048039855395433454), of(0.000433482032300839), of(0.0003890076641838897),
        of(0.00034720877633138503), of(0.0003082435860424068), of(0.0002722020272176484), of(0.00023911333317214997),
        of(0.00020895405366523298), of(0.00018165621446590208), of(0.0001571153650245695), of(0.00013519830100660587),
        of(0.00011575029130083727), of(9.860168164987218e-5), of(8.35737875821591e-5), of(7.048402653313266e-5),
        of(5.915027196038958e-5), of(4.939444027003245e-5), of(4.104534418319101e-5), of(3.394086376885635e-5),
        of(2.792949896962706e-5), of(2.287137544979505e-5), of(1.863877952852968e-5), of(1.5116298432956897e-5),
        of(1.2200639760897076e-5), of(9.800199523562509e-6), of(7.83444205546965e-6), of(6.23314798858301e-6),
        of(4.935578876883791e-6), of(3.8895993343467045e-6), of(3.0507900406624246e-6), of(2.3815779225626636e-6),
    ];
    SlopeKernel::of_table(weights, [4.187524351732231e-5, 2.791672592640755e-7, 3.101803095092918e-9])
}

/// The cubic around a crossing.
#[inline(always)]
fn cubic_fit<T: Scalar>() -> CubicFit<T, 90> {
    let of = T::of;
    let weights = [
        of(0.9994445987368581), of(0.9977802450856064), of(0.9950124791926821), of(0.9911505004882845),
        of(0.9862071167439156), of(0.9801986733067544), of(0.9731449630580498), of(0.9650691177896787),
        of(0.9559974818330979), of(0.945959468906763), of(0.93498740327045), of(0.9231163463866322),
        of(0.9103839103891382), of(0.896830059746864), of(0.8824969025845901), of(0.8674284731834048),
        of(0.8516705072294344), of(0.8352702114112648), of(0.8182760289835412), of(0.8007374029167994),
        of(0.7827045382418589), of(0.7642281651714805), of(0.7453593045429698), of(0.7261490370736796),
        of(0.7066482778577043), of(0.6869075574573753), of(0.6669768108584613), of(0.6469051754643387),
        of(0.6267407992029788), of(0.6065306597126188), of(0.5863203954586832), of(0.5661541495171819),
        of(0.5460744266396933), of(0.52612196409344), of(0.5063356166480839), of(0.4867522559599547),
        of(0.4674066844856015), of(0.4483315639409255), of(0.4295573582107215), of(0.4111122905071697),
        of(0.3930223144754912), of(0.37531109885138175), of(0.35800002518858176), of(0.3411081980965742),
        of(0.324652467358332), of(0.30864746123660136), of(0.29310563022458125), of(0.27803730045317676),
        of(0.2634507359322396), of(0.24935220877727937), of(0.23574607655584698), of(0.22263486587887474),
        of(0.21001936136137228), of(0.1978986990835991), of(0.18627046369768568), of(0.17513078834513612),
        of(0.1644744565771405), of(0.15429500550155434), of(0.1445848294171436), of(0.1353352832365996),
        of(0.12653678504425916), of(0.11817891718176822), of(0.11025052530447337), of(0.10273981490248299),
        of(0.0956344448325277), of(0.08892161745937588), of(0.0825881650581049), of(0.07662063218048393),
        of(0.07100535373962787), of(0.06572852861652181), of(0.06077628863961593), of(0.0561347628341259),
        of(0.05179013688066605), of(0.047728707763157074), of(0.043936933623400724), of(0.040401478874156925),
        of(0.03710925465389895), of(0.03404745473459375), of(0.03120358701884384), of(0.028565500784545443),
        of(0.02612140985391362), of(0.023859911879375924), of(0.021770003951544322), of(0.019841094744366527),
        of(0.018063013419777743), of(0.016426015518882262), of(0.014920786069064794), of(0.01353844013664953),
        of(0.012270521052975634), of(0.01110899653823988),
    ];
    let moments = [75.00675055165871, 73.09489226801175, 201.88354423565048, 851.0445314636409];
    CubicFit::of_table(weights, &CubicDesign { width: 29.99999999999927, moments, noise_gain: 0.016611577528774547 })
}

/// The detector and the filter on their way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T: Scalar> {
    finder: Finder<T>,
    fit: CubicFit<T, 90>,
    filter: Ekf<T, 2>,
    crossings: u32,
}

impl<T: Scalar> Estimator<T> {
    /// Before the first sample.
    pub fn new() -> Self {
        let of = T::of;
        let kernel = slope_kernel();
        let threshold = Threshold::fixed(kernel.noise_deviation(of(1.0)) * of(4.0));
        let start = Covariance::from_standard_deviations([of(0.27249999999999996), of(0.002180000000000053)]);
        Self {
            finder: Finder::new(kernel, threshold, of(1.0)),
            fit: cubic_fit(),
            filter: Ekf::new([of(-5.558999999999999), of(0.04501700000000109)], start),
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
        let free = Mat([[of(0.0), of(1.0)], [of(-6.25963725649778e-5), of(-0.00010443558759216962)]]);
        let past = angle_at(&free, of(211.0) - crossing.displacement);
        // The rate then, h·A·x, makes an error of the time one of the angle.
        let ([by_angle, by_rate], [angle, rate]) = (past.matrix.times(&free).0[0], *self.filter.mean());
        let rate = by_angle * angle + by_rate * rate;
        let variance = angle_variance(crossing.timing_variance, rate, of(1.0)) + of(2.97025e-7);
        self.crossings += 1;
        // The samples from which it was found correct the filter themselves, all or a part of them: so much it is less certain, and gives back.
        let before = self.filter.covariance();
        let variance = Covariance::from_variances([variance * of(1.0 + 1.0)]);
        self.filter.update_where(&past, &[of(0.20165)], &variance, &Always)?;
        let after = self.filter.covariance();
        let claimed = |i, j| after.get(i, j) + of(1.0) * (before.get(i, j) - after.get(i, j));
        self.filter = Ekf::new(*self.filter.mean(), Covariance::from_lower(Mat::from_fn(claimed)));
        Ok(())
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
