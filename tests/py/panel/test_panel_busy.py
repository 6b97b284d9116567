"""Long lines of the panel: other pages go on, any page stops them; a page's first state; the end of the thread."""

from __future__ import annotations

import json
import queue
import subprocess
import sys

import panel_run as run
import pytest
from psabench.panel.hub import ANSWERS, Client
from psabench.panel.inbox import WAITING, Inbox, Stopped

# A line that no one waits for, and the pace; in step pace it would take minutes, in wall pace hours.
LONG = [
    ("wait 86400", "step"),
    ("until INT_FALL count=1000000000 limit_s=86400", "step"),
    ("can.listen 86400", "step"),
    ("dut.stream 1000000", "step"),
    ("wait 3600", "wall"),
    ("until INT_FALL count=1000000000 limit_s=86400", "wall"),
]


@pytest.mark.parametrize(("line", "pace"), LONG)
def test_a_long_line_is_stopped_by_another_page_which_goes_on_meanwhile(line: str, pace: str) -> None:
    paused = ["--paused"] if pace == "step" else []
    with run.running("quiet", "--pace", pace, *paused) as panel, panel.socket() as asks:
        assert "error" not in run.said(asks, 1, "dut.ready")
        asks.send(json.dumps({"id": 2, "do": "line", "line": line}))
        update = run.received(asks, "update")
        while update["time"]["busy"] != line:
            update = run.received(asks, "update")
        with panel.socket() as looks:
            hello = run.received(looks, "hello")
            assert hello["time"]["busy"] == line
            while run.received(looks, "update")["time"]["t_s"] <= hello["time"]["t_s"]:
                pass
            assert "counters" in run.received(looks, "state")
            assert "error" in run.asked(looks, 1, do="statistics", channel="none")
            assert run.asked(looks, 2, do="interrupt")["line"] == line
            while (answer := json.loads(asks.recv(timeout=run.WAIT_S))).get("id") != 2:
                pass
            assert answer["error"] == f"{line}: stopped by a page"
            assert run.asked(looks, 3, do="interrupt")["line"] == ""
            assert "error" not in run.said(looks, 4, "wait 0.01")  # which the second did not stop


def test_a_page_gets_its_state_however_many_requests_wait() -> None:
    inbox = Inbox()
    for _ in range(WAITING):
        inbox.put(1, {"do": "line"})
        inbox.put(1, {"do": "hello"})
    with pytest.raises(queue.Full):
        inbox.put(1, {"do": "line"})
    for _ in range(1000):
        inbox.greet(2)
    assert [n for n, _ in inbox.aside()] == [2] + [1] * WAITING
    assert len(list(inbox.in_order())) == WAITING
    assert inbox.is_empty
    client = Client()
    for k in range(ANSWERS + 1):
        client.put_answer(str(k))
    assert client.missed  # so that it gets the whole state when it reads again


def test_only_the_line_that_is_carried_out_is_stopped() -> None:
    inbox = Inbox()
    assert inbox.stop_line() == ""
    with inbox.doing("wait 1"):
        inbox.check()
        assert inbox.stop_line() == "wait 1"
        with pytest.raises(Stopped):
            inbox.check()
    with inbox.doing("wait 2"):
        inbox.check()


DYING = """
from psabench import cli
from psabench.panel.bench_view import BenchView

def take(self, every_unit):
    raise RuntimeError("made by a test")

BenchView.take = take
raise SystemExit(cli.main(["panel", "quiet"]))
"""


def test_an_error_of_its_own_ends_the_panel_with_one_line() -> None:
    command = [sys.executable, "-c", DYING]
    done = subprocess.run(command, capture_output=True, text=True, timeout=run.WAIT_S)
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("psabench: panel: an error of its own has ended it: RuntimeError('made by a test')")
