"""The host suite with PSD-1, PMKA and PIK: our own host passes on CAN and on the bus, broken ones are caught."""

from __future__ import annotations

import json
import re
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from broken_boards import BROKEN_BOARDS, HOST, BrokenBoardHost, build
from broken_hosts import ROOT
from psabench import cli
from psabench.conform.host import cases_units as unit_cases
from psabench.conform.host import runner
from psabench.conform.host.check import case_checks
from psabench.conform.host.stimulus import ByHand
from psabench.conform.host.stimulus_bus import BusBridge
from psabench.emulator import Emulator
from psabench.link.busport import BusPort
from psabench.link.control import Control

SPEED = "3"  # times real time: nothing here is slower than that
CAN, BUS = "socketcand:{can} {node}", "{bus}"


def judged(out: Path, *args: str) -> tuple[int, dict[str, Any]]:
    """`conform host` with these arguments: exit status and conform.json."""
    status = cli.main(["conform", "host", "--out", str(out), "--speed", SPEED, *args])
    return status, json.loads((out / "conform.json").read_text())


@pytest.mark.host
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("board", "profile", "place"),
    [
        ("psd1", "psd1", CAN),
        ("psd1", "psd1_host", BUS),
        ("pmka", "pmka", CAN),
        ("pmka", "pmka_drift", CAN),
        ("pik", "pik", CAN),
        ("pik", "pik", BUS),
        ("pik5", "pik5", CAN),
        ("pik6", "pik6", CAN),
        ("pik6", "pik6", BUS),
    ],
)
def test_our_own_host_conforms(board: str, profile: str, place: str, tmp_path: Path) -> None:
    command = f"{sys.executable} {HOST} {board} {place}"
    status, told = judged(tmp_path, "--board", board, "--profile", profile, "--command", command)
    bad = {
        t["test"]: (t["saw"], t["due"], t["reason"])
        for t in told["tests"]
        if t["verdict"] in ("failed", "inconclusive")
    }
    assert (status, bad) == (0, {})
    link = "bus" if place == BUS else "can"
    sent = {t["scene"] for t in told["tests"] if t["scene"]}
    assert sent == {name for name, c in unit_cases.UNIT_CASES.items() if board in c.boards and link in c.links}


@pytest.mark.host
@pytest.mark.timeout(300)
@pytest.mark.parametrize("broken", BROKEN_BOARDS, ids=lambda b: b.name)
def test_a_broken_host_of_a_board_is_caught(broken: BrokenBoardHost, tmp_path: Path) -> None:
    command = f"{sys.executable} {build(tmp_path, broken)} {broken.board} {BUS if broken.on_bus else CAN}"
    profile = "psd1_host" if broken.on_bus and broken.board == "psd1" else broken.board
    status, told = judged(
        tmp_path / "out", "--board", broken.board, "--profile", profile, "--command", command, "--case", broken.case
    )
    assert status == 1
    assert told["requirements"][broken.requirement] == "failed", told["requirements"]


def test_every_requirement_of_these_boards_has_a_broken_host() -> None:
    ids = {i for j in case_checks() if j.case in unit_cases.UNIT_CASES for i in j.ids}
    assert ids == {b.requirement for b in BROKEN_BOARDS}


def test_each_case_of_a_board_is_judged_and_on_the_page() -> None:
    page = (ROOT / "docs/conform_host.md").read_text()
    assert {j.case for j in case_checks()} == set(runner.ALL)
    for name in unit_cases.UNIT_CASES:
        assert f"`{name}`" in page


@pytest.mark.parametrize(
    "args",
    [
        ["--board", "gyro", "--command", "host {can}"],
        ["--board", "pmka", "--command", "host {bus}"],
        ["--board", "psd1", "--command", "host {line}"],
        ["--board", "psd1", "--command", "host {bus}"],
        ["--board", "psd1", "--profile", "psd1_host", "--command", "host {can}"],
        ["--board", "pik", "--command", "host {can}", "--case", "good"],
        ["--board", "nonsense", "--command", "host {can}"],
    ],
)
def test_a_board_without_such_a_link_is_refused(
    args: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["conform", "host", "--out", str(tmp_path), *args]) == 2
    assert capsys.readouterr().err.strip()


LINES = (
    *("?", "R 3", "r 03H", "R 0", "R 20", "W 3 0", "W F 3", "R F 100", "W F", "hello", "R 3 800", "R B", "R", "R 3 0"),
    *(
        "R H",
        "R 3 x",
        "W A FFFF",
        "W A 10000",
        "W A FFFF 800",
        "W A 1 800 9",
        "? ?",
        "R 3 800 7",
        "w f 0003 9999999999",
    ),
    *("Rx 3", "R 333", "-", "R\t3", "W 20 1", "R " + "3" * 90),
)


class HostThatLeaves(ByHand):
    """No one: it has left when it is ended."""

    def __init__(self, results: Path) -> None:
        super().__init__(results, results, lambda: None)
        self.left = threading.Event()

    def gone(self) -> bool:
        return self.left.is_set()


def answers(port: BusPort) -> list[str]:
    """To LINES, without their times, and without the bits of STATUS, which follow from those."""
    found = []
    for line in LINES:
        port.ask(line)
        found.append(re.sub(r"^(R 03h) \w{4}$", r"\1", re.sub(r" t=\d+$", "", port.answered())))
    return found


@pytest.mark.host
def test_the_bus_port_of_the_suite_answers_as_the_emulators(tmp_path: Path) -> None:
    scenario = tmp_path / "psd1.yaml"
    scenario.write_text(unit_cases.scenario().replace("BOARD", "psd1").replace("PROFILE", "psd1_host"))
    with (
        Emulator(scenario, pace="step", extra=["--bus-port", tmp_path / "bus"]) as emulator,
        Control(emulator.control_path or Path()) as control,
    ):
        control.call("run", for_s=0.1)
        with BusPort(tmp_path / "bus", lambda s: control.call("run", for_s=s)) as theirs:
            due = answers(theirs)
    bridge, host = BusBridge("psd1"), HostThatLeaves(tmp_path / "none")
    with Emulator(scenario, pace="step") as emulator, Control(emulator.control_path or Path()) as control:
        control.call("run", for_s=0.1)
        server = threading.Thread(target=bridge.serve, args=(control, host, 10.0, 4e-6, 0.0), daemon=True)
        with BusPort(bridge.path) as ours:
            server.start()
            saw = answers(ours)
            host.left.set()
            server.join(30.0)
    bridge.close()
    assert saw == due
    assert [c.address for c in bridge.cycles][:2] == [3, 3]
    assert {c.code for c in bridge.cycles} >= {"", "not-ready", "read-only", "too-short"}
