//! Allan's deviations against published figures and the tables of another program.

use kalmems_engines::signal::{AllanDeviation, Deviation, OctaveSums, octaves};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::fs;
use std::path::PathBuf;

const ALL: [(&str, Deviation); 7] = [
    ("adev", Deviation::Allan),
    ("oadev", Deviation::Overlapping),
    ("mdev", Deviation::Modified),
    ("tdev", Deviation::Time),
    ("hdev", Deviation::Hadamard),
    ("ohdev", Deviation::OverlappingHadamard),
    ("totdev", Deviation::Total),
];

/// As far apart as rounding to seven digits may put them.
fn assert_published(found: &[AllanDeviation], published: &[f64], what: &str) {
    assert_eq!(found.len(), published.len(), "{what}");
    for (found, published) in found.iter().zip(published) {
        assert!((found.deviation / published - 1.0).abs() < 5e-7, "{what}: {found:?} {published}");
    }
}

/// Riley, NIST Special Publication 1065, 2008, section 12.4: 1000 numbers of a generator, at 1, 10 and 100 s.
#[test]
fn a_thousand_published_samples() {
    let rate = generated(1_234_567_890, 1000);
    let published = [
        [0.292_231_9, 0.099_657_36, 0.038_978_04],
        [0.292_231_9, 0.091_599_53, 0.032_413_43],
        [0.292_231_9, 0.061_723_76, 0.021_709_21],
        [0.168_720_2, 0.356_362_3, 1.253_382],
        [0.294_388_3, 0.105_275_4, 0.039_108_6],
        [0.294_388_3, 0.095_810_83, 0.032_376_38],
        [0.292_231_9, 0.091_347_43, 0.034_065_3],
    ];
    for ((name, deviation), published) in ALL.into_iter().zip(published) {
        assert_published(&deviation.of(&rate, 1.0, &[1, 10, 100]), &published, name);
    }
}

/// The same publication, section 12.2: nine rates, at 1 and 2 s.
#[test]
fn nine_published_samples() {
    let rate = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0];
    let published = [
        [91.229_45, 115.808_2],
        [91.229_45, 85.952_87],
        [91.229_45, 74.788_49],
        [52.671_35, 86.358_31],
        [70.806_07, 116.798_0],
        [70.806_07, 85.614_87],
        [91.229_45, 93.903_79],
    ];
    for ((name, deviation), published) in ALL.into_iter().zip(published) {
        assert_published(&deviation.of(&rate, 1.0, &[1, 2]), &published, name);
    }
}

/// So many numbers of the generator of the publication, from 0 to 1.
fn generated(mut state: u64, count: usize) -> Vec<f64> {
    let numbers = std::iter::repeat_with(|| {
        let value = state as f64 / 2_147_483_647.0;
        state = state * 16_807 % 2_147_483_647;
        value
    });
    numbers.take(count).collect()
}

/// White noise with a random walk.
fn wandering(count: usize) -> Vec<f64> {
    let steps = generated(42, count).into_iter().scan(0.0, |sum, step| {
        *sum += step - 0.5;
        Some(*sum)
    });
    generated(1_234_567_890, count)
        .iter()
        .zip(steps)
        .map(|(white, walk)| white - 0.5 + 0.002 * walk)
        .collect()
}

