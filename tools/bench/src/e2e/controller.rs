//! The controller as a process, as with a real robot; and a client that publishes commands at
//! random instants and records encoder positions, to the controller and to the floor.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::Ordering;
use std::{fs, thread};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::{Client, Commander, Subscription};
use i2ris::ipc::payload::{ActuatorState, OperatingStateMsg};
use i2ris::ipc::{Domain, DomainLock, StateCommand, random_id};
use i2ris::realtime::Granted;
use i2ris::units::Nanos;
use i2ris_report::process::Process;

use super::matching::{CommandLatencies, Observations, Written, match_commands};
use super::{BareLoop, DriveRig, EndToEndBenchmark, READ_PERIOD, program};
use crate::control_loop::CONFIG;
use crate::inverse::model;
use crate::machine::{Run, describe, in_thread, request_priority};
use crate::{Failure, panicked};

/// Limit for operations that take much less than a second on an idle machine.
pub const TIMEOUT: Nanos = Nanos::from_millis(20_000);
/// Reply timeout of a drive. It is long because a stalled machine must not cause a fault.
const REPLY_TIMEOUT_MS: u64 = 1000;
/// Default deadline of commands. It is long for the same reason.
const DEADLINE_MS: u64 = 500;
/// The loop sends its statistics once a second.
const STATISTICS_TIMEOUT: Nanos = Nanos::from_millis(2500);

pub struct Controller {
    pub client: Client,
    process: Process,
    // Dropped last.
    pub domain: OwnDomain,
}

/// A domain whose shared memory is removed at the end, also after a failure of the controller.
pub struct OwnDomain(pub Domain);

impl Drop for OwnDomain {
    fn drop(&mut self) {
        drop(DomainLock::acquire(&self.0));
    }
}

impl Controller {
    /// Starts the controller with the drives of a rig, homes and enables.
    pub fn start(rig: &DriveRig, run: Run) -> Result<Self, Failure> {
        let domain = OwnDomain(Domain::new(&format!("bench-{:08x}", random_id() as u32))?);
        let mut command = Command::new(program("i2ris-control")?);
        command.arg("--config").arg(configure(rig, run, &domain.0)?);
        let process = Process::start("controller", &mut command, rig.folder.path());
        let remedy = "build both programs: cargo build --release";
        let mut process =
            process.map_err(|error| format!("cannot start the controller; {remedy}: {error}"))?;
        let mut client = connect(&mut process, &domain.0)?;
        enable(&mut client)?;
        Ok(Self { client, process, domain })
    }

    /// Number of stops since the start because commands were late.
    pub fn stale_stops(&mut self) -> Result<u64, Failure> {
        Ok(self.client.wait_for(TIMEOUT, |_| true)?.stale_stops)
    }

    /// The scheduling of the control loop, which it reports once a second.
    pub fn scheduling(&self) -> String {
        let (mut statistics, start) = (self.client.watcher().period_statistics(), clock::now());
        while clock::now().duration_since(start) < STATISTICS_TIMEOUT {
            if let Ok(Some(window)) = statistics.newest() {
                return describe(&Granted {
                    priority: window.priority as u8,
                    cpu: (window.cpu != u32::MAX).then_some(window.cpu as usize),
                    memory_locked: window.memory_locked == 1,
                    warnings: Vec::new(),
                });
            }
            clock::sleep(Nanos::from_millis(10));
        }
        "not known".to_owned()
    }

    pub fn end(self) -> Result<(), Failure> {
        drop(self.client);
        self.process.end()
    }
}

fn connect(process: &mut Process, domain: &Domain) -> Result<Client, Failure> {
    let start = clock::now();
    loop {
        process.check()?;
        match Client::connect(domain, Nanos::from_millis(100)) {
            Err(error) if error.is_absent() && clock::now().duration_since(start) < TIMEOUT => {}
            outcome => return Ok(outcome?),
        }
    }
}

fn configure(rig: &DriveRig, run: Run, domain: &Domain) -> Result<PathBuf, Failure> {
    let folder = rig.folder.path();
    let model = model(10, 8)?;
    model.file().write(&folder.join("model.json"))?;
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    config.robot_id.clone_from(&model.file().robot_id);
    config.control.model = Some("model.json".into());
    config.control.priority = run.priority;
    config.control.cpu = run.processor();
    config.domain = domain.name().to_owned();
    config.record_folder = folder.join("records");
    config.command.deadline_ms = DEADLINE_MS;
    config.limits.feedback_stale_ms = 3 * REPLY_TIMEOUT_MS;
    config.ports = rig.ports();
    config.ports.iter_mut().for_each(|port| port.reply_timeout_ms = REPLY_TIMEOUT_MS);
    let file = folder.join("bench.toml");
    fs::write(&file, toml::to_string(&config)?)?;
    Ok(file)
}

/// Homes and enables. Not in the client library: homing a robot needs the operator's consent.
fn enable(client: &mut Client) -> Result<(), Failure> {
    client.wait_for(TIMEOUT, |state| state.flags & OperatingStateMsg::BUSY == 0)?;
    let start = clock::now();
    client.carry_out(StateCommand::Home, || clock::now().duration_since(start) > TIMEOUT)?;
    client.enable(TIMEOUT)?;
    Ok(())
}

