"""A recording that is being opened, in a thread: pages are served meanwhile, and can stop it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from psabench.errors import BenchError
from psabench.panel.recorded.base import PlayedView
from psabench.panel.recorded.source import RecordingSource

TURN_S = 0.05  # between two looks at who waits


class Opening:
    """done: the part that has been read, 0 to 1; below 0 nothing has been."""

    def __init__(self, source: RecordingSource) -> None:
        self.name = source.name
        self.done = -1.0
        self._source = source
        self._view: PlayedView | None = None
        self._error: Exception | None = None
        self._given_up = False
        self._thread = threading.Thread(target=self._open, name="opening", daemon=True)

    def message(self) -> dict[str, Any]:
        """For a page."""
        return {"kind": "opening", "name": self.name, "done": round(max(0.0, self.done), 3)}

    def follow(self, look: Callable[[], None]) -> PlayedView:
        """Until it is open; looks every TURN_S, and what `look` raises ends it. Raises BadInput."""
        self._thread.start()
        try:
            while self._thread.is_alive():
                self._thread.join(TURN_S)
                look()
        except BaseException:
            self._given_up = True
            raise
        if self._error is not None:
            raise self._error
        assert self._view is not None
        return self._view

    def _open(self) -> None:
        try:
            self._view = self._source.open_slowly(self._note)
        except Exception as e:  # the thread that follows raises it
            self._error = e

    def _note(self, done: float) -> None:
        if self._given_up:
            raise BenchError(f"{self.name}: no one waits for it")
        self.done = done
