"""Words of PSA-2 and PSA-1 on the line and on DOut, beside the codes of the same samples on CAN."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psabench.boards.psa2.conform.capture_can import Pairs, aligned, pairs, signed
from psabench.boards.psa2.conform.capture_line import transfers
from psabench.boards.psa2.conform.check_serial import LEAST
from psabench.boards.psa2.conform.check_setup import port_traffic
from psabench.boards.psa2.conform.check_stream import LINES, whole_transfers, word_bits
from psabench.conform.capture.intervals import first_of
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive
from psabench.link.signals import Ints

# ---- words on the line beside CAN


def _words(e: Capture) -> Ints:
    """(n, 4) words of the line, sign-extended. Raises Failed for a transfer without all its bits."""
    return signed(whole_transfers(e).words(word_bits(e)), word_bits(e))


WORDS = {
    "PSA2-WORD-01": 0,
    "PSA2-WORD-02": 0,
    "PSA2-WORD-03": 8,
    "PSA2-WORD-04": -8,
}  # bits of a code that a word lacks


@dataclass(frozen=True, kw_only=True)
class Beside:
    """n frames on the line and the samples of the same frames on CAN."""

    line: Ints  # (n, 3) words X, Y, Z as 24-bit codes, or what is left of them
    words: Ints  # (n, 4) as sent
    fall_ns: Ints  # (n,) of Int
    samples: Pairs


def beside(e: Capture) -> Beside:
    """Both logs laid beside each other where most samples agree in an axis; the other axes are what is checked."""
    words, p = _words(e), pairs(e)
    row = row_for(e, *WORDS)
    lost = WORDS[row.id]
    line = words[:, :3] >> -lost if lost < 0 else words[:, :3]
    code = p.code >> lost if lost > 0 else p.code
    best = max((aligned(line[:, [k]], code[:, [j]]) for k in range(3) for j in range(3)), key=lambda r: r[1])
    shift, same = best
    if same < LEAST:
        saw, due = "no word of the line is a code on CAN", "codes, least significant bit first, word X first"
        raise Failed(saw, due, at_ns=int(e.wires.falls("Int")[0]), lines=LINES, frames=p.about(0))
    i = np.arange(len(p)) + shift
    keep = (i >= 0) & (i < len(words))
    conclusive(keep.sum() >= LEAST, "the recording and the log have few samples in common")
    at = i[keep]
    return Beside(
        line=line[at] << max(lost, 0), words=words[at], fall_ns=transfers(e.wires).fall_ns[at], samples=p.where(keep)
    )


def _codes_due(e: Capture, p: Pairs) -> Ints:
    """(n, 3) the codes of CAN with the bits that a word has."""
    lost = WORDS[row_for(e, *WORDS).id]
    return p.code >> lost << lost if lost > 0 else p.code


def _same(saw: Ints, due: Ints, p: Pairs, what: str) -> str:
    """Raises Failed for the first row that differs."""
    bad = saw != due
    bad = bad.any(axis=1) if bad.ndim > 1 else bad
    if (k := first_of(bad)) is not None:
        words = f"{saw[k]} on the line ({int(bad.sum())} of {len(bad)})"
        raise Failed(words, f"{due[k]}, {what} on CAN", frames=p.about(k))
    return f"{len(bad)} frames, {what} as on CAN"


@check("stream", "PSA2-FRAME-03", needs={"line"})
def words_come_least_significant_bit_first(e: Capture) -> str:
    """Read the words either way round: which way do they hold the codes of CAN?"""
    t, p = transfers(e.wires.unbroken()), pairs(e)
    bits = word_bits(e)
    t = t.of(4 * bits)
    conclusive(len(t) >= LEAST or not len(e.wires.gaps_ns), f"{len(t)} frames between two losses of samples")
    if len(t) < LEAST:
        raise Failed(f"{len(t)} transfers of {4 * bits} bits", "all", at_ns=int(e.wires.falls("Int")[0]), lines=LINES)
    lost = WORDS[row_for(e, *WORDS).id]
    code = (p.code >> lost if lost >= 0 else p.code) & 0xFFFF
    count = {}
    for name, lsb_first in (("least", True), ("most", False)):
        words = t.words(bits, lsb_first=lsb_first) >> (-lost if lost < 0 else 0) & 0xFFFF
        count[name] = max(aligned(words[:, [k]], code[:, [j]])[1] for k in range(4) for j in range(3))
    if count["least"] < min(len(t), len(p)) // 2:
        saw = f"{count['most']} words read most significant bit first are codes, {count['least']} the other way"
        raise Failed(saw, f"{len(p)}, least significant bit first", at_ns=int(t.fall_ns[0]), lines=LINES)
    return f"{count['least']} words are codes, read so; {count['most']} the other way round"


@check("stream", "PSA2-WORD-01", "PSA2-WORD-02", "PSA2-WORD-03", "PSA2-WORD-04", needs={"line"})
def words_are_the_codes(e: Capture) -> str:
    """Compare the words X, Y and Z of each frame with the codes of the same frame on CAN."""
    b = beside(e)
    due = _codes_due(e, b.samples)
    return _same(np.sort(b.line, axis=1), np.sort(due, axis=1), b.samples, "codes")


@check("stream", "PSA2-FRAME-04", needs={"line"})
def the_first_word_is_that_of_the_lowest_address(e: Capture) -> str:
    """Compare the first word with the code of X on CAN."""
    b = beside(e)
    return _same(b.line[:, 0], _codes_due(e, b.samples)[:, 0], b.samples, "X first")


@check("stream", "PSA2-FRAME-05", needs={"line"})
def words_are_in_their_order(e: Capture) -> str:
    """Compare the order of the words with X, Y, Z and T on CAN."""
    b = beside(e)
    mask = (1 << int(row_for(e, "PSA2-WORD-05").limit("code_bits"))) - 1
    saw = np.column_stack((b.line, b.words[:, 3] & mask))
    due = np.column_stack((_codes_due(e, b.samples), b.samples.temp & mask))
    return _same(saw, due, b.samples, "X, Y, Z, T in this order")


@check("stream", "PSA2-CAN-07", needs={"line"})
def can_and_line_carry_the_same(e: Capture) -> str:
    """Compare all that a frame carries on the line with its pair on CAN."""
    b = beside(e)
    mask = (1 << int(row_for(e, "PSA2-WORD-05").limit("code_bits"))) - 1
    _same(b.line, b.samples.code, b.samples, "codes")
    return _same(b.words[:, 3] & mask, b.samples.temp & mask, b.samples, "codes and T")


@check("stream", "PSA2-WORD-05", "PSA2-WORD-08", needs={"line"})
def word_t_has_the_temperature_code(e: Capture) -> str:
    """Compare the lower bits of word T with T on CAN."""
    b = beside(e)
    mask = (1 << int(row_for(e, "PSA2-WORD-05").limit("code_bits"))) - 1
    return _same(b.words[:, 3] & mask, b.samples.temp & mask, b.samples, "T")


def channel_on_the_line(e: Capture, b: Beside) -> Ints:
    """(n,) the channel that word T has."""
    row = row_for(e, "PSA2-WORD-06")
    return b.words[:, 3] >> int(row.limit("channel_shift_bits")) & ((1 << int(row.limit("channel_bits"))) - 1)


@check("stream", "PSA2-WORD-06", needs={"line"})
def word_t_has_the_channel(e: Capture) -> str:
    """Compare bits 19 to 16 of word T with CHANNEL on CAN."""
    b = beside(e)
    return _same(channel_on_the_line(e, b), b.samples.channel, b.samples, "CHANNEL")


@check("stream", "PSA2-WORD-07", needs={"line"})
def word_t_has_the_status(e: Capture, row: Requirement) -> str:
    """Compare bits 23 to 20 of word T with the status bits on CAN."""
    b = beside(e)
    p = b.samples
    due = sum(
        int(row.limit(f"{n}_bit")) * v
        for n, v in (("settled", p.settled), ("clip", p.clip), ("overrun", p.overrun), ("new", p.new))
    )
    saw = b.words[:, 3] >> int(row.limit("status_shift_bits")) & 0xF
    return _same(saw, np.asarray(due, np.int64), p, "status")


# ---- the words that were read


def _read_words(e: Capture) -> Ints:
    """(n, 3) upper 24 bits of what DOutX, DOutY and DOutZ had at each read."""
    reads = [b for b in port_traffic(e).reads if b.bits >= 24]
    conclusive(len(reads) >= LEAST, f"{len(reads)} reads were recorded")
    return signed(np.array([[int(w[:24], 2) for w in b.got] for b in reads], np.int64), 24)


@check("stream", "PSA2-READ-04", needs={"pins"})
def three_axes_are_read_at_once(e: Capture, row: Requirement) -> str:
    """Decode DOutX, DOutY and DOutZ by the same pulses of SClk, beside the codes on CAN."""
    read, p = _read_words(e), pairs(e)
    shift, same = aligned(read, p.code)
    if same < len(p) - int(row.limit("edge_max_frames")):
        i = np.arange(len(p)) + shift
        at = np.flatnonzero([not (0 <= k < len(read)) or (read[k] != c).any() for k, c in zip(i, p.code, strict=True)])
        raise Failed(
            f"{len(p) - same} of {len(p)} samples on CAN were not read so",
            "the words of one burst of SClk",
            frames=p.about(int(at[0]) if len(at) else 0),
            lines=("SClk", "DOutX", "DOutY", "DOutZ"),
        )
    return f"{same} samples of {len(p)} as they were read"


@check("stream", "PSA2-READ-05", needs={"pins"})
def a_frame_has_the_codes_of_the_read_before_it(e: Capture) -> str:
    """Compare the words of each frame with the read that ended before Int fell."""
    words, t = _words(e), transfers(e.wires)
    read = _read_words(e)
    ends = np.array([b.rise_ns[-1] for b in port_traffic(e).reads if b.bits >= 24], np.int64)
    k = np.searchsorted(ends, t.fall_ns) - 1
    for n, at in enumerate(k):
        if at >= 0 and (words[n, :3] != read[at]).any():
            saw, due = f"{words[n, :3]} sent", f"{read[at]}, as read before"
            raise Failed(saw, due, at_ns=int(t.fall_ns[n]), lines=("DRD_A", "SClk", "DOutX", *LINES))
    return f"{int((k >= 0).sum())} frames of the codes that were read before them"
