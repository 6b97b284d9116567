"""The pages of the quartz campaigns show what is computed."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from command_line import QUIET

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("plot_quartz", ROOT / "tools/plots/quartz.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look themselves up
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["quartz_deformation", "run_in"])
def test_the_tables_of_the_page_are_what_is_computed(name: str, tool: ModuleType) -> None:
    """A difference: run tools/plots/quartz.py, and read what the page says of the numbers."""
    text = (ROOT / f"docs/procedures/{name}.md").read_text(encoding="utf-8")
    page = tool.COMPUTED[name](QUIET)
    assert text.splitlines() == tool.with_tables(text, page).splitlines()
    assert set(re.findall(r"<!-- quartz: (\w+)", text)) == set(page.tables)
    for picture in page.pictures:
        assert f"(../img/{name}_{picture}.svg)" in text
