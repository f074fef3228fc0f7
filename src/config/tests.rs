use super::*;

const AXIS: &str = r#"
    robot_id = "test"
    [[ports]]
    device = "/dev/null"
    [[ports.axes]]
    motor = 0
    node_id = 0
    serial_number = 1
    position_min_counts = -100
    position_max_counts = 100
"#;

fn error(extra: &str) -> String {
    Config::parse(&format!("{AXIS}\n{extra}"), Path::new("robot.toml"))
        .unwrap_err()
        .to_string()
}

#[test]
fn a_short_file_gets_the_defaults() {
    let config = Config::parse(AXIS, Path::new("robot.toml")).unwrap();
    assert_eq!(config.control, ControlConfig::default());
    assert_eq!(config.motors(), 1);
    assert_eq!(config.axis(0).unwrap().current_limit_ma, 300);
}

#[test]
fn an_unknown_key_is_named_with_its_line() {
    let text = error("[control]\nrate_herz = 3");
    assert!(
        text.contains("rate_herz")
            && text.contains("line 13")
            && text.contains("did you mean `rate_hz`?"),
        "{text}"
    );
}

#[test]
fn a_value_out_of_range_is_named_with_the_reason() {
    assert!(error("[control]\nrate_hz = 7").contains("control.rate_hz = 7: must be 100 to 4000"));
    assert!(error("[limits]\nvelocity_counts_s = nan").contains("limits.velocity_counts_s = NaN"));
    assert!(error("[command]\ndeadline_ms = 0").contains("command.deadline_ms"));
    assert!(
        error("[compensation]\nfactor = 1.5").contains("compensation.factor = 1.5: must be 0 to 1")
    );
    assert!(
        error("[compensation]\nturning_band_deg = nan")
            .contains("turning_band_deg = NaN: must be 0 to 2")
    );
    assert!(
        error("[limits]\njerk_counts_s3 = 1e7").contains("the delay would be longer than 16 ticks")
    );
    assert!(error("[condition]\nturns = 0").contains("condition.turns = 0: must be 1 to 20"));
    assert!(error("[condition]\nhalf_width_counts = 0").contains("condition.half_width_counts"));
}

#[test]
fn two_axes_on_one_motor_are_refused() {
    let text = error(
        "[[ports]]\ndevice = \"/dev/zero\"\n[[ports.axes]]\nmotor = 0\nnode_id = 0\nserial_number = 2\n\
         position_min_counts = 0\nposition_max_counts = 1",
    );
    assert!(text.contains("turned by another axis"), "{text}");
}

#[test]
fn the_window_of_a_jerk_limit_is_as_long_as_it_needs() {
    assert_eq!(window_ticks(400.0, 40_000.0, Nanos::from_millis(1)), 20);
    assert_eq!(window_ticks(400.0, 39_000.0, Nanos::from_millis(1)), 21);
    assert_eq!(window_ticks(1.0, 1e9, Nanos::from_millis(1)), 1);
}
