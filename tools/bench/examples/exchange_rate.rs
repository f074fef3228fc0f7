//! How much of the wire the driver uses: exchanges and set-points per second against the limit of the line.
//!
//! ```text
//! cargo run --release -p i2ris-bench --example exchange_rate [SECONDS]
//! ```
//!
//! Two emulated drives on two ports at 115200 baud, without processing delay. A request and its reply are 24 bytes of ten bits
//! each, so the wire allows 480 exchanges per second on a line: 240 set-points with the position read back.
#![allow(clippy::print_stdout, reason = "it prints what it measured")]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::config::{AxisConfig, Pattern, PortConfig};
use i2ris::drive::{AxisLink, AxisPhase, AxisRequest, Demand, LinkCounters, Port, PortRunner};
use i2ris::rt::{self, Wanted};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::log::EventKind;
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};

/// Bytes of a request and its reply, without stuffing.
const EXCHANGE_BYTES: f64 = 24.0;
const BITS_PER_BYTE: f64 = 10.0;
const BAUD: f64 = 115_200.0;

/// How often the stand-in of the control loop writes a target.
const TICK: Nanos = Nanos::from_millis(1);

fn main() -> Result<(), Box<dyn Error>> {
    let seconds: f64 = std::env::args().nth(1).map_or(Ok(5.0), |text| text.parse())?;
    let folder = tempfile::tempdir()?;
    let snake = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes/steel.toml");
    let mut emulation = EmulatorConfig::new(SnakeConfig::load(&snake)?, &folder.path().join("ports"));
    emulation.line.processing_us = 0;
    let serial_numbers = emulation.drives.clone().map(|drive| drive.serial_number);
    let emulator = Emulator::start(emulation)?;
    let limit = BAUD / BITS_PER_BYTE / EXCHANGE_BYTES;
    println!(
        "the wire allows {limit:.0} exchanges/s on a line, {:.0} set-points/s with the position read back",
        limit / 2.0
    );

    let (stop, mut links, mut threads) = (Arc::new(AtomicBool::new(false)), Vec::new(), Vec::new());
    for (motor, serial_number) in serial_numbers.into_iter().enumerate() {
        let axis = AxisConfig::new(motor, serial_number, [Counts(-2400), Counts(2400)]);
        let port = PortConfig {
            reply_timeout_ms: 200,
            deadman_ms: 0,
            // Nothing but set-points and positions, as far as it may be.
            pattern: Pattern { status_every: 50, rare_every: 1000 },
            ..PortConfig::new(emulator.device(motor).to_owned(), vec![axis])
        };
        let (runner, ends) = Port::open(&port)?.bring_up()?.split();
        links.extend(ends);
        let stopped = Arc::clone(&stop);
        threads.push(thread::spawn(move || serve(runner, &stopped)));
    }
    let mut requests = [AxisRequest::default(); 2];
    until(&mut links, &mut requests, AxisPhase::Disabled);
    requests.iter_mut().for_each(|request| request.demand = Demand::Enabled);
    until(&mut links, &mut requests, AxisPhase::Enabled);

    let before: Vec<LinkCounters> = counters(&mut links);
    let begin = clock::now();
    while (clock::now() - begin).as_seconds() < seconds {
        let angle = std::f64::consts::TAU * 0.5 * (clock::now() - begin).as_seconds();
        for (link, request) in links.iter_mut().zip(&mut requests) {
            request.target = Counts((200.0 * angle.sin()) as i32);
            write(link, request);
        }
        clock::sleep(TICK);
    }
    let (end, after) = (clock::now(), counters(&mut links));
    let span = (end - begin).as_seconds();
    let log = emulator.log();
    for (motor, (before, after)) in before.iter().zip(&after).enumerate() {
        let rate = (after.exchanges - before.exchanges) as f64 / span;
        let setpoint = |kind| matches!(kind, EventKind::Setpoint(_));
        let within = |stamp: Nanos| stamp >= begin && stamp < end;
        let setpoints =
            log.iter().filter(|event| event.axis == motor && within(event.stamp) && setpoint(event.kind)).count();
        let ms = |quantile| after.round_trips.quantile(quantile).map_or(0.0, |span| span.as_seconds() * 1e3);
        println!(
            "motor {motor}: {rate:.1} exchanges/s = {:.1} % of the wire; {:.1} set-points/s; round trip p50 <= {:.2} ms, \
             p99 <= {:.2} ms; {} time-outs",
            100.0 * rate / limit,
            setpoints as f64 / span,
            ms(0.5),
            ms(0.99),
            after.timeouts - before.timeouts
        );
    }
    println!("rules broken by the host: {}", emulator.host_bugs());
    stop.store(true, Ordering::Release);
    threads.into_iter().for_each(|thread| drop(thread.join()));
    Ok(())
}

/// The port thread, with the priority that the controller gives it where that is allowed.
fn serve(runner: PortRunner, stop: &AtomicBool) {
    let _ = rt::request(Wanted { priority: 70, ..Wanted::default() });
    runner.run(stop, |_| {});
}

fn until(links: &mut [AxisLink], requests: &mut [AxisRequest], phase: AxisPhase) {
    while !links.iter_mut().all(|link| link.feedback.read().phase == phase) {
        links.iter_mut().zip(&mut *requests).for_each(|(link, request)| write(link, request));
        clock::sleep(TICK);
    }
}

fn write(link: &mut AxisLink, request: &mut AxisRequest) {
    request.sequence += 1;
    link.requests.write(*request);
}

fn counters(links: &mut [AxisLink]) -> Vec<LinkCounters> {
    links.iter_mut().map(|link| link.feedback.read().counters).collect()
}
