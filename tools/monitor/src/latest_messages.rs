//! The last message of every stream, and its text. Pure.

use i2ris::ipc::drive_phase::phase_text;
use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, ExternalPosition, Health, JointState, OperatingStateMsg,
    PeriodStatistics, SpanSummary,
};
use i2ris::ipc::{Fault, Message, OperatingState, Refusal};
use i2ris::model::ModelId;
use i2ris::units::{MAX_MOTORS, Nanos};

use crate::adaptation;

/// Age at which a value is marked as stale. Cameras are slow; everything else comes many times a
/// second.
pub const STALE: Nanos = Nanos::from_millis(500);
/// The same for a camera.
pub const CAMERA_STALE: Nanos = STALE;
/// Statistics come once a second.
pub const STATISTICS_STALE: Nanos = Nanos::from_millis(2500);

/// The last message of every stream, as far as there is one.
#[derive(Debug, Clone, Copy, Default)]
pub struct LatestMessages {
    pub state: Option<OperatingStateMsg>,
    pub goal: Option<JointState>,
    pub setpoint: Option<JointState>,
    pub measured: Option<JointState>,
    pub camera: Option<ExternalPosition>,
    pub actuators: Option<ActuatorState>,
    pub statistics: Option<PeriodStatistics>,
    pub health: Option<Health>,
    pub adaptation: Option<AdaptationMsg>,
    /// Answered requests per second and drive.
    pub exchange_rates: Option<[f64; MAX_MOTORS]>,
}

impl LatestMessages {
    /// Everything, in several lines.
    pub fn page(&self, now: Nanos) -> Vec<String> {
        let mut lines = vec![self.state_line(now), self.lease_line()];
        lines.extend(self.angle_lines(now));
        lines.extend(self.motor_lines(now));
        lines.extend(self.loop_lines(now));
        lines.extend(
            self.health
                .as_ref()
                .map(|health| format!("health     {}", health_text(health))),
        );
        let adaptation = self.adaptation.iter().flat_map(adaptation::lines);
        lines.extend(adaptation.map(|line| format!("adaptation {line}")));
        lines
    }

    /// The essentials, in one line.
    pub fn line(&self, now: Nanos) -> String {
        let state = self.state.map_or("no state", |state| state_name(&state));
        let fault = self
            .fault()
            .map(|fault| format!(" ({fault})"))
            .unwrap_or_default();
        let pair = |joint: Option<&JointState>| {
            angles(joint).map_or_else(
                || "- -".to_owned(),
                |[pitch, yaw]| format!("{pitch:+.2} {yaw:+.2}"),
            )
        };
        let counts = self.actuators.map_or_else(String::new, |actuators| {
            let shown = |values: &[i32; MAX_MOTORS]| {
                let counts: Vec<String> = values
                    .iter()
                    .take(count(actuators.count))
                    .map(i32::to_string)
                    .collect();
                counts.join(" ")
            };
            format!(
                "; counts {} -> {}",
                shown(&actuators.setpoint_counts),
                shown(&actuators.measured_counts)
            )
        });
        let late = self.statistics.map_or_else(String::new, |statistics| {
            format!(
                "; late p99 {} us, missed {}",
                microseconds(statistics.lateness.p99_ns),
                statistics.total_missed
            )
        });
        let (setpoint, measured) = (pair(self.setpoint.as_ref()), pair(self.measured.as_ref()));
        let camera = self
            .camera_angles()
            .map_or_else(String::new, |[p, y]| format!(" camera {p:+.2} {y:+.2}"));
        let stale = mark(self.state.as_ref(), now, STALE);
        let goal = pair(self.goal.as_ref());
        format!(
            "{state}{fault}{stale}; goal {goal} set-point {setpoint} measured {measured}{camera} \
             deg{counts}{late}"
        )
    }

