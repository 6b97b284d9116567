"""The gyro unit asked over CAN: modes, turns, rejections, what never settles."""

from __future__ import annotations

from psabench.boards.gyro.conform.capture_readings import EMCY, columns
from psabench.boards.gyro.conform.stimulus import RUN_LIMIT_S, calm, level_unit, levelled, unit, until_mode
from psabench.boards.gyro.device import Mode, Phase
from psabench.boards.objects import GyroObjects as OD
from psabench.conform.bus_host import refused
from psabench.conform.capture.messages import emergencies
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.requirements import Requirement
from psabench.conform.stimulus.streamed import while_streaming
from psabench.conform.verdict import Failed, expect

FRAMES = (OD.COUNTERS, 14)  # level frames taken


@active("GYRO-MODE-09", needs={"can"}, after=calm)
def modes_that_cannot_be_are_refused(s: Dut, row: Requirement) -> str:
    """Ask for a mode just after Res and look for the reason."""
    code = row.limit("abort_code")
    s.reset()
    s.run_for(0.01)
    refused(lambda: s.unit.node.write(OD.CONTROL, 1, int(Mode.LEVEL)), code, "mode 1 just after Res")
    reason = s.unit.refusal()
    expect(reason, "no reason in 2031h", "one in words")
    calm(s)
    s.unit.node.write(OD.CONTROL, 1, int(Mode.LEVEL))
    return f"refused; said {reason}"


@active("GYRO-MODE-10", needs={"can"}, after=calm)
def a_run_s_settings_stand_while_it_runs(s: Dut, row: Requirement) -> str:
    """Write 2102h and 2103h in a run."""
    code = row.limit("abort_code")
    levelled(s)
    unit(s).mode = Mode.GYROCOMPASS
    s.run_for(1.0)
    refused(lambda: s.unit.node.write(OD.POSITIONS, 1, 5.0), code, "2103h sub 1 in a run")
    refused(lambda: s.unit.node.write(OD.RUN, 1, 2), code, "2102h sub 1 in a run")
    calm(s)
    s.unit.node.write(OD.POSITIONS, 1, 5.0)
    return "both refused"


@active("GYRO-ERR-02", needs={"can"})
def what_does_not_settle_is_told(s: Dut, row: Requirement) -> str:
    """Allow a fiftieth of an arc minute and a second, and let a run begin."""
    code = int(row.limit("emcy_code"))
    levelled(s)
    unit(s).set(tolerance_arcmin=0.02, settle_s=0.0, settle_limit_s=1.0, latitude_deg=-60.0)
    with s.take(lines=False) as take, while_streaming(s):
        unit(s).mode = Mode.GYROCOMPASS
        until_mode(s, Mode.HOLD, RUN_LIMIT_S)
        s.run_for(0.1)
    e = s.capture("unsettled", take)
    c = columns(e)
    calm(s)
    if (c["PHASE"] == Phase.WINDOW).any() or c["MODE"][-1] != Mode.HOLD or c["NOT_SETTLED"][-1] != 1:
        raise Failed(
            f"mode {c['MODE'][-1]:g}, NOT_SETTLED {c['NOT_SETTLED'][-1]:g}", "no window, mode 2, NOT_SETTLED 1"
        )
    if code not in [k for k, _ in emergencies(e, EMCY)]:
        raise Failed(f"emergencies {[f'{k:04X}h' for k, _ in emergencies(e, EMCY)]}", f"{code:04X}h")
    return "no window, mode 2, NOT_SETTLED, FF23h"


@active("GYRO-LEV-05", needs={"can"}, before=calm)
def frames_of_others_are_not_taken(s: Dut) -> str:
    """Send frames of another node's PSA-2 while the level unit is silent."""
    level_unit(s, False)
    node = int(s.unit.node.read(OD.LEVEL, 1))
    before = int(s.unit.node.read(*FRAMES))
    for k in range(20):
        s.host.send(0x180 + (node % 126 + 1 if node % 126 + 1 != s.node else node + 2), bytes([k] * 8))
    s.run_for(0.05)
    taken = int(s.unit.node.read(*FRAMES)) - before
    calm(s)
    expect(not taken, f"{taken} frames of another node taken", "none")
    return "none of 20 frames taken"


@active("GYRO-CAN-05", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "GYRO-CAN-05", "GYRO")


@active("GYRO-CAN-04", needs={"can"}, before=calm)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "gyro")
