"""`psabench run koi-season`, `koi replay`: short flights over the wire, a passport that grows, programs that end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.koi.flight_log import read_log
from psabench.koi.wire import season
from psabench.koi.wire.feed import FlightFeed
from psabench.koi.wire.nav_pvt import Solution
from psabench.koi.wire.recording import Look
from psabench.passport.store import PassportStore

pytestmark = pytest.mark.host

ROOT = Path(__file__).parents[3]
SHORT = ROOT / "examples/koi/short_flight.yaml"
Lines = pytest.CaptureFixture[str]
# Ends itself without a word in the middle of the second flight, as a computer does that loses its supply.
KILLED = """
import os, signal, sys
from psabench import cli
from psabench.koi.wire.feed import FlightFeed
look, looks = FlightFeed.look, [0]
def counted(self, at, found=None):
    looks[0] += self.grid.now_s < 1.0
    if looks[0] > FIRST and self.grid.now_s > 150.0:
        os.kill(os.getpid(), signal.SIGKILL)
    look(self, at, found)
FlightFeed.look = counted
FIRST = int(sys.argv[1])
sys.exit(cli.main(sys.argv[2:]))
"""


def words(out: Path, flights: int, *more: str) -> list[str]:
    given = ["--routes", str(SHORT), "--align-s", "120", "--flights", str(flights), "--out", str(out)]
    return ["run", "koi-season", *given, "--store", str(out / "p.sqlite"), *more]


def numbers(out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((out / "result.json").read_text())["flights"]
    return found


def test_a_season_that_is_killed_goes_on(tmp_path: Path, capsys: Lines) -> None:
    """After a flight the passport has learned; the second is killed, and no part of it is in the passport."""
    cut = tmp_path / "cut"
    assert cli.main(words(cut, 1)) == 0
    first = numbers(cut)
    with PassportStore(cut / "p.sqlite", read_only=True) as store:
        before = read_log(store, "SP-1")
    done = subprocess.run([sys.executable, "-c", KILLED, "0", *words(cut, 2)], capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    with PassportStore(cut / "p.sqlite", read_only=True) as store:
        after = read_log(store, "SP-1")
    assert len(after.events) == len(before.events) == 1
    assert len(after.incomplete) == 1
    assert (cut / "flight-002/can.log").stat().st_size > 1_000_000
    assert not (cut / "flight-002/result.json").exists()
    capsys.readouterr()
    assert cli.main(words(cut, 2)) == 0
    said = capsys.readouterr().out
    assert "unit SP-1: 2 flights, 1 cut off, 2 with weight" in said
    rows = numbers(cut)
    assert [r["number"] for r in rows] == [1, 3]
    assert rows[:1] == first
    assert all(r["weight"] > 0.0 for r in rows)


def test_ctrl_c_leaves_the_flight_incomplete(tmp_path: Path, capsys: Lines, monkeypatch: pytest.MonkeyPatch) -> None:
    look = FlightFeed.look

    def interrupted(self: FlightFeed, at: Look, found: list[Solution] | None = None) -> None:
        if self.grid.now_s > 20.0:
            raise KeyboardInterrupt
        look(self, at, found)

    monkeypatch.setattr(FlightFeed, "look", interrupted)
    assert cli.main(words(tmp_path, 1)) == 130
    assert "the same command goes on with the next one" in capsys.readouterr().err
    with PassportStore(tmp_path / "p.sqlite", read_only=True) as store:
        log = read_log(store, "SP-1")
    assert (log.events, len(log.incomplete)) == ((), 1)


def test_estimates_help_the_flights_after_them(tmp_path: Path, capsys: Lines) -> None:
    """Two flights; what the first has found, on both; a passport and a flight that are not there."""
    assert cli.main(words(tmp_path, 2)) == 0
    folders = [str(tmp_path / f"flight-00{k}") for k in (1, 2)]
    capsys.readouterr()
    given = ["--with-estimates", f"{tmp_path / 'p.sqlite'}@1", "--align-s", "120"]
    assert cli.main(["koi", "replay", *folders, *given]) == 0
    first, second, rms = capsys.readouterr().out.splitlines()
    assert first.endswith("its own estimates, or later ones, are among them")
    assert second.endswith("m with estimates")
    assert rms.startswith("rms of 2: ")
    assert float(rms.split()[-2]) > 1.1
    for wrong, said in (
        ([*folders, "--with-estimates", "none@1"], "none: expected a store of passports, got none"),
        ([*folders, "--with-estimates", f"{tmp_path / 'p.sqlite'}@7"], "expected a flight of 0 to 2, got 7"),
        ([*folders, *given, "--unit", "SP-9"], "expected one of SP-1, got SP-9"),
        ([str(tmp_path), *given], "expected a recorded flight with truth.jsonl, got none"),
    ):
        assert cli.main(["koi", "replay", *wrong]) == 2
        assert said in capsys.readouterr().err


def test_routes_take_turns_and_errors_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without flying: what is set up. The persistent errors are the same, the seeds are not."""
    flown = list[tuple[str, int | None]]()

    class Stop(BaseException):  # which the command does not take for a fault of its own
        pass

    def flies(options: Any, *_: Any, **__: Any) -> None:
        flown.append((options.scenario.read_text(), options.seed))
        raise Stop

    monkeypatch.setattr(season, "run_flight", flies)
    for _ in range(3):
        with pytest.raises(Stop):
            cli.main(words(tmp_path, 3, "--routes", f"{SHORT},koi_flight"))
    (a, b, c), seeds = (text for text, _ in flown), [seed for _, seed in flown]
    assert a == c
    assert ("snake_s" in a, "snake_s" in b) == (False, True)
    profiles = [[line for line in text.splitlines() if "- " in line and "e-" in line][-24:] for text in (a, b)]
    assert profiles[0] == profiles[1]
    assert len(set(seeds)) == 3
