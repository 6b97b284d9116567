"""A file that grows by whole segments and can be read after each one: what does not fit is taken back."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from psabench.link.own import OutputFile


class SegmentFile:
    """tail: bytes that close the file; always behind the last segment, and replaced by the next one."""

    def __init__(self, path: Path, tail: bytes = b"") -> None:
        """Raises OSError."""
        self._file, self._tail = OutputFile(path, "wb"), tail
        self.end = 0  # of the last segment

    def append(self, data: bytes, tail: bool = True) -> None:
        """Raises OSError; the file is then as before. tail: False for the segment that closes the file itself."""
        whole = data + self._tail if tail else data
        try:
            if self._tail:
                self._file.seek(self.end)
            self._file.write(whole)
        except OSError:
            with suppress(OSError):  # of a pipe: nothing can be taken back
                self._take_back()
            raise
        self.end += len(data)

    def _take_back(self) -> None:
        """Needs no room: the tail was there before."""
        tail = self._tail if self.end else b""
        self._file.truncate(self.end + len(tail))
        self._file.seek(self.end)
        self._file.write(tail)

    def close(self) -> None:
        self._file.close()
