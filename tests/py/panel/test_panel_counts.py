"""What the panel counts: nothing is lost by a stop or a reset, and a frame is decoded once for all pages and cards."""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import panel_run as run
import pytest
from psabench.link import signals
from psabench.link.can_host import Message
from psabench.panel.can_trace import CanTrace
from psabench.panel.handlers import HANDLERS
from psabench.panel.hub import Client, Hub
from psabench.panel.procedures import Runs
from psabench.panel.source import Source
from psabench.panel.worker import Worker
from psabench.shell.connect import Opening
from websockets.sync.client import ClientConnection

PAGES, VIEWS = 3, 8  # views of the CAN card, 0.2 s each
WAIT_S = 60.0


@pytest.fixture(scope="module")
def socket(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ClientConnection]:
    with run.running("calibrate", "--paused", "--out", tmp_path_factory.mktemp("out")) as panel, panel.socket() as s:
        yield s


def carried_out(socket: ClientConnection, *lines: str) -> None:
    for number, line in enumerate(lines, 1):
        answer = run.said(socket, number, line)
        assert not answer.get("failed"), answer
        assert "error" not in answer, answer


def counts(socket: ClientConnection) -> dict[str, int]:
    """Of the unit, when the next state of the bench has come."""
    run.received(socket, "state")
    (unit,) = run.received(socket, "state")["overview"]
    return {key: unit[key] for key in ("lost", "torn", "stretches")}


def test_time_between_ready_and_start_is_no_loss_nor_is_a_reset(socket: ClientConnection) -> None:
    carried_out(socket, "dut.ready", "wait 0.1", "dut.start", "wait 0.1")
    assert counts(socket) == {"lost": 0, "torn": 0, "stretches": 2}
    carried_out(socket, "dut.start", "wait 0.1", "dut.stop", "wait 0.05", "dut.start", "wait 0.1")
    assert counts(socket) == {"lost": 0, "torn": 0, "stretches": 3}
    carried_out(socket, "dut.reset", "dut.ready", "dut.start", "wait 0.1")
    assert counts(socket) == {"lost": 0, "torn": 0, "stretches": 5}
    carried_out(socket, "can.send 000#8005", "wait 0.03", "can.send 000#0105", "wait 0.1")
    assert counts(socket) == {"lost": 0, "torn": 0, "stretches": 6}


def test_what_is_lost_while_the_stream_runs_counts(socket: ClientConnection) -> None:
    carried_out(socket, "dut.start", "wait 0.1")
    before = counts(socket)
    carried_out(socket, "faults.add link.drop a.can can_id=389", "wait 0.02", "faults.clear", "wait 0.1")
    after = counts(socket)
    assert after["lost"] - before["lost"] == pytest.approx(20, abs=1)
    assert after["stretches"] == before["stretches"]


@dataclass(slots=True)
class Outlet:
    """Pages without a server: each has the texts that it got."""

    hub: Hub = field(default_factory=Hub)
    views: int = 0
    enough: threading.Event = field(default_factory=threading.Event)
    truth: bool = False

    def publish(self, text: str, *, truth: bool = False) -> None:
        self.hub.publish(text, truth=truth)
        self.views += json.loads(text)["kind"] == "can"
        if self.views >= VIEWS:
            self.enough.set()

    def answer(self, number: int, text: str) -> None:
        self.hub.answer(number, text)

    def wants_truth(self) -> bool:
        return False

    def wants_lines(self) -> bool:
        return True

    def is_watched(self) -> bool:
        return True


@dataclass(slots=True)
class Decoded:
    """Payloads and CAN frames that were decoded; kept, so that no two are the same object."""

    payloads: list[bytes] = field(default_factory=list)
    views: list[list[Message]] = field(default_factory=list)

    def times(self) -> Counter[int]:
        """How often each payload was."""
        return Counter(map(id, self.payloads))


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> Decoded:
    seen = Decoded()
    payload, view, row = signals.payload, CanTrace.view, CanTrace._row

    def kept_payload(data: list[bytes], size: int) -> Any:
        seen.payloads += data
        return payload(data, size)

    def kept_view(trace: CanTrace, span_s: float) -> dict[str, Any]:
        seen.views.append([])
        return view(trace, span_s)

    def kept_row(trace: CanTrace, m: Message) -> dict[str, Any]:
        seen.views[-1].append(m)
        return row(trace, m)

    monkeypatch.setattr(signals, "payload", kept_payload)
    monkeypatch.setattr(CanTrace, "view", kept_view)
    monkeypatch.setattr(CanTrace, "_row", kept_row)
    return seen


def test_a_frame_is_decoded_once_for_all_pages_and_cards(tmp_path: Path, decoded: Decoded) -> None:
    """A sample once for channels, units, statistics and a page that opens; a frame once in a view of the CAN card."""
    outlet = Outlet(Hub({k: Client(number=k, lines=True) for k in range(PAGES)}))
    source = Source(Opening(scenario="gyrocompass", pace="step"), tmp_path)
    worker = Worker(source, outlet, Runs(tmp_path / "procedures", lambda: None), HANDLERS)
    worker.start()
    try:
        for k in range(PAGES):
            worker.ask(k, {"do": "line", "line": "dut.start"})
            worker.inbox.greet(k)
            worker.ask(k, {"do": "statistics", "channel": "BETA"})
        assert outlet.enough.wait(WAIT_S)
        samples = sum(c.count for c in worker.view.channels.values())  # type: ignore[attr-defined]
    finally:
        worker.stop()
    assert len(decoded.payloads) > 100
    assert len(decoded.payloads) >= 2 * samples > 0
    assert set(decoded.times().values()) == {1}
    assert len(decoded.views) == outlet.views, "one view for all pages"
    assert any(decoded.views)
    for view in decoded.views:
        assert len({id(m) for m in view}) == len(view), "a frame is a row and among the latest"
    for page in outlet.hub.clients.values():
        assert sum(text.startswith('{"kind":"can"') for _, text in page.texts) > 0
