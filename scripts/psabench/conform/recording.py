"""`psabench conform recording`: the checks of the device suite on files that somebody recorded at a bench.

What a check of a stimulus relies on is looked for in the recording (`plan.PARTS`); what is not there is not observable,
never passed. Times are divided by the measured ratio of the recorder's clock to the board's. Rows that say a frequency
(those with a limit clock_error_ppm) are checked by the recorder's clock as it is, unless a second recorder agrees with
the board.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

import numpy as np

from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog
from psabench.conform.plan import Plan, plan_of
from psabench.conform.profile import Variant
from psabench.conform.proves import SuiteTest
from psabench.conform.requirements import Requirement
from psabench.conform.runner import MISSING, Keep, tell_each, wanted
from psabench.conform.sources import clocks
from psabench.conform.sources.clocks import BEATS, Clocks, Ratio
from psabench.conform.sources.files import Recording
from psabench.conform.sources.lines import Recorded
from psabench.conform.verdict import Failed, Inconclusive, Outcome, Unseen, Verdict, conclusive, decide, not_decided
from psabench.errors import BadInput, BenchError, expected
from psabench.link.signals import Ints
from psabench.link.vcd import Vcd, Wire
from psabench.procedures.head_bench import Progress

PINS_NS = 42.0  # edges known so well or better stand for a clip on each pin
BOOT_UP, NMT_RESETS = b"\0", (0x81, 0x82)
HEARTBEAT_ID, SDO_RX_ID = 0x700, 0x600
RES_IS_A_LINE = ("psa2",)
BEFORE_NS = 300_000  # lines at rest before the first beat, with the read that it tells of
MARK = "clock_error_ppm"  # limit of rows that say a frequency
NO_PART = {
    "boot": "the recording has no Res and no boot-up",
    "": "it needs a stimulus, which a recording may not contain",
}


@dataclass(frozen=True, kw_only=True)
class Bench:
    """A recording with all that is known of the bench it was made at."""

    recording: Recording
    variant: Variant
    node: int
    clock_ppm: float = 100.0
    inputs_v: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def raw(self) -> Capture:
        """By the recorders' own clocks."""
        r = self.recording
        return Capture(
            variant=self.variant,
            node=self.node,
            stimulus="recording",
            can=r.can or CanLog(),
            lines=r.lines,
            inputs_v=self.inputs_v,
            clock_ppm=self.clock_ppm,
        )

    @cached_property
    def clocks(self) -> Clocks:
        return clocks.estimate(self.raw)

    @cached_property
    def probes(self) -> frozenset[str]:
        """As `Dut.probes`; pins only where edges are known well enough."""
        seen: set[str] = set()
        if self.recording.can is not None:
            frames = self.recording.can.frames
            seen |= {"can", "stamps", "rtr", "stream"}
            seen |= {"fd"} if any(f.fd for f in frames) else set()
            seen |= {"errors"} if any(f.error for f in frames) else set()
        if self.recording.lines is not None:
            seen |= {"line", "pins"} if self.recording.lines.resolution_ns <= PINS_NS else {"line"}
            seen |= {"wires"} if _has_wires(self.recording.lines) else set()
        return frozenset(seen | ({"inputs"} if self.inputs_v else set()))

    # ---- clocks

    def excused(self, own: Ratio | None, other: Ratio | None) -> bool:
        """Is it the recorder's clock that is off, since another recorder agrees with the board?"""
        limit = self.clock_ppm
        return own is not None and other is not None and own.beyond(limit) and own.usable and other.inside(limit)

    @cached_property
    def corrected(self) -> Capture:
        """By the board's clock."""
        c = self.clocks
        return _scaled(self.raw, c.lines if _usable(c.lines) else None, c.can if _usable(c.can) else None)

    @cached_property
    def by_recorders(self) -> Capture:
        """For rows that say a frequency: as recorded, but by the board's clock where the recorder's is found off."""
        c = self.clocks
        lines = c.lines if self.excused(c.lines, c.can) else None
        return _scaled(self.raw, lines, c.can if self.excused(c.can, c.lines) else None)

    def whose(self) -> str:
        """Words about a clock that is off, "" where none is."""
        c, limit = self.clocks, self.clock_ppm
        found = []
        for own, other, name, second in (
            (c.lines, c.can, "the lines' recorder", "the CAN log"),
            (c.can, c.lines, "the CAN log", "the lines' recorder"),
        ):
            if own is None or not own.beyond(limit):
                continue
            if not own.usable:
                found.append(f"the board's period by the clock of {name} is {own}: no clock's error")
            elif self.excused(own, other):
                found.append(f"the clock of {name} is off by {own}: that of {second} agrees with the board's")
            elif other is not None and other.beyond(limit):
                found.append(
                    f"the board's clock is off by {replace(own, ppm=-own.ppm)} as {name} and {second} both have it"
                )
            else:
                found.append(f"the clock of {name} or the board's is off, {own}: no second recorder tells which")
        return "; ".join(found)

    # ---- parts

    def part(self, capture: Capture, plan: Plan) -> Capture:
        """The part of the capture that a check reads. Raises Inconclusive where the recording has no such part."""
        if plan.on_recording == "all":
            return capture
        if plan.on_recording == "stream":
            return stream(capture)
        if plan.on_recording == "boot":
            return boot(capture, plan.needs)
        raise Inconclusive(NO_PART[""])


