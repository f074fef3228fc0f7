//! Campaigns: numbers, not tests. Each prints a summary; how often is set by `I2RIS_CAMPAIGN`.
//!
//! ```text
//! cargo test --release --test hazards -- --ignored --nocapture --test-threads 1 campaign
//! ```

use std::io::{Seek, Write};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use i2ris::clock;
use i2ris::config::ControlConfig;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{OperatingStateMsg, PeriodStatistics};
use i2ris::model::ModelId;
use i2ris::realtime::{self, LoopStatistics, TickTiming, Ticker, Wanted};
use i2ris::units::Nanos;
use nix::sys::signal::Signal;

use crate::live::{SetAtEnd, largest_step, linear_model, stream_angles};
use crate::rig::{PATIENCE, Rig, enable, settle};

/// How often, or `usual`.
fn times(usual: u32) -> u32 {
    std::env::var("I2RIS_CAMPAIGN").map_or(usual, |times| times.parse().unwrap())
}

fn summary(what: &str, unit: &str, values: &mut [f64]) {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
    println!(
        "{what}: {} times, median {:.2} {unit}, 90 % {:.2} {unit}, largest {:.2} {unit}",
        values.len(),
        at(0.5),
        at(0.9),
        at(1.0)
    );
}

/// A rig as a robot would be run: the loop real-time if the system allows it, the deadline of the
/// configuration.
fn rig() -> Rig {
    let mut rig = Rig::new();
    rig.config.control.priority = 80;
    rig.config.control.spin_us = 100;
    rig.config.control.lock_memory = true;
    rig.config.command.deadline_ms = 50;
    rig
}

#[test]
#[ignore = "a campaign"]
fn campaign_kills() {
    let mut rig = rig();
    let mut client = rig.enabled();
    let (mut after_kill, mut steps) = (Vec::new(), 0);
    for _ in 0..times(200) {
        let before = client.wait_for(PATIENCE, |_| true).unwrap();
        let mut commander = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "h02::commander_process"])
            .env("RIG_DOMAIN", &rig.config.ipc.domain)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        client
            .wait_for(PATIENCE, |state| state.accepted > before.accepted + 60)
            .unwrap();
        commander.kill().unwrap();
        let killed = clock::now();
        commander.wait().unwrap();
        client
            .wait_for(PATIENCE, |state| {
                state.flags & OperatingStateMsg::HOLDING != 0
            })
            .unwrap();
        clock::sleep(Nanos::from_millis(100));
        let setpoints = rig.setpoints(0);
        let moved = setpoints
            .windows(2)
            .rev()
            .find(|pair| pair[0].1 != pair[1].1);
        if let Some(pair) = moved.filter(|pair| pair[1].0 > killed) {
            after_kill.push((pair[1].0 - killed).as_seconds() * 1e3);
        } else {
            steps += 1;
        }
        // The next one begins where the snake is: at zero, as its path does.
        client
            .wait_for(PATIENCE, |state| state.lease_client_id == 0)
            .unwrap();
        bring_back(&mut client);
    }
    let deadline = rig.config.command.deadline_ms;
    println!(
        "deadline {deadline} ms, tick 1 ms, a set-point on the wire every 5 ms; {steps} stood already when killed"
    );
    summary(
        "last set-point that moved, after the kill",
        "ms",
        &mut after_kill,
    );
}

/// Both motors to zero, in small steps.
fn bring_back(client: &mut Client) {
    let (mut commander, mut actuators) = (client.commander(), client.watcher().actuators());
    let start = clock::now();
    let mut goal = None::<[i32; 2]>;
    while goal != Some([0, 0]) && clock::now().since(start) < PATIENCE {
        if let (None, Some(message)) = (goal, actuators.newest().unwrap()) {
            goal = Some(message.setpoint_counts);
        }
        if let Some(goal) = &mut goal {
            goal.iter_mut()
                .for_each(|counts| *counts -= (*counts).clamp(-5, 5));
            commander.servo_actuators(goal).unwrap();
        }
        clock::sleep(Nanos::from_millis(5));
    }
    client.state_command(StateCommand::Release).unwrap();
}

