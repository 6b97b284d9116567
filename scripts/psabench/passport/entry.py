"""What enters a passport: the sections of a calibration's result.json, a run of the unit each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected
from psabench.passport.store import Covariance, Measured, UnitRun
from psabench.report.diff import read_result
from psabench.report.provenance import KEY, json_digest
from psabench.thermal.compensation import compensation_of_dict


def runs_of_result(path: Path) -> list[UnitRun]:
    """Of a folder of a report or its result.json. Raises BadInput for one without estimates or provenance."""
    data = read_result(path)
    origin = data.get(KEY)
    if not isinstance(origin, dict) or not {"begun", "psabench"} <= origin.keys():
        raise BadInput(expected("a result with its provenance", "none", path))
    sections = [s for s in data.get("sections", []) if s.get("estimates")]
    if not sections:
        raise BadInput(expected("a result with estimates", "none", path))
    procedure = data.get("facts", {}).get("procedure", "")
    try:
        return [_run_of_section({"procedure": procedure, **section}, origin) for section in sections]
    except (KeyError, TypeError, ValueError) as e:
        raise BadInput(expected("the sections of a calibration", f"{type(e).__name__}: {e}", path)) from e


def _run_of_section(section: Mapping[str, Any], origin: Mapping[str, Any]) -> UnitRun:
    if not section["procedure"]:
        raise ValueError(expected("the name of a procedure", "none", "section"))
    words = (section.get(key) for key in ("procedure", "reading", "label"))
    estimates = [e for e in section["estimates"] if e.get("identifiable", True)]
    judged = [e["within_limits"] for e in estimates if e.get("within_limits") is not None]
    seed = origin.get("seed")
    return UnitRun(
        method=" ".join(str(w) for w in words if w),
        begun=str(origin["begun"]),
        version=str(origin["psabench"]),
        data_sha256=json_digest(section),
        seed=seed if isinstance(seed, int) else None,
        within=all(judged) if judged else None,
        range_c=_range_of(section),
        quantities=tuple(_measured_of(e) for e in estimates),
        covariance=_covariance_of(section, {e["name"]: float(e["sd"]) for e in estimates}),
        provenance=origin,
    )


def _measured_of(estimate: Mapping[str, Any]) -> Measured:
    low, high = (float(x) for x in estimate["ci95"])
    value, half = float(estimate["value"]), (high - low) / 2.0
    if not (math.isfinite(value) and math.isfinite(half)):
        raise ValueError(expected("a finite estimate", f"{value} +- {half}", estimate["name"]))
    name, curve = str(estimate["name"]), estimate.get("compensation")
    return Measured(
        name=name,
        unit=str(estimate["unit"]),
        value=value,
        half_width=half,
        compensation=None if curve is None else compensation_of_dict(curve, name),
    )


def _range_of(section: Mapping[str, Any]) -> tuple[float, float] | None:
    """Temperatures for which a run is valid, degC; None: it was made at one."""
    found = section.get("range_c")
    return None if found is None else (float(found[0]), float(found[1]))


def _covariance_of(section: Mapping[str, Any], sd: Mapping[str, float]) -> Covariance | None:
    """Correlation times standard deviations, of the quantities that enter."""
    found = section.get("correlation")
    if not found:
        return None
    at = {name: k for k, name in enumerate(found["names"]) if name in sd}
    rows = tuple(tuple(float(found["matrix"][at[a]][at[b]]) * sd[a] * sd[b] for b in at) for a in at)
    return Covariance(names=tuple(at), matrix=rows) if at else None
