"""Parts of the panel without a process: who is let in, how much a page may send, envelopes, the queue of a page."""

from __future__ import annotations

import asyncio
import hashlib
import math
import os
import shutil
import sys
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import uvicorn
from panel_run import WAIT_S
from psabench import cli
from psabench.errors import BenchError
from psabench.link.signals import Floats
from psabench.panel import bench_view, prompt_http
from psabench.panel.bench_view import BenchView
from psabench.panel.channels import MOST_BUCKETS, Channels, Samples, channel_figures, split_envelopes
from psabench.panel.guard import Allowance, Door, Log
from psabench.panel.hub import UPDATES, Client
from psabench.panel.procedures import Progress, Runs
from psabench.panel.server import MESSAGE_BYTES, parse_request
from psabench.panel.statistics import amplitude_density, channel_statistics
from psabench.panel.view import TURN_S
from uvicorn.server import ServerState

DOOR = Door(port=8000, token="secret-token")
OWN = {"host": "127.0.0.1:8000", "cookie": "psabench_panel_8000=secret-token"}
ORIGIN = {"origin": "http://127.0.0.1:8000"}


def scope(kind: str, headers: dict[str, str], method: str = "GET", path: str = "/", query: str = "") -> dict[str, Any]:
    """A request as uvicorn hands it on."""
    pairs = [(k.encode(), v.encode()) for k, v in headers.items()]
    return {"type": kind, "method": method, "path": path, "query_string": query.encode(), "headers": pairs}


# what comes | status, 0: it is served
REQUESTS = [
    (scope("http", OWN), 0),
    (scope("http", OWN | ORIGIN), 0),
    (scope("http", {"host": "127.0.0.1:8000"}, query="token=secret-token"), 0),
    (scope("http", {"host": "localhost:8000"}, query="token=secret-token"), 0),
    (scope("websocket", OWN | ORIGIN), 0),
    (scope("http", {"host": "127.0.0.1:8000"}), 401),
    (scope("http", {"host": "127.0.0.1:8000"}, query="token=secret-tokem"), 401),
    (scope("http", {"host": "127.0.0.1:8000"}, query="token=secret-token", path="/static/main.js"), 401),
    (scope("http", {"host": "127.0.0.1:8000", "cookie": 'x={"a":1}; psabench_panel_8000=secret-token'}), 0),
    (scope("http", {"host": "127.0.0.1:8000", "cookie": "psabench_panel_8000="}), 401),
    (scope("http", {"host": "127.0.0.1:8000", "cookie": "psabench_panel_8001=secret-token"}), 401),
    (scope("http", {}, query="token=secret-token"), 421),
    (scope("http", OWN | {"host": "evil.example:8000"}), 421),
    (scope("http", OWN | {"host": "127.0.0.1:8001"}), 421),
    (scope("http", OWN | {"host": "127.0.0.1"}), 421),
    (scope("http", OWN | {"origin": "http://evil.example"}), 403),
    (scope("http", OWN | {"origin": "null"}), 403),
    (scope("http", OWN | {"origin": "http://localhost:8000"}), 403),  # not the Host that it came to
    (scope("http", OWN, method="POST"), 405),
    (scope("websocket", OWN), 403),
    (scope("websocket", OWN | {"origin": "http://127.0.0.1:9000"}), 403),
    (scope("websocket", {"host": "127.0.0.1:8000"} | ORIGIN), 401),
    (scope("websocket", {"host": "127.0.0.1:8000"} | ORIGIN, query="token=secret-token"), 401),
    (scope("websocket", OWN | ORIGIN | {"host": "rebound.example:8000"}), 421),
]


@pytest.mark.parametrize(("request_scope", "status"), REQUESTS)
def test_only_our_page_with_the_token_is_served(request_scope: dict[str, Any], status: int) -> None:
    refusal = DOOR.refusal(request_scope)
    assert (refusal.status if refusal else 0) == status


def test_a_second_host_header_is_refused() -> None:
    twice = scope("http", OWN)
    twice["headers"].append((b"host", b"evil.example"))
    refusal = DOOR.refusal(twice)
    assert refusal is not None
    assert refusal.status == 421


def test_the_same_refusal_is_logged_once_and_their_number_is_bounded() -> None:
    lines: list[str] = []
    log = Log(lines.append)
    for k in range(10_000):
        log.once(f"refused {k % 500}")
    assert lines == [f"refused {k}" for k in range(100)]


def test_a_page_may_send_a_burst_and_then_a_rate() -> None:
    now_s = 0.0
    allowance = Allowance(per_s=10.0, burst=5.0, clock=lambda: now_s)
    assert [allowance.take() for _ in range(6)] == [True] * 5 + [False]
    now_s = 0.1
    assert [allowance.take() for _ in range(2)] == [True, False]


