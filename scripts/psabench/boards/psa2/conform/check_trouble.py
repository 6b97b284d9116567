"""What PSA-2 and PSA-1 reject for want of room on the bus, and what they tell of trouble."""

from __future__ import annotations

from psabench.boards.psa2.conform.capture_can import pairs, segment
from psabench.boards.psa2.conform.check_setup import ACCEL as ACCEL_LINES
from psabench.boards.psa2.conform.check_setup import port_traffic
from psabench.boards.psa2.conform.check_stream import number
from psabench.boards.psa2.conform.stimulus_can import FORM, TIMEOUTS, Answer
from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import CanFrame, Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.link.protocol_files import message

# ---- what does not fit the bus


@check("fit", "PSA2-FIT-01")
def a_form_that_does_not_fit_is_refused(e: Capture, row: Requirement) -> str:
    """Ask for pairs at 4000 a second."""
    expect(fact(e, "fast") == Answer(), f"4000 SPS in form 1 answered by {fact(e, 'fast').abort:08X}h", "it is taken")
    due = int(row.limit("abort_code"))
    if fact(e, "form").abort != due:
        raise Failed(f"form 0 at 4000 SPS answered by {fact(e, 'form').abort:08X}h", f"abort {due:08X}h")
    if number(fact(e, "form read")) != 1:
        raise Failed(f"{FORM:04X}h {number(fact(e, 'form read'))} after a refusal", "1, as before")
    _emcy(segment(e, "form", "form end"), int(row.limit("emcy_code")))
    text = fact(e, "form text").value
    if not isinstance(text, str) or not text:
        raise Failed("2031h is empty", "why the form was refused")
    return f"abort {due:08X}h, EMCY; said {text}"


@check("fit", "PSA2-FIT-02")
def a_rate_that_does_not_fit_is_refused(e: Capture, row: Requirement) -> str:
    """Ask for 4000 SPS in pairs, and read CONFIG0."""
    due = int(row.limit("abort_code"))
    expect(fact(e, "rate").abort == due, f"CONFIG0 = 66h answered by {fact(e, 'rate').abort:08X}h", f"abort {due:08X}h")
    before = int(row_for(e, "PSA2-REG-01").limit("config0_code"))
    if number(fact(e, "config0")) != before:
        raise Failed(f"CONFIG0 {number(fact(e, 'config0')):02X}h after a refusal", f"{before:02X}h")
    return f"abort {due:08X}h, CONFIG0 still {before:02X}h"


@check("fit", "PSA2-FIT-02", needs={"pins"})
def a_refused_rate_never_reaches_the_converters(e: Capture) -> str:
    """Count the writes of CONFIG0 on DIn: the one in form 1 that was taken."""
    n = sum(m.sent[:1] == b"\x41" for m in port_traffic(e).of(temp=False))
    expect(n == 1, f"{n} writes of CONFIG0 on DIn", "one, in form 1", at_ns=e.wires.start_ns, lines=ACCEL_LINES)
    return "one write of CONFIG0 on DIn, that in form 1"


@check("fit", "PSA2-FIT-04")
def worst_case_times_are_those_of_the_table(e: Capture, row: Requirement) -> str:
    """Read 2031h after a rejection."""
    due = f"{row.limit('pair_us'):.3f} us"
    for name in ("rate text", "form text"):
        text = fact(e, name).value
        if not isinstance(text, str) or due not in text:
            raise Failed(f"2031h; said {text!r}", f"{due} for the pair")
    return f"2031h; said {fact(e, 'rate text').value}"


# ---- trouble


def emcys(e: Capture) -> list[CanFrame]:
    """Emergencies of the board."""
    return [f for f in e.can.of_id(0x80 + e.node).frames if len(f.data) == int(message("EMCY").length)]


def _emcy(e: Capture, code: int) -> CanFrame:
    """The one of this code. Raises Failed for none and for several."""
    found = [f for f in emcys(e) if int.from_bytes(f.data[:2], "little") == code]
    expect(len(found) == 1, f"{len(found)} EMCY {code:04X}h", "one", frames=emcys(e))
    return found[0]


@check("trouble", "PSA2-ERR-02")
def a_silent_temperature_converter_is_told(e: Capture, row: Requirement) -> str:
    """Silence it by its SYNC command without WAKEUP: EMCY once, and its end."""
    expect(fact(e, "opcode") == Answer(), f"SYNC FCh answered by {fact(e, 'opcode').abort:08X}h", "it is taken")
    e = segment(e, "silent", "silent end")
    told = _emcy(e, int(row.limit("emcy_code")))
    if told.data[3] != int(row.limit("source_code")):
        raise Failed(f"source {told.data[3]}", f"{int(row.limit('source_code'))}", frames=[told])
    later = [f for f in emcys(e) if f.data[:2] == b"\0\0" and e.can.frames.index(f) > e.can.frames.index(told)]
    expect(len(later) == 1, f"{len(later)} EMCY 0000h after it", "one, with the next temperature", frames=emcys(e))
    return f"EMCY {int(row.limit('emcy_code')):04X}h, then 0000h"


@check("trouble", "PSA2-ERR-03")
def axes_go_on_without_temperatures(e: Capture, row: Requirement) -> str:
    """SEQ and T_NEW while the temperature converter is silent."""
    p = pairs(segment(e, "stream", "silent end"))
    p.unbroken()
    at = p.new.nonzero()[0]
    conclusive(len(at), "no new temperature came")
    pause = max(at[1:] - at[:-1]) if len(at) > 1 else len(p) - at[0]
    if pause < row.limit("silent_min_frames"):
        raise Failed(f"T_NEW pauses for {pause} frames at most", "the converter is silent", frames=p.about(int(at[-1])))
    return f"{len(p)} frames without a gap, {pause} of them without a temperature"


@check("trouble", "BUS-EMCY-04", boards=("psa2",))
def the_history_has_the_latest_first(e: Capture) -> str:
    """Compare 1003h with the emergencies of different codes that came."""
    due = [f.data[:2] for f in reversed(emcys(e)) if f.data[:2] != b"\0\0"]
    if due == due[::-1]:
        raise Inconclusive(f"{len(due)} emergencies that read the same backwards; expected others")
    for n, (answer, code) in enumerate(zip(fact(e, "history"), due, strict=False), 1):
        saw = number(answer).to_bytes(4, "little")[:2]
        if saw != code:
            raise Failed(f"1003h:{n} has {saw[::-1].hex().upper()}h", f"{code[::-1].hex().upper()}h", frames=emcys(e))
    return f"{', '.join(f'{c[::-1].hex().upper()}h' for c in due)}, as they came"


@check("trouble", "PSA2-CNT-03")
def time_outs_are_counted(e: Capture) -> str:
    """2030h:9 before and after."""
    n = number(fact(e, "after")[TIMEOUTS]) - number(fact(e, "before")[TIMEOUTS])
    told = sum(f.data[:2] in (b"\x01\xff", b"\x02\xff") for f in emcys(e))
    expect(n >= 1 and n >= told, f"{n} time-outs counted, {told} told by EMCY", "one at least, and as many")
    return f"{n} counted"


@check("trouble", "PSA2-ACC-06")
def an_access_without_data_ready_is_aborted(e: Capture, row: Requirement) -> str:
    """Read a register of the silent temperature converter."""
    due, answer = int(row.limit("abort_code")), fact(e, "access")
    expect(answer.abort == due, f"answered by {answer.abort:08X}h {answer.value}", f"abort {due:08X}h")
    return f"abort {due:08X}h"
