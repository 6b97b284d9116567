"""A recording that begins late, of lines that no one has watched before, is a piece of the one from power-on."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from psabench.emulator import Emulator
from psabench.link.control import Control
from psabench.link.vcd import Vcd, read_vcd
from rig import psa_emu

from tests.e2e.boards.test_boards import ALL, NAMES, SETUP_S, scenario

pytestmark = pytest.mark.host

SEED = int(os.environ.get("TEST_SEED", "1"))
RECORDINGS = 21
LENGTH_NS = 1_500_010  # a reading of most boards and a half; it ends at no edge, which would make the file end later
CLOCK_NS = 400  # of PSD-1's 1M25: a third of the recordings begin at one of its edges, as it has one at its power-on
EVENTS = {"psa2": "INT_FALL", "psd1": "RFX", "pmka": "READING", "pik": "LATCH", "gyro": "STEP"}  # and a third at these
# A recording of another board begins at any instant.
LAG_NS = 200_000  # longer than any word or pulse of a board; later edges are not all known when a recording ends
UNIT = ("--vcd-unit", "1")
# What a board does not tell a late listener while it is under way: pulses, words of the converters' ports.
UNDER_WAY = {"STEP", "SClk", "DIn", "DOutX", "DOutY", "DOutZ", "DInT", "DOutT"}


def wait(control: Control, i: int, event: str | None, wait_ns: int) -> int:
    """Until the instant at which the i-th recording begins."""
    now_ns = control.call("time").t_ns
    wait_ns -= (now_ns + wait_ns) % (CLOCK_NS if i % 3 == 1 else 1)
    if i % 3 < 2 or event is None:
        return control.call("run", for_s=wait_ns * 1e-9).t_ns
    control.call("run", for_s=wait_ns * 1e-9)
    return control.call("run.until", event=event).t_ns


def record_pieces(path: Path, folder: Path, event: str | None) -> dict[int, Path]:
    """Recordings by the instant at which they were asked for."""
    r = random.Random(SEED)
    made: dict[int, Path] = {}
    with Emulator(path, extra=("--start", *UNIT)) as emulator, Control(emulator.control_path or Path()) as control:
        control.call("run", for_s=SETUP_S)
        for i in range(RECORDINGS):
            t_ns = wait(control, i, event, r.randrange(1_000_000, 3_000_000))
            made[t_ns] = folder / f"{i}.vcd"
            control.call("vcd.start", path=str(made[t_ns]))
            control.call("run", for_s=LENGTH_NS * 1e-9)
            control.call("vcd.stop")
    return made


def changes(v: Vcd, names: list[str]) -> list[tuple[int, str, int]]:
    """All of a recording, those of its first instant too: what Vcd.edges() would leave out."""
    wires = [v.wires[n] for n in names]
    each = [(int(t), i, int(x)) for i, w in enumerate(wires) for t, x in zip(w.t_ns[1:], w.level[1:], strict=True)]
    return [(t, names[i], x) for t, i, x in sorted(each, key=lambda e: e[:2])]


@pytest.mark.parametrize("board", ALL)
def test_a_recording_begins_when_it_is_asked_for(board: str, tmp_path: Path) -> None:
    """It has no edge that never was, and lacks none but of words and pulses that were under way."""
    path, whole_path = scenario(tmp_path, board), tmp_path / "whole.vcd"
    pieces = record_pieces(path, tmp_path, EVENTS.get(NAMES[board]))
    run = ("--start", "--pace", "free", "--for", "1s", "--can", "none", "--quiet", *UNIT)
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
        known_ns = t_ns + LAG_NS
        levels = {n: int(piece.wires[n].at(known_ns)) for n in names}
        assert levels == {n: int(whole.wires[n].at(known_ns)) for n in names}, f"soon after {t_ns} ns, TEST_SEED={SEED}"
        edges = whole.edges(names, t_ns - 1, end_ns)
        seen = set(changes(piece, names))
        assert seen <= set(edges), f"from {t_ns} ns on, TEST_SEED={SEED}"
        lacking = [e for e in edges if e not in seen and e[0] > t_ns and not (e[0] < known_ns and e[1] in UNDER_WAY)]
        assert lacking == [], f"after {t_ns} ns, TEST_SEED={SEED}"
        found += len(edges)
    assert found > 0
