//! The models at hand: the one in use, the one that waits, the one before.
//!
//! A model comes in as a [`Candidate`], a pointer that a slower thread has filled, and goes out as
//! one when it is of no use any more: nothing is built and nothing is freed in the loop. All models
//! remember the same past; see `trail`.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::EventKind;
use crate::core::event::Events;
use crate::core::model_slots::motion_history::{Mark, Trail};
use crate::core::motion::joint_space::{Joints, Remembered};
use crate::drive::AxisFeedback;
use crate::model::{History, Model, ModelId};
use crate::robot::Refusal;
use crate::units::{MotorVec, Nanos};

/// A model on its way into the cycle or out of it.
#[derive(Debug, Clone)]
pub struct Candidate(Box<Joints>);

impl Candidate {
    /// A model whose memory is rebuilt from a history that ends at a mark of the cycle's trail.
    /// Takes thousands of steps: for a slower thread.
    #[must_use]
    pub fn new(model: Arc<Model>, config: &Config, history: &History, mark: Mark) -> Self {
        Self(Box::new(Joints::recalled(model, config, history, mark)))
    }

    /// A model as it was carried into a cycle before.
    #[must_use]
    pub fn restored(model: Arc<Model>, config: &Config, carried: Carried) -> Self {
        let mut joints = Joints::new(model, config);
        joints.restore(carried.0);
        Self(Box::new(joints))
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &Model {
        self.0.model()
    }

    /// What it remembers, to be written to a file.
    #[must_use]
    pub fn carried(&self) -> Carried {
        Carried(*self.0.remembered())
    }
}

/// What a model remembers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Carried(Remembered);

/// What is asked about models, as it arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelRequest {
    /// Names the request towards the thread that has to answer it.
    pub id: u64,
    /// What is asked.
    pub change: ModelChange,
    /// Also if the hysteresis memory is not known.
    pub forced: bool,
}

/// A change of the model in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ModelChange {
    /// To the staged model, if it is this one.
    Activate(ModelId),
    /// To the former one.
    Rollback,
}

/// The answer to a [`ModelRequest`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelReply {
    /// [`ModelRequest::id`].
    pub id: u64,
    /// [`Refusal::None`] when accepted.
    pub refusal: Refusal,
}

/// The models at hand, as shown to the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ModelSlots {
    /// In use.
    pub active: Option<ModelId>,
    /// Staged, and ready to take over.
    pub staged: Option<ModelId>,
    /// The staged model has caught up with the motors, and its memory is known.
    pub staged_known: bool,
    /// In use before.
    pub former: Option<ModelId>,
}

/// The models at hand.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slots {
    active: Option<Box<Joints>>,
    staged: Option<Box<Joints>>,
    former: Option<Box<Joints>>,
    /// Of no use any more.
    retired: Option<Box<Joints>>,
}

/// The memories of the models in use, staged, and in use before.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct RememberedSlots([Option<(ModelId, Remembered)>; 3]);

impl RememberedSlots {
    /// Which models.
    pub fn models(&self) -> impl Iterator<Item = ModelId> {
        self.0.iter().flatten().map(|(id, _)| *id)
    }
}

/// What a swap of models has to know of the robot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment<'a> {
    /// The tick.
    pub now: Nanos,
    /// The motors are led through a stroke that the present model has planned.
    pub conditioning: bool,
    /// Angles are followed.
    pub following: bool,
    /// The drives, if all have reported.
    pub drives: Option<&'a [AxisFeedback]>,
    /// The set-points before rounding.
    pub setpoints: &'a MotorVec,
    /// Where the motors have been.
    pub trail: &'a Trail,
}

impl Slots {
    /// One model, in use.
    pub fn new(active: Option<Joints>) -> Self {
        Self {
            active: active.map(Box::new),
            ..Self::default()
        }
    }

    /// The model in use.
    pub fn active(&self) -> Option<&Joints> {
        self.active.as_deref()
    }

    /// The model in use.
    pub fn active_mut(&mut self) -> Option<&mut Joints> {
        self.active.as_deref_mut()
    }

    /// All but the one in use.
    pub fn others_mut(&mut self) -> impl Iterator<Item = &mut Joints> {
        [&mut self.staged, &mut self.former]
            .into_iter()
            .flatten()
            .map(Box::as_mut)
    }

