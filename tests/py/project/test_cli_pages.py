"""Manual pages and completion, which tools/gen_cli.py makes from the tables of --help (docs/tools/packages.md)."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from psabench.campaign.procedures import CAMPAIGNS
from psabench.cli import COMMANDS
from psabench.places import find_emulator
from psabench.procedures.command_line.commands import COMMANDS as PROCEDURES

ROOT = Path(__file__).parents[3]


def run(command: Sequence[str | Path], **environment: str) -> str:
    env = {**os.environ, **environment}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    assert done.stderr == ""
    return done.stdout


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("cli")
    run([sys.executable, "tools/gen_cli.py", "--out", out], PSA_EMU=str(find_emulator()))
    return out


def plain(page: Path) -> str:
    """What man shows, without bold face; `run` finds warnings of groff."""
    # https://lintian.debian.org/tags/groff-message: the call of lintian's check.
    shown = run(
        ["man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", page], LC_ALL="C.UTF-8", MANWIDTH="150", MANPAGER="cat"
    )
    return re.sub(r".\x08|\x1b\[[0-9;]*m", "", shown)


def options_of(text: str) -> set[str]:
    """Options at the beginning of a line of --help or of a manual page."""
    return {
        name for line in re.findall(r"^ +(-.*)", text, re.MULTILINE) for name in re.findall(r"--[a-z][\w-]*", line[:30])
    }


def test_the_page_of_the_emulator_has_each_option_that_help_prints(pages: Path) -> None:
    printed = re.findall(r"^  (--[\w-]+)(?:, (--[\w-]+))?", run([find_emulator(), "--help"]), re.MULTILINE)
    options = {name for names in printed for name in names if name}
    assert len(options) > 30
    page = plain(pages / "psa-emu.1")
    assert {name for name in options if not re.search(rf"^ +{name}\b", page, re.MULTILINE)} == set()
    assert "cannelloni's UDP tunnel on 127.0.0.1" in page
    assert "Exit status: 0 success, 2 bad input" in page


def test_the_page_of_psabench_has_each_command_with_its_options(pages: Path) -> None:
    page = plain(pages / "psabench.1")
    sections = dict(re.findall(r"^   (psabench .*)\n((?:(?:    .*)?\n)*)", page, re.MULTILINE))
    names = {
        *COMMANDS,
        *(f"run {name}" for name in (*PROCEDURES, "script")),
        *(f"campaign {name}" for name in CAMPAIGNS),
    }
    assert {f"psabench {name}" for name in names} <= set(sections)
    for words in ("record", "conform device", "run gyrocompass", "campaign gyrocompass"):
        printed = run([sys.executable, "-m", "psabench", *words.split(), "--help"], COLUMNS="150")
        assert options_of(printed) == options_of(sections[f"psabench {words}"]), words


BASH = """
. {pages}/{command}.bash
COMP_WORDS=({words}); COMP_CWORD={last}; _shtab_{name}
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
CASES = [
    ("psa-emu strea", {"stream"}),
    ("psa-emu --pace ", {"wall", "step", "free"}),
    ("psa-emu --bit", {"--bitrate"}),
    ("psabench conf", {"conform"}),
    ("psabench conform dev", {"device"}),
    ("psabench run comp", {"compare-converters"}),
    ("psabench campaign heading", {"heading-modes"}),
    ("psabench record --cou", {"--count"}),
]


@pytest.mark.parametrize(("line", "completed"), CASES, ids=[line for line, _ in CASES])
def test_bash_completes(pages: Path, line: str, completed: set[str]) -> None:
    words = line.split(" ")
    text = " ".join(w or "''" for w in words)
    script = BASH.format(
        pages=pages, command=words[0], words=text, last=len(words) - 1, name=words[0].replace("-", "_")
    )
    assert set(run(["bash", "--norc", "-c", script]).split()) == completed


@pytest.mark.parametrize(("line", "completed"), CASES, ids=[line for line, _ in CASES])
def test_fish_completes(pages: Path, tmp_path: Path, line: str, completed: set[str]) -> None:
    """With the text beside it, which bash has not."""
    command = line.split()[0]
    offered = run(
        ["fish", "--no-config", "-c", f"source {pages / command}.fish; complete -C {line!r}"], HOME=str(tmp_path)
    )
    assert completed <= {row.partition("\t")[0] for row in offered.splitlines()}


def test_zsh_loads_them(pages: Path) -> None:
    for command in ("psabench", "psa-emu"):
        run(["zsh", "-f", "-n", pages / f"{command}.zsh"])
        name = (pages / f"{command}.zsh").read_text(encoding="utf-8").partition("\n")[0]
        assert name == f"#compdef {command}"
