//! Events of faults, refusals, stops and clips report the measured value and its limit.

use i2ris::process::model_comparison::{ModelState, difference};

use super::*;

/// The measurement of the last event with this cause.
pub fn measurement(bench: &Bench, cause: Cause) -> Option<Measurement> {
    let mut reasons = bench.reasons.iter().rev();
    let reason = reasons.find(|reason| reason.cause == cause);
    reason.unwrap_or_else(|| panic!("{cause}: {:?}", bench.reasons)).measurement
}

fn fault(bench: &mut Bench, expected: Fault) -> Measurement {
    bench.until("FAULT", |bench| bench.state() == OperatingState::Fault);
    measurement(bench, Cause::Fault(expected)).unwrap()
}

#[test]
fn a_fault_reports_what_was_measured_and_of_which_motor() {
    let mut bench = Bench::enabled();
    bench.drives[1].fail(0x8611);
    let code = Measurement::new(Quantity::ErrorCode, f64::from(0x8611), None);
    assert_eq!(fault(&mut bench, Fault::Drive), code.of_motor(1));

    let mut bench = Bench::enabled();
    bench.quirk(1, Quirk::Silent);
    let age = fault(&mut bench, Fault::Link);
    assert_eq!((age.motor, age.quantity), (Some(1), Quantity::Milliseconds));
    assert!((age.measured - 150.0).abs() < 1e-9 && (age.limit.unwrap() - 150.0).abs() < 1e-9);

    let mut bench = Bench::enabled();
    bench.drives[1].feedback.phase = AxisPhase::Lost;
    let lost = fault(&mut bench, Fault::Link);
    assert_eq!(lost.to_string(), "motor 1", "given up before the limit: its age says nothing");

    let limits = "[limits]\nover_current_ma = 200";
    let mut bench = Bench::enabled_with(config(limits), None);
    bench.drives[1].feedback.current_ma = -240;
    let current = Measurement::new(Quantity::Milliamperes, 240.0, Some(200.0));
    assert_eq!(fault(&mut bench, Fault::Current), current.of_motor(1));

    let mut bench = Bench::enabled_with(config("[limits]\noverrun_ticks = 10"), None);
    bench.missed = 3;
    let late = fault(&mut bench, Fault::Late);
    assert_eq!(late.quantity, Quantity::LateTicks);
    assert!(late.measured >= late.limit.unwrap(), "{late}");
    // A suspend is a single late tick.
    let mut bench = Bench::enabled();
    bench.missed = u32::MAX;
    bench.tick();
    assert_eq!(measurement(&bench, Cause::Fault(Fault::Late)), None);
}

#[test]
fn drive_error_code_is_reported_once_read_never_as_zero() {
    let mut bench = Bench::enabled();
    bench.drives[1].feedback.phase = AxisPhase::Faulted;
    assert_eq!(fault(&mut bench, Fault::Drive).to_string(), "motor 1");
    bench.run(3);
    bench.drives[1].feedback.error_code = 0x8611;
    bench.run(3);
    let reported = measurement(&bench, Cause::Fault(Fault::Drive)).unwrap();
    assert_eq!(reported.to_string(), "motor 1: error code 0x8611");
    let faults = { bench.reasons.iter() }.filter(|it| it.cause == Cause::Fault(Fault::Drive));
    assert_eq!(faults.count(), 2, "once without, once with its code");
}

#[test]
fn a_refusal_reports_what_was_measured() {
    let Some(_) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    assert_eq!(bench.joint(9.0, 0.0), Refusal::StepTooLarge);
    let step = measurement(&bench, Cause::Refusal(Refusal::StepTooLarge)).unwrap();
    let limit = bench.config.command.max_step_deg;
    assert_eq!((step.quantity, step.limit), (Quantity::Degrees, Some(limit)));
    assert!((step.measured - 9.0).abs() < 1e-6, "{step}");

    let beyond = bench.config.axis(1).unwrap().position_max_counts.0 + 7;
    assert_eq!(bench.actuator([0, beyond]), Refusal::Range);
    let position =
        Measurement::new(Quantity::Counts, f64::from(beyond), Some(f64::from(beyond - 7)));
    assert_eq!(measurement(&bench, Cause::Refusal(Refusal::Range)), Some(position.of_motor(1)));

    let mut stale = bench.servo(ServoGoal::Joint(rad(0.0, 0.0), 2));
    stale.stamp = bench.now - Nanos::from_millis(80);
    stale.deadline = Nanos::from_millis(20);
    assert_eq!(bench.send(stale), Refusal::Stale);
    let age = measurement(&bench, Cause::Refusal(Refusal::Stale)).unwrap();
    assert!(age.measured >= 80.0 && age.limit == Some(20.0), "{age}");

    let mut entries = bench.servo(ServoGoal::Actuator([Counts(0); 2], 1));
    entries.deadline = Nanos::ZERO;
    assert_eq!(bench.send(entries), Refusal::Malformed);
    let values = Measurement::new(Quantity::Values, 1.0, Some(2.0));
    assert_eq!(measurement(&bench, Cause::Refusal(Refusal::Malformed)), Some(values));
}

