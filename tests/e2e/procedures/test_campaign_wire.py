"""Virtual gyrocompasses, each an emulator, its bus and the host's procedure, beside the algebra; and the two ways to
run them, alone in free pace and live, beside each other."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from psabench.bench import Bench
from psabench.campaign import chains, command, emulated, page
from psabench.campaign.cases import QUIET, STUDIES
from psabench.campaign.chains import CHAINS, Wanted
from psabench.campaign.command import Options
from psabench.campaign.setup import Setup
from psabench.campaign.store import Rows, Store
from psabench.errors import BadInput, DeviceError, LinkError
from psabench.link import can_log
from psabench.places import proto_file
from psabench.procedures import gyrocompass, host_script
from psabench.procedures.head_bench import Silent
from psabench.procedures.recorded_platform import RecordedPlatform
from psabench.procedures.wire_platform import WirePlatform
from psabench.progress import Bar
from scipy import stats

WIRE = {c.name: c for c in STUDIES["wire"].cases(Setup())}
RUNS, SEED = 200, 1  # of the article's mode, declared before they were run
MANY = 1000


@pytest.fixture
def quiet() -> Bar:
    return Bar(Path(os.devnull).open("w"))


@pytest.mark.host
@pytest.mark.timeout(600)
def test_runs_are_the_same_each_time_and_resume(tmp_path: Path, quiet: Bar) -> None:
    """Runs in this process, then more in two processes: the first ones are there already."""
    out = tmp_path / "campaign"
    few, more = CHAINS["emulated"].part_runs, CHAINS["emulated"].part_runs + 4
    command.campaign(Options(case="article", chain="emulated", runs=few, workers=1, seed=9, out=out), quiet)
    origin = chains.origin("emulated", WIRE["article"].setup, None, 9)
    with Store(out / "store.sqlite") as store:
        first = store.rows(origin, few)
    found = command.campaign(Options(case="article", chain="emulated", runs=more, workers=2, seed=9, out=out), quiet)
    with Store(out / "store.sqlite") as store:
        rows = store.rows(origin, more)
    assert np.array_equal(rows[:few], first, equal_nan=True)
    wanted = Wanted(chain="emulated", setup=WIRE["article"].setup, hold=None, seed=9, first_run=few + 3, runs=1)
    assert np.array_equal(chains.compute([wanted])[0].rows, rows[few + 3 :], equal_nan=True)
    heading_deg, drift_degph, quality = rows[:, 1], rows[:, 2], rows[:, 3]
    assert np.all(np.abs(heading_deg) < 0.3)  # six standard deviations
    assert len(set(heading_deg.tolist())) == more
    assert np.all(np.abs(drift_degph) < 0.1)
    assert np.all((quality > 0.0) & (quality < 0.02))
    assert [a.chain for a in found.agreements] == ["emulated"]
    assert found.checks == []  # limits are for the algebra
    text = page.write(out, found).read_text(encoding="utf-8")
    assert "Agreement of the chains" in text


# ---- free pace beside live


@pytest.mark.host
@pytest.mark.timeout(300)
def test_a_recording_of_the_live_bus_gives_the_live_heading_to_the_last_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One run, live; its emulator records the bus; the windows are cut out of the file by the other code."""
    setup = WIRE["article"].setup
    p, at = emulated.params(setup), emulated.instrument(setup, 5, 0)
    path, log = tmp_path / "run.yaml", tmp_path / "bus.log"
    path.write_text(json.dumps(emulated.scenario(setup, at)), encoding="utf-8")
    with Bench.start(path, extra=["--can", f"log:{log}"]) as bench:
        windows = gyrocompass.measure(WirePlatform(bench), p, Silent())
        ended_s = bench.time_s
    recorded = RecordedPlatform(emulated.scenario(setup, at))
    script = recorded._script.bench
    heard = can_log.read(log.read_bytes(), script._listen_to)
    script._recording, script._recorded_s, script.now_s = heard, math.inf, windows[0].t_mid_s - setup.window_s
    monkeypatch.setattr(script, "_send", lambda *_: None)
    recorded._m1_per_s, recorded._latitude_rad = windows[0].m1_per_s, p.latitude_rad
    recorded._script.expect(ended_s - script.now_s, 0.0)
    again = tuple(recorded._windows(p.table.sequence_deg, 1000.0))
    live, cut = gyrocompass.estimate(windows, p), gyrocompass.estimate(again, p)
    assert [len(w.beta_rad) for w in again] == [1000, 1000, 1000]
    assert all(np.array_equal(a.beta_rad, b.beta_rad) for a, b in zip(again, windows, strict=True))
    assert all(np.array_equal(a.encoder_rad, b.encoder_rad) for a, b in zip(again, windows, strict=True))
    assert cut.heading_rad == pytest.approx(live.heading_rad, abs=1e-12)
    assert cut.compass.drift1_radps == pytest.approx(live.compass.drift1_radps, rel=1e-12, abs=0.0)


