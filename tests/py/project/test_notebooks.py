"""Notebooks: the stored ones are what a run gives, and the truth is in their last cell alone."""

from __future__ import annotations

import base64
import re
import struct
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import notebooks
import pytest

ROOT = Path(__file__).parents[3]
SOURCES = sorted((ROOT / "examples/notebooks").glob("*.py"))
TRUTH = re.compile(r"\b\w*(truth|graded?)\w*\b", re.IGNORECASE)
WITH_SITE = pytest.mark.skipif(not notebooks.PACKAGES.is_dir(), reason="Jupyter is not there: tools/setup all")


@WITH_SITE
def test_a_run_gives_what_is_stored() -> None:
    """All six, in 25 to 40 s of CPU. A cell that raises fails, too."""
    done = subprocess.run([sys.executable, ROOT / "tools/notebooks.py", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\nmake notebooks"


def test_each_has_its_outputs() -> None:
    assert len(SOURCES) == 6
    assert sorted(p.stem for p in (ROOT / "examples/notebooks").glob("*.ipynb")) == [p.stem for p in SOURCES]


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.stem)
def test_the_truth_is_in_the_last_cell_that_says_so(path: Path) -> None:
    """Imports may name it; a name with truth or grade in it is used in the last cell alone."""
    cells = re.split(r"^# %%", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    code = [c for c in cells if not c.startswith(" [markdown]")]
    said = next(c for c in reversed(cells) if c.startswith(" [markdown]"))
    assert cells[-1] is code[-1]
    assert cells[-2] is said
    assert said.startswith(" [markdown]\n# ## Truth\n#\n# Only an emulator")
    assert TRUTH.search(code[-1]), "no truth in the last cell"
    for cell in code[:-1]:
        lines = [line for line in cell.splitlines() if not line.startswith(("from ", "import "))]
        assert not TRUTH.search("\n".join(lines))


def picture(width: int, height: int) -> str:
    head = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + struct.pack(">II", width, height)
    return base64.b64encode(head).decode()


def a_notebook(text: str = "a\nb\n", source: str = "f()", png: str = picture(3, 2), more: int = 0) -> Any:
    outputs = [
        SimpleNamespace(output_type="stream", name="stdout", text=text, get=lambda *_: {}),
        SimpleNamespace(output_type="display_data", get=lambda *_: {"image/png": png, "text/plain": "<Figure>"}),
    ]
    cell = SimpleNamespace(cell_type="code", source=source, get=lambda *_: outputs)
    return SimpleNamespace(cells=[cell] * (1 + more))


@pytest.mark.parametrize(
    ("now", "said"),
    [
        (a_notebook(), []),
        (a_notebook(png=picture(3, 2) + "AAAA"), []),
        (a_notebook(text="a\nc\n"), ["cell 0, stdout: expected 'b', got 'c'"]),
        (a_notebook(source="g()"), ["cell 0, source: expected 'f()', got 'g()'"]),
        (a_notebook(png=picture(3, 4)), ["cell 0, image/png: expected '3 x 2', got '3 x 4'"]),
        (a_notebook(more=1), ["expected 4 sources, texts and pictures, got 8"]),
    ],
)
def test_what_differs_is_named(now: Any, said: list[str]) -> None:
    assert notebooks.differences(a_notebook(), now) == said
