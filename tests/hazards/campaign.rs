//! Campaigns: measurements, not tests. Each prints a summary; `I2RIS_CAMPAIGN` sets the number of
//! repetitions.
//!
//! ```text
//! cargo test --release --test hazards -- --ignored --nocapture --test-threads 1 campaign
//! ```

use std::io::{Seek, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use i2ris::clock;
use i2ris::config::ControlConfig;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{OperatingStateMsg, PeriodStatistics};
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris::model::ModelId;
use i2ris::realtime::{self, LoopStatistics, TickTiming, Ticker, Wanted};
use i2ris::units::Nanos;
use nix::sys::signal::Signal;

use crate::h02::spawn_commander;
use crate::rig::motion::{
    SEND_PERIOD, SetOnDrop, largest_step, linear_model, rig_with_model, stream_angles,
    swing_angles_until,
};
use crate::rig::{Rig, TIMEOUT, enable, has, settle, wait_for, wait_until_holding};

/// The number of repetitions, or `usual`.
fn times(usual: u32) -> u32 {
    std::env::var("I2RIS_CAMPAIGN").map_or(usual, |times| times.parse().unwrap())
}

/// The value at a fraction of sorted values.
fn quantile(sorted: &[f64], fraction: f64) -> f64 {
    let last = sorted.len().saturating_sub(1) as f64;
    sorted.get((last * fraction).round() as usize).copied().unwrap_or(f64::NAN)
}

fn print_summary(what: &str, unit: &str, values: &mut [f64]) {
    values.sort_by(f64::total_cmp);
    let [median, p90, largest] = [0.5, 0.9, 1.0].map(|fraction| quantile(values, fraction));
    println!(
        "{what}: {} times, median {median:.2} {unit}, 90 % {p90:.2} {unit}, largest {largest:.2} \
         {unit}",
        values.len(),
    );
}

/// Runs a rig as a robot would be run: the loop real-time if the system allows it, the default
/// deadline.
fn as_robot(mut rig: Rig) -> Rig {
    rig.config.control.priority = 80;
    rig.config.control.spin_us = 100;
    rig.config.control.lock_memory = true;
    rig.config.command.deadline_ms = 50;
    rig
}

#[test]
#[ignore = "a campaign"]
fn campaign_kills() {
    let mut rig = as_robot(Rig::new());
    let mut client = rig.enabled();
    let (mut after_kill, mut constant) = (Vec::new(), 0);
    for _ in 0..times(200) {
        let before = wait_for(&mut client, |_| true);
        let mut commander = spawn_commander(&rig.config.ipc.domain);
        wait_for(&mut client, |state| state.accepted > before.accepted + 60);
        commander.kill().unwrap();
        let killed = clock::now();
        commander.wait().unwrap();
        wait_until_holding(&mut client);
        clock::sleep(Nanos::from_millis(100));
        let setpoints = rig.setpoints(0);
        let last_motion = setpoints.windows(2).rev().find(|pair| pair[0].1 != pair[1].1);
        match last_motion.map(|pair| pair[1].0).filter(|stamp| *stamp > killed) {
            Some(stamp) => after_kill.push((stamp - killed).as_seconds() * 1e3),
            None => constant += 1,
        }
        // The next commander begins at zero.
        wait_for(&mut client, |state| state.lease_client_id == 0);
        return_to_zero(&mut client);
    }
    let deadline = rig.config.command.deadline_ms;
    println!(
        "deadline {deadline} ms, tick 1 ms, a setpoint on the wire every 5 ms; {constant} were \
         constant already when killed"
    );
    print_summary("last setpoint that moved, after the kill", "ms", &mut after_kill);
}

/// Moves both motors to zero, in small steps.
fn return_to_zero(client: &mut Client) {
    let (mut commander, mut actuators) = (client.commander(), client.watcher().actuators());
    let start = clock::now();
    let mut goal = None::<[i32; 2]>;
    while goal != Some([0, 0]) && clock::now().since(start) < TIMEOUT {
        goal = goal.or(actuators.newest().unwrap().map(|message| message.setpoint_counts));
        if let Some(goal) = &mut goal {
            *goal = goal.map(|counts| counts - counts.clamp(-5, 5));
            commander.servo_actuators(goal).unwrap();
        }
        clock::sleep(SEND_PERIOD);
    }
    client.state_command(StateCommand::Release).unwrap();
}

/// Blocks of swaps and blocks of the same motion without swaps, in turn, beside an idle loop.
#[test]
#[ignore = "a campaign"]
fn campaign_swaps() {
    const BLOCK: u32 = 200;
    let mut rig = as_robot(rig_with_model());
    let second = linear_model(&rig, "second.json", "rig", 1.2);
    let client = rig.enabled();
    let mut operator = Client::connect(&rig.domain(), TIMEOUT).unwrap();
    let done = AtomicBool::new(false);
    let (mut replies, mut blocks) = (Vec::new(), Vec::new());
    let ((largest, pairs), idle, windows) = std::thread::scope(|scope| {
        let steps = scope.spawn(|| largest_step(&client, &done));
        let idle = scope.spawn(|| idle_loop(&rig.config.control, &done));
        let windows = scope.spawn(|| all_windows(&client, &done));
        scope.spawn(|| stream_angles(&client, swing_angles_until(&done)));
        let end = SetOnDrop(&done);
        let staged = operator.stage_model(&second).unwrap().slots[1].model_id;
        operator.activate_model(ModelId(staged), false).unwrap();
        for _ in 0..times(1000).div_ceil(BLOCK) {
            let begun = clock::now();
            for _ in 0..BLOCK {
                let requested = Instant::now();
                operator.roll_back_model(false).unwrap();
                replies.push(requested.elapsed().as_secs_f64() * 1e3);
                clock::sleep(Nanos::from_millis(20));
            }
            let ended = clock::now();
            clock::sleep(ended.since(begun));
            blocks.push([begun, ended, clock::now()]);
        }
        drop(end);
        (steps.join().unwrap(), idle.join().unwrap(), windows.join().unwrap())
    });
    let limit = rig.config.limits.velocity_counts_s * rig.config.control.period().as_seconds();
    println!(
        "{} swaps during motion: largest setpoint step {largest} counts a tick in {pairs} ticks, \
         {limit} allowed",
        replies.len()
    );
    print_summary("from request to reply", "ms", &mut replies);
    for (what, part) in [("with swaps", 0), ("without", 1)] {
        let is_inside = |window: &&PeriodStatistics| {
            let end = Nanos(window.stamp_ns);
            let begin = Nanos(window.stamp_ns - window.window_ns);
            blocks.iter().any(|block| begin >= block[part] && end <= block[part + 1])
        };
        print_windows(&format!("controller, {what}"), windows.iter().filter(is_inside));
    }
    print_windows("idle loop beside it", idle.iter());
}

/// All period statistics until `done`.
fn all_windows(client: &Client, done: &AtomicBool) -> Vec<PeriodStatistics> {
    let (mut statistics, mut windows) = (client.watcher().period_statistics(), Vec::new());
    while !done.load(Ordering::Relaxed) {
        statistics.drain(|message| windows.push(message)).unwrap();
        clock::sleep(Nanos::from_millis(100));
    }
    windows
}

/// Statistics of a loop that does nothing, scheduled as the controller's, until `done`.
fn idle_loop(config: &ControlConfig, done: &AtomicBool) -> Vec<PeriodStatistics> {
    let granted =
        realtime::request(Wanted { priority: config.priority, cpu: None, lock_memory: false });
    let (period, spin) = (config.period(), Nanos::from_micros(u64::from(config.spin_us)));
    let mut ticker = Ticker::new(clock::now() + period, period, spin);
    let mut statistics = LoopStatistics::new(period, Nanos::from_millis(1000), granted);
    let mut windows = Vec::with_capacity(4096);
    while !done.load(Ordering::Relaxed) {
        let tick = ticker.wait();
        let ended = clock::now();
        statistics.record(TickTiming { tick, ended });
        windows.extend(statistics.take(clock::now()));
    }
    windows
}

/// Prints one line about the windows of a loop: median and maximum over the windows.
fn print_windows<'a>(what: &str, windows: impl Iterator<Item = &'a PeriodStatistics>) {
    let windows: Vec<_> = windows.collect();
    let ticks: u64 = windows.iter().map(|window| window.ticks).sum();
    let missed: u64 = windows.iter().map(|window| window.missed).sum();
    let us = |of: fn(&PeriodStatistics) -> u64| {
        let mut values: Vec<f64> = windows.iter().map(|window| of(window) as f64 / 1e3).collect();
        values.sort_by(f64::total_cmp);
        format!("{:.1} ({:.1})", quantile(&values, 0.5), quantile(&values, 1.0))
    };
    println!(
        "{what}: priority {}, {ticks} ticks, {missed} missed ({:.2} %); us, median of {} windows \
         (largest): lateness p50 {}, p99 {}, max {}; compute p50 {}, p99 {}, max {}",
        windows.last().map_or(0, |window| window.priority),
        100.0 * missed as f64 / (ticks + missed).max(1) as f64,
        windows.len(),
        us(|window| window.lateness.p50_ns),
        us(|window| window.lateness.p99_ns),
        us(|window| window.lateness.max_ns),
        us(|window| window.compute.p50_ns),
        us(|window| window.compute.p99_ns),
        us(|window| window.compute.max_ns),
    );
}

