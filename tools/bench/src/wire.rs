//! Use of the serial lines by the driver: exchanges and setpoints per second against the limit of
//! a line, over baud rates and axes per port.
//!
//! Two emulated drives without processing delay, on two ports or one. A request and its reply are
//! 24 bytes of ten bits each without stuffing, so 115200 baud allow 480 exchanges per second on a
//! line: 240 setpoints with a position. The floor is a bare loop on the same ports, in the same
//! run. Three and four axes are the bare loop alone: it addresses the two drives in turn, which
//! takes as many bytes.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::drive::{AxisLink, AxisPhase, AxisRequest, Demand, LinkCounters, Port};
use i2ris::units::{Counts, Nanos};

use crate::outcome::{Durations, Found, Outcome, Quantity, Role, Variant};
use crate::placement::{Run, request_priority};
use crate::rig::{BareLoop, DriveRig, LOCAL, RigLines, setpoint_intervals};
use crate::{BenchError, busy, panicked};

/// The most axes of a port.
pub const MAX_AXES: usize = 4;
/// Axes of the emulator.
const EMULATED: usize = 2;
/// The rate of USB at full speed. Its frames of 1 ms are not emulated.
const USB: u32 = 12_000_000;

/// Bytes of a request and its reply, without stuffing.
const EXCHANGE_BYTES: f64 = 24.0;
const BITS_PER_BYTE: f64 = 10.0;

/// Time between two setpoints.
const TICK: Nanos = Nanos::from_millis(1);
/// Amplitude of the setpoints, counts, and their frequency, Hz.
const AMPLITUDE: f64 = 200.0;
const FREQUENCY: f64 = 0.5;
/// Limit for the time until the drives are enabled.
const TIMEOUT: Nanos = Nanos::from_millis(20_000);

#[derive(Debug)]
pub struct WireBenchmark {
    /// Baud rates and axes per port, 1 to [`MAX_AXES`].
    pub lines: Vec<(u32, usize)>,
    /// Of each measurement.
    pub seconds: f64,
}

/// Measures a bare loop and the driver for some seconds each, on every line.
pub fn run(benchmark: &WireBenchmark, run: Run) -> Result<Outcome, BenchError> {
    let about = "Use of a line: a request and its reply are 24 bytes of ten bits";
    Outcome::of("wire", about, || {
        let priority = port_priority(run);
        let scheduling =
            format!("threads that own a port: SCHED_FIFO {priority} requested (0: none)");
        let mut found = Found { scheduling: vec![scheduling], ..Found::default() };
        for (baud, axes) in &benchmark.lines {
            let is_single = benchmark.lines.len() == 1;
            measure(*baud, *axes, benchmark.seconds, run, is_single, &mut found)?;
        }
        Ok(found)
    })
}

fn measure(
    baud: u32,
    axes: usize,
    seconds: f64,
    run: Run,
    is_single: bool,
    found: &mut Found,
) -> Result<(), BenchError> {
    let rig = rig(baud, axes)?;
    let (group, of) = match is_single {
        true => ("setpoint to setpoint".to_owned(), String::new()),
        false => (name(baud, axes), format!("{}: ", name(baud, axes))),
    };
    let limit = exchanges_per_s(baud);
    let mut add = |name: &str, value: f64, unit| {
        found.quantities.push(Quantity::new(format!("{of}{name}"), value, unit));
    };
    add("the wire allows, a line", limit, "exchanges/s");
    add("two exchanges on the wire", 2e6 / limit, "us");
    let bare = bare_loop(&rig, axes, seconds, run)?;
    add("a bare loop reaches, a line", bare.exchanges_per_s, "exchanges/s");
    add("a bare loop uses", 100.0 * bare.exchanges_per_s / limit, "% of the wire");
    let floor = "a loop that does nothing else";
    found.variants.push(Variant::new(floor, &group, Role::Floor, bare.intervals));
    if axes > EMULATED {
        return Ok(());
    }
    let driver = driver(&rig, seconds, run)?;
    add("the driver reaches, a line", driver.exchanges_per_s, "exchanges/s");
    add("the driver uses", 100.0 * driver.exchanges_per_s / limit, "% of the wire");
    let share = 100.0 * driver.exchanges_per_s / bare.exchanges_per_s;
    add("the driver against the bare loop", share, "%");
    add("time-outs of the driver", driver.timeouts as f64, "");
    add("rules broken by the host", rig.emulator.host_bugs() as f64, "");
    found.variants.push(Variant::new("the driver", &group, Role::Ours, driver.intervals));
    Ok(())
}

/// The exchanges per second that a line allows.
fn exchanges_per_s(baud: u32) -> f64 {
    f64::from(baud) / BITS_PER_BYTE / EXCHANGE_BYTES
}

fn name(baud: u32, axes: usize) -> String {
    let line = if baud == USB { "USB".to_owned() } else { format!("{baud} baud") };
    let plural = if axes == 1 { "axis" } else { "axes" };
    format!("{line}, {axes} {plural} per port")
}

/// Below the control loop, as in the controller.
fn port_priority(run: Run) -> u8 {
    run.placement.priority.saturating_sub(10)
}

fn rig(baud: u32, axes: usize) -> Result<DriveRig, BenchError> {
    DriveRig::start(RigLines { processing_us: Some(0), baud: Some(baud), is_shared: axes > 1 })
}

/// What went over the lines in an interval.
struct LineUsage {
    /// From each setpoint of an axis to its next.
    intervals: Durations,
    /// Of one line.
    exchanges_per_s: f64,
    timeouts: u64,
}

