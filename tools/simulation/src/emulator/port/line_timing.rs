//! Timing of a serial line: when bytes arrive and when replies are complete.
//!
//! A pseudo-terminal delivers any number of bytes at once. Here they take as long as on a line.
//! Instants follow from earlier ones, not from wake-ups, so late wake-ups do not accumulate.
//!
//! With a USB adapter, a request and a reply each wait for a USB frame, and a reply before that for
//! the latency timer: FTDI chips transfer 62 bytes at once, or all bytes when the timer expires.
//! The timer restarts with every transfer (FTDI AN232B-04).

use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

#[derive(Debug, Clone, PartialEq)]
pub struct LineConfig {
    /// Bits per second; ten bits a byte.
    pub baud: u32,
    /// A host at a wrong bit rate sends garbage, as on a line. A pseudo-terminal ignores the rate.
    pub strict_baud: bool,
    /// Processing time of the drive, microseconds.
    pub processing_us: u64,
    /// Maximum random time added to it, microseconds.
    pub jitter_us: u64,
    /// The latency timer of the FTDI chip, milliseconds; 0: no chip.
    pub latency_timer_ms: u64,
    /// Part of a late wake-up that does not count as the host's time, microseconds: bytes read this
    /// long after the line was free count as sent when it became free. A wake-up takes about 70.
    pub allowance_us: u64,
}

impl Default for LineConfig {
    fn default() -> Self {
        Self {
            baud: 115_200,
            strict_baud: false,
            processing_us: 400,
            jitter_us: 0,
            latency_timer_ms: 0,
            allowance_us: 150,
        }
    }
}

impl LineConfig {
    /// An EPOS2 on USB: an FTDI bridge, its timer set to 1 ms. An exchange takes 2 ms, as measured.
    pub fn usb() -> Self {
        Self { baud: 1_000_000, latency_timer_ms: 1, processing_us: 300, ..Self::default() }
    }
}

/// Packet size of an FTDI bridge.
const PACKET: usize = 62;
/// Maximum, random wait for USB, microseconds: a frame; for replies the host polls more often.
const REQUEST_WAIT_US: u64 = 1000;
const REPLY_WAIT_US: u64 = 500;

/// Timing of both directions of a line.
#[derive(Debug, Clone)]
pub(crate) struct LineTiming {
    config: LineConfig,
    random: Pcg64Mcg,
    byte: Nanos,
    allowance: Nanos,
    /// When the line towards the drive is free.
    free: Nanos,
    /// Delay of the last reply, caused by this thread and not by the host.
    late: Nanos,
    /// The latency timer, and when it started.
    timer: Nanos,
    started: Nanos,
}

