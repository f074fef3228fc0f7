//! Asking about models, and changing the one in use.

use std::path::Path;

use super::{Client, ClientError};
use crate::ipc::payload::{ModelReply, ModelRequest, text_of};
use crate::ipc::service;
use crate::model::ModelId;
use crate::robot::{ModelAction, Refusal};
use crate::units::Nanos;

/// A model is read, checked over its whole hull, and compared: seconds on a machine that does other
/// things, too.
pub(super) const PATIENCE: Nanos = Nanos::from_millis(30_000);

impl Client {
    /// The models at hand: in use, staged, in use before. Waits for the answer.
    ///
    /// # Errors
    ///
    /// [`ClientError::ModelRefused`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn models(&mut self) -> Result<ModelReply, ClientError> {
        self.ask_models(ModelAction::List, ModelRequest::default())
    }

    /// Has the controller read, check and compare a model file, and lead the model along with the
    /// motors. The model in use stays in use. Waits for the answer, up to 30 s.
    ///
    /// # Errors
    ///
    /// As [`Client::models`], and [`ClientError::Path`] for a path that does not fit a payload.
    pub fn stage_model(&mut self, file: &Path) -> Result<ModelReply, ClientError> {
        let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let mut request = ModelRequest::default();
        let bytes = absolute.as_os_str().as_encoded_bytes();
        // One byte less than there is room: the end of the path has to show.
        if bytes.len() >= request.path.len() || bytes.contains(&0) {
            return Err(ClientError::Path {
                path: absolute,
                limit: request.path.len() - 1,
            });
        }
        request
            .path
            .iter_mut()
            .zip(bytes)
            .for_each(|(to, from)| *to = *from);
        self.ask_models(ModelAction::Stage, request)
    }

    /// Lets the staged model take over, if it is this one. `force`: also while its hysteresis
    /// memory is unknown.
    ///
    /// # Errors
    ///
    /// As [`Client::models`].
    pub fn activate_model(
        &mut self,
        model: ModelId,
        force: bool,
    ) -> Result<ModelReply, ClientError> {
        let request = ModelRequest {
            model_id: model.0,
            flags: flags(force),
            ..ModelRequest::default()
        };
        self.ask_models(ModelAction::Activate, request)
    }

    /// Lets the model that was in use before take over again. `force` as in
    /// [`Client::activate_model`].
    ///
    /// # Errors
    ///
    /// As [`Client::models`].
    pub fn roll_back_model(&mut self, force: bool) -> Result<ModelReply, ClientError> {
        let request = ModelRequest {
            flags: flags(force),
            ..ModelRequest::default()
        };
        self.ask_models(ModelAction::Rollback, request)
    }

    fn ask_models(
        &mut self,
        action: ModelAction,
        request: ModelRequest,
    ) -> Result<ModelReply, ClientError> {
        let request = ModelRequest {
            client_id: self.id(),
            action: action.number(),
            ..request
        };
        let reply = self.models.ask(&self.link, request)?;
        match Refusal::from_number(reply.refusal) {
            Some(Refusal::None) => Ok(reply),
            Some(refusal) => Err(ClientError::ModelRefused {
                action,
                refusal,
                message: text_of(&reply.message),
            }),
            None => Err(ClientError::Unknown {
                request: service::MODEL,
                number: reply.refusal,
            }),
        }
    }
}

fn flags(force: bool) -> u32 {
    if force { ModelRequest::FORCE } else { 0 }
}
