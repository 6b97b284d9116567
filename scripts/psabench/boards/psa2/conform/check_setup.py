"""Set-up of PSA-2 and PSA-1 after Res: messages, their order, the events that they wait for, their times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psabench.boards.psa2.conform.capture_line import transfers
from psabench.boards.psa2.conform.capture_spi import Traffic, traffic
from psabench.conform.capture.intervals import none_at
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.signals import Ints

ACCEL = ("Res", "SClk", "DIn", "DRD_A", "SYNC_A", "CST")
TEMP = ("Res", "SClk", "DInT", "CST", "DRD_T", "SYNC_T")
DATA_READY = {"DIn": "DRD_A", "SYNC_A": "DRD_A", "DInT": "DRD_T", "SYNC_T": "DRD_T"}
SET_UP = (  # in the article's order; rows that do not hold for the profile are left out
    "PSA2-SETUP-02",
    "PSA2-SETUP-03",
    "PSA2-SETUP-04",
    "PSA2-SETUP-05",
    "PSA2-SETUP-06",
)
MS = 1e6  # ns


@dataclass(frozen=True, slots=True)
class Step:
    """What the controller did: a message or a pulse on a line."""

    begin_ns: int
    end_ns: int
    line: str  # "DIn", "DInT", "SYNC_A" or "SYNC_T"
    sent: bytes = b""

    @property
    def name(self) -> str:
        return f"{self.sent.hex(' ').upper()} on {self.line}" if self.sent else f"a pulse on {self.line}"


@dataclass(frozen=True, slots=True)
class SetUp:
    """From the end of Res on."""

    res_ns: int  # rise of Res
    steps: tuple[Step, ...]  # all that was done from then on, in order
    drd_a: Ints  # falls from then on
    drd_t: Ints

    def until_sync_a(self) -> tuple[Step, ...]:
        """The article's part: up to the first pulse on SYNC_A, it included."""
        for k, s in enumerate(self.steps):
            if s.line == "SYNC_A":
                return self.steps[: k + 1]
        raise Failed("no pulse on SYNC_A after Res", "one that ends the set-up", at_ns=self.res_ns, lines=ACCEL)

    def ready(self, step: Step) -> Ints:
        """Falls of the data-ready line that a step waits for."""
        return self.drd_a if DATA_READY[step.line] == "DRD_A" else self.drd_t

    def nth(self, line: str, n: int) -> Step:
        """The n-th thing done on a line after Res. Raises Failed where there are fewer."""
        found = [s for s in self.steps if s.line == line]
        expect(len(found) > n, f"{len(found)} on {line} after Res", f"{n + 1}", at_ns=self.res_ns, lines=ACCEL + TEMP)
        return found[n]


def port_traffic(e: Capture) -> Traffic:
    """Both serial ports. Raises Inconclusive."""
    return traffic(e.wires, row_for(e, "PSA2-SIG-09").limit("sclk_hz"))


def set_up(e: Capture) -> SetUp:
    """After the last pulse on Res that the recording has whole. Raises Inconclusive where there is none."""
    t = port_traffic(e)
    ends = e.wires.pulses("Res", 0)[1]
    conclusive(len(ends), "the recording has no pulse on Res")
    res_ns = int(ends[-1])
    steps = [Step(m.begin_ns, m.end_ns, "DInT" if m.temp else "DIn", m.sent) for m in t.messages]
    for line, active in (("SYNC_A", 1), ("SYNC_T", 0)):
        steps += [Step(int(a), int(b), line) for a, b in zip(*e.wires.pulses(line, active), strict=True)]
    later = sorted((s for s in steps if s.begin_ns > res_ns), key=lambda s: s.begin_ns)
    falls = {name: e.wires.falls(name) for name in ("DRD_A", "DRD_T")}
    return SetUp(res_ns, tuple(later), *(f[f > res_ns] for f in falls.values()))


def sent_by(row: Requirement) -> bytes:
    """The bytes of a message that a row demands."""
    return bytes(int(row.limit(f"byte_{k}")) for k in range(3))


def demanded(e: Capture) -> list[tuple[str, bytes]]:
    """Line and bytes of each step of the article's set-up in this profile; b"": a pulse."""
    rows = [requirements().rows[i] for i in SET_UP]
    here = [r for r in rows if r.applies(e.variant.board, e.variant.profile)]
    found = [("DIn" if r.id == SET_UP[0] else "DInT", sent_by(r)) for r in here]
    return [*found, ("SYNC_T", b""), ("SYNC_A", b"")]


