"""The device suite over PSD-1, PMKA, PIK and the gyro unit: clocks that are off, the line port alone, real time.

Whole runs of all profiles: test_conform_reports.py.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from psabench.boards.registry import BOARDS, BUS_BOARDS
from psabench.conform import suite
from psabench.conform.dut import INPUTS_V, UNIT, Addresses, Dut, scenario
from psabench.conform.profile import Variant, variant
from psabench.conform.runner import run
from psabench.conform.verdict import Outcome, Verdict
from psabench.emulator import Emulator
from psabench.link.endpoints import scpi_addresses
from psabench.procedures.head_bench import Silent

pytestmark = pytest.mark.host

suite.load()
PREFIX = {"psd1": "PSD1", "pmka": "PMKA", "pik": "PIK", "pik5": "PIK", "pik6": "PIK", "gyro": "GYRO"}
# What takes seconds where time passes by itself; make false-positives has all of it.
SOON = {
    "psd1": ("PSD1",),
    "pmka": ("PMKA-SAMP", "PMKA-BUS", "PMKA-ERR", "PMKA-CAN-04", "PMKA-CAN-05"),
    "pik6": ("PIK-CNT", "PIK-CAN", "PIK-RES", "PIK-SAT-01", "PIK-LAW-07", "PIK-LAW-08", "PIK-LAW-10"),
    "gyro": ("GYRO-RES", "GYRO-LEV-03", "GYRO-LEV-04", "GYRO-MODE-09"),
}
OFF_PPM = {"psd1": -100.0, "pmka": -100.0, "pik6": 100.0}


def judged(board: str, profile: str, seed: int = 1, ppm: float = 0.0, port_only: bool = False) -> list[Outcome]:
    with Dut.open(variant(board, profile), Addresses(port_only=port_only), seed=seed, clock_ppm=ppm) as s:
        return run(s, Silent(), only=(PREFIX[board],))


def faults(outcomes: Sequence[Outcome], *allowed: Verdict) -> list[str]:
    good = {Verdict.PASSED, *allowed}
    return [f"{o.test}: {o.saw or o.reason}; due {o.due}" for o in outcomes if o.verdict not in good]


@pytest.mark.parametrize("board", OFF_PPM)
def test_a_clock_that_is_off_conforms(board: str) -> None:
    assert faults(judged(board, board, seed=2, ppm=OFF_PPM[board])) == []


@pytest.mark.parametrize("board", ["psd1", "pik6", "pmka"])
def test_through_the_line_port_what_it_shows_conforms(board: str) -> None:
    outcomes = judged(board, board, seed=3, port_only=True)
    assert faults(outcomes, Verdict.NOT_OBSERVABLE) == []
    assert sum(o.verdict is Verdict.PASSED for o in outcomes) > 15


@contextmanager
def in_real_time(v: Variant, folder: Path) -> Iterator[Dut]:
    """An emulator whose time passes by itself, reached by addresses alone."""
    path, line, bus = folder / "bench.yaml", folder / "line", folder / "bus"
    path.write_text(json.dumps(scenario(v, INPUTS_V, 0.0)), encoding="utf-8")
    extra: list[str | Path] = ["--line", line]
    extra += ["--bus-port", f"{UNIT}:{bus}"] if v.family in BUS_BOARDS else []
    with Emulator(path, pace="wall", control=False, scpi=True, extra=extra) as emulator:
        can = next(f"socketcand:{e['host']}:{e['port']}" for e in emulator.endpoints if "can" in e)
        at = Addresses(
            can=can,
            lines=line,
            bus_port=bus if v.family in BUS_BOARDS else None,
            scpi=scpi_addresses(emulator.endpoints),
            inputs_v=INPUTS_V if BOARDS[v.family].has_inputs else {},
        )
        with Dut.open(v, at) as dut:
            yield dut


@pytest.mark.parametrize("board", SOON)
def test_in_real_time_what_is_seen_conforms(board: str, tmp_path: Path) -> None:
    with in_real_time(variant(board), tmp_path) as dut:
        assert not dut.lockstep
        outcomes = run(dut, Silent(), only=SOON[board])
    assert faults(outcomes, Verdict.NOT_OBSERVABLE) == []
    assert sum(o.verdict is Verdict.PASSED for o in outcomes) >= 4
