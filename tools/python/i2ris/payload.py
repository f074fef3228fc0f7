"""The messages, byte for byte as in ``src/ipc/payload``; the fields are documented there.

Angles are radians, stamps are nanoseconds of the monotonic clock (``time.monotonic_ns()``), motors turn in counts.
A test compares names, sizes and offsets with those of the controller.
"""

import ctypes
from ctypes import c_double, c_int32, c_uint8, c_uint16, c_uint32, c_uint64
from typing import Any

#: Common version of all payloads. Client and controller must have the same.
INTERFACE_VERSION = 7


class Payload(ctypes.Structure):
    """A message of fixed size. ``NAME`` is its name in iceoryx2, with the version of its layout."""

    NAME = ""

    @classmethod
    def type_name(cls) -> str:
        return cls.NAME

    def __repr__(self) -> str:
        def text_of_value(value: Any) -> Any:
            if not isinstance(value, ctypes.Array):
                return value
            if value._type_ is c_uint8:
                text = bytes(value).rstrip(b"\0")
                return text.decode() if text.isascii() and text.decode().isprintable() else bytes(value).hex()
            return [text_of_value(entry) for entry in value]

        fields = ", ".join(f"{field[0]}={text_of_value(getattr(self, field[0]))}" for field in self._fields_)
        return f"{type(self).__name__}({fields})"


class ServoJp(Payload):
    """``servo_jp``, in: go to these angles now. By its flags also ``servo_jv``, ``interpolate_jp``, ``servo_cp`` and
    ``servo_cv``.
    """

    NAME = "I2risServoJpV1"
    CLUTCH = 1
    RATE = 2
    INTERPOLATE = 4
    TIP = 8
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("client_id", c_uint64),
        ("deadline_ns", c_uint64),
        ("position", c_double * 3),
        ("count", c_uint32),
        ("flags", c_uint32),
    ]


class ServoActuator(Payload):
    """``actuators/servo_jp``, in: turn the motors to these encoder positions now."""

    NAME = "I2risServoActuatorV1"
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("client_id", c_uint64),
        ("deadline_ns", c_uint64),
        ("position_counts", c_int32 * 2),
        ("count", c_uint32),
        ("flags", c_uint32),
    ]


class JointState(Payload):
    """``measured_js``, ``setpoint_js``, ``goal_js``, out: angles."""

    NAME = "I2risJointStateV1"
    VALID = 1
    MEMORY_KNOWN = 2
    CLIPPED = 4
    FIXTURE = 8
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("position", c_double * 3),
        ("velocity", c_double * 3),
        ("deviation", c_double * 3),
        ("model_id", c_uint8 * 32),
        ("count", c_uint32),
        ("flags", c_uint32),
    ]


class ActuatorState(Payload):
    """``actuators/measured_js``, out: the motors."""

    NAME = "I2risActuatorStateV1"
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("measured_stamp_ns", c_uint64 * 2),
        ("written_stamp_ns", c_uint64 * 2),
        ("command_stamp_ns", c_uint64 * 2),
        ("command_sequence", c_uint64 * 2),
        ("exchanges", c_uint64 * 2),
        ("measured_counts", c_int32 * 2),
        ("setpoint_counts", c_int32 * 2),
        ("written_counts", c_int32 * 2),
        ("current_ma", c_int32 * 2),
        ("statusword", c_uint16 * 2),
        ("error_code", c_uint16 * 2),
        ("phase", c_uint8 * 2),
        ("reserved", c_uint8 * 2),
        ("count", c_uint32),
    ]


