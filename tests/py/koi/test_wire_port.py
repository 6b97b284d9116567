"""Bytes of a receiver's port, its clock, and when to look at it."""

from __future__ import annotations

import math
import random
import struct

import numpy as np
import pytest
from psabench.koi.wire.clock import WEEK_S, ClockLimits, ReceiverClock
from psabench.koi.wire.nav_pvt import PvtStream, Solution
from psabench.koi.wire.port import LEAST_S, LOOK_S, LookPlan
from pvt_packets import pvt

RMC = b"$GPRMC,092751.000,A,5321.6802,N,00630.3371,W,0.06,31.66,280511,,,A*45\r\n"  # published, with its checksum


# ---- bytes


def test_a_packet_is_read_as_pyubx2_wrote_it() -> None:
    stream = PvtStream()
    (s,) = stream.take(pvt(86_418_100, v_mms=(-1500, 2500, -250)))
    assert s.tow_s == 86_418.1
    assert (s.lat_rad, s.lon_rad) == pytest.approx((math.radians(55.7), math.radians(-37.5)), abs=1e-9)
    assert s.h_m == pytest.approx(150.123)
    assert s.v_enu_mps == pytest.approx((2.5, -1.5, 0.25))
    assert s.valid
    assert not stream.take(pvt(86_418_200, fix=0))[0].valid
    assert not stream.take(pvt(86_418_200, fix=2))[0].valid
    assert stream.counts.garbage == 0


def test_pieces_of_any_size_give_the_same() -> None:
    data = b"".join(pvt(1000 * k) + RMC for k in range(20))
    whole = PvtStream()
    expected = whole.take(data)
    assert len(expected) == 20
    for seed in range(5):
        rng, stream, at, found = random.Random(seed), PvtStream(), 0, list[Solution]()
        while at < len(data):
            size = rng.randint(1, 70)
            found += stream.take(data[at : at + size])
            at += size
        assert found == expected
        assert stream.counts == whole.counts
    assert (whole.counts.sentences, whole.counts.garbage, whole.counts.words()) == (20, 0, [])


def test_garbage_is_counted_and_costs_no_whole_message() -> None:
    """Noise, a lone head, a length that is wrong, a sentence that was cut."""
    rng = random.Random(7)
    noise = [bytes(rng.choices(range(256), k=40)) for _ in range(8)]
    pieces = [*noise, b"\xb5", b"\xb5\x62\x01\x07\xff\xff", RMC[:30], b"$", b"\xb5\x62\x01\x07\x5c\x00" + b"x" * 20]
    stream, found = PvtStream(), 0
    for k, piece in enumerate(pieces):
        found += len(stream.take(piece + pvt(1000 * k) + pvt(1000 * k + 500)))
    found += len(stream.take(bytes(1100)))  # a length within the noise may hold the last ones back
    assert found == 2 * len(pieces)
    assert stream.counts.garbage > 300
    assert any("bytes of neither" in w for w in stream.counts.words())


def test_a_wrong_checksum_is_no_solution() -> None:
    stream, bad, worse = PvtStream(), bytearray(pvt(1000)), bytearray(RMC)
    bad[40] ^= 4
    worse[12] ^= 1
    assert stream.take(bytes(bad) + bytes(worse) + pvt(2000))[0].tow_s == 2.0
    assert stream.counts.bad_sums == 2
    assert stream.counts.sentences == 0
    assert "receiver: expected messages with their checksum, got 2 with another" in stream.counts.words()


def test_a_receiver_without_packets_is_named() -> None:
    stream = PvtStream()
    assert stream.take(RMC * 3) == []
    (words,) = stream.counts.words()
    assert words == (
        "receiver: expected UBX-NAV-PVT, which has three velocities, got 3 sentences of NMEA and 0 other packets alone"
    )


def test_other_packets_are_passed_over() -> None:
    """One that is as long as NAV-PVT is."""
    body = struct.pack("<BBH", 0x01, 0x21, 92) + b"abcd" * 23
    a = b = 0
    for x in body:
        a = (a + x) & 255
        b = (b + a) & 255
    stream = PvtStream()
    assert stream.take(b"\xb5\x62" + body + bytes((a, b))) == []
    assert (stream.counts.others, stream.counts.garbage) == (1, 0)