def _usable(r: Ratio | None) -> bool:
    return r is not None and r.usable


# ---- a capture by another clock, and parts of it


def _scaled(e: Capture, lines: Ratio | None, can: Ratio | None) -> Capture:
    """Times divided by these ratios; what is not known of them widens the limits."""
    found = e
    if lines is not None and isinstance(e.lines, Recorded):
        found = found.with_lines(_slowed(e.lines, 1.0 + lines.ppm * clocks.PPM))
    if can is not None:
        factor = 1.0 + can.ppm * clocks.PPM
        found = found.with_can(CanLog(frames=tuple(f._replace(t_s=f.t_s / factor) for f in e.can.frames)))
    wider = max((r.within_ppm for r in (lines, can) if r is not None), default=0.0)
    return replace(found, clock_ppm=e.clock_ppm + wider)


def _slowed(log: Recorded, factor: float) -> Recorded:
    rounded_ns = 1.0 if factor != 1.0 else 0.0
    return log.at_times(
        lambda t_ns: t_ns - np.rint(t_ns * (1.0 - 1.0 / factor)).astype(np.int64),
        log.resolution_ns / factor + rounded_ns,
    )


def lines_from(log: LineLog, t_ns: int) -> Recorded:
    """The lines from an instant on."""
    r = log.recording
    wires = {}
    for name, w in r.wires.items():
        k = max(0, int(np.searchsorted(w.t_ns, t_ns, "right")) - 1)
        wires[name] = Wire(np.concatenate(([np.int64(t_ns)], w.t_ns[k + 1 :])), w.level[k:])
    return Recorded(
        recording=Vcd(r.unit_ns, t_ns, r.end_ns, wires),
        resolution_ns=log.resolution_ns,
        gaps_ns=log.gaps_ns[log.gaps_ns >= t_ns],
    )


def _resets_ns(log: LineLog) -> Ints:
    """Rises (n,) of Res: ends of resets, one under way at the begin included."""
    return log.recording.wires["Res"].edges_ns(1) if "Res" in log.recording.wires else np.empty(0, np.int64)


def _from_power_up(log: LineLog) -> Recorded:
    """A recording that begins with Res low begins in a reset: it is given the fall of Res that it lacks."""
    r = log.recording
    res = r.wires["Res"]
    t_ns, level = np.concatenate(([res.t_ns[0], res.t_ns[0] + 1], res.t_ns[1:])), np.concatenate(([1], res.level))
    wires = {**r.wires, "Res": Wire(t_ns, level.astype(np.uint8))}
    return Recorded(
        recording=Vcd(r.unit_ns, r.start_ns, r.end_ns, wires), resolution_ns=log.resolution_ns, gaps_ns=log.gaps_ns
    )


def _boots(e: Capture) -> list[int]:
    """Places of the boot-up messages in the log."""
    return [k for k, f in enumerate(e.can.frames) if f.can_id == HEARTBEAT_ID + e.node and f.data == BOOT_UP]


