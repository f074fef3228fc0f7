//! Texts of single values.

use i2ris::ipc::OperatingState;
use i2ris::ipc::payload::{Health, OperatingStateMsg, PeriodStatistics};
use i2ris::model::ModelId;

/// What failed or was lost since the start of the controller; in capitals if anything did.
pub fn health_text(health: &Health) -> String {
    let sum = |counters: &[u64]| counters.iter().sum::<u64>();
    let line_errors = [
        ("TIMEOUTS", sum(&health.timeouts)),
        ("CRC ERRORS", sum(&health.crc_errors)),
        ("RESYNCHRONISATIONS", sum(&health.resynchronisations)),
        ("RETRIES", sum(&health.retries)),
        ("SHARED-MEMORY FAILURES", health.ipc_failures),
        ("LOST EVENTS", health.lost_events),
        ("LOST MESSAGES", health.lost_reports),
        ("LOST RECORDS", health.lost_records),
        ("LOST REPLIES", health.lost_replies),
    ];
    let found = line_errors.iter().filter(|(_, count)| *count > 0);
    let found: Vec<String> = found.map(|(name, count)| format!("{name} {count}")).collect();
    if found.is_empty() { "no errors, nothing lost".to_owned() } else { found.join(", ") }
}

/// What the system granted to the loop; capitals where something is missing.
pub fn granted(statistics: &PeriodStatistics) -> String {
    let scheduling = match statistics.priority {
        0 => "NORMAL SCHEDULING".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    let memory = if statistics.memory_locked == 1 { "memory locked" } else { "MEMORY NOT LOCKED" };
    let processor = match statistics.cpu {
        u32::MAX => "not pinned".to_owned(),
        cpu => format!("processor {cpu}"),
    };
    format!("{scheduling}, {memory}, {processor}")
}

/// The name of the state.
pub fn state_name(state: &OperatingStateMsg) -> &'static str {
    OperatingState::from_number(state.state).map_or("UNKNOWN STATE", OperatingState::text)
}

/// The beginning of a model's identity: enough to distinguish models.
pub fn short_id(id: ModelId) -> String {
    id.to_string().chars().take(8).collect()
}

/// Microseconds, with as many digits as mean something.
pub fn microseconds(nanos: u64) -> String {
    let value = nanos as f64 / 1000.0;
    if value < 10.0 { format!("{value:.1}") } else { format!("{value:.0}") }
}
