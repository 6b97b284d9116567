"""For all tests: what runs on which worker of `pytest -n`, and Ctrl-C for the programs that tests start.

A runner in the background (`make test &` in a script, many CI runners) starts us with SIGINT ignored; programs would
inherit that, and the tests that press Ctrl-C would wait for ever.
"""

import signal
from pathlib import Path

import pytest

signal.signal(signal.SIGINT, signal.default_int_handler)

# They run make in the checkout, which is not for two at once.
MAKING = {"test_chip_builds.py", "test_docs.py", "test_library.py", "test_make.py", "test_wheel.py"}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With -n and --dist loadgroup the tests of a file stay together: they share fixtures, ports and folders."""
    if config.pluginmanager.hasplugin("xdist"):
        for item in items:
            name = item.path.name
            item.add_marker(pytest.mark.xdist_group("make" if name in MAKING else name))


@pytest.fixture
def shared_path(tmp_path: Path) -> Path:
    """tmp_path with the folders above it, which pytest makes its user's own, passable to everybody."""
    for folder in tmp_path.parents:
        if "pytest-of-" in str(folder):
            folder.chmod(0o755)
    return tmp_path
