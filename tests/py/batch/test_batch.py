"""A batch of sensors in one pass: positions of each one of a triad, what its values should be, the spread."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from psabench import cli
from psabench.batch.bench import Place
from psabench.batch.run import Spread, section_of, spreads_of
from psabench.budget.accuracy import EXACT, BenchAccuracy
from psabench.estimate.face import Face
from psabench.procedures.head_bench import Reading
from psabench.procedures.turns import PAIRS, TurnsParams, expected_of_pairs, expected_turns, pairs_of_channel
from psabench.report.grading import grade, sensor_of

TRUTH = {
    "u0_v": 2.51,
    "kx_v_per_g": 0.98,
    "ky_v_per_g": 0.02,
    "kz_v_per_g": -0.03,
    "kxy_v_per_g2": 1e-3,
    "kxx_v_per_g2": 2e-4,
    "kyy_v_per_g2": 5e-5,
    "alpha0_deg": 0.7,
}
POSITIONS = [(p.face, a) for p in PAIRS for a in (p.along_deg, p.against_deg)]


def output_v(truth: dict[str, float], channel: str, face: Face, alpha_deg: float) -> float:
    """(12) of the article, the face, the place of the sensor in its triad, (1): written for this test alone."""
    alpha = math.radians(alpha_deg + truth["alpha0_deg"])
    mount = (-math.sin(alpha), -math.cos(alpha))
    case = (mount[0], mount[1], 0.0) if face is Face.DIRECT else (mount[0], 0.0, mount[1])
    x, y, z = (case[(k + "xyz".index(channel)) % 3] for k in range(3))
    u_v = truth["u0_v"] + truth["kx_v_per_g"] * x + truth["ky_v_per_g"] * y + truth["kz_v_per_g"] * z
    return u_v + truth["kxy_v_per_g2"] * x * y + truth["kxx_v_per_g2"] * x * x + truth["kyy_v_per_g2"] * y * y


def readings(channel: str, noise_v: float = 1e-9, off_deg: float = 0.0) -> list[Reading]:
    """Two realisations; off_deg: that the head misses each position by, in turn to either side, and says so."""
    rng = np.random.default_rng(4)
    found: list[Reading] = []
    for realisation in range(2):
        for k, (face, set_deg) in enumerate(POSITIONS):
            alpha_deg = set_deg + off_deg * (-1) ** (k // 2)
            u_v = output_v(TRUTH, channel, face, alpha_deg) + noise_v * rng.standard_normal()
            found.append(
                Reading(
                    t_s=float(len(found)),
                    face=face,
                    set_deg=set_deg,
                    alpha_deg=alpha_deg,
                    axis=channel,
                    realisation=realisation,
                    u_v=u_v,
                )
            )
    return found


def found(channel: str, given: list[Reading]) -> dict[str, tuple[float, float]]:
    """Estimate and what it should have been, by name."""
    section = section_of(
        Place("a", channel), given, TurnsParams(realisations=2), BenchAccuracy(**EXACT), 9.8, dict(TRUTH)
    )
    return {g.estimate.name: (g.estimate.value, g.truth or 0.0) for g in grade(section)}


@pytest.mark.parametrize("channel", ["x", "y", "z"])
def test_each_sensor_of_a_triad_has_its_own_pairs(channel: str) -> None:
    of = found(channel, readings(channel))
    for name in ("u0_v", "kx_sum_v_per_g", "ky_sum_v_per_g", "kz_sum_v_per_g", "closure_y_v", "closure_z_v"):
        value, truth = of[name]
        assert value == pytest.approx(truth, abs=1e-8), name
    for axis in "xyz":  # by name, to what alpha0 mixes in
        assert of[f"k{axis}_sum_v_per_g"][0] == pytest.approx(TRUTH[f"k{axis}_v_per_g"], abs=0.0125)


@pytest.mark.parametrize("channel", ["x", "y", "z"])
def test_what_the_head_says_it_missed_is_taken_out(channel: str) -> None:
    straight, turned = found(channel, readings(channel)), found(channel, readings(channel, off_deg=0.01))
    for name, (value, _) in turned.items():
        assert value == pytest.approx(straight[name][0], abs=1e-5), name  # 0.01 deg of kx are 1.7e-4 V


def test_the_first_channel_is_the_article_s() -> None:
    assert sorted(PAIRS, key=lambda p: p.axis) == list(pairs_of_channel("x"))
    sensor = sensor_of(TRUTH)
    of_pairs, known = expected_of_pairs(PAIRS, sensor, sensor), expected_turns(sensor, sensor)
    assert of_pairs == pytest.approx(dict(known), abs=1e-12)


def test_spread_is_of_what_each_sensor_determines() -> None:
    sections = []
    for k in range(3):
        given = [replace(r, u_v=r.u_v + 0.01 * k) for r in readings("x", noise_v=1e-6)]
        sections.append(
            section_of(Place("a", "x"), given, TurnsParams(realisations=2), BenchAccuracy(**EXACT), 9.8, None)
        )
    of = {s.name: s for s in spreads_of(sections)}
    assert list(of) == ["u0_v", "kx_sum_v_per_g", "ky_sum_v_per_g", "kz_sum_v_per_g"]
    assert of["u0_v"].sd == pytest.approx(0.01, rel=1e-6)
    assert of["kx_sum_v_per_g"].sd < 1e-9
    assert Spread(name="a", unit="V", values=(1.0, 3.0), u=0.1).mean == 2.0


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--record", "x.log"], "run: expected no --record beside --batch, got x.log"),
        (["--node", "6"], "run: expected no --node beside --batch, got 6"),
        (["--axis", "y"], "turns --batch: expected all channels, no --axis, got y"),
        (["--search-deg", "1"], "turns --batch: expected no --search-deg, got 1"),
        (["--average", "0"], "turns --batch: expected an --average of 1 or more: samples of all channels, got 0"),
        (["--climate"], "turns: expected one of --climate and --batch, got both"),
    ],
)
def test_what_a_batch_does_not_take(
    words: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", "turns", "--batch", *words, "--out", str(tmp_path)]) == 2
    assert why in capsys.readouterr().err
