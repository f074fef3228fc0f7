"""The I2RIS snake robot as a robot of LeRobot: `--robot.type=i2ris`.

Thin over `i2ris.arm`: lease, deadline, limits and virtual fixtures of the controller stay in force,
for any action of a policy. Angles are rad.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from lerobot.cameras import CameraConfig
from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.robots import Robot, RobotConfig

from i2ris.arm import Arm, Refused

#: Maximum distance at which a stream starts; from farther away the snake is moved first, rad.
BEGIN_RAD = np.radians(0.25)
#: Refusal of a stream that fell silent in motion.
STREAM_INTERRUPTED = 24
AXES = ("pitch", "yaw")


@RobotConfig.register_subclass("i2ris")
@dataclass(kw_only=True)
class I2risConfig(RobotConfig):
    #: Domain of the controller; None: `I2RIS_DOMAIN`, or `i2ris`.
    domain: str | None = None
    #: False: another client commands (`i2ris teleop`), and this one watches.
    commands: bool = True
    #: Age at which an action is stale and the snake holds, s; None: the controller's default.
    deadline_s: float | None = None
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


class I2ris(Robot):
    config_class = I2risConfig
    name = "i2ris"

    def __init__(self, config: I2risConfig):
        super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)
        self._arm: Arm | None = None

    @property
    def observation_features(self) -> dict:
        numbers = [f"{axis}.{what}" for what in ("pos", "deviation", "counts") for axis in AXES]
        cameras = {name: (it.height, it.width, 3) for name, it in self.config.cameras.items()}
        return {name: float for name in [*numbers, "memory_known"]} | cameras

    @property
    def action_features(self) -> dict:
        return {f"{axis}.pos": float for axis in AXES}

    @property
    def is_connected(self) -> bool:
        return self._arm is not None

    @property
    def is_calibrated(self) -> bool:
        """`i2ris calibrate` makes the model, and the controller loads it."""
        return True

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def connect(self, calibrate: bool = True) -> None:
        self._arm = Arm(self.config.domain, self.config.deadline_s)
        if self.config.commands:
            self._arm.enable().wait()
        for camera in self.cameras.values():
            camera.connect()

    def disconnect(self) -> None:
        for camera in self.cameras.values():
            camera.disconnect()
        if self._arm is not None:
            self._arm.close()
            self._arm = None

    def get_observation(self) -> dict:
        joints, motors, state = (
            self._arm.measured_js(), self._arm.actuators.measured_js(), self._arm.operating_state(),
        )
        if not joints.valid:
            raise RuntimeError("the controller has no model: angles are unknown")
        seen: dict = {"memory_known": float(state.memory_known)}
        for index, axis in enumerate(AXES):
            seen[f"{axis}.pos"] = float(joints.position[index])
            seen[f"{axis}.deviation"] = float(joints.deviation[index])
            seen[f"{axis}.counts"] = float(motors.measured_counts[index])
        return seen | {name: camera.read() for name, camera in self.cameras.items()}

    def send_action(self, action: dict) -> dict:
        """Streams the goal. If the stream was interrupted, the snake first moves to the goal by `move_jp`."""
        goal = np.array([float(action[f"{axis}.pos"]) for axis in AXES])
        if not self.config.commands:
            return action
        setpoint = self._arm.setpoint_js()
        holds = self._arm.operating_state().holding
        if holds and np.abs(setpoint.position[:2] - goal).max() > BEGIN_RAD:
            self._arm.move_jp(goal).wait()
        try:
            self._arm.servo_jp(goal)
        except Refused as refused:
            # A policy that was stopped in motion does not resume automatically.
            if refused.code == STREAM_INTERRUPTED:
                raise
            # A step that is too large: the next action moves there.
            self._arm.hold()
        return action
