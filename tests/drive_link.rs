//! One request and one reply over a line that loses, damages and delays: nothing wrong is ever
//! believed.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

mod drive_fixture;

use drive_fixture::{Bench, MiniDrive, Mischief, SERIAL_NUMBER, port_config};
use i2ris::drive::epos4::Epos4;
use i2ris::drive::error::LinkError;
use i2ris::drive::exchange::{Link, Repeat};
use i2ris::drive::object::{self, POSITION, TARGET};
use i2ris::drive::request::AbortCode;
use i2ris::units::Nanos;
use proptest::collection::vec;
use proptest::prelude::*;

const NODE: u8 = 1;

/// A line to one drive whose positions tell which request they answer.
fn line() -> (Bench, Link<Bench>) {
    let mut drive = MiniDrive::new(NODE, SERIAL_NUMBER);
    drive.counting = true;
    let config = port_config(std::slice::from_ref(&drive));
    let bench = Bench::new(vec![drive]);
    let mut link = Link::new(bench.clone(), &Epos4, &config);
    link.know_serial_number(SERIAL_NUMBER);
    link.know_frame_timeout(Nanos::from_millis(50));
    (bench, link)
}

/// The value that a position must have if it answers the last request.
fn last_request(bench: &Bench) -> i32 {
    bench.drive(NODE, |drive| drive.requests as i32)
}

#[test]
fn a_value_is_read_and_cut_to_its_size() {
    let (_, mut link) = line();
    assert_eq!(link.read(NODE, object::STATUSWORD), Ok(0x8240));
    assert_eq!(link.counters().exchanges, 1);
}

#[test]
fn a_refusal_is_an_answer_and_leaves_the_line_in_step() {
    let (bench, mut link) = line();
    bench.drive(NODE, |drive| drive.refuses.insert((0x607A, 0), 0x0800_0022));
    let refused = link.write(NODE, TARGET.set(5), Repeat::Never);
    assert_eq!(refused, Err(LinkError::Refused(AbortCode(0x0800_0022))));
    assert!(link.is_in_step());
    assert_eq!(link.counters().timeouts + link.counters().retries, 0);
}

#[test]
fn an_answer_tells_when_it_was_sent_and_received() {
    let (bench, mut link) = line();
    let before = bench.world().now;
    let answer = link.write(NODE, TARGET.set(5), Repeat::Never).unwrap();
    assert_eq!(answer.sent, before);
    assert_eq!(answer.received, bench.world().now);
    assert!(
        answer.received > answer.sent + Nanos::from_millis(2),
        "24 bytes take 2.08 ms"
    );
}

#[test]
fn a_lost_request_or_reply_is_repeated_once_after_the_line_is_checked() {
    for mischief in [
        Mischief::LoseRequest,
        Mischief::LoseReply,
        Mischief::CutReply(5),
        Mischief::FlipReply(6),
    ] {
        let (bench, mut link) = line();
        bench.misbehave([mischief]);
        let position = link.read(NODE, POSITION).unwrap();
        assert_eq!(position, last_request(&bench), "{mischief:?}");
        let indices: Vec<u16> = bench
            .world()
            .requests
            .iter()
            .map(|request| request.3)
            .collect();
        assert!(
            indices.ends_with(&[0x1018, 0x1018, 0x6064]),
            "vendor, serial number, again: {indices:X?}"
        );
        assert_eq!(link.counters().retries, 1);
    }
}

#[test]
fn a_request_that_arrived_damaged_is_sent_again_at_once() {
    let (bench, mut link) = line();
    bench.misbehave([Mischief::FlipRequest(4)]);
    assert_eq!(link.read(NODE, POSITION), Ok(1));
    assert_eq!(link.counters().timeouts, 0);
    assert_eq!(bench.world().requests.len(), 1, "nothing else was asked");
}

