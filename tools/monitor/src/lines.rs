//! The robot as lines of text.

use i2ris_report::view::{Age, ControlLoop, Motor, NOTHING, Pose, Span, State, View, Why};

/// Reasons why it does not move: two lines each.
pub fn reasons(view: &View) -> Vec<String> {
    let is_free = view.state.is_some() && view.why.iter().all(|why| why.age_s.is_some());
    let state = view.state.as_ref();
    let holder = state.and_then(|it| it.commander.as_ref().or(it.lease.as_ref()));
    let nothing = is_free.then(|| match holder {
        None => vec![NOTHING.to_owned()],
        Some(holder) => vec![
            format!("nothing keeps the robot from moving: it follows {holder}"),
            "  action: wait for its end, or end it, before another program commands".to_owned(),
        ],
    });
    let lines = view.why.iter().flat_map(|Why { text, advice, age_s, .. }| {
        let age = age_s.map(|age| format!(", {age:.1} s ago")).unwrap_or_default();
        [format!("{text}{age}"), format!("  action: {advice}")]
    });
    nothing.into_iter().flatten().chain(lines).collect()
}

/// Everything else, in several lines.
pub fn page(view: &View) -> Vec<String> {
    let mut lines = vec![state_line(view.state.as_ref()), lease_line(view.state.as_ref())];
    lines.extend(angle_lines(view));
    match &view.motors {
        None => lines.push("motors     not received yet".to_owned()),
        Some(motors) => {
            lines.extend(motors.iter().enumerate().map(|(index, it)| motor_line(index, it)));
        }
    }
    lines.extend(view.jaw.iter().map(|jaw| {
        let deg = jaw.deg.map_or_else(|| "unknown".to_owned(), |[deg, _]| format!("{deg:+.2} deg"));
        format!("auxiliary  {deg}{}", mark(Some(&jaw.age)))
    }));
    lines.extend(loop_lines(view.control_loop.as_ref()));
    lines.extend(view.trial.iter().map(|trial| format!("study      {}", trial.line())));
    lines.extend(view.health.iter().map(|health| format!("health     {health}")));
    let adaptation = view.adaptation.iter().flat_map(|it| it.lines());
    lines.extend(adaptation.map(|line| format!("adaptation {line}")));
    let fixtures: Vec<&str> = view.fixtures.iter().map(|it| it.text.as_str()).collect();
    if !fixtures.is_empty() {
        lines.push(format!("fixtures   {}", fixtures.join(", ")));
    }
    lines
}

fn state_line(state: Option<&State>) -> String {
    let Some(state) = state else { return "state      not received yet".to_owned() };
    let flags = [
        (true, if state.homed { "homed" } else { "not homed" }),
        (state.busy, "busy"),
        (state.holding, "holding"),
        (state.clipped, "clipped"),
        (state.at_fixture, "limited by a virtual fixture"),
        (true, if state.model { "model loaded" } else { "no model: angles not limited" }),
        (state.memory_known, "memory known"),
        (true, if state.watched { "watchdog" } else { "no watchdog" }),
        (state.compared, "compared with camera"),
    ];
    let flags = flags.into_iter().filter_map(|(is_set, text)| is_set.then_some(text));
    let fault = state.fault.map(|fault| format!(": {fault}")).unwrap_or_default();
    let (flags, mark) = (flags.collect::<Vec<_>>().join(", "), mark(Some(&state.age)));
    format!("state      {}{fault} for {:.0} s, {flags}{mark}", state.name, state.for_s)
}

fn lease_line(state: Option<&State>) -> String {
    let Some(State { lease, commander, accepted, refused, last_refusal, stale_stops, .. }) = state
    else {
        return "commander  -".to_owned();
    };
    let holder = lease.as_deref().map_or("none", |id| commander.as_deref().unwrap_or(id));
    let reason = last_refusal.map(|refusal| format!(", last: {refusal}")).unwrap_or_default();
    format!(
        "commander  {holder}; accepted {accepted}, refused {refused}{reason}; stale stops \
         {stale_stops}"
    )
}

fn angle_lines(view: &View) -> Vec<String> {
    let camera = match &view.camera {
        Some(camera) if camera.age.stale => format!("  CAMERA{}", &mark(Some(&camera.age))[1..]),
        Some(camera) if camera.deg.is_none() => "  CAMERA SEES NOTHING".to_owned(),
        _ => String::new(),
    };
    let estimate = mark(view.estimate.as_ref().map(|it| &it.age));
    let mut lines = vec![format!(
        "{:<11}{:>9}{:>11}{:>11}{:>9}{:>9}{estimate}{camera}",
        "deg", "goal", "setpoint", "measured", "+-", "camera"
    )];
    for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
        let signed = |pose: Option<Pose>| {
            let deg = pose.and_then(|pose| pose.deg);
            deg.map_or_else(|| "-".to_owned(), |deg| format!("{:+.2}", deg[axis]))
        };
        let deviation = view.estimate.and_then(|it| it.deviation_deg);
        lines.push(format!(
            "{name:<11}{:>9}{:>11}{:>11}{:>9}{:>9}",
            signed(view.goal),
            signed(view.setpoint),
            signed(view.estimate),
            deviation.map_or_else(|| "-".to_owned(), |deg| format!("{:.2}", deg[axis])),
            signed(view.camera),
        ));
    }
    lines
}