#[test]
#[ignore = "a campaign"]
fn campaign_restarts() {
    let mut rig = as_robot(Rig::new());
    let mut client = rig.enabled();
    let (mut ready, mut enabled) = (Vec::new(), Vec::new());
    for _ in 0..times(100) {
        rig.signal(Signal::SIGKILL);
        rig.wait_for_end();
        let start = Instant::now();
        rig.start_controller();
        rig.client();
        settle(&mut client, |state| {
            let disabled = state.state == OperatingState::Disabled.number();
            disabled && has(state, OperatingStateMsg::HOMED)
        });
        ready.push(start.elapsed().as_secs_f64());
        enable(&mut client);
        enabled.push(start.elapsed().as_secs_f64());
    }
    let what = "from start to DISABLED, homed, and connected to an old client";
    print_summary(what, "s", &mut ready);
    print_summary("from start to ENABLED", "s", &mut enabled);
}

/// The loop of the controller with a model and a moving snake, beside an idle loop with the same
/// scheduling, while one thread per CPU copies memory and writes files. Seconds in
/// `I2RIS_CAMPAIGN`.
#[test]
#[ignore = "a campaign"]
fn campaign_loop() {
    let mut rig = as_robot(rig_with_model());
    let client = rig.enabled();
    let seconds = u64::from(times(600));
    let done = AtomicBool::new(false);
    let (idle, windows) = std::thread::scope(|scope| {
        let idle = scope.spawn(|| idle_loop(&rig.config.control, &done));
        let windows = scope.spawn(|| all_windows(&client, &done));
        scope.spawn(|| stream_angles(&client, swing_angles_until(&done)));
        for _ in 0..std::thread::available_parallelism().unwrap().get() {
            scope.spawn(|| load(&done));
        }
        let end = SetOnDrop(&done);
        clock::sleep(Nanos::from_millis(1000 * seconds));
        drop(end);
        (idle.join().unwrap(), windows.join().unwrap())
    });
    print_windows("idle loop", idle.iter());
    print_windows("controller", windows.iter());
}

/// Loads a CPU, its memory and the file system.
fn load(done: &AtomicBool) {
    let mut file = tempfile::tempfile().unwrap();
    let from = vec![1_u8; 16 << 20];
    let mut to = vec![0_u8; from.len()];
    while !done.load(Ordering::Relaxed) {
        to.copy_from_slice(&from);
        file.set_len(0).unwrap();
        file.rewind().unwrap();
        file.write_all(&to[..1 << 20]).unwrap();
    }
}