@pytest.mark.parametrize(
    "text",
    ["", "null", "[]", "{}", '{"do":1}', '{"do":"hello","id":"x"}', "[" * 4000, '{"do":"' + "x" * MESSAGE_BYTES + '"}',
     '{"do":"line","line":"\\ud800"}'],
)  # fmt: skip
def test_malformed_requests_are_none(text: str) -> None:
    assert parse_request(text) is None
    assert parse_request('{"do":"hello","id":1}') == {"do": "hello", "id": 1}


def test_at_a_speed_that_the_bench_has_not_pages_get_their_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    clock_s, waited_s = 0.0, 0.0
    view = object.__new__(BenchView)
    view.bench = Mock()
    monkeypatch.setattr(bench_view, "time", Mock(monotonic=lambda: clock_s))

    def wait(for_s: float, own_s: float) -> None:
        nonlocal clock_s, waited_s
        clock_s, waited_s = clock_s + for_s * own_s, waited_s + for_s

    view.bench.wait = partial(wait, own_s=0.5)  # real time for a second of its own
    view.wait(66.0)
    assert TURN_S <= clock_s <= 2 * TURN_S
    waited_s = 0.0
    view.bench.wait = partial(wait, own_s=1e-4)
    view.wait(66.666_666_667)
    assert waited_s == pytest.approx(66.666_666_667, abs=1e-9)


def test_another_panel_in_the_same_folder_has_intervals_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = Runs(tmp_path, lambda: None)
    monkeypatch.setattr(os, "getpid", lambda: 1)
    other = Runs(tmp_path, lambda: None)
    other.intervals.path.write_text('{"readings": 1, "estimates": []}\n')
    mine.close()
    assert other.intervals.path.exists()
    other.close()
    assert not list(tmp_path.iterdir())


def test_a_procedure_that_has_not_said_anything_yet_is_shown_as_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    runs = Runs(tmp_path, lambda: shown.append(runs.message()["state"]))
    monkeypatch.setattr(sys, "executable", shutil.which("true"))
    monkeypatch.setattr(Runs, "_follow", lambda _, ours, *__: os.close(ours))  # its words are never read
    runs.start("turns")
    assert shown == ["running"]
    runs.close()


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_a_connection_that_asks_for_nothing_ends(sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prompt_http, "LIFE_S", 0.01)

    async def answer() -> bytes:
        config = uvicorn.Config(Mock(), log_config=None)
        config.load()
        new = asyncio.get_running_loop().create_server
        async with await new(lambda: prompt_http.PromptHttp(config, ServerState(), {}), "127.0.0.1", 0) as server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            writer.write(sent)
            read = await asyncio.wait_for(reader.read(), WAIT_S)
            writer.close()
            return read

    assert asyncio.run(answer()) == b""


def test_an_envelope_keeps_a_spike_and_every_sample_counts_once() -> None:
    n = 1000
    t_s: Floats = np.arange(n, dtype=np.float64) / 1000.0
    x = np.zeros(n)
    x[517] = 1.0
    s = Samples(t_s=t_s, values=np.column_stack([x, np.full(n, np.nan)]), names=("x", "y"), units=("V", "V"))
    found = split_envelopes(s)
    assert len(found) == 29  # 0.999 s in thirtieths
    assert [b.bands[0][1] for b in found if b.bands[0]].count(1.0) == 1
    assert all(b.bands[1] is None for b in found)
    assert found[-1].t_s == pytest.approx(0.999)
    long = Samples(t_s=t_s * 1000.0, values=s.values, names=s.names, units=s.units)
    assert len(split_envelopes(long)) == MOST_BUCKETS


def test_bands_are_those_of_the_values_that_are_there() -> None:
    t_s: Floats = np.arange(100, dtype=np.float64) / 1000.0
    values = np.random.default_rng(1).normal(2.5, 0.1, (100, 3))
    values[np.random.default_rng(2).random((100, 3)) < 0.3] = np.nan
    values[:34, 1] = np.inf  # nothing there in the first third
    found = split_envelopes(Samples(t_s=t_s * 1.02, values=values, names=("x",) * 3, units=()))
    assert len(found) == 3
    for bucket, rows in zip(found, (range(33), range(33, 66), range(66, 100)), strict=True):
        for k, band in enumerate(bucket.bands):
            there = [v for v in values[rows, k].tolist() if math.isfinite(v)]
            if not there:
                assert band is None
                continue
            assert band is not None
            assert band[:2] == (min(there), max(there))
            assert band[2] == pytest.approx(math.fsum(there) / len(there), rel=1e-12)


