//! The whole way of the pictures, and everything that cameras and folders do wrong: named, counted,
//! never an angle.
#![allow(clippy::unwrap_used, reason = "a test may")]

use i2ris::units::Nanos;
use i2ris_vision::accuracy::setup;
use i2ris_vision::image::Grey;
use i2ris_vision::look::{Cause, Eye};
use i2ris_vision::record::Row;
use i2ris_vision::rest::RestError;
use i2ris_vision::scene::{Pose, Rig};
use i2ris_vision::session::{Reference, Session, SessionError, Tally};
use i2ris_vision::source::{Frame, Gap, Shot};

const PERIOD: u64 = 33_000_000;
/// Pictures at rest, and pictures that move after them.
const REST: u64 = 8;
const MOVING: u64 = 8;

fn rig() -> Rig {
    Rig::laboratory(640, 480, 100.0)
}

fn pose(number: u64) -> Pose {
    let step = number.saturating_sub(REST - 1) as f64;
    Pose {
        pitch_rad: 0.06 * step,
        yaw_rad: -0.04 * step,
    }
}

fn frame(number: u64, picture: Grey) -> Shot {
    Shot::Frame(Frame {
        stamp: Nanos(1_000_000_000 + number * PERIOD),
        name: number.to_string(),
        picture,
    })
}

/// Shots of both views.
fn film(rig: &Rig) -> [Vec<Shot>; 2] {
    let mut views = [Vec::new(), Vec::new()];
    for number in 0..REST + MOVING {
        for (view, picture) in rig.shoot(pose(number), number).into_iter().enumerate() {
            views[view].push(frame(number, picture));
        }
    }
    views
}

fn run(rig: &Rig, shots: [Vec<Shot>; 2]) -> (Result<Vec<Row>, SessionError>, Tally) {
    let setup = setup(rig);
    let mut session = Session::new(&setup, Reference::First(Nanos(REST * PERIOD))).unwrap();
    let mut eyes: Vec<Eye> = setup
        .views
        .iter()
        .map(|view| Eye::new(view.settings()))
        .collect();
    let mut sources = shots.map(Vec::into_iter);
    let mut rows = Vec::new();
    while let Some(view) = session.wanted() {
        match sources[view].next() {
            Some(shot) => {
                let look = eyes[view].look(shot);
                session.take(view, look);
            }
            None => session.end(view),
        }
        match session.rows() {
            Ok(more) => rows.extend(more),
            Err(error) => return (Err(error), session.tally().clone()),
        }
    }
    (Ok(rows), session.tally().clone())
}

/// All rows with angles are right; the others are as many as expected and name this cause.
fn assert_gaps(rig: &Rig, shots: [Vec<Shot>; 2], gaps: usize, cause: &str) {
    let (rows, tally) = run(rig, shots);
    let rows = rows.unwrap();
    for row in &rows {
        let number = (row.stamp.0 - 1_000_000_000 + PERIOD / 2) / PERIOD;
        match &row.seen {
            Ok(joints) => {
                let truth = pose(number);
                let off = |axis: usize, truth: f64| {
                    (joints.angle_rad[axis].unwrap() - truth).to_degrees().abs()
                };
                assert!(
                    off(0, truth.pitch_rad) < 0.1 && off(1, truth.yaw_rad) < 0.1,
                    "{number}: {joints:?}"
                );
            }
            Err(words) => assert!(words.contains(cause), "{words}"),
        }
    }
    let missing = rows.iter().filter(|row| row.seen.is_err()).count();
    assert_eq!(
        (missing, tally.rows - tally.good),
        (gaps, gaps),
        "{tally:?}"
    );
    let counted: usize = tally
        .causes
        .iter()
        .filter(|((_, words), _)| words.contains(cause))
        .map(|(_, n)| n)
        .sum();
    assert!(gaps == 0 || counted >= gaps, "{tally:?}");
}

#[test]
fn clear_pictures_of_two_views_give_both_angles() {
    let rig = rig();
    assert_gaps(&rig, film(&rig), 0, "");
}

#[test]
fn cameras_that_are_turned_and_reversed_give_the_same_angles() {
    let mut rig = rig();
    // The first shows yaw with a turn, the second pitch the other way round.
    rig.cameras[0].plane_rad = f64::to_radians(97.0);
    rig.cameras[1].plane_rad = f64::to_radians(176.0);
    assert_gaps(&rig, film(&rig), 0, "");
}

#[test]
fn a_frozen_camera() {
    let rig = rig();
    let mut shots = film(&rig);
    let Shot::Frame(stuck) = shots[1][10].clone() else {
        panic!("a frame")
    };
    shots[1][11] = frame(11, stuck.picture.clone());
    shots[1][12] = frame(12, stuck.picture);
    assert_gaps(&rig, shots, 2, Gap::Frozen.text());
}

