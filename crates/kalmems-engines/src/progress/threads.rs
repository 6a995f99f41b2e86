//! Points of a computation over threads, or in turn where there are none.

use super::Progress;
use std::collections::VecDeque;
use std::num::NonZero;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::Duration;

/// How often an interruption is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// Whether a program has threads here; one in a browser's sandbox (WebAssembly) has none.
pub const HAS_THREADS: bool = !cfg!(target_family = "wasm");

/// How many threads the machine can run at once, at least 1.
pub fn processors() -> usize {
    if HAS_THREADS { std::thread::available_parallelism().map_or(1, NonZero::get) } else { 1 }
}

/// What `point` makes of 0 to `count` − 1, in this order, whatever thread computed which; `None` where the work was stopped.
///
/// `units` is how much work a point is, for the progress. A point that hears from its own [`Progress`] that the work was
/// stopped may give `None`.
pub fn map_on_threads<T: Send>(
    (progress, what): (&dyn Progress, &str),
    threads: usize,
    (count, units): (usize, u64),
    point: impl Fn(usize, &dyn Progress) -> Option<T> + Sync,
) -> Option<Vec<T>> {
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    progress.begin(what, units * count as u64);
    let take = |index: usize, result| {
        results[index] = Some(result);
        Ok::<(), NoError>(())
    };
    let whole = each_on_threads(progress, threads, (count, units), point, take);
    matches!(whole, Ok(true)).then(|| results.into_iter().collect()).flatten()
}

/// The error of taking a result where there is none.
enum NoError {}

/// Has `point` make something of 0 to `count` − 1 on threads, and gives each result to `take` on this thread as soon as it is
/// there, in any order; whether the work came to its end.
///
/// The work ends where `progress` or a result that is not taken ends it. A target without threads computes one point after
/// the other on this thread. The caller begins the progress.
pub fn each_on_threads<T: Send, E>(
    progress: &dyn Progress,
    threads: usize,
    (count, units): (usize, u64),
    point: impl Fn(usize, &dyn Progress) -> Option<T> + Sync,
    take: impl FnMut(usize, T) -> Result<(), E>,
) -> Result<bool, E> {
    if HAS_THREADS {
        side_by_side(progress, threads, (count, units), point, take)
    } else {
        in_turn(progress, (count, units), point, take)
    }
}

fn side_by_side<T: Send, E>(
    progress: &dyn Progress,
    threads: usize,
    (count, units): (usize, u64),
    point: impl Fn(usize, &dyn Progress) -> Option<T> + Sync,
    mut take: impl FnMut(usize, T) -> Result<(), E>,
) -> Result<bool, E> {
    let threads = threads.clamp(1, count.max(1));
    // The results of each thread: the one of which it has told, and the one behind it.
    let results: Vec<Mutex<VecDeque<T>>> = (0..threads).map(|_| Mutex::default()).collect();
    let of = |thread: usize| results[thread].lock().unwrap_or_else(PoisonError::into_inner);
    let mut refused = None;
    let mut taken = |thread: usize, index: usize| {
        let result = of(thread).pop_front();
        refused = result.and_then(|result| take(index, result).err());
        if refused.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let compute = |thread: usize, index: usize, watch: &dyn Progress| {
        let result = point(index, watch);
        let is_there = result.is_some();
        of(thread).extend(result);
        is_there
    };
    match on_threads(progress, threads, (count, units), &compute, &mut taken) {
        Some(whole) => refused.map_or(Ok(whole), Err),
        None => in_turn(progress, (count, units), point, take),
    }
}

/// What [`side_by_side`] does for every kind of result, once in a program: `compute` says whether there is a result of that thread and
/// point, and `take` takes it; `None` where no thread can be started.
fn on_threads(
    progress: &dyn Progress,
    threads: usize,
    (count, units): (usize, u64),
    compute: &(dyn Fn(usize, usize, &dyn Progress) -> bool + Sync),
    take: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Option<bool> {
    let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    std::thread::scope(|scope| {
        // A thread waits until its result is taken: results do not pile up, and an end of the work is not overtaken by points behind it.
        let (send, receive) = mpsc::sync_channel(0);
        let begin = |thread: &usize| {
            let (thread, send, next, stopped) = (*thread, send.clone(), &next, &stopped);
            let work = move || {
                let watch = StopWatcher { stopped };
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let sent = (index < count && !stopped.load(Ordering::Relaxed))
                        .then(|| send.send((thread, index, compute(thread, index, &watch))));
                    if !matches!(sent, Some(Ok(()))) {
                        break;
                    }
                }
            };
            std::thread::Builder::new().spawn_scoped(scope, work).is_ok()
        };
        // A limit of memory or of processes may leave fewer threads, or none.
        if (0..threads).take_while(begin).count() == 0 {
            return None;
        }
        drop(send);
        let (mut done, mut whole) = (0, true);
        loop {
            match receive.recv_timeout(LOOK) {
                Ok((thread, index, true)) => {
                    if take(thread, index).is_break() {
                        stopped.store(true, Ordering::Relaxed);
                        return Some(false);
                    }
                    done += 1;
                }
                Ok((_, _, false)) => whole = false,
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => break,
            }
            if progress.reached(units * done).is_break() {
                stopped.store(true, Ordering::Relaxed);
            }
        }
        Some(whole && !stopped.load(Ordering::Relaxed))
    })
}

fn in_turn<T, E>(
    progress: &dyn Progress,
    (count, units): (usize, u64),
    point: impl Fn(usize, &dyn Progress) -> Option<T>,
    mut take: impl FnMut(usize, T) -> Result<(), E>,
) -> Result<bool, E> {
    let mut whole = true;
    for index in 0..count {
        let within = SerialProgress { progress, done: units * index as u64 };
        match point(index, &within) {
            Some(result) => take(index, result)?,
            None => whole = false,
        }
        if progress.reached(units * (index as u64 + 1)).is_break() {
            return Ok(false);
        }
    }
    Ok(whole)
}

/// Tells a point that the work was stopped.
struct StopWatcher<'a> {
    stopped: &'a AtomicBool,
}

