"""What the command takes: studies, settings, words that refuse a mistake; and what it prints."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from command_line import QUIET
from psabench import cli
from psabench.campaign import cases, chains, command, emulated, page, report, settings
from psabench.campaign.cases import STUDIES
from psabench.campaign.chains import Wanted
from psabench.campaign.command import Options
from psabench.campaign.runner import Plan
from psabench.campaign.setup import Setup, changed
from psabench.errors import BadInput
from psabench.places import proto_file


def test_settings_change_the_instrument_of_every_study() -> None:
    base = changed(Setup(), ["latitude_deg=60", "angles_deg=0,120,240", "gm_from_zero=yes", "alpha1_deg=12"])
    assert (base.latitude_deg, base.angles_deg, base.gm_from_zero) == (60.0, (0.0, 120.0, 240.0), True)
    assert base.alpha1_deg == 12.0
    assert changed(base, ["alpha1_deg=any"]).alpha1_deg is None
    (own,) = STUDIES["own"].cases(base)
    assert own.setup == base
    r5 = next(c for c in STUDIES["readings"].cases(base) if c.name == "R5")
    assert (r5.setup.gm_sigma_degph, r5.setup.latitude_deg) == (0.02, 60.0)  # a study's own settings win
    p = Plan(cases=[own], chain="closed", runs=10, seed=1)
    assert not report._plain(p)
    assert report._plain(replace(p, cases=list(STUDIES["readings"].cases(Setup()))))


MISTAKES = [
    ("--study stars", "--study: expected readings, sources, step"),
    ("--case R99", "--case: expected R0, R1"),
    ("--runs 0", "--runs: expected 1 to 100000000, got 0"),
    ("--seed 99999999999999999999", "expected 0 to"),
    ("--workers 0", "--workers: expected 1 to 1024, got 0"),
    ("--workers 2 --dask tcp://127.0.0.1:9", "--workers: expected none with --dask"),
    ("--set latitude_deg", "--set: expected NAME=VALUE with a name of latitude_deg, "),
    ("--set latitude=3", "--set latitude=3: expected a setting that --list names (latitude_deg, tilt_deg?)"),
    ("--set moon=3", "--set: expected NAME=VALUE with a name of latitude_deg, "),
    ("--set latitude_deg=x", "--set latitude_deg=x: "),
    ("--set latitude_deg=nan", "expected a number within +-1e12, got "),
    ("--set method=guess", "method: expected closed3, lsq"),
    ("--set gm_from_zero=maybe", "expected yes or no"),
    ("--study own --set latitude_deg=90", "--set latitude_deg=90: case own: "),
    ("--study own --set latitude_deg=86", "latitude beyond 85 degrees"),
    ("--study own --set angles_deg=0,90", "angles_deg=0,90: angles_deg: expected 3 to 64 positions, got 2"),
    ("--set angles_deg=0,0,0", "positions coincide"),
    ("--set angles_deg=0,90,36001", "angles_deg: expected -36000 to 36000 deg, got 36001"),
    ("--set window_s=0", "--set window_s=0: window_s: expected 0.01 to 86400 s, got 0"),
    ("--set tilt_deg=31", "--set tilt_deg=31: tilt_deg: expected 0 to 30 deg, got 31"),
    (
        "--study hold --chain emulated",
        "--chain: expected closed or samples for the hold of 0.1 deg",
    ),
    ("--case R5n --chain wire", "--chain emulated or wire: slew_dps: expected a rate above 0"),
    ("--store README.md", "README.md: expected a store of results"),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_gets_one_line_and_status_2(
    line: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "README.md").write_text("no store, and longer than the hundred bytes of a header would be " * 3)
    monkeypatch.chdir(tmp_path)
    assert cli.main(["campaign", "gyrocompass", *line.split()]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.startswith("psabench: ")  # no bar before it: nothing has been started
    assert err.count("\n") == 1


def test_the_command_prints_computes_once_and_is_quiet_the_second_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["campaign", "gyrocompass", "--study", "hold", "--runs", "3000", "--out", str(tmp_path)]
    assert cli.main(argv) == 0
    first = capsys.readouterr()
    assert "closed form, 1 at once: 13/13 in" in first.err
    assert "0.1 deg and 0.05 deg/h, nothing else" in first.out
    assert "4 of 4 figures lie within their limits." in first.out
    assert cli.main(argv) == 0
    second = capsys.readouterr()
    assert (second.out, second.err) == (first.out, "")
    assert cli.main([*argv, "--fresh"]) == 0
    third = capsys.readouterr()
    assert third.out == first.out
    assert "13/13" in third.err


def test_the_list_names_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["campaign", "gyrocompass", "--list"]) == 0
    out = capsys.readouterr().out
    assert all(f"{s.name}: {s.title}\n" in out for s in STUDIES.values())
    assert re.search(r"  gm_sigma_degph=0.2 +deg/h; random drift, standard deviation of a Gauss-Markov process\n", out)
    assert "(closed3, lsq, constrained, gls, gls_constrained)\n" in out


def test_the_help_teaches_studies_and_settings(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        cli.main(["campaign", "gyrocompass", "--help"])
    out = capsys.readouterr().out
    assert all(s.title in out for s in STUDIES.values())
    assert all(f"  {name}=" in out for name in settings.SETTINGS)


def test_each_setting_has_a_line_and_a_range_that_the_library_takes() -> None:
    assert set(settings.SETTINGS) <= {f.name for f in fields(Setup)}
    for name, s in settings.SETTINGS.items():
        default = getattr(Setup(), name)
        assert settings.out_of_range(Setup(), name) == ""
        if isinstance(default, str | bool) or name == "angles_deg":
            continue
        for value in (s.low, s.high):
            setup = with_value(name, value)
            assert settings.out_of_range(setup, name) == ""
            outwards = math.copysign(1e-3 + 1e-3 * abs(value), value - (s.low + s.high) / 2)
            assert f"{name}: expected " in settings.out_of_range(with_value(name, value + outwards), name)
            wanted = Wanted(chain="closed", setup=setup, hold=None, seed=1, first_run=0, runs=2)
            if name == "latitude_deg":  # the fit's own limit, told in its words
                with pytest.raises(BadInput, match="latitude beyond 85"):
                    chains.compute([wanted])
            else:
                chains.compute([wanted])


def with_value(name: str, value: float) -> Setup:
    return replace(Setup(), **{name: value})  # type: ignore[arg-type]  # numbers only


def test_what_is_beyond_the_closed_form_is_said(tmp_path: Path) -> None:
    o = Options(studies=["own"], runs=100, out=tmp_path)
    beyond = "  own: errors so large are beyond the closed form"
    large = command.campaign(replace(o, settings=["gm_sigma_degph=1000"]), QUIET)
    assert any(line.startswith(beyond) for line in page.console(large))
    assert not any(line.startswith(beyond) for line in page.console(command.campaign(o, QUIET)))


def test_the_improved_procedure_takes_the_time_of_its_turns() -> None:
    """By hand: 24 windows of 5 s; 12 turns of 180 and 11 of 90 deg at 18 or 30 deg/s, 20 deg/s2, 5 s to settle."""
    improved = {c.name: c for c in STUDIES["improved"].cases(Setup())}
    times_s = {name: cases.duration_s(c.setup) for name, c in improved.items()}
    assert times_s["instant"] == 24 * 5 + 23 * 5
    assert times_s["unit"] == pytest.approx(24 * 5 + 3150 / 18 + 23 * (0.9 + 5))
    assert times_s["fast"] == pytest.approx(24 * 5 + 3150 / 30 + 23 * (1.5 + 5))
    assert times_s["4 min"] == pytest.approx(15 * 5 + 14 * (120 / 30 + 1.5 + 5.5))
    unit = improved["unit"].setup
    assert {a % 360 for a in unit.angles_deg} == {0, 90, 180, 270}
    assert max(abs(b - a) for a, b in itertools.pairwise(unit.angles_deg)) == 180  # never the long way
    assert chains.config(unit).settle_s == pytest.approx(5.9)
    assert chains.config(replace(unit, slew_dps2=0.0)).settle_s == 5.0


def test_quick_turns_through_the_wire_have_the_torquers_for_it() -> None:
    def made(name: str) -> dict[str, Any]:
        found = yaml.safe_load(proto_file(f"profiles/{name}.yaml").read_text(encoding="utf-8"))
        assert isinstance(found, dict)
        return found

    slow, fast = made("gyro"), made("gyro_fast")
    assert {k for k in slow if slow[k] != fast[k]} == {"name", "torquer_limit_dps"}
    assert fast["torquer_limit_dps"] == emulated.FAST_LIMIT_DPS > 30.0 / 0.9
    improved = {c.name: c.setup for c in STUDIES["improved"].cases(Setup())}
    at = emulated.instrument(improved["fast"], 1, 0)
    bench = emulated.scenario(improved["fast"], at)
    assert bench["platform"]["torquer_limit_dps"] == emulated.FAST_LIMIT_DPS
    (gyro,) = [u for u in bench["units"] if u["board"] == "gyro"]
    assert (gyro["profile"], gyro["profile_set"]) == ("gyro_fast", {})
    bench = emulated.scenario(improved["unit"], at)
    (gyro,) = [u for u in bench["units"] if u["board"] == "gyro"]
    assert bench["platform"]["torquer_limit_dps"] == gyro["profile_set"]["torquer_limit_dps"] == 20.0
    emulated.check(improved["fast, silent"])
    with pytest.raises(BadInput, match=r"slew_dps2: expected 0 or 20, got 7.0"):
        emulated.check(replace(improved["fast, silent"], slew_dps2=7.0))
