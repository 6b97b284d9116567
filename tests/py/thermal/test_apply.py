"""Readings as acceleration: a unit that is drawn, read in a chamber that moves, gives back what it felt."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from psabench.boards.decode_command import _report_compensation
from psabench.boards.psa2.frames import Frames
from psabench.errors import BadInput
from psabench.thermal.apply import Compensator
from psabench.thermal.bench import CASE_CHANNEL
from psabench.thermal.compensation import Compensation, Lag, element_temperature
from psabench.thermal.reduce import ARCSEC, AXES, quantity_names

SEED = 240
TAU_S = 200.0
RATE_HZ, READ_S = 5.0, 1500.0
HALF_CODE_V = 5.0 / 2**23  # codes are cut off: readings are lower by that on average
CODES_PER_K, ZERO_C_K = 65.536, 273.15  # docs/boards/psa2.md


def curve(name: str, rng: np.random.Generator, lag: Lag | None) -> Compensation:
    """Of third degree, between 0 and 60 degC."""
    size = {"zero": 100.0, "scale": 1e-3, "base": 20.0}[name.split("_")[0]]
    mean = 1.2 if name.startswith("scale") else 0.0
    coefficients = rng.normal(0.0, size, 4) + np.array([mean, 0.0, 0.0, 0.0])
    return Compensation(
        quantity=name,
        low_c=0.0,
        high_c=60.0,
        coefficients=tuple(coefficients),
        covariance=np.zeros((5, 5)),
        dof=20,
        rms=0.0,
        lag=lag,
    )


def drawn_curves() -> dict[str, Compensation]:
    rng = np.random.default_rng(SEED)
    return {n: curve(n, rng, Lag(tau_s=TAU_S, per_k=2.0) if n.startswith("zero") else None) for n in quantity_names()}


def frames_of(curves: dict[str, Compensation], felt_g: np.ndarray, low_c: float = 10.0) -> Frames:
    """A case that goes up by 40 K and back, read as codes; its channel is in every fourth frame."""
    n = int(RATE_HZ * READ_S)
    t_s = np.arange(n) / RATE_HZ
    code = np.round((low_c + 40.0 * (1.0 - np.abs(2.0 * t_s / READ_S - 1.0)) + ZERO_C_K) * CODES_PER_K).astype(np.int64)
    channel = np.arange(n) % 4
    told = channel == CASE_CHANNEL
    case_c = np.interp(t_s, t_s[told], code[told] / CODES_PER_K - ZERO_C_K)
    behind = np.interp(t_s, t_s[told], (case_c - element_temperature_of(t_s, case_c, told))[told])
    value = {}
    for name, c in curves.items():
        late_k = behind if c.lag else np.zeros(n)
        value[name] = c.value_at(case_c - late_k, late_k)
    u_v = np.empty((n, 3))
    for i, a in enumerate(AXES):
        across = sum(value[f"base_{a}{b}_arcsec"] / ARCSEC * felt_g[j] for j, b in enumerate(AXES) if j != i)
        u_v[:, i] = value[f"scale_{a}_v_per_g"] * (felt_g[i] + value[f"zero_{a}_ug"] * 1e-6 + across) - HALF_CODE_V
    absent = np.zeros(n, np.int64)
    return Frames(
        t_rx_s=t_s,
        t_sample_s=t_s % 0.25,  # as the board's stamps do
        seq=absent,
        u_v=u_v,
        temp_code=code,
        temp_channel=channel,
        settled=absent.astype(bool),
        clipped=absent.astype(bool),
    )


def element_temperature_of(t_s: np.ndarray, case_c: np.ndarray, told: np.ndarray) -> np.ndarray:
    return np.asarray(np.interp(t_s, t_s[told], element_temperature(t_s[told], case_c[told], TAU_S)))


def part(f: Frames, begin: int, end: int) -> Frames:
    names = ("t_rx_s", "t_sample_s", "seq", "u_v", "temp_code", "temp_channel", "settled", "clipped")
    return Frames(**{n: getattr(f, n)[begin:end] for n in names})


FELT_G = np.array([0.3, -0.9, 0.2])


def test_what_a_unit_felt_comes_back_at_any_temperature() -> None:
    curves = drawn_curves()
    found = Compensator(curves).accelerations_g(frames_of(curves, FELT_G))
    assert np.abs(found - FELT_G).max() < 1e-11
    plain = frames_of(curves, FELT_G).u_v / 1.2
    assert np.abs(plain - FELT_G).max() > 1e-4  # what it is worth


def test_in_parts_as_in_one_piece() -> None:
    curves = drawn_curves()
    whole, in_parts = Compensator(curves), Compensator(curves)
    f = frames_of(curves, FELT_G)
    once = whole.accelerations_g(f)
    ends = [0, 1, 2, 700, 701, 3000, len(f)]
    pieces = [in_parts.accelerations_g(part(f, a, b)) for a, b in pairwise(ends)]
    joined = np.concatenate(pieces)
    assert np.all(np.isnan(joined[: CASE_CHANNEL - 1]))  # no temperature yet
    assert np.nanmax(np.abs(joined[CASE_CHANNEL:] - once[CASE_CHANNEL:])) < 2e-6  # the case is held up to the next part
    assert in_parts.clamped == whole.clamped == 0


def test_readings_outside_of_the_range_are_counted_and_clamped() -> None:
    curves = drawn_curves()
    compensator = Compensator(curves)
    found = compensator.accelerations_g(frames_of(curves, FELT_G, low_c=30.0))
    assert np.all(np.isfinite(found))
    assert 0 < compensator.clamped < len(found)


def test_frames_without_temperatures_and_half_a_passport_are_refused() -> None:
    curves = drawn_curves()
    f = frames_of(curves, FELT_G)
    bare = Frames(**{n: getattr(f, n) for n in f.__slots__} | {"temp_code": np.zeros(len(f), np.int64)})
    with pytest.raises(BadInput, match="expected frames with temperatures"):
        Compensator(curves).accelerations_g(bare)
    del curves["base_xz_arcsec"]
    with pytest.raises(BadInput, match="base_xz_arcsec"):
        Compensator(curves)


@pytest.mark.parametrize("code", [3, 32767])
def test_a_sensor_that_is_open_is_no_temperature(code: int, capsys: pytest.CaptureFixture[str]) -> None:
    """From half of the log on; the last temperature before holds, and from the beginning there is none."""
    curves = drawn_curves()
    f = frames_of(curves, FELT_G)
    late, whole = f.temp_code.copy(), np.full(len(f), code)
    late[len(f) // 2 :] = code
    fields = {n: getattr(f, n) for n in f.__slots__}
    compensator = Compensator(curves)
    held = compensator.accelerations_g(Frames(**fields | {"temp_code": late}))
    assert np.abs(held[: len(f) // 2] - FELT_G).max() < 1e-6
    assert compensator.blind == 0
    assert compensator.open == np.count_nonzero(f.temp_channel[len(f) // 2 :] == CASE_CHANNEL)
    assert _report_compensation(compensator, len(f)) == 1
    assert capsys.readouterr().err.count("its sensor is open, the last one holds") == 1
    blind = Compensator(curves)
    assert np.all(np.isnan(blind.accelerations_g(Frames(**fields | {"temp_code": whole}))))
    assert blind.blind == len(f)
