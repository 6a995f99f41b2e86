//! How many of the intervals of 95 % hold what was put in, over many records.

use std::fmt::Display;

/// How often a number is in its interval: in 91 to 99 % of the records.
pub fn limits_of_one(records: usize) -> [usize; 2] {
    assert!(records >= 100, "{records} records are too few");
    [(records * 91).div_ceil(100), records * 99 / 100]
}

/// Asserts that each number is in its interval in 91 to 99 % of the records, and all numbers together in 94 to 97 %.
///
/// Of 200 records of an exact method, 181 or fewer come once in 150 times and 199 or more once in 2500 times; of 400, both together once in 5000 times.
pub fn assert_95_of_100<N: Display>(what: &str, held: impl IntoIterator<Item = (N, usize)>, records: usize) {
    let [least, most] = limits_of_one(records);
    let (mut all, mut numbers, mut outside) = (0, 0, Vec::new());
    for (name, held) in held {
        println!("{what}, {name}: {held} of {records}");
        if !(least..=most).contains(&held) {
            outside.push(format!("{name}: {held} of {records}, expected {least} to {most}"));
        }
        all += held;
        numbers += 1;
    }
    let part = 100.0 * all as f64 / (numbers * records) as f64;
    println!("{what}: {part:.2} % of {}", numbers * records);
    assert!(outside.is_empty(), "{what}: {}", outside.join("; "));
    assert!((94.0..=97.0).contains(&part), "{what}: {part:.2} % of all, expected 94 to 97");
}
