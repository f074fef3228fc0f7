//! The whole path of the frames; faults of cameras and folders are counted, never an angle.

use i2ris::units::Nanos;
use i2ris_vision::angle_csv::AngleRow;
use i2ris_vision::image::GreyImage;
use i2ris_vision::joint_angles::RestPoseError;
use i2ris_vision::scene::{JointPose, Rig, SnakeShape};
use i2ris_vision::scene_setup::setup;
use i2ris_vision::session::{Session, SessionError, SessionStatistics};
use i2ris_vision::source::{Frame, FrameFault};
use i2ris_vision::view_detector::{Rejection, ViewDetector};

use super::rig;

const PERIOD: u64 = 33_000_000;
/// Frames at rest, and frames that move after them.
const REST: u64 = 8;
const MOVING: u64 = 8;

fn pose(number: u64) -> JointPose {
    let step = number.saturating_sub(REST - 1) as f64;
    JointPose { pitch_rad: 0.06 * step, yaw_rad: -0.04 * step }
}

fn frame(number: u64, image: GreyImage) -> Frame {
    Frame::new(Nanos(1_000_000_000 + number * PERIOD), number, image)
}

fn film(rig: &Rig) -> [Vec<Frame>; 2] {
    let mut views = [Vec::new(), Vec::new()];
    for number in 0..REST + MOVING {
        for (view, image) in rig.render_views(pose(number), number).into_iter().enumerate() {
            views[view].push(frame(number, image));
        }
    }
    views
}

fn session(rig: &Rig) -> (Session, Vec<ViewDetector>) {
    let setup = setup(rig);
    let session = Session::new(&setup, Nanos(REST * PERIOD));
    (session, setup.views.iter().map(|view| ViewDetector::new(view.settings())).collect())
}

fn run(
    rig: &Rig,
    items: [Vec<Frame>; 2],
) -> (Result<Vec<AngleRow>, SessionError>, SessionStatistics) {
    let (mut session, mut detectors) = session(rig);
    let mut sources = items.map(Vec::into_iter);
    let mut rows = Vec::new();
    while let Some(view) = session.wanted() {
        match sources[view].next() {
            Some(item) => {
                let result = detectors[view].detect(item);
                session.take(view, result);
            }
            None => session.end(view),
        }
        match session.rows() {
            Ok(more) => rows.extend(more),
            Err(error) => return (Err(error), session.statistics().clone()),
        }
    }
    (Ok(rows), session.statistics().clone())
}

/// All rows with angles are right; the others are as many as expected and name this cause.
fn assert_gaps(rig: &Rig, items: [Vec<Frame>; 2], gaps: usize, cause: FrameFault) {
    let cause = cause.to_string();
    let (rows, statistics) = run(rig, items);
    let rows = rows.unwrap();
    for row in &rows {
        let number = (row.stamp.0 - 1_000_000_000 + PERIOD / 2) / PERIOD;
        match &row.seen {
            Ok(angles) => {
                let truth = pose(number);
                let off = |axis: usize, truth: f64| {
                    (angles.angle_rad[axis].unwrap() - truth).to_degrees().abs()
                };
                let is_near = off(0, truth.pitch_rad) < 0.1 && off(1, truth.yaw_rad) < 0.1;
                assert!(is_near, "{number}: {angles:?}");
            }
            Err(words) => assert!(words.contains(&cause), "{words}"),
        }
    }
    let missing = rows.iter().filter(|row| row.seen.is_err()).count();
    assert_eq!((missing, statistics.rows - statistics.good), (gaps, gaps), "{statistics:?}");
    let of_cause = statistics.causes.iter().filter(|((_, words), _)| words.contains(&cause));
    let counted: usize = of_cause.map(|(_, n)| n).sum();
    assert!(gaps == 0 || counted >= gaps, "{statistics:?}");
}

#[test]
fn cameras_that_are_turned_and_reversed_give_the_same_angles() {
    let mut rig = rig();
    assert_gaps(&rig, film(&rig), 0, FrameFault::NoPicture);
    // The first shows yaw with a turn, the second pitch the other way round.
    rig.cameras[0].plane_rad = f64::to_radians(97.0);
    rig.cameras[1].plane_rad = f64::to_radians(176.0);
    assert_gaps(&rig, film(&rig), 0, FrameFault::NoPicture);
}

