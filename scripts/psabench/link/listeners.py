"""Who gets which frame of a bus: a frame is looked up once by its identifier, however many listen."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager

import can

Listener = Callable[[can.Message], None]

KNOWN = 4096  # identifiers whose listeners are remembered: more than the 2048 of 11 bits


class Listeners:
    """Each gets its frames in order; those of one frame are called in the order in which they came.

    A listener that comes or goes while a frame is handed on does so from the next frame on.
    """

    def __init__(self) -> None:
        self._all: list[tuple[Listener, Container[int] | None]] = []
        self._by_id: dict[int, tuple[Listener, ...]] = {}

    def append(self, listener: Listener, ids: Container[int] | None = None) -> None:
        """ids: its identifiers, as a set or a range, which do not change any more; None: each frame."""
        self._all.append((listener, ids))
        self._by_id.clear()

    def remove(self, listener: Listener) -> None:
        """Raises ValueError for one that does not listen."""
        del self._all[[known for known, _ in self._all].index(listener)]
        self._by_id.clear()

    def __len__(self) -> int:
        return len(self._all)

    def hand_on(self, message: can.Message) -> None:
        """To those of its identifier."""
        listeners = self._by_id.get(message.arbitration_id)
        for listener in self._find(message.arbitration_id) if listeners is None else listeners:
            listener(message)

    def hand_on_named(self, message: can.Message) -> None:
        """To those who have named its identifier, and not to those who get each frame."""
        for listener in [known for known, ids in self._all if ids is not None and message.arbitration_id in ids]:
            listener(message)

    def _find(self, can_id: int) -> tuple[Listener, ...]:
        if len(self._by_id) >= KNOWN:  # of 29 bits there are many
            self._by_id.clear()
        found = self._by_id[can_id] = tuple(known for known, ids in self._all if ids is None or can_id in ids)
        return found

    @contextmanager
    def only(self, *listeners: Listener) -> Iterator[None]:
        """These alone, and for each frame, while the block runs: a long stream costs each listener its time."""
        with self.restored():
            self._all = [(listener, None) for listener in listeners]
            self._by_id.clear()
            yield

    @contextmanager
    def restored(self) -> Iterator[None]:
        """Afterwards those listen who did before."""
        before = list(self._all)
        try:
            yield
        finally:
            self._all = before
            self._by_id.clear()
