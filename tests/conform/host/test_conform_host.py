"""The host suite: hosts that pass, and hosts broken on purpose, each caught by the requirement it breaks."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from broken_boards import BROKEN_BOARDS
from broken_hosts import BROKEN, EXAMPLES, ROOT, BrokenHost, build, patched
from broken_lines import BROKEN_LINES
from psabench import cli
from psabench.conform.host import runner
from psabench.conform.host.cases_can import CASES
from psabench.conform.host.cases_line import LINE_CASES
from psabench.conform.host.check import case_checks
from psabench.conform.host.stimulus import expand
from psabench.errors import BadInput

PYTHON_HOST = ROOT / "examples/vins_host.py"
SPEED = "3"  # times real time: nothing here is slower than that


def judged(out: Path, *args: str) -> tuple[int, dict[str, Any]]:
    """`conform host` with these arguments: exit status and conform.json."""
    status = cli.main(["conform", "host", "--out", str(out), "--speed", SPEED, *args])
    return status, json.loads((out / "conform.json").read_text())


def failed(told: dict[str, Any]) -> list[str]:
    return [i for i, verdict in told["requirements"].items() if verdict != "passed"]


@pytest.mark.host
@pytest.mark.timeout(300)
def test_the_hundred_lines_of_c_conform(tmp_path: Path) -> None:
    host = build(tmp_path)
    status, told = judged(tmp_path / "out", "--command", f"{host} {{can}} {{node}}")
    bad = {
        t["test"]: (t["saw"], t["due"], t["reason"])
        for t in told["tests"]
        if t["verdict"] in ("failed", "inconclusive")
    }
    assert (status, bad) == (0, {})
    assert {t["scene"] for t in told["tests"] if t["scene"]} == set(CASES) - {"fast"}
    assert told["requirements"]["HOST-CAN-09"] == "not observable", "it takes pairs alone"
    assert sum(bool(line.strip()) for line in (EXAMPLES / "host.c").read_text().splitlines()) <= 100


@pytest.mark.host
@pytest.mark.timeout(300)
def test_our_own_host_conforms(tmp_path: Path) -> None:
    command = f"{sys.executable} {PYTHON_HOST} socketcand:{{can}} {{node}} {{form}}"
    status, told = judged(tmp_path, "--command", command)
    bad = {
        t["test"]: (t["saw"], t["due"], t["reason"])
        for t in told["tests"]
        if t["verdict"] in ("failed", "inconclusive")
    }
    assert (status, bad) == (0, {})
    assert {t["scene"] for t in told["tests"] if t["scene"]} == set(CASES)
    assert (told["requirements"]["HOST-VALUE-01"], told["requirements"]["HOST-CAN-09"]) == ("passed", "passed")


SLOW = """
import runpy, sys, time
from psabench.link.canopen_host import CanopenNode
read = CanopenNode.read
CanopenNode.read = lambda *args: (time.sleep(0.1), read(*args))[1]
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.mark.host
def test_a_slow_host_has_the_time_to_read_the_set_up(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    command = f"{sys.executable} {tmp_path / 'slow.py'} {PYTHON_HOST} socketcand:{{can}} {{node}} {{form}}"
    status, told = judged(tmp_path / "out", "--command", command, "--case", "setup_order")
    assert status == 0, told["tests"]


@pytest.mark.host
def test_over_slcan_nothing_is_lost_at_the_end(tmp_path: Path) -> None:
    command = f"{sys.executable} {PYTHON_HOST} slcan:{{pty}} {{node}}"
    status, told = judged(tmp_path, "--command", command, "--case", "torn", "silence")
    assert status == 0, told["tests"]


@pytest.mark.host
@pytest.mark.parametrize("broken", BROKEN, ids=lambda b: b.name)
def test_a_broken_host_is_caught(broken: BrokenHost, tmp_path: Path) -> None:
    host = build(tmp_path, broken)
    status, told = judged(tmp_path / "out", "--command", f"{host} {{can}} {{node}}", "--case", broken.case)
    assert status == 1
    assert told["requirements"][broken.requirement] == "failed", failed(told)


@pytest.mark.host
@pytest.mark.parametrize(
    ("name", "change", "case", "requirement"),
    [
        (
            "toggles_unseen",
            ("if lost := self.reader.counters.lost - self.told_lost:", "if lost := 0:"),
            "fast",
            "HOST-CAN-09",
        ),
        (
            "volts_off",
            ('"v": frames.u_v[i].tolist()', '"v": (frames.u_v[i] * 1.00001).tolist()'),
            "good",
            "HOST-VALUE-01",
        ),
    ],
)
def test_a_broken_host_of_ours_is_caught(
    name: str, change: tuple[str, str], case: str, requirement: str, tmp_path: Path
) -> None:
    """In what the C host does not do: other frame forms, volts."""
    host = tmp_path / "host.py"
    host.write_text(patched(PYTHON_HOST.read_text(encoding="utf-8"), name, [change]), encoding="utf-8")
    command = f"{sys.executable} {host} socketcand:{{can}} {{node}} {{form}}"
    status, told = judged(tmp_path / "out", "--command", command, "--case", case)
    assert status == 1
    assert told["requirements"][requirement] == "failed", failed(told)


def test_each_check_has_a_host_that_it_catches() -> None:
    caught = {b.requirement for b in (*BROKEN, *BROKEN_LINES, *BROKEN_BOARDS)} | {"HOST-CAN-09", "HOST-VALUE-01"}
    assert {i for j in case_checks() for i in j.ids} == caught


def test_there_are_twelve_ways_and_more() -> None:
    """Each of them, with the requirement that finds it, is on the page."""
    page = (ROOT / "docs/conform_host.md").read_text()
    listed = [line for line in page.splitlines() if line.endswith(" |") and line.count("HOST-") == 1 and "| `" in line]
    assert listed == [f"| `{b.name}` | `{b.case}` | {b.requirement} |" for b in BROKEN]
    assert len(BROKEN) >= 12
    assert len({b.requirement for b in BROKEN}) >= 12


@pytest.mark.host
def test_a_host_that_does_nothing_is_told_so(tmp_path: Path) -> None:
    status, told = judged(tmp_path, "--command", "true {can}", "--case", "torn")
    assert status == 4
    assert [t["reason"] for t in told["tests"] if t["scene"]] == ["the host ended before it had opened the bus"]


@pytest.mark.host
def test_results_may_go_to_a_file(tmp_path: Path) -> None:
    host = build(tmp_path)
    command = f"sh -c 'exec {host} $1 $2 > $3' host {{can}} {{node}} {{results}}"
    status, _ = judged(tmp_path / "out", "--command", command, "--case", "torn")
    assert status == 0


def test_places_of_a_command() -> None:
    assert expand("host {can} -n {node} '{can}'", {"can": "a:1", "node": "5"}) == ["host", "a:1", "-n", "5", "a:1"]
    for bad in ("host {cann}", "host {", "host '", "", "host {0}"):
        with pytest.raises(BadInput):
            expand(bad, {"can": "a:1"})


@pytest.mark.parametrize(
    "args",
    [
        ["--command", "host"],
        ["--command", "host {can} {line}"],
        ["--manual", "can"],
        ["--command", "host {can}", "--case", "nonsense"],
        ["--command", "host {can}", "--only", "NONSENSE"],
        ["--command", "host {can}", "--profile", "psd1"],
        ["--command", "host {can}", "--speed", "0"],
        ["--command", "/nonexistent/host {can}", "--case", "torn"],
    ],
)
def test_bad_input_is_refused(args: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["conform", "host", "--out", str(tmp_path), *args]) == 2
    assert capsys.readouterr().err.strip()


def test_each_case_is_judged_and_on_the_page() -> None:
    page = (ROOT / "docs/conform_host.md").read_text()
    assert {j.case for j in runner.wanted()} == set(CASES)
    assert {j.case for j in runner.wanted(link="line")} == set(LINE_CASES)
    for name in CASES:
        assert f"`{name}`" in page