#[test]
fn faults_of_cameras_and_files_are_gaps_with_their_cause() {
    type Change = fn(&mut [Vec<Frame>; 2]);
    let cases: [(FrameFault, usize, Change); 5] = [
        (FrameFault::Frozen, 2, |items| {
            let stuck = items[1][10].picture.clone();
            items[1][11].picture = stuck.clone();
            items[1][12].picture = stuck;
        }),
        (FrameFault::WrongSize, 1, |items| {
            items[0][9] = frame(9, GreyImage::new(320, 240, vec![9; 320 * 240]).unwrap());
        }),
        (FrameFault::NoPartner, 1, |items| drop(items[1].remove(10))),
        (FrameFault::MissingFile, 1, |it| it[0][13].picture = Err(FrameFault::MissingFile)),
        (FrameFault::Undecodable, 1, |it| it[0][13].picture = Err(FrameFault::Undecodable)),
    ];
    let rig = rig();
    for (cause, gaps, change) in cases {
        let mut items = film(&rig);
        change(&mut items);
        assert_gaps(&rig, items, gaps, cause);
    }
}

#[test]
fn stamps_out_of_order() {
    let rig = rig();
    let mut items = film(&rig);
    let late = &mut items[0][12].stamp;
    *late = Nanos(late.0 - 2 * PERIOD);
    // The frame itself, and the one of the other view that is left without a partner.
    let (rows, statistics) = run(&rig, items);
    let gaps: Vec<String> = rows.unwrap().into_iter().filter_map(|row| row.seen.err()).collect();
    assert_eq!(gaps.len(), 2, "{gaps:?}");
    assert!(gaps.iter().any(|g| g.contains(&FrameFault::OutOfOrder.to_string())), "{gaps:?}");
    assert!(gaps.iter().any(|g| g.contains(&FrameFault::NoPartner.to_string())), "{gaps:?}");
    assert_eq!(statistics.rows - statistics.good, 2);
}

#[test]
fn both_views_the_same_camera() {
    let rig = rig();
    let [first, _] = film(&rig);
    let (rows, _) = run(&rig, [first.clone(), first.clone()]);
    // No reference, hence no angle.
    assert!(matches!(rows, Err(SessionError::RestPose(RestPoseError::TooFew { .. }))));
    // From the middle on.
    let [first, mut second] = film(&rig);
    second[10..].clone_from_slice(&first[10..]);
    assert_gaps(&rig, [first, second], (REST + MOVING - 10) as usize, FrameFault::SameCamera);
}

#[test]
fn no_frame_at_all() {
    let (rows, statistics) = run(&rig(), [Vec::new(), Vec::new()]);
    assert!(matches!(rows, Err(SessionError::NoPicture)));
    assert_eq!(statistics, SessionStatistics::default());
}

#[test]
fn stalled_camera_leaves_the_other_running_without_angles() {
    let rig = rig();
    let (mut session, mut detectors) = session(&rig);
    let [first, second] = film(&rig);
    let mut rows = Vec::new();
    for (number, (a, b)) in first.into_iter().zip(second).enumerate() {
        session.take(0, detectors[0].detect(a));
        if number < 10 {
            session.take(1, detectors[1].detect(b));
        }
        rows.extend(session.rows().unwrap());
    }
    assert_eq!((session.wanted(), rows.len()), (Some(1), 10));
    let late = session.stalled(1, Nanos(9_000_000_000)).unwrap();
    assert_eq!(late.len(), 7, "six frames without a partner, and the stall itself");
    assert!(late.iter().all(|row| row.seen.is_err()));
    assert!(late[6].seen.as_ref().unwrap_err().contains(&FrameFault::NoPicture.to_string()));
}

#[test]
fn moving_snake_gives_no_reference() {
    let rig = rig();
    let mut items = film(&rig);
    for view in &mut items {
        view.drain(..5);
    }
    let (rows, _) = run(&rig, items);
    assert!(matches!(rows, Err(SessionError::RestPose(RestPoseError::Moving { .. }))));
}

#[test]
fn object_of_a_different_length_is_not_measured() {
    let rig = rig();
    let mut items = film(&rig);
    let short = Rig { snake: SnakeShape { tip_mm: 1.0, ..rig.snake }, ..rig.clone() };
    items[0][12] = frame(12, short.render_views(pose(12), 12).swap_remove(0));
    let mut detector = ViewDetector::new(setup(&rig).views[0].settings());
    let result = detector.detect(items[0][12].clone());
    assert!(result.good().is_ok() || matches!(result.good(), Err(Rejection::Quality(_))));
    let (rows, statistics) = run(&rig, items);
    assert_eq!(rows.unwrap().iter().filter(|row| row.seen.is_err()).count(), 1, "{statistics:?}");
}
