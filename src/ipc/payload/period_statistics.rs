//! The stream `period_statistics`: timing of the control loop, and of the lines to the drives.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;

payload! {
    /// Percentiles of durations, ns.
    SpanSummary "I2risSpanSummaryV1" {
        /// Median.
        pub p50_ns: u64,
        /// 90th percentile.
        pub p90_ns: u64,
        /// 99th percentile.
        pub p99_ns: u64,
        /// 99.9th percentile.
        pub p999_ns: u64,
        /// Largest.
        pub max_ns: u64,
    }

    /// `period_statistics`, out, once a second: timing of the control loop in the window that ends
    /// at its stamp.
    PeriodStatistics "I2risPeriodStatisticsV2": outgoing {
        /// Length of the window.
        pub window_ns: u64,
        /// Intended length of a tick.
        pub period_ns: u64,
        /// Ticks in the window.
        pub ticks: u64,
        /// Ticks skipped in the window because they were overdue.
        pub missed: u64,
        /// Ticks since the start.
        pub total_ticks: u64,
        /// Ticks skipped since the start.
        pub total_missed: u64,
        /// Time between the starts of two ticks.
        pub period: SpanSummary,
        /// Start of the tick after its planned instant.
        pub lateness: SpanSummary,
        /// Time that the cycle took.
        pub compute: SpanSummary,
        /// Setpoints a second for each axis that the slowest line allows while all axes move.
        pub line_setpoints_hz: f64,
        /// An exchange with a drive on the slowest line, as measured at start.
        pub line_exchange_ns: u64,
        /// Longest time until a stop reaches the last drive.
        pub line_stop_ns: u64,
        /// Age of a position at which the motion stops.
        pub line_stale_ns: u64,
        /// SCHED_FIFO priority as read back; 0: normal scheduling.
        pub priority: u32,
        /// CPU that the loop is pinned to, as read back; `u32::MAX`: not pinned.
        pub cpu: u32,
        /// 1: memory is locked.
        pub memory_locked: u32,
        /// 0.
        pub reserved: u32,
    }
}
