//! The work of an operator: input device of a running `i2ris teleop`, target of a reach-and-hold
//! task, trial of a study that is being recorded.

use i2ris::ipc::Message;
use i2ris::ipc::payload::{ReachTarget, TeleopMsg, TrialMsg, unpadded_text};
use i2ris::units::Nanos;
use serde::Serialize;

use super::{STALE, Why};

/// Age at which a task counts as over: its messages come 20 times a second.
const OVER: Nanos = Nanos::from_millis(1000);
/// Age at which the recorder counts as silent; it reports twice a second.
const SILENT: Nanos = Nanos::from_millis(2000);

/// An input device and its clutch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hand {
    /// Why the snake does not follow; `None`: it does.
    pub open: Option<String>,
    /// Share of the motion that reaches the snake.
    pub scale: f64,
    /// Where in the picture +pitch and +yaw go, deg counterclockwise from the right.
    pub directions_deg: [f64; 2],
}

impl Hand {
    /// `None`: no input device is in use now.
    pub(super) fn new(message: &TeleopMsg, now: Nanos) -> Option<Self> {
        let is_open = message.flags & TeleopMsg::OPEN != 0;
        let direction = |[right, up]: [f64; 2]| up.atan2(right).to_degrees().round();
        (message.age(now) <= STALE).then(|| Self {
            open: is_open.then(|| unpadded_text(&message.why_open)),
            scale: message.scale,
            directions_deg: message.view.map(direction),
        })
    }
}

/// The target that the operator must reach.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    pub deg: [f64; 2],
    pub tolerance_deg: f64,
    pub number: u32,
    pub total: u32,
    pub hold_s: f64,
    pub held_s: f64,
    /// The target must be followed for `hold_s`, of which `held_s` have passed.
    pub follow: bool,
    /// Pose compared with the target: `camera` or `estimate`.
    pub by: &'static str,
}

impl Target {
    /// `None`: there is no target any more.
    pub(super) fn new(message: &ReachTarget, now: Nanos) -> Option<Self> {
        let is_last = message.flags & ReachTarget::ENDED != 0 && message.number >= message.total;
        if is_last || message.age(now) > OVER {
            return None;
        }
        let by_camera = message.flags & ReachTarget::BY_CAMERA != 0;
        Some(Self {
            deg: [message.position[0].to_degrees(), message.position[1].to_degrees()],
            tolerance_deg: message.tolerance.to_degrees(),
            number: message.number,
            total: message.total,
            hold_s: Nanos(message.hold_ns).as_seconds(),
            held_s: Nanos(message.held_ns.min(message.hold_ns)).as_seconds(),
            follow: message.flags & ReachTarget::FOLLOW != 0,
            by: if by_camera { "camera" } else { "estimate" },
        })
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trial {
    /// Participant, condition and number.
    pub name: String,
    pub for_s: f64,
    /// The newest mark: number and text.
    pub mark: Option<(u32, String)>,
    /// Since then.
    pub mark_age_s: Option<f64>,
    /// Why recording has stopped.
    pub problem: Option<&'static str>,
}

impl Trial {
    /// `None`: no trial runs.
    pub(super) fn new(message: &TrialMsg, now: Nanos) -> Option<Self> {
        let has = |flag: u32| message.flags & flag != 0;
        let problem = match (has(TrialMsg::ENDED), has(TrialMsg::FAILED)) {
            (true, _) => return None,
            (false, true) => Some("its recording has failed"),
            (false, false) => (message.age(now) > SILENT).then_some("its recorder is silent"),
        };
        let is_marked = message.mark_number > 0;
        let since = |stamp: u64| now.duration_since(Nanos(stamp)).as_seconds().round();
        Some(Self {
            name: unpadded_text(&message.trial),
            for_s: since(message.started_ns),
            mark: is_marked.then(|| (message.mark_number, unpadded_text(&message.mark))),
            mark_age_s: is_marked.then(|| since(message.mark_ns)),
            problem,
        })
    }

    pub fn line(&self) -> String {
        let Self { name, for_s, .. } = self;
        match (self.problem, &self.mark) {
            (Some(problem), _) => format!("TRIAL {name} IS NOT BEING RECORDED: {problem}"),
            (None, Some((number, text))) => {
                format!("trial {name} for {for_s:.0} s, mark {number}: {text}")
            }
            (None, None) => format!("trial {name} for {for_s:.0} s"),
        }
    }

    /// The problem and the recommended action.
    pub(super) fn why(&self) -> Option<Why> {
        let text = format!("trial {} is no longer recorded: {}", self.name, self.problem?);
        let advice = "free disk space if the disk is full, then run `i2ris record trial stop \
                      --outcome aborted` and repeat the trial; the robot keeps running";
        let (sentence, advice) = (text.clone(), advice.to_owned());
        Some(Why { sentence, text, advice, age_s: Some(0.0), ..Why::default() })
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::padded_text;

    use super::*;

    #[test]
    fn a_target_is_shown_until_the_task_is_over() {
        let now = Nanos::from_millis(5000);
        let message = ReachTarget {
            stamp_ns: now.0,
            position: [0.1, -0.2, 0.0],
            number: 2,
            total: 2,
            held_ns: 500_000_000,
            hold_ns: 1_000_000_000,
            ..ReachTarget::default()
        };
        let target = Target::new(&message, now).unwrap();
        assert_eq!((target.number, target.held_s, target.by), (2, 0.5, "estimate"));
        assert!((target.deg[1] + 11.459).abs() < 1e-3);
        let ended = ReachTarget { flags: ReachTarget::ENDED | ReachTarget::HELD, ..message };
        assert_eq!(Target::new(&ended, now), None);
        assert!(Target::new(&ReachTarget { number: 1, ..ended }, now).is_some());
        assert_eq!(Target::new(&message, now + Nanos::from_millis(1001)), None);
    }

    fn message() -> TrialMsg {
        TrialMsg {
            stamp_ns: 9_000_000_000,
            started_ns: 5_000_000_000,
            trial: padded_text("P07-joystick-01"),
            ..TrialMsg::default()
        }
    }

    #[test]
    fn a_running_trial_is_shown_with_its_newest_mark() {
        let now = Nanos::from_millis(9100);
        assert_eq!(Trial::new(&message(), now).unwrap().line(), "trial P07-joystick-01 for 4 s");
        let marked = TrialMsg {
            mark_ns: 8_000_000_000,
            mark_number: 3,
            mark: padded_text("contact"),
            ..message()
        };
        let shown = Trial::new(&marked, now).unwrap();
        assert_eq!(shown.line(), "trial P07-joystick-01 for 4 s, mark 3: contact");
        assert_eq!((shown.mark_age_s, shown.why()), (Some(1.0), None));
        let ended = TrialMsg { flags: TrialMsg::ENDED, ..marked };
        assert_eq!(Trial::new(&ended, now), None);
    }

    #[test]
    fn an_unrecorded_trial_is_reported() {
        let failed = TrialMsg { flags: TrialMsg::FAILED, ..message() };
        for (message, now, why) in [
            (failed, 9100, "its recording has failed"),
            (message(), 11_100, "its recorder is silent"),
        ] {
            let shown = Trial::new(&message, Nanos::from_millis(now)).unwrap();
            assert_eq!(shown.line(), format!("TRIAL P07-joystick-01 IS NOT BEING RECORDED: {why}"));
            assert!(shown.why().unwrap().text.ends_with(why));
        }
    }
}
