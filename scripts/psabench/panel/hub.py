"""Who is looking: a bounded queue for each page. One that sleeps loses old updates and holds up no other."""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass, field
from itertools import count

UPDATES = 60  # that wait for a page: two seconds; one that is slower gets the whole state again
ANSWERS = 128  # to what it has asked itself, no more than it may ask

_numbers = count(1)


@dataclass(eq=False, slots=True)
class Client:
    """One page. Used in the server's thread alone."""

    number: int = field(default_factory=lambda: next(_numbers))
    truth: bool = False  # its switch
    lines: bool = False  # it shows the levels of the lines, which the emulator computes for whoever looks
    live: bool = True  # False: its tab is hidden
    missed: bool = False  # updates were dropped: it needs the whole state
    answers: deque[str] = field(default_factory=lambda: deque(maxlen=ANSWERS))
    updates: deque[str] = field(default_factory=lambda: deque(maxlen=UPDATES))
    wake: asyncio.Event = field(default_factory=asyncio.Event)

    def put_update(self, text: str) -> None:
        if not self.live:
            return
        if len(self.updates) == UPDATES:
            self.updates.clear()
            self.missed = True
        self.updates.append(text)
        self.wake.set()

    def put_answer(self, text: str) -> None:
        self.answers.append(text)
        self.wake.set()

    async def next_text(self) -> str:
        """Waits for something to send; answers go first."""
        while not self.answers and not self.updates:
            self.wake.clear()
            await self.wake.wait()
        return (self.answers or self.updates).popleft()


@dataclass(slots=True)
class Hub:
    """All pages."""

    clients: dict[int, Client] = field(default_factory=dict)

    def publish(self, text: str, *, truth: bool = False) -> None:
        """An update for all, or for those whose switch shows the truth."""
        for client in self.clients.values():
            if client.truth or not truth:
                client.put_update(text)

    def answer(self, number: int, text: str) -> None:
        client = self.clients.get(number)
        if client is not None:
            client.put_answer(text)
