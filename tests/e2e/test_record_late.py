"""A recording that begins late, of lines that nobody has watched before, is a piece of the one from power-on."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from psabench.control import Control
from psabench.emulator import Emulator
from psabench.vcd import Vcd, read_vcd
from rig import psa_emu
from test_boards import ALL, SETUP_S, scenario

pytestmark = pytest.mark.host

SEED = int(os.environ.get("TEST_SEED", "1"))
RECORDINGS = 20
LENGTH_NS = 1_500_010  # a reading of most boards and a half; it ends at no edge, which would make the file end later
CLOCK_NS = 400  # half of the recordings begin at an edge of PSD-1's 1M25, if it has one at its power-on
LAG_NS = 200_000  # later edges are not all known when a recording ends
UNIT = ("--vcd-unit", "1")


def record_pieces(path: Path, folder: Path) -> dict[int, Path]:
    """Recordings by the instant at which they were asked for."""
    r = random.Random(SEED)
    made: dict[int, Path] = {}
    with Emulator(path, extra=("--start", *UNIT)) as emulator, Control(emulator.control_path or Path()) as control:
        t_ns = control.call("run", for_s=SETUP_S).t_ns
        for i in range(RECORDINGS):
            wait_ns = r.randrange(1_000_000, 3_000_000)
            wait_ns -= (t_ns + wait_ns) % (CLOCK_NS if i % 2 else 1)
            t_ns = control.call("run", for_s=wait_ns * 1e-9).t_ns
            made[t_ns] = folder / f"{i}.vcd"
            control.call("vcd.start", path=str(made[t_ns]))
            t_ns = control.call("run", for_s=LENGTH_NS * 1e-9).t_ns
            control.call("vcd.stop")
    return made


def changes(v: Vcd, names: list[str]) -> list[tuple[int, str, int]]:
    """All of a recording, those of its first instant too: what Vcd.edges() would leave out."""
    wires = [v.wires[n] for n in names]
    each = [(int(t), i, int(x)) for i, w in enumerate(wires) for t, x in zip(w.t_ns[1:], w.level[1:], strict=True)]
    return [(t, names[i], x) for t, i, x in sorted(each, key=lambda e: e[:2])]


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
        before = {n: int(whole.wires[n].at(t_ns - 1)) for n in names}
        assert levels == before, f"levels before {t_ns} ns, TEST_SEED={SEED}"
        edges = whole.edges(names, t_ns - 1, end_ns)
        assert changes(piece, names) == edges, f"edges from {t_ns} ns on, TEST_SEED={SEED}"
        found += len(edges)
    assert found > 0
