//! The adaptation, tick by tick.

use serde::{Deserialize, Serialize};

use super::budget::{BudgetUse, NEARLY_USED_UP, USED_UP, inside};
use super::estimator::{Estimator, Integral};
use super::excitation::Excitation;
pub(in crate::core) use super::fences::Surroundings;
use super::fences::{Conditions, Score, SlipDetector};
use super::frames::{Frame, FrameFilter, FrameUse, Moment, RegressorRing, Regressors};
use super::moving_correction::{MovedGoal, MovingCorrection};
use super::{AdaptationReport, Method, Pause, Pauses, Settings, length};
use crate::config::Config;
use crate::core::drift::geometry::{ModelGeometry, pair, subtract};
use crate::core::drift::{Drift, DriftMemories, PARAMETERS};
use crate::core::events::{AdaptationEvent, CycleEventKind, EventList};
use crate::core::inputs::ExternalPose;
use crate::core::motion::joint_model::JointModel;
use crate::model::{Memory, ModelId};
use crate::units::Nanos;

/// The budget counts as used up after this long at its end, s: of a parameter whose value is known,
/// and of one that may only have swung there and comes back.
const BEYOND_S: f64 = 3.0;
const BEYOND_UNKNOWN_S: f64 = 60.0;

/// A reverted correction is tried once more: after the robot has been disabled, because the camera
/// may have been moved back, or at once if it came from the first frames only. After the second
/// time, only a new model or a restart of the controller resets it.
const MAX_REVERTS: u32 = 2;

/// A wire slips once; repeated slips come from a moving camera.
const MAX_SLIPS: u32 = 1;

#[derive(Debug, Clone, Copy)]
pub(in crate::core) struct Adaptation {
    settings: Settings,
    pub state: AdaptationState,
}

/// A frame, the robot at its exposure, and the model.
#[derive(Clone, Copy)]
struct Seen<'a> {
    frame: &'a Frame,
    regressors: &'a Regressors,
    geometry: &'a ModelGeometry,
}

/// Everything that changes from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::core) struct AdaptationState {
    model: Option<ModelId>,
    /// They follow the positions with the active model.
    pub memories: DriftMemories,
    ring: RegressorRing,
    filter: FrameFilter,
    estimator: Estimator,
    integral: Integral,
    excitation: Excitation,
    slip: SlipDetector,
    score: Score,
    conditions: Conditions,
    correction: MovingCorrection,
    used: BudgetUse,
    beyond_s: f64,
    is_used_up: bool,
    /// Slips since the robot was disabled, or since a model swap.
    slips: u32,
    is_reverted: bool,
    taken_back: u32,
    /// The model of the last reverted correction, and its number of reversions.
    refuted: Option<(ModelId, u32)>,
    pauses: Pauses,
}

impl AdaptationState {
    /// Whether the correction was reverted too often to be tried again.
    fn is_refuted(&self) -> bool {
        let of = |(model, times)| Some(model) == self.model && times >= MAX_REVERTS;
        self.refuted.is_some_and(of)
    }

    fn note_refuted(&mut self) {
        let before = self.refuted.filter(|(model, _)| Some(*model) == self.model);
        let times = before.map_or(0, |(_, times)| times).saturating_add(1);
        self.refuted = self.model.map(|model| (model, times));
    }
}

impl Adaptation {
    /// `None` if it is switched off.
    pub(crate) fn new(config: &Config) -> Option<Self> {
        let settings = Settings::new(config.limits.plausibility_deg, config.control.period());
        config.adaptation.enabled.then(|| Self { settings, state: AdaptationState::default() })
    }

    /// The memory of the active model as calibrated, while there is a correction.
    pub(crate) fn calibrated_memory(&self, joints: &JointModel) -> Option<&Memory> {
        let is_own = self.state.model == Some(joints.model().id());
        (is_own && joints.geometry().is_some()).then_some(&self.state.memories.calibrated)
    }

