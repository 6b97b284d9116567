"""Runs of a unit as a passport keeps them."""

from __future__ import annotations

import numpy as np
from psabench.passport.store import Covariance, Measured, UnitRun
from psabench.report.provenance import json_digest
from psabench.thermal.compensation import fit_soak

FITTED = fit_soak("u0_ug", np.linspace(-60, 85, 60), np.sin(np.linspace(-1, 1.2, 60)))


def make_run(number: int, method: str = "turns quiet", count: int = 3) -> UnitRun:
    names = [f"q{k}_v" for k in range(count)]
    return UnitRun(
        method=method,
        begun=f"2026-11-27T10:00:{number:02d}+00:00",
        version="0.1.0",
        data_sha256=json_digest([method, number]),
        seed=number,
        within=number % 2 == 0,
        range_c=(-60.0, 85.0),
        quantities=tuple(
            Measured(name=n, unit="V", value=number + 0.1 * k, half_width=1e-6, compensation=FITTED if k == 0 else None)
            for k, n in enumerate(names)
        ),
        covariance=Covariance(names=tuple(names), matrix=tuple(tuple(map(float, row)) for row in np.eye(count))),
        provenance={"seed": number, "machine": "é"},
    )
