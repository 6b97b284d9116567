"""tools/lint tells at its end what failed, in which file and why, and what it was at when a signal ends it.

Its programs are stand-ins here: what they find in the project is `make lint`'s to say.
"""

import os
import select
import signal
import subprocess
from pathlib import Path

import pytest

LINT = Path(__file__).parents[3] / "tools/lint"
PROGRAMS = ("gcc", "clang", "g++", "clang++", "clang-format", "clang-tidy", "python3", ".venv/bin/python")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A project of two C files and one of C++ whose programs find nothing."""
    for name in ("emu/base/a.c", "emu/base/b.c", "nav/north/n.cpp", "build/unity/nav_north.cpp", "tools/lint"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "tools/lint").write_bytes(LINT.read_bytes())
    for name in PROGRAMS:
        stand_in(tmp_path, name, "exit 0")
    return tmp_path


def stand_in(tree: Path, name: str, script: str) -> None:
    path = tree / (name if "/" in name else f"bin/{name}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def start(tree: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        ["bash", tree / "tools/lint"],
        env={**os.environ, "PATH": f"{tree / 'bin'}:{os.environ['PATH']}", "FLAGS": "-Wall", "CXXLINT": "-Wextra"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def lint(tree: Path) -> tuple[int, list[str], list[str]]:
    with start(tree) as run:
        out, err = run.communicate(timeout=60)
    return run.returncode, out.splitlines(), err.splitlines()


def test_nothing_found_is_clean(tree: Path) -> None:
    status, out, err = lint(tree)
    assert (status, out[-1], err) == (0, "lint: clean", [])
    assert {"lint: clang-tidy", "lint: C format", "lint: mypy"} <= set(out)


def test_what_a_check_says_without_failing_is_shown(tree: Path) -> None:
    stand_in(tree, "g++", "echo 'g++: a remark'")
    status, out, _ = lint(tree)
    assert (status, out[-2:]) == (0, ["g++: a remark", "lint: clean"])


@pytest.mark.parametrize(
    ("program", "script", "check", "found"),
    [
        ("clang", "echo a.c:3: error: x >&2; exit 1", "warnings of clang", "a.c:3: error: x"),
        (
            "clang-tidy",
            'case $2 in */b.c) echo "$2:7: error: y"; exit 1 ;; esac',
            "clang-tidy",
            "emu/base/b.c:7: error: y",
        ),
        (
            "clang-tidy",
            "case $2 in */a.c) kill -KILL $$ ;; esac",
            "clang-tidy",
            "emu/base/a.c: clang-tidy ended with status 137",
        ),
        (
            "clang-tidy",
            '[ "$4" != -Wextra ] || exit 1',
            "clang-tidy of C++",
            "build/unity/nav_north.cpp: clang-tidy ended with status 1",
        ),
        (
            "clang-format",
            "echo 'emu/base/b.c:2:1: error: code should be clang-formatted [-Wclang-format-violations]' >&2; exit 1",
            "C format",
            "emu/base/b.c:2:1: not in the project's format (make format)",
        ),
        ("clang-format", "echo 'no such style' >&2; exit 1", "C format", "no such style"),
        (".venv/bin/python", 'case "$*" in *mypy*) echo "m.py:1: z"; exit 1 ;; esac', "mypy", "m.py:1: z"),
    ],
)
def test_what_failed_is_named_at_the_end(tree: Path, program: str, script: str, check: str, found: str) -> None:
    stand_in(tree, program, script)
    status, out, err = lint(tree)
    assert (status, err[-1]) == (1, f"lint: failed: {check}")
    assert found in err[err.index(f"lint: {check} FAILED") :]
    assert "lint: clean" not in out


def test_all_that_failed_is_named(tree: Path) -> None:
    stand_in(tree, "gcc", "exit 1")
    stand_in(tree, "python3", "exit 3")
    status, _, err = lint(tree)
    assert status == 1
    assert err[-1] == "lint: failed: warnings of gcc, examples in C, includes and sizes, shape, symbols, phrases, links"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_a_signal_ends_all_and_says_what_was_at_work(tree: Path, number: signal.Signals) -> None:
    here = tree / "at-work"
    os.mkfifo(here)
    stand_in(tree, "clang-tidy", f'case $2 in */a.c) echo $$ > "{here}"; exec sleep 600 ;; esac')
    with start(tree) as run:
        with here.open() as fifo:  # opens when clang-tidy does
            process = os.pidfd_open(int(fifo.read()))
        run.send_signal(number)
        _, err = run.communicate(timeout=60)
    assert run.returncode == 128 + number
    assert f"lint: ended by {number.name} in: clang-tidy" in err.splitlines()
    assert select.select([process], [], [], 30)[0], "clang-tidy is still there"
    os.close(process)
