"""A unit at rest navigates for an hour: what a gyro drift of 0.01 deg/h about its x axis, which points east, does."""

from __future__ import annotations

import math

import numpy as np
from psabench.native import strapdown

LAT_RAD, DT_S, N = math.radians(55.7), 0.01, 360_000
EARTH_RADPS = 7.292115e-5
DRIFT_RADPS = math.radians(0.01) / 3600

C_nb = strapdown.dcm(0.0, 0.0, 0.0)  # right is east, forward is north
begin = strapdown.State(lat_rad=LAT_RAD, lon_rad=0.0, h_m=0.0, v_n_mps=np.zeros(3), C_nb=C_nb)
rate = C_nb.T @ [0.0, EARTH_RADPS * math.cos(LAT_RAD), EARTH_RADPS * math.sin(LAT_RAD)]
force = C_nb.T @ [0.0, 0.0, strapdown.gravity_mps2(LAT_RAD, 0.0)]
for title, drift in (("after an hour with a gyro drift of 0.01 deg/h", DRIFT_RADPS), ("without", 0.0)):
    unit = strapdown.Strapdown(begin, height_fixed=True)
    angle = np.tile((rate + np.array([drift, 0.0, 0.0])) * DT_S, (N, 1))
    path = unit.advance(angle, np.tile(force * DT_S, (N, 1)), DT_S)
    north_m = (path[:, 0] - LAT_RAD) * strapdown.radii_m(LAT_RAD, 0.0)[0]
    print(f"{title}: {np.abs(north_m).max() / 1e3:.2f} km off, {np.abs(path[:, 4]).max():.2f} m/s")