    fn state_line(&self, now: Nanos) -> String {
        let Some(state) = &self.state else {
            return "state      not received yet".to_owned();
        };
        let flag = |bit: u32, name: &'static str| (state.flags & bit != 0).then_some(name);
        let flags: Vec<&str> = [
            Some(if state.flags & OperatingStateMsg::HOMED != 0 {
                "homed"
            } else {
                "not homed"
            }),
            flag(OperatingStateMsg::BUSY, "busy"),
            flag(OperatingStateMsg::HOLDING, "holding"),
            flag(OperatingStateMsg::CLIPPED, "clipped"),
            Some(if state.flags & OperatingStateMsg::MODEL != 0 {
                "model loaded"
            } else {
                "no model"
            }),
            flag(OperatingStateMsg::MEMORY_KNOWN, "memory known"),
            Some(if state.flags & OperatingStateMsg::WATCHED != 0 {
                "watchdog"
            } else {
                "no watchdog"
            }),
            flag(OperatingStateMsg::COMPARED, "compared with camera"),
        ]
        .into_iter()
        .flatten()
        .collect();
        let fault = self
            .fault()
            .map(|fault| format!(": {fault}"))
            .unwrap_or_default();
        let since = now.since(Nanos(state.since_ns)).as_seconds();
        let name = state_name(state);
        format!(
            "state      {name}{fault} for {since:.0} s, {}{}",
            flags.join(", "),
            mark(Some(state), now, STALE)
        )
    }

    fn lease_line(&self) -> String {
        let Some(state) = &self.state else {
            return "commander  -".to_owned();
        };
        let holder = match state.lease_client_id {
            0 => "none".to_owned(),
            client => format!("{client:016x}"),
        };
        let OperatingStateMsg {
            accepted,
            refused,
            stale_stops,
            ..
        } = state;
        let reason = Refusal::from_number(state.last_refusal)
            .filter(|refusal| *refusal != Refusal::None)
            .map(|refusal| format!(", last: {refusal}"))
            .unwrap_or_default();
        format!(
            "commander  {holder}; accepted {accepted}, refused {refused}{reason}; stale stops \
             {stale_stops}"
        )
    }

