use serde_json::{Value, json};

use super::bounds::{BOUNDS, Bound};
use super::sections::window_ticks;
use super::*;
use crate::units::Nanos;

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
    Config::parse(&format!("{AXIS}\n{extra}"), Path::new("robot.toml")).unwrap_err().to_string()
}

#[test]
fn a_short_file_gets_the_defaults() {
    let config = Config::parse(AXIS, Path::new("robot.toml")).unwrap();
    assert_eq!(config.control, ControlConfig::default());
    assert_eq!(config.motors(), 1);
    assert_eq!(config.axis(0).unwrap().current_limit_ma, 100);
    let (limits, axis) = (&config.limits, config.axis(0).unwrap());
    assert_eq!((limits.velocity_counts_s, limits.acceleration_counts_s2), (500.0, 5000.0));
    assert_eq!((limits.following_error_counts, axis.following_error_counts), (100, 150));
    assert_eq!((limits.over_current_ma, limits.overrun_ticks), (Some(90), 100));
    assert_eq!((config.command.max_step_deg, config.command.max_step_counts), (1.0, 50));
    assert_eq!(config.joint_limits.velocity_deg_s, Some(20.0));
    assert_eq!((axis.motor_speed_rpm, config.compensation.conditioning_counts), (200, Some(300)));
    assert!(config.disabled_monitors().is_empty(), "{:?}", config.disabled_monitors());
}

