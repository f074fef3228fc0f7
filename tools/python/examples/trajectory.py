"""Follows angles from a CSV file (columns t_s, pitch_deg, yaw_deg) and prints how well the model thinks it went.

    python examples/trajectory.py desired.csv --domain i2ris

The robot has to be enabled and homed (``i2ris home``, ``... enable``). Ctrl-C ends it; the robot holds.
"""

import argparse
import time

import numpy as np
import numpy.typing as npt

from i2ris.arm import Arm

RATE_HZ = 200.0
#: Speed on the way to the start of the path, deg/s.
APPROACH_DEG_S = 10.0


Values = npt.NDArray[np.float64]


def path_of(file: str) -> tuple[Values, Values]:
    table = np.genfromtxt(file, delimiter=",", names=True)
    return table["t_s"] - table["t_s"][0], np.column_stack([table["pitch_deg"], table["yaw_deg"]])


def with_approach(times: Values, poses: Values, start: Values) -> tuple[Values, Values]:
    """The same path, begun with a straight line from where the robot is."""
    duration = max(np.hypot(*(poses[0] - start)) / APPROACH_DEG_S, 0.1)
    return np.concatenate([[0.0], times + duration]), np.vstack([start, poses])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("csv")
    parser.add_argument("--domain", help="default: I2RIS_DOMAIN, or i2ris")
    arguments = parser.parse_args()
    times, poses = path_of(arguments.csv)
    errors = []
    with Arm(arguments.domain) as arm:
        arm.wait_for(lambda state: state.state == "ENABLED" and state.homed, timeout_s=2.0)
        while not (setpoint := arm.setpoint_js()).valid:
            time.sleep(0.01)
        times, poses = with_approach(times, poses, np.degrees(setpoint.position))
        start = time.monotonic()
        while (elapsed := time.monotonic() - start) < times[-1]:
            pose = [np.interp(elapsed, times, poses[:, axis]) for axis in range(2)]
            arm.servo_jp(np.radians(pose))
            errors.append(np.degrees(arm.measured_js().position - arm.goal_js().position))
            time.sleep(1.0 / RATE_HZ)
        state = arm.operating_state()
    lengths = np.hypot(*np.array(errors).T)
    print(f"{len(errors)} looks, estimate against goal: RMS {np.sqrt(np.mean(lengths**2)):.3f} deg, max {lengths.max():.3f} deg")
    print(f"{state.accepted} commands accepted, {state.own_refused} refused {state.last_refusal}")


if __name__ == "__main__":
    main()