/// Made by allantools 2024.6 with NumPy 2.4.6: `allantools.oadev(y, rate=1.0, data_type="freq", taus=[1, 2, 4, …])` and likewise `mdev`, `ohdev` and
/// `totdev`, where y is the record of `wandering(150_000)`, computed in Python.
const BY_ALLANTOOLS: [(Deviation, &[f64]); 4] = [
    (
        Deviation::Overlapping,
        &[
            0.288_049_378_972_374_04,
            0.204_604_946_767_961_98,
            0.144_773_161_056_006_63,
            0.101_917_029_273_092_72,
            0.071_471_053_436_694_38,
            0.049_906_877_560_591_13,
            0.035_796_114_600_208_824,
            0.025_576_601_336_076_91,
            0.018_688_532_214_611_836,
            0.014_032_054_691_374_593,
            0.012_890_844_579_052_284,
            0.015_279_225_258_200_06,
            0.021_434_501_443_220_268,
            0.032_682_227_107_204_01,
            0.052_211_075_054_673_03,
            0.090_478_793_029_270_27,
            0.111_778_023_293_780_3,
        ],
    ),
    (
        Deviation::Modified,
        &[
            0.288_049_378_972_372_65,
            0.161_816_546_710_593_17,
            0.105_423_078_467_855_45,
            0.072_539_121_169_408_85,
            0.050_263_987_618_947_924,
            0.035_357_940_029_710_92,
            0.025_351_813_695_076_473,
            0.018_268_715_576_632_38,
            0.013_500_978_607_175_019,
            0.010_488_321_196_821_743,
            0.010_637_029_099_290_308,
            0.013_678_322_697_264_893,
            0.019_747_017_937_746_796,
            0.030_435_828_095_541_12,
            0.050_837_775_019_468_79,
            0.085_625_720_578_371_27,
        ],
    ),
    (
        Deviation::OverlappingHadamard,
        &[
            0.287_663_434_426_219_6,
            0.204_541_394_431_238_1,
            0.144_951_062_494_202_3,
            0.102_029_288_408_404_51,
            0.071_762_178_369_355_26,
            0.049_709_768_500_276_89,
            0.035_728_557_656_750_04,
            0.025_422_216_615_129_223,
            0.018_477_686_947_118_092,
            0.013_255_419_315_401_7,
            0.010_954_474_332_413_11,
            0.011_117_929_590_368_46,
            0.014_320_750_194_867_445,
            0.019_351_134_912_597_608,
            0.031_339_249_536_559,
            0.067_902_379_681_361_94,
        ],
    ),
    (
        Deviation::Total,
        &[
            0.288_049_378_972_374_04,
            0.204_605_869_115_821_74,
            0.144_771_205_762_914_25,
            0.101_913_163_118_626_07,
            0.071_466_138_250_932_45,
            0.049_907_143_535_687_66,
            0.035_789_656_072_299_07,
            0.025_568_256_350_046_68,
            0.018_679_667_503_757_63,
            0.013_993_688_268_167_895,
            0.012_829_241_376_914_447,
            0.015_112_069_440_371_766,
            0.021_090_813_279_607_95,
            0.031_817_031_708_843_035,
            0.049_599_103_035_520_81,
            0.075_409_894_381_793_4,
            0.101_641_691_632_092_37,
        ],
    ),
];

/// In parts of any size as in one.
#[test]
fn octaves_are_those_of_allantools() {
    let rate = wandering(150_000);
    let mut parts = OctaveSums::default();
    rate.chunks(7919).for_each(|part| parts.push(part));
    parts.end_stretch();
    for sums in [OctaveSums::of(&[&rate]), parts] {
        for (deviation, expected) in BY_ALLANTOOLS {
            let found = deviation.with_confidence(&sums, 1.0, 0.95, |_| Some(0));
            assert_eq!(found.len(), expected.len(), "{deviation:?}");
            for (found, expected) in found.iter().zip(expected) {
                let found = found.averaged;
                assert!(
                    (found.deviation / expected - 1.0).abs() < 1e-9,
                    "{deviation:?} {found:?} {expected}"
                );
            }
        }
    }
}

/// Beyond 131 072 samples a difference is formed from each eighth of them, which changes the deviation by less than a ten-thousandth where chance
/// alone changes it by a half.
#[test]
fn the_longest_octaves_are_nearly_those_of_all_differences() {
    let rate = wandering(600_000);
    let all = Deviation::Overlapping.of(&rate, 1.0, &[131_072, 262_144]);
    let found = Deviation::Overlapping.with_confidence(&OctaveSums::of(&[&rate]), 1.0, 0.95, |_| Some(0));
    let off = [17, 18].map(|place| found[place].averaged.deviation / all[place - 17].deviation - 1.0);
    assert!(off[0].abs() < 1e-12 && off[1].abs() < 1e-4 && off[1] != 0.0, "{off:?}");
}

