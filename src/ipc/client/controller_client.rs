//! Requests to the controller: version, changes of state, models, black boxes; waiting for a state.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::commander::Commander;
use super::controller_link::ControllerLink;
use super::error::ClientError;
use super::publishers::{Announcement, Announcer, padded};
use super::request_client::RequestForwarder;
use super::subscription::{Latest, Watcher};
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::payload::{
    BlackBoxRequest, JointState, ModelReply, ModelRequest, MoveRequest, OperatingStateMsg,
    StateCommandReply, StateCommandRequest, Version, VersionRequest, VirtualFixtureRequest,
    unpadded_text,
};
use crate::ipc::streams::RequestService;
use crate::robot::{
    FixtureAction, FixtureKind, ModelAction, ModelId, OperatingState, Refusal, StateCommand,
};
use crate::units::{MAX_OUTPUTS, Nanos};

/// Polling period of calls that wait.
pub(super) const POLL_PERIOD: Nanos = Nanos::from_millis(2);

/// A client of a controller, with the identity that can hold the lease.
#[derive(Debug)]
pub struct Client {
    pub(super) link: Arc<ControllerLink>,
    pub(super) requests: RequestForwarder,
    operating_state: Latest<OperatingStateMsg>,
    /// Opened when it is read first.
    measured: Option<Latest<JointState>>,
    /// Opened when a move is waited for.
    pub(super) setpoint: Option<Latest<JointState>>,
    /// Last joint-space goal, rad.
    pub(super) goal: Option<[f64; MAX_OUTPUTS]>,
}

impl Client {
    /// Connects to the controller of a domain; waits for one up to `timeout`.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] when there is none in time, [`ClientError::Interface`] when it
    /// has another version, [`ClientError::Transport`] when iceoryx2 fails.
    pub fn connect(domain: &Domain, timeout: impl Into<Nanos>) -> Result<Self, ClientError> {
        let timeout = timeout.into();
        let link = ControllerLink::new(domain);
        let start = clock::now();
        while let Err(error) = link.session(clock::now()) {
            if !error.is_absent() || clock::now().duration_since(start) >= timeout {
                return Err(error);
            }
            clock::sleep(POLL_PERIOD);
        }
        Ok(Self {
            operating_state: Latest::new(Watcher::with_link(&link).own_state()),
            requests: RequestForwarder::with_link(&link),
            measured: None,
            setpoint: None,
            goal: None,
            link,
        })
    }

    /// The identity in commands: random, not 0.
    #[must_use]
    pub fn id(&self) -> u64 {
        self.link.client_id
    }

