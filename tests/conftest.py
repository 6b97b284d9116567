"""For all tests: their tier (--tier), Ctrl-C for the programs that they start, and a folder that everybody may enter.

A runner in the background (`make test &` in a script, many CI runners) starts us with SIGINT ignored; programs would
inherit that, and the tests that press Ctrl-C would wait for ever.
"""

import signal
from pathlib import Path

import hypothesis
import pytest
import tiers

PLACES = {"host", "vcan", "slc0", "soak"}  # a sample is taken of the cases of each place

signal.signal(signal.SIGINT, signal.default_int_handler)
# An example takes as long as a busy machine makes it; pytest's time limit ends what hangs.
hypothesis.settings.register_profile("psabench", deadline=None)
hypothesis.settings.load_profile("psabench")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--tier", choices=tiers.CHOICES, default="all", help="tests of tests/tiers.toml: test, rest, all (default)"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    tier = config.getoption("tier")
    if tier == "all":
        return
    chosen = tiers.in_test(tiers.load(), [_described(item) for item in items])
    kept: list[pytest.Item] = []
    left: list[pytest.Item] = []
    for item, in_test in zip(items, chosen, strict=True):
        (kept if in_test == (tier == "test") else left).append(item)
    items[:] = kept
    config.hook.pytest_deselected(items=left)


def _described(item: pytest.Item) -> tuple[Path, str, str, frozenset[str]]:
    """File, function, case and place of a test, as tiers.in_test() takes them."""
    function, _, case = item.name.partition("[")
    places = frozenset(mark.name for mark in item.iter_markers() if mark.name in PLACES)
    return item.path, function, case.removesuffix("]"), places


@pytest.fixture
def shared_path(tmp_path: Path) -> Path:
    """tmp_path with the folders above it, which pytest makes its user's own, passable to everybody."""
    for folder in tmp_path.parents:
        if "pytest-of-" in str(folder):
            folder.chmod(0o755)
    return tmp_path
