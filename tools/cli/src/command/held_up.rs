//! Streams that a loaded computer holds up.

use std::{collections::VecDeque, fs, thread};

use i2ris::{ipc::payload::OperatingStateMsg, units::Nanos};

/// Number of stops within `SPAN` that cannot be one event.
const OFTEN: usize = 5;
const SPAN: Nanos = Nanos::from_millis(60_000);

#[derive(Debug, Default)]
pub struct HeldUp {
    stale_stops: u64,
    stops: VecDeque<Nanos>,
    seen_at: Nanos,
    longest: Nanos,
}

impl HeldUp {
    pub fn new(state: &OperatingStateMsg, now: Nanos) -> Self {
        Self { stale_stops: state.stale_stops, seen_at: now, ..Self::default() }
    }

    /// After `OFTEN` stops within `SPAN`: the longest time in which this program saw no state.
    pub fn check(&mut self, state: &OperatingStateMsg, now: Nanos) -> Option<Nanos> {
        self.longest = self.longest.max(now.duration_since(self.seen_at));
        self.seen_at = now;
        let new = state.stale_stops.saturating_sub(self.stale_stops) as usize;
        self.stale_stops = state.stale_stops;
        self.stops.extend([now].repeat(new.min(OFTEN)));
        self.stops.retain(|stop| now.duration_since(*stop) < SPAN);
        (self.stops.len() >= OFTEN).then(|| {
            self.stops.clear();
            std::mem::take(&mut self.longest)
        })
    }
}

/// Names the load as the cause, with numbers that show it and the remedy.
pub fn note(longest: Nanos, state: &OperatingStateMsg) -> String {
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or_default();
    let processors = thread::available_parallelism().map_or(1, usize::from);
    let permission = if state.flags & OperatingStateMsg::FIFO == 0 {
        "; the controller has no real-time priority: `i2ris doctor` shows how to allow it"
    } else {
        ""
    };
    format!(
        "the load on this computer stopped the snake {OFTEN} times within a minute: commands came \
         late, and this program or the controller waited up to {:.0} ms for a processor (load \
         {load} on {processors} processors). End other programs{permission}",
        longest.as_seconds() * 1e3
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_stops_within_a_minute_name_the_load() {
        let state = |stale_stops| OperatingStateMsg { stale_stops, ..OperatingStateMsg::default() };
        let at = Nanos::from_millis;
        let mut held_up = HeldUp::new(&state(7), at(0));
        let mut seen = |stops: u64, ms| held_up.check(&state(7 + stops), at(ms));
        assert_eq!([seen(0, 10), seen(3, 100), seen(4, 70_000)], [None; 3], "too few in a minute");
        assert_eq!([seen(6, 70_010), seen(7, 70_020)], [None; 2]);
        assert_eq!(seen(8, 70_030), Some(at(69_900)));
        assert_eq!(seen(9, 70_040), None, "once");
        let text = note(at(180), &state(0));
        for part in ["5 times", "up to 180 ms", " processors)", "no real-time priority"] {
            assert!(text.contains(part), "{text}");
        }
        let fifo = OperatingStateMsg { flags: OperatingStateMsg::FIFO, ..state(0) };
        assert!(note(at(180), &fifo).ends_with("End other programs"));
    }
}