    /// Restarts when the next model takes over or the encoder zero moves. `from`: the model in use
    /// until now; its correction is removed.
    pub(crate) fn begin(&mut self, from: Option<&mut JointModel>, now: Nanos) {
        if let Some(from) = from
            && Some(from.model().id()) == self.state.model
        {
            from.end_correction(&self.state.memories.calibrated);
        }
        self.state = AdaptationState {
            filter: self.state.filter,
            taken_back: self.state.taken_back,
            refuted: self.state.refuted,
            ..AdaptationState::default()
        };
        self.state.conditions.unsettle(now);
    }

    /// One tick, after its feedback.
    pub(crate) fn step(
        &mut self,
        joints: &mut JointModel,
        frame: Option<&ExternalPose>,
        surroundings: &Surroundings,
        events: &mut EventList,
    ) {
        let now = surroundings.now;
        let id = joints.model().id();
        if self.state.model != Some(id) {
            self.begin(None, now);
            self.state.model = Some(id);
            self.state.memories = DriftMemories::new(joints.measured_memory());
            let slow = joints.geometry().and_then(|geometry| geometry.slow);
            self.state.estimator = Estimator::new(slow.as_ref());
            self.state.is_reverted = self.state.is_refuted();
        }
        if surroundings.is_unsettled {
            self.state.conditions.unsettle(now);
        }
        if surroundings.is_disabled {
            // The operator has had a chance to check it.
            self.state.is_reverted = self.state.is_refuted();
            self.state.slips = 0;
        }
        if joints.geometry().is_none() {
            return;
        }
        self.record(joints);
        self.find_pauses(joints, surroundings);
        if let Some(frame) = frame
            && let Some(geometry) = joints.geometry()
        {
            self.take_frame(frame, geometry, now, events);
        }
        self.move_correction(joints, now);
    }

    fn record(&mut self, joints: &JointModel) {
        let Some(measured) = joints.measured_at() else { return };
        if !self.state.ring.is_due(measured.stamp) {
            return;
        }
        let (model, memories) = (joints.model(), &self.state.memories);
        let gapped = pair(&measured.gapped);
        self.state.ring.push(Moment {
            stamp: measured.stamp,
            calibrated: memories.calibrated_pose(model, &measured.position),
            gapped,
            adapted: pair(&measured.adapted),
            slopes: memories.slopes(model, &measured.position, gapped),
            wear: joints.applied_drift().worn(),
        });
    }

    fn find_pauses(&mut self, joints: &JointModel, surroundings: &Surroundings) {
        let state = &mut self.state;
        let in_hull = joints
            .measured_at()
            .is_some_and(|measured| joints.model().hull().contains(&measured.position));
        let silence = state.filter.silence(surroundings.now);
        let moves = state.excitation.excited_parameters().iter().any(|shown| *shown);
        state.pauses = state
            .conditions
            .pauses(surroundings, silence)
            .with(Pause::MemoryUnknown, !joints.is_memory_known())
            .with(Pause::OutsideHull, !in_hull)
            .with(Pause::BudgetUsed, state.is_used_up)
            .with(Pause::Reverted, state.is_reverted)
            .with(Pause::SlippedAgain, state.slips > MAX_SLIPS)
            .with(Pause::NoMotion, !moves);
    }

    fn take_frame(
        &mut self,
        frame: &ExternalPose,
        geometry: &ModelGeometry,
        now: Nanos,
        events: &mut EventList,
    ) {
        let state = &mut self.state;
        let quality = self.settings.least_quality;
        let Some(frame) = state.filter.take(frame, geometry.outputs, quality, now) else { return };
        let latency_s = state.estimator.drift().latency_s;
        let Some(regressors) = state.ring.at(frame.stamp, latency_s) else {
            state.filter.counts.too_old += 1;
            return;
        };
        let seconds = frame.interval_s.min(1.0);
        state.excitation.add(&regressors, seconds);
        if self.state.pauses.look_away() {
            self.state.filter.counts.paused += 1;
            if self.state.pauses.contains(Pause::Settling) {
                self.state.score.restart();
            }
            return;
        }
        let seen = Seen { frame: &frame, regressors: &regressors, geometry };
        let has_slipped = self.state.slips > MAX_SLIPS;
        if self.state.is_used_up || self.state.is_reverted || has_slipped {
            self.state.filter.counts.paused += 1;
        } else {
            match geometry.has_gap {
                true => self.filter_frame(seen, events),
                false => self.integrate_frame(seen, events),
            }
            self.update_budget(seconds, geometry, events);
        }
        self.judge(seen, now, events);
    }

