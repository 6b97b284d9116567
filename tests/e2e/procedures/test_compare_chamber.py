"""Converters in a chamber over the wire, three temperatures: what the host finds is what the parts drift by."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.climate import converters_result as result
from psabench.climate.converters import ChamberParams, Drift
from psabench.procedures.head_bench import Silent

POINTS = ChamberParams(points_degc=(25.0, -60.0, 70.0), seconds=20.0)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> result.ChamberComparison:
    return result.compare_in_chamber(tmp_path_factory.mktemp("chamber"), POINTS, Silent())


def of(c: result.ChamberComparison, name: str) -> Drift:
    return next(d for d in c.drifts if d.name == name)


def test_what_is_found_is_what_the_parts_drift_by(found: result.ChamberComparison) -> None:
    assert len(found.ens) == 30
    assert found.within, result.console_table(found)
    assert [s.degc for s in found.soaks] == list(POINTS.points_degc)
    for name in ("pik", "pik6", "psa2"):  # and it is not hidden by U
        d = of(found, name)
        assert abs(d.worst_scale.worst) > 2.0 * d.worst_scale.drift_expanded_u
        assert abs(d.worst_zero.worst) > 2.0 * d.worst_zero.drift_expanded_u


def test_the_zero_of_psa_drifts_less_than_that_of_pik(found: result.ChamberComparison) -> None:
    """The article's words; by the scenario's own coefficients (E0). PMKA and PSD-1 drift less than their U."""
    last = abs(of(found, "psa2").worst_zero.worst) / of(found, "psa2").ma_v_per_g
    for name in ("pik", "pik5", "pik6"):
        assert last < abs(of(found, name).worst_zero.worst) / of(found, name).ma_v_per_g
    for name in ("pmka", "psd1"):
        zero = of(found, name).worst_zero
        assert abs(zero.worst) < 2.0 * zero.drift_expanded_u
    assert result.times_finer(found.drifts) > 10.0


def test_the_rom_ends_at_its_points(found: result.ChamberComparison) -> None:
    """Corrected within -40 to 80 degC, to what 20 s of calibrations leave; at -60 the ROM has its last point."""
    drift = np.abs([line.drift for line in of(found, "pmka").scale])
    assert drift[:, 2].max() < 8e-6
    assert drift[:, 1].max() > 15e-6
