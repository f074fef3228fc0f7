//! What runs in real time does not allocate. One binary for all these tests, because the counting
//! allocator is global.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod control_loop;
mod cycle;
mod day;
mod model;
#[path = "../model/networks.rs"]
mod networks;
mod port_thread;
#[allow(dead_code, reason = "shared with the tests of the models, which use all of it")]
#[path = "../model/samples.rs"]
mod samples;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The system's allocator. Counts per thread every call that allocates or frees memory.
struct CountingAllocator;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
    static PAUSED: Cell<bool> = const { Cell::new(false) };
}

/// Name of the thread of the control loop.
const LOOP: &[u8] = b"control\0";

/// Whether the calls of the control loop are counted, and their number.
static IS_LOOP_WATCHED: AtomicBool = AtomicBool::new(false);
static LOOP_CALLS: AtomicU64 = AtomicU64::new(0);

/// Calls of the allocator by the thread of the control loop while `work` runs in this one.
pub fn calls_of_the_loop(work: impl FnOnce()) -> u64 {
    let before = LOOP_CALLS.load(Ordering::SeqCst);
    IS_LOOP_WATCHED.store(true, Ordering::SeqCst);
    work();
    IS_LOOP_WATCHED.store(false, Ordering::SeqCst);
    LOOP_CALLS.load(Ordering::SeqCst) - before
}

fn is_loop() -> bool {
    let mut name = [0_u8; 16];
    // SAFETY: the kernel writes at most 16 bytes, the longest name of a thread.
    unsafe { libc::prctl(libc::PR_GET_NAME, name.as_mut_ptr()) };
    name.starts_with(LOOP)
}

/// Calls of the allocator by this thread.
pub fn calls() -> u64 {
    CALLS.get()
}

/// Calls of the allocator by this thread while it does `work`.
pub fn allocations(work: impl FnOnce()) -> u64 {
    let before = calls();
    work();
    calls() - before
}

/// Runs `work` without counting: it replaces hardware, or changes it.
pub fn uncounted<R>(work: impl FnOnce() -> R) -> R {
    let was_paused = PAUSED.replace(true);
    let result = work();
    PAUSED.set(was_paused);
    result
}

fn count() {
    if IS_LOOP_WATCHED.load(Ordering::Relaxed) && is_loop() {
        LOOP_CALLS.fetch_add(1, Ordering::SeqCst);
    }
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
