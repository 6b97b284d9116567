"""A schedule carried out: an emulator in lockstep from power-on, the host in this process, and what was violated.

Before a look all faults are lifted and the node is reset; before one that is `under` a fault, this is done before the
fault. The same schedule and the same build give the same frames and the same violations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.dut import Addresses, Dut, Take
from psabench.conform.profile import variant
from psabench.emulator import Emulator
from psabench.errors import BenchError, ControlError, TimeOut
from psabench.explore.fault_rules import NOTHING, RULES
from psabench.explore.host_frames import Entry
from psabench.explore.oracle import Violation, judge_always, look_at_board, short_looks
from psabench.explore.schedule import Action, Catalogue, Schedule
from psabench.faults import Fault
from psabench.link.can_host import StepClock

AHEAD, PASS_S = 50, 0.02  # an emulator takes no more than 128 frames while its time stands still
RESET_S = 0.01  # the boot-up message, and what waited in the queues


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """What came of a schedule. time_s: simulated, from the ready board on; actions: how many were begun."""

    violations: tuple[Violation, ...] = ()
    time_s: float = 0.0
    actions: int = 0


@dataclass(slots=True)
class Session:
    """A schedule that runs."""

    s: Dut
    take: Take
    violations: list[Violation] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)  # since the last reset
    rules: set[str] = field(default_factory=set)  # of these
    is_dirty: bool = False  # something was sent or broken since the last reset
    is_touched: bool = False  # the host has sent something, or the power was off
    waiting: int = 0  # frames sent while time stood still
    judged: int = 0  # frames of the take that are judged

    @property
    def clock(self) -> StepClock:
        clock = self.s.host.clock
        assert isinstance(clock, StepClock)
        return clock

    @property
    def is_over(self) -> bool:
        """Whether the schedule's time is."""
        return self.clock.now_s() >= self.clock.deadline_s

    def pass_time(self, dwell_s: float) -> None:
        self.waiting = 0
        self.s.run_for(dwell_s)


def _do_frame(at: Session, text: str) -> None:
    can_id, _, data = text.partition("#")
    at.is_dirty = at.is_touched = True
    at.s.host.send(int(can_id, 16), bytes.fromhex(data))
    at.waiting += 1
    if at.waiting >= AHEAD:
        at.pass_time(PASS_S)


def _do_wait(at: Session, s: float) -> None:
    if s:
        at.pass_time(s)


def _do_power(at: Session, off_s: float) -> None:
    at.is_dirty = at.is_touched = True
    at.s.power_cycle(off_s)


def _do_fault(at: Session, kind: str, point: str, values: Mapping[str, Any], for_s: float, fresh: bool) -> None:
    """One that the emulator rejects at this point changes nothing. fresh: on a board at its defaults."""
    if fresh:
        recover_board(at)
    try:
        at.faults.append(at.s.bench.fault(kind, point, **values, **({} if RULES[kind].is_once else {"for_s": for_s})))
    except ControlError:
        return
    at.is_dirty = True
    at.rules.add(RULES[kind].holds)


def _do_look(at: Session, name: str, under: bool) -> None:
    at.waiting = 0
    if not under or not at.rules or NOTHING in at.rules or at.is_touched:
        recover_board(at)
    found = look_at_board(at.s, name, sorted(at.rules))
    at.judged = len(at.take.frames)
    if not at.is_over:  # else it was cut off
        at.violations += found


PLAY: Mapping[str, Callable[..., None]] = {
    "frame": _do_frame,
    "wait": _do_wait,
    "power": _do_power,
    "fault": _do_fault,
    "look": _do_look,
}


def recover_board(at: Session) -> None:
    """Judge what was sent since the last look, lift all faults, reset the node, and wait for its readings."""
    judge_storm(at)
    if at.is_dirty:
        for fault in at.faults:
            with suppress(ControlError):  # one that is over may have been forgotten
                fault.clear()
        at.faults.clear()
        at.pass_time(PASS_S)  # what waits in the queues
        at.s.reset()
        at.pass_time(RESET_S)
    at.rules.clear()
    at.is_dirty = at.is_touched = False
    at.s.wait_ready()
    at.judged = len(at.take.frames)


def judge_storm(at: Session) -> None:
    """What the board sent since the last look must have its form, unless the link was ill."""
    frames = at.take.frames[at.judged :]
    at.judged = len(at.take.frames)
    if at.is_dirty and NOTHING not in at.rules:
        e = Capture(variant=at.s.variant, node=at.s.node, stimulus="explore", can=CanLog(frames=tuple(frames)))
        at.violations += judge_always(e)


def play_schedule(schedule: Schedule, snapshots: Path | None = None) -> Played:
    """Carry it out until its end, its time is up, or something is violated.

    snapshots: a folder that gets `before.snapshot`, from before the last action, and `after.snapshot`.
    """
    v = variant(schedule.board, schedule.profile)
    with Dut.open(v, Addresses(), seed=schedule.seed) as s, s.take(lines=False) as take:
        at = Session(s, take)
        begun_s, begun = 0.0, 0
        try:
            s.run_for(RESET_S)
            s.wait_ready()
            begun_s = s.bench.time_s
            at.judged = len(take.frames)
            at.clock.deadline_s = begun_s + schedule.length_s
            for action in schedule.actions:
                begun += 1
                _save_bench(s, snapshots, "before")
                _carry_out(at, action)
                if at.violations or at.is_over:
                    break
            _save_bench(s, snapshots, "after")
        except BenchError as e:
            if not at.is_over:
                at.violations.append(_of_error(s, e))
        return Played(violations=tuple(at.violations), time_s=at.clock.now_s() - begun_s, actions=begun)


def _carry_out(at: Session, action: Action) -> None:
    try:
        PLAY[action.do](at, **action.args)
    except TimeOut:
        if not at.is_over:
            raise


def _save_bench(s: Dut, folder: Path | None, name: str) -> None:
    if folder is not None:
        s.bench.snapshot(folder / f"{name}.snapshot")


def _of_error(s: Dut, e: BenchError) -> Violation:
    """The emulator has gone, or the board does not come back."""
    emulator = s.bench.emulator
    assert isinstance(emulator, Emulator)
    if emulator.status is not None:
        saw = f"exit status {emulator.status}: {e}"
        return Violation(key="emulator ends", requirements=(), saw=saw, due="an emulator that runs")
    return Violation(key=f"no recovery: {type(e).__name__}", requirements=(), saw=str(e), due="readings after a reset")


@cache
def catalogue_of(board: str, profile: str, length_s: float) -> Catalogue:
    """What schedules of a board and of this length can consist of, as the emulator and the dictionary say."""
    v = variant(board, profile)
    with Dut.open(v, Addresses()) as s:
        points = {kind: _points_of(s, kind) for kind, rule in RULES.items() if rule.board in (None, v.family)}
        entries = [Entry(d.index, d.sub, d.data_bytes or 0, d.access) for d in s.unit.node.objects()]
        node = s.node
    names = short_looks(v, length_s)
    return Catalogue(board=v.board, profile=v.profile, node=node, entries=entries, points=points, looks=names)


def _points_of(s: Dut, kind: str) -> list[str]:
    """Of the board and of what is around it, not of a level unit beside it nor of this program's own link."""
    left_out = RULES[kind].not_at
    found = (p for p in s.bench.faults.points(kind) if not p.startswith(("level.", "client.")))
    return [p for p in found if not (left_out and p.endswith(left_out))]