class OperatingStateMsg(Payload):
    """``operating_state``, out: state of the controller and its reason."""

    NAME = "I2risOperatingStateV2"
    HOMED = 1
    BUSY = 2
    MODEL = 4
    MEMORY_KNOWN = 8
    HOLDING = 16
    CLIPPED = 32
    FIFO = 64
    MEMORY_LOCKED = 128
    PINNED = 256
    WATCHED = 512
    COMPARED = 1024
    FIXTURE = 2048
    AT_REST = 4096
    OFF = 8192
    STOPPED = 16384
    #: Bit position of the stop that interrupted the last activity.
    BROKEN_OFF_SHIFT = 28
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("since_ns", c_uint64),
        ("lease_client_id", c_uint64),
        ("accepted", c_uint64),
        ("refused", c_uint64),
        ("stale_stops", c_uint64),
        ("state", c_uint32),
        ("fault", c_uint32),
        ("last_refusal", c_uint32),
        ("flags", c_uint32),
        ("refused_client_id", c_uint64 * 8),
        ("refused_commands", c_uint64 * 8),
        ("refused_reason", c_uint32 * 8),
    ]


class SpanSummary(Payload):
    """Percentiles of a distribution of durations, ns."""

    NAME = "I2risSpanSummaryV1"
    _fields_ = [
        ("p50_ns", c_uint64),
        ("p90_ns", c_uint64),
        ("p99_ns", c_uint64),
        ("p999_ns", c_uint64),
        ("max_ns", c_uint64),
    ]


class Health(Payload):
    """``health``, out, once a second: failures and losses since the start of the controller."""

    NAME = "I2risHealthV1"
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("ipc_failures", c_uint64),
        ("lost_events", c_uint64),
        ("lost_reports", c_uint64),
        ("lost_records", c_uint64),
        ("lost_replies", c_uint64),
        ("timeouts", c_uint64 * 2),
        ("crc_errors", c_uint64 * 2),
        ("resynchronisations", c_uint64 * 2),
        ("retries", c_uint64 * 2),
    ]


class AdaptationMsg(Payload):
    """``adaptation``, out: the drift from the calibration that the camera shows.

    Arrays of 14: zero of both outputs (rad), gain of output 0 by outputs 0 and 1, of output 1 by
    outputs 0 and 1, growth of the gap of both motors, latency of the camera (s), slow state (rad), loss of
    preload of both motors beyond the gap and growth of half the play of both gears (shares of half the
    calibrated range).
    """

    NAME = "I2risAdaptationV2"
    ON = 1
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("model_id", c_uint8 * 32),
        ("estimate", c_double * 14),
        ("deviation", c_double * 14),
        ("applied", c_double * 14),
        ("budget_used", c_double * 14),
        ("total_used", c_double),
        ("calibrated_error", c_double),
        ("adapted_error", c_double),
        ("frames_used", c_uint64),
        ("frames_refused", c_uint64),
        ("frames_paused", c_uint64),
        ("frames_dropped", c_uint64 * 6),
        ("taken_back", c_uint32),
        ("method", c_uint32),
        ("pauses", c_uint32),
        ("excited", c_uint32),
        ("flags", c_uint32),
        ("reserved", c_uint32),
    ]


class VirtualFixturesMsg(Payload):
    """``virtual_fixtures``, out: regions that the snake may not enter.

    ``active`` has a bit per region. The values of a region depend on its kind, as in ``VirtualFixtureRequest``; a
    polygon (5) has the number of its corners and pitch and yaw of each.
    """

    NAME = "I2risVirtualFixturesV1"
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("active", c_uint32),
        ("limited_by", c_uint32),
        ("kind", c_uint32 * 8),
        ("values", (c_double * 17) * 8),
        ("name", (c_uint8 * 24) * 8),
    ]


class EventMsg(Payload):
    """``events``, out: a line of the log, UTF-8, padded with 0."""

    NAME = "I2risEventV1"
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("text", c_uint8 * 232),
    ]


class ReasonMsg(Payload):
    """``error`` (faults) and ``warning`` (refusals, stops, clips), out: reason why the robot does not move as commanded."""

    NAME = "I2risReasonV1"
    MEASURED = 1
    LIMIT = 2
    MOTOR = 4
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("client_id", c_uint64),
        ("measured", c_double),
        ("limit", c_double),
        ("kind", c_uint32),
        ("number", c_uint32),
        ("quantity", c_uint32),
        ("motor", c_uint32),
        ("flags", c_uint32),
        ("reserved", c_uint32),
        ("text", c_uint8 * 192),
        ("advice", c_uint8 * 128),
    ]


