"""A file is there whole or as it was before."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from psabench.errors import BenchError
from psabench.link.own import replace_file


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    for text in ("old", "α new\n"):
        replace_file(page, text)
        assert page.read_text(encoding="utf-8") == text
    assert list(tmp_path.iterdir()) == [page]


def test_who_reads_it_already_keeps_what_there_was(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    replace_file(page, "old")
    with page.open(encoding="utf-8") as reader:
        replace_file(page, "new")
        assert reader.read() == "old"


@pytest.mark.parametrize("broken", ["write_text", "replace"])
def test_what_fails_half_way_leaves_the_file_as_it_was(
    broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "page.html"
    replace_file(page, "old")

    def full(path: Path, *_: object, **__: object) -> None:
        with path.open("w") as draft:
            draft.write("ne")
        raise OSError(28, "No space left on device")

    def refused(*_: object) -> None:
        raise OSError(13, "Permission denied")

    if broken == "write_text":
        monkeypatch.setattr(Path, "write_text", full)
    else:
        monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(
        BenchError,
        match=r"page.html: (expected a path .*, got one without permission|No space left on device); not written",
    ):
        replace_file(page, "new")
    assert page.read_text() == "old"


KILLED = """
import os, signal, sys
from pathlib import Path
from psabench.link.own import replace_file
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
replace_file(Path(sys.argv[1]), "new")
"""


def test_what_a_killed_process_has_left_goes_with_the_next_writing(tmp_path: Path) -> None:
    page = tmp_path / "page [1].html"
    replace_file(page, "old")
    killed = subprocess.run([sys.executable, "-c", KILLED, page], timeout=60, check=False)
    assert killed.returncode == -signal.SIGKILL
    [left] = tmp_path.glob("*.part")
    assert (page.read_text(), left.read_text()) == ("old", "new")
    others = [page.with_name(f"{page.name}.{os.getppid()}.part"), page.with_name(f"{page.name}.mine.part")]
    for other in others:  # of a process that is at work, and of no process
        other.write_text("")
    replace_file(page, "newer")
    assert sorted(tmp_path.iterdir()) == sorted([page, *others])
    assert page.read_text() == "newer"
