//! What runs in real time does not allocate. One binary for all these tests, because the counting
//! allocator is global.

#![allow(clippy::unwrap_used, clippy::expect_used)]

#[allow(
    dead_code,
    reason = "shared with the tests of the cycle, which use all of it"
)]
#[path = "../cycle/bench.rs"]
mod bench;
mod cycle;
#[path = "../drive/fixture/mod.rs"]
mod fixture;
#[path = "../cycle/invariants.rs"]
mod invariants;
mod port_thread;
#[allow(
    dead_code,
    reason = "shared with the tests of the cycle, which use all of it"
)]
#[path = "../cycle/simulated_drive.rs"]
mod simulated_drive;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator. Counts per thread every call that allocates or frees memory.
struct CountingAllocator;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
    static PAUSED: Cell<bool> = const { Cell::new(false) };
}

/// Calls of the allocator by this thread.
pub fn calls() -> u64 {
    CALLS.get()
}

/// Runs `work` without counting: it replaces hardware, or changes it.
pub fn uncounted<R>(work: impl FnOnce() -> R) -> R {
    let was_paused = PAUSED.replace(true);
    let result = work();
    PAUSED.set(was_paused);
    result
}

fn count() {
    // A thread that ends may free memory after its counter is gone.
    let _ = PAUSED.try_with(|paused| {
        if !paused.get() {
            CALLS.set(CALLS.get() + 1);
        }
    });
}

// SAFETY: every call is passed to the system's allocator unchanged. The counter is a plain cell
// without a destructor, so counting neither allocates nor unwinds.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as promised by the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as promised by the caller.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as promised by the caller.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
