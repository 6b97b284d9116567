"""The panel as a process, over HTTP and its WebSocket: what it serves, refuses, carries out, and how it comes back."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import panel_run as run
import pytest
from psabench.emulator import Emulator
from psabench.panel.hub import UPDATES
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

HELLOS = 55  # of 100 kB each: over the 4 MiB that the kernel keeps for a sender, within what a page may ask at once
ASLEEP_S = 60.0
LOST = re.compile("connection (closed|lost)|gone away")  # CAN or the control socket, whichever is used first


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[run.Running]:
    with run.running("quiet", "--seed", "3", "--out", tmp_path_factory.mktemp("out")) as p:
        yield p


def test_the_token_becomes_a_cookie_and_every_file_is_ours(panel: run.Running) -> None:
    first = panel.http(f"/?token={panel.token}")
    assert first.status == 303
    cookie = first.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    page = panel.http("/", Cookie=panel.cookie)
    assert page.status == 200
    assert "default-src 'none'" in page.headers["Content-Security-Policy"]
    html = page.read().decode()
    links = re.findall(r'(?:src|href)="([^"]+)"', html)
    assert links
    for link in links:
        assert link.startswith("/static/")
        assert panel.http(link, Cookie=panel.cookie).status == 200
        assert panel.http(link).status == 401
    assert panel.http("/static/..%2Fguard.py", Cookie=panel.cookie).status == 404


@pytest.mark.parametrize(
    ("headers", "status"),
    [({"Host": "evil.example"}, 421), ({"Origin": "http://evil.example"}, 403), ({"Cookie": ""}, 401)],
)
def test_hostile_requests_get_nothing(panel: run.Running, headers: dict[str, str], status: int) -> None:
    assert panel.http("/", **({"Cookie": panel.cookie} | headers)).status == status
    if "Host" not in headers:  # the client library sends its own
        with pytest.raises(InvalidStatus) as refused:
            panel.socket(**headers)
        assert refused.value.response.status_code == 403


def test_the_page_gets_commands_registers_and_channels(panel: run.Running) -> None:
    with panel.socket() as socket:
        hello = run.received(socket, "hello")
        assert hello["pace"] == "step"
        assert hello["commands"]["head.turn"]["args"][0]["unit"] == "deg"
        assert "bench.quit" not in hello["commands"]
        dr = next(f for f in hello["registers"]["x"]["CONFIG0"] if f["name"] == "DR")
        assert "1000 /s" in dr["meaning"].values()
        assert run.said(socket, 1, "dut.ready").get("error") is None
        assert run.said(socket, 2, "dut.start").get("error") is None
        new = run.received(socket, "update")
        while "new" not in new:
            new = run.received(socket, "update")
        assert new["new"]["names"] == ["x", "y", "z", "t"]
        low, high, mean = (column[0] for column in new["new"]["bands"][0])
        assert low <= mean <= high
        can = run.received(socket, "can")
        assert {"PSA2_XY", "PSA2_ZT"} <= {row["name"] for row in can["buses"][0]["ids"]}


def test_the_emulator_checks_what_is_written_and_files_stay_in_one_folder(panel: run.Running) -> None:
    with panel.socket() as socket:
        row = run.said(socket, 1, "dut.write x CONFIG0 DR=2")["result"]
        assert "DR 2" in row["fields"]
        assert "error" in run.said(socket, 2, "dut.write x ID 05h")  # read-only
        assert "CONFIG0.DR: expected 0 to 7" in run.said(socket, 3, "dut.write x CONFIG0 DR=9")["error"]
        for name in ("../x", "/tmp/x", ".x", "a/b", ""):
            assert "error" in run.said(socket, 4, f'bench.snapshot "{name}"')
        assert "expected a command of the panel" in run.said(socket, 5, "bench.quit")["error"]


def test_truth_comes_only_to_a_page_that_has_switched_it_on(panel: run.Running) -> None:
    with panel.socket() as shut, panel.socket() as opened:
        opened.send(json.dumps({"do": "watch", "live": True, "truth": True}))
        assert "state" in run.received(opened, "truth")
        told_s = run.received(opened, "update")["time"]["t_s"]
        run.received(opened, "truth")
        kinds, t_s = set(), 0.0
        while t_s <= told_s + 0.5:  # two more of the truth's, which come four times a second
            message = json.loads(shut.recv(timeout=run.WAIT_S))
            kinds.add(message["kind"])
            t_s = message.get("time", {}).get("t_s", t_s)
        assert "update" in kinds
        assert "truth" not in kinds


def test_the_next_frame_is_drawn_with_its_words(panel: run.Running) -> None:
    with panel.socket() as socket:
        run.said(socket, 1, "dut.ready")
        svg = run.asked(socket, 2, do="frame")["svg"]
    assert svg.startswith("<svg")
    assert "X =" in svg


def send_until_closed(socket: ClientConnection, messages: Sequence[str | bytes]) -> None:
    for message in messages:
        socket.send(message)
    while True:
        socket.recv(timeout=run.WAIT_S)


def test_floods_and_malformed_messages_close_the_page_with_one_line_each() -> None:
    with run.running("quiet", "--paused") as panel:
        for messages in (["{"], [json.dumps({"do": "line", "line": "head.turn 5"})] * 2000, ["x" * 100_000], [b"\xff"]):
            for _ in range(3):
                with panel.socket() as socket, pytest.raises(ConnectionClosed):
                    send_until_closed(socket, messages)
        for _ in range(5):
            panel.http("/", Host="evil.example", Cookie=panel.cookie)
        with panel.socket() as socket:
            answer = run.said(socket, 1, "time")
            while "at most a few requests" in answer.get("error", ""):  # those of the pages that are gone
                answer = run.said(socket, 1, "time")
            assert answer["result"]["t_s"] == 0.0  # and nothing has moved
        lines = panel.end().splitlines()
    assert len(lines) == len(set(lines)) == 4, lines


def test_a_unit_that_is_silent_loses_no_bench(tmp_path: Path) -> None:
    """Its SDO times out; faults, time and unit are there as before."""
    with run.running("climate", "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        assert "error" not in run.said(socket, 1, "wait 0.5")
        assert "error" not in run.said(socket, 2, "supply.output off")
        assert "error" not in run.said(socket, 3, "wait 0.1")
        assert "error" in run.said(socket, 4, "dut.registers x")
        assert run.said(socket, 5, "time")["result"]["t_s"] >= 0.6


def test_an_emulator_that_dies_and_returns_is_found_again(tmp_path: Path) -> None:
    control = tmp_path / "psa.ctl"

    def emulator() -> Emulator:
        return Emulator("quiet", cans=["socketcand:0"], pace="wall", control=False, extra=["--control", control])

    first = emulator().__enter__()
    try:
        with run.running("--connect", control, "--out", tmp_path) as panel, panel.socket() as socket:
            assert run.received(socket, "hello")["pace"] == "wall"
            first.stop()
            assert LOST.search(run.received(socket, "lost")["why"])
            assert "no bench" in run.said(socket, 1, "time")["error"]
            with emulator():
                assert run.received(socket, "hello")["units"]
                assert "error" not in run.said(socket, 2, "head.turn 10")
    finally:
        first.stop()


def test_a_page_that_does_not_read_holds_up_no_other(panel: run.Running) -> None:
    with panel.sleeping_socket() as asleep, panel.socket() as awake:
        run.received(asleep, "hello")
        for k in range(HELLOS):  # which it does not read: more than the buffers on the way take
            asleep.send(json.dumps({"id": k + 1, "do": "hello"}))
        begun_s = run.received(awake, "update")["time"]["t_s"]
        for _ in range(2 * UPDATES):
            now_s = run.received(awake, "update")["time"]["t_s"]
        assert now_s > begun_s
        deadline_s = time.monotonic() + ASLEEP_S
        while (read := json.loads(asleep.recv(timeout=ASLEEP_S))).get("kind") != "hello" or read.get("id") is not None:
            assert time.monotonic() < deadline_s, (
                "awake again, it did not get the whole state instead of what it missed"
            )


@pytest.mark.parametrize(
    ("scenario", "boards"),
    [
        ("converters", {"PIK", "PMKA", "PSD-1", "PSA-2"}),
        ("gyrocompass", {"PSA-2", "GYRO"}),
        ("receiver", {"RECEIVER"}),
        ("sins_table", {"BINS"}),
    ],
)
def test_units_of_every_board_show_channels_and_registers(scenario: str, boards: set[str], tmp_path: Path) -> None:
    with run.running(scenario, "--out", tmp_path) as panel, panel.socket() as socket:
        hello = run.received(socket, "hello")
        assert {u["board"] for u in hello["units"]} == boards
        first = {u["board"]: u["name"] for u in reversed(hello["units"])}
        for k, (board, name) in enumerate(first.items()):
            assert "error" not in run.said(socket, 10 * k + 1, f"dut.use {name}")
            assert "error" not in run.said(socket, 10 * k + 2, "dut.start")
            new: dict[str, object] = {}
            while new.get("unit") != name:
                new = run.received(socket, "update").get("new", {})
            assert new["t"], board
            banks = run.asked(socket, 10 * k + 3, do="hello")["registers"]
            rows = [run.said(socket, 10 * k + 4, f"dut.registers {bank}")["result"]["registers"] for bank in banks]
            assert all(rows), board


def test_an_emulator_of_the_panel_that_dies_is_started_again(tmp_path: Path) -> None:
    with run.running("quiet", "--out", tmp_path) as panel, panel.socket() as socket:
        run.received(socket, "hello")
        (child,) = run.children(panel.process.pid)
        os.kill(child, signal.SIGKILL)
        assert LOST.search(run.received(socket, "lost")["why"])
        assert run.received(socket, "hello")["units"]
        assert run.children(panel.process.pid) != [child]
        assert "error" not in run.said(socket, 1, "head.turn 10")
