//! Captures of every family.

use i2ris::drive::capture::CapturedLine;
use i2ris::drive::command_set::Requested;
use i2ris::drive::family_selection::family_of_line;
use i2ris::drive::fingerprint::read_transport;
use i2ris_testing::drive::replayed;

use super::conformance::{SETUPS, TestBench};
use super::*;

#[test]
fn every_family_is_captured_and_a_fingerprint_writes_nothing() {
    for setup in &SETUPS {
        let bench = TestBench::emulated(setup);
        let config = bench.port();
        let line = || CapturedLine::new(SerialTransport::open(&config).unwrap(), &config);
        let (captured, capture) = line();
        let drives = read_transport(captured, &config).unwrap();
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