/// Blocks of swaps and blocks of the same motion without, in turns, beside a loop that does
/// nothing.
#[test]
#[ignore = "a campaign"]
fn campaign_swaps() {
    const BLOCK: u32 = 200;
    let mut rig = rig();
    linear_model(&rig, "model.json", "rig", 1.0);
    let second = linear_model(&rig, "second.json", "rig", 1.2);
    rig.config.control.model = Some("model.json".into());
    let client = rig.enabled();
    let mut operator = Client::connect(&rig.domain(), PATIENCE).unwrap();
    let done = AtomicBool::new(false);
    let (mut answer, mut blocks) = (Vec::new(), Vec::new());
    let ((largest, pairs), bare, windows) = std::thread::scope(|scope| {
        let watch = scope.spawn(|| largest_step(&client, &done));
        let bare = scope.spawn(|| bare_loop(&rig.config.control, &done));
        let windows = scope.spawn(|| all_windows(&client, &done));
        scope.spawn(|| {
            stream_angles(&client, |t| {
                (!done.load(Ordering::Relaxed))
                    .then(|| [6.0 * (2.0 * t).sin(), 4.0 * (1.3 * t).sin()])
            });
        });
        let end = SetAtEnd(&done);
        let staged = operator.stage_model(&second).unwrap().slots[1].model_id;
        operator.activate_model(ModelId(staged), false).unwrap();
        for _ in 0..times(1000).div_ceil(BLOCK) {
            let begun = clock::now();
            for _ in 0..BLOCK {
                let asked = Instant::now();
                operator.roll_back_model(false).unwrap();
                answer.push(asked.elapsed().as_secs_f64() * 1e3);
                clock::sleep(Nanos::from_millis(20));
            }
            let ended = clock::now();
            clock::sleep(ended.since(begun));
            blocks.push([begun, ended, clock::now()]);
        }
        drop(end);
        (
            watch.join().unwrap(),
            bare.join().unwrap(),
            windows.join().unwrap(),
        )
    });
    let limit = rig.config.limits.velocity_counts_s * rig.config.control.period().as_seconds();
    println!(
        "{} swaps during motion: largest set-point step {largest} counts a tick in {pairs} ticks, {limit} allowed",
        answer.len()
    );
    summary("from asking to answer", "ms", &mut answer);
    for (what, part) in [("with swaps", 0), ("without", 1)] {
        let inside = |window: &&PeriodStatistics| {
            let (end, begin) = (
                Nanos(window.stamp_ns),
                Nanos(window.stamp_ns - window.window_ns),
            );
            blocks
                .iter()
                .any(|block| begin >= block[part] && end <= block[part + 1])
        };
        tell(
            &format!("controller, {what}"),
            windows.iter().filter(inside),
        );
    }
    tell("bare loop beside it", bare.iter());
}

/// Everything that is published about the loop until told to end.
fn all_windows(client: &Client, done: &AtomicBool) -> Vec<PeriodStatistics> {
    let (mut statistics, mut windows) = (client.watcher().period_statistics(), Vec::new());
    while !done.load(Ordering::Relaxed) {
        statistics.drain(|message| windows.push(message)).unwrap();
        clock::sleep(Nanos::from_millis(100));
    }
    windows
}

/// A loop that does nothing, scheduled as the controller's, until told to end.
fn bare_loop(config: &ControlConfig, done: &AtomicBool) -> Vec<PeriodStatistics> {
    let granted = realtime::request(Wanted {
        priority: config.priority,
        cpu: None,
        lock_memory: false,
    });
    let (period, spin) = (
        config.period(),
        Nanos::from_micros(u64::from(config.spin_us)),
    );
    let mut ticker = Ticker::new(clock::now() + period, period, spin);
    let mut statistics = LoopStatistics::new(period, Nanos::from_millis(1000), granted);
    let mut windows = Vec::with_capacity(4096);
    while !done.load(Ordering::Relaxed) {
        let tick = ticker.wait();
        statistics.record(TickTiming {
            tick,
            ended: clock::now(),
        });
        windows.extend(statistics.take(clock::now()));
    }
    windows
}

