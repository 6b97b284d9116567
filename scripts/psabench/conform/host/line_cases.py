"""Frames on INT, DATA and CLK, whole and broken, as samples of the line port (docs/lineport.md).

They are made here, bit by bit after the article's protocol of exchange, and not by an emulated board: no board sends
frames with a pause of three periods. That the emulator's own lines look like this is tested beside it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from psabench.conform.host.judge import limits
from psabench.lineport import CLK, DATA, INT, PAUSE_CLK, WORDS

Samples = NDArray[np.uint8]

SAMPLE_HZ = 8_000_000
PERIOD = 8000  # samples from frame to frame: 1 ms
CYCLE = 4  # samples in a period of CLK: 2 MHz
WORD_BITS, LEAD_CLK = 32, 8
CHANNELS = (0, 1, 2, 3)
SETTLED, CLIPPED, OVERRUN, NEW = 1, 2, 4, 8
LOW = LEAD_CLK + WORDS * WORD_BITS + (WORDS - 1) * PAUSE_CLK  # periods of CLK that INT is low


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFrame:
    """One transfer. torn: a host must not take it; seen False: it does not come at all; glitch: INT low after it."""

    codes: tuple[int, int, int, int]
    channel: int = 0
    status: int = SETTLED
    skip: int | None = None  # pulse of CLK that is missing
    twin: int | None = None  # pulse that is followed by one too many
    pauses: tuple[int, ...] = (PAUSE_CLK,) * (WORDS - 1)
    cut_clk: int | None = None  # periods of CLK after which INT rises
    mute: bool = False  # INT without CLK
    narrow: bool = False  # DATA is right only a quarter of a period about the rise of CLK
    glitch_samples: int = 0
    seen: bool = True
    torn: bool = False

    @property
    def words(self) -> tuple[int, int, int, int]:
        x, y, z, t = self.codes
        mask = (1 << WORD_BITS) - 1
        return x & mask, y & mask, z & mask, (t & 0xFFFF) | self.channel << 16 | self.status << 20


def wave(f: LineFrame) -> Samples:
    """INT low, from its fall to its rise, as samples."""
    cycles: list[tuple[int, bool]] = [(0, False)] * LEAD_CLK  # level of DATA, whether CLK pulses
    for w, word in enumerate(f.words):
        cycles += [(word >> i & 1, True) for i in range(WORD_BITS)]
        cycles += [(0, False)] * (f.pauses[w] if w < WORDS - 1 else 0)
    pulses = [i for i, (_, pulse) in enumerate(cycles) if pulse]
    if f.skip is not None:
        cycles[pulses[f.skip]] = (cycles[pulses[f.skip]][0], False)
    if f.twin is not None:
        cycles.insert(pulses[f.twin], cycles[pulses[f.twin]])
    if f.mute:
        cycles = [(0, False)] * LOW
    return np.concatenate([_cycle(level, pulse, f.narrow) for level, pulse in cycles[: f.cut_clk]])


def _cycle(level: int, pulse: bool, narrow: bool) -> Samples:
    """Data and INT change with the fall of CLK, at the first sample; CLK rises in the middle."""
    data = np.full(CYCLE, DATA * level, np.uint8)
    if narrow and pulse:
        data[[0, -1]] ^= DATA
    if pulse:
        data[CYCLE // 2 :] |= CLK
    return data


@dataclass(frozen=True, slots=True, kw_only=True)
class LineCase:
    """title: what is played. first: samples of the line before the first frame; ppm: by which its clock is slow."""

    name: str
    title: str
    frames: Callable[[], list[LineFrame]]
    first: Callable[[], Samples] = field(default=lambda: np.full(PERIOD, INT, np.uint8))
    ppm: float = 0.0
    stuck: tuple[int, int] = (0, 0)  # INT is low from the beginning of one frame to that of another


def samples(case: LineCase) -> Iterator[Samples]:
    """A block for each period of the case."""
    yield case.first()
    at = 0.0
    for i, f in enumerate(case.frames()):
        begin, at = round(at), at + PERIOD * (1 + case.ppm * 1e-6)
        block = np.full(round(at) - begin, INT, np.uint8)
        if f.seen:
            low = wave(f)
            block[: len(low)] = low
        block[PERIOD // 2 : PERIOD // 2 + f.glitch_samples] &= np.uint8(~INT & 0xFF)
        if case.stuck[0] <= i < case.stuck[1]:
            block &= np.uint8(~INT & 0xFF)
        yield block


def falls_us(case: LineCase) -> list[float]:
    """Of INT, of each frame of the case, from the first one."""
    return [i * PERIOD * (1 + case.ppm * 1e-6) * 1e6 / SAMPLE_HZ for i in range(len(case.frames()))]


FULL = 8_000_000  # within the range

# Codes that show a bit order, a width or a sign that is wrong; the others are drawn.
TELLING = (
    (1, -(1 << 31), 2, 3),
    (-1, 0x7FFFFF, -0x800000, -1),
    (0x123456, -0x123456, 0x00FF00, 0x7FFF),
    (-2, 1, 0, -0x8000),
)


def _good(n: int, seed: int = 1) -> list[LineFrame]:
    """Codes within the range, no two frames alike."""
    rng = random.Random(seed)
    return [
        LineFrame(
            codes=(
                i + 1,
                -rng.randrange(1, 8_000_000),
                rng.randrange(-8_000_000, 8_000_000),
                rng.randrange(-32768, 32768),
            ),
            channel=CHANNELS[i % 4],
            status=SETTLED | (NEW if i % 3 else 0),
        )
        for i in range(n)
    ]


def _with(n: int, *odd: LineFrame) -> Callable[[], list[LineFrame]]:
    """Good frames, and these among them, ten good ones after each."""

    def make() -> list[LineFrame]:
        found = _good(n)
        for i, f in enumerate(odd):
            found.insert(10 + 11 * i, f)
        return found

    return make


def _words() -> list[LineFrame]:
    odd = [LineFrame(codes=c, channel=i, status=SETTLED | NEW) for i, c in enumerate(TELLING)]
    return [*_good(20), *odd, *_good(20, seed=2)]


def _gaps() -> list[LineFrame]:
    found = _good(60)
    for at in (10, 20, 21, 40, 41, 42, 43, 44):
        found[at] = LineFrame(codes=(0, 0, 0, 0), seen=False)
    return found


def _silence() -> list[LineFrame]:
    row = limits("HOST-STALE-01")
    nothing = LineFrame(codes=(0, 0, 0, 0), seen=False)
    short, long_ = (round(1000 * float(row.limit(name))) for name in ("silent_max_s", "told_after_s"))
    return [*_good(20), *[nothing] * (short - 1), *_good(20, seed=2), *[nothing] * long_, *_good(20, seed=3)]


def _frozen() -> list[LineFrame]:
    same = LineFrame(codes=(1000, -2000, 3000, 4000))
    return [
        *_good(20),
        *[same] * round(1500 * float(limits("HOST-STALE-02").limit("frozen_after_s"))),
        *_good(20, seed=2),
    ]


def _over() -> list[LineFrame]:
    found = _good(10)
    for axis in range(3):
        for code in (0x7FFFFF, -0x800000):
            codes = [5, -6, 7, 8]
            codes[axis] = code
            over = LineFrame(codes=(codes[0], codes[1], codes[2], codes[3]), status=SETTLED | CLIPPED)
            found += [over] * 3 + _good(5, seed=axis + 2)
    return found


def _torn(**how: object) -> LineFrame:
    return LineFrame(codes=(77, -77, 777, 7), torn=True, **how)  # type: ignore[arg-type]


def _under_way() -> Samples:
    """The second half of a frame, and the rest of its period."""
    half = wave(LineFrame(codes=(99, 98, 97, 96)))[LOW * CYCLE // 2 :]
    return np.concatenate([half, np.full(PERIOD - LOW * CYCLE, INT, np.uint8)])


PULSES = (0, 1, 31, 32, 100, 127)  # of CLK in a frame: the first and last of words, and between
LINE_CASES: Mapping[str, LineCase] = {
    c.name: c
    for c in (
        LineCase(name="line_good", title="a good board: signs, bit order, channels", frames=_words),
        LineCase(name="line_fast", title="its clock is 100 ppm fast", frames=lambda: _good(1500), ppm=-100.0),
        LineCase(name="line_slow", title="its clock is 100 ppm slow", frames=lambda: _good(1500), ppm=100.0),
        LineCase(
            name="line_narrow",
            title="DATA is right only a quarter of a period about the rise of CLK",
            frames=lambda: [LineFrame(codes=f.codes, channel=f.channel, narrow=True) for f in _good(50)],
        ),
        LineCase(
            name="line_under_way", title="listening begins in a frame", frames=lambda: _good(20), first=_under_way
        ),
        LineCase(
            name="line_missing",
            title="a pulse of CLK is missing",
            frames=_with(80, *(_torn(skip=p) for p in PULSES)),
        ),
        LineCase(
            name="line_extra",
            title="a pulse of CLK too many",
            frames=_with(80, *(_torn(twin=p) for p in PULSES)),
        ),
        LineCase(
            name="line_pauses",
            title="a pause of 3 or of 5 periods",
            frames=_with(80, *(_torn(pauses=p) for p in ((3, 4, 4), (4, 5, 4), (4, 4, 3), (5, 3, 4)))),
        ),
        LineCase(
            name="line_cut",
            title="INT without a bit; frames cut off",
            frames=_with(60, _torn(mute=True), _torn(cut_clk=30), _torn(cut_clk=LOW - 1)),
        ),
        LineCase(
            name="line_glitch",
            title="pulses on INT that are no transfer",
            frames=_with(60, *(LineFrame(codes=(n, n, n, n), glitch_samples=n) for n in (1, 2, 8))),
        ),
        LineCase(name="line_lost", title="1, 2 and 5 frames do not come", frames=_gaps),
        LineCase(name="line_silence", title="no frame for 40 ms, then for half a second", frames=_silence),
        LineCase(name="line_stuck", title="INT stays low for 0.6 s", frames=lambda: _good(700), stuck=(50, 650)),
        LineCase(name="line_frozen", title="words stand still for 1.5 s", frames=_frozen),
        LineCase(name="line_over", title="each axis at its limits", frames=_over),
        LineCase(
            name="line_status",
            title="words that have not settled; a conversion that was lost",
            frames=_with(60, *(LineFrame(codes=(5, 6, 7, 8), status=s) for s in (0, NEW, SETTLED | OVERRUN))),
        ),
    )
}


def due(frames: Iterable[LineFrame], stuck: tuple[int, int]) -> list[tuple[int, LineFrame]]:
    """Those that a host must tell, with their numbers among the frames of the case."""
    return [
        (i, f)
        for i, f in enumerate(frames)
        if f.seen and not f.torn and f.status & SETTLED and not (stuck[1] and stuck[0] <= i <= stuck[1])
    ]
