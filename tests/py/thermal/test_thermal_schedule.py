"""Schedules of thermal runs: what is refused, and when each recording is made."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from psabench.errors import BadInput
from psabench.thermal.schedule import (
    NAMED,
    POSITIONS,
    Setting,
    Take,
    planned_actions,
    read_schedule,
    schedule_dict,
    schedule_of_dict,
    sweep_names,
)

SOAK = {"temperatures_c": [10, 20, 30, 40]}
SWEEP = {"rates_k_per_min": [1], "every_s": 10}
WARM_UP = {"times_s": [0, 600, 1200], "temps_degc": [20, 26, 29]}


def made_from(**keys: Any) -> dict[str, Any]:
    return {"low_c": 10, "high_c": 40, "degree": 2, "soak": SOAK, "sweep": SWEEP} | keys


@pytest.mark.parametrize("name", NAMED)
def test_a_schedule_is_the_same_after_json(name: str) -> None:
    s = read_schedule(name)
    assert schedule_of_dict(schedule_dict(s), "again") == s


def test_the_full_schedule_is_the_articles_range_in_30_hours() -> None:
    s = read_schedule("full")
    assert (s.low_c, s.high_c, s.degree) == (-60, 85, 6)
    assert sweep_names(s) == {"sweep-1": 0.5}  # by its warm-up
    assert 29.0 < planned_actions(s, 25.0)[-1].at_s / 3600.0 < 31.0


def test_the_rate_of_service_is_that_of_the_middle_of_a_warm_up() -> None:
    s = schedule_of_dict(made_from(sweep={"every_s": 10, "warm_up": WARM_UP}), "test")
    # 0.9 K after 90 s and 8.1 K after 1020 s, by hand
    assert sweep_names(s) == {"sweep-1": round(7.2 / (1020 - 90) * 60, 2)}
    assert s.sweep is not None
    assert s.sweep.warm_up is not None
    assert s.sweep.warm_up.most_rate == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"low_c": -70}, "low_c: expected -60 to 85 degC, got -70"),
        ({"high_c": 86}, "high_c: expected -60 to 85 degC, got 86"),
        ({"high_c": float("nan")}, "high_c: expected -60 to 85 degC, got nan"),
        ({"high_c": 15}, "high_c: expected 10 K or more above low_c, got 15 for 10"),
        ({"degree": 2.5}, "degree: expected a whole number, got 2.5"),
        ({"degree": True}, "degree: expected a number, got True"),
        (
            {"positions": [p for p in POSITIONS if p != "z_up"]},
            "positions: expected all six positions, got none of z_up",
        ),
        ({"positions": [*POSITIONS, "over"]}, "each once, got x_down, x_up, y_down, y_up, z_down, z_up, over"),
        ({"record_s": 0.1}, "record_s: expected 0.16 to 60 s, got 0.1"),
        ({"samples_hz": 300}, "samples_hz: expected 250 or 500 or 1000, got 300"),
        ({"soak": None, "sweep": None}, "schedule: expected soak, sweep or both, got none"),
        ({"soak": {}}, "soak: expected temperatures_c, got none"),
        ({"soak": {"temperatures_c": [10, 20, 30]}}, "expected 4 temperatures for degree 2, got 3"),
        ({"soak": {"temperatures_c": [5, 20, 30, 40]}}, "expected within 10 to 40 degC, got 5 to 40"),
        ({"soak": SOAK | {"ramp_k_per_min": 0}}, "soak: ramp_k_per_min: expected 0.05 to 60 K/min, got 0"),
        ({"soak": SOAK | {"dwell": 3}}, "soak: expected temperatures_c, ramp_k_per_min, dwell_s, got dwell"),
        ({"soak": "all"}, "soak: expected keys and values, got all"),
        ({"sweep": {"every_s": 10}}, "sweep: expected rates_k_per_min, or a warm_up that gives one, got none"),
        ({"sweep": SWEEP | {"rates_k_per_min": [100]}}, "expected 0.05 to 60 K/min, got 100"),
        ({"sweep": SWEEP | {"rates_k_per_min": "1"}}, "rates_k_per_min: expected a list, got 1"),
        ({"sweep": SWEEP | {"every_s": 3}}, "sweep: every_s: expected 6 to 3600 s, got 3"),
        (
            {"sweep": SWEEP | {"every_s": 120}},
            "expected 7 rounds of the positions a leg for degree 2, got 2.5 at 1 K/min",
        ),
        ({"sweep": SWEEP | {"legs": "down"}}, "sweep: legs: expected both or up, got down"),
        (
            {"sweep": {"warm_up": WARM_UP | {"times_s": [0, 0, 1]}}},
            "warm_up: expected finite numbers, times that ascend",
        ),
    ],
)
def test_what_is_no_schedule_is_refused_in_one_line(keys: dict[str, Any], says: str) -> None:
    with pytest.raises(BadInput) as e:
        schedule_of_dict(made_from(**keys), "mine.yaml")
    assert str(e.value).startswith("mine.yaml: ")
    assert says in str(e.value)
    assert "\n" not in str(e.value)


@pytest.mark.parametrize(
    ("text", "says"), [("low_c: [", "expected a schedule in YAML"), ("7", "keys and values, got 7")]
)
def test_a_file_that_is_no_schedule_is_named(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(BadInput, match=r"s\.yaml") as e:
        read_schedule(str(tmp_path / "s.yaml"))
    assert says in str(e.value)
    assert "\n" not in str(e.value)


def test_a_schedule_that_is_not_there_says_the_names() -> None:
    with pytest.raises(BadInput, match="expected quick, full, or a file, got fast, no such file"):
        read_schedule("fast")


def test_a_sweep_records_at_equal_intervals_in_every_position_until_it_is_back() -> None:
    s = schedule_of_dict(made_from(soak=None), "test")
    takes = [a for a in planned_actions(s, 25.0) if isinstance(a, Take)]
    assert {round(b.at_s - a.at_s, 6) for a, b in pairwise(takes)} == {10.0}
    assert [t.position.name for t in takes[:12]] == list(POSITIONS) * 2
    assert len(takes) == 2 * 30 * 60 / 10


def test_the_chamber_has_its_time_before_a_temperature_is_recorded() -> None:
    s = schedule_of_dict(made_from(sweep=None, soak=SOAK | {"ramp_k_per_min": 2, "dwell_s": 100}), "test")
    actions = planned_actions(s, 25.0)
    at = 25.0
    for k, a in enumerate(actions):
        if isinstance(a, Setting):
            first = actions[k + 1]
            assert first.at_s - a.at_s >= abs(a.temp_degc - at) / 2 * 60 + 100
            at = a.temp_degc