    /// Version of the domain's controller. Waits for the reply, at most 1 s.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`], [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn version(&mut self) -> Result<Version, ClientError> {
        self.requests.version(VersionRequest::default())
    }

    /// Requests a change of state and returns the state right after it. Waits for the reply, at
    /// most 1 s; longer operations continue after it: [`Client::carry_out`] waits for the effect.
    ///
    /// # Errors
    ///
    /// [`ClientError::Refused`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn state_command(&mut self, command: StateCommand) -> Result<OperatingState, ClientError> {
        let (client_id, number) = (self.id(), command.number());
        let request = StateCommandRequest { client_id, command: number, ..Default::default() };
        check_reply(command, self.requests.state_command(request)?)
    }

    /// Requests a motion to a pose (pitch and yaw, rad), from rest to rest on a straight line with
    /// limited jerk, and returns the state right after the request. [`Client::wait_until_done`]
    /// waits for the arrival.
    ///
    /// # Errors
    ///
    /// See [`Client::state_command`]; also [`ClientError::Count`] for a wrong number of values.
    pub fn move_jp(&mut self, position: &[f64]) -> Result<OperatingState, ClientError> {
        self.request_move(position, 0)
    }

    /// Moves as [`Client::move_jp`] to the pose whose tip is nearest to a place (x, y, z, base
    /// frame, m). Refused if the distance exceeds 0.1 mm.
    ///
    /// # Errors
    ///
    /// See [`Client::state_command`].
    pub fn move_cp(&mut self, place: [f64; 3]) -> Result<OperatingState, ClientError> {
        self.request_move(&place, MoveRequest::TIP)
    }

    fn request_move(
        &mut self,
        position: &[f64],
        flags: u32,
    ) -> Result<OperatingState, ClientError> {
        let (position, count) = padded(position)?;
        let client_id = self.id();
        let request = MoveRequest { client_id, position, count, flags, ..MoveRequest::default() };
        self.goal = (flags == 0).then_some(position);
        check_reply(StateCommand::Move, self.requests.move_jp(request)?)
    }

    /// Requests a change of the virtual fixtures. `region`: the kind of the region to add and its
    /// values as [`FixtureKind`] says, rad or m.
    ///
    /// # Errors
    ///
    /// See [`Client::state_command`].
    pub fn virtual_fixture(
        &mut self,
        action: FixtureAction,
        region: Option<(FixtureKind, [f64; 4])>,
    ) -> Result<OperatingState, ClientError> {
        let (kind, values) = region.unwrap_or((FixtureKind::None, [0.0; 4]));
        let request = VirtualFixtureRequest {
            client_id: self.id(),
            action: action.number(),
            kind: kind.number(),
            values,
            ..VirtualFixtureRequest::default()
        };
        check_reply(StateCommand::Fixture, self.requests.virtual_fixture(request)?)
    }

    /// The newest `operating_state`; `None` until the first one arrives, up to 50 ms after
    /// connecting.
    ///
    /// # Errors
    ///
    /// See [`super::Subscription::read`].
    pub fn operating_state(&mut self) -> Result<Option<OperatingStateMsg>, ClientError> {
        self.operating_state.refresh().map(|message| message.copied())
    }

    /// Newest measured joints: angles, rad, and velocities, rad/s. `None` until the first message
    /// arrives, up to 50 ms after the first call.
    ///
    /// # Errors
    ///
    /// As [`super::Subscription::read`].
    pub fn measured_js(&mut self) -> Result<Option<JointState>, ClientError> {
        let link = &self.link;
        let measured = self
            .measured
            .get_or_insert_with(|| Latest::new(Watcher::with_link(link).measured_js()));
        measured.refresh().map(|message| message.copied())
    }

    /// Powers the drives on and waits until the robot is enabled, at most `timeout`.
    ///
    /// # Errors
    ///
    /// As [`Client::carry_out`]; [`ClientError::WaitCancelled`] after `timeout`.
    pub fn enable(&mut self, timeout: impl Into<Nanos>) -> Result<OperatingStateMsg, ClientError> {
        let (start, timeout) = (clock::now(), timeout.into());
        let is_late = || clock::now().duration_since(start) > timeout;
        self.carry_out(StateCommand::Enable, is_late)
    }

    /// Waits until the operating state fulfils `condition`, at most `timeout`, and returns it.
    /// States from before the call are ignored: they may precede a request that was just answered.
    ///
    /// # Errors
    ///
    /// [`ClientError::Timeout`] when it does not, and as [`super::Subscription::read`] when the
    /// controller ends.
    pub fn wait_for(
        &mut self,
        timeout: Nanos,
        condition: impl Fn(&OperatingStateMsg) -> bool,
    ) -> Result<OperatingStateMsg, ClientError> {
        let start = clock::now();
        loop {
            match self.operating_state()? {
                Some(state) if state.stamp_ns > start.0 && condition(&state) => return Ok(state),
                _ if clock::now().duration_since(start) > timeout => {
                    return Err(ClientError::Timeout(timeout));
                }
                _ => clock::sleep(POLL_PERIOD),
            }
        }
    }

    /// Lets the controller write a black box and returns the path of the file. Waits for the reply,
    /// up to 30 s.
    ///
    /// # Errors
    ///
    /// [`ClientError::BlackBox`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn write_black_box(&mut self) -> Result<PathBuf, ClientError> {
        let client_id = self.id();
        let reply = self.requests.black_box(BlackBoxRequest { client_id })?;
        let text = unpadded_text(&reply.text);
        if reply.ticks == 0 {
            return Err(ClientError::BlackBox(text));
        }
        Ok(text.into())
    }

    /// A sender of servo commands with the identity of this client.
    #[must_use]
    pub fn commander(&self) -> Commander {
        Commander::new(&self.link)
    }

    /// A publisher of messages for other clients, with the identity of this one.
    #[must_use]
    #[cfg(feature = "controller")]
    pub fn announcer<T: Announcement>(&self) -> Announcer<T> {
        Announcer::new(&self.link)
    }

    /// Access to all streams of the controller.
    #[must_use]
    pub fn watcher(&self) -> Watcher {
        Watcher::with_link(&self.link)
    }
}

fn check_reply(
    command: StateCommand,
    reply: StateCommandReply,
) -> Result<OperatingState, ClientError> {
    let request = RequestService::StateCommand.service();
    let unknown = |number| ClientError::Unknown { request, number };
    let state = OperatingState::from_number(reply.state);
    match Refusal::from_number(reply.refusal).ok_or_else(|| unknown(reply.refusal))? {
        Refusal::None => state.ok_or_else(|| unknown(reply.state)),
        refusal => {
            Err(ClientError::Refused { command, refusal, measurement: reply.measurement(), state })
        }
    }
}

