"""The campaign koi: seasons, grading, the store, figures, the covariance alone, the report."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from psabench.campaign.store import CELL, Part, Store
from psabench.errors import BadInput
from psabench.koi.fleet import command, figures, linear, page, season, work
from psabench.koi.fleet.claims import list_claims
from psabench.koi.fleet.classes import CLASSES, Sizes
from psabench.koi.fleet.grade import COLUMNS, SCALARS, grade_flight, moving_errors
from psabench.koi.fleet.routes import Journey, Route, make_journey
from psabench.koi.fleet.season import MODES, draw_on, fly_host, host_config
from psabench.koi.flight_data import FlightFound
from psabench.link.signals import Floats
from psabench.native.koi import Koi, koi_prior
from psabench.native.strapdown import State
from psabench.progress import Bar
from psabench.report.page import page_without_foot
from scipy.spatial.transform import Rotation

SHORT = Route(
    place_deg_m=(55.7, 37.5, 150.0),
    heading_deg=30.0,
    taxi=(
        {"taxi_m": 300},
        {"turn_deg": 90},
        {"taxi_m": 200},
        {"stop_s": 30},
        {"taxi_m": 200},
        {"turn_deg": 90},
        {"taxi_m": 60},
        {"stop_s": 20},
    ),
    air=(
        {"climb_m": 300, "speed_mps": 110},
        {"turn_deg": 120},
        {"fly_s": 240},
        {"descend_m": 200},
        {"land_mps": 70},
        {"stop_s": 30},
    ),
)
# The filter's own idea of a receiver: white, of its sizes.
LIKE_THE_FILTER = Sizes(
    unit=CLASSES["bins"].unit,
    receiver=replace(CLASSES["bins"].receiver, white_m=5.0, slow_m=0.0, white_mps=0.15, slow_mps=0.0),
)


@cache
def journey() -> Journey:
    return make_journey(SHORT)


def fly(unit: int, mode: str, condition: str = "clean", sizes: Sizes = CLASSES["bins"]) -> tuple[FlightFound, Floats]:
    d = draw_on(journey(), sizes, condition, 1, unit, 0)
    found = fly_host(d, host_config("bins"), MODES[mode], None, "unit", 0.0)
    return found, grade_flight(found, d.against, None)


def value(row: Floats, name: str) -> float:
    return float(row[COLUMNS.index(name)])


# ---- grading


def test_errors_of_a_solution_are_the_article_s_variables() -> None:
    """A perfect solution, then one that is turned by a small angle about the vertical: beta3, and what it makes of the
    velocity; then one that is off in place."""
    j = journey()
    true = j.path.states(np.array([round((j.take_off_s + 60.0) * 1e9)]))
    to_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    at = State(
        lat_rad=true.lat_rad[0],
        lon_rad=true.lon_rad[0],
        h_m=true.h_m[0],
        v_n_mps=true.v_enu_mps[0],
        C_nb=to_enu @ true.C_nb[0],
    )
    assert np.abs(moving_errors(at.row(), true)).max() < 1e-9
    turned = replace(at, C_nb=Rotation.from_rotvec([0.0, 0.0, 1e-4]).as_matrix() @ at.C_nb)
    east, north = true.v_enu_mps[0, :2] * 1e-4
    assert moving_errors(turned.row(), true)[:7] == pytest.approx([0, 0, north, -east, 0, 0, 1e-4], abs=1e-10)
    moved = replace(at, lon_rad=at.lon_rad + 1e-5, h_m=at.h_m + 3.0)
    found = moving_errors(moved.row(), true)
    assert found[0] == pytest.approx(1e-5 * 6.378e6 * math.cos(at.lat_rad), rel=0.01)
    assert found[6] == pytest.approx(1e-5 * math.sin(at.lat_rad), rel=1e-6)
    assert found[7] == pytest.approx(3.0)


def test_with_a_receiver_as_the_filter_thinks_errors_are_within_its_covariance() -> None:
    """Twelve units; a mean over 30 states has a standard deviation of sqrt(2/360)."""
    rows = [fly(unit, "dov", sizes=LIKE_THE_FILTER)[1] for unit in range(12)]
    ratio = np.mean([value(r, "nees") / value(r, "nees_dof") for r in rows])
    print(f"NEES {ratio:.2f} a state")
    assert value(rows[0], "nees_dof") == 30
    assert abs(ratio - 1.0) < 4.0 * math.sqrt(2.0 / 360.0)


def test_a_row_has_what_the_flight_had() -> None:
    found, row = fly(0, "dov")
    assert found.take_off_s is not None
    assert value(row, "corrected") == 1.0
    assert value(row, "reasons") == 0.0
    assert value(row, "max_n_m") >= abs(value(row, "n 3 min"))
    assert value(row, "heading_sd_arcmin") < 0.5 * value(row, "heading_sd_aligned_arcmin")
    assert math.isnan(value(row, "n 60 min"))  # the flight is shorter
    k = int(np.searchsorted(found.t_s, found.take_off_s))
    assert value(row, "heading_sd_arcmin") == pytest.approx(math.degrees(found.sd[k // 10, 6]) * 60.0, rel=0.2)


def test_estimates_of_what_is_corrected_become_smaller() -> None:
    """The article's own evidence, over six units; of a flight that is not corrected there are none."""
    found, row = fly(1, "dov")
    k = found.names.index("beta3")
    assert found.x_take_off is not None
    assert value(row, "estimate_take_off") > abs(found.x_take_off[k]) / found.sd[0][k] / math.sqrt(len(found.names))
    assert math.isnan(value(fly(1, "none")[1], "estimate_end"))
    rows = np.array([fly(unit, "dov")[1] for unit in range(6)])
    before, after = (np.sqrt(np.mean(rows[:, COLUMNS.index(f"estimate_{at}")] ** 2)) for at in ("take_off", "end"))
    print(f"before {before:.2f}, after {after:.2f}")
    assert after < 0.8 * before


