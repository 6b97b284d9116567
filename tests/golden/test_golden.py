"""The lines of emulator and chips against the traces of manifest.toml; GOLDEN=rewrite (`make golden`) rewrites them.

Both sides are cut to the manifest's lines and window. A failure names instant, line, want and got.
"""

from __future__ import annotations

import os
import subprocess
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from chip_scenes import SCENES
from psabench.link.vcd import Vcd, parse_vcd, read_vcd

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
EMU = ROOT / "build" / "psa-emu"
MAX_BYTES = 50_000


@dataclass(frozen=True, slots=True)
class Trace:
    """One row of the manifest."""

    name: str
    signals: list[str]
    window_us: list[int]
    see: str
    command: str = ""  # of build/psa-emu; or
    scene: str = ""  # of chip_scenes.py
    scope: str = "psa2"  # of the lines of a board

    @property
    def file(self) -> Path:
        return HERE / f"{self.name}.vcd"

    def excerpt(self, vcd: Vcd) -> str:
        start_us, end_us = self.window_us
        text = vcd.window(self.signals, start_us * 1000, end_us * 1000)
        scope = self.scene.partition("_")[0] or self.scope
        return text.replace("$scope module psa2", f"$scope module {scope}")

    def record(self, scratch: Path) -> Vcd:
        return play(self.scene, scratch) if self.scene else record(self.command, scratch)


TRACES = [Trace(**row) for row in tomllib.loads((HERE / "manifest.toml").read_text(encoding="utf-8"))["trace"]]


def test_every_scene_has_its_row() -> None:
    assert {t.scene for t in TRACES if t.scene} == set(SCENES)
    assert [t.name for t in TRACES if bool(t.scene) == bool(t.command)] == []


def first_difference(want: Vcd, got: Vcd) -> str:
    """'' if all lines of `want` do the same in `got`, else the first instant at which one does not."""
    names = list(want.wires)
    if list(got.wires) != names:
        return f"lines: want {' '.join(names)}, got {' '.join(got.wires)}"
    first: tuple[int, str] | None = None
    for name in names:
        a, b = want.wires[name], got.wires[name]
        edges = sorted(
            {*zip(a.t_ns.tolist(), a.level.tolist(), strict=True)}
            ^ {*zip(b.t_ns.tolist(), b.level.tolist(), strict=True)}
        )
        if not edges:
            continue
        t_ns = edges[0][0]
        text = f"t = {t_ns} ns, {name}: want {int(a.at(t_ns))}, got {int(b.at(t_ns))}"
        if first is None or t_ns < first[0]:
            first = t_ns, text
    return first[1] if first else ""


@cache
def record(command: str, scratch: Path) -> Vcd:
    """The recording of one run of the emulator."""
    vcd = scratch / f"{abs(hash(command))}.vcd"
    run = subprocess.run(
        [str(EMU), *command.format(vcd=vcd).split()], cwd=ROOT, capture_output=True, text=True, timeout=100, check=False
    )
    assert run.returncode == 0, f"psa-emu {command}: exit {run.returncode}: {run.stderr}"
    return read_vcd(vcd)


def play(scene: str, scratch: Path) -> Vcd:
    """The recording of a chip that is driven through a scene."""
    vcd = scratch / f"{scene}.vcd"
    SCENES[scene](vcd)
    return read_vcd(vcd)


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("golden")


@pytest.mark.parametrize("trace", TRACES, ids=lambda t: t.name)
def test_lines_do_what_the_golden_trace_shows(trace: Trace, scratch: Path) -> None:
    if not EMU.exists():
        pytest.fail("build/psa-emu is not there; make builds it")
    got = trace.excerpt(trace.record(scratch))
    if os.environ.get("GOLDEN") == "rewrite":
        trace.file.write_text(got, encoding="ascii")
    want = trace.file.read_text(encoding="ascii")
    assert len(want) < MAX_BYTES, f"{trace.file.name} has {len(want)} bytes: choose a shorter window"
    difference = first_difference(parse_vcd(want), parse_vcd(got))
    assert not difference, f"{trace.name}: {difference}; it should show: {trace.see}"


BASE = "$timescale 10 ns $end $var wire 1 ! Int $end $var wire 1 # CLK $end $enddefinitions $end #0 1! 0# "


@pytest.mark.parametrize(
    ("want", "got", "says"),
    [
        ("#10 0! #20 1# #30", "#10 0! #20 1# #40", ""),
        ("#10 0! #20 1# #30", "#10 0! #21 1# #30", "t = 200 ns, CLK: want 1, got 0"),
        ("#10 0! #20 1# #30", "#10 0! #30", "t = 200 ns, CLK: want 1, got 0"),
        ("#10 0! #20 1# #30", "#10 0! #15 1! #20 1# #30", "t = 150 ns, Int: want 0, got 1"),
        ("#10 0! #20 1# #30", "#10 1# #20 0! #30", "t = 100 ns, Int: want 0, got 1"),
    ],
)
def test_a_difference_is_told_by_instant_line_want_and_got(want: str, got: str, says: str) -> None:
    assert first_difference(parse_vcd(BASE + want), parse_vcd(BASE + got)) == says


def test_another_line_is_a_difference() -> None:
    other = parse_vcd((BASE + "#5").replace("CLK", "Data"))
    assert first_difference(parse_vcd(BASE + "#5"), other) == "lines: want Int CLK, got Int Data"
