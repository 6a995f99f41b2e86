//! The fitting engine against the 27 nonlinear regressions of NIST's Statistical Reference Datasets: parameters,
//! standard deviations and sums of squares certified to eleven digits (National Institute of Standards and
//! Technology, public domain).

use kalmems::fit::{ByDual, Fit, FitSettings, Regression, ResidualLaw, fit};
use kalmems_core::{Over, Scalar};
use std::f64::consts::PI;
use std::path::PathBuf;

/// Observations, x (one or two predictors) and y.
struct Data(Vec<([f64; 2], f64)>);

macro_rules! laws {
    ($($name:ident: $p:literal, |$b:ident, $x:ident| $law:expr;)*) => {$(
        struct $name<'a>(&'a Data);
        impl ResidualLaw<$p> for $name<'_> {
            fn residuals<S: Over<f64>>(&self, $b: &[S; $p], each: &mut impl FnMut(S)) {
                for &([$x, _], y) in &self.0.0 {
                    each($law - y);
                }
            }
        }
    )*};
}

/// x raised to a power that is a parameter.
fn power<S: Scalar>(base: S, exponent: S) -> S {
    (base.ln() * exponent).exp()
}

fn three_decays<S: Over<f64>>(b: &[S; 6], x: f64) -> S {
    b[0] * (-b[1] * x).exp() + b[2] * (-b[3] * x).exp() + b[4] * (-b[5] * x).exp()
}

fn two_peaks<S: Over<f64>>(b: &[S; 8], x: f64) -> S {
    let peak = |height: S, at: S, width: S| height * (-((S::of(x) - at) / width).sq()).exp();
    b[0] * (-b[1] * x).exp() + peak(b[2], b[3], b[4]) + peak(b[5], b[6], b[7])
}

fn cubic_ratio<S: Over<f64>>(b: &[S; 7], x: f64) -> S {
    let above = b[0] + (b[1] + (b[2] + b[3] * x) * x) * x;
    above / (S::of(1.0) + (b[4] + (b[5] + b[6] * x) * x) * x)
}

fn year<S: Over<f64>>(b: &[S; 9], x: f64) -> S {
    let wave = |c: S, s: S, period: S| {
        let angle = S::of(2.0 * PI * x) / period;
        c * angle.cos() + s * angle.sin()
    };
    b[0] + wave(b[1], b[2], S::of(12.0)) + wave(b[4], b[5], b[3]) + wave(b[7], b[8], b[6])
}

laws! {
    Misra1a: 2, |b, x| b[0] * (S::of(1.0) - (-b[1] * x).exp());
    Misra1b: 2, |b, x| b[0] * (S::of(1.0) - (S::of(1.0) + b[1] * (x / 2.0)).sq().recip());
    Misra1c: 2, |b, x| b[0] * (S::of(1.0) - (S::of(1.0) + b[1] * (2.0 * x)).sqrt().recip());
    Misra1d: 2, |b, x| b[0] * b[1] * x / (S::of(1.0) + b[1] * x);
    BoxBod: 2, |b, x| b[0] * (S::of(1.0) - (-b[1] * x).exp());
    DanWood: 2, |b, x| b[0] * power(S::of(x), b[1]);
    Chwirut: 3, |b, x| (-b[0] * x).exp() / (b[1] + b[2] * x);
    Bennett5: 3, |b, x| b[0] * power(b[1] + x, -b[2].recip());
    Eckerle4: 3, |b, x| b[0] / b[1] * (-((S::of(x) - b[2]) / b[1]).sq().half()).exp();
    Rat42: 3, |b, x| b[0] / (S::of(1.0) + (b[1] - b[2] * x).exp());
    Mgh10: 3, |b, x| b[0] * (b[1] / (b[2] + x)).exp();
    Rat43: 4, |b, x| b[0] / power(S::of(1.0) + (b[1] - b[2] * x).exp(), b[3].recip());
    Mgh09: 4, |b, x| b[0] * (b[1] * x + x * x) / (b[2] * x + b[3] + x * x);
    Kirby2: 5, |b, x| (b[0] + b[1] * x + b[2] * (x * x)) / (b[3] * x + b[4] * (x * x) + 1.0);
    Mgh17: 5, |b, x| b[0] + b[1] * (-b[3] * x).exp() + b[2] * (-b[4] * x).exp();
    Lanczos: 6, |b, x| three_decays(b, x);
    CubicRatio: 7, |b, x| cubic_ratio(b, x);
    Gauss: 8, |b, x| two_peaks(b, x);
    Enso: 9, |b, x| year(b, x);
}