/// Prints what 10⁸ samples take, and asserts the memory of the whole process.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "10⁸ samples; cargo test --workspace --test engines -- --ignored slow_octaves --nocapture"]
fn slow_octaves_of_a_hundred_million_samples_take_less_than_100_mb() {
    let processor_s = || {
        let times = fs::read_to_string("/proc/thread-self/schedstat").unwrap();
        times.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
    };
    let (mut sums, mut state, mut making_s) = (OctaveSums::default(), 1_234_567_890_u64, 0.0);
    let mut part = vec![0.0; 1 << 16];
    let begin = processor_s();
    for _ in 0..1526 {
        let before = processor_s();
        for value in &mut part {
            *value = state as f64 / 2_147_483_647.0;
            state = state * 16_807 % 2_147_483_647;
        }
        making_s += processor_s() - before;
        sums.push(&part);
    }
    sums.end_stretch();
    let found = Deviation::Overlapping.with_confidence(&sums, 1.0, 0.95, |_| Some(0));
    println!("{:.2} s of processor time without that for the numbers", processor_s() - begin - making_s);
    // The numbers are uniform: their variance is 1/12, and that of means of m is 1/12m.
    for found in found.iter().filter(|found| found.averaged.factor <= 1 << 16) {
        let AllanDeviation { factor, deviation, .. } = found.averaged;
        let off = deviation * (12.0 * factor as f64).sqrt() - 1.0;
        assert!(off.abs() < 5.0 / (2.0 * found.freedom).sqrt(), "{found:?}");
    }
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap().trim();
    println!("{peak} at most");
    let kilobytes: f64 = peak.trim_end_matches(" kB").parse().unwrap();
    assert!(kilobytes < 100e3, "{peak}");
}

/// By the definition: means of the samples that are there, at most one in ten missing, and the differences of neighbours.
fn by_means(rate: &[f64], m: usize, is_complete: bool) -> (f64, usize) {
    let mean = |from: usize| {
        let there: Vec<f64> = rate[from..from + m].iter().copied().filter(|v| v.is_finite()).collect();
        let gone = m - there.len();
        let counts = if is_complete { gone == 0 } else { 10 * gone <= m };
        counts.then(|| (there.iter().sum::<f64>() / there.len() as f64, gone))
    };
    let (mut sum, mut terms) = (0.0, 0);
    for start in 0..=rate.len() - 2 * m {
        if let (Some((first, a)), Some((second, b))) = (mean(start), mean(start + m)) {
            sum += 0.5 * (second - first).powi(2) * (1.0 - (a + b) as f64 / (2 * m) as f64);
            terms += 1;
        }
    }
    ((sum / terms as f64).sqrt(), terms)
}

#[test]
fn a_gap_takes_the_differences_that_reach_into_it_and_no_averaging_time() {
    let mut rate = wandering(6000);
    // One sample in 97 is missing, and a stretch of 300.
    rate.iter_mut().step_by(97).for_each(|rate| *rate = f64::NAN);
    rate[2000..2300].fill(f64::NAN);
    let mut skipped = OctaveSums::default();
    skipped.push(&rate[..2000]);
    skipped.skip(300);
    skipped.push(&rate[2300..]);
    skipped.end_stretch();
    for sums in [OctaveSums::of(&[&rate]), skipped] {
        let found = Deviation::Overlapping.with_confidence(&sums, 1.0, 0.95, |_| Some(0));
        let factors: Vec<usize> = found.iter().map(|found| found.averaged.factor).collect();
        // At 2048 samples there are differences that have half of the long gap in each of their means.
        assert_eq!(factors, octaves(6000));
        for found in found {
            let found = found.averaged;
            // From 32 samples on fewer than half of the differences have all samples.
            let (expected, terms) = by_means(&rate, found.factor, found.factor < 32);
            assert_eq!(found.terms, terms, "{found:?}");
            assert!((found.deviation / expected - 1.0).abs() < 1e-9, "{found:?} {expected}");
        }
    }
}

