"""A plan of rotations as commands to the table, over SCPI; what records looks on between its parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from psabench.bench import Bench
from psabench.errors import InstrumentError
from psabench.sins.table import AXES, Move

PART_S = 30.0  # of bench time between two looks at what has come
STEP_DEG = 180.0  # a turn of at most this is a position: it ends where it should


class PlanDrive:
    """Makes the moves of a plan, from angles of zero on."""

    def __init__(self, bench: Bench, moves: Sequence[Move], look: Callable[[], None]) -> None:
        """look: after each part of a move, of `parts_of`."""
        self._bench, self._moves, self._look = bench, moves, look
        self._set_deg = [0.0] * AXES  # as commanded: a coarse table shows no angles

    def go_home(self) -> int:
        """To angles of zero. Returns how many axes the table has."""
        axes = table_axes(self._bench)
        for axis in range(1, axes + 1):
            self._bench.table.position(0.0, axis=axis)
        return axes

    def make_all(self) -> None:
        """Every move, in order."""
        for number, move in enumerate(self._moves, start=1):
            self._make(move, self._moves[number] if number < len(self._moves) else None)
            self._set_deg[move.axis - 1] += move.angle_deg

    def _make(self, move: Move, following: Move | None) -> None:
        """Long turns end by their time, on a whole turn or not: what counts is what was measured."""
        table, angle = self._bench.table, move.angle_deg
        if move.rate_dps == 0.0:
            self._pass(move.duration_s)
        elif _is_position(move):
            table.position(self._set_deg[move.axis - 1] + angle, abs(move.rate_dps), axis=move.axis)
            self._look()
        else:
            table.rate(move.rate_dps, axis=move.axis)
            self._pass(move.duration_s)
            if following is None or following.axis != move.axis or following.rate_dps == 0.0:
                table.stop(axis=move.axis)

    def _pass(self, duration_s: float) -> None:
        parts = _parts(duration_s)
        for _ in range(parts):
            self._bench.run_for(duration_s / parts)
            self._look()


@dataclass(frozen=True, slots=True, kw_only=True)
class TableOptions:
    """A bench with a table: at these addresses, or an emulator with the scenario."""

    out: Path = Path("build/run")
    can: str | None = None
    table: str | None = None
    control: Path | None = None
    scenario: Path | None = None
    seed: int | None = None

    @property
    def given(self) -> list[str]:
        """Options that say which bench."""
        return [n for n in ("can", "table", "control", "scenario", "seed") if getattr(self, n) is not None]

    def open_bench(self, usual: str, pace: str = "step") -> Bench:
        """usual: the scenario where none is given. Raises BadInput, BenchError."""
        if self.can or self.table or self.control:
            return Bench.connect(self.can, control=self.control, scpi={"table": self.table} if self.table else None)
        return Bench.start(self.scenario or usual, pace=pace, seed=self.seed)


def _parts(duration_s: float) -> int:
    return max(1, round(duration_s / PART_S))


def parts_of(moves: Sequence[Move]) -> int:
    """How often a run of them looks."""
    return sum(1 if _is_position(m) else _parts(m.duration_s) for m in moves)


def _is_position(move: Move) -> bool:
    return move.rate_dps != 0.0 and abs(move.angle_deg) <= STEP_DEG


def table_axes(bench: Bench) -> int:
    """How many axes the table has: the first that it refuses ends the count."""
    for axis in range(1, AXES + 1):
        try:
            bench.table.read(axis=axis)
        except InstrumentError:
            return axis - 1
    return AXES