# ---- clock


def arrivals(
    clock: ReceiverClock, seconds: int, ppm: float, width_s: float = 0.02, first_s: float = 1000.0
) -> list[float]:
    """Errors of the times, s: a unit's clock that is faster, arrivals 45 ms late, known to width_s."""
    rng, off = np.random.default_rng(5), []
    for k in range(seconds):
        true_s = (1.0 + 1e-6 * ppm) * k
        middle = true_s + 0.045 + width_s * (rng.random() - 0.5)
        found = clock.take((first_s + k) % WEEK_S, middle, width_s)
        assert found is not None
        off.append(found - true_s)
    return off


@pytest.mark.parametrize("ppm", [-100.0, 0.0, 100.0])
def test_clocks_apart_are_followed(ppm: float) -> None:
    """What is not in the nominal latency stays as a constant; the filter estimates it."""
    clock = ReceiverClock(ClockLimits(latency_s=0.03))
    off = np.array(arrivals(clock, 3600, ppm))
    assert np.abs(off[600:] - 0.015).max() < 0.002
    assert clock.rate_ppm == pytest.approx(ppm, abs=3.0 * clock.rate_sd_ppm)
    assert clock.rate_sd_ppm < 1.0
    assert (clock.jumps, clock.stray, clock.backwards) == (0, 0, 0)


def test_a_week_ends() -> None:
    clock = ReceiverClock()
    arrivals(clock, 100, 0.0, first_s=WEEK_S - 50.0)
    assert (clock.jumps, clock.backwards) == (0, 0)


def test_a_late_arrival_is_left_out() -> None:
    clock = ReceiverClock()
    arrivals(clock, 100, 0.0)
    assert clock.take(1100.0, 100.0 + 0.6, 0.02) is None
    assert clock.take(1101.0, 101.0 + 0.045, 0.02) == pytest.approx(101.015, abs=0.003)
    assert (clock.stray, clock.jumps) == (1, 0)


@pytest.mark.parametrize("jump_s", [-7.0, 11.0])
def test_time_that_jumps_is_believed_after_a_row(jump_s: float) -> None:
    clock = ReceiverClock()
    arrivals(clock, 100, 0.0)
    found = [clock.take(1100.0 + k + jump_s, 100.0 + k + 0.045, 0.02) for k in range(8)]
    assert found[:5] == [None] * 5
    assert found[5:] == pytest.approx([100.0 + k + 0.015 for k in range(5, 8)], abs=0.02)
    assert clock.jumps == 1


def test_time_that_stands_is_never_believed() -> None:
    clock = ReceiverClock()
    arrivals(clock, 100, 0.0)
    assert [clock.take(1099.0, 100.0 + k, 0.02) for k in range(60)] == [None] * 60
    assert (clock.jumps, clock.backwards) == (0, 60)
    assert clock.take(1160.0, 160.045, 0.02) == pytest.approx(160.015, abs=0.01)


# ---- looks


@pytest.mark.parametrize("period_s", [1.0, 0.2, 0.1])
def test_looks_close_in_on_the_arrival(period_s: float) -> None:
    """Bursts 37 ms after each solution: soon known to 8 ms, with a handful of looks for each."""
    plan, now_s, looks, widths = LookPlan(), 0.0, 0, list[float]()
    while now_s < 60.0:
        before_s, now_s = now_s, plan.next_look_s(now_s)
        looks += 1
        assert 0.0 < now_s - before_s <= LOOK_S + 1e-9
        number = math.floor((now_s - 0.037) / period_s)  # of the last one that is there
        if number * period_s + 0.037 > before_s:
            plan.arrived(before_s, now_s, number * period_s)
            widths.append(now_s - before_s)
        else:
            plan.missed(now_s)
    assert max(widths[20:]) <= 2.0 * LEAST_S + 1e-9
    assert looks < 60 * (4 + 4 / period_s)