    fn angle_lines(&self, now: Nanos) -> Vec<String> {
        let mut lines = vec![format!(
            "{:<11}{:>9}{:>11}{:>11}{:>9}{:>9}",
            "deg", "goal", "set-point", "measured", "+-", "camera"
        )];
        let (goal, setpoint) = (angles(self.goal.as_ref()), angles(self.setpoint.as_ref()));
        let (measured, camera) = (angles(self.measured.as_ref()), self.camera_angles());
        let deviation = self
            .measured
            .filter(is_valid)
            .map(|joint| joint.deviation.map(f64::to_degrees));
        for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
            let cell = |value: Option<[f64; 2]>| value.and_then(|value| value.get(axis).copied());
            let plus_minus = deviation.and_then(|value| value.get(axis).copied());
            lines.push(format!(
                "{name:<11}{:>9}{:>11}{:>11}{:>9}{:>9}",
                signed(cell(goal)),
                signed(cell(setpoint)),
                signed(cell(measured)),
                plus_minus.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}")),
                signed(cell(camera)),
            ));
        }
        if let Some(header) = lines.first_mut() {
            header.push_str(&mark(self.measured.as_ref(), now, STALE));
            header.push_str(&self.camera_mark(now));
        }
        lines
    }

    fn motor_lines(&self, now: Nanos) -> Vec<String> {
        let Some(actuators) = &self.actuators else {
            return vec!["motors     not received yet".to_owned()];
        };
        (0..count(actuators.count))
            .map(|motor| self.motor_line(actuators, motor, now))
            .collect()
    }

    fn motor_line(&self, actuators: &ActuatorState, motor: usize, now: Nanos) -> String {
        let drive = |values: &[i32; MAX_MOTORS]| values.get(motor).copied().unwrap_or_default();
        let word = |values: &[u16; MAX_MOTORS]| values.get(motor).copied().unwrap_or_default();
        let phase = actuators
            .phase
            .get(motor)
            .copied()
            .map_or("unknown", phase_text);
        let error = match word(&actuators.error_code) {
            0 => String::new(),
            code => format!(", error 0x{code:04X}"),
        };
        let read = Nanos(
            actuators
                .measured_stamp_ns
                .get(motor)
                .copied()
                .unwrap_or_default(),
        );
        let age = if read == Nanos::ZERO {
            "  NEVER READ".to_owned()
        } else {
            mark_age(now.since(read), STALE)
        };
        let rate = self
            .exchange_rates
            .and_then(|rates| rates.get(motor).copied());
        let rate = rate.map_or_else(
            || "exchanges not counted yet".to_owned(),
            |rate| format!("{rate:.0} exchanges/s"),
        );
        format!(
            "motor {motor}    set-point {}, measured {} counts, {} mA; {phase}{error}, status \
             0x{:04X}; {rate}{age}",
            drive(&actuators.setpoint_counts),
            drive(&actuators.measured_counts),
            drive(&actuators.current_ma),
            word(&actuators.statusword),
        )
    }

    fn loop_lines(&self, now: Nanos) -> Vec<String> {
        let Some(statistics) = &self.statistics else {
            return vec!["loop       not received yet".to_owned()];
        };
        let hertz = if statistics.window_ns == 0 {
            0.0
        } else {
            statistics.ticks as f64 / Nanos(statistics.window_ns).as_seconds()
        };
        let spans = |span: &SpanSummary| {
            let [p50, p99, max] = [span.p50_ns, span.p99_ns, span.max_ns].map(microseconds);
            format!("p50 {p50}, p99 {p99}, max {max} us")
        };
        let (late, compute) = (spans(&statistics.lateness), spans(&statistics.compute));
        let stale = mark(Some(statistics), now, STATISTICS_STALE);
        vec![
            format!("loop       {hertz:.0} Hz; late {late}; computing {compute}{stale}"),
            format!(
                "missed     {} of {} ticks, {} in the last window",
                statistics.total_missed,
                statistics.total_ticks + statistics.total_missed,
                statistics.missed
            ),
            format!("real time  {}", granted(statistics)),
        ]
    }

    /// Whether there is a message of every stream that a controller always publishes.
    pub fn is_complete(&self) -> bool {
        let Self {
            state,
            measured,
            actuators,
            statistics,
            exchange_rates,
            ..
        } = self;
        let all =
            state.is_some() && measured.is_some() && actuators.is_some() && statistics.is_some();
        all && exchange_rates.is_some()
    }

    /// Why the robot is in FAULT, if it is.
    pub fn fault(&self) -> Option<Fault> {
        let state = self
            .state
            .filter(|state| state.state == OperatingState::Fault.number())?;
        Fault::from_number(state.fault)
    }

    /// The last angles of the camera, degrees, fresh or not.
    pub fn camera_angles(&self) -> Option<[f64; 2]> {
        let camera = self
            .camera
            .filter(|camera| camera.flags & ExternalPosition::VALID != 0 && camera.count == 2)?;
        Some([
            camera.position[0].to_degrees(),
            camera.position[1].to_degrees(),
        ])
    }

    /// A missing camera is normal; a silent camera, or one without a detection, is marked.
    fn camera_mark(&self, now: Nanos) -> String {
        match &self.camera {
            None => String::new(),
            Some(camera) if camera.age(now) > CAMERA_STALE => {
                format!("  CAMERA STALE {:.1} s", camera.age(now).as_seconds())
            }
            Some(camera) if camera.flags & ExternalPosition::VALID == 0 => {
                "  CAMERA SEES NOTHING".to_owned()
            }
            Some(_) => String::new(),
        }
    }
}

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
    let found: Vec<String> = found
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    if found.is_empty() {
        "no errors, nothing lost".to_owned()
    } else {
        found.join(", ")
    }
}

