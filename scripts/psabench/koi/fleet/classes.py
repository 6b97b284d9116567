"""What drawn units and receivers err by: the truth of the campaign. It is a table of its own, not the filter's prior.

Sizes of both classes are those that make the article's figures 1 to 5 possible at all: an error of about a nautical
mile in an hour before, and about half of it afterwards. The article gives none. All are E0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from psabench.native.nav import ARCMIN

ARCSEC = ARCMIN / 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitSizes:
    """Standard deviations."""

    nu_degph: float  # persistent, of one unit for all its life
    nu_run_degph: float  # drawn at each switching on
    df_mps2: float
    df_run_mps2: float
    gyro_noise_degph_rts: float  # of a mean over 1 s
    nu_walk_degph_rth: float  # after an hour
    gamma_scale: float = 2e-4  # left over by a calibration on a table; persistent
    gamma_angle_arcsec: float = 10.0
    theta_scale: float = 1e-5
    theta_angle_arcsec: float = 10.0
    accel_noise_mps2_rts: float = 1e-3
    df_walk_mps2_rth: float = 0.0
    angle_count_arcsec: float = 0.01  # weights of the counts of the emulated БИНС (docs/boards/bins.md)
    speed_count_mps: float = 3e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverSizes:
    """Standard deviations of each horizontal axis; the vertical ones are `vertical_ratio` times as large.

    Position as proto/profiles/receiver.yaml.
    """

    white_mps: float
    slow_mps: float
    slow_v_s: float = 10.0  # correlation time of the velocity's slow errors
    white_m: float = 1.0
    slow_m: float = 1.5
    slow_s: float = 300.0
    vertical_ratio: float = 1.5
    position_delay_s: float = 0.05  # uniform from 0 to twice this, drawn for each flight
    velocity_delay_s: float = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class BaroSizes:
    """Of the altimeter, as in the scenario `flight`, drawn for each flight."""

    scale: float = 2e-3
    offset_m: float = 15.0
    drift_m_per_h: float = 10.0
    white_m: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Of a class."""

    unit: UnitSizes
    receiver: ReceiverSizes
    baro: BaroSizes = BaroSizes()


CLASSES: Mapping[str, Sizes] = {
    "good": Sizes(
        unit=UnitSizes(
            nu_degph=0.01,
            nu_run_degph=0.003,
            df_mps2=5e-4,
            df_run_mps2=1.5e-4,
            gyro_noise_degph_rts=0.1,
            nu_walk_degph_rth=0.0,
        ),
        receiver=ReceiverSizes(white_mps=0.05, slow_mps=0.0),
    ),
    "bins": Sizes(
        unit=UnitSizes(
            nu_degph=0.02,
            nu_run_degph=0.01,
            df_mps2=1.5e-3,
            df_run_mps2=5e-4,
            gyro_noise_degph_rts=0.15,
            nu_walk_degph_rth=0.01,
        ),
        receiver=ReceiverSizes(white_mps=0.05, slow_mps=0.1),
    ),
}