/// Of two records that have nothing to do with one another the squares are put together, and the degrees of freedom.
#[test]
fn records_are_pooled_at_equal_averaging_times() {
    let (first, second) = (wandering(3000), generated(99, 2000));
    let whole = |records: &[&[f64]]| {
        Deviation::Overlapping.with_confidence(&OctaveSums::of(records), 0.5, 0.95, |_| Some(0))
    };
    let (both, first, second) = (whole(&[&first, &second]), whole(&[&first]), whole(&[&second]));
    for (both, (first, second)) in both.iter().zip(first.iter().zip(&second)) {
        let square = |found: &kalmems_engines::signal::Confident| {
            found.averaged.terms as f64 * found.averaged.deviation.powi(2)
        };
        let terms = first.averaged.terms + second.averaged.terms;
        let expected = ((square(first) + square(second)) / terms as f64).sqrt();
        assert!((both.averaged.deviation / expected - 1.0).abs() < 1e-12, "{both:?}");
        assert!((both.freedom / (first.freedom + second.freedom) - 1.0).abs() < 1e-12, "{both:?}");
    }
    assert_eq!((both.len(), second.len()), (11, 10));
}

#[test]
fn what_a_record_is_too_short_for_is_left_out() {
    for (name, deviation) in ALL {
        assert!(deviation.of(&[], 1.0, &[1, 2]).is_empty(), "{name}");
        assert!(deviation.of(&[1.0], 1.0, &[0, 1, 5]).iter().all(|a| a.terms > 0), "{name}");
        let found = deviation.of(&[1.0, 2.0, 4.0, 3.0, 5.0], 0.5, &octaves(5));
        assert!(!found.is_empty() && found.iter().all(|a| a.deviation.is_finite()), "{name}: {found:?}");
    }
    // A linear drift of the rate is in Allan's, drift·τ/√2, and not in Hadamard's.
    let drift: Vec<f64> = (0..100).map(|k| 3.0 * f64::from(k)).collect();
    let [allan] = Deviation::Overlapping.of(&drift, 1.0, &[4])[..] else { panic!("one") };
    assert!((allan.deviation - 3.0 * 4.0 / 2.0_f64.sqrt()).abs() < 1e-10);
    let [hadamard] = Deviation::OverlappingHadamard.of(&drift, 1.0, &[4])[..] else { panic!("one") };
    assert!(hadamard.deviation < 1e-10);
}

/// How long the record is in s.
fn length_s(is_phase: bool, phase: &[f64], frequency: &[f64]) -> f64 {
    if is_phase { phase.len() as f64 - 1.0 } else { frequency.len() as f64 }
}

/// The tables of Stable32 for a computed phase and a measured oscillator: factor, τ, terms, α, lowest, σ, highest.
///
/// Its overlapping tables of the oscillator hold the rounding of a phase that grows by 1 s each second, to 2e4 s: with one
/// interval, where overlapping and plain are the same sum, its two tables differ by 4.9e-4. From a phase summed up as
/// that ours show the same, but for one row whose rounding took another way. Its total deviation is corrected for what the
/// mirrors take from flicker and random-walk noise, 1 − a·τ/T of the variance with a = 1/(3·ln 2) and 3/4.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn stable32() {
    let folder =
        PathBuf::from(std::env::var("KALMEMS_REFERENCE_DATA").expect("the folder of the reference data"));
    let folder = folder.join("real/allan_reference");
    let lines = |name: &str| -> Vec<Vec<f64>> {
        let text = fs::read_to_string(folder.join(name)).unwrap();
        let numbers = |line: &str| line.split_whitespace().filter_map(|cell| cell.parse().ok()).collect();
        text.lines()
            .filter(|line| !line.starts_with('#'))
            .map(numbers)
            .filter(|row: &Vec<f64>| !row.is_empty())
            .collect()
    };
    let phase: Vec<f64> = lines("PHASE.DAT").concat();
    assert_eq!(phase.len(), 1001);
    let frequency: Vec<f64> = lines("ocxo_frequency.txt").concat();
    let rate: Vec<f64> = frequency.iter().map(|f| f / 1e7 - 1.0).collect();
    let mut growing = vec![0.0];
    growing.extend(frequency.iter().scan(0.0, |sum, f| {
        *sum += f / 1e7;
        Some(*sum)
    }));
    let mut compared = 0;
    for (name, deviation) in ALL {
        let overlapping = matches!(name, "oadev" | "mdev" | "tdev" | "ohdev" | "totdev");
        for (record, is_phase) in [("phase_dat", true), ("ocxo", false)] {
            for row in lines(&format!("{record}_{name}_octave.txt")) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a factor
                let factor = [row[0] as usize];
                let found = match (is_phase, overlapping) {
                    (true, _) => deviation.of_phase(&phase, 1.0, &factor),
                    (false, true) => deviation.of_phase(&growing, 1.0, &factor),
                    (false, false) => deviation.of(&rate, 1.0, &factor),
                };
                let [found] = found[..] else { panic!("{record} {name} {factor:?}") };
                // Rows without a kind of noise have no bounds.
                let sigma = if row.len() >= 7 { row[5] } else { row[row.len() - 1] };
                let mirrors = match (name, row[3]) {
                    ("totdev", -1.0) => (3.0 * 2.0_f64.ln()).recip(),
                    ("totdev", -2.0) => 0.75,
                    _ => 0.0,
                };
                let kept = 1.0 - mirrors * found.time_s / length_s(is_phase, &phase, &frequency);
                let sigma = sigma * kept.sqrt();
                let bound = if (record, name, factor) == ("ocxo", "ohdev", [1]) { 2.5e-4 } else { 2e-4 };
                assert!((found.deviation / sigma - 1.0).abs() < bound, "{record} {name} {found:?} {sigma}");
                compared += 1;
            }
        }
    }
    assert!(compared > 100, "{compared}");
}

