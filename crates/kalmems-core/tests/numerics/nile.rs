//! The annual flow of the Nile at Aswan, 1871–1970 (Cobb, Biometrika 65, 243, 1978; public domain), with the
//! local-level model of Durbin and Koopman: an answer that others have published.

use kalmems_core::smooth::{Backward, Smoothed, SmoothingCourse, smooth_interval};
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, Information, InformationError, Kalman, LinearMeasurement,
    LinearProcess, Mat, StateTransition,
};

#[rustfmt::skip]
const FLOW: [f64; 100] = [
    1120., 1160., 963., 1210., 1160., 1160., 813., 1230., 1370., 1140., 995., 935., 1110., 994., 1020., 960.,
    1180., 799., 958., 1140., 1100., 1210., 1150., 1250., 1260., 1220., 1030., 1100., 774., 840., 874., 694.,
    940., 833., 701., 916., 692., 1020., 1050., 969., 831., 726., 456., 824., 702., 1120., 1100., 832., 764.,
    821., 768., 845., 864., 862., 698., 845., 744., 796., 1040., 759., 781., 865., 845., 944., 984., 897., 822.,
    1010., 771., 676., 649., 846., 812., 742., 801., 1040., 860., 874., 848., 890., 744., 749., 838., 1050.,
    918., 986., 797., 923., 975., 815., 1020., 906., 901., 1170., 912., 746., 919., 718., 714., 740.,
];

const LEVEL: LinearMeasurement<f64, 1, 1> = LinearMeasurement { matrix: Mat([[1.0]]) };

fn walk() -> LinearProcess<f64, 1, 0> {
    LinearProcess {
        transition: Mat::identity(),
        input: Mat::zero(),
        noise: Covariance::from_variances([1469.1]).into(),
    }
}

fn noise() -> Covariance<f64, 1> {
    Covariance::from_variances([15099.0])
}

#[test]
fn likelihood_and_steady_variance() {
    // The start is the prediction for the first year, so that year has no prediction of its own.
    let mut filter = Kalman::new([0.0], Covariance::from_variances([1e7]));
    let mut log_likelihood = 0.0;
    for (year, flow) in FLOW.iter().enumerate() {
        if year > 0 {
            filter.predict(&walk(), &[]).unwrap();
        }
        let innovation = filter.update(&LEVEL, &[*flow], &noise()).unwrap();
        if year > 0 {
            log_likelihood += innovation.log_likelihood();
        }
    }
    assert!((log_likelihood - -632.544_212_278_3).abs() < 1e-6, "{log_likelihood}");
    filter.predict(&walk(), &[]).unwrap();
    // The root of the Riccati equation p² − q·p − q·r = 0.
    let steady = 1469.1 / 2.0 + (1469.1_f64.powi(2) / 4.0 + 1469.1 * 15099.0).sqrt();
    approx::assert_relative_eq!(filter.covariance().get(0, 0), steady, max_relative = 1e-9);
}

/// What a filter and a smoother say of one year.
#[derive(Clone, Copy, Debug, Default)]
struct Year {
    filtered: f64,
    filtered_variance: f64,
    innovation: f64,
    innovation_variance: f64,
    smoothed: f64,
    smoothed_variance: f64,
}

impl Year {
    fn columns(&self) -> [f64; 6] {
        let Self {
            filtered,
            filtered_variance,
            innovation,
            innovation_variance,
            smoothed,
            smoothed_variance,
        } = *self;
        [filtered, filtered_variance, innovation, innovation_variance, smoothed, smoothed_variance]
    }
}

/// The years after the first, which is corrected before.
struct LaterYears;

