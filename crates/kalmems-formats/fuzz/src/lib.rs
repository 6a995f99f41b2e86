//! What every target does: opens bytes as a format and reads all columns, a bounded number of blocks, with a bounded
//! memory.

use kalmems_formats::{Block, Format, Hints, Table, Wanted, open_reader};
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Cursor;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bytes that a reader may hold at any time.
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
        eprintln!("asked for {bytes} bytes, more than the limit\n{}", std::backtrace::Backtrace::force_capture());
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

/// Opens and reads the bytes, as they are and with the hints that a format without names needs.
pub fn read(format: Format, data: &[u8]) {
    let open = |hints: &Hints| open_reader(Cursor::new(data.to_vec()), "", hints);
    let plain = Hints { format: Some(format), ..Hints::default() };
    let table = open(&plain).or_else(|_| {
        // As the fixtures need them.
        let columns = ["time_s", "drive_V", "cap_V"].map(str::to_owned).to_vec();
        open(&Hints { group: None, columns: Some(columns), ..plain.clone() })
            .or_else(|_| open(&Hints { group: Some("run".to_owned()), columns: None, ..plain.clone() }))
    });
    if let Ok(table) = table {
        drain(table);
    }
}

fn drain(mut table: Box<dyn Table>) {
    let count = table.description().columns.len().min(16);
    let mut wanted = Vec::new();
    for column in 0..count {
        let number = Wanted::Number { column, power: if column % 2 == 0 { 0 } else { -3 } };
        if table.want(&[number]).is_ok() {
            wanted.push(number);
        }
        if column % 4 == 3 || wanted.is_empty() {
            wanted.push(Wanted::Label { column });
        }
    }
    // All, or those that are of one length with the first.
    if table.want(&wanted).is_err() && table.want(&wanted[..wanted.len().min(1)]).is_err() {
        return;
    }
    let mut block = Block::with_capacity(256);
    for _ in 0..64 {
        if table.read(&mut block).is_err() || block.is_end() {
            return;
        }
        let _ = table.progress();
    }
}