#[test]
fn refused_step_is_reported_with_the_violated_limit() {
    let limits = strict_config("[joint_limits]\nposition_max_deg = [3.0, 9.0]");
    let mut bench = Bench::enabled_with(limits, Some(model(OutputUnit::Deg)));
    let angles = |pitch, yaw| ServoGoal::Joint(rad(pitch, yaw), 2);
    let refused = |bench: &mut Bench, goal: ServoGoal, [step, limit]: [f64; 2]| {
        assert_eq!(bench.goal(goal), Refusal::StepTooLarge, "{goal:?}");
        let reported = measurement(bench, Cause::Refusal(Refusal::StepTooLarge)).unwrap();
        let of = reported.limit.unwrap();
        assert!((reported.measured - step).abs() < 1e-6 && (of - limit).abs() < 1e-6, "{reported}");
    };
    let first = bench.config.command.first_step_deg;
    refused(&mut bench, angles(first + 0.1, 0.0), [first + 0.1, first]);
    assert_eq!(bench.joint(0.9 * first, 0.0), Refusal::None);
    refused(&mut bench, angles(0.9 * first, 5.1), [5.1, 5.0]);
    // The longest rate is followed, until its deadline of 50 ms.
    let rate = |pitch| ServoGoal::Rate(rad(pitch, 0.0), 2);
    assert_eq!(bench.joint(0.9 * first, 0.0), Refusal::None);
    refused(&mut bench, rate(104.0), [5.2, 5.0]);
    assert_eq!(bench.goal(rate(-100.0)), Refusal::None);
}

#[test]
fn a_repeated_refusal_is_one_event() {
    let mut bench = Bench::standard();
    for _ in 0..20 {
        assert_eq!(bench.ask(StateCommand::Enable), Refusal::NotHomed);
    }
    assert_eq!(bench.reasons.len(), 1, "{:?}", bench.reasons);
}

#[test]
fn stops_and_clips_are_reported_once_with_measurements() {
    let mut bench = Bench::moving();
    bench.run(200);
    let stale = measurement(&bench, Cause::Stop(Stop::Stale)).unwrap();
    let deadline = bench.config.command.deadline_ms as f64;
    assert_eq!(stale.limit, Some(deadline));
    assert!(stale.measured >= deadline, "{stale}");

    let mut bench = Bench::moving();
    bench.drives[0].feedback.stamp = bench.now;
    bench.quirk(0, Quirk::Silent);
    for _ in 0..120 {
        bench.joint(0.0, 0.0);
    }
    let feedback = measurement(&bench, Cause::Stop(Stop::Feedback)).unwrap();
    assert_eq!(feedback.motor, Some(0), "{feedback}");

    let mut bench = Bench::enabled();
    let mut pitch = 0.0;
    while pitch < 60.0 {
        pitch += 0.5;
        assert_eq!(bench.joint(pitch, 0.0), Refusal::None, "{pitch}");
    }
    let clips = { bench.reasons.iter() }.filter(|it| it.cause == Cause::Clip(Clip::Reach));
    assert_eq!(clips.count(), 1);
    let clip = measurement(&bench, Cause::Clip(Clip::Reach)).unwrap();
    assert!(clip.quantity == Quantity::Degrees && clip.measured > 0.0);
}

#[test]
fn the_last_event_of_a_clip_has_its_largest_distance() {
    let mut bench = Bench::enabled();
    let mut largest: f64 = 0.0;
    let go = |bench: &mut Bench, largest: &mut f64, pitch: f64| {
        assert_eq!(bench.joint(pitch, 0.0), Refusal::None, "{pitch}");
        if bench.report().clipped {
            let (goal, requested) = (bench.joints().goal, rad(pitch, 0.0));
            let cut_off = (goal[0] - requested[0]).hypot(goal[1] - requested[1]);
            *largest = largest.max(cut_off.to_degrees());
        }
    };
    for half_degrees in (0..=120).chain((0..120).rev()) {
        go(&mut bench, &mut largest, f64::from(half_degrees) / 2.0);
    }
    assert!(!bench.report().clipped && largest > 5.0, "{largest}");
    for _ in 0..1500 {
        go(&mut bench, &mut largest, 0.0);
    }
    let clips = { bench.reasons.iter() }.filter(|it| it.cause == Cause::Clip(Clip::Reach));
    let distances: Vec<f64> = clips.map(|it| it.measurement.unwrap().measured).collect();
    assert_eq!(distances.len(), 2, "beginning and largest: {distances:?}");
    assert!(distances[0] < 1.0, "{distances:?}");
    assert!((distances[1] - largest).abs() < 1e-9, "{distances:?} {largest}");
}

#[test]
fn model_does_not_differ_from_itself_with_any_memory() {
    let model = standard_model();
    let mut memory = model.new_memory();
    for counts in [[0.0, 0.0], [300.0, -200.0], [-150.0, 80.0], [40.0, 0.0]] {
        model.advance(&mut memory, &counts);
    }
    let here = [40.0, 0.0];
    let state = ModelState { model: &model, memory: &memory };
    for compensation in [0.0, 0.5, 1.0] {
        let found = difference(state, state, &here, compensation).unwrap();
        assert_eq!(found.present_counts, [0.0; 2], "{compensation}");
        assert_eq!(found.largest_counts, [0.0; 2], "{compensation}");
    }
    let other = scaled_standard_model(1.3);
    let mut memory = other.new_memory();
    other.advance(&mut memory, &here);
    let other = ModelState { model: &other, memory: &memory };
    let found = difference(state, other, &here, 0.5).unwrap();
    assert!(found.largest_counts[0].abs().max(found.largest_counts[1].abs()) > 50.0);
}