@pytest.mark.host
@pytest.mark.timeout(300)
def test_both_ways_find_the_same_heading_of_the_same_instrument() -> None:
    """Live, levelling ends when it is seen to be over, alone when its time is up: the windows are not at the same
    instants. So the instrument has neither drift that wanders nor noise; what differs is codes of 1 ug: 0.02 deg."""
    setup = replace(WIRE["article"].setup, gm_sigma_degph=0.0, white_degph_rts=0.0)
    free, live = emulated.runs(emulated.recorded(), setup, 3, 0, 3), emulated.runs(emulated.live, setup, 3, 0, 3)
    assert np.abs(free[:, 1]).max() > 0.02  # its errors are drawn from its seed, and the same
    assert np.abs(free[:, 1] - live[:, 1]).max() < 0.03
    assert np.abs(free[:, 2] - live[:, 2]).max() < 3e-3


@pytest.mark.host
@pytest.mark.timeout(300)
def test_what_the_set_angle_is_in_error_by_has_one_sign_in_all_chains() -> None:
    """A zero of the angle, and what the azimuth loop is off by. Without noise codes of 1 ug leave a run 0.01 deg,
    some 0.05: the middle one of five tells."""
    plain = {**QUIET, "white_degph_rts": 0.0, "angle_sys": "common", "angle_sys_arcmin": 30.0}
    zero = replace(WIRE["article"].setup, **plain)  # type: ignore[arg-type]
    rows = emulated.runs(emulated.recorded(), zero, 2, 0, 5)
    closed = CHAINS["closed"].compute(zero, 2, 0, 100)
    assert closed[:, 1] == pytest.approx(0.5 - 25.0 / 3600.0 / 2.0, abs=1e-4)
    assert np.median(rows[:, 1]) == pytest.approx(closed[0, 1], abs=0.02)
    slow = replace(zero, angle_sys="none", angle_sys_arcmin=0.0, m2_per_s=0.7, drift_degph=200.0)
    rows = emulated.runs(emulated.recorded(), slow, 2, 0, 5)
    assert np.median(rows[:, 1]) == pytest.approx(-200.0 / 3600.0 / 0.7, abs=0.02)
    assert CHAINS["closed"].compute(slow, 2, 0, 1)[0, 1] == pytest.approx(-200.0 / 3600.0 / 0.7, abs=1e-3)


# ---- the same distribution


def rows_of(out: Path, chain: str, runs: int) -> Rows:
    with Store(out / "store.sqlite") as store:
        return store.rows(chains.origin(chain, WIRE["article"].setup, None, SEED), runs)


@pytest.mark.host
@pytest.mark.soak
@pytest.mark.timeout(1500)
def test_two_hundred_runs_and_a_thousand_have_the_distribution_of_the_algebra(tmp_path: Path, quiet: Bar) -> None:
    """Kolmogorov and Smirnov's p above 0.01, of heading and of drift, from PSA-2's codes; 0.1 s of a core each."""
    found = command.campaign(Options(case="article", chain="emulated", runs=MANY, seed=SEED, out=tmp_path), quiet)
    (a,) = found.agreements
    assert (a.runs, a.reference_runs) == (MANY, 20000)
    assert a.p > chains.KS_P
    rows, closed = rows_of(tmp_path, "emulated", MANY), rows_of(tmp_path, "closed", 20000)
    for count in (RUNS, MANY):
        for column, name in ((1, "heading"), (2, "drift")):
            p = stats.ks_2samp(rows[:count, column], closed[:, column]).pvalue
            print(f"{count} runs, {name}: KS p {p:.3f}")
            assert p > chains.KS_P, f"{name} of {count} runs"
    # The comparison can fail: with a tenth of a degree of zero (200 runs show it), or half the error again, it does.
    case = WIRE["article"]
    assert page.agree(case, "emulated", rows[:RUNS] + np.float32(0.1), closed).p < chains.KS_P
    assert page.agree(case, "emulated", rows * np.float32(1.5), closed).p < chains.KS_P


# ---- what is refused, and what fails


@pytest.mark.host
@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("angle_sys=increment", "angle_sys: expected none or common"),
        ("gamma_random_arcmin=5", "the level sensors are alike"),
        ("random_sign=yes", "random_sign: expected no"),
        ("latitude_deg=90", "latitude_deg: expected -90 to 90 deg, got 90.0017"),
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
@pytest.mark.timeout(300)
def test_runs_that_fail_are_nan_and_told_with_their_reasons(tmp_path: Path, quiet: Bar) -> None:
    """The angle sensor sticks before the first turn between windows: the run ends there."""
    own = tmp_path / "stuck.yaml"
    text = proto_file(emulated.SCENARIO).read_text(encoding="utf-8")
    own.write_text(text + "faults:\n  - {kind: platform.encoder_stuck, point: platform.encoder, at_s: 25}\n")
    options = Options(chain="emulated", scenario=own, runs=2, workers=1, out=tmp_path)
    found = command.campaign(options, quiet)
    (figures,) = found.found.values()
    assert figures.refused == 2  # type: ignore[union-attr]
    assert list(found.refusals.values()) == [2]
    assert "stuck" in next(iter(found.refusals))
    assert "no heading, 2 runs: the run ended before position" in "\n".join(page.console(found))


