//! The annual flow of the Nile at Aswan, 1871–1970 (Cobb, Biometrika 65, 243, 1978; public domain), with the
//! local-level model of Durbin and Koopman: an answer that others have published.

use kalmems_core::{Covariance, Kalman, LinearMeasurement, LinearProcess, Mat};

#[rustfmt::skip]
const FLOW: [f64; 100] = [
    1120., 1160., 963., 1210., 1160., 1160., 813., 1230., 1370., 1140., 995., 935., 1110., 994., 1020., 960.,
    1180., 799., 958., 1140., 1100., 1210., 1150., 1250., 1260., 1220., 1030., 1100., 774., 840., 874., 694.,
    940., 833., 701., 916., 692., 1020., 1050., 969., 831., 726., 456., 824., 702., 1120., 1100., 832., 764.,
    821., 768., 845., 864., 862., 698., 845., 744., 796., 1040., 759., 781., 865., 845., 944., 984., 897., 822.,
    1010., 771., 676., 649., 846., 812., 742., 801., 1040., 860., 874., 848., 890., 744., 749., 838., 1050.,
    918., 986., 797., 923., 975., 815., 1020., 906., 901., 1170., 912., 746., 919., 718., 714., 740.,
];

#[test]
fn likelihood_and_steady_variance() {
    let walk = LinearProcess::<f64, 1, 0> {
        transition: Mat::identity(),
        input: Mat::zero(),
        noise: Covariance::from_variances([1469.1]).into(),
    };
    let level = LinearMeasurement { matrix: Mat([[1.0]]) };
    let r = Covariance::from_variances([15099.0]);
    // The start is the prediction for the first year, so that year has no prediction of its own.
    let mut filter = Kalman::new([0.0], Covariance::from_variances([1e7]));
    let mut log_likelihood = 0.0;
    for (year, flow) in FLOW.iter().enumerate() {
        if year > 0 {
            filter.predict(&walk, &[]).unwrap();
        }
        let innovation = filter.update(&level, &[*flow], &r).unwrap();
        if year > 0 {
            log_likelihood += innovation.log_likelihood();
        }
    }
    assert!((log_likelihood - -632.544_212_278_3).abs() < 1e-6, "{log_likelihood}");
    filter.predict(&walk, &[]).unwrap();
    // The root of the Riccati equation p² − q·p − q·r = 0.
    let steady = 1469.1 / 2.0 + (1469.1_f64.powi(2) / 4.0 + 1469.1 * 15099.0).sqrt();
    approx::assert_relative_eq!(filter.covariance().get(0, 0), steady, max_relative = 1e-9);
}
