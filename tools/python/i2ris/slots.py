"""The models of a controller: in use, staged and previously in use."""

from __future__ import annotations

import os

from .payload import ModelReply, ModelRequest
from .requests import Pending, Requests
from .values import ModelSlots, Refused, model, text

#: Timeout for requests about models, which are checked over their whole hull, s.
MODEL_REPLY_TIMEOUT_S = 30.0


class Staging:
    """The controller reads and checks a model file, which takes a tenth of a second. Streams continue."""

    def __init__(self, pending: Pending[ModelReply]):
        self._pending = pending
        self._slots: ModelSlots | None = None

    def is_done(self) -> bool:
        """Whether it is staged. Does not wait. Raises ``Refused`` if the controller rejects it."""
        if self._slots is None and (reply := self._pending.poll()) is not None:
            self._slots = _slots(reply)
        return self._slots is not None

    def wait(self) -> ModelSlots:
        """Waits until it is staged."""
        if self._slots is None:
            self._slots = _slots(self._pending.wait())
        return self._slots


def _slots(reply: ModelReply) -> ModelSlots:
    if reply.refusal:
        raise Refused("a request about models", reply.refusal, text(reply.message))
    return ModelSlots(*(model(slot) for slot in reply.slots))


class ModelArm:
    """The models of an arm."""

    def __init__(self, arm: Requests):
        self._arm = arm

    def list(self) -> ModelSlots:
        """The models in use, staged and previously in use."""
        return self._begin(1).wait()

    def stage(self, path: str | os.PathLike[str], other_drive: bool = False) -> Staging:
        """Lets the controller read and check a model file. The model in use stays in use. Returns at once: ``wait()`` for
        the models, or call ``is_done()`` in the loop of a stream. ``other_drive``: also one that was calibrated with other settings of the drives."""
        name = os.fsencode(os.path.abspath(path))
        if len(name) >= 1024:
            raise ValueError(f"{path} is too long a path")
        return self._begin(2, path=name, other_drive=other_drive)

    def activate(self, model_id: str, force: bool = False) -> ModelSlots:
        """Takes the staged model into use, if it has this id. ``force``: also while its memory is unknown."""
        return self._begin(3, model_id=bytes.fromhex(model_id), force=force).wait()

    def rollback(self, force: bool = False) -> ModelSlots:
        """Takes the previous model into use again."""
        return self._begin(4, force=force).wait()

    def _begin(self, action: int, model_id: bytes = b"", path: bytes = b"",
                 force: bool = False, other_drive: bool = False) -> Staging:
        if len(model_id) not in (0, 32):
            raise ValueError("a model id has 64 hexadecimal digits")
        flags = (ModelRequest.FORCE if force else 0) | (ModelRequest.OTHER_DRIVE if other_drive else 0)
        request = ModelRequest(client_id=self._arm._client_id, action=action, flags=flags)
        request.model_id[: len(model_id)] = model_id
        request.path[: len(path)] = path
        return Staging(self._arm._begin("i2ris/model", request, ModelReply, MODEL_REPLY_TIMEOUT_S))