@pytest.mark.host
def test_what_a_unit_refuses_of_the_script_is_told() -> None:
    s = json.loads(emulated.resolved(str(proto_file(emulated.SCENARIO))))
    bench = host_script.ScriptedBench(s, listen_to=frozenset(), bus="can0")
    bench.write("gyro", (9, 0x2100, 1), 1)
    bench.recording(bench.now_s)
    bench.write("gyro", (9, 0x2104, 1), 21.0)
    with pytest.raises(DeviceError, match="2104h:1 = 21: abort 0609003"):
        bench.recording(bench.now_s)
    silent = host_script.ScriptedBench(s, listen_to=frozenset(), bus="can0")
    silent.write("gyro", (17, 0x2104, 1), 1.0)
    with pytest.raises(LinkError, match="node 17: write 2104h:1 = 1: no answer"):
        silent.recording(silent.now_s)


@pytest.mark.host
def test_a_scenario_that_is_none_is_refused_in_the_words_of_the_emulator(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"nonesuch\.yaml"):
        emulated.setup_of(tmp_path / "nonesuch.yaml")
    plain = tmp_path / "plain.yaml"
    plain.write_text("units: [{name: a, board: psa2}]\n")
    with pytest.raises(BadInput, match="a platform, a gyro unit and the PSA-2"):
        emulated.setup_of(plain)


@pytest.mark.host
@pytest.mark.timeout(300)
def test_a_scenario_of_ones_own_is_the_bench_and_the_algebra_beside_it(tmp_path: Path, quiet: Bar) -> None:
    """Another latitude and a platform of other errors: both chains have them."""
    own = tmp_path / "own.yaml"
    text = proto_file(emulated.SCENARIO).read_text(encoding="utf-8")
    own.write_text(
        text.replace("latitude_deg: 50,", "latitude_deg: 60,").replace("gm_sigma_degph: 0.2", "gm_sigma_degph: 0.05")
    )
    setup = emulated.setup_of(own)
    assert (setup.latitude_deg, setup.gm_sigma_degph, setup.torquer_scale) == (60.0, 0.05, 0.0005)
    s = emulated.scenario(replace(setup, m1_per_s=2.0), emulated.instrument(setup, 1, 0))
    assert s["site"]["latitude_deg"] == 60.0
    assert s["platform"]["gm_sigma_degph"] == 0.05
    options = Options(chain="emulated", scenario=own, runs=3, workers=1, out=tmp_path, settings=["m1_per_s=2"])
    found = command.campaign(options, quiet)
    (case,) = found.cases
    assert case.study == "own"
    assert case.setup.m1_per_s == 2.0
    (figures,) = found.found.values()
    assert figures.refused == 0  # type: ignore[union-attr]
    for wrong, why in (
        (replace(options, chain="closed"), "--chain: expected --chain emulated or wire with --scenario"),
        (replace(options, studies=["wire"]), r"--scenario: expected no --case, .*own\.yaml"),
    ):
        with pytest.raises(BadInput, match=why):
            command.campaign(wrong, quiet)


@pytest.mark.host
@pytest.mark.timeout(120)
def test_ctrl_c_leaves_no_emulator_and_no_file(tmp_path: Path) -> None:
    """In the middle of a campaign in one process: it ends with 130, the emulator with it, and nothing is left."""
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    argv = [sys.executable, "-m", "psabench.cli", "campaign", "gyrocompass", "--case", "article", "--chain", "emulated"]
    argv += ["--runs", "100000", "--workers", "1", "--out", str(tmp_path / "out")]
    wanted = Wanted(chain="emulated", setup=WIRE["article"].setup, hold=None, seed=1, first_run=0, runs=1)
    with subprocess.Popen(argv, env=environment, stderr=subprocess.PIPE, text=True) as process:
        done: dict[int, int] = {}
        while not done:
            assert process.poll() is None
            time.sleep(0.05)
            if (tmp_path / "out" / "store.sqlite").exists():
                with Store(tmp_path / "out" / "store.sqlite") as store:
                    done = store.runs(wanted.origin)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert not [p for p in Path("/proc").glob("[0-9]*/environ") if _has(p, f"TMPDIR={tmp_path}")]


def _has(environ: Path, word: str) -> bool:
    try:
        return word.encode() in environ.read_bytes().split(b"\0")
    except OSError:  # it has ended, or is another user's
        return False


@pytest.mark.host
def test_the_instrument_of_a_run_follows_from_seed_and_number() -> None:
    setup = WIRE["article"].setup
    drawn = [emulated.instrument(setup, 1, k) for k in range(200)]
    assert drawn[7] == emulated.instrument(setup, 1, 7)
    assert drawn[7] != emulated.instrument(setup, 2, 7)
    assert len({i.seed for i in drawn}) == 200
    assert max(abs(i.pitch_deg) for i in drawn) <= 5.0
    assert min(i.heading_deg for i in drawn) < -90.0 < 90.0 < max(i.heading_deg for i in drawn)
