"""Every fault of the matrix of docs/faults.md against the device suite: fault_matrix.yaml says which requirements fail.

The fault is armed by the test, over the control socket, before the suite begins; the suite knows nothing of it. `make
test` tries each kind of fault at one point of a sort; `make fault-matrix` at all of them.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from unittest import mock

import pytest
from fault_case import FAR_S, VALUES
from gen_fault_matrix import PAGE, Row, load, table
from psabench.conform import dut as dut_module
from psabench.conform import runner, suite
from psabench.conform.dut import Addresses, Dut
from psabench.conform.profile import variant
from psabench.conform.verdict import Outcome, Verdict
from psabench.errors import ControlError
from psabench.procedures.head_bench import Silent

pytestmark = pytest.mark.host

suite.load()
EVERYWHERE = os.environ.get("PSABENCH_FAULTS") == "all"
BOARDS = sorted({r.board for r in load()})
plain = dut_module.scenario


def by_current(bench: dict[str, Any]) -> None:
    """Sensors that give currents over 1 kohm: the same volts."""
    for a in bench["units"][0]["axes"].values():
        a |= {"u0_v": a["u0_v"] / 1000, "afe": {"input": "current", "load_ohm": 1000}}


def felt(bench: dict[str, Any]) -> None:
    """Of the volts at each input, minus half a volt is the 1 g that the sensor feels, on a head without errors."""
    axes = bench["units"][0]["axes"]
    for axis, along in (("x", "ky"), ("y", "kx"), ("z", "kz")):  # the sensor's axis that is vertical with the head at 0
        axes[axis] |= {"u0_v": axes[axis]["u0_v"] + 0.5, f"{along}_v_per_g": 0.5}
    bench["units"][0].pop("on", None)  # the head, not the rate table
    errors = ("setting_error_arcsec_rms", "periodic_arcsec", "mount_error_arcsec_rms", "resolution_arcsec")
    bench |= {"head": dict.fromkeys(errors, 0), "site": {"g_mps2": 9.80665}}


BENCHES = {"": lambda _: None, "current": by_current, "felt": felt}


@contextmanager
def opened(board: str, bench: str = "") -> Iterator[Dut]:
    """The emulator that the suite starts for itself, with other inputs where a fault wants them."""

    def scenario(*args: Any, **options: Any) -> dict[str, Any]:
        made = plain(*args, **options)
        BENCHES[bench](made)
        return made

    with mock.patch.object(dut_module, "scenario", scenario), Dut.open(variant(board), Addresses()) as s:
        yield s


def points(s: Dut, kind: str) -> list[str]:
    """Of the board and of what is around it; a PSA-2 beside a gyro unit is tested as one."""
    found: list[str] = s.bench.control.call("fault.points", kind=kind).result["points"]
    return [p for p in found if not p.startswith("level.")]


def taken(s: Dut, kind: str, point: str, values: Mapping[str, Any]) -> bool:
    """Whether the emulator has that fault there, tried for an instant that does not come."""
    values = {k: v for k, v in values.items() if k not in ("after", "count", "since", "delay_s", "unit")}
    try:
        s.bench.fault(kind, point, **{**VALUES.get(kind, {}), **values}, at_s=FAR_S).clear()
    except ControlError as e:
        if e.code != "point":
            raise
        return False
    return True


def cases() -> list[Any]:
    """Rows that break something: all at all of their points, or one for each kind, board and sort of point."""
    found: dict[tuple[str, ...], Any] = {}
    for row in load():
        for point in row.at if row.breaks else ():
            sort = point if EVERYWHERE else re.sub(r"^(a\.line)\..*|\.[xyz]$", r"\1", point)
            found.setdefault(
                (row.board, row.kind, sort), pytest.param(row, point, id=f"{row.board} {row.kind} {point}")
            )
    return list(found.values())


def ids(outcomes: list[Outcome], *verdicts: Verdict) -> set[str]:
    return {i for o in outcomes if o.verdict in verdicts for i in o.requirements}


@pytest.mark.parametrize(("row", "point"), cases())
def test_a_fault_fails_the_requirements_that_it_breaks(row: Row, point: str) -> None:
    with opened(row.board, row.bench) as s:
        s.bench.fault(row.kind, point, **row.values)
        found = runner.run(s, Silent(), only=sorted(row.breaks))
    missed = row.breaks - ids(found, Verdict.FAILED)
    assert not missed, [(o.test, o.verdict.value, o.saw or o.reason) for o in found if missed & set(o.requirements)]


@pytest.mark.parametrize("board", BOARDS)
def test_what_breaks_nothing_is_not_called_broken(board: str) -> None:
    """All of a bench at once: the board conforms."""
    rows = [r for r in load() if r.board == board and r.unseen]
    for bench in sorted({r.bench for r in rows}):
        with opened(board, bench) as s:
            for row in rows:
                if row.bench == bench:
                    s.bench.fault(row.kind, row.at[0], **row.values)
            found = runner.run(s, Silent())
        assert ids(found, Verdict.FAILED, Verdict.INCONCLUSIVE) == set(), bench


@pytest.mark.parametrize("bench", sorted(set(BENCHES) - {""}))
@pytest.mark.parametrize("board", BOARDS)
def test_without_the_fault_they_pass(board: str, bench: str) -> None:
    """On the benches that are made for a fault; on the plain ones whole runs pass (test_conform_reports.py)."""
    only = {i for r in load() if r.board == board and r.bench == bench for i in r.breaks}
    if only:
        with opened(board, bench) as s:
            found = runner.run(s, Silent(), only=sorted(only))
        assert only <= ids(found, Verdict.PASSED)
        assert not ids(found, Verdict.FAILED, Verdict.INCONCLUSIVE)


@pytest.mark.parametrize("board", BOARDS)
def test_every_fault_that_a_board_can_have_stands_in_the_table_once(board: str) -> None:
    listed = Counter((r.kind, point) for r in load() if r.board == board for point in r.at)
    values = {r.kind: r.values for r in load() if r.board == board}
    with opened(board, "" if board == "gyro" else "current") as s:
        has = {
            (kind["kind"], point)
            for kind in s.bench.control.call("fault.kinds").result["kinds"]
            for point in points(s, kind["kind"])
            if taken(s, kind["kind"], point, values.get(kind["kind"], {}))
        }
    assert sorted(has - set(listed)) == [], "not in the table"
    assert sorted(set(listed) - has) == [], "the board has no such fault"
    assert [fault for fault, times in listed.items() if times > 1] == []


def test_the_page_has_the_table() -> None:
    assert table() in PAGE.read_text(encoding="utf-8"), "make docs"
