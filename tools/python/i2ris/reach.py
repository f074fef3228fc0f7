"""``gymnasium.make("i2ris/Reach-v0")``: bring the tip of an emulated snake to a goal, past backlash and friction.

Action: motion of both motors in 20 ms, -1 to 1, times 9 counts. Observation: measured pitch and yaw, the goal, both deg,
and both motors, counts / 1000. Reward: minus the distance, deg. It ends at 0.2 deg for 10 steps together.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from i2ris.benchmark import PHYSICS, SEEDS, Snake

_TICKS = 20
_COUNTS = 9.0
_REACH_COUNTS = 1800.0
_NOISE_DEG = 0.07


class Reach(gymnasium.Env):
    """See the module."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, physics: str | None = None, snake: int | None = None, goal_deg: float = 20.0) -> None:
        self._physics, self._snake_seed, self._goal_deg = physics, snake, goal_deg
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (6,), np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        physics = self._physics or PHYSICS[self.np_random.integers(len(PHYSICS))]
        number = self._snake_seed or SEEDS[self.np_random.integers(len(SEEDS))]
        self._snake = Snake(physics, int(number))
        self._counts = np.zeros(2)
        self._goal = self.np_random.uniform(-self._goal_deg, self._goal_deg, 2)
        self._inside = 0
        return self._observe(), {"physics": physics, "snake": int(number)}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        moved = self._counts + _COUNTS * np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        self._counts = np.clip(moved, -_REACH_COUNTS, _REACH_COUNTS)
        angles = self._snake.step(np.round(self._counts), _TICKS)
        distance = float(np.hypot(*(angles - self._goal)))
        self._inside = self._inside + 1 if distance < 0.2 else 0
        return self._observe(), -distance, self._inside >= 10, False, {"distance_deg": distance}

    def _observe(self) -> np.ndarray:
        measured = self._snake.angles + self.np_random.normal(0.0, _NOISE_DEG, 2)
        return np.concatenate([measured, self._goal, self._snake.counts / 1000.0])


def register() -> None:
    """Called by gymnasium, which finds it by its entry point."""
    if "i2ris/Reach-v0" not in gymnasium.registry:
        gymnasium.register("i2ris/Reach-v0", entry_point="i2ris.reach:Reach", max_episode_steps=1500)
