//! The steps of the demo on the screen, and its interruption.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use i2ris_terminal::Failure;
use indicatif::{ProgressBar, ProgressStyle};

use super::process::Process;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Lets SIGINT, SIGTERM and SIGHUP end the demo in order.
pub fn catch_interrupts() -> Result<(), Failure> {
    Ok(ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Release))?)
}

/// Fails when the demo is interrupted or a child has ended.
pub fn check_children(children: &mut [&mut Process]) -> Result<(), Failure> {
    if INTERRUPTED.load(Ordering::Acquire) {
        return Err("interrupted; everything was stopped and cleaned up".into());
    }
    children.iter_mut().try_for_each(|child| child.check())
}

/// Runs a step behind a spinner.
pub fn step<T>(what: &str, work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    check_children(&mut [])?;
    let spinner = ProgressBar::new_spinner().with_message(what.to_owned());
    spinner.enable_steady_tick(Duration::from_millis(100));
    let done = work()?;
    finish(&spinner, "done");
    Ok(done)
}

/// A progress bar that counts tenths of a second.
pub fn bar(what: &str, duration_s: f64) -> ProgressBar {
    let bar = ProgressBar::new((duration_s * 10.0) as u64).with_message(what.to_owned());
    if let Ok(style) = ProgressStyle::with_template("{msg:50} {bar:20} {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// One line per finished step, on a terminal and in a log alike.
pub fn finish(bar: &ProgressBar, outcome: &str) {
    let what = bar.message();
    bar.finish_and_clear();
    eprintln!("{what:<50} {outcome}");
}
