"""Heading hold on a platform in memory: what is compensated, what grows, what is refused; grading and report."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_platform import FakePlatform
from psabench.errors import LinkError
from psabench.estimate.angles import wrapped_deg
from psabench.procedures import gyrocompass
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.heading_hold import Held, HoldParams, HoldResult, hold
from psabench.procedures.platform_bench import Floats, Look
from psabench.report import gyro_grading, gyro_page
from psabench.report.gyro_grading import GyroSection, HeldTruth
from psabench.report.language import load_language


def start(bench: FakePlatform, reading: str = "improved", **given: object) -> GyrocompassResult:
    p = params_of(reading, given)
    return gyrocompass.estimate(gyrocompass.measure(bench, p, Silent()), p)


def held(bench: FakePlatform, p: HoldParams) -> HoldResult:
    return hold(bench, start(bench), p, Silent())


def end_error_deg(bench: FakePlatform, r: HoldResult) -> float:
    return wrapped_deg(math.degrees(r.held[-1].heading_rad) - bench.heading_deg)


def test_with_its_own_drift_compensated_the_heading_stays() -> None:
    bench = FakePlatform()
    r = held(bench, HoldParams())
    assert abs(end_error_deg(bench, r)) < 1e-4
    assert len(r.held) == 49
    assert r.held[-1].t_s == pytest.approx(4 * 3600.0)
    assert r.held[-1].sd_rad > 10 * r.held[0].sd_rad


def test_the_drift_of_the_other_axis_is_the_wrong_one() -> None:
    """The article's trap: 25 deg/h about the axis of suspension, 24 about the azimuth axis: 1 deg an hour."""
    bench = FakePlatform(drift2_degph=lambda t_s: 24.0)
    r = held(bench, HoldParams(compensate="axis1"))
    assert abs(end_error_deg(bench, r)) == pytest.approx(4.0, abs=0.05)
    bench = FakePlatform(drift2_degph=lambda t_s: 0.5)
    r = held(bench, HoldParams(compensate="none"))
    assert abs(end_error_deg(bench, r)) == pytest.approx(2.0, abs=0.05)


def test_what_the_passport_says_of_the_force_in_the_windows_is_not_in_the_drift_of_the_hold() -> None:
    bench = FakePlatform(drift2_degph=lambda t_s: 24.0)
    found = start(bench)
    forced = replace(found, drift2=replace(found.drift2, by_force_radps=math.radians(0.5 / 3600.0)))
    r = hold(bench, forced, HoldParams(), Silent())
    assert math.degrees(r.drift2_radps) * 3600.0 == pytest.approx(23.5, abs=0.01)
    assert abs(end_error_deg(bench, r)) == pytest.approx(2.0, abs=0.05)


def test_the_article_s_sum() -> None:
    """0.1 deg and 0.05 deg/h for 4 h are 0.3 deg, all of the article's claim."""
    bench = FakePlatform()
    r = start(bench)
    drift2 = replace(r.drift2, radps=r.drift2.radps + math.radians(0.05) / 3600)
    off = replace(r, heading_rad=r.heading_rad + math.radians(0.1), drift2=drift2)
    end = hold(bench, off, HoldParams(), Silent())
    assert end_error_deg(bench, end) == pytest.approx(0.300, abs=0.001)


def test_what_is_expected_grows_as_the_random_drift_does() -> None:
    """0.288 deg in 4 h for 0.2 deg/h and 1000 s, and the drift over the windows, less what both have in common."""
    r = held(FakePlatform(), HoldParams())
    d = r.start.drift2
    within = np.linspace(-0.45, 0.45, 10)
    window_s = np.add.outer(d.t_mid_s, 0.0 * within) + np.outer(d.length_s, within)
    weight = np.repeat(d.share, within.size) / within.size
    hold_s = window_s.max() + d.length_s[-1] / 20.0 + 14.4 * (np.arange(1000) + 0.5)
    common = _covariance(window_s.ravel(), hold_s).mean(axis=1) @ weight
    own = weight @ _covariance(window_s.ravel(), window_s.ravel()) @ weight
    wandered = math.sqrt(0.288**2 + 4.0**2 * (own - 2.0 * common))
    found = r.start.get("drift2_degph").sd * 4.0
    heading = r.start.get("heading_deg").sd
    assert math.degrees(r.held[-1].sd_rad) == pytest.approx(math.hypot(wandered, found, heading), rel=0.005)