#[test]
fn an_unknown_key_is_named_with_its_line() {
    let text = error("[control]\nrate_herz = 3");
    let parts = ["rate_herz", "line 13", "did you mean `rate_hz`?"];
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

/// Another port with one axis.
fn port(axis: &str) -> String {
    format!(
        "[[ports]]\ndevice = \"/dev/zero\"\n[[ports.axes]]\nnode_id = 0\n\
         position_min_counts = 0\nposition_max_counts = 1\n{axis}"
    )
}

#[test]
fn every_value_out_of_range_is_named_with_the_reason() {
    let cases: &[(&str, &[&str])] = &[
        (
            "[control]\nrate_hz = 7\n[command]\nmotion_scale = 2",
            &[
                "control.rate_hz = 7: must be 100 to 4000",
                "command.motion_scale = 2: must be 0.01 to 1",
            ],
        ),
        ("[limits]\nvelocity_counts_s = nan", &["limits.velocity_counts_s = NaN"]),
        ("[command]\ndeadline_ms = 0", &["command.deadline_ms"]),
        ("[command]\ndeadline_ms = 1001", &[": the robot has to stop when commands end"]),
        ("[compensation]\nfactor = 1.5", &["compensation.factor = 1.5: must be 0 to 1"]),
        ("[compensation]\nreversal_dead_band_deg = nan", &["dead_band_deg = NaN: must be 0 to 2"]),
        ("[limits]\njerk_counts_s3 = 1e7", &["the delay would be longer than 16 ticks"]),
        ("[compensation]\nconditioning_counts = -1", &["compensation.conditioning_counts"]),
        // Limits that no motor of the snake has.
        ("[limits]\nvelocity_counts_s = 20001", &["at most"]),
        ("[limits]\nacceleration_counts_s2 = 2.1e6", &["at most"]),
        ("[limits]\nstop_deceleration_counts_s2 = 2.1e7", &["at most"]),
        ("[limits]\nover_current_ma = 2001", &["must be 0 to"]),
        ("[joint_limits]\nvelocity_deg_s = 1001", &["must be 0 to"]),
        ("[joint_limits]\nposition_max_deg = []", &["must have 1 entries"]),
        (&port("motor = 0\nserial_number = 2"), &["turned by another axis"]),
        (
            &port("motor = 1\nserial_number = 1"),
            &["serial_number = 1: is already named by another axis"],
        ),
    ];
    for (extra, expected) in cases {
        let text = error(extra);
        assert!(expected.iter().all(|part| text.contains(part)), "{extra}:\n{text}");
    }
}

#[test]
fn jerk_limit_window_has_the_required_length() {
    assert_eq!(window_ticks(400.0, 40_000.0, Nanos::from_millis(1)), 20);
    assert_eq!(window_ticks(400.0, 39_000.0, Nanos::from_millis(1)), 21);
    assert_eq!(window_ticks(1.0, 1e9, Nanos::from_millis(1)), 1);
}

#[test]
fn joint_limit_lists_need_an_entry_per_angle() {
    let two = "[joint_limits]\nposition_min_deg = [-5.0, -5.0]\nposition_max_deg = [5.0]";
    let text = error(two);
    let wrong = "joint_limits.position_min_deg = [-5.0, -5.0]: must have 1 entries";
    assert!(text.contains(wrong), "{text}");
    assert!(!text.contains("joint_limits.position_max_deg"), "{text}");
}

#[test]
fn values_above_ceilings_are_all_reported_at_once() {
    let mut text = AXIS.replace("/dev/null\"", "/dev/null\"\nbaud = 115201");
    text.push_str(
        "current_limit_ma = 300000\nmotor_speed_rpm = 4000000000\n\
         following_error_counts = 4000000000\n\
         [limits]\nvelocity_counts_s = 1e300\nover_current_ma = 300000\n\
         feedback_stale_ms = 18446744073709551\n\
         [command]\nmax_step_deg = 1e9\n",
    );
    let error = Config::parse(&text, Path::new("robot.toml")).unwrap_err();
    let text = error.to_string();
    let keys = "motor_speed_rpm following_error_counts limits.velocity_counts_s \
                limits.over_current_ma limits.feedback_stale_ms command.max_step_deg";
    let whole = ["baud = 115201", "current_limit_ma = 300000: must be above 0 and at most 2000"];
    for key in whole.into_iter().chain(keys.split(' ')) {
        assert!(text.contains(key), "{key}:\n{text}");
    }
}

#[test]
fn watches_that_are_off_are_reported() {
    let off = format!("{AXIS}\n[limits]\noverrun_ticks = 0\nover_current_ma = 0");
    let off = Config::parse(&off, Path::new("robot.toml")).unwrap();
    let sentences = [
        "limits.overrun_ticks = 0: late ticks are not a fault",
        "limits.over_current_ma = 0: only the drive limits the current",
    ];
    assert_eq!(off.disabled_monitors(), sentences);
    // What is off stays off in a copy of the file.
    assert_eq!(Config::parse(&toml::to_string(&off).unwrap(), Path::new("copy")).unwrap(), off);
    let mut on = Config::parse(AXIS, Path::new("robot.toml")).unwrap();
    on.ports[0].axes[0].current_limit_ma = 90;
    let sentence = "limits.over_current_ma = 90: the drive of motor 0 gives no more than 90 mA";
    assert_eq!(on.disabled_monitors(), [sentence]);
}

#[test]
fn values_and_files_are_checked_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    let control = "[control]\nrate_hz = 7\nmodel = \"absent.json\"";
    std::fs::write(&file, format!("{AXIS}\n{control}")).unwrap();
    let text = Config::load_and_check_files(&file).unwrap_err().to_string();
    assert!(text.contains("control.rate_hz = 7"), "{text}");
    assert!(text.contains("control.model") && text.contains("absent.json"), "{text}");
    // The watchdog and other programs that do not use the model read the file nevertheless.
    std::fs::write(&file, format!("{AXIS}\n[control]\nmodel = \"absent.json\"")).unwrap();
    assert!(Config::load(&file).is_ok());
}

