//! The examples for programs of others run as they are printed.

use i2ris_testing::program::example;

use super::*;

#[test]
fn examples_stream_a_circle_and_swap_a_model() {
    let mut rig = Rig::with_model();
    let second = rig.sample_model("second.json", "rig", 1.3);
    let mut client = rig.enabled();
    client.carry_out(StateCommand::Condition, || false).unwrap();
    let domain = rig.domain();

    let circle = example("stream_circle", &[domain.name()]);
    let pitch = circle.lines().map(|line| {
        let (_, rest) = line.split_once("pitch ").unwrap();
        rest.split(' ').next().unwrap().parse::<f64>().unwrap()
    });
    let (least, most) = pitch.fold((f64::MAX, f64::MIN), |(a, b), it: f64| (a.min(it), b.max(it)));
    assert!((3.0..4.5).contains(&(most - least)), "{circle}");

    let swap = example("swap_model", &[second.to_str().unwrap(), domain.name()]);
    let [new, active, again] = swap.lines().collect::<Vec<_>>()[..] else { panic!("{swap}") };
    let (new, old) = new.split_once(" instead of ").unwrap();
    assert_eq!((active, again), (&*format!("active: {new}"), &*format!("active: {old}")));
}

#[test]
fn example_converts_counts_and_angles_without_a_robot() {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/adaptation/force-balance.json");
    let lines = example("model_without_robot", &[model]);
    let lines: Vec<&str> = lines.lines().collect();
    assert_eq!(lines.len(), 9, "{lines:?}");
    // The same counts up and down, at other angles: hysteresis.
    assert_ne!(lines[3], lines[5], "{lines:?}");
}
