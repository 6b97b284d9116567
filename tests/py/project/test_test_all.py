"""`make test` adds up honestly: runners' closing lines are counted, and no failure gets past the last line."""

import importlib.util
import itertools
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

PATH = Path(__file__).parents[3] / "tools/test_all.py"


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("test_all_tool", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        ("===== 5 passed in 0.42s =====", (5, 0, 0)),
        ("5 passed in 0.42s", (5, 0, 0)),
        ("== 1 failed, 4 passed, 2 skipped, 7 deselected in 121.02s (0:02:01) ==", (4, 1, 2)),
        (
            "\x1b[31m== \x1b[1m1 failed\x1b[0m, \x1b[32m4 passed\x1b[0m\x1b[31m in 1.02s\x1b[0m\x1b[31m ==\x1b[0m",
            (4, 1, 0),
        ),
        ("= 3 passed, 2 errors in 1.0s =", (3, 2, 0)),
        ("= 3 passed, 1 error in 1.0s =", (3, 1, 0)),
        ("= 3 passed, 1 xfailed, 1 xpassed, 2 warnings in 1.0s =", (3, 1, 1)),
        ("= no tests ran in 0.01s =", (0, 0, 0)),
        ("[  PASSED  ] 12 test(s).", (12, 0, 0)),
        ("[  FAILED  ] 2 test(s), listed below:", (0, 2, 0)),
        ("[  SKIPPED ] 1 test(s), listed below:", (0, 0, 1)),
        ("[  FAILED  ] name_of_a_test", (0, 0, 0)),
        ("[==========] 12 test(s) run.", (0, 0, 0)),
        ("check: 12 passed, 1 failed, 2 skipped", (12, 1, 2)),
        ("the test says: 5 passed in the street", (0, 0, 0)),
    ],
)
def test_closing_lines_are_counted(tool: ModuleType, line: str, counts: tuple[int, int, int]) -> None:
    outcome = tool.Outcome("x")
    outcome.read(line + "\n")
    assert (outcome.passed, outcome.failed, outcome.skipped) == counts


SAY = [sys.executable, "-c"]


@pytest.mark.parametrize(
    ("what", "steps", "last", "status"),
    [
        (
            "all well",
            ["print('= 2 passed in 1.0s =')", "print('[  PASSED  ] 3 test(s).')"],
            "5 passed, 0 failed, 0 skipped",
            0,
        ),
        (
            "a failed test",
            ["print('= 1 failed, 2 passed in 1.0s ='); exit(1)", "print('[  PASSED  ] 3 test(s).')"],
            "5 passed, 1 failed, 0 skipped",
            1,
        ),
        (
            "a crash that no runner counted",
            ["print('= 2 passed in 1.0s ='); exit(9)"],
            "2 passed, 1 failed, 0 skipped",
            1,
        ),
        ("a failure under status 0", ["print('= 1 failed, 1 passed in 1.0s =')"], "1 passed, 1 failed, 0 skipped", 1),
        ("nothing ran", ["pass"], "0 passed, 0 failed, 0 skipped", 1),
        (
            "a hang",
            ["print('= 2 passed in 1.0s =', flush=True); import time; time.sleep(60)"],
            "2 passed, 1 failed, 0 skipped",
            1,
        ),
    ],
)
def test_the_last_line_and_the_status(
    tool: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    what: str,
    steps: list[str],
    last: str,
    status: int,
) -> None:
    monkeypatch.setattr(tool, "LOGS", tmp_path)
    monkeypatch.setattr(tool, "STEPS", [tool.Step(f"step {n}", [*SAY, code], 2.0) for n, code in enumerate(steps)])
    assert tool.main([]) == status, what
    assert capsys.readouterr().out.splitlines()[-1] == last
    assert len(list(tmp_path.glob("*.log"))) == len(steps)


@pytest.fixture
def said(
    tool: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., tuple[int, list[str]]]:
    """Runs steps in two lanes, [name, code] each, and gives the status and what was printed."""
    monkeypatch.setattr(tool, "LOGS", tmp_path / "logs")
    monkeypatch.setattr(tool, "LANES", 2)

    def run(*steps: tuple[str, str]) -> tuple[int, list[str]]:
        made = [tool.Step(name, [*SAY, code, str(tmp_path)], 60.0, beside=True) for name, code in steps]
        monkeypatch.setattr(tool, "STEPS", made)
        return tool.main([]), capsys.readouterr().out.splitlines()

    return run


# Two that wait for each other end only if both run at once.
MEET = """
import os, pathlib, sys, time
here = pathlib.Path(sys.argv[1])
def tell(what): (here / what).touch()
def wait(what):
    while not (here / what).exists(): time.sleep(0.01)
"""
FIRST = MEET + "print('first 1', flush=True); tell('a'); wait('b'); print('first 2'); {}"
SECOND = MEET + "print('second 1', flush=True); wait('a'); print('second 2', flush=True); {} tell('b')"
PASS, FAIL = "print('= 1 passed in 1.0s =');", "print('= 1 failed in 1.0s ='); tell('b'); sys.exit(1);"