def _is(step: Step, row: Requirement, what: str) -> str:
    due = sent_by(row).hex(" ").upper()
    expect(step.sent == sent_by(row), step.name, f"{due} as {what}", at_ns=step.begin_ns, lines=ACCEL + TEMP)
    return f"{due} {step.begin_ns * 1e-6:.3f} ms"


def _after(s: SetUp, step: Step, before: Step | None) -> None:
    """A step waits for a fall of its own data-ready line after the step before it. Raises Failed."""
    since_ns = s.res_ns if before is None else before.end_ns
    falls = s.ready(step)
    awaited, line = (falls > since_ns) & (falls <= step.begin_ns), DATA_READY[step.line]
    saw, due = f"{step.name} without a fall of {line} before it", f"a fall of {line} after the step before"
    expect(awaited.any(), saw, due, at_ns=step.begin_ns, lines=ACCEL + TEMP)


def _span(e: Capture, row: Requirement, begin_ns: float, end_ns: float, lo: str, hi: str, what: str) -> str:
    """An interval within the limits of a row, in ms. Raises Failed."""
    saw_ns, slack_ns = end_ns - begin_ns, e.slack_ns(end_ns - begin_ns)
    lo_ns, hi_ns = row.limit(lo) * MS - slack_ns, row.limit(hi) * MS + slack_ns
    if not lo_ns <= saw_ns <= hi_ns:
        due = f"{lo_ns / MS:.4f} to {hi_ns / MS:.4f} ms"
        raise Failed(f"{saw_ns / MS:.4f} ms {what}", due, at_ns=end_ns, lines=ACCEL + TEMP)
    return f"{saw_ns / MS:.4f} ms {what}"


def first_fall(falls: Ints, after_ns: float, line: str) -> int:
    """Raises Failed where the line does not fall any more."""
    later = falls[falls > after_ns]
    expect(len(later), f"{line} does not fall", f"a fall of {line}", at_ns=after_ns, lines=ACCEL + TEMP)
    return int(later[0])


@check("power_on", "PSA2-RES-03", needs={"pins"})
def res_rests_high_and_acts_low(e: Capture, row: Requirement) -> str:
    """Look at Res before and after the reset."""
    low, high = e.wires.pulses("Res", 0)
    expect(len(low), "no low pulse on Res", "one", at_ns=e.wires.start_ns, lines=("Res",))
    total_ns = int((high - low).sum())
    expect(e.wires["Res"].at(e.wires.end_ns), "Res low at the end", "high", at_ns=e.wires.end_ns, lines=("Res",))
    if total_ns > row.limit("low_max_share") * (e.wires.end_ns - e.wires.start_ns):
        raise Failed("Res low most of the time", "high", at_ns=int(low[0]), lines=("Res",))
    return f"{len(low)} low pulse of {total_ns * 1e-3:.1f} us, high otherwise"


@check("power_on", "PSA2-RES-04", needs={"pins"})
def a_reset_brings_all_lines_to_rest(e: Capture) -> str:
    """Press Res, in a frame where that can be timed, and look at Int, Data and CLK until the set-up is over."""
    s = set_up(e)
    res_ns = int(e.wires.falls("Res")[-1])
    quiet_ns = s.nth("SYNC_A", 0).end_ns
    in_frame = e.wires["Int"].at(res_ns - 1) == 0
    for line, rest in (("Int", 1), ("Data", 0), ("CLK", 0)):
        if e.wires[line].at(s.res_ns) != rest:
            raise Failed(f"{line} {1 - rest} at the end of Res", f"{rest}", at_ns=s.res_ns, lines=("Res", line))
        moves = e.wires[line].t_ns
        moves = moves[(moves > s.res_ns) & (moves < quiet_ns)]
        none_at(moves, f"{line} moves before the set-up is over", "rest", ("Res", line))
    if not s.steps or s.steps[0].line != "DIn":
        raise Failed("the set-up does not begin again", "its first message", at_ns=s.res_ns, lines=ACCEL)
    return f"Res came {'in a frame' if in_frame else 'between frames'}; all lines at rest, then the set-up"


@check("power_on", "PSA2-SETUP-01", needs={"pins"})
def the_set_up_is_made_once(e: Capture) -> str:
    """Look for messages of the set-up after it."""
    s = set_up(e)
    own = {sent for _, sent in demanded(e) if sent}
    end_ns = s.until_sync_a()[-1].end_ns
    again = [x for x in s.steps if x.begin_ns > end_ns and x.sent in own]
    if again:
        raise Failed(f"{again[0].name} after the set-up", "none", at_ns=again[0].begin_ns, lines=ACCEL + TEMP)
    if not any(x.sent in own for x in s.steps):
        raise Failed("no message of the set-up after Res", "all of them", at_ns=s.res_ns, lines=ACCEL + TEMP)
    return f"no message of the set-up in {(e.wires.end_ns - end_ns) / MS:.0f} ms after it"