@pytest.mark.parametrize("condition", ["outage", "spoof", "late", "lever"])
def test_what_is_not_touched_errs_the_same_whatever_the_receiver_does(condition: str) -> None:
    """Why the mode `none` has one series for all conditions."""
    usual, other = fly(0, "none")[0], fly(0, "none", condition)[0]
    assert np.array_equal(usual.autonomous[:, :2], other.autonomous[:, :2])
    assert not np.array_equal(usual.hybrid, other.hybrid)


def test_a_late_receiver_is_a_reason() -> None:
    row = fly(0, "both", "late")[1]
    assert value(row, "corrected") == 0.0
    assert value(row, "reasons") != 0.0


@pytest.mark.parametrize("name", ["good", "bins"])
def test_a_season_learns_and_none_does_not(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(season, "fly_route", lambda _: journey())
    seasons = {m: season.Season(unit_class=name, condition="clean", mode=m, flights=3, seed=1) for m in MODES}
    rows = {m: season.fly_season(s, 0) for m, s in seasons.items()}
    left = {m: figures.pick_column(r[None], "left_df12_mps2")[0] for m, r in rows.items()}
    assert np.array_equal(left["none"], [left["none"][0]] * 3)
    assert left["both"][2] < 0.7 * left["none"][2]
    first = {m: r[0, : len(SCALARS)] for m, r in rows.items()}
    assert np.array_equal(first["none"][:8], first["auto"][:8])
    assert np.array_equal(first["dov"][:8], first["both"][:8])
    assert not np.array_equal(first["none"][:2], first["dov"][:2])


# ---- the store


FLEET = work.Fleet(classes=("good", "bins"), conditions=("clean", "spoof"), units=6, flights=8, seed=1)


def made_up(w: work.Wanted) -> Part:
    """Rows without a flight: errors of 2 with neither, 1 with both, in the modes' order."""
    size = {"none": 2000.0, "dov": 1250.0, "auto": 1600.0, "both": 1000.0}[w.season.mode]
    rng = np.random.default_rng([w.unit, len(w.season.mode)])
    rows = np.abs(rng.normal(1.0, 0.2, (w.season.flights, len(COLUMNS))))
    unit_size = size * (1.0 + 0.1 * w.unit)
    rows[:, :2] = unit_size
    rows[:, len(SCALARS) :] *= size
    rows[:, COLUMNS.index("reasons")] = 5.0 if w.season.condition == "spoof" else 0.0
    return Part(origin=work.make_origin(w.season), first_run=w.unit, rows=rows.reshape(1, -1).astype(CELL))


def quiet() -> Bar:
    return Bar(io.StringIO())


class Here:
    """Workers of this process; ends by Ctrl-C after so many tasks."""

    count = 1

    def __init__(self, last: int = 10**9) -> None:
        self.last = last

    def map(self, compute: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        for k, task in enumerate(tasks):
            if k == self.last:
                raise KeyboardInterrupt
            yield made_up(task)


def test_seasons_are_flown_once_each() -> None:
    names = [(s.unit_class, s.condition, s.mode) for s in FLEET.seasons()]
    assert len(names) == len(set(names)) == 2 * (4 + 1)
    assert ("bins", "spoof", "both") in names
    assert ("bins", "spoof", "none") not in names


def test_ctrl_c_keeps_what_was_done_and_the_next_run_goes_on(tmp_path: Path) -> None:
    with Store(tmp_path / "store.sqlite") as store:
        wanted = work.list_missing(FLEET, store)
        assert [w.unit for w in wanted] == [unit for unit in range(6) for _ in range(10)]
        with pytest.raises(KeyboardInterrupt):
            work.fill_store(wanted, store, Here(23), quiet())
    with Store(tmp_path / "store.sqlite") as store:
        assert work.list_missing(FLEET, store) == wanted[23:]
        work.fill_store(wanted[23:], store, Here(), quiet())
        assert work.list_missing(FLEET, store) == []
        assert work.load_rows(FLEET.season("bins", "spoof", "both"), store, 6).shape == (6, 8, len(COLUMNS))


# ---- figures and report


def made_up_report(folder: Path, *, backwards: bool = False) -> page.Report:
    with Store(folder / "store.sqlite") as store:
        wanted = work.list_missing(FLEET, store)
        work.fill_store(wanted[::-1] if backwards else wanted, store, Here(), quiet())
        return page.gather_report(FLEET, store, {})


def test_factors_and_shares_are_those_of_the_rows(tmp_path: Path) -> None:
    r = made_up_report(tmp_path)
    both = r.modes["bins", "both"]
    assert both.factor.value == pytest.approx(2.0, rel=1e-6)
    assert both.factor.low == pytest.approx(both.factor.high)
    assert both.rms_m.value == pytest.approx(1000.0 * math.sqrt(np.mean((1.0 + 0.1 * np.arange(6)) ** 2)), rel=1e-6)
    assert both.rms_m.low < both.rms_m.value < both.rms_m.high
    assert both.within_mile.value == 1.0
    assert r.modes["bins", "auto"].within_mile.value == pytest.approx(2.0 / 6.0)
    assert r.harms[-1][1].ratios == pytest.approx((0.5, 0.5))
    assert dict(r.reasons["bins, spoof"]) == {"no measurement lately": 1.0, "outside the gate": 1.0}
    met = {c.what: c.met for c in r.claims}
    assert met["good: factor, auto"] is False
    assert met["good: factor, both"] is True
    assert met["good: factor, dov"] is True


def test_harm_is_a_claim_that_may_fail() -> None:
    h = figures.harm_figures("spoof", np.full((2, 3, len(COLUMNS)), 1.2), np.ones((2, 3, len(COLUMNS))))
    (claim,) = list_claims({}, [("bins", h)])
    assert not claim.met
    assert claim.found == "rms 1.20, 95 % 1.20"


def test_the_report_is_the_same_in_whatever_order_units_come(tmp_path: Path) -> None:
    pages, results = [], []
    for backwards in (False, True):
        folder = tmp_path / str(backwards)
        folder.mkdir()
        path = page.write_page(folder, made_up_report(folder, backwards=backwards))
        pages.append(page_without_foot(path.read_text()))
        results.append({**json.loads((folder / "result.json").read_text()), "provenance": None})
    assert pages[0] == pages[1]
    assert results[0] == results[1]
    for words in ("As fig. 1, class bins", "As figs 2 to 5, class good", "What a receiver can do"):
        assert words in pages[0]


def test_two_processes_give_the_bytes_of_one(tmp_path: Path) -> None:
    """Flights of an hour."""
    results = []
    for jobs in ("1", "2"):
        words = ["--units", "2", "--flights", "1", "--class", "good", "--jobs", jobs, "-o", str(tmp_path / jobs)]
        args = command.parse(words)
        assert args.handler(args) == 0
        results.append({**json.loads((tmp_path / jobs / "result.json").read_text()), "provenance": None})
    assert results[0] == results[1]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--units", "0"], "--units: expected 1 to 100000, got 0"),
        (["--flights", "101"], "--flights: expected 1 to 100, got 101"),
        (["--jobs", "0"], "--jobs: expected 1 to 1024, got 0"),
        (["--seed", str(2**53 + 1)], "--seed: expected 0 to"),
        (["--condition", "rain"], "--condition: expected clean, outage"),
        (["--class", "best"], "--class: expected good, bins, got 'best'"),
    ],
)
def test_options_out_of_range_are_one_line(words: list[str], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        command._fleet_of(command.parse(words))


# ---- the covariance alone


def test_a_track_is_the_filter_s_own_prediction() -> None:
    """Without measurements the filter's covariance and the track's are the same."""
    cfg, j = host_config("bins"), journey()
    begin = round(j.take_off_s * 100.0)
    s = j.path.states(np.array([begin * 10_000_000]))
    to_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    at = State(
        lat_rad=s.lat_rad[0], lon_rad=s.lon_rad[0], h_m=s.h_m[0], v_n_mps=s.v_enu_mps[0], C_nb=to_enu @ s.C_nb[0]
    )
    koi = Koi(cfg, 0.0, at, p=koi_prior(cfg, at))
    track = linear.Track(cfg=cfg, names=(), p=koi.p)
    for k in range(begin, begin + 6000, 10):
        koi.push(j.dtheta_rad[k : k + 10], j.dv_mps[k : k + 10])
        track.predict_step(*koi.jacobians())
    scale = np.outer(koi.sd, koi.sd)
    assert np.abs((track.p - koi.p) / scale).max() < 1e-9


def test_a_correction_leaves_what_was_not_corrected() -> None:
    """Drawn: x and its estimate; what is left after a correction of some states has the covariance of the formula."""
    rng = np.random.default_rng(1)
    u, h, r = np.diag([4.0, 1.0, 2.0]), np.array([[1.0, 0.5, 0.2], [0.0, 1.0, 0.1]]), np.diag([0.5, 4.0])
    gain = u @ h.T @ np.linalg.inv(h @ u @ h.T + r)
    p = u - gain @ h @ u
    x = rng.multivariate_normal(np.zeros(3), u, 400_000)
    estimate = (x @ h.T + rng.multivariate_normal(np.zeros(2), r, 400_000)) @ gain.T
    names = ("dr1", "nu2_radps", "nu3_radps")  # the second and third stay: they have not converged

    koi: Any = SimpleNamespace(p=p)
    tracks = linear.Tracks(linear.Track(cfg=host_config("bins"), names=names, p=u))
    assert (np.sqrt(np.diag(p) / np.diag(u))[1:] > 0.7).all()
    tracks.leave_ground(koi)
    assert tracks.corrected is not None
    left = x - estimate * np.array([1.0, 0.0, 0.0])
    assert tracks.corrected.p == pytest.approx(np.cov(left.T), abs=0.03)


def test_the_covariance_predicts_what_drawn_units_do() -> None:
    """Eight units with neither, four minutes after take-off: rms within what eight units can say."""
    (rows,) = linear.predict_season("bins", [journey()], learns=False)
    drawn = [fly(unit, "none")[1] for unit in range(8)]
    for axis, name in enumerate("ne"):
        rms = math.sqrt(np.mean([value(r, f"{name} 4 min") ** 2 for r in drawn]))
        print(f"{name}: {rms:.0f} m, predicted {rows[False][4, axis]:.0f} m")
        assert 0.5 < rms / rows[False][4, axis] < 1.7
    assert (rows[True][4] < 0.4 * rows[False][4]).all()


def test_what_the_covariance_says_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = replace(FLEET, classes=("bins",), flights=2)
    row = {False: np.full((61, 2), 3.0), True: np.ones((61, 2))}
    monkeypatch.setattr(linear, "fly_route", lambda _: journey())
    monkeypatch.setattr(linear, "predict_season", lambda *_, learns: [row, row])
    with Store(tmp_path / "store.sqlite") as store:
        found = linear.predict_fleet(fleet, store, quiet())
        monkeypatch.setattr(linear, "predict_season", None)
        again = linear.predict_fleet(fleet, store, quiet())
    assert {name: float(x[0, 0, 0]) for name, x in found.items()} == {
        ("bins", "none"): 3.0,
        ("bins", "dov"): 1.0,
        ("bins", "auto"): 3.0,
        ("bins", "both"): 1.0,
    }
    assert all(np.array_equal(found[name], again[name]) for name in found)
