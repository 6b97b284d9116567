"""PMKA: K_IN from Nr and CT, and what old or printed values of it do to increments; voltages in a VCD."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from psabench.boards.pmka import estimate as est
from psabench.boards.pmka import k_in
from psabench.link.vcd_reals import read_reals

TS_S = 4.8e-3
CT = (1.0005, 0.9997)
CAPS_F = (0.470e-6, 0.465e-6)  # at the first calibration, at the second
R_OHM = 20e3 * 1.0003


def rom() -> est.Rom:
    ct = np.tile(np.array(CT), (4, 2, 1))
    return est.Rom(serial=1, ts_s=TS_S, degc=np.array([0.0, 80.0]), ct=ct, zero_vs=np.zeros((4, 2)))


def nr_of(cap_f: float) -> list[float]:
    """Codes of a reset from the parts, eq. (2): Rr(s) = RIN / (2 CT(s))."""
    return [10.0 * TS_S / 2.0 / (R_OHM / (2.0 * ct) * cap_f) / est.CODE_V for ct in CT]


def calibration() -> est.Calibration:
    nr = np.array([nr_of(c) for c in CAPS_F])
    return est.Calibration(nr_at=np.array([0.0, 1000.0]), nr=nr, zero_at=np.zeros(1), zero=np.zeros(1))


def test_k_in_is_that_of_the_parts() -> None:
    degc, at = np.full(2000, 25.0), np.array([0.0, 1000.0, 1500.0])
    found = k_in.k_in_per_s(calibration(), rom(), 0, degc, at)
    assert found == pytest.approx([1.0 / (R_OHM * c) for c in (*CAPS_F, CAPS_F[1])], rel=1e-12)
    assert k_in.k_psa(calibration(), rom(), 0, degc, at) == pytest.approx(found * 3276.8, rel=1e-12)


def test_printed_parts() -> None:
    """106.4 1/s, and the reset of 5.106 V."""
    assert pytest.approx(106.383, abs=1e-3) == k_in.K_IN_PRINTED
    assert k_in.printed(calibration(), rom()).nr == pytest.approx(np.full((1, 2), 16732.6), abs=0.1)


def steps(cap_f: float, input_v: float, count: int, *, moved: int | None = None) -> est.Periods:
    """X alone at a steady input, without resets; before reading `moved` a key has moved: half an increment."""
    du = input_v * TS_S / (R_OHM * cap_f) / est.CODE_V * np.ones(count)
    serves = np.tile(np.array([1, 0, 0, 0]), (count, 1))
    if moved is not None:
        du[moved] /= 2
        serves[moved - 1] = [0, 0, 0, 1]
    code = np.zeros((count, 4))
    code[:, 0] = np.cumsum(du)
    zeros = np.zeros((count, 4), dtype=np.int64)
    return est.Periods(code=code, reset=zeros, serves=serves, cal=zeros[:, 0], degc=np.full(count, 25.0))


def test_an_increment_is_as_wrong_as_its_k_in() -> None:
    p = steps(CAPS_F[1], 0.01, 2400, moved=2000)
    cal, r = calibration(), rom()
    each = [k_in.error_of_increments(p, r, [c] * 4, (0.01, 1.0, 1.0), 1000)[0] for c in (cal, k_in.held(cal))]
    assert each == pytest.approx([0.0, CAPS_F[0] / CAPS_F[1] - 1.0], abs=1e-9)


VCD = """$version psabench $end
$timescale 10 ns $end
$scope module pmka $end
$var wire 1 ! KL1 $end
$var real 64 a U_X $end
$var real 64 d U_K $end
$upscope $end
$enddefinitions $end
#0
$dumpvars
1!
$end
#100
r1.25 a
0!
#250
r-3e-07 d
r2 a
#300
"""


def test_voltages_of_a_vcd(tmp_path: Path) -> None:
    file = tmp_path / "u.vcd"
    file.write_text(VCD, encoding="ascii")
    found = read_reals(file)
    assert list(found) == ["U_X", "U_K"]
    assert (found["U_X"].t_ns.tolist(), found["U_X"].value.tolist()) == ([1000, 2500], [1.25, 2.0])
    assert found["U_K"].at(2500) == -3e-07
    with pytest.raises(ValueError, match="expected a value at 1000 ns, got none"):
        found["U_K"].at(1000)
    file.write_text(VCD.replace("r2 a", "r2 q"), encoding="ascii")
    with pytest.raises(ValueError, match="expected a time or a level of a declared wire, got 'r2'"):
        read_reals(file)
