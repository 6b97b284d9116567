"""The inertial unit asked over CAN."""

from __future__ import annotations

from psabench.boards.bins.conform.stimulus import STREAM_S, until_ready
from psabench.boards.bins.device import MESSAGES, Bins
from psabench.boards.objects import BinsObjects as OD
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.requirements import Requirement
from psabench.conform.stimulus.streamed import while_streaming
from psabench.conform.verdict import conclusive, expect, known

INCREMENTS = (OD.COUNTERS, 12)
TRIES = 20


@active("BINS-CAN-04", needs={"can"}, before=until_ready)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "bins", varies=(OD.WEIGHTS, OD.TIMING))


@active("BINS-CAN-05", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "BINS-CAN-05", "BINS")


@active("BINS-INC-04", needs={"can"}, before=until_ready)
def timing_is_consistent(s: Dut, row: Requirement) -> str:
    """Read 2221h."""
    words, word_ns, delay_ns, age_ns = (int(s.unit.node.read(OD.TIMING, k)) for k in range(1, 5))
    due = f"{row.limit('period_us'):g} us in all, an age of 0 or {delay_ns - word_ns // 2} ns"
    whole = words * word_ns == row.limit("period_us") * 1000
    return expect(
        whole and age_ns in (0, delay_ns - word_ns // 2), f"{words} words of {word_ns} ns, age {age_ns} ns", due
    )


@active("BINS-OBJ-01", needs={"can"}, before=until_ready)
def objects_show_the_latest_reading(s: Dut) -> str:
    """Read the number, the increments and the number again while readings come, and find the reading in the log."""
    with s.take(lines=False) as take, while_streaming(s):
        shown = _shown_reading(s)
        s.run_for(0.05)
    e = s.capture("objects", take)
    seq, values = known(shown, "no look at 2200h lay within one reading")
    logs = [e.frames_of(name) for name in MESSAGES]
    raw = {k: v for log, name in zip(logs, MESSAGES, strict=True) for k, v in log.raw(name).items()}
    at = [k for k, n in enumerate(raw["SEQ"]) if n == seq]
    conclusive(len(at) == 1, f"{len(at)} readings {seq} came")
    sent = [int(raw[name][at[0]]) for name in ("GX", "GY", "GZ", "AX", "AY", "AZ")]
    return expect(values == sent, f"2200h {values}", f"reading {seq}: {sent}")


def _shown_reading(s: Dut) -> tuple[int, list[int]] | None:
    for _ in range(TRIES):
        seq = int(s.unit.node.read(OD.READING, 1))
        values = [int(s.unit.node.read(OD.INCREMENTS, k)) for k in range(1, 7)]
        if int(s.unit.node.read(OD.READING, 1)) == seq:
            return seq, values
    return None


@active("BINS-CNT-01", needs={"can"}, before=until_ready)
def readings_are_counted(s: Dut, row: Requirement) -> str:
    """Read 2030h sub 12 before and after a second, and count the readings between."""
    unit = known(s.unit if isinstance(s.unit, Bins) else None, "no inertial unit")
    before = int(unit.node.read(*INCREMENTS))
    with s.take(lines=False) as take, while_streaming(s):
        s.run_for(STREAM_S)
    came = len(s.capture("counted", take).frames_of(MESSAGES[0]))
    rose = int(unit.node.read(*INCREMENTS)) - before
    return expect(abs(rose - came) <= row.limit("margin_count"), f"{rose} counted", f"{came} that came")
