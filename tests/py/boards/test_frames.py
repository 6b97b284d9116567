"""PDOs to arrays: cantools, which is not used for streams, is the independent encoder."""

from __future__ import annotations

import itertools
import os
import random

import can
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from psabench.boards.psa2.frames import Form, FrameReader
from psabench.link import signals
from psabench.link.protocol_files import message

LSB_V = 10.0 / 2**23
CODE = st.integers(-(2**23), 2**23 - 1)


def seed() -> int:
    """Seed of random tests: TEST_SEED, or a fixed one; printed so that a failure can be replayed."""
    value = int(os.environ.get("TEST_SEED", "1"))
    print(f"TEST_SEED={value}")
    return value


def frame(name: str, raw: dict[str, int], t_s: float = 0.0, node: int = 5) -> can.Message:
    m = message(name)
    values = {s.name: 0 for s in m.signals} | raw
    data = m.encode(values, scaling=False, strict=False)
    return can.Message(
        arbitration_id=m.frame_id + node - 5, data=data, is_extended_id=False, is_fd=m.is_fd, timestamp=t_s
    )


def pair(code: tuple[int, int, int], seq: int, stamp: int = 0, node: int = 5, **flags: int) -> list[can.Message]:
    x, y, z = code
    return [
        frame("PSA2_XY", {"X": x, "Y": y, "SEQ": seq % 2**16}, node=node),
        frame("PSA2_ZT", {"Z": z, "TSTAMP": stamp % 2**16, "SETTLED": 1} | flags, t_s=seq * 1e-3, node=node),
    ]


def nmt(command: int, node: int) -> can.Message:
    return can.Message(arbitration_id=0x000, data=[command, node], is_extended_id=False)


def boot_up(node: int, state: int = 0) -> can.Message:
    return can.Message(arbitration_id=0x700 + node, data=[state], is_extended_id=False)


def feed(reader: FrameReader, messages: list[can.Message]) -> None:
    for m in messages:
        reader.on_message(m)


@given(st.lists(st.tuples(CODE, CODE, CODE), min_size=1, max_size=20))
def test_codes_come_back_as_volts_at_the_load(codes: list[tuple[int, int, int]]) -> None:
    reader = FrameReader()
    feed(reader, list(itertools.chain.from_iterable(pair(c, k) for k, c in enumerate(codes))))
    frames = reader.take()
    assert np.array_equal(frames.u_v, np.array(codes) * LSB_V)
    assert np.array_equal(frames.seq, np.arange(len(codes)))
    assert frames.settled.all()
    assert reader.counters.lost == reader.counters.torn == 0


@pytest.mark.parametrize("form", [Form.FAST, Form.FRAME])
def test_single_frame_forms_carry_the_same_codes(form: Form) -> None:
    shift = 3 if form is Form.FAST else 0
    codes = [(-(2**23), 2**23 - 8, 8 * k) for k in range(6)]
    reader = FrameReader()
    for k, (x, y, z) in enumerate(codes):
        raw = {"X": x >> shift, "Y": y >> shift, "Z": z >> shift}
        extra = {"TOG": k & 1} if form is Form.FAST else {"TSTAMP": 1000 * k}
        feed(reader, [frame(f"PSA2_{form.name}", raw | extra)])
    assert np.allclose(reader.take().u_v, np.array(codes) * LSB_V, rtol=0, atol=1e-12)
    assert reader.counters.lost == 0


def test_a_block_is_five_samples_in_order() -> None:
    reader = FrameReader()
    for b in range(3):
        raw = {"TSTAMP": b * 1250}
        for k in range(5):
            raw |= {f"X{k}": b * 5 + k, f"Y{k}": -(b * 5 + k), f"Z{k}": 7, f"T{k}": -2, f"STATUS{k}": 0x21}
        feed(reader, [frame("PSA2_BLOCK", raw)])
    assert len(reader) == 15
    frames = reader.take()
    assert np.array_equal(frames.axis("x"), np.arange(15) * LSB_V)
    assert np.array_equal(frames.axis("y"), -np.arange(15) * LSB_V)
    assert frames.temp_channel.tolist() == [2] * 15
    assert np.allclose(np.diff(frames.t_sample_s), 250e-6)
    assert frames.settled.all()
    assert not frames.clipped.any()


def test_a_temperature_is_a_code_at_the_nominal_scale_and_absent_where_the_form_has_none() -> None:
    """AD590 on 10 kohm at +-5 V: 0 degC is 273.15 K * 65.536 codes."""
    reader = FrameReader()
    for number, code in enumerate((round(273.15 * 65.536), round(373.15 * 65.536), 19539)):
        feed(reader, [frame("PSA2_XY", {"SEQ": number}), frame("PSA2_ZT", {"T": code, "CHANNEL": 1})])
    assert reader.take().temp_degc == pytest.approx([0.0, 100.0, 24.991], abs=0.008)
    feed(reader, [frame("PSA2_FAST", {"X": 1})])
    assert np.isnan(reader.take().temp_degc).all()


