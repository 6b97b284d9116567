"""MF4 logs by asammdf: the frames as CAN loggers have them, and each message of the DBC as channels with units.

The start time of the file is the first frame's whole second; channels count from there, and python-can gives back the
frames with their own stamps. Stamps that go back are raised to the one before, as the format has it.

asammdf writes at the end, in a process of its own with bounds of memory and time, as it takes seconds to load
(psabench.conform.sources.mf4). Until then the frames are in a temporary file.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import can

from psabench.conform.sources import mf4
from psabench.errors import expected
from psabench.link.log_file import Checked
from psabench.logs.records import Decoder, raw_record

MESSAGE, LEAST = 128, 65_536  # bytes of a message before compression, at most, and of the file's own blocks
CHILD = "psabench.logs.mf4_child"


class Mf4(Checked):
    """boards: by node, where they differ from the DBC's."""

    def __init__(self, path: Path, boards: Mapping[int, str] | None = None) -> None:
        """Raises NotImplementedError where asammdf is missing, OSError."""
        if not mf4.asammdf_is_there():
            raise NotImplementedError(expected("asammdf (make setup, or pip install asammdf)", "none"))
        self._path, self._boards = path, Decoder(boards).boards
        self._spool = tempfile.TemporaryFile()  # noqa: SIM115 (`stop` closes it)
        self._messages = self._saved = 0
        path.open("wb").close()

    def on_message_received(self, m: can.Message) -> None:
        self._spool.write(json.dumps(raw_record(m)).encode() + b"\n")
        self._messages += 1

    def check(self) -> None:
        """The recording ends while there is room for the file."""
        self._spool.flush()
        kept, free = MESSAGE * self._messages, shutil.disk_usage(self._path.parent).free
        if free < kept + LEAST:
            full = os.strerror(errno.ENOSPC)
            raise OSError(errno.ENOSPC, f"{full}: {free} bytes are left, up to {kept} are kept until the end")

    def stop(self) -> None:
        with self._spool:
            self._saved = self._write()
        if self._saved < self._messages:
            raise OSError(errno.EIO, f"{self._saved} of {self._messages} messages were kept until the end")

    def _write(self) -> int:
        """How many messages are in the file."""
        self._spool.seek(0)
        with tempfile.TemporaryFile() as words, tempfile.TemporaryDirectory() as scratch:
            done = subprocess.run(
                [sys.executable, "-P", "-W", "ignore", "-m", CHILD, str(self._path), json.dumps(self._boards)],
                env=os.environ | mf4.ONE_THREAD | {"TMPDIR": scratch, "PYTHONPATH": mf4.search_path()},
                stdin=self._spool,
                stdout=subprocess.PIPE,
                stderr=words,
                check=False,
            )
            if done.returncode:
                os.truncate(self._path, 0)  # a part of such a file cannot be read
                words.seek(0)
                raise _child_error(done.returncode, words.read())
        return int(done.stdout.split()[-1])

    def stored(self, written: int) -> int:
        return self._saved


def _child_error(status: int, words: bytes) -> OSError:
    """The child's last words begin with the number of the error, if it was one of the file."""
    said = words.decode(errors="replace").splitlines()[-1:] or [f"exit status {status}"]
    number, _, text = said[0].partition(" ")
    if number.isdecimal():
        return OSError(int(number), text)
    ended = f"ended by {signal.Signals(-status).name}" if status < 0 else said[0][:160]
    return OSError(errno.EIO, f"asammdf could not write it: {ended}")
