"""A program with a screen, in a pseudo-terminal: what it has drawn so far, and keys for it."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from collections.abc import Mapping, Sequence
from fcntl import ioctl
from types import TracebackType
from typing import Self

import pytest
from rig import TIMEOUT_S

ESCAPES = re.compile(r"\x1b(\[[0-9;?]*[A-Za-z]|[()][A-Z0-9]|[=>78])")

WHERE, HERE = b"\x1b[6n", b"\x1b[1;1R"  # a program asks where the cursor is, and draws its lower rows when it knows


class Terminal:
    """`with Terminal(argv, env) as t: t.wait_for("regex"); t.type("q")`; 40 rows of 120 columns."""

    def __init__(self, argv: Sequence[str], env: Mapping[str, str]) -> None:
        self.text = ""  # all that was drawn, control sequences as blanks
        self._raw = ""
        self._master, slave = pty.openpty()
        ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        self._process = subprocess.Popen(
            argv,
            env={**env, "TERM": "xterm"},
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=lambda: ioctl(0, termios.TIOCSCTTY, 0),  # its Ctrl-C is a signal
        )
        os.close(slave)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._master)

    @property
    def pid(self) -> int:
        return self._process.pid

    def wait_for(self, pattern: str, timeout_s: float = TIMEOUT_S) -> re.Match[str]:
        """Until the pattern has been drawn since the last match."""
        deadline_s = time.monotonic() + timeout_s
        while not (found := re.search(pattern, self.text)):
            if time.monotonic() > deadline_s or not self._read(0.2):
                pytest.fail(f"the screen never showed {pattern!r}; it drew {self.text[-2000:]!r}")
        self.text = self.text[found.end() :]
        self._raw = self.text
        return found

    def type(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def wait_end(self, timeout_s: float = TIMEOUT_S) -> int:
        """Exit status."""
        deadline_s = time.monotonic() + timeout_s
        while self._process.poll() is None and time.monotonic() < deadline_s:
            self._read(0.05)
        return self._process.wait(1.0)

    def _read(self, timeout_s: float) -> bool:
        """False when the program has closed its terminal."""
        if select.select([self._master], [], [], timeout_s)[0]:
            chunk = b""
            with contextlib.suppress(OSError):  # EIO: no one has the slave open any more
                chunk = os.read(self._master, 65536)
            if not chunk:
                return False
            for _ in range(chunk.count(WHERE)):
                os.write(self._master, HERE)
            self._raw += chunk.decode(errors="replace")
            self.text = ESCAPES.sub(" ", self._raw)
        return True
