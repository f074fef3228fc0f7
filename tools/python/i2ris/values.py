"""Messages of the robot as values, and its refusals and faults as exceptions."""

from __future__ import annotations

import ctypes
from ctypes import c_uint8
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .payload import ModelSlot, ReasonMsg, StateCommandReply
from .reasons import ADVICE, FAULTS, QUANTITIES, REFUSALS

STATES = {0: "DISABLED", 1: "ENABLED", 2: "PAUSED", 3: "FAULT"}
#: Kinds in ``error`` and ``warning``.
FAULT_KIND, REFUSAL_KIND, STOP_KIND = 1, 2, 3


class Refused(Exception):
    """The controller refuses a command; nothing has changed. ``str()`` gives what ``i2ris status`` prints."""

    def __init__(self, what: str, code: int, detail: str = "", measured: str = ""):
        #: The reason, in words.
        self.reason: str = detail or refusal_text(code)
        #: The reason as a number, see ``REFUSALS``.
        self.code: int = code
        #: The measured value and the limit; empty where they are not known.
        self.measured: str = measured
        #: What to do.
        self.advice: str = ADVICE.get((REFUSAL_KIND, code), "")
        super().__init__(f"the controller refuses {what}: {_sentence('refusal', self)}")


class Fault(Exception):
    """The robot is in FAULT; ``str()`` gives what ``i2ris status`` prints."""

    def __init__(self, what: str, code: int, measured: str = ""):
        #: The cause, in words.
        self.reason: str = FAULTS.get(code, f"unknown fault {code}")
        #: The cause as a number, see ``FAULTS``.
        self.code: int = code
        #: The measured value and the limit; empty where they are not known.
        self.measured: str = measured
        #: What to do.
        self.advice: str = ADVICE.get((FAULT_KIND, code), "")
        super().__init__(f"{what}the robot is in FAULT: {_sentence('fault', self)}")


def _sentence(kind: str, error: Refused | Fault) -> str:
    """The text of every outlet: code, sentence, measured value and limit, what to do."""
    measured = f" ({error.measured})" if error.measured else ""
    return f"{kind} {error.code}: {error.reason}{measured}; action: {error.advice}"


@dataclass(frozen=True)
class Reason:
    """Reason why the robot does not move as commanded: a message of ``error`` or ``warning``."""

    stamp_ns: int
    #: 1 fault, 2 refusal, 3 stop, 4 clip; and the number within its kind.
    kind: int
    code: int
    #: Code, sentence, measured value and limit.
    text: str
    #: What to do.
    advice: str
    #: It concerns a command of this client.
    own: bool
    #: Measured value and limit; empty where they are not known.
    measured: str


class Stopped(Exception):
    """An operation ended before it was carried out: paused, disabled or held by a client."""


class OutOfReach(Exception):
    """The pose is outside the calibrated hull, the position limits or the joint limits."""


class NoReply(Exception):
    """The controller does not reply."""


@dataclass(frozen=True)
class Joints:
    """Angles at an instant. ``valid`` is False while no model is loaded."""

    stamp_ns: int
    #: Pitch and yaw, rad (x, y, z, m, for a model of the tip).
    position: npt.NDArray[Any]
    #: Per second.
    velocity: npt.NDArray[Any]
    #: Standard deviation of ``position``; 0 where it is not known.
    deviation: npt.NDArray[Any]
    valid: bool
    #: Whether the branch of the hysteresis loop is known.
    memory_known: bool
    #: The goal was outside the calibrated hull.
    clipped: bool
    sequence: int


@dataclass(frozen=True)
class Actuators:
    """Motors at an instant."""

    stamp_ns: int
    measured_counts: npt.NDArray[Any]
    measured_stamp_ns: npt.NDArray[Any]
    setpoint_counts: npt.NDArray[Any]
    current_ma: npt.NDArray[Any]
    error_code: npt.NDArray[Any]
    sequence: int


@dataclass(frozen=True)
class LoadedModel:
    """A loaded model."""

    #: SHA-256, hexadecimal.
    id: str
    family: str
    file: str
    memory_known: bool
    #: Root mean square error per output on training data and on data held out, in degrees (millimetres).
    training_rms: npt.NDArray[Any]
    held_out_rms: npt.NDArray[Any]


@dataclass(frozen=True)
class ModelSlots:
    """The loaded models; None for an empty slot."""

    active: LoadedModel | None
    staged: LoadedModel | None
    previous: LoadedModel | None


@dataclass(frozen=True)
class OperatingState:
    """State of the controller."""

    stamp_ns: int
    state: str
    fault: str
    homed: bool
    busy: bool
    holding: bool
    memory_known: bool
    #: This client holds the lease; any client holds it.
    lease: bool
    taken: bool
    #: Servo commands of all clients.
    accepted: int
    refused: int
    #: Reason why the last servo command of this client was refused; empty if none was.
    last_refusal: str
    #: The same as a number; 0 if none was.
    last_refusal_code: int = 0
    #: Refused servo commands of this client. Restarts after a second without one, if others need the place.
    own_refused: int = 0
    #: The fault as a number, see ``FAULTS``.
    fault_code: int = 0
    #: A model is loaded.
    model: bool = False
    #: No setpoint moves.
    at_rest: bool = False
    #: Every drive reports that it has no power.
    off: bool = False
    #: Cause that interrupted the last enabling, homing, conditioning cycle or move, or a stream since then, see
    #: ``STOPS``; 0: still running, or completed.
    broken_off: int = 0
    #: Identifies this start of the controller.
    boot_id: int = 0


def model(slot: ModelSlot) -> LoadedModel | None:
    if not slot.flags & ModelSlot.PRESENT:
        return None
    return LoadedModel(
        id=bytes(slot.model_id).hex(),
        family=text(slot.family),
        file=text(slot.file),
        memory_known=bool(slot.flags & ModelSlot.MEMORY_KNOWN),
        training_rms=np.array(slot.training_rms[: slot.outputs]),
        held_out_rms=np.array(slot.held_out_rms[: slot.outputs]),
    )


def text(field: ctypes.Array[c_uint8]) -> str:
    return bytes(field).split(b"\0", 1)[0].decode("utf-8", "replace")


def measurement(message: ReasonMsg | StateCommandReply) -> str:
    """Measured value and limit, in the format of ``src/robot/measurement.rs``."""
    if not message.flags & ReasonMsg.MEASURED:
        return ""
    motor = f"motor {message.motor}: " if message.flags & ReasonMsg.MOTOR else ""
    limit = f", limit {_value(message.quantity, message.limit)}" if message.flags & ReasonMsg.LIMIT else ""
    return f"{motor}{_value(message.quantity, message.measured)}{limit}"


def _value(quantity: int, value: float) -> str:
    unit = QUANTITIES.get(quantity, "")
    if unit in ("error code", "statusword"):
        return f"{unit} 0x{int(value):04X}"
    if unit == "sequence number":
        return f"{unit} {value:.0f}"
    digits = {"deg": 2, "mm": 2, "ms": 1}.get(unit, 0)
    return f"{value:.{digits}f} {unit}"


def refusal_text(number: int) -> str:
    return REFUSALS.get(number, f"unknown reason {number}")