fn bare_loop(rig: &DriveRig, axes: usize, seconds: f64, run: Run) -> Result<LineUsage, BenchError> {
    let ports = rig.ports();
    let nodes: Vec<u8> = match axes {
        1 => vec![LOCAL],
        axes => (0..axes).map(|axis| 1 + (axis % EMULATED) as u8).collect(),
    };
    let visits = match axes {
        1 => [1, 1],
        axes => [axes.div_ceil(EMULATED), axes / EMULATED],
    };
    let loops: Vec<BareLoop> = ports.iter().map(|_| BareLoop::default()).collect();
    thread::scope(|scope| {
        let nodes = &nodes;
        let serving: Vec<_> = ports
            .iter()
            .zip(&loops)
            .map(|(port, bare)| scope.spawn(move || bare.serve(port, nodes, port_priority(run))))
            .collect();
        let counted =
            || -> u64 { loops.iter().map(|bare| bare.exchanges.load(Ordering::Relaxed)).sum() };
        let (begin, before) = (clock::now(), counted());
        let moved = move_sine(seconds, run, |counts| {
            loops.iter().for_each(|bare| bare.target.store(counts, Ordering::Release));
        });
        let (end, after) = (clock::now(), counted());
        loops.iter().for_each(|bare| bare.stop.store(true, Ordering::Release));
        for thread in serving {
            thread.join().map_err(panicked)??;
        }
        moved?;
        let exchanges = (after - before) as f64 / loops.len() as f64;
        Ok(LineUsage {
            intervals: setpoint_intervals(&rig.emulator.log(), [begin, end], visits),
            exchanges_per_s: exchanges / end.duration_since(begin).as_seconds(),
            timeouts: 0,
        })
    })
}

/// Calls `set` with the counts of a sine in every tick.
fn move_sine(seconds: f64, run: Run, mut set: impl FnMut(i32)) -> Result<(), BenchError> {
    let begin = clock::now();
    loop {
        let t = clock::now().duration_since(begin).as_seconds();
        if t >= seconds {
            return Ok(());
        }
        run.check()?;
        set((AMPLITUDE * (TAU * FREQUENCY * t).sin()) as i32);
        clock::sleep(TICK);
    }
}

/// Runs the driver on two axes, with status, error codes and currents as the controller reads them.
fn driver(rig: &DriveRig, seconds: f64, run: Run) -> Result<LineUsage, BenchError> {
    let (mut links, mut runners) = (Vec::new(), Vec::new());
    for port in rig.ports() {
        let (runner, ends) = Port::open(&port)?.bring_up()?.split();
        links.extend(ends);
        runners.push(runner);
    }
    let stop = &AtomicBool::new(false);
    thread::scope(|scope| {
        for runner in runners {
            scope.spawn(move || {
                request_priority(port_priority(run));
                runner.run(stop, |_| {});
            });
        }
        let usage = measure_driver(rig, &mut links, seconds, run);
        stop.store(true, Ordering::Release);
        usage
    })
}

fn measure_driver(
    rig: &DriveRig,
    links: &mut [AxisLink],
    seconds: f64,
    run: Run,
) -> Result<LineUsage, BenchError> {
    let mut requests = [AxisRequest::default(); EMULATED];
    wait_for_phase(links, &mut requests, AxisPhase::Disabled)?;
    for request in &mut requests {
        request.demand = Demand::Enabled;
    }
    wait_for_phase(links, &mut requests, AxisPhase::Enabled)?;
    let (before, begin) = (counters(links), clock::now());
    move_sine(seconds, run, |counts| {
        for (link, request) in links.iter_mut().zip(&mut requests) {
            request.target = Counts(counts);
            write(link, request);
        }
    })?;
    let (end, after) = (clock::now(), counters(links));
    // Counters are those of the line: the mean of two axes is that of a line, also of a shared one.
    let count = |of: fn(&LinkCounters) -> u64| -> u64 {
        after.iter().zip(&before).map(|(after, before)| of(after) - of(before)).sum()
    };
    let exchanges = count(|line| line.exchanges) as f64 / EMULATED as f64;
    Ok(LineUsage {
        intervals: setpoint_intervals(&rig.emulator.log(), [begin, end], [1, 1]),
        exchanges_per_s: exchanges / end.duration_since(begin).as_seconds(),
        timeouts: count(|line| line.timeouts),
    })
}

fn wait_for_phase(
    links: &mut [AxisLink],
    requests: &mut [AxisRequest],
    phase: AxisPhase,
) -> Result<(), BenchError> {
    let start = clock::now();
    while links.iter_mut().any(|link| link.feedback.read().phase != phase) {
        if clock::now().duration_since(start) > TIMEOUT {
            return Err(busy("the emulated drives were not enabled"));
        }
        for (link, request) in links.iter_mut().zip(&mut *requests) {
            write(link, request);
        }
        clock::sleep(TICK);
    }
    Ok(())
}

fn write(link: &mut AxisLink, request: &mut AxisRequest) {
    request.sequence += 1;
    link.requests.write(*request);
}

fn counters(links: &mut [AxisLink]) -> Vec<LinkCounters> {
    links.iter_mut().map(|link| link.feedback.read().counters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_of_an_exchange_take_2_ms_at_115200_baud() {
        assert_eq!(exchanges_per_s(115_200), 480.0);
        assert_eq!(name(USB, 1), "USB, 1 axis per port");
        assert_eq!(name(1_000_000, 4), "1000000 baud, 4 axes per port");
    }
}
