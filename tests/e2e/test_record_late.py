"""A recording that begins late, of lines that nobody has watched before, is a piece of the one from power-on."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from psabench.control import Control
from psabench.emulator import Emulator
from psabench.vcd import read_vcd
from rig import psa_emu
from test_boards import ALL, SETUP_S, scenario

pytestmark = pytest.mark.host

SEED = int(os.environ.get("TEST_SEED", "1"))
RECORDINGS = 20
LENGTH_NS = 1_500_000  # a reading of most boards and a half
LAG_NS = 200_000  # later edges are not all known when a recording ends
UNIT = ("--vcd-unit", "1")


def record_pieces(path: Path, folder: Path) -> dict[int, Path]:
    """Recordings by the instant at which they were asked for."""
    r = random.Random(SEED)
    made: dict[int, Path] = {}
    with Emulator(path, extra=("--start", *UNIT)) as emulator, Control(emulator.control_path or Path()) as control:
        control.call("run", for_s=SETUP_S)
        for i in range(RECORDINGS):
            t_ns = control.call("run", for_s=r.randrange(1_000_000, 3_000_000) * 1e-9).t_ns
            made[t_ns] = folder / f"{i}.vcd"
            control.call("vcd.start", path=str(made[t_ns]))
            control.call("run", for_s=LENGTH_NS * 1e-9)
            control.call("vcd.stop")
    return made


@pytest.mark.parametrize("board", ALL)
def test_a_recording_begins_when_it_is_asked_for_and_lacks_nothing(board: str, tmp_path: Path) -> None:
    path, whole_path = scenario(tmp_path, board), tmp_path / "whole.vcd"
    pieces = record_pieces(path, tmp_path)
    run = ("--start", "--pace", "free", "--for", "600ms", "--can", "none", "--quiet", *UNIT)
    done = psa_emu(path, *run, "--vcd", whole_path)
    assert done.returncode == 0, done.stderr
    whole = read_vcd(whole_path)
    names = list(whole.wires)
    assert max(pieces) + LENGTH_NS < whole.end_ns
    found = 0
    for t_ns, piece_path in pieces.items():
        piece = read_vcd(piece_path)
        end_ns = t_ns + LENGTH_NS - LAG_NS
        assert (piece.start_ns, piece.end_ns) == (t_ns, end_ns), f"TEST_SEED={SEED}"
        levels = {n: int(piece.wires[n].level[0]) for n in names}
        assert levels == {n: int(whole.wires[n].at(t_ns)) for n in names}, f"levels at {t_ns} ns, TEST_SEED={SEED}"
        edges = whole.edges(names, t_ns, end_ns)
        assert piece.edges(names, t_ns, end_ns) == edges, f"edges after {t_ns} ns, TEST_SEED={SEED}"
        found += len(edges)
    assert found > 0
