"""Writes a virtual unit's flight for navigate.c: raw increments, fixes of a receiver, heights of a barometer.

examples/koi/record.py FILE. Ten minutes parked, taxi, take-off, ten in the air; errors of the sensors are drawn.
"""

import sys

import numpy as np
from psabench.native.flight_model import Flight

DEGPH = np.pi / 180 / 3600
LEGS: list[dict[str, float]] = [
    {"park_s": 600, "roll_deg": 0.05, "roll_s": 2.5},
    {"taxi_m": 300},
    {"turn_deg": 90},
    {"taxi_m": 400},
    {"stop_s": 30},
    {"taxi_m": 200},
    {"turn_deg": 90},
    {"taxi_m": 100},
    {"stop_s": 20},
    {"takeoff_mps": 85},
    {"climb_m": 600, "speed_mps": 110},
    {"turn_deg": 120},
    {"climb_m": 1500, "speed_mps": 180},
    {"fly_s": 180},
    {"descend_m": 2100, "speed_mps": 90, "rate_mps": 15},
    {"land_mps": 70},
    {"stop_s": 30},
]
rng = np.random.default_rng(7)
path = Flight(LEGS, heading_deg=30.0)
seconds = path.end_ns // 10**9
angle, speed = path.increments(0, 10**7, 100 * seconds)
drift, bias = rng.normal(0, 0.02 * DEGPH, 3), rng.normal(0, 1.5e-3, 3)
angle = angle + drift * 0.01 + rng.normal(0, 0.15 * DEGPH * 0.1, angle.shape)  # 0.15 deg/h as a mean over 1 s
speed = speed + bias * 0.01 + rng.normal(0, 0.001 * 0.1, speed.shape)
rows = np.hstack([angle, speed])
at = path.states(np.arange(1, seconds + 1) * 10**9)
off = rng.normal(0, 1, (seconds, 7)) * [5 / 6.37e6, 5 / 3.6e6, 8, 0.1, 0.1, 0.1, 1]
with open(sys.argv[1], "w", encoding="ascii") as file:
    for s in range(seconds):
        for row in rows[100 * s : 100 * s + 100]:
            file.write("I " + " ".join(f"{x:.9e}" for x in row) + "\n")
        place = (at.lat_rad[s] + off[s, 0], at.lon_rad[s] + off[s, 1], at.h_m[s] + off[s, 2])
        v = at.v_enu_mps[s] + off[s, 3:6]
        file.write(f"F {s + 1} " + " ".join(f"{x:.10f}" for x in (*place, *v)) + "\n")
        file.write(f"H {s + 1} {at.baro_m[s] + off[s, 6]:.2f}\n")
print(f"{sys.argv[1]}: {seconds} s")
