"""A camera process in its shortest form: angles with stamp, deviation and quality, 30 times a second.

    python examples/camera.py --domain i2ris

``angles`` stands for whatever measures: replace it. The stamp is the instant at which the image was taken, on the
monotonic clock of this machine. Where nothing was seen, say so: an old value is worse than none.
"""

import argparse
import math
import time

from i2ris.external import ExternalPublisher, NoController

RATE_HZ = 30.0


def angles(stamp_ns: int) -> tuple[tuple[float, float], tuple[float, float], float] | None:
    """Pitch and yaw, rad, their standard deviations, and quality; None where nothing was seen."""
    phase = 2.0 * math.pi * 0.1 * stamp_ns * 1e-9
    if math.sin(0.37 * phase) > 0.99:
        return None
    return (0.1 * math.sin(phase), 0.1 * math.cos(phase)), (0.001, 0.001), 0.9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--domain", help="default: I2RIS_DOMAIN, or i2ris")
    parser.add_argument("--duration-s", type=float, default=math.inf)
    arguments = parser.parse_args()
    publisher = ExternalPublisher(arguments.domain)
    end = time.monotonic() + arguments.duration_s
    while time.monotonic() < end:
        stamp_ns = time.monotonic_ns()
        try:
            seen = angles(stamp_ns)
            if seen is None:
                publisher.publish_nothing(stamp_ns)
            else:
                publisher.publish(stamp_ns, *seen)
        except NoController as absent:
            print(absent)
            time.sleep(1.0)
        time.sleep(1.0 / RATE_HZ)


if __name__ == "__main__":
    main()
