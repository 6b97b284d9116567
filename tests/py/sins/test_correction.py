"""Corrections of an inertial unit against its errors forwards; in Python, as C, from files, from the command line."""

from __future__ import annotations

import json
import subprocess
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from psabench import cli
from psabench.errors import BadInput
from psabench.sins.correction import (
    KIND,
    SHAPES,
    Correction,
    c_header,
    correction_dict,
    correction_of,
    lever_mps2,
    read_correction,
)
from psabench.sins.increments import Increments
from psabench.sins.readers import read_increments, write_csv

DT_S = 0.01
RNG = np.random.default_rng(11)
UNIT = Correction(
    nu_radps=RNG.normal(0, 1e-6, 3),
    theta=RNG.normal(0, 1e-3, (3, 3)),
    df_mps2=RNG.normal(0, 1e-2, 3),
    gamma=RNG.normal(0, 1e-3, (3, 3)),
    quadratic_s2pm=RNG.normal(0, 1e-6, 3),
    lever_m=RNG.normal(0, 0.05, (3, 3)),
    delay_s=0.003,
)


def motion(n: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates and forces that change slowly against an interval: w, dw/dt, f at the middles."""
    t = DT_S * (np.arange(n) + 0.5)[:, None]
    phase, speed = np.array([0.0, 1.0, 2.0]), np.array([0.5, 0.7, 0.3])
    w = 0.3 * np.sin(speed * t + phase)
    f = 9.8 * np.cos(speed * t + phase)
    return w, 0.3 * speed * np.cos(speed * t + phase), f


def measured(c: Correction) -> tuple[Increments, Increments]:
    """What a unit with these errors gives, by the model as printed, and what is true."""
    w, _, f = motion()
    late = motion_at(-c.delay_s)
    lever = np.stack([felt_at(c.lever_m[i])[:, i] for i in range(3)], axis=1)
    raw_f = late + c.df_mps2 + late @ c.gamma.T + c.quadratic_s2pm * late**2 + lever
    raw_w = w + c.nu_radps + w @ c.theta.T
    end_s = np.asarray(DT_S * np.arange(1, len(w) + 1), np.float64)
    made = (
        Increments(end_s=end_s, dt_s=DT_S, dtheta_rad=a * DT_S, dv_mps=b * DT_S) for a, b in ((raw_w, raw_f), (w, f))
    )
    raw, true = made
    return raw, true


def felt_at(r: np.ndarray) -> np.ndarray:
    """Beyond the centre, at r of a body that turns as in `motion`."""
    w, slope, _ = motion()
    return np.asarray(np.cross(w, np.cross(w, r)) + np.cross(slope, r))


def motion_at(shift_s: float) -> np.ndarray:
    t = DT_S * (np.arange(400) + 0.5)[:, None] + shift_s
    return np.asarray(9.8 * np.cos(np.array([0.5, 0.7, 0.3]) * t + np.array([0.0, 1.0, 2.0])))


@pytest.mark.parametrize("only", [None, *SHAPES])
def test_a_unit_s_errors_go_out_as_they_came_in(only: str | None) -> None:
    """Each alone, and all: but for the line between neighbours, which is of second order in the interval."""
    c = UNIT if only is None else Correction(**{only: getattr(UNIT, only)})
    raw, true = measured(c)
    found = c.apply(raw)
    inside = slice(2, -2)  # the delay's end
    assert np.abs(found.dtheta_rad - true.dtheta_rad)[inside].max() < 1e-15
    limit = 9.8 * 0.7**2 * DT_S**2 / 8 if c.delay_s else 1e-6 if c.lever_m.any() else 1e-9  # slopes by differences
    assert np.abs(found.dv_mps - true.dv_mps)[inside].max() / DT_S < limit
    if only != "delay_s":
        assert np.abs(raw.dv_mps - true.dv_mps).max() + np.abs(raw.dtheta_rad - true.dtheta_rad).max() > 1e-9


def test_the_lever_arms_are_those_of_a_rigid_body() -> None:
    """Against the second derivative of a place that turns."""
    w, slope, _ = motion()
    r = UNIT.lever_m
    true = np.stack([(np.cross(w, np.cross(w, r[i])) + np.cross(slope, r[i]))[:, i] for i in range(3)], axis=1)
    assert lever_mps2(w, DT_S, r)[1:-1] == pytest.approx(true[1:-1], abs=1e-6)


def test_a_file_gives_back_the_same_correction(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text(json.dumps({"sections": [{"name": "x"}, {"correction": correction_dict(UNIT)}]}))
    found = read_correction(path)
    for f in fields(Correction):
        assert np.array_equal(getattr(found, f.name), getattr(UNIT, f.name))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "expected JSON"),
        ("{}", "expected a correction, kind"),
        ({"version": 2}, "version: expected 1, got 2"),
        ({"nu_radps": [1, 2]}, r"nu_radps: expected finite numbers of shape \(3,\)"),
        ({"nu_radps": [1, 2, "x"]}, "nu_radps: expected numbers of shape"),
        ({"nu_radps": [1, 2, None]}, "nu_radps: expected numbers of shape"),
        ({"theta": [[1, 0, 0], [0, 0, 0], [0, 0, 0]]}, "theta: expected elements within 0.5, got 1"),
        (
            {"gamma": [[-0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0, 0, 0]]},
            "gamma: expected a matrix that, added to the unit",
        ),
        ({"nu_radps": [1, 2, True]}, "nu_radps: expected numbers of shape"),
        ({"version": True}, "version: expected 1, got True"),
        ({"delay_s": 2.0}, "delay_s: expected elements within 1, got 2"),
        ({"df_mps2": [1e300, 0, 0]}, r"df_mps2: expected elements within 1000, got 1e\+300"),
        ({"thetas": 1}, "correction: expected nu_radps.* got thetas"),
    ],
)
def test_a_file_that_holds_none_is_refused(tmp_path: Path, text: str | dict[str, object], said: str) -> None:
    path = tmp_path / "c.json"
    path.write_text(text if isinstance(text, str) else json.dumps({"kind": KIND, "version": 1} | text))
    with pytest.raises(BadInput, match=f"^{path}: .*{said}"):
        read_correction(path)
    if isinstance(text, dict):
        with pytest.raises(ValueError, match=said):
            correction_of({"kind": KIND, "version": 1} | text)


def test_the_header_computes_what_python_does(tmp_path: Path) -> None:
    plain = Correction(**{n: getattr(UNIT, n) for n in ("nu_radps", "theta", "df_mps2", "gamma", "quadratic_s2pm")})
    raw, _ = measured(plain)
    want = plain.apply(raw)
    (tmp_path / "unit.h").write_text(c_header(plain, "unit"))
    (tmp_path / "main.c").write_text(
        '#include "unit.h"\n#include <stdio.h>\nint main(void)\n{\n    double g[3], a[3], w[3], f[3];\n'
        '    while (scanf("%lf %lf %lf %lf %lf %lf", g, g + 1, g + 2, a, a + 1, a + 2) == 6) {\n'
        "        unit_gyros(g, 0.01, w);\n        unit_accelerometers(a, 0.01, f);\n"
        '        printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", w[0], w[1], w[2], f[0], f[1], f[2]);\n    }\n'
        "    return unit_lever_m[0][0] != 0.0 || unit_delay_s != 0.0;\n}\n"
    )
    strict = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-ffp-contract=off"]
    subprocess.run(["cc", *strict, "main.c", "-o", "main"], cwd=tmp_path, check=True)
    rows = np.hstack([raw.dtheta_rad, raw.dv_mps])
    text = "\n".join(" ".join(f"{x:.17g}" for x in row) for row in rows)
    done = subprocess.run([tmp_path / "main"], input=text, capture_output=True, text=True, check=True)
    found = np.array([line.split() for line in done.stdout.splitlines()], np.float64)
    assert found == pytest.approx(np.hstack([want.dtheta_rad, want.dv_mps]), rel=1e-12, abs=1e-18)
    with pytest.raises(BadInput, match="header: expected a name of C, got int"):
        c_header(plain, "int")


def test_the_command_applies_checks_and_exports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    raw, _ = measured(UNIT)
    write_csv(tmp_path / "raw.csv", raw)
    (tmp_path / "unit.json").write_text(json.dumps(correction_dict(UNIT)))
    words = ["nav", "apply", str(tmp_path / "raw.csv"), "--calibration", str(tmp_path / "unit.json")]
    assert cli.main([*words, "--out", str(tmp_path / "out.csv")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'out.csv'}: 400 intervals of 0.01 s\n"
    found, want = read_increments(tmp_path / "out.csv"), UNIT.apply(read_increments(tmp_path / "raw.csv"))
    assert np.array_equal(found.dv_mps, want.dv_mps)
    assert cli.main(["nav", "check", str(tmp_path / "raw.csv")]) == 1
    assert "the unit does not rest on a table" in capsys.readouterr().out
    assert cli.main(["nav", "header", str(tmp_path / "unit.json"), "--out", str(tmp_path / "u.h")]) == 0
    assert "unit_gyro_matrix" in (tmp_path / "u.h").read_text()
    assert cli.main([*words[:3], "--calibration", str(tmp_path / "none.json"), "--out", str(tmp_path / "o.csv")]) == 2
    assert "none.json: expected a calibration in JSON, got no such file" in capsys.readouterr().err
