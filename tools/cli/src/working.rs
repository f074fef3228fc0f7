//! A sign of life for work that takes long and cannot say how far it is.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Work that is over sooner needs none.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often it moves.
const BEAT: Duration = Duration::from_millis(100);

/// Does the work, and shows on stderr that it goes on, if stderr is a terminal and the work takes
/// more than two seconds.
pub fn while_working<T>(what: &'static str, work: impl FnOnce() -> T) -> T {
    let (done, is_done) = channel::<()>();
    thread::scope(|scope| {
        scope.spawn(move || {
            if is_done.recv_timeout(PATIENCE) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr())
                .with_message(what);
            // The template is fixed; were it wrong, the sign would look plain.
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
                bar.set_style(style);
            }
            while is_done.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
                bar.tick();
            }
            bar.finish_and_clear();
        });
        let outcome = work();
        drop(done);
        outcome
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_work_gives_comes_back_at_once() {
        assert_eq!(while_working("adding", || 3 + 4), 7);
    }
}