def _covariance(a_s: Floats, b_s: Floats) -> Floats:
    """Of the random drift at instants, (deg/h)^2."""
    return np.asarray(0.2**2 * np.exp(-np.abs(np.subtract.outer(a_s, b_s)) / 1000.0))


def test_a_flight_tells_the_controller_where_it_is() -> None:
    told: list[tuple[float, float]] = []

    class Flying(FakePlatform):
        def moved(self, *, latitude_rad: float, speed_mps: float, track_rad: float) -> None:
            told.append((math.degrees(latitude_rad), speed_mps))

    departed: list[int] = []
    bench = Flying()
    p = HoldParams(hours=2.0, look_s=1800.0, speed_kmh=500.0, track_deg=0.0)
    hold(bench, start(bench), p, Silent(), depart=lambda: departed.append(len(told)))
    leg = math.degrees(1800.0 * 500.0 / 3.6 / 6371e3)
    assert [round(lat, 6) for lat, _ in told] == [round(50.0 + leg * (k + 0.5), 6) for k in range(5)]
    assert {round(v, 6) for _, v in told} == {round(500.0 / 3.6, 6)}
    assert departed == [1]


def test_navigation_does_not_begin_on_a_platform_with_a_fault() -> None:
    class Faulty(FakePlatform):
        def look(self) -> Look:
            return replace(super().look(), faults=("the level sensors are silent",))

    bench = Faulty()
    with pytest.raises(LinkError, match="navigation did not begin: the level sensors are silent"):
        held(bench, HoldParams())


def test_a_fault_on_the_way_is_a_doubt() -> None:
    bench = FakePlatform()
    looks = 0

    def spoil(_: Held) -> None:
        nonlocal looks
        looks += 1
        if looks == 3:
            ordinary = bench.look
            bench.look = lambda: replace(ordinary(), faults=("the angle sensor does not follow",))  # type: ignore[method-assign]

    r = hold(bench, start(bench), HoldParams(), Silent(), watch=spoil)
    assert r.doubts == ("the angle sensor does not follow",)


def test_a_parked_vehicle_does_not_turn() -> None:
    """What a dead azimuth torquer looks like: the platform turns as the Earth does not, and no flag says so."""
    bench = FakePlatform()
    ordinary, begun = bench.look, start(bench)

    def turning(rate_degph: float) -> HoldResult:
        begun_s = bench.t_s
        bench.look = lambda: _turned(ordinary(), math.radians(rate_degph) / 3600 * (bench.t_s - begun_s))  # type: ignore[method-assign]
        return hold(bench, begun, HoldParams(hours=0.5), Silent())

    (doubt,) = turning(11.5).doubts
    assert re.match(r"the heading moved by -?0\.9\d deg in 300 s of standing", doubt)
    assert turning(0.2).doubts == ()  # a drift that the calibration leaves


@pytest.mark.parametrize(("heading_deg", "doubtful"), [(60.0, False), (75.0, False), (100.0, True), (-110.0, True)])
def test_a_flying_vehicle_heads_along_its_track(heading_deg: float, doubtful: bool) -> None:
    """An angle sensor that stuck before the vehicle turned onto its track shows nothing else; wind may be 20 deg."""
    bench = FakePlatform(heading_deg=heading_deg)
    r = held(bench, HoldParams(hours=0.5, speed_kmh=500.0, track_deg=60.0))
    found = [d for d in r.doubts if d not in r.start.doubts]
    assert bool(found) is doubtful
    if doubtful:
        off_deg = wrapped_deg(heading_deg - 60.0)
        assert found[0].startswith(f"the heading is {off_deg:.0f} deg from the track after 300 s")
    soon = held(bench, HoldParams(hours=0.025, look_s=90.0, speed_kmh=500.0, track_deg=60.0))
    assert soon.doubts == soon.start.doubts  # it may still turn