def stream(e: Capture) -> Capture:
    """The readings after the last boot-up and the last Res: from the first whole one on each of the two."""
    boots = _boots(e)
    frames = e.can.frames[boots[-1] + 1 if boots else 0 :]
    first = e.frames_of(BEATS[e.variant.family].message).frames[:1] if e.variant.family in BEATS else ()
    ids = {f.can_id for f in first}
    begin = next((k for k, f in enumerate(frames) if f.can_id in ids), 0)
    found = e.with_can(CanLog(frames=frames[begin:]))
    beat = BEATS.get(e.variant.family)
    if e.lines is None or beat is None or beat.line not in e.lines.recording.wires:
        return found
    ends, edges = _resets_ns(e.lines), e.lines.recording.wires[beat.line].edges_ns(beat.level)
    later = edges[edges > ends[-1]] if len(ends) else edges[clocks.steady_from(e.variant, edges) :]
    if not len(later) or (e.variant.family in RES_IS_A_LINE and not len(ends)):
        return found
    return found.with_lines(lines_from(e.lines, max(e.lines.start_ns, int(later[0]) - BEFORE_NS)))


def boot(e: Capture, needs: frozenset[str]) -> Capture:
    """All, with the mark of the reset where the log shows it. Raises Inconclusive where no reset was recorded."""
    boots = _boots(e)
    conclusive("can" not in needs or boots, "the log has no boot-up")
    if needs & {"line", "pins"} and e.lines is not None and not len(_resets_ns(e.lines)):
        has_res = "Res" in e.lines.recording.wires or e.variant.family in RES_IS_A_LINE
        if has_res or not boots:
            raise Inconclusive("the recording has no pulse on Res" if has_res else NO_PART["boot"])
    if "line" in needs and "pins" not in needs:
        _reset_amid_readings(e)
    if e.lines is not None and len(_resets_ns(e.lines)) and not e.lines.recording.wires["Res"].level[0]:
        e = e.with_lines(_from_power_up(e.lines))
    if not boots:
        return e
    asked = [f.t_s for f in e.can.frames[: boots[-1]] if f.can_id == 0 and f.data[:1] and f.data[0] in NMT_RESETS]
    return replace(e, marks={"reset": asked[-1] if asked else e.can.frames[boots[-1]].t_s})


def _reset_amid_readings(e: Capture) -> None:
    """Checks that know Res by what Int does want readings before it. Raises Inconclusive."""
    beat = BEATS.get(e.variant.family)
    ends = np.empty(0, np.int64) if e.lines is None else _resets_ns(e.lines)
    if beat is None or e.lines is None or not len(ends) or beat.line not in e.lines.recording.wires:
        raise Inconclusive("the recording of the lines does not show a Res")
    if not (e.lines.recording.wires[beat.line].edges_ns(beat.level) < ends[-1]).any():
        raise Inconclusive("the recording has no readings before Res")


# ---- the run


def check_node(recording: Recording, variant: Variant, node: int) -> None:
    """Raises BadInput for a log without a frame of this node, with the nodes that have."""
    if recording.can is None or any(_of_node(f, node) for f in recording.can.frames):
        return
    nodes = sorted({f.can_id & 0x7F for f in recording.can.frames if f.can_id & 0x7F and _of_node(f, f.can_id & 0x7F)})
    raise BadInput(
        expected(f"frames of node {node} (--node)", f"frames of {', '.join(map(str, nodes[:20])) or 'none'}", "CAN log")
    )


def _of_node(f: CanFrame, node: int) -> bool:
    """Sent by a unit of this node, by the predefined connection set."""
    data = not (f.error or f.extended or f.remote)
    return data and f.can_id & 0x7F == node and 0x80 < f.can_id < 0x780 and f.can_id != SDO_RX_ID + node


def run(
    bench: Bench,
    progress: Progress,
    *,
    only: Sequence[str] = (),
    told: Callable[[Outcome], None] = lambda _: None,
    keep: Keep = lambda *_: (),
) -> list[Outcome]:
    """Check everything; told: of each outcome as it comes."""
    tests = wanted(bench.variant, only)
    each = (_outcome_of(bench, proof, rows, keep) for proof, rows in tests)
    return tell_each(chain(_clock_outcome(bench, only), each), len(tests), bench.variant.name, progress, told)


