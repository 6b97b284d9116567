"""Errors beside a truth log; when a flight has landed."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from koi_flight import Truth, state_of
from psabench.errors import BadInput
from psabench.koi.flight_data import FlightFound
from psabench.koi.geodesy import MILE_M
from psabench.koi.wire.live import LandedRule, Landing
from psabench.koi.wire.truth import Graded, grade_flight, read_truth
from psabench.link.signals import Floats
from psabench.native.flight_model import Flight, Leg

LEGS: list[Leg] = [{"park_s": 20}, {"takeoff_mps": 85}, {"climb_m": 100}, {"turn_deg": 90}, {"fly_s": 30}]
BEGIN_S = 0.37  # of the increments, after power-on


def log_of(path: Flight, file: Path, seconds: int) -> None:
    """As psa-emu --truth-log writes it, of two units."""
    rows = Truth.of(path, 0, seconds * 10**9)
    with file.open("w") as out:
        for k in range(seconds):
            s = state_of(rows.times(np.array([float(k)])), 0)
            heading = math.degrees(math.atan2(s.C_nb[0, 0], s.C_nb[1, 0]))
            place = {"latitude_deg": math.degrees(s.lat_rad), "longitude_deg": math.degrees(s.lon_rad)}
            moves = {"height_m": s.h_m, "v_enu_mps": s.v_n_mps.tolist(), "heading_deg": heading, "roll_deg": 0.0}
            for name in ("gps", "sins"):
                out.write(json.dumps({"t_ns": k * 10**9, "unit": name, "flight": place | moves}) + "\n")


def found_of(rows: Floats, t_s: Floats) -> FlightFound:
    return cast(FlightFound, SimpleNamespace(t_s=t_s, autonomous=rows, hybrid=rows))


def test_errors_are_those_that_were_put_in(tmp_path: Path) -> None:
    """Between the lines of the log, in a run and a turn: 3 m east, 4 m north, 5 m up."""
    path = Flight([*LEGS, {"land_mps": 70}, {"stop_s": 5}], heading_deg=30.0)
    log_of(path, tmp_path / "truth.jsonl", 100)
    truth = read_truth(tmp_path / "truth.jsonl")
    assert truth is not None
    t_s = np.arange(1.0, 98.0)
    rows = Truth.of(path, 0, 100 * 10**9)
    states = [state_of(rows.times(np.array([t + BEGIN_S])), 0) for t in t_s]
    exact = np.array([s.row() for s in states])
    put = exact.copy()
    put[:, 0] += 4.0 / 6.366e6
    put[:, 1] += 3.0 / (6.3878e6 * np.cos(exact[:, 0]))
    put[:, 2] += 5.0
    graded = grade_flight(found_of(put, t_s), BEGIN_S, truth)
    assert graded is not None
    assert np.abs(graded.autonomous_m - [3.0, 4.0, 5.0]).max() < 0.15  # radii above, and jerks within a second
    assert graded.hybrid_rms_m == pytest.approx(5.0, abs=0.1)
    assert graded.hour_error_m(None) == pytest.approx(5.0, abs=0.15)
    late = grade_flight(found_of(put, t_s), BEGIN_S + 0.1, truth)
    assert late is not None
    assert np.abs(late.autonomous_m[60:] - [3.0, 4.0, 5.0]).max() > 5.0  # a tenth of a second is seen
    assert grade_flight(found_of(put, t_s), 1e4, truth) is None


def test_the_hour_begins_at_take_off() -> None:
    t_s = np.arange(0.0, 6000.0)
    off = np.stack([t_s * MILE_M / 3600.0, 0.0 * t_s, 0.0 * t_s], axis=1)
    g = Graded(
        t_s=t_s,
        autonomous_m=off,
        hybrid_m=off,
        hybrid_mps=off,
        heading_rad=t_s,
        way_m=off[:, :2],
        bank_rad=t_s,
    )
    assert g.hour_error_m(1000.0) == pytest.approx(4600.0 * MILE_M / 3600.0)
    assert g.hour_error_m(None) == pytest.approx(MILE_M)
    assert math.isnan(g.hour_error_m(7000.0))


def test_a_log_is_read_as_far_as_it_is_whole(tmp_path: Path) -> None:
    log = tmp_path / "truth.jsonl"
    assert read_truth(log) is None
    line = json.dumps(
        {
            "t_ns": 0,
            "flight": {
                "latitude_deg": 1,
                "longitude_deg": 2,
                "heading_deg": 3,
                "roll_deg": 0,
                "height_m": 4,
                "v_enu_mps": [0, 0, 0],
            },
        }
    )
    log.write_text("\n".join([line, line.replace('"t_ns": 0', '"t_ns": 1000000000'), line[:30]]))
    truth = read_truth(log)
    assert truth is not None
    assert truth.t_s.tolist() == [0.0, 1.0]
    log.write_text("{}\n" + '{"t_ns": 5, "flight": {}}\n')
    with pytest.raises(BadInput, match="line 2: expected a record of a flight"):
        read_truth(log)


def test_a_flight_is_over_when_it_has_flown_and_rests() -> None:
    """A stop before take-off does not count; an outage on the ground does not end it."""
    landing, now_s = Landing(LandedRule()), 0
    ended = list[int]()
    for speed, seconds, valid in (
        (0.0, 100, True),
        (60.0, 50, True),
        (0.1, 20, True),
        (3.0, 5, True),
        (0.1, 40, False),
    ):
        for _ in range(seconds):
            now_s += 1
            if landing.take(float(now_s), speed, valid=valid):
                ended.append(now_s)
    assert ended == []
    ended = [k for k in range(60) if landing.take(float(now_s + k), 0.1, valid=True)]
    assert ended[0] == 30
