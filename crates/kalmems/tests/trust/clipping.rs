//! How often the check for clipping refuses a recording that is clipped, and one that is not, by the resolution of the converter.

use crate::outliers::signals::{DEVICES, Of, signals};
use crate::side_by_side::side_by_side;
use kalmems::recording::unusable_signal;
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;

/// The bits of converters; none of numbers as they are computed.
const BITS: [Option<i32>; 4] = [None, Some(16), Some(12), Some(8)];

/// What of the range of the signal, from below, a clipped converter has.
const SHARES: [Option<f64>; 4] = [None, Some(0.98), Some(0.9), Some(0.5)];

/// Puts a signal through a converter of so many bits, whose range is 10 % larger than that of the signal, and which clips it.
fn convert(values: &mut [f64], bits: Option<i32>, share: Option<f64>) {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(*y), h.max(*y)));
    let top = share.map_or(f64::INFINITY, |share| low + share * (high - low));
    for y in values {
        *y = y.min(top);
        if let Some(bits) = bits {
            let step = 1.1 * (high - low) * 2.0_f64.powi(-bits);
            *y = step * (*y / step).round();
        }
    }
}

/// Of which of these recordings the check refuses the first signal.
fn refused(of: Of, seed: u64) -> Vec<(Option<i32>, Option<f64>, bool)> {
    let (experiment, simulated) = of.recorded(&[], seed);
    let (signal, layout) = (
        signals(&experiment).remove(0),
        published().rig(&experiment).unwrap().layout(&experiment, 0).unwrap(),
    );
    let mut channels = experiment.recordings[0].channels.iter();
    let (_, column) = channels.find(|(meaning, _)| *meaning == signal).unwrap();
    let cases = SHARES.into_iter().flat_map(|share| BITS.into_iter().map(move |bits| (bits, share)));
    let judged = cases.map(|(bits, share)| {
        let mut simulated: ComputedRecording = simulated.clone();
        assert!(simulated.change_recorded(&signal, |values, _| convert(values, bits, share)));
        let recording = simulated.recorded(&layout).unwrap();
        (bits, share, unusable_signal(recording.diagnosis(), &[column], |_| true).is_some())
    });
    judged.collect()
}

/// Prints a table of how many are refused.
fn table(seeds: std::ops::RangeInclusive<u64>) -> Vec<(Of, Option<i32>, Option<f64>, usize)> {
    let count = seeds.clone().count();
    let wanted: Vec<(Of, u64)> =
        DEVICES.iter().flat_map(|of| seeds.clone().map(|seed| (*of, seed))).collect();
    let found = side_by_side(&wanted, |(of, seed)| refused(*of, *seed));
    let mut rows = Vec::new();
    println!("| device | converter | not clipped | at 98 % | at 90 % | at 50 % |");
    println!("|---|---|--:|--:|--:|--:|");
    for of in DEVICES {
        for bits in BITS {
            let cells = SHARES.map(|share| {
                let own = wanted.iter().zip(&found).filter(|((own, _), _)| *own == of);
                let is_it = |case: &&(Option<i32>, Option<f64>, bool)| **case == (bits, share, true);
                let refused = own.flat_map(|(_, cases)| cases.iter().filter(is_it)).count();
                rows.push((of, bits, share, refused));
                format!("{refused} of {count}")
            });
            let converter = bits.map_or_else(|| "none".to_owned(), |bits| format!("{bits} bits"));
            println!("| {} | {converter} | {} |", of.name(), cells.join(" | "));
        }
    }
    rows
}

fn assert_right(rows: &[(Of, Option<i32>, Option<f64>, usize)], count: usize) {
    for (of, bits, share, refused) in rows {
        let what = format!("{} {bits:?} {share:?}: {refused} of {count}", of.name());
        match share {
            None => assert_eq!(*refused, 0, "{what}"),
            Some(share) if *share == 0.5 => assert_eq!(*refused, count, "{what}"),
            Some(_) => {}
        }
    }
}

#[test]
fn what_is_clipped_is_refused_and_nothing_else() {
    assert_right(&table(811..=812), 2);
}

/// A hundred seeds a cell.
#[test]
#[ignore = "a minute on two processors"]
fn slow_clipped_signals_of_every_device() {
    assert_right(&table(821..=920), 100);
}
