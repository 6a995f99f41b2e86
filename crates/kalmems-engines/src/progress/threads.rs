//! Points of a computation over threads.

use super::Progress;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Duration;

/// How often an interruption is looked for.
const LOOK: Duration = Duration::from_millis(50);

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
    let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    progress.begin(what, units * count as u64);
    std::thread::scope(|scope| {
        let (send, receive) = mpsc::channel();
        for _ in 0..threads.clamp(1, count.max(1)) {
            let (send, next, stopped, point) = (send.clone(), &next, &stopped, &point);
            scope.spawn(move || {
                let watch = Watch { stopped };
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let sent = (index < count && !stopped.load(Ordering::Relaxed))
                        .then(|| send.send((index, point(index, &watch))));
                    if !matches!(sent, Some(Ok(()))) {
                        break;
                    }
                }
            });
        }
        drop(send);
        let mut done = 0;
        loop {
            match receive.recv_timeout(LOOK) {
                Ok((index, result)) => {
                    results[index] = result;
                    done += 1;
                }
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => break,
            }
            if progress.reached(units * done).is_break() {
                stopped.store(true, Ordering::Relaxed);
            }
        }
    });
    if stopped.load(Ordering::Relaxed) {
        return None;
    }
    results.into_iter().collect()
}

/// Tells a point that the work was stopped.
struct Watch<'a> {
    stopped: &'a AtomicBool,
}

impl Progress for Watch<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
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
}
