"""The run itself: the actions of a schedule on a bench, each recording stored before anything else happens."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from psabench.errors import BenchError, expected
from psabench.estimate.angles import wrapped_deg
from psabench.procedures.head_bench import Progress, Silent
from psabench.thermal.bench import CASE_CHANNEL, ThermalBench
from psabench.thermal.follow import FollowCheck
from psabench.thermal.records import Recording
from psabench.thermal.schedule import SOAK, Action, Schedule, Setting, Take, planned_actions

HEAD_DEG = 0.1  # that the head's scale may miss a position by: what is beyond first order there is 2 ppm


def _drop_it(_: object) -> None:
    """No one wants it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalWatch:
    """Who follows a run. store: gets each recording as soon as it exists; checkpoint: after each round of positions,
    with the number of recordings."""

    store: Callable[[Recording], object] = _drop_it
    checkpoint: Callable[[int], object] = _drop_it
    progress: Progress = field(default_factory=Silent)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunStart:
    """Where a run begins."""

    origin_s: float  # of its times, s of the bench
    chamber_degc: float  # what the chamber shows then


def measure_schedule(
    bench: ThermalBench,
    schedule: Schedule,
    start: RunStart,
    watch: ThermalWatch,
    kept: Sequence[Recording] = (),
) -> list[Recording]:
    """Carry out a schedule; kept: its first recordings, which are not made again. All recordings.

    Raises BenchError where head, chamber or case does not follow, LinkError for a sensor that gives nothing.
    """
    actions = planned_actions(schedule, start.chamber_degc)
    recordings, follow = list(kept), FollowCheck()
    first = _after_takes(actions, len(kept))
    _recall_follow(follow, actions[:first], start, recordings)
    total = sum(isinstance(a, Take) for a in actions)
    with watch.progress.step(f"thermal run, {total - len(kept)} recordings", total - len(kept)) as done:
        for k, action in enumerate(actions[first:], start=first):
            if isinstance(action, Setting):
                bench.wait_until(start.origin_s + action.at_s)
                shown = bench.chamber_degc()
                bench.set_chamber(action.temp_degc, action.ramp_k_per_min)
                follow.note_setting(action, bench.t_s, shown)
                continue
            recordings.append(_record_take(bench, schedule, action, start, follow, watch))
            if _ends_round(actions, k):
                watch.checkpoint(len(recordings))
            done()
    return recordings


def _record_take(
    bench: ThermalBench, schedule: Schedule, take: Take, start: RunStart, follow: FollowCheck, watch: ThermalWatch
) -> Recording:
    alpha_deg = bench.turn(take.position)
    if abs(wrapped_deg(alpha_deg - take.position.set_deg)) > HEAD_DEG:
        at = f"{take.position.set_deg:g} deg for {take.position.name}"
        raise BenchError(expected(at, f"{alpha_deg:.4f}: it does not turn or slips", "head"))
    bench.wait_until(start.origin_s + take.at_s)
    shown = bench.chamber_degc()
    s = bench.record(schedule.record_s)
    temps = [float(t) for t in s.temps_degc]
    made = Recording(
        t_s=s.t_s,
        segment=take.segment,
        part=take.part,
        position=take.position.name,
        alpha_deg=alpha_deg,
        chamber_degc=shown,
        case_degc=temps[CASE_CHANNEL],
        element_x_degc=temps[0],
        element_y_degc=temps[1],
        element_z_degc=temps[2],
        x_v=float(s.u_v[0]),
        y_v=float(s.u_v[1]),
        z_v=float(s.u_v[2]),
        sd_x_v=float(s.sd_v[0]),
        sd_y_v=float(s.sd_v[1]),
        sd_z_v=float(s.sd_v[2]),
    )
    watch.store(made)
    follow.see(s.t_s, shown, made.case_degc)
    return made


def _after_takes(actions: Sequence[Action], takes: int) -> int:
    """The first action after so many recordings."""
    if takes == 0:
        return 0
    at = [k for k, a in enumerate(actions) if isinstance(a, Take)]
    return at[takes - 1] + 1


def whole_parts(actions: Sequence[Action], taken: int) -> int:
    """How many of the first `taken` recordings are of temperatures and sweeps that are complete."""
    takes = [a for a in actions if isinstance(a, Take)]
    if taken == len(takes):
        return taken
    cut = takes[taken]
    same = (t.segment == cut.segment and (t.part == cut.part or t.segment != SOAK) for t in takes)
    return next(k for k, of_part in enumerate(same) if of_part)


def restarted_origin(bench: ThermalBench, actions: Sequence[Action], kept: int) -> float:
    """Where time has passed: the chamber is sent where the next action begins, and that has its usual time from when
    the chamber is as near as it should be. The origin of the run's times."""
    first = _after_takes(actions, kept)
    next_setting = actions[first]
    assert isinstance(next_setting, Setting)
    before = next((a for a in reversed(actions[:first]) if isinstance(a, Setting)), next_setting)
    to_c, ramp = next_setting.temp_degc, next_setting.ramp_k_per_min
    further_k = abs(to_c - bench.chamber_degc()) - abs(to_c - before.temp_degc)
    bench.set_chamber(to_c, ramp)
    return math.ceil(bench.t_s + max(further_k, 0.0) / ramp * 60.0) + 1.0 - next_setting.at_s


def _ends_round(actions: Sequence[Action], k: int) -> bool:
    """Whether the next recording is of another round, or there is none."""
    this = actions[k]
    assert isinstance(this, Take)
    after = next((a for a in actions[k + 1 :] if isinstance(a, Take)), None)
    return after is None or (after.segment, after.part) != (this.segment, this.part)


def _recall_follow(
    follow: FollowCheck, actions: Sequence[Action], start: RunStart, recordings: Sequence[Recording]
) -> None:
    """What the check would know by now: each setting found the air where the one before had sent it."""
    shown, takes = start.chamber_degc, iter(recordings)
    for a in actions:
        if isinstance(a, Setting):
            follow.note_setting(a, start.origin_s + a.at_s, shown)
            shown = a.temp_degc
        else:
            r = next(takes)
            follow.note_reading(r.t_s, r.chamber_degc)
