use super::*;

const START_UNIX_NS: u64 = 1_795_000_000_000_000_000;
const MS: u64 = 1_000_000;

fn writer(participant: u8, entity: u8) -> Writer {
    let mut bytes = [participant; 16];
    bytes[15] = entity;
    Writer(bytes)
}

/// Times of a message that was sent and arrives at these milliseconds.
fn times(sent_ms: u64, arrived_ms: u64) -> Times {
    Times {
        arrived: Nanos(50_000 * MS + arrived_ms * MS),
        arrived_unix_ns: START_UNIX_NS + arrived_ms * MS,
        sent_unix_ns: Some(START_UNIX_NS + sent_ms * MS),
    }
}

/// Admission that listens since these milliseconds.
fn listening(since_ms: u64) -> Admission {
    let limit = Nanos::from_millis(2000);
    let since_ns = START_UNIX_NS + since_ms * MS;
    Admission::new(Ages { oldest: limit, ahead: limit, since_ns })
}

fn pose(pitch: f64) -> Pose {
    checked(&[pitch, 0.0], 2).unwrap()
}

fn servo(
    admission: &mut Admission,
    writer: Writer,
    sent_ms: u64,
    arrived_ms: u64,
) -> Result<Admitted, Reason> {
    let times = times(sent_ms, arrived_ms);
    admission.servo(writer, Topic::ServoJp, 1, &times)
}

#[test]
fn values_of_wrong_number_or_not_finite_are_refused() {
    assert_eq!(pose(0.25).position, [0.25, 0.0, 0.0]);
    for wrong in [&[][..], &[1.0], &[1.0; 3], &[0.0; 1000]] {
        let given = wrong.len();
        assert_eq!(checked(wrong, 2), Err(Reason::Length { given, joints: 2 }));
    }
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(checked(&[0.0, wrong], 2), Err(Reason::NotFinite));
    }
    let none = Reason::Length { given: 0, joints: 0 };
    assert_eq!(checked(&[], 0), Err(none));
}

#[test]
fn first_message_sets_the_clock_and_stored_ones_are_refused() {
    let (mut admission, one) = (listening(0), writer(1, 1));
    // Stored for a minute, and delivered with nine others in one burst.
    let kept = servo(&mut admission, one, 1000, 61_000);
    assert_eq!(kept, Err(Reason::FirstOfStream));
    let live = servo(&mut admission, one, 61_010, 61_010).unwrap();
    assert_eq!(live.stamp, times(0, 61_010).arrived);
    let late = servo(&mut admission, one, 61_020, 61_220).unwrap();
    // Minus the possible drift of the clocks in this time.
    let in_transit = late.stamp.duration_since(times(0, 61_020).arrived);
    assert!(in_transit < Nanos::from_millis(1), "200 ms in transit: {in_transit:?}");
}

#[test]
fn constant_delay_counts_as_silence() {
    let (mut admission, one) = (listening(0), writer(1, 1));
    let _ = servo(&mut admission, one, 0, 0);
    for at in (10..1000).step_by(10) {
        servo(&mut admission, one, at, at).unwrap();
    }
    // Half a second late from here on, for a minute, and then prompt again.
    for sent in (1000..60_000).step_by(10) {
        let refused = servo(&mut admission, one, sent, sent + 500);
        assert!(matches!(refused, Err(Reason::Late(_))), "{refused:?}");
    }
    let prompt = servo(&mut admission, one, 60_600, 60_600);
    assert!(prompt.is_ok(), "the controller knows whether it was in motion: {prompt:?}");
}

#[test]
fn clock_offset_of_hours_does_not_affect_a_stream() {
    let (mut admission, one) = (listening(0), writer(1, 1));
    let ahead = 7_200_000;
    let _ = servo(&mut admission, one, ahead, 0);
    let live = servo(&mut admission, one, ahead + 10, 10).unwrap();
    assert_eq!(live.stamp, times(0, 10).arrived);
}

#[test]
fn one_client_has_one_identity_unlike_a_second_publisher() {
    let mut admission = listening(0);
    let mut id = |writer, topic| {
        let now = times(0, 0).arrived;
        admission.client_id(writer, topic, now).unwrap()
    };
    let servo = id(writer(1, 1), Topic::ServoJp);
    assert_eq!(id(writer(1, 2), Topic::MoveJp), servo);
    assert_eq!(id(writer(1, 3), Topic::StateCommand), servo);
    assert_eq!(id(writer(1, 1), Topic::ServoJp), servo);
    let second = id(writer(1, 4), Topic::ServoJp);
    assert_ne!(second, servo, "the same process, a different publisher");
    assert_ne!(id(writer(2, 1), Topic::ServoJp), servo, "a different process");
}

