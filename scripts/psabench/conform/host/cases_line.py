"""What is sent to a host on INT, DATA and CLK: frames, whole and broken, of any profile (docs/lineport.md)."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field

import numpy as np

from psabench.conform.host.cases_can import FAMILY
from psabench.conform.host.check import limits
from psabench.conform.host.line_waves import (
    CLIPPED,
    NEW,
    OVERRUN,
    PERIOD,
    SAMPLE_HZ,
    SETTLED,
    Form,
    LineFrame,
    Samples,
    idle,
    wave,
)
from psabench.link.lineport import INT, WORDS

CHANNELS = (0, 1, 2, 3)


Frames = list[LineFrame]


@dataclass(frozen=True, slots=True)
class LineCase:
    """title: what is sent. first: samples of the line before the first frame; ppm: by which its clock is slow."""

    name: str
    title: str
    _: KW_ONLY
    frames: Callable[[Form], Frames]
    first: Callable[[Form], Samples] = field(default=lambda _: idle(PERIOD))
    ppm: float = 0.0
    boards: tuple[str, ...] = FAMILY
    links: tuple[str, ...] = ("line",)
    stuck: tuple[int, int] = (0, 0)  # INT is low from the beginning of one frame to that of another


def samples(case: LineCase, form: Form) -> Iterator[Samples]:
    """A block for each period of the case."""
    yield case.first(form)
    at = 0.0
    for i, f in enumerate(case.frames(form)):
        begin, at = round(at), at + PERIOD * (1 + case.ppm * 1e-6)
        block = idle(round(at) - begin)
        if f.seen:
            low = wave(f, form)
            block[: len(low)] = low
        block[PERIOD // 2 : PERIOD // 2 + f.glitch_samples] &= np.uint8(~INT & 0xFF)
        if case.stuck[0] <= i < case.stuck[1]:
            block &= np.uint8(~INT & 0xFF)
        yield block


def falls_us(case: LineCase, form: Form) -> list[float]:
    """Of INT, of each frame of the case, from the first one."""
    return [i * PERIOD * (1 + case.ppm * 1e-6) * 1e6 / SAMPLE_HZ for i in range(len(case.frames(form)))]


def due(case: LineCase, form: Form) -> list[tuple[int, LineFrame]]:
    """Those that a host must tell, with their numbers among the frames of the case."""
    begin, end = case.stuck
    return [
        (i, f)
        for i, f in enumerate(case.frames(form))
        if f.seen and not f.torn and (f.status & SETTLED or not form.has_status) and not (end and begin <= i <= end)
    ]


def _good(form: Form, n: int, seed: int = 1) -> Frames:
    """Codes within the range, no two frames alike."""
    rng = random.Random(seed)
    most = form.code_max * 15 // 16
    return [
        LineFrame(
            codes=(i + 1, -rng.randrange(1, most), rng.randrange(-most, most), rng.randrange(-0x8000, 0x8000)),
            channel=CHANNELS[i % 4],
            status=SETTLED | (NEW if i % 3 else 0),
        )
        for i in range(n)
    ]


def _with(n: int, *odd: LineFrame) -> Callable[[Form], Frames]:
    """Good frames, and these among them, ten good ones after each."""

    def make(form: Form) -> Frames:
        found = _good(form, n)
        for i, f in enumerate(odd):
            found.insert(10 + 11 * i, f)
        return found

    return make


def _words(form: Form) -> Frames:
    """Codes that show a bit order, a width or a sign that is wrong, among others that are drawn."""
    high, low, half = form.code_max, -form.code_max - 1, form.word_bits // 2
    telling = (
        (1, -(1 << (form.word_bits - 1)), 2, 3),
        (-1, high, low, -1),
        (high // 7, -high // 7, 0x7F << half // 2, 0x7FFF),
        (-2, 1, 0, -0x8000),
    )
    odd = [LineFrame(codes=c, channel=i, status=SETTLED | NEW) for i, c in enumerate(telling)]
    return [*_good(form, 20), *odd, *_good(form, 20, seed=2)]


def _narrow(form: Form) -> Frames:
    return [LineFrame(codes=f.codes, channel=f.channel, narrow=True) for f in _good(form, 50)]


def _gaps(form: Form) -> Frames:
    found = _good(form, 60)
    for at in (10, 20, 21, 40, 41, 42, 43, 44):
        found[at] = NOTHING
    return found


NOTHING = LineFrame(codes=(0, 0, 0, 0), seen=False)


def _silence(form: Form) -> Frames:
    row = limits("HOST-STALE-01")
    short, long_ = (round(1000 * float(row.limit(name))) for name in ("silent_max_s", "told_after_s"))
    return [
        *_good(form, 20),
        *[NOTHING] * (short - 1),
        *_good(form, 20, seed=2),
        *[NOTHING] * long_,
        *_good(form, 20, seed=3),
    ]


def _frozen(form: Form) -> Frames:
    same = LineFrame(codes=(1000, -2000, 3000, 4000))
    stand = round(1500 * float(limits("HOST-STALE-02").limit("frozen_after_s")))
    return [*_good(form, 20), *[same] * stand, *_good(form, 20, seed=2)]


def _over(form: Form) -> Frames:
    found = _good(form, 10)
    for axis in range(3):
        for code in (form.code_max, -form.code_max - 1):
            codes = [5, -6, 7, 8]
            codes[axis] = code
            over = LineFrame(codes=(codes[0], codes[1], codes[2], codes[3]), status=SETTLED | CLIPPED)
            found += [over] * 3 + _good(form, 5, seed=axis + 2)
    return found


def _torn(**how: object) -> LineFrame:
    return LineFrame(codes=(77, -77, 777, 7), torn=True, **how)  # type: ignore[arg-type]


def _under_way(form: Form) -> Samples:
    """The second half of a frame, and the rest of its period."""
    whole = wave(LineFrame(codes=(99, 98, 97, 96)), form)
    return np.concatenate([whole[len(whole) // 2 :], idle(PERIOD - len(whole))])


def _at_pulses(how: str) -> Callable[[Form], Frames]:
    """Torn at the first and last pulses of CLK in words, and between."""

    def make(form: Form) -> Frames:
        bits = form.word_bits
        places = (0, 1, bits - 1, bits, 3 * bits + 4, WORDS * bits - 1)
        return _with(80, *(_torn(**{how: p}) for p in places))(form)

    return make


def _cut(form: Form) -> Frames:
    short = form.lead_clk + form.word_bits - 10
    return _with(60, _torn(mute=True), _torn(cut_clk=short), _torn(cut_clk=form.low_clk - 1))(form)


LINE_CASES: Mapping[str, LineCase] = {
    c.name: c
    for c in (
        LineCase("line_good", "a good board: signs, bit order, channels", frames=_words),
        LineCase("line_fast", "its clock is 100 ppm fast", frames=lambda form: _good(form, 1500), ppm=-100.0),
        LineCase("line_slow", "its clock is 100 ppm slow", frames=lambda form: _good(form, 1500), ppm=100.0),
        LineCase("line_narrow", "DATA is right only a quarter of a period about the rise of CLK", frames=_narrow),
        LineCase(
            "line_under_way", "listening begins in a frame", frames=lambda form: _good(form, 20), first=_under_way
        ),
        LineCase("line_missing", "a pulse of CLK is missing", frames=_at_pulses("skip")),
        LineCase("line_extra", "a pulse of CLK too many", frames=_at_pulses("twin")),
        LineCase(
            "line_pauses",
            "a pause of 3 or of 5 periods",
            frames=_with(80, *(_torn(pauses=p) for p in ((3, 4, 4), (4, 5, 4), (4, 4, 3), (5, 3, 4)))),
        ),
        LineCase("line_cut", "INT without a bit; frames cut off", frames=_cut),
        LineCase(
            "line_glitch",
            "pulses on INT that are no transfer",
            frames=_with(60, *(LineFrame(codes=(n, n, n, n), glitch_samples=n) for n in (1, 2, 8))),
        ),
        LineCase("line_lost", "1, 2 and 5 frames do not come", frames=_gaps),
        LineCase("line_silence", "no frame for 40 ms, then for half a second", frames=_silence),
        LineCase("line_stuck", "INT stays low for 0.6 s", frames=lambda form: _good(form, 700), stuck=(50, 650)),
        LineCase("line_frozen", "words stand still for 1.5 s", frames=_frozen),
        LineCase("line_over", "each axis at its limits", frames=_over),
        LineCase(
            "line_status",
            "words that have not settled; a conversion that was lost",
            frames=_with(60, *(LineFrame(codes=(5, 6, 7, 8), status=s) for s in (0, NEW, SETTLED | OVERRUN))),
        ),
    )
}