impl Progress for StopWatcher<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Tells a point the same where nothing else runs meanwhile.
struct SerialProgress<'a> {
    progress: &'a dyn Progress,
    done: u64,
}

impl Progress for SerialProgress<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        self.progress.reached(self.done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn results_come_in_order_whatever_the_number_of_threads() {
        for threads in [0, 1, 3, 50] {
            let squares = map_on_threads((&Silent, "squares"), threads, (20, 1), |i, _| {
                // The first take longest.
                std::thread::sleep(Duration::from_millis(20 - i as u64));
                Some(i * i)
            });
            assert_eq!(squares.unwrap(), (0..20).map(|i| i * i).collect::<Vec<_>>());
            assert_eq!(
                map_on_threads((&Silent, "nothing"), threads, (0, 1), |i, _| Some(i)).unwrap(),
                [0; 0]
            );
        }
    }

    #[test]
    fn work_that_is_stopped_ends() {
        struct Three;
        impl Progress for Three {
            fn begin(&self, _: &str, _: u64) {}
            fn reached(&self, done: u64) -> ControlFlow<()> {
                if done < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            }
        }
        let computed = AtomicUsize::new(0);
        let result = map_on_threads((&Three, "points"), 2, (10_000, 1), |i, _| {
            computed.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(1));
            Some(i)
        });
        assert!(result.is_none());
        assert!(computed.load(Ordering::Relaxed) < 1000);
    }

    #[test]
    fn points_in_turn_give_what_threads_give_and_stop_where_the_progress_stops() {
        struct Until(u64);
        impl Progress for Until {
            fn begin(&self, _: &str, _: u64) {}
            fn reached(&self, done: u64) -> ControlFlow<()> {
                if done < self.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            }
        }
        let run = |until, threads: bool| {
            let mut taken = vec![None; 14];
            let square = |i: usize, watch: &dyn Progress| watch.reached(0).is_continue().then_some(i * i);
            let take = |i: usize, square| {
                taken[i] = Some(square);
                if square == 144 && until == 99 { Err(i) } else { Ok(()) }
            };
            let whole = if threads {
                side_by_side(&Until(until), 3, (14, 1), square, take)
            } else {
                in_turn(&Until(until), (14, 1), square, take)
            };
            (whole, taken.iter().flatten().count())
        };
        assert_eq!(run(100, false), (Ok(true), 14));
        assert_eq!(run(100, true), (Ok(true), 14));
        assert_eq!(run(5, false), (Ok(false), 5));
        // A result that is not taken ends it too.
        assert_eq!(run(99, false), (Err(12), 13));
        assert_eq!(run(99, true).0, Err(12));
    }
}
