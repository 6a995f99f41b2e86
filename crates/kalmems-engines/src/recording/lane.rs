//! A way for items from one thread to another on which nobody is woken before the item can be taken.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The two ends of a way for items.
///
/// A channel of the standard library wakes its receiver while it still holds the lock that the receiver takes next, so that the receiver sleeps once
/// more: of a stream that waits for single samples each estimate is later by that. Nothing bounds the number of items here: those who use it pass a
/// bounded number of blocks round.
pub(super) fn lane<T>() -> (LaneSender<T>, LaneReceiver<T>) {
    let lane = Arc::new(Lane { state: Mutex::new(LaneState::default()), comes: Condvar::new() });
    (LaneSender(Arc::clone(&lane)), LaneReceiver(lane))
}

struct Lane<T> {
    state: Mutex<LaneState<T>>,
    comes: Condvar,
}

struct LaneState<T> {
    items: VecDeque<T>,
    is_closed: bool,
    /// Whether the receiver sleeps.
    is_awaited: bool,
}

impl<T> Default for LaneState<T> {
    fn default() -> Self {
        Self { items: VecDeque::new(), is_closed: false, is_awaited: false }
    }
}

impl<T> Lane<T> {
    /// No thread panics while it holds the lock.
    fn lock(&self) -> MutexGuard<'_, LaneState<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        self.lock().is_closed = true;
        self.comes.notify_one();
    }
}

/// Where items are sent from.
pub(super) struct LaneSender<T>(Arc<Lane<T>>);

/// Where items are taken.
pub(super) struct LaneReceiver<T>(Arc<Lane<T>>);

/// What a receiver has instead of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoItem {
    /// The time is over.
    Timeout,
    /// The sender is gone, and so are its items.
    Closed,
}

impl<T> LaneSender<T> {
    /// Sends an item; `false` if nobody takes it any more.
    pub(super) fn send(&self, item: T) -> bool {
        let mut state = self.0.lock();
        if state.is_closed {
            return false;
        }
        state.items.push_back(item);
        let is_awaited = state.is_awaited;
        drop(state);
        if is_awaited {
            self.0.comes.notify_one();
        }
        true
    }
}

impl<T> Drop for LaneSender<T> {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl<T> LaneReceiver<T> {
    /// The next item, which is waited for so long at most.
    pub(super) fn receive_within(&self, patience: Duration) -> Result<T, NoItem> {
        let mut state = self.0.lock();
        let mut end = None;
        loop {
            if let Some(item) = state.items.pop_front() {
                return Ok(item);
            }
            if state.is_closed {
                return Err(NoItem::Closed);
            }
            let now = Instant::now();
            let left = end.get_or_insert(now + patience).saturating_duration_since(now);
            if left.is_zero() {
                return Err(NoItem::Timeout);
            }
            state.is_awaited = true;
            let waited = self.0.comes.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            state.is_awaited = false;
        }
    }

    /// The next item; `None` once the sender is gone and its items are taken.
    pub(super) fn receive(&self) -> Option<T> {
        /// As long as a clock can wait without an overflow; it waits again then.
        const LONG: Duration = Duration::from_secs(3600);
        loop {
            match self.receive_within(LONG) {
                Ok(item) => return Some(item),
                Err(NoItem::Closed) => return None,
                Err(NoItem::Timeout) => {}
            }
        }
    }
}

impl<T> Drop for LaneReceiver<T> {
    fn drop(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_come_in_order_and_an_end_is_heard_after_the_last() {
        let (sender, receiver) = lane();
        let thread = std::thread::spawn(move || (0..10_000).all(|item| sender.send(item)));
        for expected in 0..10_000 {
            assert_eq!(receiver.receive(), Some(expected));
        }
        assert!(thread.join().unwrap());
        assert_eq!(receiver.receive(), None);
    }

    #[test]
    fn a_receiver_waits_no_longer_than_it_says_and_a_sender_hears_that_nobody_takes() {
        let (sender, receiver) = lane::<u8>();
        assert_eq!(receiver.receive_within(Duration::from_millis(5)), Err(NoItem::Timeout));
        assert!(sender.send(1));
        assert_eq!(receiver.receive_within(Duration::ZERO), Ok(1));
        drop(receiver);
        assert!(!sender.send(2));
    }
}
