"""What the lines of a recording say: frames, words, values, and which frames are wrong.

No decoder of its own: a frame of Int, Data and CLK is that of the line port (`link.lineport`), words of a PSD-1 and
strobes of a parallel bus are those that the conformance suite judges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
MOST_BITS = 1024  # of a frame whose words are written out
MOST_WORDS = 100_000  # of a PSD-1: a minute
PIECE = 500  # frames that are decoded between two looks at who waits
ZERO_LSB = 0x8000  # of a word of PSD-1: offset binary (docs/boards/psd1.md)

Look = Callable[[], None]


def _no_places() -> Ints:
    return np.empty(0, np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """n frames (of other boards words, or strobes of the bus) in order of time.

    wrong, torn: places of those that are wrong, and of them those that are not whole. missing: how many there should be
    before each. why, tags: by place, what is wrong with it, its words. samples: values of those that are whole, if any.
    """

    what: str  # a frame, a word
    lines: Sequence[str]  # that it is read from
    begin_ns: Ints
    end_ns: Ints
    wrong: Ints = field(default_factory=_no_places)
    torn: Ints = field(default_factory=_no_places)
    missing: Ints = field(default_factory=_no_places)
    why: Callable[[int], str] = lambda _: ""
    tags: Callable[[int], Sequence[Tag]] = lambda _: ()
    samples: Samples | None = None

    def __len__(self) -> int:
        return len(self.begin_ns)

    def between(self, begin_ns: int, end_ns: int) -> range:
        """Places of those that are seen in this time."""
        first = int(np.searchsorted(self.end_ns, begin_ns, "left"))
        return range(first, max(first, int(np.searchsorted(self.begin_ns, end_ns, "right"))))


def decode_lines(vcd: Vcd, look: Look) -> Decoded:
    """By the lines that there are. Nothing where no decoder knows them. Raises what `look` raises."""
    for lines, decode in ((FRAME, _frames_of), (PSD1, _psd1_words), (BUS, _strobes_of)):
        if all(line in vcd.wires for line in lines):
            return decode(vcd, look)
    return Decoded(what="frame", lines=(), begin_ns=_no_places(), end_ns=_no_places())


# ---- PSA-1, PSA-2, the unit that has one: a frame of four words


def _frames_of(vcd: Vcd, look: Look) -> Decoded:
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
    bits, torn = last - first, np.flatnonzero(~is_whole)
    missing, off_s = _timing_of(fall, fmt)

    def why(k: int) -> str:
        return _trouble_text(int(missing[k]), float(off_s[k])) if is_whole[k] else _tear_text(int(bits[k]), fmt.bits)

    def tags(k: int) -> Sequence[Tag]:
        if not 1 < bits[k] <= MOST_BITS:
            return ()
        begin, end = int(fall[k]), int(rise[k])
        return frame_words(vcd.part(FRAME, begin - 1, end), begin, end, fmt.word_bits)

    t_s = fall[is_whole] / NS
    samples = _values_of(t_s, whole.words.astype(np.int64), whole.signed(fmt.word_bits).astype(np.int64))
    return Decoded(
        what="frame",
        lines=FRAME,
        begin_ns=fall,
        end_ns=rise,
        wrong=np.flatnonzero(~is_whole | (missing > 0) | (off_s != 0.0)),
        torn=torn,
        missing=missing,
        why=why,
        tags=tags,
        samples=samples,
    )


def _format_of(fall: Ints, bits: Ints, unit_ns: int) -> LineFormat:
    """Length of words as most frames have it; nominal spacing of frames: that of most."""
    word_bits = max(WORD_BITS, key=lambda n: int(np.count_nonzero(bits == 4 * n)))
    period_s = float(np.median(np.diff(fall))) / NS if len(fall) > 2 else None
    tolerance_s = min(LineFormat().tolerance_s, (period_s or 1.0) / 4)
    return LineFormat(word_bits=word_bits, sample_hz=NS / unit_ns, period_s=period_s, tolerance_s=tolerance_s)


def _timing_of(fall_ns: Ints, fmt: LineFormat) -> tuple[Ints, Floats]:
    """Of each frame, how many are missing before it, and by how many s it is off its time; of the first: 0."""
    unit_ns = NS / fmt.sample_hz
    steps, off_s = fmt.timing(np.diff(fall_ns // round(unit_ns)))
    first = len(fall_ns[:1])
    return np.concatenate((np.zeros(first, np.int64), steps - 1)), np.concatenate((np.zeros(first), off_s))


def _trouble_text(missing: int, off_s: float) -> str:
    if missing:
        return f"{missing} missing before it"
    return f"{abs(off_s) * 1e6:.3f} us {'late' if off_s > 0 else 'early'}" if off_s else ""


def _tear_text(bits: int, due: int) -> str:
    return f"torn: {bits} bits, not {due}" if bits != due else "torn: pulses of CLK off their time"


def _values_of(t_s: Floats, words: Ints, signed: Ints) -> Samples:
    """Codes as they are sent, which no recording says the volts of; temperature of the channel that T names."""
    code = (words[:, 3] & 0xFFFF).astype(np.uint16).view(np.int16).astype(np.int64)
    frames = Frames.of(t_s, t_s, np.zeros((len(t_s), 3)), {"T": code, "CHANNEL": words[:, 3] >> 16 & 15})
    values = np.column_stack([signed[:, :3].astype(np.float64), frames.temp_degc])
    return Samples(t_s=t_s, values=values, names=("x", "y", "z", "t"), units=("LSB", "LSB", "LSB", "degC"))


# ---- PSD-1: words of three converters


def _psd1_words(vcd: Vcd, look: Look) -> Decoded:
    log = LineLog(recording=_first_words(vcd))
    words = psd1.words_of(log, 1 - int(vcd.wires["FL2"].level[0]))
    look()
    whole = [k for k, w in enumerate(words) if len(w.rises) == psd1.BITS]
    code = dict(zip(whole, psd1.serial_words(log, [words[k] for k in whole]).tolist(), strict=True))

    def why(k: int) -> str:
        if k not in code:
            return f"torn: {len(words[k].rises)} pulses of SCLK, not {psd1.BITS}"
        return "no FL2 after it" if words[k].fl2 < 0 else ""

    def tags(k: int) -> Sequence[Tag]:
        w = words[k]
        text = f"{'XYZ'[w.axis]} = {code[k] - ZERO_LSB} ({code[k]:04X}h)" if k in code else why(k)
        return [Tag("SDAT", w.fall, w.rise, text)]

    cycles = [k for k in code if words[k].axis == 0 and all(k + n in code and words[k + n].axis == n for n in (1, 2))]
    values = np.array([[code[k + n] - ZERO_LSB for n in range(3)] for k in cycles], np.float64).reshape(-1, 3)
    t_s = np.array([words[k + 2].rise for k in cycles], np.float64) / NS
    return Decoded(
        what="word",
        lines=PSD1,
        begin_ns=psd1.of(words, "fall"),
        end_ns=psd1.of(words, "rise"),
        wrong=np.array([k for k in range(len(words)) if why(k)], np.int64),
        torn=np.array([k for k in range(len(words)) if k not in code], np.int64),
        why=why,
        tags=tags,
        samples=Samples(t_s=t_s, values=values, names=("x", "y", "z"), units=("LSB",) * 3),
    )


def _first_words(vcd: Vcd) -> Vcd:
    """As far as there are MOST_WORDS."""
    lows = np.sort(np.concatenate([vcd.wires[line].edges_ns(0) for line in psd1.FRAMES]))
    return vcd if len(lows) <= MOST_WORDS else vcd.part(PSD1, vcd.start_ns, int(lows[MOST_WORDS]))


# ---- a parallel bus


def _strobes_of(vcd: Vcd, _: Look) -> Decoded:
    s = bus_cycles.strobes(LineLog(recording=vcd))

    def tags(k: int) -> Sequence[Tag]:
        text = f"{'W' if s.write[k] else 'R'}{s.address[k]:X} {s.data[k]:04X}h"
        return [Tag("CS", int(s.fall_ns[k]), int(s.rise_ns[k]), text)]

    return Decoded(what="strobe", lines=BUS, begin_ns=s.fall_ns, end_ns=s.rise_ns, tags=tags)
