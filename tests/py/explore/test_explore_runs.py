"""psabench explore on emulators: the schedules of a fixed seed pass, and a board that is wrong after a reset is found,
shrunk to what shows it, and shown again by each of the lines that its folder has."""

from __future__ import annotations

import json
import resource
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.bench import Bench
from psabench.boards.registry import BOARDS
from psabench.campaign.workers import ThisProcess
from psabench.conform import dut as dut_module
from psabench.conform.profile import variant
from psabench.explore.fault_rules import LEFT_OUT, RULES
from psabench.explore.finding import keep_finding
from psabench.explore.oracle import Violation
from psabench.explore.play import catalogue_of, play_schedule
from psabench.explore.schedule import Action, Schedule
from psabench.explore.script import length_s
from psabench.explore.search import Search, run_search
from psabench.places import find_emulator

SEED = 23
SCHEDULE_S = 2 * 3600 / 10_000  # of one core
OF_TWO_BOARDS = {"psa2": "article", "receiver": "receiver"}  # and a profile of it
COUNT = {"psa2": 25, "psd1": 15, "pik": 15, "pmka": 15, "gyro": 5, "bins": 10, "receiver": 8}


def search(board: str = "psa2", seed: int = SEED) -> Search:
    return Search(board=board, profile=variant(board).profile, seed=seed, length_s=BOARDS[board].schedule_s)


def processor_s() -> float:
    """Of this process and of the emulators that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


@pytest.mark.parametrize("board", BOARDS)
def test_schedules_of_a_fixed_seed_find_nothing(board: str, tmp_path: Path) -> None:
    """At a pace of 10,000 an hour on two cores."""
    search(board).schedule(0)  # loads the suite
    begun_s = processor_s()
    tally = run_search(search(board), tmp_path, ThisProcess(), count=COUNT[board])
    assert processor_s() - begun_s < SCHEDULE_S * COUNT[board]
    assert tally.times == {}, [f.words() for f in tally.findings.values()]
    assert tally.schedules == COUNT[board]
    assert tally.simulated_s > 0.1 * COUNT[board]


def test_every_kind_of_fault_has_a_rule_or_a_reason() -> None:
    with Bench.start("quiet") as bench:
        kinds = {k["kind"]: {a["name"] for a in k["args"]} for k in bench.faults.kinds()}
    assert set(kinds) == set(RULES) | set(LEFT_OUT)
    for kind, rule in RULES.items():
        assert set(rule.values) <= kinds[kind], kind


def test_the_same_schedule_gives_the_same_to_the_last_frame(tmp_path: Path) -> None:
    schedule = search().schedule(1)
    states = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        play_schedule(schedule, folder)
        states.append((folder / "after.snapshot").read_bytes())
    assert states[0] == states[1]


# ---- a wrong board


@pytest.fixture
def wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """A product that repeats its codes once it has been set up for the second time."""
    plain = dut_module.scenario
    fault = {"kind": "controller.frozen_words", "point": "a.kpsa", "after": "SYNC_A", "count": 2}
    monkeypatch.setattr(dut_module, "scenario", lambda *a, **k: plain(*a, **k) | {"faults": [fault]})


def test_it_is_found_shrunk_and_shown_again(
    wrong: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tally = run_search(search(), tmp_path, ThisProcess(), count=60, most=1)
    (found,) = tally.findings.values()
    actions = found.schedule.actions
    assert [a.do for a in actions][-1] == "look", "what shows it"
    assert len(actions) <= 2 <= found.of, "a reset, which the first of two looks may bring, and what shows it"
    for k in range(len(actions)):
        less = replace(found.schedule, actions=actions[:k] + actions[k + 1 :])
        assert found.violation.key not in [v.key for v in play_schedule(less).violations], f"without action {k + 1}"
    assert {p.name for p in found.folder.iterdir()} >= {"schedule.json", "before.snapshot", "finding.txt"}
    assert cli.main(["explore", "--replay", str(found.folder / "schedule.json")]) == 1
    assert found.violation.words() in capsys.readouterr().out


def test_without_the_wrong_the_same_schedule_passes(
    wrong: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    schedule = storm("000#0105", looks=("stream",))
    assert [v.key for v in play_schedule(schedule).violations]
    monkeypatch.undo()
    assert play_schedule(schedule).violations == ()


@pytest.mark.parametrize("has_fault", [False, True])
def test_a_look_under_a_fault_begins_at_the_defaults(has_fault: bool) -> None:
    """An inhibit time that a storm has left is no violation of the board."""
    inhibit = Action("frame", {"text": "608#2B011803A2140000"})
    values = {"kind": "sensor.bias", "point": "a.sensor.x", "values": {"bias_v": 0.1}, "for_s": 10.0, "fresh": True}
    look = Action("look", {"name": "the_inhibit_time_keeps_tpdos_apart", "under": True})
    actions = (inhibit, *([Action("fault", values)] if has_fault else []), look)
    schedule = Schedule(board="pik", profile="pik", seed=1, number=0, length_s=1.5, actions=actions)
    assert play_schedule(schedule).violations == ()


# ---- the folder of a finding


def storm(*frames: str, looks: tuple[str, ...] = ("device_type",)) -> Schedule:
    """Frames, a fault, a wait, looks."""
    fault = {"kind": "sensor.bias", "point": "a.sensor.x", "values": {"bias_v": 0.1}, "for_s": 0.005}
    fault["fresh"] = False
    actions = [Action("frame", {"text": f}) for f in frames]
    actions += [Action("fault", fault), Action("wait", {"s": 0.01})]
    actions += [Action("look", {"name": name, "under": False}) for name in looks]
    return Schedule(board="psa2", profile="article", seed=1, number=0, length_s=1.0, actions=tuple(actions))


def bus_log(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def test_the_script_puts_the_same_frames_on_the_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In free pace, without a host, to the microsecond."""
    start = Bench.start.__func__  # type: ignore[attr-defined]
    step_log, free_log = tmp_path / "step.log", tmp_path / "free.log"

    def logged(*args: Any, extra: list[str | Path], **how: Any) -> Bench:
        bench: Bench = start(*args, extra=[*extra, "--can", f"log:{step_log}"], **how)
        return bench

    monkeypatch.setattr(Bench, "start", classmethod(logged))
    schedule = storm("000#0105", "605#2F20200001000000", "605#40FF5F0000000000")
    keep_finding(tmp_path, schedule, Violation(key="k", requirements=(), saw="", due=""))
    steps = bus_log(step_log)
    end_s = length_s((tmp_path / "k/after.snapshot").read_text(encoding="utf-8"))
    argv = [str(find_emulator()), str(tmp_path / "k/script.yaml"), "--pace", "free", "--for", f"{end_s:.9f}s"]
    subprocess.run([*argv, "--quiet", "--can", f"log:{free_log}"], check=True, stdout=subprocess.DEVNULL, timeout=60)
    assert len(steps) > 20
    assert bus_log(free_log) == steps