fn motor_line(index: usize, motor: &Motor) -> String {
    let Motor { setpoint_counts, measured_counts, current_ma, phase, status, .. } = motor;
    let error = motor.error.as_ref().map(|code| format!(", error {code}")).unwrap_or_default();
    let rate = motor.exchanges_per_s.map(|rate| format!("{rate:.0} exchanges/s"));
    let rate = rate.unwrap_or_else(|| "exchanges not counted yet".to_owned());
    format!(
        "motor {index}    setpoint {setpoint_counts}, measured {measured_counts} counts, \
         {current_ma} mA; {phase}{error}, status {status}; {rate}{}",
        mark(Some(&motor.age))
    )
}

fn loop_lines(control_loop: Option<&ControlLoop>) -> Vec<String> {
    let Some(it) = control_loop else { return vec!["loop       not received yet".to_owned()] };
    let ControlLoop { hz, missed, missed_in_window, granted, line, .. } = it;
    let spans = |span: &Span| {
        let [p50, p99, max] = span.texts();
        format!("p50 {p50}, p99 {p99}, max {max} us")
    };
    let (late, compute, stale) = (spans(&it.late), spans(&it.compute), mark(Some(&it.age)));
    vec![
        format!("loop       {hz:.0} Hz; late {late}; computing {compute}{stale}"),
        format!(
            "missed     {missed} of {} ticks, {missed_in_window} in the last window",
            it.ticks + missed
        ),
        format!("real time  {granted}"),
        format!("line       {line}"),
    ]
}

fn mark(age: Option<&Age>) -> String {
    age.and_then(Age::mark).map(|mark| format!("  {mark}")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{
        ActuatorState, JointState, OperatingStateMsg, PeriodStatistics, ReasonMsg, SpanSummary,
    };
    use i2ris::ipc::{Fault, OperatingState, Refusal};
    use i2ris::robot::{Cause, Measurement, Quantity, Reason};
    use i2ris::units::Nanos;
    use i2ris_report::view::LatestMessages;

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

    fn messages() -> LatestMessages {
        LatestMessages {
            state: Some(OperatingStateMsg {
                stamp_ns: NOW.0,
                since_ns: NOW.0 - 12_000_000_000,
                lease_client_id: 0xabc,
                accepted: 400,
                refused: 3,
                last_refusal: Refusal::StepTooLarge.number(),
                state: OperatingState::Enabled.number(),
                flags: OperatingStateMsg::HOMED | OperatingStateMsg::MODEL,
                ..OperatingStateMsg::default()
            }),
            goal: Some(joint(5.0, -1.0)),
            setpoint: Some(joint(4.5, -1.0)),
            measured: Some(joint(4.25, -1.5)),
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
            ..LatestMessages::default()
        }
    }

    fn fault() -> OperatingStateMsg {
        OperatingStateMsg {
            state: OperatingState::Fault.number(),
            fault: Fault::Link.number(),
            stamp_ns: NOW.0,
            ..OperatingStateMsg::default()
        }
    }

    fn text(messages: &LatestMessages, now: Nanos) -> String {
        let view = View::new(messages, now);
        [reasons(&view), page(&view)].concat().join("\n")
    }

    #[track_caller]
    fn assert_has(text: &str, parts: &[&str]) {
        for part in parts {
            assert!(text.contains(part), "{part}\n{text}");
        }
    }

    #[test]
    fn everything_is_on_the_page_in_degrees_and_counts() {
        let text = text(&messages(), NOW);
        assert_has(
            &text,
            &[
                "ENABLED for 12 s, homed, model loaded",
                "client 61d8332e; accepted 400, refused 3, last: step too large",
                "+5.00      +4.50      +4.25     0.25",
                "motor 0    setpoint 130, measured 120 counts, 12 mA; enabled, status 0x0637; 470 \
                 exchanges/s",
                "motor 1    setpoint -345, measured -340 counts, -7 mA; at fault, error 0x8611",
                "1000 Hz; late p50 0.1, p99 12, max 250 us",
                "4 of 5004 ticks",
                "SCHED_FIFO 80, memory locked, processor 1",
            ],
        );
        assert!(!text.contains("STALE"), "{text}");
    }

    #[test]
    fn old_values_are_marked() {
        let text = text(&messages(), NOW + Nanos::from_millis(3000));
        assert_eq!(text.matches("STALE 3.0 s").count(), 5, "{text}");
    }

    #[test]
    fn unknown_values_are_not_invented() {
        let nothing = LatestMessages::default();
        let lines = ["state      not received yet", "loop       not received yet"];
        assert_has(&text(&nothing, NOW), &lines);
        let invalid = JointState { flags: 0, ..joint(5.0, 5.0) };
        let text = text(&LatestMessages { measured: Some(invalid), ..messages() }, NOW);
        assert!(!text.contains("+5.00      +4.50      +5.00"), "{text}");
    }

    #[test]
    fn fault_and_fresh_refusal_are_shown_with_advice() {
        let reason = |cause, measurement| ReasonMsg::new(&Reason { cause, measurement }, 0, NOW);
        let measurement =
            Some(Measurement::new(Quantity::Milliseconds, 612.0, Some(200.0)).of_motor(1));
        let messages = LatestMessages {
            state: Some(fault()),
            error: Some(reason(Cause::Fault(Fault::Link), measurement)),
            warning: Some(reason(Cause::Refusal(Refusal::Lease), None)),
            ..messages()
        };
        let fault = "fault 2: a drive does not answer (motor 1: 612.0 ms, limit 200.0 ms)\n  \
                     action: check cable";
        let refusal = "refusal 4: another client holds the lease, 0.0 s ago\n  action: end";
        assert_has(&text(&messages, NOW), &[fault, refusal]);
        let later = text(&messages, NOW + Nanos::from_millis(6000));
        assert!(later.contains("fault 2") && !later.contains("refusal 4"), "{later}");
    }
}
