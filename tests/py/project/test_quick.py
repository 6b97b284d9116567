"""tools/quick.py: what is near a change, how much of it runs, the total."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import quick

HEADER = "emu/base/clk.h"


def put(root: Path, path: str, text: str = "") -> Path:
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_text(text)
    return Path(path)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A checkout with C tests, what they include, and Python tests."""
    for test in ("base/test_clk", "base/test_rng", "chip/x7/test_x7", "chip/x7/test_x7_cal", "link/test_slcan"):
        put(tmp_path, f"tests/unit/{test}.c")
    put(tmp_path, "build/obj/tests/unit/link/test_slcan.d", f"x.o: a.c emu/link/slcan.h \\\n  {HEADER}\n")
    put(tmp_path, "build/obj/tests/unit/chip/x7/test_x7.d", "x.o: a.c emu/base/clk.hpp\n")
    put(tmp_path, "tests/py/boards/test_frames.py", "from psabench.link import frames\n")
    put(tmp_path, "tests/py/test_other.py", "import psabench.link.frames_more\n")
    put(tmp_path, "tests/py/deep/test_user.py", "from psabench.link.frames import Form\n")
    put(tmp_path, "tests/conform/test_conform_x7.py")
    put(tmp_path, "tests/py/test_script.py", 'LINT = ROOT / "tools/lint"\n')
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "near"),
    [
        ("tests/unit/base/test_rng.c", ["test_rng.c", "test_clk.c"]),
        (HEADER, ["test_clk.c", "test_rng.c", "test_slcan.c"]),
        ("emu/base/clk.c", ["test_clk.c", "test_rng.c", "test_slcan.c"]),
        ("emu/chip/x7/cal.c", ["test_x7_cal.c", "test_x7.c"]),
        ("emu/chip/x7/regs.c", ["test_x7.c", "test_x7_cal.c"]),
        ("scripts/psabench/link/frames.py", []),
    ],
)
def test_c_tests_near_a_change(changed: str, near: list[str], tree: Path) -> None:
    choice = quick.c_choice([Path(changed)], tree)
    assert [p.name for p in choice.run] == near
    assert choice.left == []


@pytest.mark.parametrize(
    ("changed", "near"),
    [
        ("scripts/psabench/link/frames.py", ["test_frames.py", "test_user.py"]),
        ("tests/py/test_other.py", ["test_other.py"]),
        ("tools/lint", ["test_script.py"]),
        ("emu/chip/x7/cal.c", ["test_conform_x7.py"]),
        ("docs/frames.txt", ["test_frames.py"]),
        ("docs/nothing.txt", []),
    ],
)
def test_python_tests_near_a_change(changed: str, near: list[str], tree: Path) -> None:
    assert [p.name for p in quick.python_choice([Path(changed)], tree).run] == near


def test_what_is_too_much_is_left_out_the_farthest_first(tree: Path) -> None:
    choice = quick.c_choice([Path(HEADER)], tree, most=1)
    assert ([p.stem for p in choice.run], [p.stem for p in choice.left]) == (["test_clk"], ["test_rng", "test_slcan"])
    assert quick.names(Path(f"test_{n}.c") for n in range(9)) == (
        "test_0, test_1, test_2, test_3, test_4, test_5 and 3 more"
    )


def test_changed_files_are_those_of_the_work_tree(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=tmp_path, check=True)

    git("init", "-q")
    for name in ("kept", "edited", "deleted"):
        put(tmp_path, name, "x")
    git("add", ".")
    git("commit", "-qm", "first")
    assert quick.changed_files(tmp_path) == []
    put(tmp_path, "edited", "y")
    put(tmp_path, "sub/new")
    (tmp_path / "deleted").unlink()
    assert quick.changed_files(tmp_path) == [Path("deleted"), Path("edited"), Path("sub/new")]


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        ("check: 12 passed, 1 failed, 2 skipped", (12, 1, 2)),
        ("1 failed, 4 passed, 2 skipped, 3 deselected in 1.02s", (4, 1, 2)),
        ("3 passed, 2 errors, 1 xfailed, 1 xpassed in 1.00s", (3, 3, 1)),
        ("a line that says 3 passed", (0, 0, 0)),
    ],
)
def test_closing_lines_are_counted(line: str, counts: tuple[int, int, int]) -> None:
    total = quick.Total()
    total.count(line)
    assert (total.passed, total.failed, total.skipped) == counts


def test_a_command_that_fails_without_a_count_is_a_failure(capfd: pytest.CaptureFixture[str]) -> None:
    total = quick.Total()
    assert not total.step("build", ["sh", "-c", "echo 'x.c:1: error'; exit 2"])
    assert not total.step("tests", ["sh", "-c", "echo '2 failed in 1.0s'; exit 1"])
    assert total.failed == 3
    assert "x.c:1: error\n" in capfd.readouterr().out


def test_no_test_begins_after_the_budget(tmp_path: Path) -> None:
    late = "import time\ndef test_a(): time.monotonic = lambda: 1e12\n"  # the clock moves, whatever the machine does
    put(tmp_path, "test_slow.py", late + "def test_b(): pass\ndef test_c(): pass\n")
    conftest = Path(__file__).parents[2] / "conftest.py"
    (tmp_path / "conftest.py").write_text(conftest.read_text())
    command = [sys.executable, "-m", "pytest", "-q", "-c", f"{quick.ROOT}/pyproject.toml"]
    ran = subprocess.run(
        [*command, "--rootdir", tmp_path, "--budget=3600", tmp_path], capture_output=True, text=True, cwd=tmp_path
    )
    assert "left out: 2 tests, after 3600 s: test_slow\n" in ran.stdout, ran.stdout + ran.stderr
    assert "1 passed in " in ran.stdout
    total = quick.Total()
    for line in ran.stdout.splitlines():
        total.count(line)
    assert (total.passed, total.left) == (1, ["2 tests, after 3600 s: test_slow"])