@check("power_on", "PSA2-SETUP-02", needs={"pins"})
def config0_is_written_first(e: Capture, row: Requirement) -> str:
    """Decode the first message to the accelerometer converters after Res."""
    s = set_up(e)
    step = s.nth("DIn", 0)
    said = _is(step, row, "the first message")
    falls = s.drd_a[s.drd_a <= step.begin_ns]
    if len(falls) != 1:
        due = "on the first"
        raise Failed(f"it comes after {len(falls)} falls of DRD_A", due, at_ns=step.begin_ns, lines=ACCEL)
    expect(s.steps[0] is step, f"{s.steps[0].name} first", step.name, at_ns=s.steps[0].begin_ns, lines=ACCEL + TEMP)
    return said


def _status_write(e: Capture, row: str, n: int) -> str:
    s = set_up(e)
    step = s.nth("DInT", n)
    said = _is(step, row_for(e, row), f"message {n + 1} to the temperature converter")
    _after(s, step, s.nth("DInT", n - 1) if n else s.nth("DIn", 0))
    return said


@check("power_on", "PSA2-SETUP-03", needs={"pins"})
def bufen_is_written_second(e: Capture) -> str:
    """Decode the first message to the temperature converter."""
    return _status_write(e, "PSA2-SETUP-03", 0)


@check("power_on", "PSA2-SETUP-04", needs={"pins"})
def acal_is_written_third(e: Capture) -> str:
    """Decode the second message to the temperature converter."""
    return _status_write(e, "PSA2-SETUP-04", 1)


@check("power_on", "PSA2-SETUP-05", needs={"pins"})
def one_message_writes_bufen_and_acal(e: Capture, row: Requirement) -> str:
    """Decode the first message to the temperature converter, and look for another one to STATUS."""
    said = _status_write(e, "PSA2-SETUP-05", 0)
    register = sent_by(row)[0]
    more = [x for x in set_up(e).steps if x.line == "DInT" and x.sent[:1] == bytes([register])]
    expect(len(more) == 1, f"{len(more)} writes to STATUS", "one", at_ns=more[-1].begin_ns, lines=TEMP)
    return said


@check("power_on", "PSA2-SETUP-06", needs={"pins"})
def drate_is_written_after_status(e: Capture) -> str:
    """Decode the message after the writes to STATUS."""
    return _status_write(e, "PSA2-SETUP-06", sum(line == "DInT" for line, _ in demanded(e)) - 1)


@check("power_on", "PSA2-SETUP-07", needs={"pins"})
def sync_t_follows_the_write_to_drate(e: Capture) -> str:
    """Find the first pulse on SYNC_T after Res, and the fall of DRD_T before it."""
    s = set_up(e)
    drate, pulse = s.nth("DInT", sum(line == "DInT" for line, _ in demanded(e)) - 1), s.nth("SYNC_T", 0)
    if pulse.begin_ns < drate.end_ns:
        raise Failed("SYNC_T before the write to DRATE", "after it", at_ns=pulse.begin_ns, lines=TEMP)
    _after(s, pulse, drate)
    between = s.drd_t[(s.drd_t > drate.end_ns) & (s.drd_t <= pulse.begin_ns)]
    if len(between) != 1:
        raise Failed(f"SYNC_T after {len(between)} falls of DRD_T", "on the next", at_ns=pulse.begin_ns, lines=TEMP)
    return f"SYNC_T {(pulse.begin_ns - between[-1]) * 1e-3:.2f} us after the next fall of DRD_T"


@check("power_on", "PSA2-SETUP-08", needs={"pins"})
def sync_a_ends_the_set_up(e: Capture) -> str:
    """Count the falls of DRD_A before the first pulse on SYNC_A."""
    s = set_up(e)
    pulse, sync_t = s.nth("SYNC_A", 0), s.nth("SYNC_T", 0)
    if pulse.begin_ns < sync_t.end_ns:
        raise Failed("SYNC_A before SYNC_T", "after it", at_ns=pulse.begin_ns, lines=("SYNC_A", "SYNC_T"))
    falls = s.drd_a[s.drd_a <= pulse.begin_ns]
    if len(falls) != 2:
        raise Failed(f"SYNC_A after {len(falls)} falls of DRD_A", "on the second", at_ns=pulse.begin_ns, lines=ACCEL)
    return f"SYNC_A {(pulse.begin_ns - falls[-1]) * 1e-3:.3f} us after the second fall of DRD_A"