/// One line about the windows of a loop: medians of the medians, the worst of the rest.
fn tell<'a>(what: &str, windows: impl Iterator<Item = &'a PeriodStatistics>) {
    let windows: Vec<_> = windows.collect();
    let sum =
        |of: fn(&PeriodStatistics) -> u64| windows.iter().map(|window| of(window)).sum::<u64>();
    let (ticks, missed) = (sum(|window| window.ticks), sum(|window| window.missed));
    let us = |share: f64, of: fn(&PeriodStatistics) -> u64| {
        let mut values: Vec<u64> = windows.iter().map(|window| of(window)).collect();
        values.sort_unstable();
        let last = values.len().saturating_sub(1) as f64;
        values
            .get((last * share).round() as usize)
            .map_or(f64::NAN, |ns| *ns as f64 / 1e3)
    };
    println!(
        "{what}: priority {}, {ticks} ticks, {missed} missed ({:.2} %); us, median of {} windows (largest): lateness p50 \
         {:.1} ({:.1}), p99 {:.1} ({:.1}), max {:.1} ({:.1}); compute p50 {:.1}, p99 {:.1} ({:.1}), max {:.1} ({:.1})",
        windows.last().map_or(0, |window| window.priority),
        100.0 * missed as f64 / (ticks + missed).max(1) as f64,
        windows.len(),
        us(0.5, |w| w.lateness.p50_ns),
        us(1.0, |w| w.lateness.p50_ns),
        us(0.5, |w| w.lateness.p99_ns),
        us(1.0, |w| w.lateness.p99_ns),
        us(0.5, |w| w.lateness.max_ns),
        us(1.0, |w| w.lateness.max_ns),
        us(0.5, |w| w.compute.p50_ns),
        us(0.5, |w| w.compute.p99_ns),
        us(1.0, |w| w.compute.p99_ns),
        us(0.5, |w| w.compute.max_ns),
        us(1.0, |w| w.compute.max_ns),
    );
}

#[test]
#[ignore = "a campaign"]
fn campaign_restarts() {
    let mut rig = rig();
    let mut client = rig.enabled();
    let (mut there, mut enabled) = (Vec::new(), Vec::new());
    for _ in 0..times(100) {
        rig.signal(Signal::SIGKILL);
        rig.wait_for_end();
        let start = Instant::now();
        rig.start_controller();
        rig.client();
        settle(&mut client, |state| {
            state.state == 0 && state.flags & OperatingStateMsg::HOMED != 0
        });
        there.push(start.elapsed().as_secs_f64());
        enable(&mut client);
        enabled.push(start.elapsed().as_secs_f64());
    }
    summary(
        "from start to DISABLED, homed, and known to an old client",
        "s",
        &mut there,
    );
    summary("from start to ENABLED", "s", &mut enabled);
}

/// The loop of the controller with a model and a moving snake, beside one that does nothing under
/// the same scheduling, while as many threads as there are processors copy memory and write files.
/// Seconds in `I2RIS_CAMPAIGN`.
#[test]
#[ignore = "a campaign"]
fn campaign_loop() {
    let mut rig = rig();
    linear_model(&rig, "model.json", "rig", 1.0);
    rig.config.control.model = Some("model.json".into());
    let client = rig.enabled();
    let seconds = f64::from(times(600));
    let done = AtomicBool::new(false);
    let (bare, windows) = std::thread::scope(|scope| {
        let bare = scope.spawn(|| bare_loop(&rig.config.control, &done));
        let windows = scope.spawn(|| all_windows(&client, &done));
        for _ in 0..std::thread::available_parallelism().unwrap().get() {
            scope.spawn(|| load(&done));
        }
        let _end = SetAtEnd(&done);
        stream_angles(&client, |t| {
            (t < seconds).then(|| [6.0 * (2.0 * t).sin(), 4.0 * (1.3 * t).sin()])
        });
        done.store(true, Ordering::Relaxed);
        (bare.join().unwrap(), windows.join().unwrap())
    });
    tell("bare loop", bare.iter());
    tell("controller", windows.iter());
}

/// Keeps a processor, its memory and the file system busy.
fn load(done: &AtomicBool) {
    let mut file = tempfile::tempfile().unwrap();
    let from = vec![1_u8; 16 << 20];
    let mut to = vec![0_u8; from.len()];
    while !done.load(Ordering::Relaxed) {
        to.copy_from_slice(&from);
        file.set_len(0)
            .and_then(|()| file.rewind())
            .and_then(|()| file.write_all(&to[..1 << 20]))
            .unwrap();
    }
}
