"""`make test` adds up honestly: runners' closing lines are counted, and no failure gets past the last line."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

PATH = Path(__file__).parents[2] / "tools/test_all.py"


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
    monkeypatch.setattr(tool, "STEPS", [(f"step {n}", [*SAY, code], 2.0) for n, code in enumerate(steps)])
    assert tool.main([]) == status, what
    assert capsys.readouterr().out.splitlines()[-1] == last
    assert len(list(tmp_path.glob("*.log"))) == len(steps)


def test_an_unknown_step_is_refused(tool: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.main(["no such step"]) == 2
    assert "no step no such step; there are: build; lint" in capsys.readouterr().err