#[test]
fn limits_of_time_follow_from_the_slowest_line() {
    let alone = Config::parse(AXIS, Path::new("robot.toml")).unwrap();
    let ages = |config: &Config| {
        [config.feedback_stale(), config.feedback_lost(), config.over_current_time()]
    };
    let [stale, lost, over_current] = ages(&alone);
    assert_eq!([stale, lost], [32, 96].map(Nanos::from_millis));
    assert_eq!(over_current, Nanos::from_millis(200), "a quick start");
    let mut shared = alone.clone();
    let axis = shared.ports[0].axes[0].clone();
    shared.ports[0].axes.extend([axis.clone(), axis]);
    let [stale, lost, over_current] = ages(&shared);
    assert_eq!([stale, lost], [62, 186].map(Nanos::from_millis));
    assert!((400..500).contains(&(over_current.0 / 1_000_000)), "two readings: {over_current:?}");
    // A long wait for replies makes no stop late.
    shared.ports[0].reply_timeout_ms = 500;
    assert_eq!(shared.feedback_stale(), stale);
    let found = |config: &Config, exchange: u64| {
        let findings = config.line_findings(&config.ports[0], Nanos::from_millis(exchange));
        findings.into_iter().map(|finding| finding.key).collect::<Vec<_>>()
    };
    assert_eq!(found(&alone, 2), [""; 0]);
    assert_eq!(found(&shared, 2), ["limits.feedback_stale_ms"]);
    // An adapter with the latency timer of the kernel.
    let late = ["limits.feedback_stale_ms", "limits.feedback_stale_ms", "reply_timeout_ms"];
    assert_eq!(found(&alone, 17), late);
}

#[test]
fn paths_are_relative_to_the_real_file_without_shell_expansion() {
    let folder = tempfile::tempdir().unwrap();
    let (real, link) = (folder.path().join("rig/robot.toml"), folder.path().join("robot.toml"));
    std::fs::create_dir_all(real.parent().unwrap()).unwrap();
    std::fs::write(&real, format!("record_folder = \"records\"\n{AXIS}")).unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    let records = real.canonicalize().unwrap().with_file_name("records");
    assert_eq!(Config::load(&link).unwrap().record_folder, records);
    for path in ["~/records", "$HOME/records"] {
        let text = format!("record_folder = \"{path}\"\n{AXIS}");
        let error = Config::parse(&text, Path::new("robot.toml")).unwrap_err().to_string();
        assert!(error.contains("record_folder"), "{error}");
        assert!(error.contains("write the full path"), "{error}");
    }
}

/// Target of a node, through references and "this or null".
fn resolved(root: &Value, node: &Value) -> Value {
    let reference = |node: &Value| Some(node.get("$ref")?.as_str()?.strip_prefix('#')?.to_owned());
    if let Some(path) = reference(node) {
        return resolved(root, root.pointer(&path).unwrap());
    }
    let choices = node.get("anyOf").and_then(Value::as_array);
    let some = choices.and_then(|it| it.iter().find(|it| it["type"] != "null"));
    some.map_or_else(|| node.clone(), |some| resolved(root, some))
}

/// Schema path of a bound's key, as `$defs/TABLE/properties/KEY`.
fn pointer(root: &Value, key: &str) -> String {
    let mut table = String::new();
    let mut path = String::new();
    for name in key.split('.') {
        path = format!("{table}/properties/{}", name.trim_end_matches("[]"));
        let mut inner = root.pointer(&path).unwrap_or_else(|| panic!("{key}")).clone();
        if name.ends_with("[]") {
            inner = resolved(root, &inner)["items"].clone();
        }
        let names = inner["$ref"].as_str().or_else(|| inner["anyOf"][0]["$ref"].as_str());
        table = names.map_or_else(String::new, |name| name.trim_start_matches('#').to_owned());
    }
    path
}

fn write_bound(root: &mut Value, Bound { key, low, high, .. }: &Bound) {
    let number = |value: f64| match value.fract() {
        0.0 => json!(value as i64),
        _ => json!(value),
    };
    let path = pointer(root, key);
    let node = root.pointer_mut(&path).and_then(Value::as_object_mut).unwrap();
    node.remove("minimum");
    let low_key = if low.is_some() { "minimum" } else { "exclusiveMinimum" };
    node.insert(low_key.to_owned(), number(low.unwrap_or(0.0)));
    node.insert("maximum".to_owned(), number(*high));
}

/// After a change: run this test with `I2RIS_UPDATE_SCHEMA=1` and commit the file.
#[test]
fn the_schema_file_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/schema/controller.json");
    let mut schema = Value::from(schemars::schema_for!(Config));
    for bound in BOUNDS {
        write_bound(&mut schema, bound);
    }
    let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
    if std::env::var_os("I2RIS_UPDATE_SCHEMA").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}