@pytest.mark.parametrize(
    ("first", "second", "last", "status"),
    [
        (PASS, PASS, "3 passed, 0 failed, 0 skipped", 0),
        (FAIL, PASS, "2 passed, 1 failed, 0 skipped", 1),
        (PASS, FAIL, "2 passed, 1 failed, 0 skipped", 1),
    ],
)
def test_a_failure_in_either_lane_is_named(
    said: Callable[..., tuple[int, list[str]]], first: str, second: str, last: str, status: int
) -> None:
    found, lines = said(("one", FIRST.format(first)), ("two", SECOND.format(second)), ("three", PASS))
    assert (found, lines[-1]) == (status, last)
    verdicts = {"ok": 0, "FAILED": 1}
    rows = [line.split()[:2] for line in lines if line.split()[1:2] and line.split()[1] in verdicts]
    assert rows == [
        ["one", "FAILED" if first == FAIL else "ok"],
        ["two", "FAILED" if second == FAIL else "ok"],
        ["three", "ok"],
    ]


def test_a_step_that_waits_takes_no_lane(
    tool: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It ends when the second of the one lane has run."""
    monkeypatch.setattr(tool, "LOGS", tmp_path / "logs")
    monkeypatch.setattr(tool, "LANES", 1)
    codes = {"waits": f"{MEET}tell('a'); wait('b'); {PASS}", "one": PASS, "two": f"{MEET}wait('a'); tell('b'); {PASS}"}
    steps = [
        tool.Step(name, [*SAY, code, str(tmp_path)], 60.0, beside=True, waits=name == "waits")
        for name, code in codes.items()
    ]
    monkeypatch.setattr(tool, "STEPS", steps)
    assert tool.main([]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "3 passed, 0 failed, 0 skipped"


def test_the_output_of_two_steps_is_not_mixed(tool: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    screen = tool.Screen()

    def seen() -> list[str]:
        return capsys.readouterr().out.split("\n")[:-1]

    screen.begin("a", "a: make a")
    screen.begin("b", "b: make b")
    screen.line("b", "of b\n")
    screen.line("a", "of a\n")
    assert seen() == ["", "--- a: make a", "--- beside it: b", "of a"]
    screen.end("b", "ok")
    screen.begin("c", "c: make c")
    screen.line("c", "of c\n")
    screen.line("a", "more of a\n")
    assert seen() == ["--- beside it: b: ok", "--- beside it: c", "more of a"]
    screen.end("a", "FAILED")
    screen.line("c", "more of c\n")
    assert seen() == ["", "--- b: make b", "of b", "", "--- c: make c", "of c", "more of c"]
    screen.end("c", "ok")
    assert seen() == []


def test_one_lane_takes_the_next_step_while_the_other_is_busy(said: Callable[..., tuple[int, list[str]]]) -> None:
    more = MEET + PASS + "tell(f'more{}')"
    wait = MEET + PASS + "; ".join(f"wait('more{n}')" for n in range(3))
    status, lines = said(("long", wait), *((f"more {n}", more.replace("{}", str(n))) for n in range(3)))
    assert (status, lines[-1]) == (0, "4 passed, 0 failed, 0 skipped")


def test_a_step_that_cannot_be_started_is_a_failure(
    tool: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(tool, "LOGS", tmp_path)
    steps = [tool.Step("not there", [str(tmp_path / "none")], 2.0), tool.Step("there", [*SAY, PASS], 9.0)]
    monkeypatch.setattr(tool, "STEPS", steps)
    assert tool.main([]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "1 passed, 1 failed, 0 skipped"
    assert any(re.fullmatch(r"--- not there: .* No such file or directory: .*", line) for line in lines)


def test_steps_that_run_at_once_are_built_before_and_others_run_alone(tool: ModuleType) -> None:
    names = [[step.name for step in group] for group in tool.groups(tool.STEPS)]
    assert list(itertools.chain(*names)) == [step.name for step in tool.STEPS]
    assert [len(group) for group in names].count(1) == len(names) - 1
    together = max(tool.groups(tool.STEPS), key=len)
    assert [step.command[3:] for step in tool.build_first(together)] == [
        ["WERROR=1", "all"],
        ["WERROR=1", "bench-bin"],
        ["WERROR=1", "SAN=address,undefined", "all"],
    ]
    assert tool.build_first(together[:1]) == []


def test_the_total_of_the_c_tests_counts_and_not_the_output_shown_before_it(tool: ModuleType) -> None:
    outcome = tool.Outcome("x")
    for line in (
        "[  PASSED  ] 1 test(s).",
        "[  FAILED  ] 2 test(s), listed below:",
        "check: 5 passed, 2 failed, 0 skipped",
    ):
        outcome.read(line)
    assert (outcome.passed, outcome.failed, outcome.skipped) == (5, 2, 0)


@pytest.mark.parametrize(
    ("line", "kept"),
    [
        ("SKIPPED [2] tests/py/test_x.py:3: no recordings here", True),
        ("SKIPPED test_api: test_a", True),
        ("tests/py/test_x.py::test_a SKIPPED (no recordings here) [ 3%]", False),
        ("SKIPPED", False),
    ],
)
def test_reasons_of_skips_are_kept(tool: ModuleType, line: str, kept: bool) -> None:
    outcome = tool.Outcome("x")
    outcome.read(line + "\n")
    assert outcome.reasons == ([line] if kept else [])


def test_the_rest_is_what_make_test_leaves_out(tool: ModuleType) -> None:
    """A step of make test-all that runs tests of a tier is in both parts; every other one is in one of them, whole."""
    part = {tier: {step.name: step.command for step in tool.steps_of(tier)} for tier in tool.TIERS}
    assert part["all"].keys() == part["test"].keys() | part["rest"].keys()
    twice = part["test"].keys() & part["rest"].keys()
    for name in twice - {"build"}:
        words = {tier: " ".join(part[tier][name]) for tier in tool.TIERS}
        assert words["test"] != words["rest"] != words["all"], name
    for name in part["all"].keys() - twice:
        whole = part["test"].get(name) or part["rest"][name]
        assert [w for w in whole if "TIER" not in w] == [w for w in part["all"][name] if "TIER" not in w]


def test_the_steps_of_pytest_have_each_folder_once(tool: ModuleType) -> None:
    """What `make pytest` runs, and the end-to-end tests, are what pytest collects by itself."""
    root = PATH.parents[1]
    words = [word for step in tool.STEPS for word in step.command if word.startswith("PYTESTS=")]
    folders = sorted(folder for word in words for folder in word.removeprefix("PYTESTS=").split())
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]
    assert folders == sorted(set(settings["ini_options"]["testpaths"]) - {"tests/e2e"})
    assert "),tests/py tests/conform tests/golden)" in (root / "Makefile").read_text(encoding="utf-8")
    one, other = (word.removeprefix("E2E=").split() for step in tool.STEPS for word in step.command if "E2E=" in word)
    assert other == ["tests/e2e", *(f"--ignore={name}" for name in one)]
    assert all((root / name).is_file() for name in one)
    shared = [
        p
        for p in root.glob("tests/e2e/*/test_*.py")
        if {"main_job", "chamber_job"} & set(re.findall(r"\w+", p.read_text()))
    ]
    assert {str(p.relative_to(root)) for p in shared} == set(one)


def test_the_rest_adds_to_the_total_what_ran_before(
    tool: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(tool, "LOGS", tmp_path)
    steps = [
        tool.Step("first", [*SAY, "print('= 1 failed, 2 passed in 1.0s ='); exit(1)"], 9.0, tiers=["test"]),
        tool.Step("second", [*SAY, "print('= 3 passed in 1.0s =')"], 9.0, tiers=["rest"]),
    ]
    monkeypatch.setattr(tool, "STEPS", steps)
    assert tool.main(["rest", "--after"]) == 2
    assert "--after: expected the counts of a run before this one" in capsys.readouterr().err
    assert tool.main(["test"]) == 1
    assert tool.main(["rest"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "3 passed, 0 failed, 0 skipped"
    assert tool.main(["test"]) == 1
    assert tool.main(["rest", "--after"]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "5 passed, 1 failed, 0 skipped"


DRIVER = """
import importlib.util, pathlib, sys
spec = importlib.util.spec_from_file_location("test_all_tool", sys.argv[1])
tool = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tool)
here = sys.argv[2]
tool.LOGS = pathlib.Path(here)
say = [sys.executable, "-c"]
stay = "import os, sys, time; print('at work', os.getpid(), flush=True); time.sleep(600)"
stubborn = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); " + stay
tool.GRACE_S = 0.5
tool.LANES = 2
tool.STEPS = [
    tool.Step("before", [*say, "print('= 2 passed in 1.0s =')"], 60.0),
    tool.Step("one", [*say, stay], 600.0, beside=True),
    tool.Step("two", [*say, stubborn], 600.0, beside=True),
    tool.Step("never", [*say, "print('= 1 passed in 1.0s =')"], 600.0, beside=True),
]
sys.exit(tool.main([]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_ctrl_c_ends_both_lanes(tmp_path: Path, number: signal.Signals) -> None:
    with subprocess.Popen([*SAY, DRIVER, str(PATH), str(tmp_path)], stdout=subprocess.PIPE, text=True) as run:
        try:
            pids = [at_work(tmp_path / f"{name}.log") for name in ("one", "two")]
            run.send_signal(number)
            out, _ = run.communicate(timeout=60)
        finally:
            run.kill()
    assert run.returncode == 130
    said = out.splitlines()  # all that the steps had to say comes before the summary
    assert max(n for n, line in enumerate(said) if line.startswith("at work")) < said.index("interrupted")
    assert out.splitlines()[-1] == "2 passed, 0 failed, 0 skipped"
    assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()]
    assert not (tmp_path / "never.log").exists()


def at_work(log: Path) -> int:
    """The process that a step's log names, as soon as it does."""
    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        if log.exists() and (told := log.read_text().split()):
            return int(told[2])
        time.sleep(0.01)
    raise AssertionError(f"{log.name}: nothing came")


def test_an_unknown_step_is_refused(tool: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.main(["all", "no such step"]) == 2
    assert "no step no such step; there are: build; lint" in capsys.readouterr().err