@pytest.mark.parametrize(
    ("seqs", "lost"),
    [
        ([0, 1, 2, 3], 0),
        ([0, 2, 3, 6], 3),
        ([65534, 65535, 0, 1], 0),  # the counter wraps
        ([65534, 1], 2),
    ],
)
def test_gaps_in_the_sequence_are_counted_across_takes(seqs: list[int], lost: int) -> None:
    reader = FrameReader()
    for s in seqs:
        feed(reader, pair((1, 2, 3), s))
        reader.take()
    assert reader.counters.lost == lost


def test_a_missing_toggle_in_the_fast_form_is_a_lost_frame() -> None:
    reader = FrameReader()
    for tog in (0, 1, 1, 0, 1):
        feed(reader, [frame("PSA2_FAST", {"TOG": tog})])
    reader.take()
    assert reader.counters.lost == 1


def test_halves_and_wrong_lengths_are_torn_and_never_mixed() -> None:
    xy, zt = pair((1, 2, 3), 0)
    xy2, zt2 = pair((4, 5, 6), 1)
    short = can.Message(arbitration_id=xy.arbitration_id, data=b"\x01", is_extended_id=False)
    reader = FrameReader()
    feed(reader, [zt, zt, xy, xy2, zt2, short, zt])
    frames = reader.take()
    assert np.array_equal(frames.u_v, [[4 * LSB_V, 5 * LSB_V, 6 * LSB_V]])
    assert reader.counters.torn == 4  # all but the first zt, which was under way: zt, xy, the short frame, zt


@pytest.mark.parametrize("period", [62.5, 250.0, 1000.0])  # of 4 us: 4000, 1000 and 250 a second
@pytest.mark.parametrize("after", [1, 2, 40])
@pytest.mark.parametrize("take_at", [0, 20, 29])
def test_halves_of_two_samples_are_not_one(period: float, after: int, take_at: int) -> None:
    """The second half of sample 30 and the first of a later one were lost, and all between."""
    reader = FrameReader()
    taken = 0
    for k in range(120):
        xy, zt = pair((k, k, k), 65500 + k, round(k * period))
        if 30 < k < 30 + after:
            continue
        feed(reader, [xy] * (k != 30 + after) + [zt] * (k != 30))
        if k == take_at:
            taken += len(reader.take())
    frames = reader.take()
    codes = np.rint(frames.u_v / LSB_V)
    assert (codes[:, 0] == codes[:, 2]).all()
    assert taken + len(frames) == 120 - 1 - after
    assert reader.counters.torn == 1
    assert reader.counters.lost == 1 + after


def test_other_rates_and_lost_samples_are_no_halves() -> None:
    """A stream that goes on faster, or slower, after a gap, or that has lost whole samples."""
    stamps = np.cumsum([0] + [250] * 20 + [100] * 20 + [500] * 20)
    stamps[10] += 200  # a stamp that is wrong, no sample that is lost
    reader = FrameReader()
    for k, stamp in enumerate(stamps.tolist()):
        if k not in (7, 8, 20, 33, 40, 41):
            feed(reader, pair((k, k, k), k, stamp))
    assert len(reader.take()) == 61 - 6
    assert reader.counters.torn == 0
    assert reader.counters.lost == 6


def test_other_nodes_and_error_frames_are_let_by() -> None:
    reader = FrameReader(node_id=6)
    error = can.Message(arbitration_id=0x186, is_error_frame=True)
    feed(reader, [*pair((1, 1, 1), 0), error, *pair((2, 2, 2), 0, node=6)])
    assert np.array_equal(reader.take().u_v, [[2 * LSB_V] * 3])


@given(st.binary(max_size=64), st.sampled_from(["PSA2_XY", "PSA2_ZT", "PSA2_FAST", "PSA2_FRAME", "PSA2_BLOCK"]))
def test_no_bytes_upset_the_reader(data: bytes, name: str) -> None:
    reader = FrameReader()
    length = can.util.len2dlc(len(data))
    padded = data.ljust(can.util.dlc2len(length), b"\0")
    reader.on_message(
        can.Message(arbitration_id=message(name).frame_id, data=padded, is_extended_id=False, is_fd=len(padded) > 8)
    )
    reader.take()


def test_every_signal_of_the_dbc_decodes_as_cantools_decodes_it() -> None:
    rng = random.Random(seed())
    for name in ("PSA2_XY", "PSA2_ZT", "PSA2_FAST", "PSA2_FRAME", "PSA2_BLOCK"):
        m = message(name)
        data = [rng.randbytes(m.length) for _ in range(50)]
        bits, at = signals.payload(data, m.length), signals.layout(m)
        ours = {s: signals.physical(bits, at[s]) for s in at}
        for k, d in enumerate(data):
            theirs = m.decode(d, decode_choices=False)
            for s, v in theirs.items():
                assert ours[s][k] == pytest.approx(v, rel=1e-12), (name, s)


@given(st.lists(st.integers(0, 2**16 - 1), min_size=1, max_size=50), st.integers(0, 2**40))
def test_unwrapped_counters_rise_and_keep_their_low_bits(steps: list[int], start: int) -> None:
    counter = np.cumsum(np.array(steps, dtype=np.int64)) % 2**16
    unwrapped = signals.unwrap(counter, 16, start)
    assert np.array_equal(unwrapped % 2**16, counter)
    assert unwrapped[0] >= start
    assert (np.diff(unwrapped) >= 0).all()
    assert (np.diff(unwrapped) < 2**16).all()
