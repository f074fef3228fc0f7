//! Captures of lines with disturbances: the received bytes come out the same in a replay.

use i2ris::drive::capture::file::{from_bytes, to_bytes};
use i2ris::drive::capture::{CapturedLine, CapturedPort, LineEvent, Outcome};
use i2ris::drive::command_set::Requested;
use i2ris::drive::family_selection::family_of_line;
use i2ris::drive::fingerprint::read_over;
use i2ris::drive::link::replay::replay;
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::drive::{AxisRequest, Demand, Port};
use i2ris::units::{Counts, Nanos};
use i2ris_testing::drive::{Disturbance, SimulatedLine, one_drive, port_config};

use super::conformance::{SETUPS, TestBench};

/// Frames of requests and replies, and the number of outcomes that are no answer, all replayed.
fn replayed(port: &CapturedPort) -> (u64, usize) {
    let file = from_bytes(&to_bytes(std::slice::from_ref(port), "test", Nanos::ZERO)).unwrap();
    assert_eq!(file.ports, std::slice::from_ref(port));
    let found = replay(port);
    assert!(found.differences.is_empty() && found.skipped == 0, "{found:?}");
    let outcomes = port.events.iter().filter_map(LineEvent::outcome);
    let failures = outcomes.filter(|it| !matches!(it, Outcome::Answered(_))).count();
    (2 * found.attempts, failures)
}

/// A drive that follows setpoints on a disturbed line.
fn disturbed(seed: u64) -> CapturedPort {
    let drive = one_drive();
    let config = port_config(std::slice::from_ref(&drive));
    let line = SimulatedLine::new(vec![drive]);
    let (captured, capture) = CapturedLine::new(line.clone(), &config);
    let (mut runner, mut links) = Port::over(captured, &config).bring_up().unwrap().split();
    let mut request = AxisRequest { demand: Demand::Enabled, ..AxisRequest::default() };
    let mut random = seed;
    for turn in 0..500 {
        request.sequence += 1;
        request.target = Counts(turn % 1000);
        links[0].requests.write(request);
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let at = (random >> 40) as usize;
        let disturbances = [
            Disturbance::LoseReply,
            Disturbance::FlipRequest(at),
            Disturbance::TruncateRequest(at),
            Disturbance::FlipReply(at),
            Disturbance::DropReplyByte(at),
            Disturbance::DuplicateReplyByte(at),
            Disturbance::TruncateReply(at),
            Disturbance::DelayReply(Nanos::from_millis(at as u64 % 40)),
            Disturbance::Noise,
            Disturbance::StrayReply,
        ];
        line.disturb(disturbances.get(at % 30).copied());
        if at.is_multiple_of(400) {
            line.state().hung_up = true;
            let again = line.clone();
            let mend = move || again.state().hung_up = false;
            line.plan(line.time() + Nanos::from_millis(30), mend);
        }
        runner.turn(&mut |_| {});
    }
    capture.read()
}

/// So many frames in I2RIS_FRAMES.
#[test]
fn frames_of_a_disturbed_line_are_replayed_without_a_difference() {
    let least: u64 = std::env::var("I2RIS_FRAMES").map_or(1_000_000, |text| text.parse().unwrap());
    let (mut frames, mut failures, mut seed) = (0, 0, 0);
    while frames < least {
        let (more, failed) = replayed(&disturbed(seed));
        (frames, failures, seed) = (frames + more, failures + failed, seed + 1);
    }
    println!("{frames} frames of {seed} lines replayed, {failures} attempts failed: 0 differences");
    assert!(failures > 100);
}

#[test]
fn every_family_and_framing_is_captured_and_a_fingerprint_writes_nothing() {
    for setup in &SETUPS {
        let bench = TestBench::emulated(setup);
        let config = bench.port();
        let line = || CapturedLine::new(SerialTransport::open(&config).unwrap(), &config);
        let (captured, capture) = line();
        let drives = read_over(captured, &config).unwrap();
        assert_eq!(drives.len(), config.axes.len(), "{}", setup.name);
        assert!(drives.iter().all(|drive| drive.settings.len() >= 40), "{drives:?}");
        let port = capture.read();
        let commands = family_of_line(port.family).command_set();
        for attempt in port.attempts() {
            let request = port.with_request(attempt, |frame| commands.parse(frame)).flatten();
            assert!(matches!(request, Some(Requested::Read(..))), "{request:?}");
        }
        let (captured, capture) = line();
        let brought_up = Port::over(captured, &config).bring_up().unwrap();
        let (mut runner, _links) = brought_up.split::<AxisRequest>();
        (0..100).for_each(|_| runner.turn(&mut |_| {}));
        assert!(replayed(&port).0 > 100 && replayed(&capture.read()).0 > 200, "{}", setup.name);
    }
}