    fn filter_frame(&mut self, seen: Seen<'_>, events: &mut EventList) {
        let Seen { frame, regressors, geometry } = seen;
        let (state, settings) = (&mut self.state, &self.settings);
        let is_learning = !state.pauses.contains(Pause::CameraRejected);
        let shown = state.excitation.excited_parameters();
        state.estimator.predict(frame.interval_s, geometry.slow.as_ref());
        let shown = is_learning.then_some(&shown);
        let found = state.estimator.update(frame.pose, regressors, shown, geometry, settings);
        let seconds = frame.interval_s.min(1.0);
        let model = length(geometry.deviation);
        let slip = state.slip.add(found.value, model, settings.largest_step, seconds);
        if let Some(step) = slip {
            state.slips = state.slips.saturating_add(1);
            let is_followed = state.slips <= MAX_SLIPS;
            if is_followed {
                state.estimator.open_zero(step);
                state.conditions.accept_camera();
            }
            let (slip, again) = (AdaptationEvent::Slip, AdaptationEvent::SlipAgain);
            events.push(CycleEventKind::Adaptation(if is_followed { slip } else { again }));
        }
        let used = FrameUse { is_accepted: found.is_accepted, is_learning };
        self.count(used, seconds, events);
    }

    fn integrate_frame(&mut self, seen: Seen<'_>, events: &mut EventList) {
        let Seen { frame, regressors, geometry } = seen;
        let state = &mut self.state;
        let is_learning = !state.pauses.contains(Pause::CameraRejected)
            && state.excitation.excited_parameters().first() == Some(&true);
        // Sum of the applied and the pending correction.
        let zero = state.integral.zero;
        let expected = [0, 1].map(|output| regressors.moment.gapped[output] + zero[output]);
        let error = subtract(frame.pose, expected);
        let model = length(geometry.deviation);
        let is_accepted = state.integral.add(error, model, frame, is_learning);
        self.count(FrameUse { is_accepted, is_learning }, frame.interval_s.min(1.0), events);
    }

    fn count(&mut self, used: FrameUse, seconds: f64, events: &mut EventList) {
        let FrameUse { is_accepted, is_learning } = used;
        let counts = &mut self.state.filter.counts;
        let count = match (is_accepted, is_learning) {
            (true, true) => &mut counts.used,
            (true, false) => &mut counts.paused,
            (false, _) => &mut counts.refused,
        };
        *count += 1;
        if is_learning || !is_accepted {
            self.state.score.count(is_accepted);
        }
        if let Some(is_accepted) = self.state.conditions.add_frame(is_accepted, seconds) {
            let [accepted, rejected] =
                [AdaptationEvent::CameraAccepted, AdaptationEvent::CameraRejected];
            events.push(CycleEventKind::Adaptation(if is_accepted { accepted } else { rejected }));
        }
    }

