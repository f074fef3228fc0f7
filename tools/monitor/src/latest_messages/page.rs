//! The last messages as lines of text, for `--once` and for pipes.

use i2ris::ipc::drive_phase::phase_text;
use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, ReasonMsg, SpanSummary,
};
use i2ris::ipc::{Message, Refusal};
use i2ris::units::{MAX_MOTORS, Nanos};

use crate::{adaptation, fixtures};

use super::text::{granted, health_text, microseconds, state_name};
use super::{CAMERA_STALE, LatestMessages, STALE, STATISTICS_STALE, angles, count, is_valid};

impl LatestMessages {
    /// Everything, in several lines.
    pub fn page(&self, now: Nanos) -> Vec<String> {
        let mut lines = vec![self.state_line(now), self.lease_line()];
        lines.extend(self.reason_lines(now));
        lines.extend(self.angle_lines(now));
        lines.extend(self.motor_lines(now));
        lines.extend(self.loop_lines(now));
        lines.extend(
            self.health.as_ref().map(|health| format!("health     {}", health_text(health))),
        );
        let adaptation = self.adaptation.iter().flat_map(adaptation::lines);
        lines.extend(adaptation.map(|line| format!("adaptation {line}")));
        let fixtures = self.fixtures.as_ref().and_then(fixtures::line);
        lines.extend(fixtures.map(|line| format!("fixtures   {line}")));
        lines
    }

    /// The essentials, in one line.
    pub fn line(&self, now: Nanos) -> String {
        let state = self.state.map_or("no state", |state| state_name(&state));
        let fault = self.fault().map(|fault| format!(" ({fault})")).unwrap_or_default();
        let pair = |joint: Option<&JointState>| {
            angles(joint)
                .map_or_else(|| "- -".to_owned(), |[pitch, yaw]| format!("{pitch:+.2} {yaw:+.2}"))
        };
        let counts = self.actuators.map_or_else(String::new, |actuators| {
            let shown = |values: &[i32; MAX_MOTORS]| {
                let counts: Vec<String> =
                    values.iter().take(count(actuators.count)).map(i32::to_string).collect();
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
            Some(if state.flags & OperatingStateMsg::HOMED != 0 { "homed" } else { "not homed" }),
            flag(OperatingStateMsg::BUSY, "busy"),
            flag(OperatingStateMsg::HOLDING, "holding"),
            flag(OperatingStateMsg::CLIPPED, "clipped"),
            flag(OperatingStateMsg::FIXTURE, "limited by a virtual fixture"),
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
        let fault = self.fault().map(|fault| format!(": {fault}")).unwrap_or_default();
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
        let OperatingStateMsg { accepted, refused, stale_stops, .. } = state;
        let reason = Refusal::from_number(state.last_refusal)
            .filter(|refusal| *refusal != Refusal::None)
            .map(|refusal| format!(", last: {refusal}"))
            .unwrap_or_default();
        format!(
            "commander  {holder}; accepted {accepted}, refused {refused}{reason}; stale stops \
             {stale_stops}"
        )
    }

    /// Why the robot does not move: the fault, and what was refused or clipped a short time ago.
    fn reason_lines(&self, now: Nanos) -> Vec<String> {
        let line =
            |reason: &ReasonMsg| format!("why        {}; do: {}", reason.text(), reason.advice());
        let fault = self.present_error();
        fault.iter().chain(&self.recent_warning(now)).map(line).collect()
    }

    fn angle_lines(&self, now: Nanos) -> Vec<String> {
        let mut lines = vec![format!(
            "{:<11}{:>9}{:>11}{:>11}{:>9}{:>9}",
            "deg", "goal", "set-point", "measured", "+-", "camera"
        )];
        let (goal, setpoint) = (angles(self.goal.as_ref()), angles(self.setpoint.as_ref()));
        let (measured, camera) = (angles(self.measured.as_ref()), self.camera_angles());
        let deviation =
            self.measured.filter(is_valid).map(|joint| joint.deviation.map(f64::to_degrees));
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
        (0..count(actuators.count)).map(|motor| self.motor_line(actuators, motor, now)).collect()
    }

    fn motor_line(&self, actuators: &ActuatorState, motor: usize, now: Nanos) -> String {
        let drive = |values: &[i32; MAX_MOTORS]| values.get(motor).copied().unwrap_or_default();
        let word = |values: &[u16; MAX_MOTORS]| values.get(motor).copied().unwrap_or_default();
        let phase = actuators.phase.get(motor).copied().map_or("unknown", phase_text);
        let error = match word(&actuators.error_code) {
            0 => String::new(),
            code => format!(", error 0x{code:04X}"),
        };
        let read = Nanos(actuators.measured_stamp_ns.get(motor).copied().unwrap_or_default());
        let age = if read == Nanos::ZERO {
            "  NEVER READ".to_owned()
        } else {
            mark_age(now.since(read), STALE)
        };
        let rate = self.exchange_rates.and_then(|rates| rates.get(motor).copied());
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

fn signed(degrees: Option<f64>) -> String {
    degrees.map_or_else(|| "-".to_owned(), |value| format!("{value:+.2}"))
}

fn mark<T: Message>(message: Option<&T>, now: Nanos, limit: Nanos) -> String {
    message.map_or_else(String::new, |message| mark_age(message.age(now), limit))
}

fn mark_age(age: Nanos, limit: Nanos) -> String {
    if age > limit { format!("  STALE {:.1} s", age.as_seconds()) } else { String::new() }
}