@check("power_on", "PSA2-SETUP-09", needs={"pins"})
def each_step_waits_for_its_event(e: Capture) -> str:
    """Compare each step of the set-up with the falls of its data-ready line."""
    s = set_up(e)
    before: Step | None = None
    for step in s.until_sync_a():
        if before is not None and step.begin_ns <= before.end_ns:
            saw = f"{step.name} before {before.name} has ended"
            raise Failed(saw, "one after the other", at_ns=step.begin_ns, lines=ACCEL + TEMP)
        _after(s, step, before)
        before = step
    return f"{len(s.until_sync_a())} steps, each after a fall of its own line and after the step before"


@check("power_on", "PSA2-SETUP-10", needs={"pins"})
def the_write_to_drate_calibrates(e: Capture, row: Requirement) -> str:
    """Measure how long DRD_T does not fall after the write to DRATE."""
    s = set_up(e)
    drate = s.nth("DInT", sum(line == "DInT" for line, _ in demanded(e)) - 1)
    fall_ns = first_fall(s.drd_t, drate.end_ns, "DRD_T")
    return _span(e, row, drate.end_ns, fall_ns, "selfcal_min_ms", "selfcal_max_ms", "without a fall of DRD_T")


@check("power_on", "PSA2-SETUP-11", needs={"pins"})
def drd_a_falls_after_res(e: Capture, row: Requirement) -> str:
    """Measure Res to the first fall of DRD_A."""
    s = set_up(e)
    fall_ns = first_fall(s.drd_a, s.res_ns, "DRD_A")
    return _span(e, row, s.res_ns, fall_ns, "first_min_ms", "first_max_ms", "after Res")


@check("power_on", "PSA2-SETUP-12", needs={"pins"})
def config0_restarts_the_converters(e: Capture, row: Requirement) -> str:
    """Measure the write of CONFIG0 to the next fall of DRD_A."""
    s = set_up(e)
    step = s.nth("DIn", 0)
    fall_ns = first_fall(s.drd_a, step.end_ns, "DRD_A")
    return _span(e, row, step.end_ns, fall_ns, "next_min_ms", "next_max_ms", "after the write of CONFIG0")


@check("power_on", "PSA2-SETUP-13", needs={"pins"})
def the_first_frame_comes_when_the_filters_have_settled(e: Capture, row: Requirement) -> str:
    """Measure SYNC_A to the next fall of DRD_A, and look for the frame that follows it."""
    s = set_up(e)
    begin_ns = s.nth("SYNC_A", 0).begin_ns
    fall_ns = first_fall(s.drd_a, begin_ns, "DRD_A")
    said = _span(e, row, begin_ns, fall_ns, "settling_min_ms", "settling_max_ms", "after SYNC_A")
    frame_ns = first_fall(e.wires.falls("Int"), begin_ns, "Int")
    second = s.drd_a[s.drd_a > fall_ns]
    soon = fall_ns <= frame_ns and (not len(second) or frame_ns <= second[0])
    saw = f"the first frame {(frame_ns - fall_ns) * 1e-3:.1f} us after that fall"
    expect(soon, saw, "it follows at once", at_ns=frame_ns, lines=("Int", "DRD_A", "SYNC_A"))
    return said


@check("power_on", "PSA2-SETUP-14", needs={"pins"})
def the_gain_is_written_after_the_set_up(e: Capture, row: Requirement) -> str:
    """Decode the message to the accelerometer converters that follows SYNC_A."""
    s = set_up(e)
    step = s.nth("DIn", 1)
    if step.begin_ns < s.nth("SYNC_A", 0).begin_ns:
        raise Failed(f"{step.name} before SYNC_A", "after it", at_ns=step.begin_ns, lines=ACCEL)
    return _is(step, row, "the message after SYNC_A")


@check("power_on", "PSA2-SETUP-15", needs={"pins"})
def no_frame_before_the_set_up_is_over(e: Capture) -> str:
    """Look for falls of Int between Res and the first fall of DRD_A after SYNC_A."""
    s = set_up(e)
    until_ns = first_fall(s.drd_a, s.nth("SYNC_A", 0).begin_ns, "DRD_A")
    falls = e.wires.falls("Int")
    early = falls[(falls > s.res_ns) & (falls < until_ns)]
    none_at(early, f"{len(early)} falls of Int", "none", ("Int", "SYNC_A", "DRD_A"))
    return f"Int high for {(until_ns - s.res_ns) / MS:.1f} ms after Res"