impl Client {
    /// The loaded models: in use, staged, previously in use. Waits for the reply, up to 30 s; so do
    /// all requests about models.
    ///
    /// # Errors
    ///
    /// [`ClientError::ModelRefused`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn models(&mut self) -> Result<ModelReply, ClientError> {
        self.request_models(ModelAction::List, ModelRequest::default())
    }

    /// Lets the controller read and check a model file and compare it with the model in use, which
    /// stays in use. The staged model follows the motors from then on.
    ///
    /// # Errors
    ///
    /// See [`Client::models`]; also [`ClientError::Path`] for a path that does not fit a payload.
    pub fn stage_model(&mut self, file: &Path) -> Result<ModelReply, ClientError> {
        self.stage(file, 0)
    }

    /// The same for a model that was calibrated with other settings of the drives.
    ///
    /// # Errors
    ///
    /// See [`Client::stage_model`].
    pub fn stage_model_of_other_drive(&mut self, file: &Path) -> Result<ModelReply, ClientError> {
        self.stage(file, ModelRequest::OTHER_DRIVE)
    }

    fn stage(&mut self, file: &Path, flags: u32) -> Result<ModelReply, ClientError> {
        let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let mut request = ModelRequest { flags, ..ModelRequest::default() };
        let bytes = path.as_os_str().as_encoded_bytes();
        // The last byte of the field stays 0, so that the end of the path is known.
        let limit = request.path.len() - 1;
        if bytes.len() > limit || bytes.contains(&0) {
            return Err(ClientError::Path { path, limit });
        }
        for (to, from) in request.path.iter_mut().zip(bytes) {
            *to = *from;
        }
        self.request_models(ModelAction::Stage, request)
    }

    /// Takes the staged model into use, if it has this id. `force`: also while its hysteresis
    /// memory is unknown.
    ///
    /// # Errors
    ///
    /// See [`Client::models`].
    pub fn activate_model(
        &mut self,
        model: ModelId,
        force: bool,
    ) -> Result<ModelReply, ClientError> {
        let request =
            ModelRequest { model_id: model.0, flags: flags(force), ..ModelRequest::default() };
        self.request_models(ModelAction::Activate, request)
    }

    /// Takes the previous model into use again. `force` as in [`Client::activate_model`].
    ///
    /// # Errors
    ///
    /// See [`Client::models`].
    pub fn roll_back_model(&mut self, force: bool) -> Result<ModelReply, ClientError> {
        let request = ModelRequest { flags: flags(force), ..ModelRequest::default() };
        self.request_models(ModelAction::Rollback, request)
    }

    fn request_models(
        &mut self,
        action: ModelAction,
        mut request: ModelRequest,
    ) -> Result<ModelReply, ClientError> {
        request.client_id = self.id();
        request.action = action.number();
        let reply = self.requests.model(request)?;
        match Refusal::from_number(reply.refusal) {
            Some(Refusal::None) => Ok(reply),
            Some(refusal) => {
                let message = unpadded_text(&reply.message);
                Err(ClientError::ModelRefused { action, refusal, message })
            }
            None => {
                let (request, number) = (RequestService::Model.service(), reply.refusal);
                Err(ClientError::Unknown { request, number })
            }
        }
    }
}

fn flags(force: bool) -> u32 {
    if force { ModelRequest::FORCE } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reply(refusal: u32, state: u32) -> Result<OperatingState, ClientError> {
        let reply = StateCommandReply { refusal, state, ..StateCommandReply::default() };
        check_reply(StateCommand::Enable, reply)
    }

    #[test]
    fn a_refusal_becomes_a_sentence_with_the_reason() {
        let disabled = OperatingState::Disabled.number();
        let error = reply(Refusal::NotHomed.number(), disabled).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the controller refuses `enable` in state DISABLED: refusal 6: not homed: the zero of \
             an axis is unknown; action: straighten the snake, then `i2ris home`"
        );
    }

    #[test]
    fn an_accepted_command_returns_the_state() {
        let enabled = OperatingState::Enabled;
        assert_eq!(reply(0, enabled.number()).unwrap(), enabled);
    }

    #[test]
    fn unknown_numbers_are_errors() {
        for (refusal, state, unknown) in [(99, 0, 99), (0, 42, 42)] {
            let error = reply(refusal, state).unwrap_err();
            assert!(matches!(error, ClientError::Unknown { number, .. } if number == unknown));
        }
    }

    #[test]
    fn clients_can_change_threads() {
        fn is_send<T: Send>() {}
        is_send::<Client>();
        is_send::<Commander>();
        is_send::<Latest<OperatingStateMsg>>();
        is_send::<crate::ipc::client::ExternalPublisher>();
    }
}