def _turned(look: Look, by_rad: float) -> Look:
    return replace(look, encoder_rad=look.encoder_rad + by_rad)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"compensate": "all"}, "torquer, axis1, none"),
        ({"look_s": 0.0}, "expected 0 to hours"),
        ({"hours": 0.01}, "expected 0 to hours"),
        ({"speed_kmh": -1.0}, "expected 0 or more"),
    ],
)
def test_params(given: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        HoldParams(**given)  # type: ignore[arg-type]


# ---- grading and report


def section(bench: FakePlatform, error_deg: float = 0.0, hold_error_deg: float = 0.0) -> GyroSection:
    r = held(bench, HoldParams(look_s=1200.0))
    truth = {
        "heading_deg": bench.heading_deg - error_deg,
        "drift1_degph": 25.0,
        "drift2_degph": -12.0,
        "pitch_deg": 5.0,
        "roll_deg": -4.0,
    }
    headings = tuple(bench.heading_deg - hold_error_deg * h.t_s / 14400.0 for h in r.held)
    return GyroSection(
        label="improved",
        result=r.start,
        truth=truth,
        hold=r,
        hold_truth=HeldTruth(heading_deg=headings),
        article=True,
    )


def test_within_limits_and_out_of_them() -> None:
    good, off, lost = (section(FakePlatform(), e, h) for e, h in ((0.0, 0.2), (1.0, 0.0), (0.0, 9.0)))
    assert gyro_grading.within_limits([good])
    assert "All 5 numbers and the heading that was kept" in gyro_grading.verdict([good])
    assert not gyro_grading.within_limits([off])
    assert gyro_grading.verdict([off, good]).startswith("1 of 12 comparisons are not within 2 U of the truth")
    assert not gyro_grading.within_limits([lost])
    assert "OUT OF LIMITS" in gyro_grading.console_table(off)
    assert "met by this run" in gyro_grading.hold_summary(good)
    assert "not met by this run" in gyro_grading.hold_summary(lost)


def test_the_article_s_claims_are_beside_its_own_platform_alone() -> None:
    """What a user's platform is found to be has nothing to do with one simulated run of an article."""
    its = section(FakePlatform(), 0.0, 0.2)
    yours = replace(its, article=False)
    for shown in (gyro_grading.console_table, lambda s: gyro_page.html_page([s], {})):
        assert "article" in shown(its)
        assert "article" not in shown(yours)
    assert "largest error 0.2" in gyro_grading.hold_summary(yours)


def test_a_doubt_is_out_of_limits_whatever_the_truth_says() -> None:
    s = section(FakePlatform())
    doubtful = replace(s, result=replace(s.result, doubts=("no latitude fits",)), hold=None, hold_truth=None)
    assert not gyro_grading.within_limits([doubtful])
    assert "not to be trusted" in gyro_grading.verdict([doubtful])
    assert "DOUBT: no latitude fits" in gyro_grading.console_table(doubtful)


def test_headings_are_compared_around_north() -> None:
    bench = FakePlatform(heading_deg=359.99)
    s = section(bench)
    beyond = replace(s, truth={"heading_deg": 0.01})
    error = next(g.error for g in gyro_grading.grade(beyond) if g.estimate.name == "heading_deg")
    assert error == pytest.approx(-0.02, abs=1e-3)


def test_page_and_data(tmp_path: Path) -> None:
    s = section(FakePlatform(), hold_error_deg=0.1)
    bare = replace(s, label="article", truth=None, hold=None, hold_truth=None)
    page = gyro_page.write(tmp_path, [s, bare], {"seed": "<7>"})
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 5
    assert "&lt;7&gt;" in text
    assert not re.search(r"<script|src=|@import|url\((?!#)", text)  # nothing is loaded from elsewhere
    data = json.loads((tmp_path / "result.json").read_text())
    assert data["within_limits"] is True
    first, second = data["sections"]
    assert [e["name"] for e in first["estimates"]][:4] == ["heading_deg", "alpha1_deg", "drift1_degph", "drift2_degph"]
    assert first["hold"]["error_deg"][-1] == pytest.approx(0.1, abs=1e-4)
    assert len(first["positions"]) == 24
    assert second["hold"] is None
    assert second["estimates"][0]["truth"] is None
    assert gyro_page.html_page([s], {}) == gyro_page.html_page([s], {})


def test_its_report_is_russian_throughout() -> None:
    s = section(FakePlatform(), hold_error_deg=0.1)
    bare = replace(s, label="article", article=False, truth=None, hold=None, hold_truth=None)
    doubtful = replace(bare, result=replace(s.result, doubts=("only 3 of 24 windows count",)))
    ru = load_language("ru")
    assert ru is not None
    for shown in ([s, bare], [bare], [doubtful]):
        ru.translate_page(gyro_page.html_page(shown, {"seed": "7"}))
    assert ru.missing == set()
