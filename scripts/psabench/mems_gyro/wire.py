"""The procedure's bench over the wire: gyro and PSA-2 over CAN, the table over SCPI; and the run on any such bench."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from psabench.bench import Bench
from psabench.boards.psa2.device import SETTLE_PERIODS
from psabench.errors import BadInput, LinkError, TimeOut, expected
from psabench.mems_gyro.params import BLOCK_S, NAME, MemsGyroParams
from psabench.mems_gyro.plan import Dwell, parts_of, plan_steps
from psabench.procedures.head_bench import Progress
from psabench.sins.table_drive import table_axes

AXES = 3
SPIN_LIMIT_S = 60.0  # for the table to reach a rate
RATE_TOL = 1e-4  # of the rate: it is reached
LINK_S = 5.0  # more than the samples take
BLOCKS_AT_ONCE = 20  # of the recording: Ctrl-C is heard between them


class TableBench(Protocol):
    """A gyro on a table of three axes."""

    def orient(self, middle_deg: float, inner_deg: float) -> None:
        """The two inner axes, with the outer one at rest."""
        ...

    def spin(self, rate_dps: float) -> None:
        """The outer axis, until it has the rate and the converter is settled; 0: at rest."""
        ...

    def dwell(self, blocks: int, *, recording: bool = False) -> Dwell:
        """So many means of BLOCK_S."""
        ...


def measure_gyro(bench: TableBench, p: MemsGyroParams, progress: Progress, keep: Callable[[Dwell], None]) -> None:
    """The recording at rest, then the series. keep: gets each dwell as it comes."""
    with progress.step("recording at rest", 1) as done:
        bench.orient(0.0, 0.0)
        bench.spin(0.0)
        keep(bench.dwell(p.rest_s, recording=True))
        done("")
    with progress.step("attitudes and rates", parts_of(p)) as done:
        for middle_deg, inner_deg, rates in plan_steps(p):
            bench.spin(0.0)
            bench.orient(middle_deg, inner_deg)
            for rate_dps in rates:
                bench.spin(rate_dps)
                keep(bench.dwell(p.dwell_s))
                done("")


class WireTable:
    """A `TableBench` of a PSA-2 and a table."""

    def __init__(self, bench: Bench, p: MemsGyroParams, look: Callable[[Dwell | None], None]) -> None:
        """look: after each block, for who follows the truth; with the dwell when it is over."""
        self._bench, self._axis, self._look = bench, p.axis, look
        self._unit = bench.unit
        self._unit.wait_ready()
        self._hz = self._unit.data_hz
        self._filter_gain = self._unit.filter_gain
        self._inner = (0.0, 0.0)
        if (axes := table_axes(bench)) != AXES:
            raise BadInput(expected("a table of 3 axes, each of the gyro's goes along the vertical", axes, NAME))

    def orient(self, middle_deg: float, inner_deg: float) -> None:
        self._inner = (middle_deg, inner_deg)
        for axis, angle_deg in ((2, middle_deg), (3, inner_deg)):
            self._bench.table.position(angle_deg, axis=axis)
        self._settle()

    def spin(self, rate_dps: float) -> None:
        table = self._bench.table
        if rate_dps == 0.0:
            table.stop()
        else:
            table.rate(rate_dps)
            self._until_rate(rate_dps)
        self._settle()

    def _until_rate(self, rate_dps: float) -> None:
        ends_s = self._bench.time_s + SPIN_LIMIT_S
        while abs(self._bench.table.rate_dps() - rate_dps) > RATE_TOL * abs(rate_dps):
            if self._bench.time_s > ends_s:
                raise TimeOut(f"{NAME}: {rate_dps:g} deg/s not reached within {SPIN_LIMIT_S:g} s")
            self._bench.wait(0.1)

    def _settle(self) -> None:
        self._bench.wait(SETTLE_PERIODS / self._hz)

    def dwell(self, blocks: int, *, recording: bool = False) -> Dwell:
        t0_s, heading_deg = self._stamped()
        means = self._recorded(blocks) if recording else self._followed(blocks)
        t1_s, end_deg = self._stamped()
        d = Dwell(
            middle_deg=self._inner[0],
            inner_deg=self._inner[1],
            heading_deg=heading_deg,
            rate_dps=(end_deg - heading_deg) / (t1_s - t0_s),
            t_s=t0_s,
            duration_s=t1_s - t0_s,
            blocks_v=np.array(means),
            recording=recording,
        )
        self._look(d)
        return d

    def _followed(self, blocks: int) -> list[float]:
        self._look(None)
        means: list[float] = []
        for _ in range(blocks):
            means += self._blocks_v(1)
            self._look(None)
        return means

    def _recorded(self, blocks: int) -> list[float]:
        means: list[float] = []
        while len(means) < blocks:
            means += self._blocks_v(min(BLOCKS_AT_ONCE, blocks - len(means)))
        return means

    def _blocks_v(self, blocks: int) -> list[float]:
        each = round(BLOCK_S * self._hz)
        v = self._unit.stream(blocks * each, blocks * BLOCK_S + LINK_S).axis(self._axis)
        means: list[float] = (v.reshape(blocks, each).mean(axis=1) / self._filter_gain).tolist()
        return means

    def _stamped(self) -> tuple[float, float]:
        t_s, angle_deg = self._bench.table.stamped()
        if abs(angle_deg) > 1e30:
            raise LinkError(expected("a table that shows its angle", "a coarse one", NAME))
        return t_s, angle_deg