/// What the system granted to the loop; capitals where something is missing.
pub fn granted(statistics: &PeriodStatistics) -> String {
    let scheduling = match statistics.priority {
        0 => "NORMAL SCHEDULING".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    let memory = if statistics.memory_locked == 1 {
        "memory locked"
    } else {
        "MEMORY NOT LOCKED"
    };
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

fn is_valid(joint: &JointState) -> bool {
    joint.flags & JointState::VALID != 0
}

/// Pitch and yaw, degrees; `None` where they mean nothing, or are a position instead.
pub fn angles(joint: Option<&JointState>) -> Option<[f64; 2]> {
    let joint = joint.filter(|joint| is_valid(joint) && joint.count == 2)?;
    Some([
        joint.position[0].to_degrees(),
        joint.position[1].to_degrees(),
    ])
}

/// How many motors there are.
pub fn count(count: u32) -> usize {
    usize::try_from(count).unwrap_or(MAX_MOTORS).min(MAX_MOTORS)
}

fn signed(degrees: Option<f64>) -> String {
    degrees.map_or_else(|| "-".to_owned(), |value| format!("{value:+.2}"))
}

/// The beginning of a model's identity: enough to distinguish models.
pub fn short_id(id: ModelId) -> String {
    id.to_string().chars().take(8).collect()
}

/// Microseconds, with as many digits as mean something.
pub fn microseconds(nanos: u64) -> String {
    let value = nanos as f64 / 1000.0;
    if value < 10.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.0}")
    }
}

fn mark<T: Message>(message: Option<&T>, now: Nanos, limit: Nanos) -> String {
    message.map_or_else(String::new, |message| mark_age(message.age(now), limit))
}

