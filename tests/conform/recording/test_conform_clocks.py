"""How fast a log's clock runs against the board's time stamps, over their wraps and over silences."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from psabench.conform.capture.log import CanFrame, CanLog, Capture
from psabench.conform.profile import variant
from psabench.conform.sources.clocks import Clocks, estimate
from psabench.link.protocol_files import dbc_node

PERIOD_S, UNIT_S, WRAP_S = 1e-3, 4e-6, 0.262144
ZT = 0x280 + dbc_node("psa2")


def clocks_of(at_s: np.ndarray, ppm: float, begin_s: float) -> Clocks:
    """Of a log of time stamps (PSA2_ZT) alone, whose clock is so fast; begin_s: the first stamp."""
    stamps = np.rint((at_s + begin_s) / UNIT_S).astype(int) % 2**16
    frames = tuple(
        CanFrame(float(t_s), ZT, struct.pack("<6xH", stamp))
        for t_s, stamp in zip(at_s * (1.0 + ppm * 1e-6), stamps.tolist(), strict=True)
    )
    return estimate(
        Capture(variant=variant("psa2"), node=dbc_node("psa2"), stimulus="stream", can=CanLog(frames=frames))
    )


@pytest.mark.parametrize("begin_s", [0.0, WRAP_S - UNIT_S, WRAP_S - 7 * PERIOD_S])
@pytest.mark.parametrize("ppm", [-90.0, 0.0, 60.0])
def test_stamps_are_followed_over_their_wraps(ppm: float, begin_s: float) -> None:
    """Two seconds hold seven or eight wraps of 16 bits at 4 us."""
    found = clocks_of(np.arange(2000) * PERIOD_S, ppm, begin_s).stamps
    assert found is not None
    assert found.points == 2000
    assert found.ppm == pytest.approx(ppm, abs=found.within_ppm)
    assert found.within_ppm < 5.0


@pytest.mark.parametrize("silent_s", [0.2, WRAP_S / 2.0, WRAP_S, 3.0 * WRAP_S + 0.1])
def test_a_silence_may_last_for_whole_turns_of_the_stamp(silent_s: float) -> None:
    at_s = np.arange(1000) * PERIOD_S
    at_s[500:] += silent_s
    found = clocks_of(at_s, 30.0, 0.0).stamps
    assert found is not None
    assert found.ppm == pytest.approx(30.0, abs=found.within_ppm)
    assert found.within_ppm < 10.0


def test_stamps_that_stand_still_are_no_clock() -> None:
    assert clocks_of(np.zeros(100), 0.0, 1.0).stamps is None