    /// What is remembered: by the model in use, the staged one, the former one. `None` between a
    /// swap and the moment at which the displaced model has left.
    pub fn remembered(&self) -> Option<RememberedSlots> {
        let slot = |slot: &Option<Box<Joints>>| {
            slot.as_ref()
                .map(|joints| (joints.model().id(), *joints.remembered()))
        };
        let slots = [&self.active, &self.staged, &self.former].map(slot);
        self.open().then_some(RememberedSlots(slots))
    }

    /// The same models with the same memories. The error names a model that is not there.
    pub fn restored(
        slots: &RememberedSlots,
        config: &Config,
        model: impl Fn(ModelId) -> Option<Arc<Model>>,
    ) -> Result<Self, ModelId> {
        let slot = |slot: &Option<(ModelId, Remembered)>| -> Result<Option<Box<Joints>>, ModelId> {
            let Some((id, remembered)) = slot else {
                return Ok(None);
            };
            Ok(Some(
                Candidate::restored(model(*id).ok_or(*id)?, config, Carried(*remembered)).0,
            ))
        };
        let [active, staged, former] = &slots.0;
        Ok(Self {
            active: slot(active)?,
            staged: slot(staged)?,
            former: slot(former)?,
            retired: None,
        })
    }

    /// What the world sees.
    pub fn shown(&self, trail: &Trail) -> ModelSlots {
        let id = |slot: &Option<Box<Joints>>| slot.as_ref().map(|joints| joints.model().id());
        ModelSlots {
            active: id(&self.active),
            staged: id(&self.staged),
            staged_known: self
                .staged
                .as_ref()
                .is_some_and(|staged| staged.caught_up(trail) && staged.memory_known()),
            former: id(&self.former),
        }
    }

    /// Whether a candidate can come in: what it displaces has to have a place.
    pub fn open(&self) -> bool {
        self.retired.is_none()
    }

    /// Takes a candidate in, in place of the one that is staged.
    pub fn stage(&mut self, candidate: Candidate) {
        let displaced = self.staged.replace(candidate.0);
        if self.retired.is_none() {
            self.retired = displaced;
        }
    }

    /// What is of no use any more.
    pub fn retired(&mut self) -> Option<Candidate> {
        self.retired.take().map(Candidate)
    }

    /// Changes the model in use, or says why not and changes nothing.
    pub fn change(
        &mut self,
        request: &ModelRequest,
        moment: &Moment<'_>,
        events: &mut Events,
    ) -> Result<(), Refusal> {
        let next = self.next(request)?;
        permits(next, self.active(), request.forced, moment)?;
        // All that can fail comes before the first change.
        let drives = moment.drives.ok_or(Refusal::DrivesNotReady)?;
        let active = self.active.take();
        let slot = match request.change {
            ModelChange::Activate(_) => &mut self.staged,
            ModelChange::Rollback => &mut self.former,
        };
        let taken = match slot.as_mut() {
            Some(next) => next.take_over(active.as_deref(), drives, moment.setpoints, moment.now),
            None => return Err(Refusal::NothingStaged),
        };
        if taken.is_err() {
            self.active = active;
            return Err(Refusal::BadModel);
        }
        let from = active.as_ref().map(|joints| joints.model().id());
        match request.change {
            ModelChange::Activate(_) => {
                self.active = self.staged.take();
                self.retired = self.former.take();
                self.former = active;
            }
            ModelChange::Rollback => self.active = std::mem::replace(&mut self.former, active),
        }
        let to = self
            .active
            .as_ref()
            .map(|joints| joints.model().id())
            .unwrap_or_default();
        events.push(EventKind::Model { from, to });
        Ok(())
    }

    fn next(&self, request: &ModelRequest) -> Result<&Joints, Refusal> {
        match request.change {
            ModelChange::Activate(id) => {
                let staged = self
                    .staged
                    .as_deref()
                    .filter(|staged| staged.model().id() == id);
                // The former model has to have a place to go to.
                let staged = staged.ok_or(Refusal::NothingStaged)?;
                if self.open() {
                    Ok(staged)
                } else {
                    Err(Refusal::Busy)
                }
            }
            ModelChange::Rollback => self.former.as_deref().ok_or(Refusal::NoFormer),
        }
    }
}

fn permits(
    next: &Joints,
    active: Option<&Joints>,
    forced: bool,
    moment: &Moment<'_>,
) -> Result<(), Refusal> {
    if moment.conditioning || !next.caught_up(moment.trail) {
        return Err(Refusal::Busy);
    }
    if moment.following && !active.is_some_and(|active| active.speaks_like(next)) {
        return Err(Refusal::State);
    }
    if forced || next.memory_known() {
        Ok(())
    } else {
        Err(Refusal::MemoryUnknown)
    }
}
