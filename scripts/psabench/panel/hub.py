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
    lines: bool = False  # it shows the levels of the lines; the emulator computes them only when they are read
    live: bool = True  # False: its tab is hidden
    missed: bool = False  # texts were dropped: it needs the whole state
    answers: int = 0  # of the texts that wait
    texts: deque[tuple[bool, str]] = field(default_factory=deque)  # whether it is an answer; oldest first
    wake: asyncio.Event = field(default_factory=asyncio.Event)

    def put_update(self, text: str) -> None:
        if not self.live:
            return
        if len(self.texts) - self.answers == UPDATES:
            self.texts = deque(t for t in self.texts if t[0])
            self.missed = True
        self.texts.append((False, text))
        self.wake.set()

    def put_answer(self, text: str) -> None:
        if self.answers < ANSWERS:
            self.answers += 1
            self.texts.append((True, text))
        else:
            self.missed = True
        self.wake.set()

    async def next_text(self) -> str:
        """Waits for something to send."""
        while not self.texts:
            self.wake.clear()
            await self.wake.wait()
        is_answer, text = self.texts.popleft()
        self.answers -= is_answer
        return text


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
