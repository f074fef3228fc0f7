//! `i2ris command motor` on emulated drives: no model, no camera, and an unknown zero.

use std::sync::atomic::Ordering;

use i2ris::clock;
use i2ris_testing::bench::{ends, expect_stalls, fails, start, succeeds};
use i2ris_testing::{Rig, Terminal, wait_until};

fn robot() -> Rig {
    let mut rig = Rig::start();
    expect_stalls(&mut rig);
    // 25 counts.
    rig.config.command.first_step_deg = 0.1 * rig.config.command.max_step_deg;
    rig.camera_is_shut.store(true, Ordering::Relaxed);
    rig.start_controller_thread();
    rig.client();
    rig
}

fn first_number(line: &str) -> Option<i32> {
    line.split_whitespace().next()?.parse().ok()
}

#[test]
fn motor_moves_a_few_counts_and_returns() {
    let rig = robot();
    let domain = rig.domain();
    let begin = clock::now();
    for (words, code, part) in [
        ("0 20", 1, "--enable"),
        ("0 20 --enable", 4, "not homed"),
        ("0 101 --home", 2, "1 to 100 counts"),
        ("2 20 --home", 1, "there are 2, from 0"),
    ] {
        fails(&domain, &format!("command motor {words}"), code, &[part]);
    }
    assert!(!rig.moved_since(begin), "nothing moves before it is permitted");
    let origin = rig.emulator.snapshot().axes.map(|axis| axis.drive.motor_counts);
    for (motor, counts, permission) in [(0, 20, "--home"), (1, -20, "--enable")] {
        let result = succeeds(&domain, &format!("command motor {motor} {counts} {permission}"));
        let targets: Vec<i32> = result.lines().filter_map(first_number).collect();
        // The exit code shows that each target was reached.
        assert_eq!(targets, [counts / 2, counts, counts / 2, 0], "{result}");
        let now = rig.emulator.snapshot().axes.map(|axis| axis.drive.motor_counts);
        let off = [0, 1].map(|axis| (now[axis] - origin[axis]).abs());
        assert!(off.iter().all(|off| *off <= 3.0), "both are where they began: {off:?}");
        let written = rig.setpoints(motor).into_iter().map(|(_, to)| to);
        let (low, high) = (counts.min(0), counts.max(0));
        let written: Vec<i32> = written.filter(|to| *to < low - 2 || *to > high + 2).collect();
        assert!(written.is_empty(), "not beyond the target: {written:?}");
    }
}

#[test]
fn a_person_types_yes_and_ctrl_c_holds() {
    let rig = robot();
    let domain = rig.domain();
    for (typed, end) in [("no\n", "nothing has moved"), ("yes\n", "    0 ")] {
        let mut terminal = Terminal::start(&domain, &["command", "motor", "0", "-20"], 30, 100);
        terminal.wait_for("Type yes.");
        assert!(
            rig.setpoints(0).windows(2).all(|pair| pair[0].1 == pair[1].1),
            "no motion before permission"
        );
        terminal.type_keys(typed);
        terminal.wait_for(end);
        assert_eq!(terminal.end().success(), typed == "yes\n");
    }
    let mut program = start(&domain, "command motor 0 100 --enable");
    wait_until("it is under way", || rig.positions()[0] > 20);
    program.interrupt();
    ends(program, 1, &["interrupted", "holds"]);
    rig.wait_until_still();
    assert!(rig.positions()[0] < 95, "it stopped on its way");
    assert!(rig.emulator.snapshot().axes[0].drive.state.is_powered());
}
