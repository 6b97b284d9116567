"""psabench explore, without an emulator: drawing, shrinking, scripts, and what a search has done already."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from psabench.boards.registry import BOARDS
from psabench.campaign.workers import ThisProcess
from psabench.conform.plan import plan_of
from psabench.conform.profile import variant
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Verdict, not_decided
from psabench.errors import BadInput
from psabench.explore import finding, search
from psabench.explore.fault_rules import LINES, NOTHING, READINGS, RULES, VALUES
from psabench.explore.finding import read_schedule, shrink_schedule
from psabench.explore.host_frames import KINDS, Entry, drawn_frames
from psabench.explore.oracle import ALWAYS, HOLDS, LONG_S, Violation, looks_of, must_hold, of_outcome, short_looks
from psabench.explore.play import PLAY, Played
from psabench.explore.schedule import ACTIONS, Action, Catalogue, Schedule, draw_schedule, of_data
from psabench.explore.script import MOST, length_s, script_of
from psabench.explore.search import PART, Log, Part, Search, Task, missing_tasks
from psabench.explore.shrink import shrink_list

ENTRIES = [
    Entry(0x1017, 0, 2, "rw"),
    Entry(0x1008, 0, 0, "const"),
    Entry(0x2020, 0, 1, "rw"),
    Entry(0x1018, 4, 4, "ro"),
]
CATALOGUE = Catalogue(
    board="psa2",
    profile="article",
    node=5,
    entries=ENTRIES,
    points={kind: ["a.somewhere"] for kind in RULES},
    looks=["stream", "registers", "device_type"],
)
SEARCH = Search(board="psa2", profile="article", seed=1, length_s=1.0)


# ---- drawing


def test_a_number_gives_the_same_schedule_and_another_one_another() -> None:
    drawn = [draw_schedule(CATALOGUE, 1, n, 1.0) for n in range(50)]
    assert drawn == [draw_schedule(CATALOGUE, 1, n, 1.0) for n in range(50)]
    assert len({str(s.actions) for s in drawn}) == len({s.seed for s in drawn}) == 50
    assert draw_schedule(CATALOGUE, 2, 0, 1.0).actions != drawn[0].actions


def test_schedules_have_all_actions_faults_and_host_behaviours() -> None:
    drawn = [a for n in range(500) for a in draw_schedule(CATALOGUE, 1, n, 1.0).actions]
    assert {a.do for a in drawn} == set(ACTIONS) == set(PLAY)
    assert {a.args["kind"] for a in drawn if a.do == "fault"} == set(RULES)
    assert {a.args["under"] for a in drawn if a.do == "look"} == {True, False}


def test_every_schedule_ends_with_a_look() -> None:
    assert {draw_schedule(CATALOGUE, 1, n, 1.0).actions[-1].do for n in range(100)} == {"look"}


def test_a_schedule_is_json_and_comes_back(tmp_path: Path) -> None:
    drawn = draw_schedule(CATALOGUE, 1, 4, 1.0)
    path = tmp_path / "schedule.json"
    path.write_text(json.dumps(drawn.data()), encoding="utf-8")
    assert read_schedule(path) == drawn


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "expected a schedule of psabench explore"),
        ('{"actions": []}', "expected a schedule"),
        ('{"actions": [{"text": "605#"}]}', "expected a schedule"),
        ('{"board": 1, "profile": 1, "seed": 1, "number": 1, "length_s": 1, "actions": [{"do": "sing"}]}', "got sing"),
    ],
)
def test_what_is_no_schedule_is_told(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "schedule.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=words):
        read_schedule(path)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_frames_are_frames(kind: Callable[..., list[str]]) -> None:
    rng = random.Random(3)
    for _ in range(200):
        for text in kind(rng, 5, ENTRIES):
            can_id, _, data = text.partition("#")
            assert 0 <= int(can_id, 16) < 0x800
            assert len(bytes.fromhex(data)) <= 8


def test_frames_of_all_kinds_are_drawn() -> None:
    rng = random.Random(3)
    ids = {text.partition("#")[0] for _ in range(300) for text in drawn_frames(rng, 5, ENTRIES)}
    assert {"000", "080", "605"} < ids


# ---- shrinking


@pytest.mark.parametrize("seed", range(20))
def test_what_is_left_fails_and_none_of_it_can_go(seed: int) -> None:
    rng = random.Random(seed)
    items = list(range(rng.randint(1, 60)))
    needed = set(rng.sample(items, rng.randint(1, min(5, len(items)))))
    calls = 0

    def fails(some: Sequence[int]) -> bool:
        nonlocal calls
        calls += 1
        return needed <= set(some)

    assert shrink_list(items, fails) == tuple(sorted(needed)), seed
    assert calls <= 40 * len(needed) + 10, seed


def test_one_that_depends_on_its_order_stays_in_order() -> None:
    assert shrink_list("xaxbxxb", lambda s: "ab" in "".join(c for c in s if c != "x")) == ("a", "b")


def wrong_after(*needed: str) -> Callable[[Schedule], Played]:
    """A player whose board is wrong once these actions were there."""

    def play(schedule: Schedule) -> Played:
        names = [a.args["name"] for a in schedule.actions]
        if set(needed) <= set(names):
            v = Violation(key="k", requirements=("X-01",), saw="1", due="2")
            return Played(violations=(v,), actions=1 + max(names.index(n) for n in needed))
        return Played(actions=len(names))

    return play


def named(names: str) -> Schedule:
    actions = tuple(Action("look", {"name": n}) for n in names)
    return Schedule(board="psa2", profile="article", seed=1, number=0, length_s=1.0, actions=actions)


def test_a_schedule_shrinks_to_what_the_violation_needs() -> None:
    shrunk = shrink_schedule(named("abcdefghij"), "k", wrong_after("c", "g"))
    assert [a.args["name"] for a in shrunk.actions] == ["c", "g"]


def test_one_that_does_not_fail_again_stays_whole() -> None:
    assert shrink_schedule(named("abc"), "another", wrong_after("b")) == named("abc")


# ---- the oracle


@pytest.mark.parametrize("board", BOARDS)
def test_looks_of_a_second_and_longer_ones(board: str) -> None:
    v = variant(board)
    short, long = short_looks(v, 1.0), short_looks(v, 1000.0)
    assert set(short) < set(long)
    assert set(long) - set(short) <= set(LONG_S)
    assert "the_history_holds_eight" in long


def test_what_always_holds_is_a_requirement() -> None:
    assert set(ALWAYS) <= set(requirements().rows)


@pytest.mark.parametrize(
    ("rule", "holds", "may_fail"),
    [
        (VALUES, "xy_and_zt_alternate", "codes_are_volts"),
        (VALUES, "no_such_object", "three_axes_move_together"),
        (LINES, "xy_and_zt_alternate", "a_transfer_has_four_words"),
        (READINGS, "no_such_object", "xy_and_zt_alternate"),
        (NOTHING, "", "no_such_object"),
    ],
)
def test_a_fault_excuses_what_it_breaks_and_nothing_else(rule: str, holds: str, may_fail: str) -> None:
    tests = {
        t.test.__name__: (t, [r.id for r in rows]) for ts in looks_of("psa2", "article").values() for t, rows in ts
    }
    assert not must_hold(*tests[may_fail], [rule])
    assert not holds or must_hold(*tests[holds], [rule])
    assert all(must_hold(*t, []) for t in tests.values())
    assert {r.holds for r in RULES.values()} == set(HOLDS)


@pytest.mark.parametrize(
    ("verdict", "is_found"),
    [
        (Verdict.PASSED, False),
        (Verdict.NOT_OBSERVABLE, False),
        (Verdict.FAILED, True),
        (Verdict.INCONCLUSIVE, True),
    ],
)
def test_what_a_verdict_is_worth(verdict: Verdict, is_found: bool) -> None:
    proof = looks_of("psa2", "article")["stream"][0][0]
    assert plan_of(proof.test).stimulus == "stream"
    outcome = replace(not_decided(proof.test, proof.ids, "stream"), verdict=verdict, saw="1", due="2", reason="3")
    found = of_outcome(outcome)
    assert (found is not None) == is_found
    assert found is None or (found.key, found.requirements) == (proof.test.__name__, proof.ids)


# ---- scripts


def snapshot(*entries: dict[str, object]) -> str:
    rows = [
        {"psabench": "snapshot", "format": 1},
        {"buses": [{"name": "can0"}, {"name": "can1"}], "timeline": [{"at_s": 0.5, "cmd": "head.turn"}]},
        {"t": 0, "bus": 0, "came": 1},
        *entries,
        {"end": 250_000_000, "state": "0"},
        {"sha256": "0"},
    ]
    return "\n".join(map(json.dumps, rows)) + "\n"


def test_inputs_become_a_timeline() -> None:
    text = snapshot(
        {"t": 1_500_000, "bus": 1, "from": 1, "frame": "605#40"},
        {"t": 2_000_000, "ran": True, "cmd": "fault.add", "args": {"kind": "line.stuck"}},
        {"t": 2_000_000, "cmd": "fault.add", "args": {"kind": "no"}, "refused": True},
        {"t": 2_000_001, "unit": 0, "watch": 65535},
    )
    script = script_of(text)
    assert script is not None
    assert script["timeline"] == [
        {"at_s": 0.5, "cmd": "head.turn"},
        {"at_s": 0.0015, "cmd": "can.put", "args": {"frame": "605#40", "bus": "can1"}},
        {"at_s": 0.002, "cmd": "fault.add", "args": {"kind": "line.stuck"}},
    ]
    assert length_s(text) == 0.25


def test_what_a_timeline_cannot_have_gives_no_script() -> None:
    frame = {"t": 1, "bus": 0, "from": 1, "frame": "605#40"}
    assert script_of(snapshot(*[frame] * (MOST - 1))) is not None
    assert script_of(snapshot(*[frame] * MOST)) is None
    assert script_of(snapshot({"t": 1, "unit": 1, "cycle": 3, "write": False, "data": 0, "strobe_ns": 0})) is None


@pytest.mark.parametrize("text", ["", "{}", '{"psabench":"log"}\n{"buses":[]}\n', "no JSON"])
def test_what_is_no_snapshot_is_told(text: str) -> None:
    with pytest.raises(BadInput, match="expected a snapshot"):
        script_of(text)


# ---- a search


def part(task: Task) -> Part:
    """As of a board that violates two things at once in schedule 12, and one of these again in 13 and 17."""
    k, m = (Violation(key=key, requirements=("X-01",), saw="1", due="2") for key in "km")
    mine = range(task.first, task.first + task.count)
    found = tuple((n, v) for n, v in ((12, k), (12, m), (13, m), (17, k)) if n in mine)
    return Part(first=task.first, count=task.count, simulated_s=1.0, found=found)


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[int]:
    """Numbers of the schedules whose findings were kept; nothing is played."""
    numbers: list[int] = []

    def keep(out: Path, schedule: Schedule, v: Violation) -> finding.Finding:
        numbers.append(schedule.number)
        return finding.Finding(violation=v, schedule=schedule, of=3, folder=out / "k")

    monkeypatch.setattr(search, "compute_part", part)
    monkeypatch.setattr(search, "keep_finding", keep)
    monkeypatch.setattr(search, "catalogue_of", lambda *_: CATALOGUE)
    return numbers


def test_a_search_goes_on_where_it_was_ended(kept: list[int], tmp_path: Path) -> None:
    counts = (10, 15, 23, 40)  # 23 leaves a part of which three are done
    runs = [search.run_search(SEARCH, tmp_path, ThisProcess(), count=n) for n in counts]
    assert tuple(r.schedules for r in runs) == counts
    assert [r.times for r in runs[:3]] == [{}, {"k": 1, "m": 1}, {"k": 2, "m": 1}]
    assert kept == [12], "what comes together, or was kept before, is kept once"
    assert [t.first for t in missing_tasks(SEARCH, 40, Log(tmp_path, SEARCH).done, lambda: True)] == []


def test_a_line_that_was_cut_is_played_again(kept: list[int], tmp_path: Path) -> None:
    search.run_search(SEARCH, tmp_path, ThisProcess(), count=10)
    path = tmp_path / search.DONE
    path.write_text(path.read_text(encoding="utf-8")[:-5], encoding="utf-8")
    assert [t.first for t in missing_tasks(SEARCH, 10, Log(tmp_path, SEARCH).done, lambda: True)] == [PART]
    for _ in range(2):  # what is written after the cut is read again
        assert search.run_search(SEARCH, tmp_path, ThisProcess(), count=20).schedules == 20
    assert len(path.read_text(encoding="utf-8").splitlines()) == 1 + 20 // PART


def test_a_search_ends_after_its_findings_and_its_time(kept: list[int], tmp_path: Path) -> None:
    most = search.run_search(SEARCH, tmp_path / "most", ThisProcess(), count=100, most=1)
    none = search.run_search(SEARCH, tmp_path / "time", ThisProcess(), count=None, for_s=0.0)
    assert (most.schedules, none.schedules) == (15, 0)


def test_results_of_another_search_are_left_alone(kept: list[int], tmp_path: Path) -> None:
    search.run_search(SEARCH, tmp_path, ThisProcess(), count=5)
    with pytest.raises(BadInput, match="expected results of the same search"):
        search.run_search(replace(SEARCH, seed=2), tmp_path, ThisProcess(), count=5)


def test_schedule_of_data_keeps_every_field() -> None:
    drawn = draw_schedule(CATALOGUE, 1, 7, 1.0)
    assert of_data(drawn.data()).data() == drawn.data()
