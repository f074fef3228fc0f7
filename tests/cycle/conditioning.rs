//! The command `condition`: a conditioning cycle, after which the memory of the model is known.

use super::*;

/// Enabled, at a position that is not the centre.
fn ready(config: Config, model: Option<Arc<Model>>) -> Bench {
    let mut bench = Bench::enabled_with(config, model);
    for _ in 0..40 {
        assert_eq!(bench.actuator([120, -80]), Refusal::None);
        bench.run(4);
    }
    bench.run(600);
    assert_eq!((bench.targets(), bench.report().lease_client_id), ([120, -80], 0));
    bench
}

/// Runs a complete conditioning cycle. Returns the targets of every tick.
fn run_conditioning(bench: &mut Bench) -> Vec<[i32; 2]> {
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    assert!(bench.report().busy && !bench.report().holding);
    let mut positions = vec![bench.targets()];
    while bench.report().busy {
        bench.tick();
        positions.push(bench.targets());
        assert!(positions.len() < 100_000, "it ends");
    }
    assert_eq!((bench.state(), bench.report().holding), (OperatingState::Enabled, true));
    positions
}

fn range(positions: &[[i32; 2]], motor: usize) -> (i32, i32) {
    let values = || positions.iter().map(|place| place[motor]);
    (values().min().unwrap(), values().max().unwrap())
}

#[test]
fn conditioning_covers_hull_within_limits_and_returns_to_start() {
    let mut bench = ready(config(""), Some(standard_model()));
    let positions = run_conditioning(&mut bench);
    assert_eq!(range(&positions, 0), (-HULL as i32, HULL as i32));
    assert_eq!(range(&positions, 1), (-700, HULL as i32), "motor 1 ends at -700");
    assert_eq!(positions.last(), Some(&[120, -80]));
    let swings: Vec<i32> = positions
        .chunks(positions.len() / 4)
        .map(|part| range(part, 0).1 - range(part, 0).0)
        .collect();
    assert!(swings[1] > swings[3] && swings[3] < 900, "it decays: {swings:?}");
    let rests = positions.chunk_by(|a, b| a == b).filter(|rest| rest.len() > 40);
    assert!(rests.count() >= 16, "at the ends of four rounds, to read the encoders");
}

#[test]
fn afterwards_the_memory_is_known() {
    let mut bench = ready(config(""), Some(model_with_memory()));
    // The motors have covered 120 and 80 counts, and more are needed.
    assert!(!bench.joints().memory_known);
    run_conditioning(&mut bench);
    assert!(bench.joints().memory_known);
}

#[test]
fn narrow_conditioning_is_widened_for_the_model() {
    let model = model_with_memory();
    let narrow = config("[compensation]\nconditioning_counts = 20");
    let mut bench = ready(narrow, Some(Arc::clone(&model)));
    let positions = run_conditioning(&mut bench);
    for (motor, centre) in [120.0, -80.0].into_iter().enumerate() {
        // What it needs and a margin.
        let half = 0.5 * model.conditioning_range()[motor] + 10.0;
        let (low, high) = range(&positions, motor);
        let wanted = [centre - half, centre + half].map(f64::round);
        assert_eq!([low, high].map(f64::from), wanted, "motor {motor}");
    }
    assert!(bench.joints().memory_known);
}

#[test]
fn conditioning_without_model_uses_configured_width_within_limits() {
    for (half_width, first, second) in
        [(650, (-530, 770), (-700, 600)), (950, (-900, 1000), (-700, 1000))]
    {
        let table = "[compensation]\nconditioning_counts";
        let mut bench = ready(config(&format!("{table} = {half_width}")), None);
        let positions = run_conditioning(&mut bench);
        let ranges = (range(&positions, 0), range(&positions, 1));
        assert_eq!(ranges, (first, second), "as wide, but moved off the limit");
        assert_eq!(positions.last(), Some(&[120, -80]));
        let mut steps = positions.windows(2).map(|pair| (pair[1][0] - pair[0][0]).abs());
        assert!(steps.all(|step| step <= 1), "half a count in a tick");
    }
}

#[test]
fn one_motor_is_conditioned_too() {
    let mut one = config("");
    one.ports[0].axes.truncate(1);
    let mut bench = Bench::enabled_with(one, None);
    let positions = run_conditioning(&mut bench);
    assert_eq!((range(&positions, 0), range(&positions, 1)), ((-500, 500), (0, 0)));
}

#[test]
fn conditioning_wider_than_position_limits_is_refused() {
    let mut narrow = config("");
    narrow.ports[0].axes[1].position_min_counts = Counts(-60);
    narrow.ports[0].axes[1].position_max_counts = Counts(60);
    let mut bench = Bench::enabled_with(narrow, Some(model_with_memory()));
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::Range);
    assert!(!bench.report().busy);
}

#[test]
fn servo_commands_during_conditioning_are_refused() {
    let mut bench = ready(config(""), Some(standard_model()));
    let alone = run_conditioning(&mut ready(config(""), Some(standard_model())));
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    for place in &alone[1..500] {
        assert_eq!(bench.actuator([0, 0]), Refusal::Conditioning);
        assert_eq!(bench.targets(), *place);
    }
    assert_eq!(bench.report().lease_client_id, CLIENT, "its cycle is its own");
    bench.idle();
    assert_eq!(bench.report().lease_client_id, 0);
}

#[test]
fn pause_and_disable_stop_it_at_once() {
    for (command, state) in [
        (StateCommand::Pause, OperatingState::Paused),
        (StateCommand::Disable, OperatingState::Disabled),
    ] {
        let mut bench = ready(config(""), None);
        bench.ask(StateCommand::Condition);
        bench.run(300);
        assert_eq!(bench.ask(command), Refusal::None);
        bench.tick();
        let here = bench.targets();
        bench.run(1000);
        assert_eq!((bench.targets(), bench.state(), bench.report().busy), (here, state, false));
    }
}

#[test]
fn motor_blocked_during_conditioning_raises_fault() {
    let mut bench = ready(config(""), None);
    bench.ask(StateCommand::Condition);
    bench.run(100);
    bench.quirk(1, Quirk::Blocked);
    bench.run(3000);
    let fault = (bench.state(), bench.report().fault);
    assert_eq!(fault, (OperatingState::Fault, Fault::FollowingError));
    let here = bench.targets();
    bench.run(500);
    assert_eq!(bench.targets(), here);
}