class ReachTarget(Payload):
    """``reach_target``, between clients: the target to reach and hold, or to follow."""

    NAME = "I2risReachTargetV1"
    ENDED = 1
    HELD = 2
    BY_CAMERA = 4
    FOLLOW = 8
    RUN_IN_NS = 3_000_000_000
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("client_id", c_uint64),
        ("shown_ns", c_uint64),
        ("hold_ns", c_uint64),
        ("held_ns", c_uint64),
        ("position", c_double * 3),
        ("tolerance", c_double),
        ("number", c_uint32),
        ("total", c_uint32),
        ("count", c_uint32),
        ("flags", c_uint32),
    ]


class TeleopMsg(Payload):
    """``teleop``, between clients: input of a person with an input device."""

    NAME = "I2risTeleopV1"
    OPEN = 1
    VIEW_MEASURED = 2
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("client_id", c_uint64),
        ("view", c_double * 2 * 2),
        ("push", c_double * 2),
        ("scale", c_double),
        ("event_ns", c_uint64),
        ("command_sequence", c_uint64),
        ("mark_ns", c_uint64),
        ("mode", c_uint32),
        ("flags", c_uint32),
        ("why_open", c_uint8 * 128),
    ]


class TrialMsg(Payload):
    """``trial``, between clients: the trial being recorded, and its newest mark."""

    NAME = "I2risTrialV1"
    ENDED = 1
    FAILED = 2
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("client_id", c_uint64),
        ("started_ns", c_uint64),
        ("mark_ns", c_uint64),
        ("mark_number", c_uint32),
        ("flags", c_uint32),
        ("trial", c_uint8 * 64),
        ("mark", c_uint8 * 64),
    ]


class PeriodStatistics(Payload):
    """``period_statistics``, out, once a second: timing of the control loop."""

    NAME = "I2risPeriodStatisticsV2"
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("boot_id", c_uint64),
        ("window_ns", c_uint64),
        ("period_ns", c_uint64),
        ("ticks", c_uint64),
        ("missed", c_uint64),
        ("total_ticks", c_uint64),
        ("total_missed", c_uint64),
        ("period", SpanSummary),
        ("lateness", SpanSummary),
        ("compute", SpanSummary),
        ("line_setpoints_hz", c_double),
        ("line_exchange_ns", c_uint64),
        ("line_stop_ns", c_uint64),
        ("line_stale_ns", c_uint64),
        ("priority", c_uint32),
        ("cpu", c_uint32),
        ("memory_locked", c_uint32),
        ("reserved", c_uint32),
    ]


class ExternalPosition(Payload):
    """``external/measured_jp``, in: angles measured by a sensor; without a detection all fields but the stamp are zero."""

    NAME = "I2risExternalPositionV2"
    VALID = 1
    _fields_ = [
        ("sequence", c_uint64),
        ("stamp_ns", c_uint64),
        ("position", c_double * 3),
        ("deviation", c_double * 3),
        ("quality", c_double),
        ("count", c_uint32),
        ("flags", c_uint32),
    ]


class StateCommandRequest(Payload):
    """``state_command``, request."""

    NAME = "I2risStateCommandV2"
    _fields_ = [
        ("client_id", c_uint64),
        ("stamp_ns", c_uint64),
        ("valid_ns", c_uint64),
        ("command", c_uint32),
        ("reserved", c_uint32),
    ]


class StateCommandReply(Payload):
    """``state_command``, reply."""

    NAME = "I2risStateCommandReplyV2"
    _fields_ = [
        ("refusal", c_uint32),
        ("state", c_uint32),
        ("measured", c_double),
        ("limit", c_double),
        ("quantity", c_uint32),
        ("motor", c_uint32),
        ("flags", c_uint32),
        ("reserved", c_uint32),
    ]


