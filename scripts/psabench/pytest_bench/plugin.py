"""The pytest plugin: loaded wherever psabench is installed (entry point `pytest11`). docs/tools/pytest.md.

@pytest.mark.scenario("quiet", seed=7)
def test_zero(bench):
    bench.unit.wait_ready()
    assert abs(bench.unit.stream(10).axis("y").mean()) < 1e-3
"""

from __future__ import annotations

import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # loaded by the fixture alone: a session without a bench pays nothing
    from psabench.bench import Bench
    from psabench.pytest_bench.kept import Recording

FOLDER = "bench-failures"
MARKER = "scenario(name='calibrate', *, seed, pace, can, node, extra)"
RECORDING: pytest.StashKey[Recording] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    text = f"folder for what is kept of failed tests with a bench (default: {FOLDER} in the root folder)"
    parser.getgroup("psabench").addoption("--bench-failures", metavar="FOLDER", help=text)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", f"{MARKER}: the bench of this test, as Bench.start takes them")


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """A bench with the scenario of the test's marker; its time moves when the test waits."""
    from psabench.bench import Bench
    from psabench.pytest_bench.kept import LOG, Recording

    name, how = _scenario_of(request)
    with tempfile.TemporaryDirectory(prefix="psabench-") as work:
        extra = (*how.pop("extra", ()), "--can", f"log:{Path(work) / LOG}")
        with Bench.start(name, **how, extra=extra) as started:
            recording = Recording(started, Path(work), _folder_of(request))
            request.node.stash[RECORDING] = recording
            yield started
        recording.finish()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Before the bench is closed: keeps what a failed test leaves, and names it in the report."""
    report = yield
    recording = item.stash.get(RECORDING, None)
    if recording is not None and report.failed and report.when != "teardown":
        report.sections.append(("psabench", recording.keep(item.nodeid)))
    return report


def _scenario_of(request: pytest.FixtureRequest) -> tuple[str | Path, dict[str, Any]]:
    """Of the test's marker: name, or the path of a file beside the test, and options of Bench.start."""
    marker = request.node.get_closest_marker("scenario")
    if marker is None:
        return "calibrate", {}
    if len(marker.args) > 1 or (unknown := set(marker.kwargs) - {"name", "seed", "pace", "can", "node", "extra"}):
        given = marker.args[1:] or sorted(unknown)
        raise pytest.UsageError(f"{request.node.nodeid}: expected {MARKER}, got {given}")
    how = dict(marker.kwargs)
    name = marker.args[0] if marker.args else how.pop("name", "calibrate")
    beside = request.path.parent / name
    return (beside if beside.is_file() else name), how


def _folder_of(request: pytest.FixtureRequest) -> Path:
    """Of this test, below the folder of the run."""
    base = Path(request.config.getoption("--bench-failures") or request.config.rootpath / FOLDER)
    return base / "".join(c if c.isalnum() or c in "._-" else "-" for c in request.node.nodeid)