    fn update_budget(&mut self, seconds: f64, geometry: &ModelGeometry, events: &mut EventList) {
        let drift = self.drift(geometry);
        let (state, settings) = (&mut self.state, &self.settings);
        let reach = state.excitation.reach();
        let used_by = |drift: &Drift| BudgetUse::new(drift, geometry, &reach, settings);
        state.used = used_by(&drift);
        let used = state.used.largest();
        // A correction that is kept at the end of its budget no longer explains the frames.
        let is_refused = used >= NEARLY_USED_UP && state.pauses.contains(Pause::CameraRejected);
        // An integral swings with the hysteresis: the filter's first deviations keep it unknown.
        let total = |it: &Drift| used_by(it).total;
        let deviations = state.estimator.deviations();
        let is_known = is_refused || state.used.is_known(&drift, &deviations, total);
        let seconds = if is_refused || used >= USED_UP { seconds } else { -seconds };
        state.beyond_s = (state.beyond_s + seconds).max(0.0);
        if geometry.has_gap {
            state.estimator.drift = inside(&drift, geometry, &reach, settings).to_array();
        }
        let most = if is_known { BEYOND_S } else { BEYOND_UNKNOWN_S };
        if state.beyond_s >= most && !state.is_used_up {
            state.is_used_up = true;
            events.push(CycleEventKind::Adaptation(AdaptationEvent::BudgetUsed));
        }
    }

    fn judge(&mut self, seen: Seen<'_>, now: Nanos, events: &mut EventList) {
        let (pose, moment) = (seen.frame.pose, &seen.regressors.moment);
        let errors = [moment.calibrated, moment.adapted].map(|it| subtract(pose, it));
        let state = &mut self.state;
        if state.score.add(errors, state.is_reverted, now) {
            // A correction misled by its first frames restarts at once, the first time.
            let is_first = state.refuted.is_none_or(|(model, _)| Some(model) != state.model);
            state.is_reverted = !(is_first && state.score.failed_from_start());
            state.conditions.accept_camera();
            state.taken_back = state.taken_back.saturating_add(1);
            state.note_refuted();
            state.estimator = Estimator::new(seen.geometry.slow.as_ref());
            state.integral = Integral::default();
            // The budget is reset with the learned values: it is tried once more.
            state.used = BudgetUse::default();
            (state.is_used_up, state.beyond_s) = (false, 0.0);
            events.push(CycleEventKind::Adaptation(AdaptationEvent::Reverted));
        }
    }

    /// The correction moves with the goal, and only while the robot is settled.
    fn move_correction(&mut self, joints: &mut JointModel, now: Nanos) {
        let Some(geometry) = joints.geometry() else { return };
        let motion = geometry.counts(pair(joints.goal_motion()));
        if self.state.conditions.is_settled(now) {
            let drift = self.drift(geometry);
            let reach = self.state.excitation.reach();
            let inside = inside(&drift, geometry, &reach, &self.settings);
            let pose = pair(&joints.setpoint().unwrap_or_default());
            let goal = MovedGoal { pose, motion };
            self.state.correction.advance(&inside, &goal, &reach, geometry, &self.settings);
        }
        joints.set_correction(self.state.correction.correction(geometry));
    }

    fn drift(&self, geometry: &ModelGeometry) -> Drift {
        if geometry.has_gap {
            self.state.estimator.drift()
        } else {
            Drift { zero: self.state.integral.zero, ..Drift::default() }
        }
    }

    /// The pose as calibrated, at the last moment.
    pub(crate) fn calibrated_pose(&self) -> Option<[f64; 2]> {
        self.state.ring.newest().map(|moment| moment.calibrated)
    }

    pub(crate) fn report(&self, joints: Option<&JointModel>) -> AdaptationReport {
        let state = &self.state;
        let [calibrated_error, adapted_error] = state.score.last;
        let (frames, taken_back) = (state.filter.counts, state.taken_back);
        let Some((joints, geometry)) = joints.and_then(|joints| Some((joints, joints.geometry()?)))
        else {
            return AdaptationReport { frames, taken_back, ..AdaptationReport::default() };
        };
        let deviations = state.estimator.deviations();
        AdaptationReport {
            model: state.model,
            method: if geometry.has_gap { Method::Filter } else { Method::Integral },
            estimate: self.drift(geometry),
            deviations: if geometry.has_gap { deviations } else { [0.0; PARAMETERS] },
            applied: joints.applied_drift(),
            budget_used: state.used.parameters,
            total_used: state.used.total,
            excited: state.excitation.excited_parameters(),
            pauses: state.pauses,
            frames,
            calibrated_error,
            adapted_error,
            taken_back,
        }
    }
}