class MoveRequest(Payload):
    """``move_jp``, and ``move_cp`` by its flag, request; the reply is a ``StateCommandReply``."""

    NAME = "I2risMoveRequestV2"
    TIP = 1
    _fields_ = [
        ("client_id", c_uint64),
        ("stamp_ns", c_uint64),
        ("valid_ns", c_uint64),
        ("position", c_double * 3),
        ("count", c_uint32),
        ("flags", c_uint32),
    ]


class VirtualFixtureRequest(Payload):
    """``virtual_fixture``, request; the reply is a ``StateCommandReply``.

    Actions: 1 on, 2 off, 3 add, 4 remove. Kinds to add, with their values: 1 circle (pitch, yaw, radius), 2 half-plane
    (normal, normal, offset), rad; 3 ball (x, y, z, radius), 4 half-space (normal of 3, offset), m.
    """

    NAME = "I2risVirtualFixtureRequestV2"
    _fields_ = [
        ("client_id", c_uint64),
        ("stamp_ns", c_uint64),
        ("valid_ns", c_uint64),
        ("action", c_uint32),
        ("kind", c_uint32),
        ("values", c_double * 4),
    ]


class VersionRequest(Payload):
    """``version``, request."""

    NAME = "I2risVersionRequestV1"
    _fields_ = [("reserved", c_uint64)]


class Version(Payload):
    """``version``, reply: identity of this domain's controller."""

    NAME = "I2risVersionV2"
    _fields_ = [
        ("boot_id", c_uint64),
        ("pid", c_uint32),
        ("interface", c_uint32),
        ("software", c_uint16 * 3),
        ("shape", c_uint8 * 2),
        ("model_id", c_uint8 * 32),
        ("output_names", (c_uint8 * 16) * 3),
        ("velocity_counts_s", c_double),
        ("acceleration_counts_s2", c_double),
        ("position_min_counts", c_int32 * 2),
        ("position_max_counts", c_int32 * 2),
        ("robot_id", c_uint8 * 64),
    ]


class ModelRequest(Payload):
    """``model``, request."""

    NAME = "I2risModelRequestV2"
    FORCE = 1
    OTHER_DRIVE = 2
    _fields_ = [
        ("client_id", c_uint64),
        ("stamp_ns", c_uint64),
        ("valid_ns", c_uint64),
        ("action", c_uint32),
        ("flags", c_uint32),
        ("model_id", c_uint8 * 32),
        ("path", c_uint8 * 1024),
    ]


class ModelSlot(Payload):
    """A loaded model."""

    NAME = "I2risModelSlotV1"
    PRESENT = 1
    MEMORY_KNOWN = 2
    _fields_ = [
        ("training_rms", c_double * 3),
        ("held_out_rms", c_double * 3),
        ("model_id", c_uint8 * 32),
        ("family", c_uint8 * 32),
        ("file", c_uint8 * 120),
        ("outputs", c_uint32),
        ("flags", c_uint32),
    ]


class ModelDifference(Payload):
    """Difference between the staged model and the model in use."""

    NAME = "I2risModelDifferenceV1"
    _fields_ = [
        ("present_counts", c_double * 2),
        ("largest_counts", c_double * 2),
        ("largest_at_counts", c_double * 2),
        ("unreached", c_double),
        ("valid", c_uint32),
        ("reserved", c_uint32),
    ]


class ModelReply(Payload):
    """``model``, reply: the models in use, staged and previously in use."""

    NAME = "I2risModelReplyV1"
    _fields_ = [
        ("refusal", c_uint32),
        ("reserved", c_uint32),
        ("slots", ModelSlot * 3),
        ("difference", ModelDifference),
        ("message", c_uint8 * 512),
    ]


class BlackBoxRequest(Payload):
    """``black_box``, request."""

    NAME = "I2risBlackBoxRequestV1"
    _fields_ = [("client_id", c_uint64)]


class BlackBoxReply(Payload):
    """``black_box``, reply, once the file is written."""

    NAME = "I2risBlackBoxReplyV1"
    _fields_ = [("ticks", c_uint64), ("text", c_uint8 * 1024)]
