"""Parts of the panel without a process: who is let in, how much a page may send, envelopes, the queue of a page."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from psabench.panel.channels import MOST_BUCKETS, Channels, Samples, envelopes
from psabench.panel.guard import Allowance, Door, Log
from psabench.panel.hub import UPDATES, Client
from psabench.panel.server import MESSAGE_BYTES, parsed

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
    ["", "null", "[]", "{}", '{"do":1}', '{"do":"hello","id":"x"}', "[" * 4000, '{"do":"' + "x" * MESSAGE_BYTES + '"}'],
)
def test_malformed_requests_are_none(text: str) -> None:
    assert parsed(text) is None
    assert parsed('{"do":"hello","id":1}') == {"do": "hello", "id": 1}


def test_an_envelope_keeps_a_spike_and_every_sample_counts_once() -> None:
    n = 1000
    t_s = np.arange(n) * 1e-3
    x = np.zeros(n)
    x[517] = 1.0
    s = Samples(t_s=t_s, values=np.column_stack([x, np.full(n, np.nan)]), names=("x", "y"), units=("V", "V"))
    found = envelopes(s)
    assert len(found) == 29  # 0.999 s in thirtieths
    assert [b.bands[0][1] for b in found if b.bands[0]].count(1.0) == 1
    assert all(b.bands[1] is None for b in found)
    assert found[-1].t_s == pytest.approx(0.999)
    long = Samples(t_s=np.arange(n) * 1.0, values=s.values, names=s.names, units=s.units)
    assert len(envelopes(long)) == MOST_BUCKETS


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
    assert len(client.updates) <= UPDATES
    assert client.updates[-1] == str(10 * UPDATES + 6)
    assert client.missed
    client.live = False
    before = list(client.updates)
    client.put_update("hidden")
    assert list(client.updates) == before