/// The logarithm of y is what is fitted here.
struct Nelson<'a>(&'a Data);
impl ResidualLaw<3> for Nelson<'_> {
    fn residuals<S: Over<f64>>(&self, b: &[S; 3], each: &mut impl FnMut(S)) {
        for &([x1, x2], y) in &self.0.0 {
            each(b[0] - b[1] * x1 * (-b[2] * x2).exp() - y.ln());
        }
    }
}

/// Its arctangent is not among a model's functions: derivatives by hand.
struct Roszman1<'a>(&'a Data);
impl Regression<4> for Roszman1<'_> {
    fn residuals(&self, b: &[f64; 4], each: &mut impl FnMut(f64)) {
        self.linearize(b, &mut |residual, _| each(residual));
    }
    fn linearize(&self, b: &[f64; 4], each: &mut impl FnMut(f64, &[f64; 4])) {
        for &([x, _], y) in &self.0.0 {
            let d = x - b[3];
            let square = d * d + b[2] * b[2];
            each(
                b[0] - b[1] * x - (b[2] / d).atan() / PI - y,
                &[1.0, -x, -d / square / PI, -b[2] / square / PI],
            );
        }
    }
}

/// Digits that agree: −log₁₀ of the relative difference.
fn digits(found: f64, certified: f64) -> f64 {
    -((found - certified).abs() / certified.abs()).log10()
}

struct Case {
    name: String,
    starts: [Vec<f64>; 2],
    certified: Vec<f64>,
    deviations: Vec<f64>,
    sum_of_squares: f64,
}

/// Fits from both starts; the worst of the parameters', standard deviations' and sum of squares' digits of each.
fn run<R: Regression<P>, const P: usize>(case: &Case, regression: &R) -> Vec<String> {
    let mut failures = Vec::new();
    for (number, start) in case.starts.iter().enumerate() {
        let start: [f64; P] = std::array::from_fn(|i| start[i]);
        let label = format!("{} start {}", case.name, number + 1);
        let found: Fit<P> = match fit(regression, &FitSettings::from_start(start)) {
            Ok(found) => found,
            Err(why) => {
                failures.push(format!("{label}: {why}"));
                continue;
            }
        };
        let worst = |pairs: &mut dyn Iterator<Item = (f64, f64)>| {
            pairs.map(|(a, b)| digits(a, b)).fold(f64::INFINITY, f64::min)
        };
        let parameters = worst(&mut found.parameters.iter().copied().zip(case.certified.iter().copied()));
        let deviations =
            worst(&mut (0..P).map(|i| (found.covariance.standard_deviation(i), case.deviations[i])));
        let squares = digits(found.sum_of_squares, case.sum_of_squares);
        println!(
            "{label}: {parameters:.1} digits, sd {deviations:.1}, sum of squares {squares:.1}, {} iterations",
            found.iterations
        );
        // The residuals of Lanczos1 are rounding alone, and so are its sum of squares and deviations.
        let rounding = case.name == "Lanczos1.dat";
        if !(parameters >= 6.0 && (rounding || (deviations >= 6.0 && squares >= 6.0))) {
            failures.push(format!("{label}: {parameters:.1}, {deviations:.1}, {squares:.1} digits"));
        }
    }
    failures
}

