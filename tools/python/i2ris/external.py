"""Publishing measurements of a camera: the stream ``external/measured_jp``."""

import os
from collections.abc import Sequence

from .link import Link, NoController, publisher
from .payload import ExternalPosition

__all__ = ["ExternalPosition", "ExternalPublisher", "NoController"]

SERVICE = "i2ris/external/measured_jp"


class ExternalPublisher:
    """Publishes measurements; finds a controller that starts later or restarts."""

    def __init__(self, domain: str | None = None):
        """``domain``: None: that of the environment variable ``I2RIS_DOMAIN``, or ``i2ris``."""
        self._link = Link(os.environ.get("I2RIS_DOMAIN", "i2ris") if domain is None else domain)
        self._sequence = 0

    def publish(
        self, stamp_ns: int, position: Sequence[float], deviation: Sequence[float] = (), quality: float = 0.0
    ) -> None:
        """Publishes angles, rad, measured at ``stamp_ns`` (``time.monotonic_ns()``).

        Raises NoController while no controller serves the domain; the message is then lost.
        """
        if not 1 <= len(position) <= 3 or len(deviation) > 3:
            raise ValueError("1 to 3 values")
        message = ExternalPosition(
            stamp_ns=stamp_ns, quality=quality, count=len(position), flags=ExternalPosition.VALID
        )
        message.position[: len(position)] = list(position)
        message.deviation[: len(deviation)] = list(deviation)
        self._send(message)

    def publish_nothing(self, stamp_ns: int) -> None:
        """Publishes that the sensor has no detection."""
        self._send(ExternalPosition(stamp_ns=stamp_ns))

    def _send(self, message: ExternalPosition) -> None:
        self._sequence += 1
        message.sequence = self._sequence
        publisher(self._link, SERVICE, ExternalPosition).send_copy(message)
