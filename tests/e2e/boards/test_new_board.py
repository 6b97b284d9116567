"""docs/new_board.md as it is written: each step in a copy of the repository, with the files of tests/toy_board."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from rig import ROOT

pytestmark = pytest.mark.host

PAGE, FILES = "docs/new_board.md", ROOT / "tests/toy_board"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHARED_MAX = 2  # files that a board edits by hand
# What gen_proto.py writes: messages, objects and UDS identifiers of all boards, and two files of the board's own.
GENERATED = {
    "proto/psabench.dbc",
    "scripts/psabench/boards/objects.py",
    "scripts/psabench/boards/parameters.py",
    "proto/toy.eds",
    "docs/reference/protocol_toy.md",
    "docs/tools/uds.md",
}
STEP_S = 300
NEEDED = (
    "Makefile",
    "docs/",
    "emu/",
    "examples/",
    "proto/",
    "pyproject.toml",
    "scripts/",
    "tests/toy_board/",
    "tools/",
)


@dataclass(frozen=True, slots=True)
class Step:
    """A block of the page: sh, diff or python."""

    kind: str
    text: str


def steps() -> list[Step]:
    return [Step(kind, text) for kind, text in BLOCK.findall((ROOT / PAGE).read_text(encoding="utf-8"))]


def tracked(*what: str) -> list[str]:
    """Files of the repository, those that are not committed yet included."""
    told = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *what],
        cwd=ROOT, capture_output=True, check=True, text=True,
    )  # fmt: skip
    return [name for name in told.stdout.split("\0") if name and (ROOT / name).is_file()]


def copy_of_the_repository(folder: Path) -> Path:
    """What a build and a run need. What is built is copied with its times, so that make builds the rest alone."""
    for name in tracked(*NEEDED):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    for part in ("gen", "obj/emu", "obj/build"):
        shutil.copytree(ROOT / "build" / part, folder / "build" / part, copy_function=shutil.copy2)
    (folder / ".venv").symlink_to(ROOT / ".venv")
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """Every file but what is built."""
    files = (p for p in folder.rglob("*") if p.is_file() and not p.is_relative_to(folder / "build"))
    names = {p.relative_to(folder).as_posix(): p for p in files}
    return {name: p.read_bytes() for name, p in names.items() if ".venv/" not in name and "__pycache__" not in name}


def apply_diff(folder: Path, text: str) -> None:
    """Replaces the old lines of each hunk, which must occur once. A hunk has no line numbers: they change too often."""
    name = re.search(r"^\+\+\+ b/(.*)$", text, re.MULTILINE)
    assert name, text
    path = folder / name[1]
    content = path.read_text(encoding="utf-8")
    for hunk in text.split("\n@@\n")[1:]:
        lines = hunk.splitlines()
        old = "".join(line[1:] + "\n" for line in lines if line[0] in " -")
        new = "".join(line[1:] + "\n" for line in lines if line[0] in " +")
        assert content.count(old) == 1, (
            f"{PAGE}: expected these lines once in {name[1]}, got {content.count(old)}:\n{old}"
        )
        content = content.replace(old, new)
    path.write_text(content, encoding="utf-8")


def run(folder: Path, step: Step) -> None:
    python = str(folder / ".venv/bin/python")
    command = {"sh": ["bash", "-euo", "pipefail", "-c", step.text], "python": [python, "-c", step.text]}[step.kind]
    own = {"PYTHONPATH": str(folder / "scripts"), "PYTHONDONTWRITEBYTECODE": "1", "CFLAGS": "-O0"}
    left_out = ("PSA_EMU", "MAKEFLAGS", "MFLAGS", "MAKELEVEL", "BUILD", "SAN")
    env = {k: v for k, v in os.environ.items() if k not in left_out} | own
    said = subprocess.run(
        command, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=STEP_S
    )
    assert said.returncode == 0, f"{PAGE}: status {said.returncode} of\n{step.text}\n{said.stdout[-4000:]}"


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("new_board")
    yield copy_of_the_repository(folder)
    shutil.rmtree(folder)


def test_a_board_is_added_by_the_steps_of_the_page(copy: Path) -> None:
    before = contents(copy)
    for step in steps():
        if step.kind == "diff":
            apply_diff(copy, step.text)
        else:
            run(copy, step)
    after = contents(copy)
    own = {p.relative_to(FILES).as_posix() for p in FILES.rglob("*") if p.is_file() and p.suffix != ".pyc"}
    changed = {name for name in after if before.get(name) != after[name]}
    shared = changed - own - GENERATED
    assert before.keys() <= after.keys()
    assert own | GENERATED <= changed
    assert shared == {m for step in steps() for m in re.findall(r"^\+\+\+ b/(.*)$", step.text, re.MULTILINE)}
    assert len(shared) <= SHARED_MAX, shared


def test_the_page_has_a_step_of_each_kind() -> None:
    kinds = [step.kind for step in steps()]
    assert set(kinds) == {"sh", "diff", "python"}
    assert kinds.count("diff") == SHARED_MAX
    needed = (
        "make ",
        "wait_ready()",
        "stream(",
        'fault("line.',
        'fault("chip.',
        'fault("sensor.',
        "Bench.restore",
        "conform device",
    )
    text = "".join(step.text for step in steps())
    assert [word for word in needed if word not in text] == []


def test_the_page_names_every_file_of_the_board() -> None:
    page = (ROOT / PAGE).read_text(encoding="utf-8")
    for path in FILES.rglob("*.*"):
        name = path.relative_to(FILES).as_posix()
        stem = f"{name.rsplit('.', 1)[0]}.[ch]"
        folder = f"{name.rsplit('/', 1)[0]}/"
        assert name in page or stem in page or f"`{folder}`" in page or "__" in name, name