/// The bounds that Stable32 gives with its deviations, for a probability of 0.683: degrees of freedom and χ² by its own
/// reading of the noise; and that reading against ours.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn bounds_of_stable32() {
    let folder =
        PathBuf::from(std::env::var("KALMEMS_REFERENCE_DATA").expect("the folder of the reference data"));
    let folder = folder.join("real/allan_reference");
    let numbers = |name: &str| -> Vec<Vec<f64>> {
        let text = fs::read_to_string(folder.join(name)).unwrap();
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        rows.map(|line| line.split_whitespace().filter_map(|cell| cell.parse().ok()).collect()).collect()
    };
    let phase = numbers("PHASE.DAT").concat();
    let mut oscillator = vec![0.0];
    oscillator.extend(numbers("ocxo_frequency.txt").concat().iter().scan(0.0, |sum, f| {
        *sum += f / 1e7 - 1.0;
        Some(*sum)
    }));
    let (mut compared, mut same_noise, mut largest) = (0, 0, 0.0_f64);
    for (name, deviation) in ALL {
        for (record, phase) in [("phase_dat", &phase), ("ocxo", &oscillator)] {
            let rows = numbers(&format!("{record}_{name}_octave.txt"));
            for row in rows.iter().filter(|row| row.len() >= 7) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a factor and α
                let (factor, exponent) = (row[0] as usize, row[3] as i32);
                // Its total deviation has bounds with phase noise, of which no formula is published; and it takes the formula of long averaging times
                // at one and two intervals too, where intervals by it hold 161 of 200 records of white noise (`slow_modified_hadamard_and_total`:
                // 185 or more by ours).
                if name == "totdev" && (exponent > 0 || factor < 4) {
                    continue;
                }
                let freedom = deviation.freedom(phase.len(), factor, exponent);
                let law = ChiSquared::new(freedom).unwrap();
                let bound = |part: f64| row[5] * (freedom / law.inverse_cdf(part)).sqrt();
                // The half widths, which is where the degrees of freedom show.
                for (ours, theirs) in [(bound(0.8415), row[4]), (bound(0.1585), row[6])] {
                    let off = ((ours - row[5]) / (theirs - row[5]) - 1.0).abs();
                    largest = largest.max(off);
                    println!("{record} {name} {factor} {exponent} {freedom:.2} {off:.4}");
                }
                let rate: Vec<f64> = phase.windows(2).map(|pair| pair[1] - pair[0]).collect();
                let sums = OctaveSums::of(&[&rate]);
                let found = deviation.with_confidence(&sums, 1.0, 0.683, |_| None);
                let found = found.into_iter().find(|found| found.averaged.factor == factor);
                same_noise += usize::from(found.is_some_and(|found| found.exponent == exponent));
                compared += 1;
            }
        }
    }
    println!("largest {largest}; {same_noise} of {compared} kinds of noise");
    assert!(compared > 70 && largest < 0.03);
}
