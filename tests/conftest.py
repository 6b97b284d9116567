"""For all tests: their tier (--tier), Ctrl-C for the programs that they start, one thread for linear algebra, and a
folder that all users may enter.

A runner in the background (`make test &` in a script, many CI runners) starts us with SIGINT ignored; programs would
inherit that, and the tests that press Ctrl-C would wait without end.
"""

import os
import signal
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import hypothesis
import pytest
import tiers

PLACES = {"host", "vcan", "slc0", "soak"}  # a sample is taken of the cases of each place

signal.signal(signal.SIGINT, signal.default_int_handler)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as psabench's commands have it; before any test loads numpy
# An example takes as long as a busy machine makes it; pytest's time limit ends what hangs.
hypothesis.settings.register_profile("psabench", deadline=None)
hypothesis.settings.load_profile("psabench")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--tier", choices=tiers.CHOICES, default="all", help="tests of tests/tiers.toml: test, rest, all (default)"
    )
    parser.addoption("--budget", type=float, metavar="S", help="begin no test after so many seconds (make quick)")


@pytest.fixture(autouse=True)
def signals_are_heard() -> Iterator[None]:
    """What a test starts inherits ignored signals: a test that leaves one ignored makes another one hang."""
    yield
    ignored = [s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) is signal.SIG_IGN]
    for s in ignored:
        signal.signal(s, signal.default_int_handler)
    assert not ignored, f"left ignored: {', '.join(s.name for s in ignored)}"


class Budget:
    """Begins no test after its time, and says how many it left out."""

    def __init__(self, budget_s: float) -> None:
        self._budget_s = budget_s
        self._end_s = time.monotonic() + budget_s
        self._left: list[str] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> object:
        if time.monotonic() < self._end_s:
            return None
        self._left.append(item.path.stem)
        return True  # has been dealt with

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._left:
            files = ", ".join(dict.fromkeys(self._left))
            terminalreporter.write_line(f"left out: {len(self._left)} tests, after {self._budget_s:g} s: {files}")


class Unused:
    """Refuses a run of whole files in which an entry of tests/tiers.toml fits no test: it would leave out nothing."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        if any("::" in arg for arg in config.args):
            return
        if unused := tiers.unused(table(), [_described(item) for item in items]):
            raise pytest.UsageError("\n".join(unused))


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Unused())
    if (budget_s := config.getoption("budget")) is not None:
        config.pluginmanager.register(Budget(budget_s))


@cache
def table() -> tiers.Table:
    return tiers.load()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """A file without a test of the tier is not even imported: half of them in the rest."""
    is_test = collection_path.suffix == ".py" and collection_path.name.startswith("test_")
    return True if is_test and tiers.has_none(table().row(collection_path), config.getoption("tier")) else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    tier = config.getoption("tier")
    if tier == "all":
        return
    chosen = tiers.in_test(table(), [_described(item) for item in items])
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
    """tmp_path with the folders above it, which pytest makes its user's own, passable to all users."""
    for folder in tmp_path.parents:
        if "pytest-of-" in str(folder):
            folder.chmod(0o755)
    return tmp_path
