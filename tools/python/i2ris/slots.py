"""The models of a controller: in use, staged and previously in use."""

from __future__ import annotations

import os

from .payload import ModelReply, ModelRequest
from .requests import Requests
from .values import ModelSlots, Refused, model, text

#: Timeout for requests about models, which are checked over their whole hull, s.
MODEL_REPLY_TIMEOUT_S = 30.0


class ModelArm:
    """The models of an arm."""

    def __init__(self, arm: Requests):
        self._arm = arm

    def list(self) -> ModelSlots:
        """The models in use, staged and previously in use."""
        return self._request(1)

    def stage(self, path: str | os.PathLike[str], other_drive: bool = False) -> ModelSlots:
        """Lets the controller read and check a model file. The model in use stays in use. ``other_drive``: also one
        that was calibrated with other settings of the drives."""
        name = os.fsencode(os.path.abspath(path))
        if len(name) >= 1024:
            raise ValueError(f"{path} is too long a path")
        return self._request(2, path=name, other_drive=other_drive)

    def activate(self, model_id: str, force: bool = False) -> ModelSlots:
        """Takes the staged model into use, if it has this id. ``force``: also while its memory is unknown."""
        return self._request(3, model_id=bytes.fromhex(model_id), force=force)

    def rollback(self, force: bool = False) -> ModelSlots:
        """Takes the previous model into use again."""
        return self._request(4, force=force)

    def _request(self, action: int, model_id: bytes = b"", path: bytes = b"",
                 force: bool = False, other_drive: bool = False) -> ModelSlots:
        if len(model_id) not in (0, 32):
            raise ValueError("a model id has 64 hexadecimal digits")
        flags = (ModelRequest.FORCE if force else 0) | (ModelRequest.OTHER_DRIVE if other_drive else 0)
        request = ModelRequest(client_id=self._arm._client_id, action=action, flags=flags)
        request.model_id[: len(model_id)] = model_id
        request.path[: len(path)] = path
        reply = self._arm._request("i2ris/model", request, ModelReply, MODEL_REPLY_TIMEOUT_S)
        if reply.refusal:
            raise Refused("a request about models", reply.refusal, text(reply.message))
        return ModelSlots(*(model(slot) for slot in reply.slots))
