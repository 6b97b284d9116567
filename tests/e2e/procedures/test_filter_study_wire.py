"""PSA-2's filter through the wire: zero by rate, gain and phase; interference where the sampling puts it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from psabench import Bench
from psabench.estimate import allan
from psabench.procedures import filter_study as fs

pytestmark = pytest.mark.host

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
ZERO_S = 40.0


@pytest.fixture(scope="module")
def zeros() -> dict[tuple[int, int], fs.Zero]:
    out = {}
    for setting in (fs.Setting(rate_hz=250), fs.Setting(rate_hz=500), fs.Setting(rate_hz=250, gain=8)):
        with Bench.start(EXAMPLES / "filter_study_drift.yaml") as bench:
            out[setting.rate_hz, setting.gain] = fs.zero_of(bench, setting, ZERO_S, (0.4, 1.0, 30.0))
    return out


def test_a_reading_has_the_published_noise_and_its_means_that_of_white_noise(
    zeros: dict[tuple[int, int], fs.Zero],
) -> None:
    for z in zeros.values():
        assert z.rms_v[0] == pytest.approx(z.setting.noise_v, rel=0.05)
        for i, tau_s in enumerate((0.4, 1.0)):
            want = pytest.approx(allan.of_white(z.setting.density_v_rthz, tau_s), rel=0.25)
            assert z.allan_v[i, 0] == want
        assert math.isnan(z.allan_v[2, 0])  # 40 s are too short for it


def test_the_gain_lessens_the_noise_of_the_mean_and_the_rate_does_not(zeros: dict[tuple[int, int], fs.Zero]) -> None:
    slow, fast, fine = zeros[250, 2], zeros[500, 2], zeros[250, 8]
    assert fast.rms_v[0] / slow.rms_v[0] == pytest.approx(2.0**0.5, rel=0.05)
    assert fast.allan_v[0, 0] / slow.allan_v[0, 0] == pytest.approx(1.0, rel=0.25)
    assert fine.allan_v[0, 0] / slow.allan_v[0, 0] < 0.45


def test_the_mains_pass_every_setting(zeros: dict[tuple[int, int], fs.Zero]) -> None:
    for z in zeros.values():
        assert z.rms_v[2] == pytest.approx(1e-3 / 2.0**0.5, rel=0.01)


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    with Bench.start(EXAMPLES / "filter_study_interference.yaml") as bench:
        yield bench


def test_tones_are_seen_where_and_as_large_as_the_published_response_says(bench: Bench) -> None:
    hz = (1_650.0, 1_023_950.0, 2_048_050.0)
    found = fs.tones(bench, fs.Setting(rate_hz=4000), hz, amplitude_v=0.1, count=800)
    assert [t.seen_hz for t in found] == [1650.0, 50.0, 50.0]
    for t in found:
        for unit in fs.UNITS:
            assert t.seen_v[unit] == pytest.approx(t.predicted_v[unit], rel=5e-3)
    assert found[1].seen_v["bare"] == pytest.approx(0.1, rel=1e-3)  # the filter does nothing
    assert found[1].seen_v["filtered"] == pytest.approx(0.1 * 10.0 / 1024.0, rel=0.01)


def test_the_stop_band_leaves_nothing(bench: Bench) -> None:
    (t,) = fs.tones(bench, fs.Setting(rate_hz=4000), (3_950.0,), amplitude_v=0.1, count=800)
    for unit in fs.UNITS:
        assert t.predicted_v[unit] < 1e-9
        assert t.seen_v[unit] < 5.0 * t.floor_v