#[test]
fn many_publishers_or_processes_do_not_fill_the_memory() {
    let mut admission = listening(0);
    let refused = (0..200).filter(|entity| {
        let outcome = servo(&mut admission, writer(1, *entity), 0, 0);
        outcome == Err(Reason::TooManyWriters)
    });
    assert_eq!(refused.count(), 200 - CLIENTS_PER_PARTICIPANT);
    for participant in 0..=255 {
        let arrived = 10 + u64::from(participant);
        // One speaks all the time: the most silent is replaced.
        for participant in [0, participant] {
            let _ = servo(&mut admission, writer(participant, 1), arrived, arrived);
        }
    }
    let kept = |participant| admission.peers.contains_key(&writer(participant, 1).participant());
    assert_eq!((0..=255).filter(|it| kept(*it)).count(), PARTICIPANTS);
    assert!(kept(0) && kept(255) && !kept(1));
}

#[test]
fn old_single_command_is_refused_by_either_stamp() {
    let (mut admission, one) = (listening(0), writer(1, 1));
    let mut once = |header_ms: Option<u64>, times: &Times| {
        let header = header_ms.map(|ms| START_UNIX_NS + ms * MS);
        admission.once(one, Topic::StateCommand, header, times)
    };
    assert!(once(None, &times(9_999, 10_000)).is_ok());
    assert!(once(Some(9_000), &times(9_999, 10_000)).is_ok());
    for (header, sent) in [(None, 7_000), (Some(7_000), 10_000), (None, 13_000)] {
        let refused = once(header, &times(sent, 10_000));
        assert!(matches!(refused, Err(Reason::Old { .. })), "{refused:?}");
    }
    let no_stamp = Times { sent_unix_ns: None, ..times(0, 10_000) };
    assert_eq!(once(None, &no_stamp), Err(Reason::NoStamp));
}

#[test]
fn command_from_before_subscription_is_refused() {
    let mut admission = listening(1000);
    let mut once = |times| admission.once(writer(1, 1), Topic::MoveJp, None, &times);
    assert!(matches!(once(times(999, 1500)), Err(Reason::Old { .. })));
    assert!(once(times(1001, 1500)).is_ok());
}

#[test]
fn stop_passes_without_stamp_in_floods_from_any_publisher() {
    for topic in [Topic::Hold, Topic::StateCommand] {
        let mut admission = listening(0);
        let old = times(0, 100_000);
        for entity in 0..=CLIENTS_PER_PARTICIPANT as u8 {
            for _ in 0..5000 {
                for times in [old, Times { sent_unix_ns: None, ..old }] {
                    assert_ne!(admission.stop(writer(1, entity), topic, &times), 0);
                }
            }
        }
    }
}

#[test]
fn hold_passes_in_a_flood_without_ending_it() {
    let (mut admission, one) = (listening(0), writer(1, 1));
    for _ in 0..5000 {
        let _ = servo(&mut admission, one, 0, 0);
    }
    admission.stop(writer(1, 2), Topic::Hold, &times(10, 10));
    for after_ms in [20, 1100] {
        let refused = servo(&mut admission, one, after_ms, after_ms);
        assert!(matches!(refused, Err(Reason::Flood { .. })), "{refused:?}");
    }
}

/// A message that was stored while its client was gone.
#[test]
fn first_message_of_a_returning_client_is_refused() {
    let (mut admission, one) = (listening(0), writer(1, 1));
    let _ = servo(&mut admission, one, 0, 0);
    servo(&mut admission, one, 10, 10).unwrap();
    admission.lost(one.participant());
    let first = Err(Reason::FirstOfStream);
    assert_eq!(servo(&mut admission, one, 29_990, 29_990), first);
    assert!(servo(&mut admission, one, 30_000, 30_000).is_ok());
}

#[test]
fn a_publisher_that_is_opened_again_has_the_place_of_the_closed_one() {
    let mut admission = listening(0);
    let first = admission.client_id(writer(1, 0), Topic::ServoJp, times(0, 0).arrived);
    for entity in 0..10 {
        let (one, at) = (writer(1, entity), 100 * u64::from(entity));
        assert_eq!(servo(&mut admission, one, at, at), Err(Reason::FirstOfStream));
        let live = servo(&mut admission, one, at + 10, at + 10).unwrap();
        assert_eq!(Some(live.client_id), first, "{entity}");
        admission.closed(one);
    }
}

fn share_taken(per_second: u64, seconds: u64) -> f64 {
    let (mut flood, total) = (Flood::default(), per_second * seconds);
    let at = |place: u64| Nanos(1 + place * 1_000_000_000 / per_second);
    let taken = (0..total).filter(|place| flood.check(1, at(*place)).is_ok());
    taken.count() as f64 / total as f64
}

#[test]
fn a_thousand_messages_a_second_pass_and_a_flood_ends() {
    assert_eq!(share_taken(1000, 3), 1.0);
    // 2000 in the first second, and nothing after that.
    assert!(share_taken(10_000, 3) < 0.07);
}

#[test]
fn client_that_stops_flooding_passes_again() {
    let mut flood = Flood::default();
    let ms = |ms: u64| Nanos::from_millis(1000 + ms);
    assert!(flood.check(5000, ms(0)).is_err());
    assert!(flood.check(1, ms(1100)).is_err(), "the previous window");
    assert!(flood.check(1, ms(2200)).is_ok());
}
