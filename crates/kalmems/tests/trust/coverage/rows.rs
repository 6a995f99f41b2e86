//! What many identifications of one number say together.

use crate::side_by_side::side_by_side;
use kalmems::identify::Identified;
use statrs::distribution::{Binomial, DiscreteCDF};
use std::ops::Range;
use std::path::Path;

/// One number over all recordings.
struct Row {
    name: String,
    /// Error and claimed standard error, relative to the truth; and whether the interval holds it.
    told: Vec<(f64, f64, bool)>,
    /// Recordings that did not tell it.
    untold: u64,
}

/// Numbers in the order in which they came.
#[derive(Default)]
pub struct Rows(Vec<Row>);

/// What a row that is right is below in one of 7000 cases: of 100 intervals of 95 % fewer than 86.
const CHANCE: f64 = 1.4e-4;

/// Of the errors that are made, the most that may be claimed, in the median.
const MOST_CLAIMED: f64 = 1.3;

impl Rows {
    pub fn push(&mut self, name: &str, truth: f64, found: &Identified) {
        let place = self.0.iter().position(|row| row.name == name).unwrap_or_else(|| {
            self.0.push(Row { name: name.to_owned(), told: Vec::new(), untold: 0 });
            self.0.len() - 1
        });
        let row = &mut self.0[place];
        if found.standard_error.is_finite() {
            let [low, high] = found.interval;
            let relative = [found.value - truth, found.standard_error].map(|size| size / truth.abs());
            row.told.push((relative[0], relative[1], (low..=high).contains(&truth)));
        } else {
            row.untold += 1;
        }
    }

    fn join(&mut self, others: Self) {
        for other in others.0 {
            match self.0.iter_mut().find(|row| row.name == other.name) {
                Some(row) => {
                    row.told.extend(other.told);
                    row.untold += other.untold;
                }
                None => self.0.push(other),
            }
        }
    }

    /// Adds what recordings of these seeds tell, several at once; what `one` says of each of them.
    pub fn of_recordings<R: Send>(
        &mut self,
        seeds: Range<u64>,
        one: impl Fn(u64, &Path, &mut Self) -> R + Sync,
    ) -> Vec<R> {
        let told = side_by_side(&seeds.collect::<Vec<_>>(), |seed| {
            let (folder, mut rows) = (tempfile::tempdir().unwrap(), Self::default());
            let said = one(*seed, folder.path(), &mut rows);
            (rows, said)
        });
        let join = |(rows, said)| {
            self.join(rows);
            said
        };
        told.into_iter().map(join).collect()
    }

    /// Prints each row, and fails where one or all of them together hold the truth too seldom, or claim too much.
    pub fn judge(&self) {
        let (mut inside, mut all) = (0, 0);
        let mut wrong = Vec::new();
        for row in &self.0 {
            let count = row.told.len() as u64;
            let held = row.told.iter().filter(|(.., held)| *held).count() as u64;
            let rms = (row.told.iter().map(|(error, ..)| error * error).sum::<f64>() / count as f64).sqrt();
            let mut claimed: Vec<f64> = row.told.iter().map(|(_, claimed, _)| *claimed).collect();
            claimed.sort_by(f64::total_cmp);
            let median = claimed.get(claimed.len() / 2).copied().unwrap_or(f64::NAN);
            println!(
                "{}: {held} of {count} held, {} not told; error {rms:.2e}, claimed {:.2} of it",
                row.name,
                row.untold,
                median / rms
            );
            if count == 0 {
                continue;
            }
            let law = Binomial::new(0.95, count).unwrap();
            if law.cdf(held) < CHANCE {
                wrong.push(format!("{}: {held} of {count}", row.name));
            }
            // Of few the observed size is known too badly for a bar.
            if count >= 50 && median > MOST_CLAIMED * rms {
                wrong.push(format!("{}: claims {:.2} of its error", row.name, median / rms));
            }
            (inside, all) = (inside + held, all + count);
        }
        let share = inside as f64 / all as f64;
        println!("all together: {inside} of {all}, {:.1} %", 100.0 * share);
        assert!(wrong.is_empty(), "{wrong:?}");
        assert!(all < 300 || (0.94..=0.98).contains(&share), "{share}");
    }
}
