"""The motors of an arm, without a model."""

from __future__ import annotations

from typing import Sequence

import numpy as np

from .payload import ActuatorState, ServoActuator, ServoJp
from .requests import Requests
from .values import Actuators, Joints


class ActuatorArm:
    """The motors of an arm, in counts."""

    def __init__(self, arm: Requests):
        self._arm = arm

    def servo_jp(self, counts: Sequence[int]) -> int:
        """Turn the motors to these encoder positions now. Call it repeatedly."""
        if not 1 <= len(counts) <= 2:
            raise ValueError("1 or 2 values")
        self._arm._raise_refusals()
        command = self._arm._stamped(ServoActuator, len(counts))
        command.position_counts[: len(counts)] = [int(value) for value in counts]
        return self._arm._send("i2ris/actuators/servo_jp", command)

    def measured_js(self) -> Actuators:
        """The motors."""
        message = self._arm._first("i2ris/actuators/measured_js", ActuatorState)
        count = message.count
        return Actuators(
            stamp_ns=message.stamp_ns,
            measured_counts=np.array(message.measured_counts[:count]),
            measured_stamp_ns=np.array(message.measured_stamp_ns[:count], dtype=np.uint64),
            setpoint_counts=np.array(message.setpoint_counts[:count]),
            current_ma=np.array(message.current_ma[:count]),
            error_code=np.array(message.error_code[:count]),
            sequence=message.sequence,
        )


class JawArm:
    """The auxiliary axis of an arm: a gripper, or a roll."""

    def __init__(self, arm: Requests):
        self._arm = arm

    def servo_jp(self, angle_rad: float) -> int:
        """Turn it to this angle now, rad. Call it repeatedly, together with a stream of the joints or alone."""
        self._arm._raise_refusals()
        command = self._arm._stamped(ServoJp, 1)
        command.position[0] = float(angle_rad)
        return self._arm._send("i2ris/jaw/servo_jp", command)

    def measured_js(self) -> Joints | None:
        """Its angle, rad; None if the robot has none, or until the first message has arrived."""
        return self._arm._joints("i2ris/jaw/measured_js")
