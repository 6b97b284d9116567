"""The C header: a compiler's result is ours to the bit, and its stated error is the true one."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.thermal.compensation import Compensation, Lag, fit_soak
from psabench.thermal.fixed_point import FixedPoint, c_header, fixed_point
from quartz_units import HIGH_C, LOW_C, draw_unit

SEED = 26
GRID_C = np.linspace(LOW_C, HIGH_C, 146)
MDEGC = np.arange(-90_000, 120_000, 7)


def fitted_unit(seed: int, degree: int = 6) -> Compensation:
    return fit_soak("u0_ug", GRID_C, draw_unit(np.random.default_rng(seed)).zero_ug(GRID_C), degree)


def compiled_header(folder: Path, f: FixedPoint) -> ctypes.CDLL:
    """The header in a library, every warning an error."""
    (folder / "zero.h").write_text(c_header(f, "zero_signal"))
    (folder / "zero.c").write_text('#include "zero.h"\nint32_t at(int32_t t) { return zero_signal(t); }\n')
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-shared", "-fPIC"]
    sanitized = ["-fsanitize=undefined", "-fno-sanitize-recover", "-static-libubsan"]
    subprocess.run(["gcc", *flags, *sanitized, "-o", folder / "zero.so", folder / "zero.c"], check=True)
    return ctypes.CDLL(str(folder / "zero.so"))


@pytest.mark.parametrize("degree", [0, 1, 6, 9])
def test_the_header_gives_pythons_integers(tmp_path: Path, degree: int) -> None:
    f = fixed_point(fitted_unit(SEED, degree), 0.01)
    at = compiled_header(tmp_path, f).at
    assert [at(int(t)) for t in MDEGC] == f.value_at(MDEGC).tolist()


def test_the_stated_error_is_the_largest() -> None:
    c = fitted_unit(SEED)
    for step in (1.0, 0.01, 0.0001):
        f = fixed_point(c, step)
        inside = MDEGC[(f.low_mdegc <= MDEGC) & (f.high_mdegc >= MDEGC)]
        errors = np.abs(f.value_at(inside) * step - c.value_at(inside / 1000))
        assert errors.max() <= f.error
        assert 0.4 * step <= f.error <= 0.6 * step


def test_what_does_not_fit_is_rejected() -> None:
    with pytest.raises(BadInput, match="a step above"):
        fixed_point(fitted_unit(SEED), 1e-7)
    with pytest.raises(BadInput, match="a step above"):
        fixed_point(fitted_unit(SEED), float("inf"))
    for name in ("zero signal", "int"):
        with pytest.raises(BadInput, match="a name of C"):
            c_header(fixed_point(fitted_unit(SEED), 0.01), name)


def test_the_header_says_that_the_lag_is_left_out(tmp_path: Path) -> None:
    c = replace(fitted_unit(SEED), lag=Lag(tau_s=360.0, per_k=0.25))
    f = fixed_point(c, 0.01)
    assert "NOT in this function: add 0.25 a kelvin" in c_header(f, "zero_signal")
    assert compiled_header(tmp_path, f).at(30_000) == f.value_at(30_000)
