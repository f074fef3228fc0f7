//! A request over a line that loses, damages and delays data: a wrong value is never accepted.

use i2ris::drive::epos4::Epos4;
use i2ris::drive::error::{LinkError, UnexpectedReply};
use i2ris::drive::link::{DriveLink, Retry, TimedReply};
use i2ris::drive::object::{self, AbortCode, POSITION, TARGET};
use i2ris::drive::transport::Transport;
use i2ris::units::Nanos;
use i2ris_testing::drive::{Disturbance, MiniDrive, NODE, SERIAL_NUMBER, SimulatedLine};
use i2ris_testing::drive::{one_drive, open};
use proptest::collection::vec;
use proptest::prelude::*;

/// A line to one drive whose positions are the number of the request that they answer.
struct LinkTest {
    line: SimulatedLine,
    link: DriveLink<SimulatedLine>,
}

impl LinkTest {
    fn new() -> Self {
        let mut drive = one_drive();
        drive.counts_requests = true;
        let (line, config, _) = open(vec![drive]);
        let mut link = DriveLink::new(line.clone(), &Epos4::Cyclic, &config);
        link.set_serial_number(SERIAL_NUMBER);
        link.set_frame_timeout(Nanos::from_millis(50));
        Self { line, link }
    }

    fn disturbed(disturbances: impl IntoIterator<Item = Disturbance>) -> Self {
        let test = Self::new();
        test.line.disturb(disturbances);
        test
    }

    fn drive<R>(&self, access: impl FnOnce(&mut MiniDrive) -> R) -> R {
        self.line.drive(NODE, access)
    }

    /// The position that answers the last request.
    fn last_request(&self) -> i32 {
        self.drive(|drive| drive.requests as i32)
    }

    fn write_target(&mut self, target: i32) -> Result<TimedReply<()>, LinkError> {
        self.link.write(NODE, TARGET.set(target), Retry::Never)
    }

    fn written_targets(&self) -> usize {
        self.drive(|drive| drive.written(0x607A, 0)).len()
    }

    /// Reads a position and checks that it answers the last request.
    fn assert_reads(&mut self, context: &str) {
        assert_eq!(self.link.read(NODE, POSITION), Ok(self.last_request()), "{context}");
    }
}

fn delay(ms: u64) -> Disturbance {
    Disturbance::DelayReply(Nanos::from_millis(ms))
}

#[test]
fn a_value_is_read_and_truncated_to_its_size() {
    let LinkTest { mut link, .. } = LinkTest::new();
    assert_eq!(link.read(NODE, object::STATUSWORD), Ok(0x8240));
    assert_eq!(link.counters().exchanges, 1);
}

#[test]
fn refusal_leaves_line_in_sync_without_retry() {
    let mut test = LinkTest::new();
    test.drive(|drive| drive.refuses.insert((0x607A, 0), 0x0800_0022));
    assert_eq!(test.write_target(5), Err(LinkError::Refused(AbortCode(0x0800_0022))));
    assert!(test.link.is_in_sync());
    let counters = test.link.counters();
    assert_eq!((counters.timeouts, counters.retries), (0, 0));
}

#[test]
fn a_reply_has_the_times_of_sending_and_receiving() {
    let mut test = LinkTest::new();
    let before = test.line.time();
    let reply = test.write_target(5).unwrap();
    assert_eq!((reply.sent, reply.received), (before, test.line.time()));
    assert!(reply.received - reply.sent > Nanos::from_millis(2), "24 bytes take 2.08 ms");
}

#[test]
fn a_lost_request_or_reply_is_retried_once_after_synchronising() {
    for disturbance in [
        Disturbance::LoseRequest,
        Disturbance::LoseReply,
        Disturbance::TruncateReply(5),
        Disturbance::FlipReply(6),
    ] {
        let mut test = LinkTest::disturbed([disturbance]);
        test.assert_reads(&format!("{disturbance:?}"));
        let requests = &test.line.state().requests;
        let indices: Vec<u16> = requests.iter().map(|request| request.index).collect();
        // Vendor, serial number, and the retry.
        assert!(indices.ends_with(&[0x1018, 0x1018, 0x6064]), "{indices:X?}");
        assert_eq!(test.link.counters().retries, 1);
    }
}

