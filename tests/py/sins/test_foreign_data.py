"""A calibration recording made elsewhere, with known errors, through the library: every error is found, sign included.

The recording is synthetic, of another author's toolbox, which shares nothing with ours (docs/procedures/sins_data.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from psabench.native import sins
from psabench.native.nav import Floats
from psabench.native.sins import Calibration, Gauge, Params, SinsConfig
from psabench.sins.layout import read_layout
from psabench.sins.parameters import SCALES, state_parameters, value_of
from psabench.sins.readers import read_increments
from recordings import recorded_file

SHA256 = "7d7ad569bc46d7f3b58dfd57471e89192937ae604ab3e1d982d8332f8de38623"
LAYOUT = Path(__file__).resolve().parents[3] / "examples" / "sins" / "layout.yaml"
DEG, PPM = np.pi / 180.0, 1e-6
ARCSEC, DEGPH = DEG / 3600.0, DEG / 3600.0
UG = 9.7803267714e-6  # of that toolbox
LATITUDE_RAD = 34.0 * DEG
S2 = np.sin(LATITUDE_RAD) ** 2
GRAVITY_MPS2 = 9.780325333434361 * (1.0 + 5.2790414e-3 * S2 + 2.32718e-5 * S2**2)  # of that toolbox

# w' = Kg w - eb; f' = Ka f - db - Ka2 f^2 - L r - tGA (w x f): measured less true has the signs below.
SCALE = -PPM * np.diag([10.0, 20.0, 30.0])
INJECTED = Params(
    nu_radps=-DEGPH * np.array([0.1, 0.2, 0.3]),
    theta=SCALE + ARCSEC * np.array([[0.0, 10.0, 20.0], [30.0, 0.0, 40.0], [50.0, 60.0, 0.0]]),
    df_mps2=-UG * np.array([10.0, 20.0, 30.0]),
    gamma=SCALE + ARCSEC * np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 30.0, 0.0]]),
    quadratic_s2pm=-UG / (1e6 * UG) ** 2 * np.array([10.0, 20.0, 30.0]),
    lever_m=-0.01 * np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [0.0, 0.0, 0.0]]),
    delay_s=-1e-3,
)
# What may be left, in the unit of the kind of parameter (SCALES).
WITHIN = {
    "nu": 0.002,  # deg/h
    "theta_ii": 1.0,  # ppm
    "theta_ij": 1.0,  # arcsec
    "df": 1e6 * UG,  # um/s^2: 1 ug
    "gamma_ii": 1.0,
    "gamma_ij": 1.0,
    "quad": 1.0,  # ug/g^2
    "lever": 1.0,  # mm
    "delay": 0.1,  # ms
}
CFG = SinsConfig(
    latitude_rad=LATITUDE_RAD,
    gravity_mps2=GRAVITY_MPS2,
    gauge=Gauge.LOWER,
    lever=9,
    clone=True,
    beta_sd_rad=(DEG, DEG, DEG),
    quad_sd_s2pm=1e-5,
    delay_sd_s=0.01,
    gyro_noise_radps_rts=1e-3 * DEGPH,  # the recording has none but float32's rounding
    accel_noise_mps2_rts=1e-5,
)


def start_c_nb(pitch: float, roll: float, yaw: float) -> Floats:
    """C_nb of that toolbox's angles: about z (yaw), then x (pitch), then y (roll)."""
    (si, sj, sk), (ci, cj, ck) = np.sin([pitch, roll, yaw]), np.cos([pitch, roll, yaw])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, ci, -si], [0.0, si, ci]])
    about_y = np.array([[cj, 0.0, sj], [0.0, 1.0, 0.0], [-sj, 0.0, cj]])
    about_z = np.array([[ck, -sk, 0.0], [sk, ck, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_x @ about_y)


@pytest.fixture(scope="module")
def found() -> Calibration:
    data = read_increments(recorded_file("sins/imusysclbt.bin", SHA256), read_layout(LAYOUT))
    assert (len(data), data.dt_s) == (98200, 0.01)
    start = start_c_nb(*(np.array([1.0, -91.0, -91.0]) * DEG))
    return sins.calibrate_unit(CFG, start, data.dtheta_rad, data.dv_mps)


PARAMETERS = state_parameters(sins.state_layout(CFG), CFG)


def test_all_errors_are_looked_at_but_the_three_that_the_gauge_sets_to_zero() -> None:
    assert len(PARAMETERS) == 37 - 3
    assert {key for _, key, _ in PARAMETERS} == set(WITHIN)


@pytest.mark.parametrize(("name", "key"), [(name, key) for name, key, _ in PARAMETERS])
def test_what_another_toolbox_injected_is_found(found: Calibration, name: str, key: str) -> None:
    got, want = (value_of(p, name) * SCALES[key].per_si for p in (found.state.params, INJECTED))
    assert got == pytest.approx(want, rel=0.0, abs=WITHIN[key])


def test_the_signs_are_settled() -> None:
    """Else a difference within the limits could be of an error near zero."""
    for name, key, _ in PARAMETERS:
        injected = abs(value_of(INJECTED, name) * SCALES[key].per_si)
        assert injected > 2.0 * WITHIN[key] or injected == 0.0, name


def test_what_is_left_of_the_force_is_that_of_rounding(found: Calibration) -> None:
    """Innovations are 0.08 of the noise assumed; without one block of the model they are several times larger."""
    assert found.state.nis_accel < 0.01
