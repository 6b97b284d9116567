"""The line port decoder against a sample-by-sample reading of the same rules, whatever the bytes and their pieces."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from dataclasses import asdict
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from psabench.link import lineport
from psabench.link.lineport import CLK, DATA, GAP, INT, Counts, Frames, LineDecoder, LineFormat, concat, decode_stream

PERIOD = 8000  # samples from frame to frame: 1 ms at 8 MHz


def lines(words: Sequence[int], *, word_bits: int = 32, samples_per_clk: float = 4.0, phase: float = 0.0) -> bytes:
    """A frame as sampled, from INT fall to a little after its rise; phase: of the sampling clock, in samples."""
    lead_in = 8
    clks = lead_in + 4 * word_bits + 12
    n = int((clks + 3) * samples_per_clk)
    out = bytearray()
    for k in range(n):
        clk = (k + phase) / samples_per_clk  # CLK periods since INT fell
        word, bit = divmod(int(clk) - lead_in, word_bits + 4)
        sending = clk >= lead_in and 0 <= word < 4 and bit < word_bits
        byte = INT if clk >= clks else 0
        if sending:
            byte |= DATA * (words[word] >> bit & 1) | CLK * (clk % 1 >= 0.5)
        out.append(byte)
    return bytes(out)


def idle(n: int) -> bytes:
    return bytes([INT]) * n


def train(frames: Sequence[bytes], period: int = PERIOD) -> bytes:
    """Frames one period apart; an empty one is a frame that was not sent."""
    return idle(100) + b"".join(f + idle(period - len(f)) for f in frames)


def slow(data: bytes, fmt: LineFormat) -> tuple[list[tuple[int, int, list[int]]], Counts]:
    """The definition: one sample at a time."""
    frames: list[tuple[int, int, list[int]]] = []
    c = Counts(samples=len(data))
    before, fall, prev_fall, gap = 0, -1, -1, -1
    bits: list[tuple[int, int]] = []
    for k, b in enumerate(data):
        if b & GAP:
            c.gaps += 1
            gap = k
        if before & INT and not b & INT:
            # no time is known across a gap
            if prev_fall >= gap and prev_fall >= 0 and fmt.period_s is not None:
                off, steps = spacing((k - prev_fall) / fmt.sample_hz, fmt.period_s)
                slack = fmt.tolerance_s + 1 / fmt.sample_hz
                c.lost += steps - 1
                c.late += off > slack
                c.early += off < -slack
            fall = prev_fall = k
            bits = []
        if b & INT and not before & INT and fall >= 0:
            if gap < fall and in_shape([at for at, _ in bits], fmt):
                values = [sum(bits[w * fmt.word_bits + i][1] << i for i in range(fmt.word_bits)) for w in range(4)]
                frames.append((fall, k, values))
                c.frames += 1
            else:
                c.torn += 1
            fall = -1
        if b & CLK and not before & CLK and fall >= 0:
            bits.append((k, 1 if b & DATA else 0))
        before = b
    return frames, c


def in_shape(at: list[int], fmt: LineFormat) -> bool:
    if len(at) != 4 * fmt.word_bits:
        return False
    mean = (at[-1] - at[0]) / (4 * fmt.word_bits + 11)
    for i in range(1, len(at)):
        periods = 5 if i % fmt.word_bits == 0 else 1
        if abs(at[i] - at[i - 1] - mean * periods) > max(mean / 2, 1.0):
            return False
    return True


def spacing(spacing_s: float, period_s: float) -> tuple[float, int]:
    steps = max(round(spacing_s / period_s), 1)
    return spacing_s - steps * period_s, steps


def in_pieces(data: bytes, cuts: Sequence[int], fmt: LineFormat, block: int = lineport.BLOCK) -> tuple[Frames, Counts]:
    """As decoded in these pieces, each block by block; a memoryview keeps the pieces at any alignment."""
    d = LineDecoder(fmt)
    view = memoryview(data)
    edges = [0, *sorted(c % (len(data) + 1) for c in cuts), len(data)]
    with mock.patch.object(lineport, "BLOCK", block):
        return concat([d.feed(view[a:b]) for a, b in itertools.pairwise(edges)]), d.counts


def assert_same(got: Frames, want: list[tuple[int, int, list[int]]]) -> None:
    assert got.fall.tolist() == [f for f, _, _ in want]
    assert got.rise.tolist() == [r for _, r, _ in want]
    assert got.words.tolist() == [w for _, _, w in want]


words32 = st.lists(st.integers(0, 2**32 - 1), min_size=4, max_size=4)


@settings(deadline=None)
@given(
    st.sampled_from((16, 24, 32)),
    st.lists(words32, min_size=1, max_size=4),
    st.floats(3.0, 9.0),
    st.floats(0, 0.999),
    st.lists(st.integers(0, 10**6), max_size=6),
)
def test_random_frames_at_any_sample_phase_and_rate(
    word_bits: int, frames: list[list[int]], samples_per_clk: float, phase: float, cuts: list[int]
) -> None:
    mask = (1 << word_bits) - 1
    sent = [[w & mask for w in f] for f in frames]
    data = train([lines(f, word_bits=word_bits, samples_per_clk=samples_per_clk, phase=phase) for f in sent])
    got, counts = in_pieces(data, cuts, LineFormat(word_bits=word_bits))
    assert got.words.tolist() == sent
    assert asdict(counts) == asdict(Counts(samples=len(data), frames=len(sent)))
    assert got.fall.tolist() == [100 + PERIOD * i for i in range(len(sent))]


pieces = st.one_of(
    st.binary(max_size=300),
    st.integers(1, 3000).map(idle),
    st.builds(lambda n: bytes(n), st.integers(1, 300)),  # INT stuck low
    st.builds(lambda n, b: idle(n) + bytes([b]) + idle(8), st.integers(0, 40), st.integers(0, 255)),  # a lone sample
    st.builds(lambda n: bytes([0, CLK]) * n, st.integers(1, 300)),  # and CLK running
    st.builds(
        lambda w, cut, flip: bytes(b ^ (flip if i == cut else 0) for i, b in enumerate(lines(w, word_bits=16))),
        words32,
        st.integers(0, 700),
        st.sampled_from((0, INT, DATA, CLK, GAP, GAP | INT)),
    ),
    st.builds(
        lambda w, a, b: (x := lines(w, word_bits=16))[:a] + x[a + b :], words32, st.integers(0, 400), st.integers(0, 99)
    ),
)


@settings(deadline=None, max_examples=300)
@given(
    st.lists(pieces, max_size=12),
    st.lists(st.integers(0, 10**6), max_size=8),
    st.sampled_from((5, 64, 100, 1003, lineport.BLOCK)),
)
def test_arbitrary_bytes_in_arbitrary_pieces_read_as_the_definition_says(
    parts: list[bytes], cuts: list[int], block: int
) -> None:
    data = b"".join(parts)
    fmt = LineFormat(word_bits=16, period_s=100e-6, tolerance_s=5e-6)
    got, counts = in_pieces(data, cuts, fmt, block)
    want, want_counts = slow(data, fmt)
    assert_same(got, want)
    assert asdict(counts) == asdict(want_counts)


F = lines([1, 0xFFFFFC18, 0x007FFFFF, 0x00012345])
NO_BITS = bytes([0]) * 600 + idle(1)


@pytest.mark.parametrize(
    ("data", "want"),
    [
        (train([F, F, F]), {"frames": 3}),
        (train([F, b"", b"", F]), {"frames": 2, "lost": 2}),
        (train([F, F[:300] + F[340:], F]), {"frames": 2, "torn": 1}),  # 10 CLK periods of the frame are missing
        (train([F, F + F[1:], F]), {"frames": 4, "early": 2}),  # one more, and the next comes early after it
        (train([F, idle(400) + F, F]), {"frames": 3, "late": 1, "early": 1}),  # 50 us late once
        (train([F, idle(100) + F, F]), {"frames": 3}),  # 12.5 us: within tolerance
        (train([F, NO_BITS, F]), {"frames": 2, "torn": 1}),
        (F[200:] + train([F]), {"frames": 1}),  # the recording began inside a frame
        (train([F])[:-PERIOD] + F[:300], {}),  # and ended inside one
        (train([F, F])[:9000] + bytes([INT | GAP]) + train([b"", b"", F]), {"frames": 3, "gaps": 1}),
        (train([F, F[:250] + bytes([F[250] | GAP]) + F[251:], F]), {"frames": 2, "torn": 1, "gaps": 1}),
        (train([F, F[:160] + F[176:], F]), {"frames": 2, "torn": 1}),  # all bits, but no pause after the first word
        (train([F, F[:170] + bytes(16) + F[170:], F]), {"frames": 2, "torn": 1}),  # a pause of 8 CLK periods
        (train([F, F[:48] + bytes(4) + F[48:], F]), {"frames": 2, "torn": 1}),  # one CLK period of two inside a word
        (train([F, F[:592] + bytes([0, 0, CLK, CLK]) + F[592:], F]), {"frames": 2, "torn": 1}),  # one bit too many
        (train([F, F[:592] + bytes([F[592] | GAP]) + F[593:], F]), {"frames": 2, "torn": 1, "gaps": 1}),
        (idle(10**6), {}),
        (bytes(10**6), {}),
        (bytes([INT]) + bytes([0, CLK]) * 500_000, {}),
        (b"", {}),
    ],
)
def test_what_is_counted(data: bytes, want: dict[str, int]) -> None:
    for piece in (len(data), 37 if len(data) < 100_000 else 99_991):  # 37: a cut behind the bit too many
        d = LineDecoder()
        got = concat(d.feed(data[i : i + piece]) for i in range(0, len(data), max(piece, 1)))
        assert asdict(d.counts) == asdict(Counts(samples=len(data))) | want
        assert len(got) == want.get("frames", 0)


@pytest.mark.parametrize("cut_at_rise", [False, True])
def test_int_may_rise_at_any_place_of_a_row_or_piece(cut_at_rise: bool) -> None:
    low = F[: F.index(INT)]
    for before in range(1, 2 * lineport.ROW):
        data = idle(before) + low + idle(300) + low + idle(300)
        rise = before + len(low)
        got, counts = in_pieces(data, [rise] if cut_at_rise else [], LineFormat(period_s=None))
        assert got.rise.tolist() == [rise, rise + 300 + len(low)]
        assert (counts.frames, counts.torn) == (2, 0)


def test_words_are_twos_complement_of_their_width() -> None:
    raw = [[0x8000, 0x7FFF, 0xFFFF, 1]]
    f = Frames(np.zeros(1, np.int64), np.ones(1, np.int64), np.array(raw, np.uint32))
    assert f.signed(16).tolist() == [[-32768, 32767, -1, 1]]
    assert f.signed(24).tolist() == raw
    g = LineDecoder().feed(train([F]))
    assert g.signed(32)[0, :3].tolist() == [1, -1000, 8388607]


def test_unused_bits_of_the_byte_do_not_matter() -> None:
    noise = np.random.default_rng(3).integers(0, 16, len(F), dtype=np.uint8) << 3
    data = train([(np.frombuffer(F, np.uint8) | noise).tobytes()])
    assert LineDecoder().feed(data).words.tolist() == LineDecoder().feed(train([F])).words.tolist()


def test_memory_stays_bounded_when_int_never_rises() -> None:
    d = LineDecoder()
    for _ in range(20):
        d.feed(bytes([INT]) + bytes([0, CLK]) * 50_000)
    assert len(d._clk) <= d.fmt.bits + 1
    assert d.counts.frames == 0


def test_a_stream_is_read_to_its_end() -> None:
    d = LineDecoder()
    data = train([F] * 300)
    assert len(concat(decode_stream(io.BytesIO(data), d))) == 300
    assert d.counts.samples == len(data) > 2_000_000
    assert str(d.counts) == f"samples={len(data)} frames=300 torn=0 lost=0 late=0 early=0 gaps=0"


@pytest.mark.parametrize(
    ("kw", "says"),
    [
        ({"word_bits": 12}, "16, 24 or 32"),
        ({"sample_hz": 0.0}, "positive"),
        ({"tolerance_s": 0.5e-3}, "expected less than period_s"),
    ],
)
def test_a_format_that_cannot_be_is_refused(kw: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        LineFormat(**kw)  # type: ignore[arg-type]