impl SmoothingCourse<f64, Ekf<f64, 1>, 1> for LaterYears {
    type Error = FilterError;
    fn samples(&self) -> usize {
        FLOW.len()
    }
    fn advance(
        &mut self,
        filter: &mut Ekf<f64, 1>,
        _: usize,
    ) -> Result<StateTransition<f64, 1>, FilterError> {
        filter.predict_linked(&walk(), &[])
    }
    fn correct(&mut self, filter: &mut Ekf<f64, 1>, year: usize) -> Result<(), FilterError> {
        if year == 0 { Ok(()) } else { filter.update(&LEVEL, &[FLOW[year]], &noise()).map(|_| ()) }
    }
}

/// The filter from the start a1 = 0, P1 = 1e7 as the prediction for 1871; the smoother from no knowledge at
/// all.
fn years() -> Vec<Year> {
    let mut years = vec![Year::default(); FLOW.len()];
    let mut filter = Kalman::new([0.0], Covariance::from_variances([1e7]));
    for (k, year) in years.iter_mut().enumerate() {
        if k > 0 {
            filter.predict(&walk(), &[]).unwrap();
        }
        let innovation = filter.update(&LEVEL, &[FLOW[k]], &noise()).unwrap();
        year.filtered = filter.mean()[0];
        year.filtered_variance = filter.covariance().get(0, 0);
        year.innovation = innovation.residual[0];
        year.innovation_variance = innovation.covariance.get(0, 0);
    }
    let mut start = Information::nothing();
    assert_eq!(start.gaussian(), Err(InformationError::Undetermined { rank: 0, states: 1 }));
    start.update(&LEVEL, &[FLOW[0]], &noise()).unwrap();
    let known = start.gaussian().unwrap();
    let start = Ekf::new(known.mean, known.covariance);
    let mut block = [Backward::identity(); 10];
    smooth_interval(
        &start,
        &mut LaterYears,
        &mut [start; 10],
        &mut block,
        |k, smoothed: &Smoothed<f64, 1>| {
            years[k].smoothed = smoothed.mean[0];
            years[k].smoothed_variance = smoothed.covariance().get(0, 0);
            Ok(())
        },
    )
    .unwrap();
    years
}

/// Each column of a year within 1e-8 of the reference.
fn assert_row(year: usize, ours: &Year, reference: [f64; 6]) {
    for (column, (ours, reference)) in ours.columns().into_iter().zip(reference).enumerate() {
        assert!(
            (ours - reference).abs() <= 1e-8 * reference.abs(),
            "{year}, column {column}: {ours} and not {reference}"
        );
    }
}

/// Some rows of a reference: the filter recomputed with the start a1 = 0, P1 = 1e7, the smoother by
/// statsmodels 0.15 with its exact diffuse start.
#[test]
#[rustfmt::skip]
#[allow(clippy::unreadable_literal)] // as printed
fn some_years_as_others_have_them() {
    let years = years();
    for (year, reference) in [
        (1871, [1118.31146152, 15076.2363907, 1120.0, 10015099.0, 1111.66831913, 4032.15794181]),
        (1872, [1140.10843916, 7894.55753088, 41.6885384758, 31644.3363907, 1110.85766462, 3242.93007322]),
        (1917, [916.615878289, 4032.15794181, 250.199364838, 20600.2579418, 871.740064026, 2326.75686981]),
        (1970, [798.370292608, 4032.15794181, -79.6372663005, 20600.2579418, 798.370292608, 4032.15794181]),
    ] {
        assert_row(year, &years[year - 1871], reference);
    }
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn every_year_as_others_have_it() {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    let path = std::path::Path::new(&folder).join("real/nile_local_level/kalman_reference.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some(
            "year,filtered_level,filtered_variance,innovation,innovation_variance,smoothed_level,smoothed_variance"
        )
    );
    let years = years();
    let mut rows = 0_u32;
    for (line, ours) in lines.zip(&years) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(cells[0], f64::from(1871 + rows));
        assert_row(1871 + rows as usize, ours, std::array::from_fn(|i| cells[1 + i]));
        rows += 1;
    }
    assert_eq!(rows, 100);
}
