"""docs/procedures/gyrocompass_campaign.md shows what is computed."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from psabench.campaign.cases import STUDIES
from psabench.campaign.page import Campaign

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("plot_campaign", ROOT / "tools/plots/campaign.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def computed(tool: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    found: Campaign = tool.computed(tmp_path_factory.mktemp("page"))
    return found


def test_the_tables_of_the_page_are_what_is_computed(tool: ModuleType, computed: Campaign) -> None:
    """A difference: run tools/plots/campaign.py, and read what the page says of the numbers."""
    text = tool.PAGE.read_text(encoding="utf-8")
    wanted = tool.with_tables(text, computed)
    assert text.splitlines() == wanted.splitlines()
    assert re.findall(r"<!-- campaign: (\w+)", text) == [m[1] for m in tool.TABLE.finditer(text)]


def test_a_table_is_replaced_whole_and_nothing_else(tool: ModuleType, computed: Campaign) -> None:
    before, after = "one\n\n", "\ntwo\n"
    for name in ("hold", "claims"):
        old = "```\nstale\n```\n" if name == "hold" else "| stale |\n| --- |\n"
        text = f"{before}<!-- campaign: {name} -->\n{old}{after}"
        found = tool.with_tables(text, computed)
        assert "stale" not in found
        assert found.startswith(f"{before}<!-- campaign: {name} -->\n")
        assert found.endswith(after)
        assert tool.with_tables(found, computed) == found
        wanted = computed.claims[0].says if name == "claims" else "whole chain, exact drift from zero"
        assert wanted in found


def test_each_picture_of_the_page_is_drawn(tool: ModuleType) -> None:
    shown = set(re.findall(r"img/campaign_(\w+)\.svg", tool.PAGE.read_text(encoding="utf-8")))
    assert shown == {"distribution", *tool.PICTURES}
    assert set(tool.PICTURES) <= set(STUDIES)