def test_channels_start_again_when_time_goes_back() -> None:
    c = Channels()
    late = Samples(t_s=np.array([5.0]), values=np.array([[1.0]]), names=("x",), units=("V",))
    early = Samples(t_s=np.array([1.0]), values=np.array([[2.0]]), names=("x",), units=("V",))
    c.add(late)
    c.add(early)
    assert [b.t_s for b in c.history] == [1.0]
    assert c.latest("x")[1].tolist() == [2.0]


def test_a_page_that_sleeps_has_a_bounded_queue_and_the_newest_update() -> None:
    client = Client()
    for k in range(10 * UPDATES + 7):
        client.put_update(str(k))
    assert len(client.texts) <= UPDATES
    assert client.texts[-1] == (False, str(10 * UPDATES + 6))
    assert client.missed
    client.live = False
    before = list(client.texts)
    client.put_update("hidden")
    assert list(client.texts) == before


def test_answers_stay_in_order_and_are_never_dropped_for_updates() -> None:
    client = Client()
    client.put_update("before")
    client.put_answer("answer")
    for k in range(UPDATES):
        client.put_update(str(k))
    sent = [asyncio.run(client.next_text()) for _ in range(len(client.texts))]
    assert sent == ["answer", str(UPDATES - 1)]  # the others came to a page that was full
    client.put_update("before")
    client.put_answer("answer")
    client.put_update("after")
    assert [asyncio.run(client.next_text()) for _ in range(3)] == ["before", "answer", "after"]
    assert client.answers == 0


def test_spectrum_and_allan_deviation_of_white_noise_and_a_sine() -> None:
    rng = np.random.default_rng(1)
    step_s, density = 1e-3, 2e-6  # one-sided, V per root Hz
    noise = rng.normal(0.0, density * np.sqrt(0.5 / step_s), 8192)
    t_s: Floats = np.arange(8192, dtype=np.float64) / 1000.0
    found = channel_statistics(t_s, noise, "V")
    assert np.sqrt(np.mean(np.square(found["spectrum"]["y"][40:]))) == pytest.approx(density, rel=0.05)
    for tau_s, deviation in list(zip(found["allan"]["x"], found["allan"]["y"], strict=True))[:20]:
        assert deviation == pytest.approx(density / np.sqrt(2 * tau_s), rel=0.25)
    assert sum(found["histogram"]["y"]) == 8192
    hz, amplitude = amplitude_density(np.sin(2 * np.pi * 50.0 * t_s), step_s)
    assert hz[np.argmax(amplitude)] == pytest.approx(50.0, rel=0.05)


@pytest.mark.parametrize(("values", "words"), [(np.zeros(63), "64 samples"), (np.array([0.0, np.nan] * 50), "gaps")])
def test_statistics_need_enough_samples_without_gaps(values: Any, words: str) -> None:
    with pytest.raises(BenchError, match=words):
        channel_statistics(np.arange(len(values), dtype=np.float64) / 1000.0, values, "V")


# what a procedure prints | step, done, total, note
PRINTED = [
    ("turns, face side ██████···· 4/10, 3 s left\x1b[K", ("turns, face side", 4, 10, "")),
    ("heading ████ 7/9, 0 s left; azimuth 12.3 +- 0.4 deg\x1b[K", ("heading", 7, 9, "azimuth 12.3 +- 0.4 deg")),
    ("\x1b[Kturns, face side: 10/10 in 0.3 s", ("turns, face side", 10, 10, "")),
    ("gyro: 3/3 in 61.0 s; u0 1.2", ("gyro", 3, 3, "u0 1.2")),
    ("report: build/run/report.html", ("", 0, 0, "")),
]


@pytest.mark.parametrize(("text", "shown"), PRINTED)
def test_the_bar_of_a_procedure_is_understood(text: str, shown: tuple[str, int, int, str]) -> None:
    p = Progress()
    p.take(text)
    assert (p.step, p.done, p.total, p.note) == shown
    assert list(p.lines) == ([text] if not p.step else [])


@pytest.mark.parametrize("name", ["uPlot.iife.min.js", "uPlot.min.css"])
def test_the_file_of_another_project_is_the_one_that_the_page_names(name: str) -> None:
    digest = hashlib.sha256((files("psabench.panel") / "static" / name).read_bytes()).hexdigest()
    assert digest in (Path(__file__).parents[3] / "docs/sources.md").read_text()


def test_without_the_extra_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "psabench.panel.command_run", raising=False)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert cli.main(["panel"]) == 2
    assert capsys.readouterr().err == (
        "psabench: panel: expected the extra 'panel', got none; pip install 'psabench[panel]'\n"
    )


def test_statistics_without_a_sample_say_so() -> None:
    with pytest.raises(BenchError, match=r"^statistics: expected samples, got none yet$"):
        channel_figures(Channels(), "")