impl LineTiming {
    pub(crate) fn new(config: &LineConfig, seed: u64) -> Self {
        Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            byte: Nanos(10 * 1_000_000_000 / u64::from(config.baud.max(1))),
            allowance: Nanos::from_micros(config.allowance_us),
            free: Nanos::ZERO,
            late: Nanos::ZERO,
            timer: Nanos::from_millis(config.latency_timer_ms),
            started: Nanos::ZERO,
        }
    }

    fn up_to(&mut self, longest_us: u64) -> Nanos {
        Nanos::from_micros(self.random.random_range(0..=longest_us))
    }

    /// On USB, bytes read at `read` have waited for a frame.
    pub(crate) fn wait_for_frame(&mut self, read: Nanos) {
        if self.timer > Nanos::ZERO {
            let wait = self.up_to(REQUEST_WAIT_US);
            self.free = self.free.max(read - (self.allowance + self.late)) + wait;
        }
    }

    /// When the reply to a frame is ready. `delay`: in addition to the processing time.
    pub(crate) fn process(&mut self, arrived: Nanos, delay: Nanos) -> Nanos {
        let processing = Nanos::from_micros(self.config.processing_us);
        arrived + processing + self.up_to(self.config.jitter_us) + delay
    }

    /// When the host gets a reply of `bytes` that starts at `start`.
    pub(crate) fn reply(&mut self, start: Nanos, bytes: usize) -> Nanos {
        let end = self.depart(start, bytes);
        let wait = self.up_to(REPLY_WAIT_US);
        self.deliver(end, bytes, wait)
    }

    /// The arrival time of a byte that was read at `read`.
    pub(crate) fn arrive(&mut self, read: Nanos) -> Nanos {
        self.free = self.free.max(read - (self.allowance + self.late)) + self.byte;
        self.free
    }

    /// The arrival time of a frame that was read whole at `read`: not before the host sent it.
    pub(crate) fn complete(&mut self, read: Nanos) -> Nanos {
        self.free = self.free.max(read);
        self.free
    }

    /// When a reply of `bytes` that starts at `start` ends. The host cannot respond before.
    fn depart(&mut self, start: Nanos, bytes: usize) -> Nanos {
        let end = start + Nanos(self.byte.0 * bytes as u64);
        self.free = self.free.max(end);
        end
    }

    /// When the host gets a reply whose last byte arrived at `end`; `wait`: for a USB frame.
    fn deliver(&mut self, end: Nanos, bytes: usize, wait: Nanos) -> Nanos {
        if self.timer == Nanos::ZERO {
            return end;
        }
        if bytes >= PACKET {
            self.started = end - Nanos(self.byte.0 * (bytes % PACKET) as u64);
        }
        // Without bytes to transfer, it still expires.
        let expiries = (end - self.started).0.div_ceil(self.timer.0);
        self.started = self.started + Nanos(expiries * self.timer.0) + wait;
        self.started
    }

    /// Records that the reply due at `due` was delivered at `now`.
    pub(super) fn hand_over(&mut self, due: Nanos, now: Nanos) {
        self.late = now - due;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A byte takes 1 ms.
    fn timing() -> LineTiming {
        let config = LineConfig { baud: 10_000, allowance_us: 100, ..LineConfig::default() };
        LineTiming::new(&config, 1)
    }

    const BYTE: Nanos = Nanos::from_millis(1);

    #[test]
    fn bytes_follow_each_other_at_the_bit_rate() {
        let mut timing = timing();
        let arrivals = [50, 50, 50].map(|read_ms| timing.arrive(Nanos::from_millis(read_ms)));
        assert_eq!(arrivals, [50_900, 51_900, 52_900].map(Nanos::from_micros));
    }

    #[test]
    fn late_wake_ups_do_not_accumulate() {
        let (mut timing, mut ideal) = (timing(), Nanos::from_millis(100));
        timing.depart(ideal - BYTE, 1);
        for lateness_us in [0, 50, 99, 20] {
            let arrived = timing.arrive(ideal + Nanos::from_micros(lateness_us));
            assert_eq!(arrived, ideal + BYTE);
            ideal = timing.depart(arrived, 2);
            assert_eq!(ideal, arrived + BYTE + BYTE);
        }
    }

    #[test]
    fn a_late_reply_does_not_delay_the_host() {
        let mut timing = timing();
        let due = timing.depart(Nanos::from_millis(10), 1);
        timing.hand_over(due, due + Nanos::from_micros(700));
        let read = due + Nanos::from_micros(800);
        assert_eq!(timing.arrive(read), due + BYTE);
        assert_eq!(timing.complete(read), due + BYTE);
        let read = due + Nanos::from_millis(9);
        timing.hand_over(due, read);
        timing.arrive(read);
        assert_eq!(timing.complete(read), read, "nothing arrives before it was sent");
    }

    #[test]
    fn only_short_replies_wait_for_the_latency_timer() {
        let config = LineConfig { latency_timer_ms: 16, baud: 10_000, ..LineConfig::default() };
        let mut timing = LineTiming::new(&config, 1);
        let mut deliver = |end_ms, bytes| timing.deliver(Nanos::from_millis(end_ms), bytes, BYTE);
        assert_eq!([3, 18, 50].map(|ms| deliver(ms, 10)), [17, 34, 51].map(Nanos::from_millis));
        assert_eq!(deliver(100, 62), Nanos::from_millis(101));
        assert_eq!(deliver(104, 10), Nanos::from_millis(118), "it restarted at 101");
        assert_eq!(deliver(200, 72), Nanos::from_millis(207), "10 bytes wait, since 190");
        let mut wire = LineTiming::new(&LineConfig::default(), 1);
        assert_eq!(wire.deliver(BYTE, 10, BYTE), BYTE);
    }

    #[test]
    fn a_slow_host_keeps_its_delay() {
        let mut timing = timing();
        timing.depart(Nanos::ZERO, 1);
        assert_eq!(timing.arrive(Nanos::from_millis(9)), Nanos::from_micros(9_900));
    }
}
