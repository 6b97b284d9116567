"""Virtual gyrocompasses through the wire, each an emulator, its bus and the host's procedure, beside the algebra."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from psabench.campaign import chains, command, emulated, page
from psabench.campaign.cases import STUDIES
from psabench.campaign.chains import Wanted
from psabench.campaign.command import Options
from psabench.campaign.setup import Setup
from psabench.errors import BadInput
from psabench.progress import Bar
from psabench.store import Rows, Store

WIRE = {c.name: c for c in STUDIES["wire"].cases(Setup())}
RUNS, SEED = 200, 3  # of the article's mode; other seeds: docs/procedures/gyrocompass_campaign.md


@pytest.fixture
def quiet() -> Bar:
    return Bar(Path(os.devnull).open("w"))


@pytest.mark.host
@pytest.mark.timeout(600)
def test_runs_through_the_wire_are_the_same_each_time_and_resume(tmp_path: Path, quiet: Bar) -> None:
    """Two runs in this process, then four in two processes: the first two are there already."""
    out = tmp_path / "campaign"
    two = Options(case="article", chain="emulated", runs=2, workers=1, seed=9, out=out)
    command.campaign(two, quiet)
    origin = chains.origin("emulated", WIRE["article"].setup, None, 9)
    with Store(out / "store.sqlite") as store:
        first = store.rows(origin, 2)
    four = Options(case="article", chain="emulated", runs=4, workers=2, seed=9, out=out)
    found = command.campaign(four, quiet)
    with Store(out / "store.sqlite") as store:
        rows = store.rows(origin, 4)
    assert np.array_equal(rows[:2], first, equal_nan=True)
    wanted = Wanted(chain="emulated", setup=WIRE["article"].setup, hold=None, seed=9, first_run=3, runs=1)
    assert np.array_equal(chains.compute([wanted])[0].rows, rows[3:], equal_nan=True)
    heading_deg, drift_degph, quality = rows[:, 1], rows[:, 2], rows[:, 3]
    assert np.all(np.abs(heading_deg) < 0.3)  # six standard deviations
    assert len(set(heading_deg.tolist())) == 4
    assert np.all(np.abs(drift_degph) < 0.1)
    assert np.all((quality > 0.0) & (quality < 0.02))
    assert [a.chain for a in found.agreements] == ["emulated"]
    assert found.checks == []  # limits are for the algebra
    text = page.write(out, found).read_text(encoding="utf-8")
    assert "Do the chains agree?" in text


@pytest.mark.host
@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("angle_sys=increment", "its angle sensor has one zero"),
        ("gamma_sys_arcmin=5", "both its level sensors have the same errors"),
        ("random_sign=yes", "the signs of its systematic errors are those given"),
        ("latitude_deg=90", "latitude_deg is 90.0017; it must lie within"),
        ("latitude_deg=89", "latitude beyond 85 degrees"),
    ],
)
def test_what_no_emulator_can_be_told_is_refused_before_any_starts(
    setting: str, reason: str, tmp_path: Path, quiet: Bar
) -> None:
    o = Options(case="literal", chain="emulated", runs=1, out=tmp_path, settings=[setting])
    with pytest.raises(BadInput, match=reason):
        command.campaign(o, quiet)
    assert not list(tmp_path.iterdir())


@pytest.mark.host
@pytest.mark.soak
@pytest.mark.timeout(1500)
def test_two_hundred_runs_through_the_wire_have_the_distribution_of_the_algebra(tmp_path: Path, quiet: Bar) -> None:
    """Kolmogorov and Smirnov's p above 0.01, from PSA-2's codes; about two seconds of a core each."""
    found = command.campaign(Options(case="article", chain="emulated", runs=RUNS, seed=SEED, out=tmp_path), quiet)
    (a,) = found.agreements
    print(f"KS {a.statistic:.4f}, p {a.p:.3f}, rms {a.rms_deg:.4f} and {a.reference_rms_deg:.4f} deg")
    assert (a.runs, a.reference_runs) == (RUNS, 20000)
    assert a.p > chains.KS_P
    rows = emulated_rows(tmp_path)
    # The comparison can fail: with a tenth of a degree of zero, or half the error again, it does.
    _, closed = rows
    assert page.agree(a.case, "emulated", rows[0] + np.float32(0.1), closed).p < chains.KS_P
    assert page.agree(a.case, "emulated", rows[0] * np.float32(1.6), closed).p < chains.KS_P


def emulated_rows(out: Path) -> tuple[Rows, Rows]:
    with Store(out / "store.sqlite") as store:
        setup = WIRE["article"].setup
        return (
            store.rows(chains.origin("emulated", setup, None, SEED), RUNS),
            store.rows(chains.origin("closed", setup, None, SEED), 20000),
        )


@pytest.mark.host
def test_the_instrument_of_a_run_follows_from_seed_and_number() -> None:
    setup = WIRE["article"].setup
    drawn = [emulated.instrument(setup, 1, k) for k in range(200)]
    assert drawn[7] == emulated.instrument(setup, 1, 7)
    assert drawn[7] != emulated.instrument(setup, 2, 7)
    assert len({i.seed for i in drawn}) == 200
    assert max(abs(i.pitch_deg) for i in drawn) <= 5.0
    assert min(i.heading_deg for i in drawn) < -90.0 < 90.0 < max(i.heading_deg for i in drawn)