#[test]
fn what_may_not_be_repeated_is_not() {
    for mischief in [
        Mischief::LoseRequest,
        Mischief::LoseReply,
        Mischief::FlipReply(7),
    ] {
        let (bench, mut link) = line();
        bench.misbehave([mischief]);
        assert_eq!(
            link.write(NODE, TARGET.set(5), Repeat::Never),
            Err(LinkError::Unanswered),
            "{mischief:?}"
        );
        assert!(bench.drive(NODE, |drive| drive.written(0x607A, 0)).len() <= 1);
        assert!(link.is_in_step(), "the next reply can be believed");
        assert_eq!(link.read(NODE, POSITION), Ok(last_request(&bench)));
    }
}

#[test]
fn a_late_reply_is_never_taken_for_the_next_one() {
    for late_ms in [1, 5, 15, 19, 20, 21, 22, 25, 27, 30, 40, 60, 100, 200] {
        let (bench, mut link) = line();
        bench.misbehave([Mischief::DelayReply(Nanos::from_millis(late_ms))]);
        for _ in 0..5 {
            let position = link.read(NODE, POSITION).unwrap();
            assert_eq!(position, last_request(&bench), "reply late by {late_ms} ms");
        }
        assert!(link.is_in_step());
    }
}

#[test]
fn a_late_reply_that_equals_the_known_constant_is_told_apart() {
    for late_ms in 15..60 {
        let (bench, mut link) = line();
        // This position is 251, the vendor number of maxon.
        bench.drive(NODE, |drive| drive.requests = 250);
        bench.misbehave([Mischief::DelayReply(Nanos::from_millis(late_ms))]);
        assert_eq!(
            link.read(NODE, POSITION),
            Ok(last_request(&bench)),
            "reply late by {late_ms} ms"
        );
        assert_eq!(
            link.read(NODE, POSITION),
            Ok(last_request(&bench)),
            "the one after it"
        );
    }
}