/// Two of the harder ones, typed in.
#[test]
fn two_problems_of_higher_difficulty() {
    let pairs = |rows: &[(f64, f64)]| Data(rows.iter().map(|&(y, x)| ([x, 0.0], y)).collect());
    let box_bod = Case {
        name: "BoxBOD.dat".to_owned(),
        starts: [vec![1.0, 1.0], vec![100.0, 0.75]],
        certified: vec![213.809_408_89, 0.547_237_485_42],
        deviations: vec![12.354_515_176, 0.104_559_932_37],
        sum_of_squares: 1_168.008_876_6,
    };
    let rows = [(109.0, 1.0), (149.0, 2.0), (149.0, 3.0), (191.0, 5.0), (213.0, 7.0), (224.0, 10.0)];
    let mut failures = run(&box_bod, &ByDual(BoxBod(&pairs(&rows))));
    let mgh09 = Case {
        name: "MGH09.dat".to_owned(),
        starts: [vec![25.0, 39.0, 41.5, 39.0], vec![0.25, 0.39, 0.415, 0.39]],
        certified: vec![0.192_806_934_58, 0.191_282_328_73, 0.123_056_506_93, 0.136_062_330_68],
        deviations: vec![0.011_435_312_227, 0.196_332_209_11, 0.080_842_031_232, 0.090_025_542_308],
        sum_of_squares: 3.075_056_038_5e-4,
    };
    let y = [0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246];
    let x = [4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625];
    let rows: Vec<(f64, f64)> = y.into_iter().zip(x).collect();
    failures.extend(run(&mgh09, &ByDual(Mgh09(&pairs(&rows)))));
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn all_problems_from_both_starts() {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    let folder = PathBuf::from(folder).join("real/nist_strd");
    let expected: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("expected.json")).unwrap()).unwrap();
    let numbers = |v: &serde_json::Value| -> Vec<f64> {
        v.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let mut failures = Vec::new();
    let mut problems = 0;
    for (name, case) in expected["cases"].as_object().unwrap() {
        let case = Case {
            name: name.clone(),
            starts: [numbers(&case["start1"]), numbers(&case["start2"])],
            certified: numbers(&case["certified"]),
            deviations: numbers(&case["certified_sd"]),
            sum_of_squares: case["certified_rss"].as_f64().unwrap(),
        };
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        let (_, table) = text.rsplit_once("Data:").unwrap();
        let data = Data(
            table
                .lines()
                .skip(1)
                .filter(|line| !line.trim().is_empty())
                .map(|line| {
                    let row: Vec<f64> = line.split_whitespace().map(|v| v.parse().unwrap()).collect();
                    ([row[1], row.get(2).copied().unwrap_or(0.0)], row[0])
                })
                .collect(),
        );
        let d = &data;
        problems += 1;
        failures.extend(match name.as_str() {
            "Misra1a.dat" => run(&case, &ByDual(Misra1a(d))),
            "Misra1b.dat" => run(&case, &ByDual(Misra1b(d))),
            "Misra1c.dat" => run(&case, &ByDual(Misra1c(d))),
            "Misra1d.dat" => run(&case, &ByDual(Misra1d(d))),
            "BoxBOD.dat" => run(&case, &ByDual(BoxBod(d))),
            "DanWood.dat" => run(&case, &ByDual(DanWood(d))),
            "Chwirut1.dat" | "Chwirut2.dat" => run(&case, &ByDual(Chwirut(d))),
            "Bennett5.dat" => run(&case, &ByDual(Bennett5(d))),
            "Eckerle4.dat" => run(&case, &ByDual(Eckerle4(d))),
            "Rat42.dat" => run(&case, &ByDual(Rat42(d))),
            "MGH10.dat" => run(&case, &ByDual(Mgh10(d))),
            "Rat43.dat" => run(&case, &ByDual(Rat43(d))),
            "MGH09.dat" => run(&case, &ByDual(Mgh09(d))),
            "Kirby2.dat" => run(&case, &ByDual(Kirby2(d))),
            "MGH17.dat" => run(&case, &ByDual(Mgh17(d))),
            "Lanczos1.dat" | "Lanczos2.dat" | "Lanczos3.dat" => run(&case, &ByDual(Lanczos(d))),
            "Hahn1.dat" | "Thurber.dat" => run(&case, &ByDual(CubicRatio(d))),
            "Gauss1.dat" | "Gauss2.dat" | "Gauss3.dat" => run(&case, &ByDual(Gauss(d))),
            "ENSO.dat" => run(&case, &ByDual(Enso(d))),
            "Nelson.dat" => run(&case, &ByDual(Nelson(d))),
            "Roszman1.dat" => run(&case, &Roszman1(d)),
            other => panic!("no law for {other}"),
        });
    }
    assert_eq!(problems, 27);
    assert!(failures.is_empty(), "{} of 54 runs fail:\n{}", failures.len(), failures.join("\n"));
}