#[test]
fn a_request_that_arrived_damaged_is_sent_again_at_once() {
    let mut test = LinkTest::disturbed([Disturbance::FlipRequest(4)]);
    assert_eq!(test.link.read(NODE, POSITION), Ok(1));
    assert_eq!(test.link.counters().timeouts, 0);
    assert_eq!(test.line.state().requests.len(), 1, "no other request");
}

#[test]
fn a_request_without_retry_is_not_repeated() {
    for disturbance in [Disturbance::LoseRequest, Disturbance::LoseReply, Disturbance::FlipReply(7)]
    {
        let mut test = LinkTest::disturbed([disturbance]);
        let outcome = test.write_target(5);
        assert!(matches!(outcome, Err(LinkError::Unanswered(_))), "{disturbance:?}: {outcome:?}");
        assert!(test.written_targets() <= 1);
        assert!(test.link.is_in_sync(), "the next reply can be trusted");
        test.assert_reads("after it");
    }
}

#[test]
fn a_request_without_retry_is_not_sent_late() {
    let mut test = LinkTest::new();
    test.line.send_stale_request();
    test.line.sleep_until(test.line.time() + Nanos::from_millis(10));
    assert!(matches!(test.write_target(5), Err(LinkError::Unanswered(_))));
    assert_eq!(test.written_targets(), 0);
    assert!(test.write_target(5).is_ok());
}

#[test]
fn a_late_reply_is_never_accepted_for_the_next_request() {
    // After 250 requests the next position is 251, the vendor number of maxon.
    for (late_ms, before) in (1..61).chain([100, 200]).flat_map(|ms| [(ms, 0), (ms, 250)]) {
        let mut test = LinkTest::disturbed([delay(late_ms)]);
        test.drive(|drive| drive.requests = before);
        for _ in 0..5 {
            test.assert_reads(&format!("reply late by {late_ms} ms after {before} requests"));
        }
        assert!(test.link.is_in_sync());
    }
}

#[test]
fn late_replies_are_named_and_no_wrong_device_is_suspected() {
    for late_ms in [25, 26, 28, 30, 40, 60] {
        let mut test = LinkTest::disturbed([delay(late_ms)]);
        let error = test.write_target(5).unwrap_err();
        let LinkError::Unanswered(reply) = error else { panic!("{error}") };
        assert!(reply.is_late(), "late by {late_ms} ms: {error}");
        assert_eq!(error.to_string(), "not answered: a reply came too late");
    }
}

#[test]
fn several_late_replies_are_never_accepted_for_the_known_constants() {
    for first in (0..200).step_by(7) {
        for second in (0..200).step_by(7) {
            for third in [0, 60, 130] {
                let mut test = LinkTest::disturbed([Disturbance::LoseRequest]);
                test.line.disturb([first, second, third].map(delay));
                for _ in 0..4 {
                    if let Ok(position) = test.link.read(NODE, POSITION) {
                        let late = (first, second, third);
                        assert_eq!(position, test.last_request(), "late by {late:?} ms");
                    }
                }
            }
        }
    }
}

#[test]
fn two_replies_at_once_are_both_rejected() {
    let mut test = LinkTest::disturbed([Disturbance::StrayReply]);
    test.line.state().host_delay = Nanos::from_millis(10);
    test.assert_reads("two replies");
    assert_eq!(test.link.counters().retries, 1);
}

#[test]
fn a_delayed_host_still_accepts_the_reply_that_has_arrived() {
    let mut test = LinkTest::new();
    test.line.state().host_delay = Nanos::from_millis(300);
    assert_eq!(test.link.read(NODE, POSITION), Ok(1));
    assert_eq!(test.link.counters().timeouts, 0);
}

#[test]
fn replies_without_a_request_put_the_line_out_of_sync() {
    let mut test = LinkTest::new();
    test.line.send_stale_request();
    test.line.send_stale_request();
    // The first reply has arrived, the second is still on its way.
    test.line.sleep_until(test.line.time() + Nanos::from_millis(3));
    test.assert_reads("stale replies");
}

