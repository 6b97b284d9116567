"""The procedures against a bench in memory whose physics shares no line with the estimators."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from fake_bench import DEFAULT_SEED, SEED, FakeBench, seeded
from psabench.estimate.face import Face
from psabench.estimate.model import Sensor
from psabench.procedures.fourier import FourierParams, estimate_fourier, expected_fourier, fourier
from psabench.procedures.head_bench import HeadBench, Reading, Watch
from psabench.procedures.recording import CsvRecorder, load_csv
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.result import ProcedureResult
from psabench.procedures.reversal import ReversalParams, estimate_reversal, expected_reversal, reversal
from psabench.procedures.turns import TurnsParams, estimate_turns, expected_turns, turns
from psabench.progress import Advance

ARTICLE = Sensor(
    u0_v=2.50,
    alpha0_rad=np.radians(0.1121),
    kx_v_per_g=1.0,
    ky_v_per_g=0.0098,
    kz_v_per_g=0.004,
    kxy_v_per_g2=0.0010,
)
QUADRATIC = replace(ARTICLE, kxx_v_per_g2=3e-4, kyy_v_per_g2=1e-4, kzz_v_per_g2=-2e-4)


def bench_of(s: Sensor, **others: float) -> FakeBench:
    """The in-memory bench carrying this sensor."""
    return FakeBench(
        u0_v=s.u0_v,
        alpha0_deg=float(np.degrees(s.alpha0_rad)),
        k=(s.kx_v_per_g, s.ky_v_per_g, s.kz_v_per_g),
        kxy=s.kxy_v_per_g2,
        k_square=(s.kxx_v_per_g2, s.kyy_v_per_g2, s.kzz_v_per_g2),
        **others,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("face", "angle_deg", "gravity_g"),
    [
        (Face.DIRECT, 270.0, (1, 0, 0)),  # fig. 2, position 1: Ox down reads +g (the text prints -g twice)
        (Face.DIRECT, 90.0, (-1, 0, 0)),
        (Face.DIRECT, 180.0, (0, 1, 0)),  # fig. 3
        (Face.DIRECT, 0.0, (0, -1, 0)),
        (Face.REVERSED, 270.0, (1, 0, 0)),  # Ox is the axis of the turn: it stays
        (Face.REVERSED, 180.0, (0, -1, 0)),
        (Face.SIDE, 270.0, (1, 0, 0)),
        (Face.SIDE, 180.0, (0, 0, 1)),  # fig. 4: Oz is where Oy stood
        (Face.SIDE, 0.0, (0, 0, -1)),
        (Face.SIDE_REVERSED, 180.0, (0, 0, -1)),
    ],
)
def test_gravity_on_the_axes_is_the_table_of_the_bench_module(
    face: Face, angle_deg: float, gravity_g: tuple[float, float, float]
) -> None:
    bench = FakeBench(alpha0_deg=0.0)
    bench.mount(face)
    bench.turn(angle_deg)
    np.testing.assert_allclose(bench.gravity_g(), gravity_g, atol=1e-15)


@pytest.mark.parametrize(
    "s", [ARTICLE, QUADRATIC, replace(ARTICLE, kxy_v_per_g2=-0.001), replace(ARTICLE, alpha0_rad=-0.2)]
)
@pytest.mark.parametrize(
    ("run", "params", "expected"),
    [
        (turns, TurnsParams(), expected_turns),
        (fourier, FourierParams(), expected_fourier),
        (reversal, ReversalParams(), expected_reversal),
    ],
)
def test_without_noise_every_measured_number_is_what_was_to_be_expected(
    s: Sensor,
    run: Callable[[HeadBench, object], ProcedureResult],
    params: object,
    expected: Callable[[Sensor, Sensor], dict[str, float]],
) -> None:
    """All that is not flagged must be right, for quadratic terms, a negative kxy and a large alpha0 too."""
    result = run(bench_of(s, drift_v_per_s=0.0), params)
    want = expected(s, s)
    assert {e.name for e in result.estimates} == set(want)
    wrong = {
        e.name: (e.value, want[e.name])
        for e in result.estimates
        if e.identifiable and abs(e.value - want[e.name]) > 1e-9
    }
    assert not wrong
    assert result.residual_rms_v < 1e-12


def test_quiet_reading_prints_exactly_the_five_printed_digits() -> None:
    """2 nV a reading puts half a printed digit of alpha0 at 6 sd (6 nV, sources instruments 2.3: 96 % of runs)."""
    result = fourier(FakeBench(noise_v=2e-9, rng=seeded("quiet")), FourierParams())
    printed = [
        f"{result.get('u0_v').value:.2f}",
        f"{result.get('alpha0_deg').value:.4f}",
        f"{result.get('kx_v_per_g').value:.1f}",
        f"{result.get('ky_v_per_g').value:.4f}",
        f"{result.get('kxy_v_per_g2').value:.4f}",
    ]
    assert printed == ["2.50", "0.1121", "1.0", "0.0098", "0.0010"]


def test_alpha0_within_10_percent_in_80_percent_of_200_runs_at_2_uv() -> None:
    """The issue's figure, through the whole procedure.

    The share is 0.831 (test_estimate_uncertainty holds it to a percent for any seed), so one fair sample of 200 in
    eight has fewer than 160: other seeds than the default are held to 4 sd below 166.
    """
    rng = seeded("200_runs")
    p = FourierParams(drift=False)
    runs = (fourier(FakeBench(noise_v=2e-6, rng=rng), p) for _ in range(200))
    good = sum(abs(r.get("alpha0_deg").value / 0.1121 - 1) < 0.1 for r in runs)
    print(f"{good} of 200 within 10 %")
    assert good >= (160 if SEED == DEFAULT_SEED else 145)


def test_realistic_noise_takes_the_flags_down_and_leaves_the_measured_set_up() -> None:
    result = fourier(FakeBench(noise_v=1e-3, rng=seeded("realistic")), FourierParams(quadratic_bound_v_per_g2=1e-7))
    flagged = {e.name for e in result.estimates if not e.identifiable}
    assert flagged == {"alpha0_deg", "kx_v_per_g", "ky_v_per_g", "kxy_v_per_g2"}
    assert "wider than the value" in result.get("alpha0_deg").reason
    assert result.correlation.between("alpha0_deg", "ky_v_per_g") < -0.999


def test_a_bound_from_the_reversal_takes_the_flag_of_quiet_alpha0_back() -> None:
    quiet = fourier(FakeBench(noise_v=6e-9, rng=seeded("bound")), FourierParams())
    assert "cannot exclude" in quiet.get("alpha0_deg").reason
    pair = reversal(FakeBench(noise_v=2e-6, rng=seeded("bound_reversal")), ReversalParams())
    assert pair.quadratic_bound_v_per_g2 < 2e-6
    p = FourierParams(quadratic_bound_v_per_g2=pair.quadratic_bound_v_per_g2)
    assert all(e.identifiable for e in estimate_fourier(quiet.readings, p, quiet.g_mps2).estimates)


def test_reversal_is_immune_to_quadratic_terms_that_throw_one_face() -> None:
    one = fourier(bench_of(QUADRATIC), FourierParams())
    assert abs(one.get("alpha0_deg").value - 0.1121) > 4.0
    pair = reversal(bench_of(QUADRATIC), ReversalParams())
    assert pair.get("alpha0_deg").value == pytest.approx(0.1121, abs=1e-9)
    assert pair.get("kxx_minus_kyy_v_per_g2").value == pytest.approx(2e-4, abs=1e-12)
    assert pair.get("kz_v_per_g").value == pytest.approx(0.004, abs=1e-12)


@pytest.mark.parametrize("remount_arcsec", [10.0, 60.0])
def test_remounting_repeatability_limits_the_reversal(remount_arcsec: float) -> None:
    """Two mountings, each off by sd r: alpha0 errs by r/sqrt(2). (One, r/2: 0.0014 deg, sources instruments 2.4.)"""
    rng = seeded("remount")
    p = ReversalParams(realisations=1, positions=16, step_deg=22.5, side=False, drift=False)
    runs = (reversal(FakeBench(remount_arcsec=remount_arcsec, rng=rng), p) for _ in range(400))
    sd_deg = np.std([r.get("alpha0_deg").value for r in runs])
    assert sd_deg == pytest.approx(remount_arcsec / 3600 / np.sqrt(2), rel=0.15)  # 4 sd


def test_remounting_that_does_not_repeat_is_said() -> None:
    quiet = reversal(FakeBench(noise_v=2e-6, rng=seeded("repeat")), ReversalParams())
    assert not any("alpha0 of the side pair" in n for n in quiet.notes)
    loose = reversal(FakeBench(noise_v=2e-6, remount_arcsec=20, rng=seeded("repeat")), ReversalParams())
    assert any("alpha0 of the side pair" in n for n in loose.notes)


@pytest.mark.parametrize("run", [fourier, reversal])
def test_drift_of_50_uv_over_a_turn_is_taken_out(run: Callable[..., ProcedureResult]) -> None:
    params = FourierParams if run is fourier else ReversalParams
    bench = FakeBench(drift_v_per_s=50e-6 / 80)
    with_column = run(bench, params())
    assert with_column.get("alpha0_deg").value == pytest.approx(0.1121, abs=1e-6)
    assert with_column.drift is not None
    assert with_column.drift.value == pytest.approx(50e-6 / 80, rel=1e-6)
    if run is fourier:
        one_turn = fourier(FakeBench(drift_v_per_s=50e-6 / 80), FourierParams(realisations=1, drift=False))
        assert one_turn.get("alpha0_deg").value == pytest.approx(0.280, abs=0.02)  # sources instruments 2.3


def test_setting_error_that_the_head_shows_does_not_matter() -> None:
    rng = seeded("setting")
    got = fourier(FakeBench(setting_error_deg=0.05, rng=rng), FourierParams())
    assert got.get("alpha0_deg").value == pytest.approx(0.1121, abs=1e-8)
    ky = turns(FakeBench(setting_error_deg=10 / 3600, rng=rng), TurnsParams()).get("ky_sum_v_per_g")
    assert ky.value == pytest.approx(0.0117564, abs=1e-6)  # uncorrected, 10" would cost 15 uV


def test_24_bit_steps_are_seen_as_lack_of_fit_or_drowned_in_noise() -> None:
    """1.192 uV a code at the load: without dither the same error returns each turn and the intervals are too short."""
    p = FourierParams(drift=False)
    stepped = fourier(FakeBench(noise_v=6e-9, lsb_v=1.192e-6), p)
    assert any("repeats from turn to turn" in n for n in stepped.notes)
    dithered = fourier(FakeBench(noise_v=2e-6, lsb_v=1.192e-6, rng=seeded("dither")), p)
    assert not any("repeats from turn to turn" in n for n in dithered.notes)


def test_test_turns_return_the_sum_that_contains_alpha0_and_say_so() -> None:
    """sources instruments 2.3: the apparent ky is 0.011756, not 0.0098."""
    result = turns(FakeBench(), TurnsParams())
    ky = result.get("ky_v_per_g")
    assert ky.value == pytest.approx(0.011756, abs=1e-6)
    assert not ky.identifiable
    assert "kx sin alpha0" in ky.reason


def test_search_for_the_extreme_returns_the_hypotenuse_and_leaves_10_uv_in_u0() -> None:
    """sources instruments 2.3: max/min search gives 1.000048, and not 1.0."""
    result = turns(FakeBench(kxy=1e-3), TurnsParams(search_deg=2.0, realisations=2, readings=1))
    assert result.get("kx_v_per_g").value == pytest.approx(1.000048, abs=1e-6)
    assert abs(result.get("u0_v").value - 2.5) == pytest.approx(10e-6, abs=2.5e-6)


def test_intervals_of_test_turns_cover() -> None:
    rng = seeded("turns_coverage")
    want = expected_turns(ARTICLE, ARTICLE)
    hits = []
    for _ in range(1500):
        result = turns(FakeBench(noise_v=1e-3, rng=rng), TurnsParams(readings=1))
        hits.append([abs(e.value - want[e.name]) <= e.ci_half for e in result.estimates if e.identifiable])
    share = np.mean(hits, axis=0)
    print(share)
    assert ((share > 0.93) & (share < 0.97)).all()  # 0.95 +- 0.0056


def test_interrupted_run_keeps_its_readings_and_they_can_be_estimated(tmp_path: Path) -> None:
    """Ctrl-C in reading 1000 of a reversal: direct, reversed and half of the third face are on disk."""
    path = tmp_path / "readings.csv"
    bench = FakeBench(noise_v=1e-6, stop_after=1000, rng=seeded("ctrl_c"))
    with CsvRecorder(path) as record, pytest.raises(KeyboardInterrupt):
        reversal(bench, ReversalParams(), Watch(record=record))
    kept = load_csv(path)
    assert len(kept) == 1000
    result = estimate_reversal(kept, ReversalParams(), bench.g_mps2)
    assert result.get("alpha0_deg").value == pytest.approx(0.1121, abs=1e-4)
    assert any(n.startswith("no kz") for n in result.notes)


def test_each_reading_is_on_disk_before_the_next_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    on_disk: list[int] = []
    with CsvRecorder(path) as record:

        def look(r: Reading) -> None:
            record(r)
            on_disk.append(len(load_csv(path)))

        turns(FakeBench(), TurnsParams(realisations=2, readings=2), Watch(record=look))
    assert on_disk == list(range(1, 25))


def test_readings_of_one_position_count_once_because_the_filter_correlates_them() -> None:
    """Noise common to the 4 readings of a position: as independent rows they would halve the interval."""

    class Sticky(FakeBench):
        def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
            return np.repeat(super().read(axis, 1), readings)

    one = fourier(FakeBench(noise_v=1e-3, rng=np.random.default_rng(1)), FourierParams(drift=False))
    four = fourier(Sticky(noise_v=1e-3, rng=np.random.default_rng(1)), FourierParams(drift=False, readings=4))
    assert len(four.readings) == 4 * len(one.readings)
    for a, b in zip(one.estimates, four.estimates, strict=True):
        assert b.ci_half == pytest.approx(a.ci_half, rel=1e-6)


def test_recorded_readings_come_back_to_the_bit_and_a_torn_last_row_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    with CsvRecorder(path) as record:
        result = fourier(FakeBench(noise_v=1e-3, rng=seeded("csv")), FourierParams(), Watch(record=record))
    assert load_csv(path) == result.readings
    path.write_text(path.read_text()[:-7])
    assert load_csv(path) == result.readings[:-1]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", ":1: expected the columns"),
        ("a,b\n", ":1: expected"),
        ("{header}\n1,direct,0\n", ":2:"),
        ("{header}\n1,upside,0,0,x,0,2.5\n", "upside"),
    ],
)
def test_a_file_that_is_not_a_recording_is_refused_with_its_line(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(text.replace("{header}", "t_s,face,set_deg,alpha_deg,axis,realisation,u_v"))
    with pytest.raises(ValueError, match=why):
        load_csv(path)


@pytest.mark.parametrize(
    ("estimate", "why"),
    [
        (
            lambda r: estimate_fourier(r, FourierParams(), 9.81),
            "face direct: expected at least 7 readings for 6 unknowns and a residual, got 5",
        ),
        (
            lambda r: estimate_reversal(r, ReversalParams(), 9.81),
            "face direct: expected at least 7 readings for 6 unknowns and a residual, got 5",
        ),
        (
            lambda r: estimate_turns(r, TurnsParams(), 9.81),
            "expected at least 2 complete realisations of the x pair, got 0",
        ),
    ],
)
def test_too_few_readings_are_refused_with_the_count(estimate: Callable[[list[Reading]], object], why: str) -> None:
    taken: list[Reading] = []
    with pytest.raises(KeyboardInterrupt):
        fourier(FakeBench(stop_after=5), FourierParams(), Watch(record=taken.append))
    with pytest.raises(ValueError, match=why):
        estimate(taken)


def test_progress_counts_every_position_of_every_face() -> None:
    told: dict[str, list[int]] = {}

    class Counter:
        @contextmanager
        def step(self, name: str, total: int) -> Iterator[Advance]:
            told[name] = [0, total]

            def done(note: str = "") -> None:
                del note
                told[name][0] += 1

            yield done

    reversal(FakeBench(), ReversalParams(realisations=2), Watch(progress=Counter()))
    turns(FakeBench(), TurnsParams(), Watch(progress=Counter()))
    assert len(told) == 6
    assert all(done == total for done, total in told.values())


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: FourierParams(axis="w"), "axis: expected x, y or z, got 'w'"),
        (lambda: FourierParams(positions=3), "positions: expected at least 6, got 3"),
        (lambda: FourierParams(step_deg=0.0), "step_deg: expected 0 to 180 deg, either way, got 0.0"),
        (lambda: FourierParams(dwell_s=-1.0), "dwell_s: expected 0 or more, got -1.0"),
        (lambda: ReversalParams(realisations=0), "realisations: expected at least 1, got 0"),
        (lambda: TurnsParams(realisations=1), "at least 2"),
        (lambda: TurnsParams(search_deg=45.0), "search_deg: expected 0 to 10 deg"),
    ],
)
def test_parameters_out_of_range_are_refused_with_the_range(make: Callable[[], object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        make()


def test_registry_names_procedures_whose_options_explain_themselves() -> None:
    assert set(PROCEDURES) == {"turns", "fourier", "reversal"}
    for p in PROCEDURES.values():
        assert all(f.metadata["help"] for f in fields(p.params))
        result = p.run(FakeBench(noise_v=1e-6), p.params())
        again = p.estimate(result.readings, p.params(), result.g_mps2)
        assert again.estimates == result.estimates
        assert set(p.expected(ARTICLE, ARTICLE)) == {e.name for e in result.estimates}


class SlippingBench(FakeBench):
    """Each turn leaves the mount slip_deg short of the scale, one after another."""

    slip_deg = 0.02

    def turn(self, angle_deg: float) -> float:
        self.slipped_deg = getattr(self, "slipped_deg", 0.0) + self.slip_deg
        super().turn(angle_deg - self.slipped_deg)
        return angle_deg


@pytest.mark.parametrize(
    ("run", "params"), [(fourier, FourierParams()), (reversal, ReversalParams())], ids=["fourier", "reversal"]
)
def test_a_head_that_slips_makes_the_intervals_doubtful(
    run: Callable[[HeadBench, object], ProcedureResult], params: object
) -> None:
    """More positions than unknowns: scale and codes belong to different angles. `turns` has no such redundancy."""
    assert run(FakeBench(noise_v=1e-6, rng=seeded("slip")), params).doubts == ()
    assert run(SlippingBench(noise_v=1e-6, rng=seeded("slip")), params).doubts
