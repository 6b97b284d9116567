"""A line port of our own: a pseudo-terminal on which samples are sent to a host, none lost, as fast as it reads."""

from __future__ import annotations

import itertools
import os
import select
import time
import tty
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

from psabench.conform.host.stimulus import STUCK_S, ByHand, Program
from psabench.errors import TimeOut
from psabench.link.lineport import INT

HELD = 1 << 17  # bytes: more than the kernel keeps of what no one reads
# Rest of the line, 16 ms: when it has been taken, all before it has been read; its own end may be lost.
TAIL = bytes([INT]) * HELD


class LinePort:
    """The end that the host opens is `path`; it hangs up when the context ends."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.path = Path(os.ttyname(self._theirs))

    def play(self, blocks: Iterable[bytes], host: Program | ByHand) -> None:
        """Raises TimeOut when the host does not read at all; one that reads no more is ended."""
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

    def __enter__(self) -> LinePort:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Hang up."""
        for end in (self._ours, self._theirs):
            if end >= 0:
                os.close(end)
        self._ours = self._theirs = -1
