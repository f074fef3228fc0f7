"""The hand on the I2RIS snake robot as a teleoperator of LeRobot: `--teleop.type=i2ris`.

The action is the goal of the controller, whoever commands it (`i2ris teleop`, a console, a program),
after all limits. Use it with `--robot.type=i2ris --robot.commands=false`: one client commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from i2ris.arm import Arm

AXES = ("pitch", "yaw")


@TeleoperatorConfig.register_subclass("i2ris")
@dataclass(kw_only=True)
class I2risTeleopConfig(TeleoperatorConfig):
    #: Domain of the controller; None: `I2RIS_DOMAIN`, or `i2ris`.
    domain: str | None = None


class I2risTeleop(Teleoperator):
    config_class = I2risTeleopConfig
    name = "i2ris"

    def __init__(self, config: I2risTeleopConfig):
        super().__init__(config)
        self.config = config
        self._arm: Arm | None = None

    @property
    def action_features(self) -> dict:
        return {f"{axis}.pos": float for axis in AXES}

    @property
    def feedback_features(self) -> dict:
        return {}

    @property
    def is_connected(self) -> bool:
        return self._arm is not None

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def connect(self, calibrate: bool = True) -> None:
        self._arm = Arm(self.config.domain)

    def disconnect(self) -> None:
        if self._arm is not None:
            self._arm.close()
            self._arm = None

    def get_action(self) -> dict:
        goal = self._arm.goal_js()
        if not goal.valid:
            raise RuntimeError("the controller has no model: the goal is unknown")
        return {f"{axis}.pos": float(goal.position[index]) for index, axis in enumerate(AXES)}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        pass
