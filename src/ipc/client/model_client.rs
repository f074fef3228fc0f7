//! Requests about models.

use std::path::Path;

use super::controller_client::Client;
use super::error::ClientError;
use crate::ipc::payload::{ModelReply, ModelRequest, unpadded_text};
use crate::ipc::streams::RequestService;
use crate::robot::{ModelAction, ModelId, Refusal};

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
            Some(refusal) => Err(ClientError::ModelRefused {
                action,
                refusal,
                message: unpadded_text(&reply.message),
            }),
            None => Err(ClientError::Unknown {
                request: RequestService::Model.service(),
                number: reply.refusal,
            }),
        }
    }
}

fn flags(force: bool) -> u32 {
    if force { ModelRequest::FORCE } else { 0 }
}
