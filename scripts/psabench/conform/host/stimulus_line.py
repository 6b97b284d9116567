"""A line port of our own: a pseudo-terminal on which samples are sent to a host, none lost, as fast as it reads."""

from __future__ import annotations

import itertools
import os
import select
import time
import tty
from collections.abc import Iterable
from pathlib import Path

from psabench.conform.host.stimulus import STUCK_S, ByHand, Program
from psabench.errors import TimeOut
from psabench.link.lineport import INT

HELD = 1 << 17  # bytes: more than the kernel keeps of what no one reads
# Rest of the line, 16 ms: when it has been taken, all before it has been read; its own end may be lost.
TAIL = bytes([INT]) * HELD


class Pty:
    """A pseudo-terminal. The end that the host opens is `path`; it hangs up at `close`."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.path = Path(os.ttyname(self._theirs))

    def close(self) -> None:
        """Hang up."""
        for end in (self._ours, self._theirs):
            if end >= 0:
                os.close(end)
        self._ours = self._theirs = -1


class LinePort(Pty):
    """What is played on it a host reads as samples of the lines."""

    def play(self, blocks: Iterable[bytes], host: Program | ByHand) -> None:
        """Raises TimeOut when the host does not read at all; one that reads no more is ended."""
        os.set_blocking(self._ours, False)
        written = 0
        for block in itertools.chain(blocks, [TAIL]):
            left = memoryview(block)
            while left:
                if not self._room(host, STUCK_S if written > HELD else host.come_s):
                    if written <= HELD:
                        raise TimeOut("the host did not open the line port, or did not read it")
                    host.kill()
                    return
                n = os.write(self._ours, left)
                left, written = left[n:], written + n

    def _room(self, host: Program | ByHand, timeout_s: float) -> bool:
        deadline_s = time.monotonic() + timeout_s
        while not select.select([], [self._ours], [], 0.05)[1]:
            if host.gone() or time.monotonic() > deadline_s:
                return False
        return True
