//! Real-time code does not allocate. One binary for all tests: the counting allocator is global.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod control_loop;
mod cycle;
mod model;
mod port_thread;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// The system's allocator. Counts per thread every call that allocates or frees memory.
struct CountingAllocator;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
    static PAUSED: Cell<bool> = const { Cell::new(false) };
}

/// Thread names of the control loop and the ports.
const REAL_TIME: [&[u8]; 2] = [b"control\0", b"port\0"];

/// Serialises the tests, whose threads have the same names.
static ONE: Mutex<()> = Mutex::new(());
/// Whether calls of these threads are counted, and the count.
static IS_WATCHED: AtomicBool = AtomicBool::new(false);
static REAL_TIME_CALLS: AtomicU64 = AtomicU64::new(0);

/// Allocator calls by the threads of control loop and ports while `work` runs in this one.
pub fn calls_in_real_time(work: impl FnOnce()) -> u64 {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let before = REAL_TIME_CALLS.load(Ordering::SeqCst);
    IS_WATCHED.store(true, Ordering::SeqCst);
    work();
    IS_WATCHED.store(false, Ordering::SeqCst);
    REAL_TIME_CALLS.load(Ordering::SeqCst) - before
}

fn is_real_time() -> bool {
    let mut name = [0_u8; 16];
    // SAFETY: the kernel writes at most 16 bytes, the longest name of a thread.
    unsafe { libc::prctl(libc::PR_GET_NAME, name.as_mut_ptr()) };
    REAL_TIME.iter().any(|known| name.starts_with(known))
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

/// Runs `work` without counting, because it simulates hardware.
pub fn uncounted<R>(work: impl FnOnce() -> R) -> R {
    let was_paused = PAUSED.replace(true);
    let result = work();
    PAUSED.set(was_paused);
    result
}

fn count() {
    if IS_WATCHED.load(Ordering::Relaxed) && is_real_time() {
        REAL_TIME_CALLS.fetch_add(1, Ordering::SeqCst);
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
