//! A bounded memory.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bytes that a target may hold at any time.
const LIMIT: usize = 192 << 20;

/// The system's allocator, which ends the program where more than the limit is held.
struct Limited;

static HELD: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static ALLOCATOR: Limited = Limited;

fn hold(bytes: usize) {
    if HELD.fetch_add(bytes, Ordering::Relaxed) + bytes > LIMIT {
        // The backtrace takes memory as well.
        HELD.store(0, Ordering::Relaxed);
        eprintln!(
            "asked for {bytes} bytes, more than the limit\n{}",
            std::backtrace::Backtrace::force_capture()
        );
        std::process::abort();
    }
}

// SAFETY: all is passed on to the system's allocator.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        hold(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        hold(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size().min(HELD.load(Ordering::Relaxed)), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}
