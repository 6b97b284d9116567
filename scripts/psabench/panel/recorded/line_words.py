"""What the lines of a recording say: frames, words, values, and which frames are wrong.

No decoder of its own: a frame of Int, Data and CLK is that of the line port (`link.lineport`), words of a PSD-1 and
strobes of a parallel bus are those that the conformance suite judges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from psabench.boards.board import PARALLEL_BUS
from psabench.boards.psa2.frames import Frames
from psabench.boards.psd1.conform import capture_cycles as psd1
from psabench.conform.capture import bus_cycles
from psabench.conform.capture.log import LineLog
from psabench.link.lineport import LineDecoder, LineFormat, concat
from psabench.link.signals import Floats, Ints
from psabench.link.vcd import Vcd
from psabench.panel.channels import Samples
from psabench.report.drawing import Tag
from psabench.report.waveform import frame_words

FRAME, PSD1, BUS = ("Int", "Data", "CLK"), psd1.LINES, PARALLEL_BUS
NS = 1_000_000_000
WORD_BITS = (32, 24, 16)
PIECE = 500  # frames that are decoded between two looks at who waits
ZERO_LSB = 0x8000  # of a word of PSD-1: offset binary (docs/boards/psd1.md)

Look = Callable[[], None]
Tags = Callable[[int], Sequence[Tag]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """n frames (of other boards words, or strobes of the bus) in order of time.

    wrong: by place what is wrong with it. tags: its words, by place. samples: values of those that are whole, if any.
    """

    what: str  # a frame, a word
    lines: Sequence[str]  # that it is read from
    begin_ns: Ints
    end_ns: Ints
    wrong: Mapping[int, str] = field(default_factory=dict)
    torn: Sequence[int] = ()  # those of `wrong` that are not whole
    missing: Mapping[int, int] = field(default_factory=dict)  # how many there should be before it
    tags: Tags = lambda _: ()
    samples: Samples | None = None

    def __len__(self) -> int:
        return len(self.begin_ns)

    def between(self, begin_ns: int, end_ns: int) -> range:
        """Places of those that are seen in this time."""
        first = int(np.searchsorted(self.end_ns, begin_ns, "left"))
        return range(first, max(first, int(np.searchsorted(self.begin_ns, end_ns, "right"))))


def decoded(vcd: Vcd, look: Look) -> Decoded:
    """By the lines that there are. Nothing where no decoder knows them. Raises what `look` raises."""
    for lines, decode in ((FRAME, _frames), (PSD1, _psd1_words), (BUS, _strobes)):
        if all(line in vcd.wires for line in lines):
            return decode(vcd, look)
    none = np.empty(0, np.int64)
    return Decoded(what="frame", lines=(), begin_ns=none, end_ns=none)


# ---- PSA-1, PSA-2, the unit that has one: a frame of four words


def _frames(vcd: Vcd, look: Look) -> Decoded:
    log = LineLog(recording=vcd)
    fall, rise = log.pulses("Int", 0)
    clk = log.rises("CLK")
    bit = vcd.wires["Data"].at(clk).astype(bool)
    first, last = np.searchsorted(clk, fall), np.searchsorted(clk, rise)
    fmt = _format_of(fall, last - first, vcd.unit_ns)
    decoder, parts = LineDecoder(fmt), []
    for k in range(0, len(fall), PIECE):
        mine = slice(k, k + PIECE)
        clocks = slice(int(first[k]), int(last[mine][-1]))
        begin, end, at = (t // vcd.unit_ns for t in (fall[mine], rise[mine], clk[clocks]))
        parts.append(decoder.feed_edges(begin, end, at, bit[clocks]))
        look()
    whole = concat(parts)
    is_whole = np.isin(fall // vcd.unit_ns, whole.fall)
    torn = np.flatnonzero(~is_whole).tolist()
    missing, off_time = _off_time(fall // vcd.unit_ns, fmt)
    wrong = off_time | {k: _tear(int(last[k] - first[k]), fmt.bits) for k in torn}

    def tags(k: int) -> Sequence[Tag]:
        begin, end = int(fall[k]), int(rise[k])
        rises = last[k] - first[k]
        return frame_words(vcd.part(FRAME, begin - 1, end), begin, end, fmt.word_bits) if rises > 1 else ()

    t_s = fall[is_whole] / NS
    samples = _values(t_s, whole.words.astype(np.int64), whole.signed(fmt.word_bits).astype(np.int64))
    return Decoded(
        what="frame",
        lines=FRAME,
        begin_ns=fall,
        end_ns=rise,
        wrong=dict(sorted(wrong.items())),
        torn=torn,
        missing=missing,
        tags=tags,
        samples=samples,
    )


def _format_of(fall: Ints, bits: Ints, unit_ns: int) -> LineFormat:
    """Length of words as most frames have it; nominal spacing of frames: that of most."""
    word_bits = max(WORD_BITS, key=lambda n: int(np.count_nonzero(bits == 4 * n)))
    period_s = float(np.median(np.diff(fall))) / NS if len(fall) > 2 else None
    tolerance_s = min(LineFormat().tolerance_s, (period_s or 1.0) / 4)
    return LineFormat(word_bits=word_bits, sample_hz=NS / unit_ns, period_s=period_s, tolerance_s=tolerance_s)


def _off_time(fall: Ints, fmt: LineFormat) -> tuple[dict[int, int], dict[int, str]]:
    """By place: how many frames are missing before it; what is wrong with when it comes."""
    steps, off_s = fmt.timing(np.diff(fall))
    missing = {int(k) + 1: int(steps[k]) - 1 for k in np.flatnonzero(steps > 1)}
    words = {k: f"{n} missing before it" for k, n in missing.items()}
    for k in np.flatnonzero(off_s).tolist():
        words.setdefault(k + 1, f"{abs(off_s[k]) * 1e6:.3f} us {'late' if off_s[k] > 0 else 'early'}")
    return missing, words


def _tear(bits: int, due: int) -> str:
    return f"torn: {bits} bits, not {due}" if bits != due else "torn: pulses of CLK out of their time"


def _values(t_s: Floats, words: Ints, signed: Ints) -> Samples:
    """Codes as they are sent, which no recording says the volts of; temperature of the channel that T names."""
    code = (words[:, 3] & 0xFFFF).astype(np.uint16).view(np.int16).astype(np.int64)
    frames = Frames.of(t_s, t_s, np.zeros((len(t_s), 3)), {"T": code, "CHANNEL": words[:, 3] >> 16 & 15})
    values = np.column_stack([signed[:, :3].astype(np.float64), frames.temp_degc])
    return Samples(t_s=t_s, values=values, names=("x", "y", "z", "t"), units=("LSB", "LSB", "LSB", "degC"))


# ---- PSD-1: words of three converters


def _psd1_words(vcd: Vcd, look: Look) -> Decoded:
    log = LineLog(recording=vcd)
    words = psd1.words_of(log, 1 - int(vcd.wires["FL2"].level[0]))
    look()
    whole = [k for k, w in enumerate(words) if len(w.rises) == psd1.BITS]
    code = dict(zip(whole, psd1.serial_words(log, [words[k] for k in whole]).tolist(), strict=True))
    torn = {k: f"torn: {len(w.rises)} pulses of SCLK, not {psd1.BITS}" for k, w in enumerate(words) if k not in code}
    unread = {k: "no FL2 after it" for k, w in enumerate(words) if w.fl2 < 0 and k not in torn}

    def tags(k: int) -> Sequence[Tag]:
        w = words[k]
        text = f"{'XYZ'[w.axis]} = {code[k] - ZERO_LSB} ({code[k]:04X}h)" if k in code else torn[k]
        return [Tag("SDAT", w.fall, w.rise, text)]

    cycles = [k for k in code if words[k].axis == 0 and all(k + n in code and words[k + n].axis == n for n in (1, 2))]
    values = np.array([[code[k + n] - ZERO_LSB for n in range(3)] for k in cycles], np.float64).reshape(-1, 3)
    t_s = np.array([words[k + 2].rise for k in cycles], np.float64) / NS
    return Decoded(
        what="word",
        lines=PSD1,
        begin_ns=psd1.of(words, "fall"),
        end_ns=psd1.of(words, "rise"),
        wrong=dict(sorted((torn | unread).items())),
        torn=list(torn),
        tags=tags,
        samples=Samples(t_s=t_s, values=values, names=("x", "y", "z"), units=("LSB",) * 3),
    )


# ---- a parallel bus


def _strobes(vcd: Vcd, _: Look) -> Decoded:
    s = bus_cycles.strobes(LineLog(recording=vcd))

    def tags(k: int) -> Sequence[Tag]:
        text = f"{'W' if s.write[k] else 'R'}{s.address[k]:X} {s.data[k]:04X}h"
        return [Tag("CS", int(s.fall_ns[k]), int(s.rise_ns[k]), text)]

    return Decoded(what="strobe", lines=BUS, begin_ns=s.fall_ns, end_ns=s.rise_ns, tags=tags)
