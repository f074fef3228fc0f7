//! The configuration of a controller on a machine that tests share.

use i2ris::config::Config;

/// Nothing spins or asks for real-time scheduling, and a stall is neither a lost drive nor the end
/// of a command.
pub fn run_on_shared_machine(config: &mut Config) {
    config.control.spin_us = 0;
    config.control.priority = 0;
    config.control.lock_memory = false;
    config.limits.feedback_stale_ms = 2000;
    config.limits.feedback_lost_ms = 10_000;
    config.command.deadline_ms = 500;
    config.command.lease_timeout_ms = 2000;
    for port in &mut config.ports {
        port.reply_timeout_ms = 500;
    }
}
