"""The kernel's own slcan line discipline on the emulator's pseudo-terminal: its frames are ordinary SocketCAN frames.

The emulator runs outside the guest kernel (tests/uml/slc0), in wall pace, with tests/e2e/support/bench.yaml: no control
socket here, only the wire.
"""

from __future__ import annotations

import itertools
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from psabench.boards.psa2.device import Psa2
from rig import TIMEOUT_S, MakeRig, need

pytestmark = pytest.mark.slc0


@pytest.fixture
def unit(make_rig: MakeRig) -> Iterator[Psa2]:
    need("slc0")
    unit = make_rig("slc0").unit
    unit.wait_ready()
    yield unit
    unit.stop()


def statistic(name: str) -> int:
    return int(Path("/sys/class/net/slc0/statistics", name).read_text())


def test_sdo_reads_what_the_set_up_wrote(unit: Psa2) -> None:
    assert [unit.register(converter, 1) for converter in "xyz"] == [0x56] * 3


def test_a_second_of_frames_is_complete(unit: Psa2) -> None:
    unit.frames.forget()
    before = replace(unit.frames.counters)
    unit.start()
    assert unit.host.pump_until(lambda: len(unit.frames) >= 1000, TIMEOUT_S)
    assert (unit.frames.counters.lost, unit.frames.counters.torn) == (before.lost, before.torn)
    frames = unit.frames.take()
    assert np.allclose(np.diff(frames.t_sample_s), 1e-3, atol=8.1e-6)  # the stamp counts 4 us
    assert [statistic(f"{way}_{what}") for way in ("rx", "tx") for what in ("errors", "dropped")] == [0, 0, 0, 0]


def test_candump_sees_both_halves_of_each_sample_in_order(unit: Psa2) -> None:
    samples = 200
    with subprocess.Popen(["candump", "-L", "-r", "4000000", "slc0"], stdout=subprocess.PIPE, text=True) as dump:
        assert dump.stdout is not None
        try:
            unit.start()
            rows = (line.split()[2].split("#") for line in dump.stdout)
            first_half = itertools.dropwhile(lambda row: row[0] != "185", rows)
            got = list(itertools.islice(((i, d) for i, d in first_half if i in ("185", "285")), 2 * samples))
        finally:
            dump.terminate()
    assert [can_id for can_id, _ in got] == ["185", "285"] * samples
    seq = [int.from_bytes(bytes.fromhex(data)[6:8], "little") for can_id, data in got if can_id == "185"]
    assert seq == [(seq[0] + k) % 2**16 for k in range(samples)]


def test_cansend_and_cangen_reach_the_unit(unit: Psa2) -> None:
    subprocess.run(["cansend", "slc0", "000#0105"], check=True)  # NMT: start node 5
    assert unit.host.pump_until(lambda: len(unit.frames) >= 10, TIMEOUT_S)
    unit.stop()
    before = statistic("tx_packets")
    # Ids of no one: the unit must take them without harm and go on answering.
    subprocess.run(["cangen", "slc0", "-g", "1", "-n", "50", "-I", "7EF", "-L", "8"], check=True)
    assert unit.register("t", 3) == 0x82
    assert statistic("tx_packets") >= before + 50


def test_canbusload_counts_the_stream(unit: Psa2) -> None:
    unit.start()
    with subprocess.Popen(
        ["stdbuf", "-oL", "canbusload", "slc0@1000000"], stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        try:
            # " slc0@1000000  2001  222111  128064  22%": frames and bits of the last second
            rows = (line.split() for line in program.stdout if "slc0@1000000" in line)
            frames, bits = next((int(r[1]), int(r[2])) for r in rows if int(r[1]) > 10)
        finally:
            program.terminate()
    assert 100 <= bits / frames <= 135  # 8 bytes: 111 bits and stuffing, and a heartbeat now and then
