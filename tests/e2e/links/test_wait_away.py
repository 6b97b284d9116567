"""A wait without the buses: time goes on, what passed is no one's, and afterwards all is as before."""

from __future__ import annotations

import pytest
from psabench.bench import Bench

pytestmark = pytest.mark.host


def test_time_goes_on_and_the_bench_is_as_it_was() -> None:
    with Bench.start("stream") as bench:
        unit = bench.unit
        unit.wait_ready()
        unit.start()
        before_s = bench.time_s
        for dwell_s in (1.5, 2.0):
            bench.wait_away(dwell_s)
            assert bench.time_s - before_s >= dwell_s
            before_s = bench.time_s
            assert unit.register("x", 1) == 0x56  # what we send arrives before time goes on
            assert len(unit.stream(10)) == 10
            assert unit.frames.counters.lost == unit.frames.counters.torn == 0


def test_nothing_is_received_meanwhile() -> None:
    with Bench.start("stream") as bench:
        bench.unit.wait_ready()
        bench.unit.start()
        bench.wait_away(5.0)
        assert bench.host.received == 0
        bench.wait(0.1)
        assert 190 <= bench.host.received <= 210  # two messages a frame, 1000 frames a second