#[test]
fn several_late_replies_are_never_taken_for_those_to_the_constants() {
    for first in (0..200).step_by(7) {
        for second in (0..200).step_by(7) {
            for third in [0, 60, 130] {
                let (bench, mut link) = line();
                bench.misbehave([Mischief::LoseRequest]);
                bench.misbehave(
                    [first, second, third]
                        .map(|late| Mischief::DelayReply(Nanos::from_millis(late))),
                );
                for _ in 0..4 {
                    if let Ok(position) = link.read(NODE, POSITION) {
                        assert_eq!(
                            position,
                            last_request(&bench),
                            "late by {first}, {second} and {third} ms"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn two_replies_at_once_are_both_not_believed() {
    let (bench, mut link) = line();
    bench.world().stall = Nanos::from_millis(10);
    bench.misbehave([Mischief::Stray]);
    assert_eq!(link.read(NODE, POSITION), Ok(last_request(&bench)));
    assert_eq!(link.counters().retries, 1);
}

#[test]
fn a_host_that_looks_late_still_takes_the_reply_that_is_there() {
    let (bench, mut link) = line();
    bench.world().stall = Nanos::from_millis(300);
    assert_eq!(link.read(NODE, POSITION), Ok(1));
    assert_eq!(link.counters().timeouts, 0);
}

#[test]
fn replies_to_what_no_one_asked_put_the_line_out_of_step() {
    let (bench, mut link) = line();
    bench.leave_a_request();
    bench.leave_a_request();
    // The first has arrived, the second is still coming.
    bench.world().now = bench.time() + Nanos::from_millis(3);
    assert_eq!(link.read(NODE, POSITION), Ok(last_request(&bench)));
}

#[test]
fn what_may_not_be_repeated_is_not_sent_late_either() {
    let (bench, mut link) = line();
    bench.leave_a_request();
    bench.world().now = bench.time() + Nanos::from_millis(10);
    assert_eq!(
        link.write(NODE, TARGET.set(5), Repeat::Never),
        Err(LinkError::Unanswered)
    );
    assert!(
        bench
            .drive(NODE, |drive| drive.written(0x607A, 0))
            .is_empty()
    );
    assert!(link.write(NODE, TARGET.set(5), Repeat::Never).is_ok());
}

#[test]
fn noise_before_a_reply_is_skipped() {
    let (bench, mut link) = line();
    bench.misbehave([Mischief::Noise]);
    assert_eq!(link.read(NODE, POSITION), Ok(1));
    assert!(link.counters().resynchronisations > 0);
    assert_eq!(link.counters().timeouts, 0);
}

#[test]
fn a_reply_cut_inside_a_doubled_byte_does_not_take_the_next_with_it() {
    let (bench, mut link) = line();
    bench.drive(NODE, |drive| drive.requests = 0x8F);
    // 90 02 00 04, four zeros of error code, then the first half of the doubled 0x90.
    bench.misbehave([Mischief::CutReply(9)]);
    assert_eq!(link.read(NODE, POSITION), Ok(last_request(&bench)));
    assert_eq!(link.counters().timeouts, 1);
}

#[test]
fn a_drive_that_waits_for_the_rest_of_a_request_is_freed() {
    let (bench, mut link) = line();
    bench.misbehave([Mischief::CutRequest(5)]);
    assert_eq!(link.read(NODE, POSITION), Ok(last_request(&bench)));
}

#[test]
fn a_dead_line_is_given_up_after_a_bounded_time() {
    let (bench, mut link) = line();
    bench.world().dead = true;
    let begin = bench.world().now;
    assert_eq!(link.read(NODE, POSITION), Err(LinkError::Lost));
    let span = bench.world().now.since(begin);
    assert!(span < Nanos::from_millis(500), "{span:?}");
    bench.world().dead = false;
    assert_eq!(
        link.read(NODE, POSITION),
        Ok(last_request(&bench)),
        "and found again"
    );
}

#[test]
fn a_silent_node_behind_a_live_line_is_unanswered_not_lost() {
    let (bench, mut link) = line();
    // The request, the two constants, and the repetition.
    bench.misbehave([
        Mischief::LoseReply,
        Mischief::Nothing,
        Mischief::Nothing,
        Mischief::LoseReply,
    ]);
    assert_eq!(link.read(NODE, POSITION), Err(LinkError::Unanswered));
    assert!(link.is_in_step());
}

#[test]
fn a_pulled_cable_is_told_from_silence() {
    let (bench, mut link) = line();
    bench.world().hung_up = true;
    assert_eq!(
        link.read(NODE, POSITION),
        Err(LinkError::Broken(std::io::ErrorKind::BrokenPipe))
    );
}

fn mischief() -> impl Strategy<Value = Mischief> {
    prop_oneof![
        4 => Just(Mischief::Nothing),
        1 => Just(Mischief::LoseRequest),
        1 => any::<usize>().prop_map(Mischief::FlipRequest),
        1 => any::<usize>().prop_map(Mischief::CutRequest),
        1 => Just(Mischief::LoseReply),
        2 => (0..150u64).prop_map(|late| Mischief::DelayReply(Nanos::from_millis(late))),
        1 => any::<usize>().prop_map(Mischief::FlipReply),
        1 => any::<usize>().prop_map(Mischief::DropReplyByte),
        1 => any::<usize>().prop_map(Mischief::DoubleReplyByte),
        1 => any::<usize>().prop_map(Mischief::CutReply),
        1 => Just(Mischief::Noise),
    ]
}

proptest! {
    /// Whatever happens on the line, a value that is believed answers the request that was just
    /// made, a set-point that is acknowledged was written, and the line never stays out of step.
    #[test]
    fn no_wrong_value_is_ever_believed(mischief in vec(mischief(), 1..60), first in 0..300u32) {
        let (bench, mut link) = line();
        bench.drive(NODE, |drive| drive.requests = first);
        bench.misbehave(mischief);
        for target in 0..40 {
            if let Ok(position) = link.read(NODE, POSITION) {
                prop_assert_eq!(position, last_request(&bench));
            }
            if link.write(NODE, TARGET.set(target), Repeat::Never).is_ok() {
                prop_assert_eq!(bench.drive(NODE, |drive| drive.target()), target);
            }
        }
        bench.world().mischief.clear();
        prop_assert!(link.read(NODE, POSITION).is_ok());
    }
}