def untested(rows: Sequence[Requirement], outcomes: Sequence[Outcome]) -> list[Outcome]:
    """For rows that no test of the suite looks at: they are not observable here."""
    seen = {i for o in outcomes for i in o.requirements}
    left = tuple(r.id for r in rows if r.id not in seen)
    why = "no test of the suite judges these"
    title = "Requirements that want more than the suite has."
    return [
        Outcome(test="none", title=title, requirements=left, verdict=Verdict.NOT_OBSERVABLE, reason=why)
    ] if left else []  # fmt: skip


def _clock_outcome(bench: Bench, only: Sequence[str]) -> Iterator[Outcome]:
    """A clock that is off and that no one excuses is a finding about the board's period."""
    row, c = clocks.beat_row(bench.variant), bench.clocks
    bad = [
        own
        for own, other in ((c.lines, c.can), (c.can, c.lines))
        if own is not None and own.beyond(bench.clock_ppm) and not bench.excused(own, other)
    ]
    if bad and row and (not only or row.startswith(tuple(only))):
        yield Outcome(
            test="the_board_s_period_by_the_recorders",
            title="Compare the board's period with the clocks of the recorders.",
            requirements=(row,),
            verdict=Verdict.FAILED,
            saw=bench.whose(),
            due=f"clocks within {bench.clock_ppm:g} ppm of one another",
            stimulus="recording",
        )


def _outcome_of(bench: Bench, proof: SuiteTest, rows: tuple[Requirement, ...], keep: Keep) -> Outcome:
    plan = plan_of(proof.test)
    begun_s = time.monotonic()
    found = not_decided(proof.test, [r.id for r in rows], plan.stimulus)
    missing = plan.needs - bench.probes
    if plan.is_active:
        return replace(found, reason="it asks the board; a recording cannot be asked")
    if missing:
        return replace(found, reason="; ".join(_missing(bench, m) for m in sorted(missing)))
    frequency = any(MARK in r.limits for r in rows)
    capture = bench.by_recorders if frequency else bench.corrected
    words = bench.whose() if frequency else ""

    def test() -> str:
        try:
            return proof.test(bench.part(capture, plan))
        except Failed as e:
            e.saw += f"; {words}" if words else ""
            raise
        except (Inconclusive, BenchError) as e:  # what a recording lacks cannot be asked for
            raise Unseen(str(e)) from e

    found = decide(found, test, lambda e: keep(found.test, e, _plain(capture)))
    return replace(found, took_s=time.monotonic() - begun_s)


# Where the device suite would name the missing option.
UNRECORDED = {
    "can": "no CAN bus was recorded",
    "fd": "no FD frame was recorded",
    "port": "the line port itself is asked; a recording has its samples alone",
    "bus": "the bus port is asked; a recording has none",
    "supply": "the suite turns a power supply; a recording has none",
    "chamber": "the suite turns a thermal chamber; a recording has none",
    "head": "the suite turns a dividing head; a recording has none",
    "table": "the suite turns a rate table; a recording has none",
}


def _has_wires(lines: LineLog) -> bool:
    """Whether both wires of a pair were recorded, and the line behind them: Int, Int_A, Int_B."""
    names = lines.recording.wires
    return any(f"{name}_A" in names and f"{name}_B" in names for name in names)


def _missing(bench: Bench, way: str) -> str:
    lines = bench.recording.lines
    if way == "pins" and lines is not None:
        return f"edges are known to {lines.resolution_ns:.4g} ns; expected {PINS_NS:g} ns or better"
    if way in ("line", "pins"):
        return "no lines were recorded"
    return UNRECORDED.get(way) or MISSING.get(way, way)


def _plain(e: Capture) -> Capture:
    """For the excerpts, which leave out what was not recorded."""
    lines = e.lines
    if lines is None:
        return e
    return e.with_lines(LineLog(recording=lines.recording, resolution_ns=lines.resolution_ns, gaps_ns=lines.gaps_ns))