def test_the_snapshot_is_the_bench_before_the_last_action(tmp_path: Path) -> None:
    play_schedule(storm("000#0105"), tmp_path)
    with Bench.restore(tmp_path / "before.snapshot") as bench:
        assert bench.time_s == pytest.approx(0.201)
        assert [f["kind"] for f in bench.faults.list()] == ["sensor.bias"]


# ---- the command


def test_what_is_violated_is_the_exit_status(wrong: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["explore", "--seed", str(SEED), "--schedules", "60", "--findings", "1", "--jobs", "1"]
    assert cli.main([*words, "--out", str(tmp_path)]) == 1
    told = capsys.readouterr().out
    assert "found: " in told
    assert "psabench explore --replay" in told


def test_an_emulator_that_ends_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its process is killed in the middle of a schedule."""
    from psabench.explore import play as module

    def killed(at: Any, s: float) -> None:
        at.s.bench.emulator.signal(9)
        at.s.bench.emulator.wait(10.0)

    monkeypatch.setattr(module, "PLAY", {**module.PLAY, "wait": killed})
    (found,) = play_schedule(storm("000#0105")).violations
    assert found.key == "emulator ends"
    assert "exit status -9" in found.saw


def test_a_catalogue_has_looks_points_and_objects() -> None:
    c = catalogue_of("psa2", "article", 1.0)
    assert "stream" in c.looks
    assert c.node == 5
    assert any(p.startswith("a.line.") for p in c.points["line.stuck"])
    assert not any(p.startswith("client") for points in c.points.values() for p in points)
    assert json.dumps([e.index for e in c.entries])


def test_faults_of_a_receiver_are_drawn_for_no_other_board() -> None:
    """fault.points knows places alone: the controller of each board is one."""
    points = {board: catalogue_of(board, profile, 1.0).points for board, profile in OF_TWO_BOARDS.items()}
    assert not [kind for kind in points["psa2"] if kind.startswith("receiver.")]
    assert {kind: at for kind, at in points["receiver"].items() if kind.startswith("receiver.")} == {
        kind: ["a.solver"] for kind in RULES if kind.startswith("receiver.")
    }


@pytest.mark.parametrize("length_s", [0.02, 0.1])
def test_a_schedule_ends_with_its_time_and_what_it_cut_is_not_judged(wrong: None, length_s: float) -> None:
    """The look would find the wrong after 0.2 s."""
    schedule = replace(storm("000#0105", looks=("stream",)), length_s=length_s)
    played = play_schedule(schedule)
    assert played.time_s == pytest.approx(length_s, abs=1e-9)
    assert played.violations == ()