fn mark_age(age: Nanos, limit: Nanos) -> String {
    if age > limit {
        format!("  STALE {:.1} s", age.as_seconds())
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Nanos = Nanos(100_000_000_000);

    fn joint(pitch: f64, yaw: f64) -> JointState {
        JointState {
            stamp_ns: NOW.0,
            position: [pitch.to_radians(), yaw.to_radians(), 0.0],
            deviation: [0.25_f64.to_radians(), 0.5_f64.to_radians(), 0.0],
            count: 2,
            flags: JointState::VALID,
            ..JointState::default()
        }
    }

    #[test]
    fn health_names_what_failed_or_was_lost() {
        let mut health = Health::default();
        assert_eq!(health_text(&health), "no errors, nothing lost");
        (health.crc_errors, health.lost_records) = ([2, 1], 40);
        assert_eq!(health_text(&health), "CRC ERRORS 3, LOST RECORDS 40");
        let view = LatestMessages {
            health: Some(health),
            ..view()
        };
        let page = view.page(NOW);
        let line = "health     CRC ERRORS 3, LOST RECORDS 40";
        assert!(page.iter().any(|text| text == line), "{page:?}");
    }

    fn view() -> LatestMessages {
        LatestMessages {
            state: Some(OperatingStateMsg {
                stamp_ns: NOW.0,
                since_ns: NOW.0 - 12_000_000_000,
                lease_client_id: 0xabc,
                accepted: 400,
                refused: 3,
                last_refusal: Refusal::Step.number(),
                state: OperatingState::Enabled.number(),
                flags: OperatingStateMsg::HOMED | OperatingStateMsg::MODEL,
                ..OperatingStateMsg::default()
            }),
            goal: Some(joint(5.0, -1.0)),
            setpoint: Some(joint(4.5, -1.0)),
            measured: Some(joint(4.25, -1.5)),
            health: None,
            adaptation: None,
            camera: None,
            actuators: Some(ActuatorState {
                stamp_ns: NOW.0,
                measured_stamp_ns: [NOW.0; 2],
                measured_counts: [120, -340],
                setpoint_counts: [130, -345],
                current_ma: [12, -7],
                statusword: [0x0637, 0x0637],
                error_code: [0, 0x8611],
                phase: [3, 7],
                count: 2,
                ..ActuatorState::default()
            }),
            statistics: Some(PeriodStatistics {
                stamp_ns: NOW.0,
                window_ns: 1_000_000_000,
                ticks: 1000,
                total_ticks: 5000,
                total_missed: 4,
                lateness: SpanSummary {
                    p50_ns: 100,
                    p99_ns: 12_300,
                    max_ns: 250_000,
                    ..SpanSummary::default()
                },
                priority: 80,
                cpu: 1,
                memory_locked: 1,
                ..PeriodStatistics::default()
            }),
            exchange_rates: Some([470.2, 468.0]),
        }
    }

    fn page(view: &LatestMessages) -> String {
        view.page(NOW).join("\n")
    }

    #[test]
    fn everything_is_on_the_page_in_degrees_and_counts() {
        let text = page(&view());
        for part in [
            "ENABLED for 12 s, homed, model loaded",
            "0000000000000abc; accepted 400, refused 3, last: step too large",
            "+5.00      +4.50      +4.25     0.25",
            "motor 0    set-point 130, measured 120 counts, 12 mA; enabled, status 0x0637; 470 \
             exchanges/s",
            "motor 1    set-point -345, measured -340 counts, -7 mA; at fault, error 0x8611",
            "1000 Hz; late p50 0.1, p99 12, max 250 us",
            "4 of 5004 ticks",
            "SCHED_FIFO 80, memory locked, processor 1",
        ] {
            assert!(text.contains(part), "{part}\n{text}");
        }
        assert!(!text.contains("STALE"), "{text}");
    }

    #[test]
    fn old_values_are_marked() {
        let text = view().page(NOW + Nanos::from_millis(3000)).join("\n");
        assert_eq!(text.matches("STALE 3.0 s").count(), 5, "{text}");
    }

    #[test]
    fn a_camera_that_sees_nothing_or_fell_silent_is_told() {
        let camera = |stamp_ns, flags| LatestMessages {
            camera: Some(ExternalPosition {
                stamp_ns,
                flags,
                count: 2,
                ..ExternalPosition::default()
            }),
            ..view()
        };
        assert!(page(&camera(NOW.0, 0)).contains("CAMERA SEES NOTHING"));
        assert!(page(&camera(NOW.0 - 2_000_000_000, 1)).contains("CAMERA STALE 2.0 s"));
        assert!(page(&camera(NOW.0, 1)).contains("+0.00"));
    }

    #[test]
    fn what_is_not_known_is_not_invented() {
        let text = page(&LatestMessages::default());
        assert!(
            text.contains("state      not received yet")
                && text.contains("loop       not received yet"),
            "{text}"
        );
        let invalid = JointState {
            flags: 0,
            ..joint(5.0, 5.0)
        };
        let text = page(&LatestMessages {
            measured: Some(invalid),
            ..view()
        });
        assert!(!text.contains("+5.00      +4.50      +5.00"), "{text}");
        assert!(LatestMessages::default().line(NOW).contains("no state"));
    }

    #[test]
    fn what_is_missing_for_real_time_stands_out() {
        let statistics = PeriodStatistics {
            cpu: u32::MAX,
            ..PeriodStatistics::default()
        };
        assert_eq!(
            granted(&statistics),
            "NORMAL SCHEDULING, MEMORY NOT LOCKED, not pinned"
        );
    }

    #[test]
    fn one_line_holds_the_essentials() {
        let text = view().line(NOW);
        assert_eq!(
            text,
            "ENABLED; goal +5.00 -1.00 set-point +4.50 -1.00 measured +4.25 -1.50 deg; counts 130 \
             -345 -> 120 -340; \
             late p99 12 us, missed 4"
        );
        let fault = OperatingStateMsg {
            state: OperatingState::Fault.number(),
            fault: Fault::Link.number(),
            stamp_ns: NOW.0,
            ..OperatingStateMsg::default()
        };
        assert!(
            LatestMessages {
                state: Some(fault),
                ..view()
            }
            .line(NOW)
            .starts_with("FAULT (a drive does not answer);")
        );
    }
}