/// Range of the pause before a command, ms: not synchronous with loop or line.
const PAUSE_MS: [f64; 2] = [11.0, 23.0];
/// Deadline of a command. It is long because a stall of the machine must not stop the robot.
const DEADLINE: Nanos = Nanos::from_millis(500);
/// Radius of the circle of the commands. A step is about 6 counts, 8 deg/s, within all limits.
const RADIUS_DEG: f64 = 1.5;
const STEP_RAD: f64 = 0.09;
/// The port threads have a priority 10 below that of the control loop, the client 20 below.
const PORT_BELOW: u8 = 10;
const CLIENT_BELOW: u8 = 20;

/// Random pauses, the same for the same seed (SplitMix64, G. L. Steele et al. 2014).
#[derive(Debug)]
pub struct Pauses(pub u64);

impl Iterator for Pauses {
    type Item = Nanos;

    fn next(&mut self) -> Option<Nanos> {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let share = (z ^ (z >> 31)) as f64 / u64::MAX as f64;
        Some(Nanos(((PAUSE_MS[0] + share * (PAUSE_MS[1] - PAUSE_MS[0])) * 1e6) as u64))
    }
}

fn at_random_instants(
    benchmark: &EndToEndBenchmark,
    mut publish: impl FnMut(u64, &mut Observations) -> Result<(), Failure>,
    mut read: impl FnMut(&mut Observations) -> Result<(), Failure>,
) -> Result<Observations, Failure> {
    let (mut observations, mut last) = (Observations::default(), None);
    for (number, pause) in (0..benchmark.commands).zip(Pauses(benchmark.seed)) {
        let now = clock::now();
        let gap = now.duration_since(last.replace(now).unwrap_or(now));
        observations.longest_gap = observations.longest_gap.max(gap);
        publish(number, &mut observations)?;
        observations.sent += 1;
        while clock::now() < now + pause {
            read(&mut observations)?;
            clock::sleep(READ_PERIOD);
        }
    }
    Ok(observations)
}

/// Publishes all commands to a controller and records setpoints and encoder positions.
pub fn command(
    client: &mut Client,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<Observations, Failure> {
    let mut commander = client.commander().with_deadline(DEADLINE);
    let mut actuators = client.watcher().actuators();
    in_thread(|| {
        request_priority(run.priority.saturating_sub(CLIENT_BELOW));
        let mut last = [0; 2];
        at_random_instants(
            benchmark,
            |number, _| {
                run.check()?;
                publish(&mut commander, number)
            },
            |observations| read_states(&mut actuators, observations, &mut last),
        )
    })
}

fn publish(commander: &mut Commander, number: u64) -> Result<(), Failure> {
    let angle = STEP_RAD * number as f64;
    // The circle grows from the position of the robot.
    let radius = RADIUS_DEG.to_radians() * (number as f64 / 20.0).min(1.0);
    commander.servo_jp(&[radius * angle.sin(), radius * (1.0 - angle.cos())])?;
    Ok(())
}

/// `last`: sequence number of the last command of each motor.
pub fn read_states(
    actuators: &mut Subscription<ActuatorState>,
    observations: &mut Observations,
    last: &mut [u64; 2],
) -> Result<(), Failure> {
    actuators.drain(|state| {
        let seen = clock::now();
        for (motor, last) in last.iter_mut().enumerate() {
            observations.add_reading(motor, Nanos(state.measured_stamp_ns[motor]), seen);
            let sequence = state.command_sequence[motor];
            if state.command_stamp_ns[motor] != 0 && sequence != *last {
                *last = sequence;
                observations.written[motor].push(Written {
                    command: Nanos(state.command_stamp_ns[motor]),
                    sequence,
                    written: Nanos(state.written_stamp_ns[motor]),
                    counts: state.written_counts[motor],
                });
            }
        }
    })?;
    Ok(())
}

/// The floor: passes commands from memory to a bare loop on the first port, and positions back.
pub fn bare(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<CommandLatencies, Failure> {
    let (bare, ports) = (&BareLoop::default(), &rig.ports());
    let observations = thread::scope(|scope| {
        let serving =
            scope.spawn(|| bare.serve(&ports[0], run.priority.saturating_sub(PORT_BELOW)));
        let observations = in_thread(|| {
            request_priority(run.priority.saturating_sub(CLIENT_BELOW));
            at_random_instants(
                benchmark,
                |number, observations| {
                    run.check()?;
                    // Every setpoint differs from the previous one, so that it can be matched.
                    let (command, counts) = (clock::now(), (number % 200) as i32);
                    bare.target.store(counts, Ordering::Release);
                    let (sequence, written) = (number, Nanos::ZERO);
                    observations.written[0].push(Written { command, sequence, written, counts });
                    Ok(())
                },
                |observations| {
                    let measured = Nanos(bare.measured_ns.load(Ordering::Acquire));
                    observations.add_reading(0, measured, clock::now());
                    if serving.is_finished() { Err("the bare loop ended".into()) } else { Ok(()) }
                },
            )
        });
        bare.stop.store(true, Ordering::Release);
        // Report first why the loop ended.
        serving.join().map_err(panicked)??;
        observations
    })?;
    Ok(match_commands(&observations, &rig.emulator.log()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_fill_their_range() {
        let all: Vec<f64> = Pauses(7).take(1000).map(|pause| pause.as_seconds() * 1e3).collect();
        let range = PAUSE_MS[0] - 1e-6..=PAUSE_MS[1] + 1e-6;
        assert!(all.iter().all(|ms| range.contains(ms)));
        let mean = all.iter().sum::<f64>() / 1000.0;
        assert!((mean - 17.0).abs() < 0.5, "{mean}");
    }
}