#[test]
fn noise_before_a_reply_is_skipped() {
    let mut test = LinkTest::disturbed([Disturbance::Noise]);
    assert_eq!(test.link.read(NODE, POSITION), Ok(1));
    assert!(test.link.counters().resynchronisations > 0);
    assert_eq!(test.link.counters().timeouts, 0);
}

#[test]
fn reply_truncated_inside_stuffed_byte_does_not_spoil_next() {
    // 90 02 00 04, four zeros of error code, then the first half of the doubled 0x90.
    let mut test = LinkTest::disturbed([Disturbance::TruncateReply(9)]);
    test.drive(|drive| drive.requests = 0x8F);
    test.assert_reads("truncated");
    assert_eq!(test.link.counters().timeouts, 1);
}

#[test]
fn drive_waiting_for_rest_of_request_recovers() {
    LinkTest::disturbed([Disturbance::TruncateRequest(5)]).assert_reads("truncated request");
}

#[test]
fn a_silent_line_is_given_up_after_a_bounded_time() {
    let mut test = LinkTest::new();
    test.line.state().silent = true;
    let begin = test.line.time();
    assert_eq!(test.link.read(NODE, POSITION), Err(LinkError::Lost(UnexpectedReply::default())));
    let span = test.line.time().duration_since(begin);
    assert!(span < Nanos::from_millis(500), "{span:?}");
    test.line.state().silent = false;
    test.assert_reads("found again");
}

#[test]
fn silent_node_on_live_line_is_unanswered() {
    // The request, the two constants, and the retry.
    let mut test = LinkTest::disturbed([
        Disturbance::LoseReply,
        Disturbance::Nothing,
        Disturbance::Nothing,
        Disturbance::LoseReply,
    ]);
    let silence = LinkError::Unanswered(UnexpectedReply::default());
    assert_eq!(test.link.read(NODE, POSITION), Err(silence));
    assert!(test.link.is_in_sync());
}

#[test]
fn an_unplugged_cable_is_distinguished_from_silence() {
    let mut test = LinkTest::new();
    test.line.state().hung_up = true;
    let broken = LinkError::Broken(std::io::ErrorKind::BrokenPipe);
    assert_eq!(test.link.read(NODE, POSITION), Err(broken));
}

fn disturbance() -> impl Strategy<Value = Disturbance> {
    prop_oneof![
        4 => Just(Disturbance::Nothing),
        1 => Just(Disturbance::LoseRequest),
        1 => any::<usize>().prop_map(Disturbance::FlipRequest),
        1 => any::<usize>().prop_map(Disturbance::TruncateRequest),
        1 => Just(Disturbance::LoseReply),
        2 => (0..150u64).prop_map(delay),
        1 => any::<usize>().prop_map(Disturbance::FlipReply),
        1 => any::<usize>().prop_map(Disturbance::DropReplyByte),
        1 => any::<usize>().prop_map(Disturbance::DuplicateReplyByte),
        1 => any::<usize>().prop_map(Disturbance::TruncateReply),
        1 => Just(Disturbance::Noise),
    ]
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    /// With any disturbances: a value that is accepted answers the last request, a setpoint that
    /// is acknowledged was written, and the line returns to sync.
    #[test]
    fn no_wrong_value_is_ever_accepted(
        disturbances in vec(disturbance(), 1..60), first in 0..300u32,
    ) {
        let mut test = LinkTest::new();
        test.drive(|drive| drive.requests = first);
        test.line.disturb(disturbances);
        for target in 0..40 {
            if let Ok(position) = test.link.read(NODE, POSITION) {
                prop_assert_eq!(position, test.last_request());
            }
            if test.write_target(target).is_ok() {
                prop_assert_eq!(test.drive(|drive| drive.target()), target);
            }
        }
        test.line.state().disturbances.clear();
        prop_assert!(test.link.read(NODE, POSITION).is_ok());
    }
}
