//! Campaigns: numbers, not tests. Each prints a summary; how often is set by `I2RIS_CAMPAIGN`.
//!
//! ```text
//! cargo test --release --test hazards -- --ignored --nocapture --test-threads 1 campaign
//! ```

use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{OperatingStateMsg, PeriodStatistics, SpanSummary};
use i2ris::model::ModelId;
use i2ris::rt::{self, LoopStatistics, TickTiming, Ticker, Wanted};
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

/// A rig as a robot would be run: the loop real-time if the system allows it, the deadline of the configuration.
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
        client.wait_for(PATIENCE, |state| state.accepted > before.accepted + 60).unwrap();
        commander.kill().unwrap();
        let killed = clock::now();
        commander.wait().unwrap();
        client.wait_for(PATIENCE, |state| state.flags & OperatingStateMsg::HOLDING != 0).unwrap();
        clock::sleep(Nanos::from_millis(100));
        let setpoints = rig.setpoints(0);
        let moved = setpoints.windows(2).rev().find(|pair| pair[0].1 != pair[1].1);
        if let Some(pair) = moved.filter(|pair| pair[1].0 > killed) {
            after_kill.push((pair[1].0 - killed).as_seconds() * 1e3);
        } else {
            steps += 1;
        }
        // The next one begins where the snake is: at zero, as its path does.
        client.wait_for(PATIENCE, |state| state.lease_client_id == 0).unwrap();
        bring_back(&mut client);
    }
    let deadline = rig.config.command.deadline_ms;
    println!(
        "deadline {deadline} ms, tick 1 ms, a set-point on the wire every 5 ms; {steps} stood already when killed"
    );
    summary("last set-point that moved, after the kill", "ms", &mut after_kill);
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
            goal.iter_mut().for_each(|counts| *counts -= (*counts).clamp(-5, 5));
            commander.servo_actuators(goal).unwrap();
        }
        clock::sleep(Nanos::from_millis(5));
    }
    client.state_command(StateCommand::Release).unwrap();
}

#[test]
#[ignore = "a campaign"]
fn campaign_swaps() {
    let mut rig = rig();
    linear_model(&rig, "model.json", "rig", 1.0);
    let second = linear_model(&rig, "second.json", "rig", 1.2);
    rig.config.control.model = Some("model.json".into());
    let client = rig.enabled();
    let mut operator = Client::connect(&rig.domain(), PATIENCE).unwrap();
    let done = AtomicBool::new(false);
    let mut statistics = client.watcher().period_statistics();
    let count = times(1000);
    let mut answer = Vec::new();
    let (largest, pairs) = std::thread::scope(|scope| {
        let watch = scope.spawn(|| largest_step(&client, &done));
        scope.spawn(|| {
            stream_angles(&client, |t| {
                (!done.load(Ordering::Relaxed)).then(|| [6.0 * (2.0 * t).sin(), 4.0 * (1.3 * t).sin()])
            });
        });
        let end = SetAtEnd(&done);
        let staged = operator.stage_model(&second).unwrap().slots[1].model_id;
        operator.activate_model(ModelId(staged), false).unwrap();
        for _ in 1..count {
            let asked = Instant::now();
            operator.roll_back_model(false).unwrap();
            answer.push(asked.elapsed().as_secs_f64() * 1e3);
            clock::sleep(Nanos::from_millis(20));
        }
        drop(end);
        watch.join().unwrap()
    });
    let missed = last(&mut statistics);
    let limit = rig.config.limits.velocity_counts_s * rig.config.control.period().as_seconds();
    println!(
        "{count} swaps during motion: largest set-point step {largest} counts a tick in {pairs} ticks, {limit} allowed"
    );
    println!("ticks {}, missed {}", missed.total_ticks, missed.total_missed);
    summary("from asking to answer", "ms", &mut answer);
}

fn last(statistics: &mut i2ris::ipc::client::Subscription<PeriodStatistics>) -> PeriodStatistics {
    let start = clock::now();
    loop {
        if let Some(message) = statistics.newest().unwrap() {
            return message;
        }
        assert!(clock::now().since(start) < PATIENCE, "no statistics");
        clock::sleep(Nanos::from_millis(20));
    }
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
        settle(&mut client, |state| state.state == 0 && state.flags & OperatingStateMsg::HOMED != 0);
        there.push(start.elapsed().as_secs_f64());
        enable(&mut client);
        enabled.push(start.elapsed().as_secs_f64());
    }
    summary("from start to DISABLED, homed, and known to an old client", "s", &mut there);
    summary("from start to ENABLED", "s", &mut enabled);
}

/// The loop of the controller beside one that does nothing, under the same scheduling, in the same minute.
#[test]
#[ignore = "a campaign"]
fn campaign_bare_loop() {
    let mut rig = rig();
    let client = rig.enabled();
    let seconds = u64::from(times(60));
    let mut statistics = client.watcher().period_statistics();
    let config = rig.config.control.clone();
    let bare = std::thread::spawn(move || {
        let wanted = Wanted { priority: config.priority, cpu: None, lock_memory: false };
        let granted = rt::request(wanted);
        let (period, spin) = (config.period(), Nanos::from_micros(u64::from(config.spin_us)));
        let window = Nanos::from_millis(seconds * 1000);
        let mut ticker = Ticker::new(clock::now() + period, period, spin);
        let mut statistics = LoopStatistics::new(period, window, granted);
        loop {
            let tick = ticker.wait();
            statistics.record(TickTiming { tick, ended: clock::now() });
            if let Some(message) = statistics.take(clock::now()) {
                return message;
            }
        }
    });
    let mut windows = Vec::new();
    while !bare.is_finished() {
        statistics.drain(|message| windows.push(message)).unwrap();
        clock::sleep(Nanos::from_millis(100));
    }
    let bare = bare.join().unwrap();
    let worst = |of: fn(&PeriodStatistics) -> u64| windows.iter().map(of).max().unwrap_or(0);
    println!(
        "bare loop, {seconds} s, priority {}: {} missed, lateness {}",
        bare.priority,
        bare.missed,
        spans(&bare.lateness)
    );
    println!(
        "controller, worst of {} windows of 1 s, priority {}: lateness p50 {:.1}, p99 {:.1}, max {:.1} us; compute p99 {:.1}, max {:.1} us",
        windows.len(),
        windows.last().map_or(0, |window| window.priority),
        worst(|w| w.lateness.p50_ns) as f64 / 1e3,
        worst(|w| w.lateness.p99_ns) as f64 / 1e3,
        worst(|w| w.lateness.max_ns) as f64 / 1e3,
        worst(|w| w.compute.p99_ns) as f64 / 1e3,
        worst(|w| w.compute.max_ns) as f64 / 1e3,
    );
    println!("controller missed {}", windows.iter().map(|window| window.missed).sum::<u64>());
}

fn spans(spans: &SpanSummary) -> String {
    let us = |ns: u64| ns as f64 / 1e3;
    format!("p50 {:.1}, p99 {:.1}, max {:.1} us", us(spans.p50_ns), us(spans.p99_ns), us(spans.max_ns))
}