@check("power_on", "PSA2-SETUP-15", needs={"line"})
def int_is_quiet_while_the_set_up_lasts(e: Capture, row: Requirement) -> str:
    """Press Res while frames flow: how long until Int falls again?"""
    falls = transfers(e.wires).fall_ns
    quiet_ns = np.diff(falls)
    k = int(np.argmax(quiet_ns))
    due_ns = row.limit("quiet_min_ms") * MS
    if quiet_ns[k] < due_ns - e.slack_ns(due_ns):
        conclusive(not len(e.wires.gaps_ns), "the line port lost samples, and with them time")
        saw = f"Int falls again after {quiet_ns[k] / MS:.2f} ms"
        raise Failed(saw, f"{due_ns / MS:g} ms or more", at_ns=int(falls[k + 1]), lines=("Int", "Res"))
    return f"no fall of Int for {quiet_ns[k] / MS:.2f} ms"


@check("power_on", "PSA2-SETUP-16", needs={"pins"})
def nothing_but_the_set_up_is_sent(e: Capture) -> str:
    """List all that is sent between Res and SYNC_A."""
    s = set_up(e)
    saw, due = s.until_sync_a(), demanded(e)
    for k, step in enumerate(saw):
        if k >= len(due) or (step.line, step.sent) != due[k]:
            raise Failed(
                f"{step.name} as step {k + 1}", _names(due[k : k + 1]), at_ns=step.begin_ns, lines=ACCEL + TEMP
            )
    expect(len(saw) >= len(due), f"{len(saw)} steps", _names(due), at_ns=s.res_ns, lines=ACCEL + TEMP)
    return "; ".join(x.name for x in saw)


@check("power_on", "PSA1-SETUP-01", needs={"pins"})
def the_accelerometer_converters_get_one_message(e: Capture) -> str:
    """List all that is sent to the accelerometer converters from Res to the first frames."""
    s = set_up(e)
    saw = [x for x in s.steps if x.line == "DIn"]
    due = sent_by(row_for(e, "PSA2-SETUP-02"))
    if [x.sent for x in saw] != [due]:
        names = "; ".join(x.name for x in saw) or "nothing"
        raise Failed(names, due.hex(" "), at_ns=saw[-1].begin_ns if saw else s.res_ns, lines=ACCEL)
    return saw[0].name


def _names(due: list[tuple[str, bytes]]) -> str:
    return "; ".join(f"{sent.hex(' ').upper() or 'a pulse'} on {line}" for line, sent in due) or "nothing more"


@check("power_cycle", "PSA2-ERR-04", needs={"supply"})
def power_up_begins_anew(e: Capture) -> str:
    """Switch the supply off, in a frame where that can be timed, and on: what comes first on CAN and on the lines?"""
    boot = [f for f in e.can.of_id(0x700 + e.node).frames if f.data[:1] == b"\0"]
    expect(boot, "no boot-up message", "one after power-up", frames=e.can.frames[:20])
    after = [f for f in e.frames_of("PSA2_XY").frames if f.t_s > boot[-1].t_s]
    conclusive(after, "no PSA2_XY came after power-up")
    seq = int.from_bytes(after[0].data[6:8], "little")
    expect(seq == 0, f"SEQ {seq} first", "0", frames=after[:4])
    return "boot-up, then SEQ 0" + (_cut_on_the_line(e) if e.lines is not None else "")


def _cut_on_the_line(e: Capture) -> str:
    """No frame goes on after the supply has gone: there is a long time without one, and whole frames after it."""
    t = transfers(e.wires)
    pause_ns = np.diff(t.fall_ns)
    k = int(np.argmax(pause_ns))
    bits = [len(r) for r in t.rises]
    whole = max(bits)
    short = [i for i, b in enumerate(bits) if b != whole and i != k]
    if short:
        raise Failed(f"{bits[short[0]]} bits in a frame", f"{whole}", at_ns=int(t.fall_ns[short[0]]), lines=("Int",))
    clk = t.clk_rise_ns
    most_ns = row_for(e, "PSA2-ERR-04").limit("pause_max_us") * 1e3
    late = np.flatnonzero(np.diff(t.rises[k]) > most_ns)
    cut = t.rises[k][: int(late[0]) + 1] if len(late) else t.rises[k]
    end_ns = int(cut[-1]) if len(cut) else int(t.fall_ns[k])
    stray = clk[(clk > end_ns) & (clk < t.fall_ns[k + 1])]
    none_at(stray, "CLK without power", "none", ("Int", "CLK"))
    return f"; the last frame before it had {len(cut)} of {whole} bits, then {pause_ns[k] / MS:.0f} ms of silence"
