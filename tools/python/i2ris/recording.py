"""Recordings by the program ``i2ris record``."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

from .requests import POLL_S

#: Timeout for the start and the end of a recording, s.
RECORD_TIMEOUT_S = 30.0


class Recording:
    """A recording in progress."""

    def __init__(self, domain: str, path: str | os.PathLike[str], note: str):
        self.path = Path(path).absolute()
        # The program refuses it as well, but later: an existing file looks like a recording that has started.
        if self.path.exists():
            raise FileExistsError(f"{self.path} exists; name a file that does not exist yet")
        command = ["i2ris", "record", "--domain", domain, "--output", str(self.path)]
        # In a separate session: Ctrl-C in a notebook does not end it.
        self._program: subprocess.Popen[str] | None = subprocess.Popen(
            command + (["--note", note] if note else []),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        end = time.monotonic() + RECORD_TIMEOUT_S
        while not self.path.exists() and self._program.poll() is None and time.monotonic() < end:
            time.sleep(POLL_S)
        if self._program.poll() is not None:
            self.stop()

    def stop(self) -> Path:
        """Ends the recording and returns its file. Raises ``OSError`` with the message of the program if it failed."""
        if self._program is not None:
            program, self._program = self._program, None
            program.send_signal(signal.SIGINT)
            _, error = program.communicate(timeout=RECORD_TIMEOUT_S)
            if program.returncode != 0:
                raise OSError(error.strip())
        return self.path

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_error: object) -> None:
        self.stop()