#[test]
fn a_picture_of_another_size() {
    let rig = rig();
    let mut shots = film(&rig);
    shots[0][9] = frame(9, Grey::new(320, 240, vec![9; 320 * 240]).unwrap());
    assert_gaps(&rig, shots, 1, Gap::WrongSize.text());
}

#[test]
fn stamps_out_of_order() {
    let rig = rig();
    let mut shots = film(&rig);
    let Shot::Frame(late) = &mut shots[0][12] else {
        panic!("a frame")
    };
    late.stamp = Nanos(late.stamp.0 - 2 * PERIOD);
    // The picture itself, and the one of the other view that is left without a partner.
    let (rows, tally) = run(&rig, shots);
    let gaps: Vec<String> = rows
        .unwrap()
        .into_iter()
        .filter_map(|row| row.seen.err())
        .collect();
    assert_eq!(gaps.len(), 2, "{gaps:?}");
    assert!(
        gaps.iter().any(|g| g.contains(Gap::OutOfOrder.text())),
        "{gaps:?}"
    );
    assert!(
        gaps.iter().any(|g| g.contains(Gap::NoPartner.text())),
        "{gaps:?}"
    );
    assert_eq!(tally.rows - tally.good, 2);
}

#[test]
fn a_picture_that_one_view_lacks() {
    let rig = rig();
    let mut shots = film(&rig);
    shots[1].remove(10);
    assert_gaps(&rig, shots, 1, Gap::NoPartner.text());
}

#[test]
fn a_missing_file_and_a_broken_one() {
    let rig = rig();
    for cause in [Gap::MissingFile, Gap::Undecodable] {
        let mut shots = film(&rig);
        shots[0][13] = Shot::Gap {
            stamp: shots[0][13].stamp(),
            name: "13".into(),
            cause,
        };
        assert_gaps(&rig, shots, 1, cause.text());
    }
}

#[test]
fn both_views_the_same_camera() {
    let rig = rig();
    let [first, _] = film(&rig);
    let (rows, _) = run(&rig, [first.clone(), first.clone()]);
    assert!(
        matches!(rows, Err(SessionError::Rest(RestError::TooFew { .. }))),
        "no reference, hence no angle"
    );
    // From the middle on.
    let [first, mut second] = film(&rig);
    second[10..].clone_from_slice(&first[10..]);
    assert_gaps(
        &rig,
        [first, second],
        (REST + MOVING - 10) as usize,
        Gap::SameCamera.text(),
    );
}

#[test]
fn no_picture_at_all() {
    let (rows, tally) = run(&rig(), [Vec::new(), Vec::new()]);
    assert!(matches!(rows, Err(SessionError::NoPicture)));
    assert_eq!(tally, Tally::default());
}

#[test]
fn a_camera_that_stalls_lets_the_other_one_go_on_without_angles() {
    let rig = rig();
    let setup = setup(&rig);
    let mut session = Session::new(&setup, Reference::First(Nanos(REST * PERIOD))).unwrap();
    let mut eyes: Vec<Eye> = setup
        .views
        .iter()
        .map(|view| Eye::new(view.settings()))
        .collect();
    let [first, second] = film(&rig);
    let mut rows = Vec::new();
    for (number, (a, b)) in first.into_iter().zip(second).enumerate() {
        session.take(0, eyes[0].look(a));
        if number < 10 {
            session.take(1, eyes[1].look(b));
        }
        rows.extend(session.rows().unwrap());
    }
    assert_eq!((session.wanted(), rows.len()), (Some(1), 10));
    let late = session.stalled(1, Nanos(9_000_000_000)).unwrap();
    assert_eq!(
        late.len(),
        7,
        "six pictures without a partner, and the stall itself"
    );
    assert!(late.iter().all(|row| row.seen.is_err()));
    assert!(
        late[6]
            .seen
            .as_ref()
            .unwrap_err()
            .contains(Gap::NoPicture.text())
    );
}

#[test]
fn a_snake_that_moves_in_the_first_seconds_is_no_reference() {
    let rig = rig();
    let mut shots = film(&rig);
    for view in &mut shots {
        view.drain(..5);
    }
    let (rows, _) = run(&rig, shots);
    assert!(matches!(
        rows,
        Err(SessionError::Rest(RestError::Moving { .. }))
    ));
}

#[test]
fn something_else_of_another_length_is_not_taken_for_the_snake() {
    let rig = rig();
    let mut shots = film(&rig);
    let short = Rig {
        snake: i2ris_vision::scene::Snake {
            tip_mm: 1.0,
            ..rig.snake
        },
        ..rig.clone()
    };
    shots[0][12] = frame(12, short.shoot(pose(12), 12).swap_remove(0));
    let mut eye = Eye::new(setup(&rig).views[0].settings());
    let look = eye.look(shots[0][12].clone());
    assert!(look.good().is_ok() || matches!(look.good(), Err(Cause::Doubt(_))));
    let (rows, tally) = run(&rig, shots);
    assert_eq!(
        rows.unwrap().iter().filter(|row| row.seen.is_err()).count(),
        1,
        "{tally:?}"
    );
}
