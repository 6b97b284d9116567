"""One transfer on INT, DATA and CLK, whole or broken, as samples of the line port.

It is made bit by bit after the article's protocol of exchange, and not by an emulated board: no board sends a frame
with a pause of three periods. That the emulator's own lines look like this is tested beside it. How wide words are and
how fast CLK is depends on the profile (docs/boards/psa2.md, output frame).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray

from psabench.conform.profile import variant
from psabench.link.lineport import CLK, DATA, INT, PAUSE_CLK, WORDS

Samples = NDArray[np.uint8]

SAMPLE_HZ = 8_000_000
PERIOD = 8000  # samples from frame to frame: 1 ms
SETTLED, CLIPPED, OVERRUN, NEW = 1, 2, 4, 8  # of the status in word T
STATUS_BITS = 24  # a narrower word T has the temperature's code alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """Of a profile's transfers. clk_cycle: samples in a period of CLK."""

    word_bits: int
    code_bits: int
    lead_clk: int
    clk_cycle: Fraction

    @property
    def low_clk(self) -> int:
        """Periods of CLK that INT is low."""
        return self.lead_clk + WORDS * self.word_bits + (WORDS - 1) * PAUSE_CLK

    @property
    def code_max(self) -> int:
        """Positive limit of a code; the negative one is a step further."""
        return (1 << (self.code_bits - 1)) - 1

    @property
    def has_status(self) -> bool:
        """Whether word T tells channel and status."""
        return self.word_bits >= STATUS_BITS

    def samples(self, clk: int) -> int:
        """That so many periods of CLK take, begun ones included."""
        return int(-(-clk * self.clk_cycle // 1))


@cache
def form_of(profile: str) -> Form:
    """Raises BadInput for a profile that is none of a PSA-2."""
    v = variant("psa2", profile)
    return Form(
        word_bits=int(v["word_bits"]),
        code_bits=int(v["code_bits"]),
        lead_clk=int(v["lead_in_clk"]),
        clk_cycle=Fraction(SAMPLE_HZ * int(v["line_div"]), int(v["line_hz"])),
    )


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

    def words(self, form: Form) -> tuple[int, int, int, int]:
        """As they stand on the line."""
        x, y, z, t = self.codes
        mask = (1 << form.word_bits) - 1
        tail = self.channel << 16 | self.status << 20 if form.has_status else 0
        return x & mask, y & mask, z & mask, (t & 0xFFFF) | tail


def wave(f: LineFrame, form: Form) -> Samples:
    """INT low, from its fall to its rise, as samples."""
    cycles: list[tuple[int, bool]] = [(0, False)] * form.lead_clk  # level of DATA, whether CLK pulses
    for w, word in enumerate(f.words(form)):
        cycles += [(word >> i & 1, True) for i in range(form.word_bits)]
        cycles += [(0, False)] * (f.pauses[w] if w < WORDS - 1 else 0)
    pulses = [i for i, (_, pulse) in enumerate(cycles) if pulse]
    if f.skip is not None:
        cycles[pulses[f.skip]] = (cycles[pulses[f.skip]][0], False)
    if f.twin is not None:
        cycles.insert(pulses[f.twin], cycles[pulses[f.twin]])
    if f.mute:
        cycles = [(0, False)] * form.low_clk
    return _sampled(cycles[: f.cut_clk], form, f.narrow)


def _sampled(cycles: list[tuple[int, bool]], form: Form, narrow: bool) -> Samples:
    """Data and INT change with the fall of CLK, where a period begins; CLK rises in its middle."""
    quarter = np.arange(form.samples(len(cycles)), dtype=np.int64) * 4 * form.clk_cycle.denominator
    quarter //= form.clk_cycle.numerator
    level, pulse = np.array(cycles, dtype=np.int64)[quarter // 4].T
    phase = quarter % 4
    data: Samples = DATA * level.astype(np.uint8)
    if narrow:
        data[(pulse == 1) & ((phase == 0) | (phase == 3))] ^= DATA
    data[(pulse == 1) & (phase >= 2)] |= CLK
    return data


def idle(samples: int) -> Samples:
    """INT at rest."""
    return np.full(samples, INT, np.uint8)
