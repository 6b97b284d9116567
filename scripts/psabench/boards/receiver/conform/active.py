"""The receiver asked over CAN."""

from __future__ import annotations

from psabench.boards.objects import ReceiverObjects as OD
from psabench.boards.receiver.conform.stimulus import STREAM_S, until_ready
from psabench.boards.receiver.device import MESSAGES
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.requirements import Requirement
from psabench.conform.stimulus.streamed import while_streaming
from psabench.conform.verdict import conclusive, expect, known

SOLUTIONS = (OD.COUNTERS, 12)
SIGNALS = ("LAT", "LON", "VE", "VN", "H", "VU")
TRIES = 20
ONE_SENT_S = 0.25  # the latest reading then is one that the log has


@active("RECEIVER-CAN-04", needs={"can"}, before=until_ready)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "receiver", varies=(OD.ACCURACY, OD.PORT))


@active("RECEIVER-CAN-05", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "RECEIVER-CAN-05", "RECEIVER")


@active("RECEIVER-OBJ-01", needs={"can"}, before=until_ready)
def objects_show_the_latest_reading(s: Dut) -> str:
    """Read TOW, the solution and TOW again while readings come, and find the reading in the log."""
    with s.take(lines=False) as take, while_streaming(s):
        s.run_for(ONE_SENT_S)
        shown = _shown_reading(s)
    e = s.capture("objects", take)
    tow, values = known(shown, "no look at 2200h lay within one reading")
    raw = {k: v for name in MESSAGES for k, v in e.frames_of(name).raw(name).items()}
    at = [k for k, n in enumerate(raw["TOW"]) if n == tow]
    conclusive(len(at) == 1, f"{len(at)} readings of TOW {tow} came")
    sent = [int(raw[name][at[0]]) for name in SIGNALS]
    return expect(values == sent, f"2200h {values}", f"reading of TOW {tow}: {sent}")


def _shown_reading(s: Dut) -> tuple[int, list[int]] | None:
    for _ in range(TRIES):
        tow = int(s.unit.node.read(OD.READING, 1))
        values = [int(s.unit.node.read(OD.SOLUTION, k)) for k in range(1, 7)]
        if int(s.unit.node.read(OD.READING, 1)) == tow:
            return tow, values
    return None


@active("RECEIVER-CNT-01", needs={"can"}, before=until_ready)
def readings_are_counted(s: Dut, row: Requirement) -> str:
    """Read 2030h sub 12 before and after two seconds, and count the readings between."""
    before = int(s.unit.node.read(*SOLUTIONS))
    with s.take(lines=False) as take, while_streaming(s):
        s.run_for(STREAM_S)
    came = len(s.capture("counted", take).frames_of(MESSAGES[0]))
    rose = int(s.unit.node.read(*SOLUTIONS)) - before
    return expect(abs(rose - came) <= row.limit("margin_count"), f"{rose} counted", f"{came} that came")
