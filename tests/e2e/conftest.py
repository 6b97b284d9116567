"""The same bench over each transport: one emulator per test, reached the way a user would reach it."""

from __future__ import annotations

import logging
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import pytest
from psabench.boards.psa2.device import Psa2
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from rig import ADAPTERS, BENCH, HOST, ROOT, SLC, SLC0, TIMEOUT_S, VCAN, MakeRig, Rig, bus_spec, need

logging.getLogger("can").setLevel(logging.ERROR)  # a warning for every message that a read has cut in two

BOOT_UP = 0x705, b"\0"
HERE = Path(__file__).parent
PLACES = {"host", "vcan", "slc0"}  # make e2e, e2e-vcan and e2e-slc0 choose by these marks
TRANSPORTS = [
    pytest.param("socketcand", marks=HOST),
    pytest.param("slcan", marks=HOST),
    pytest.param("vcan", marks=VCAN),
    pytest.param("slc0", marks=SLC),
]


@pytest.hookimpl(tryfirst=True)  # before -m leaves tests out
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuses a test that no step of make test-all would choose."""
    if left := [i.nodeid for i in items if HERE in i.path.parents and not PLACES & {m.name for m in i.iter_markers()}]:
        raise pytest.UsageError(f"{left[0]}: expected a mark of {', '.join(sorted(PLACES))}, got none")


@pytest.fixture(params=TRANSPORTS)
def transport(request: pytest.FixtureRequest) -> str:
    name = str(request.param)
    need(name)
    return name


@pytest.fixture(scope="session")
def main_job(tmp_path_factory: pytest.TempPathFactory) -> tuple[subprocess.CompletedProcess[str], Path]:
    """`make run`, once for all tests that look at what it prints, and a copy of what it leaves in build/run."""
    shutil.rmtree(ROOT / "build/run", ignore_errors=True)
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    done = subprocess.run(["make", "run"], cwd=ROOT, env=env, stdout=subprocess.PIPE, text=True, timeout=550)
    out = tmp_path_factory.mktemp("main") / "run"
    shutil.copytree(ROOT / "build/run", out)  # other commands of a page write there, too
    return done, out


@pytest.fixture(scope="session")
def chamber_job(tmp_path_factory: pytest.TempPathFactory) -> tuple[subprocess.CompletedProcess[str], Path]:
    """All converters at five temperatures, once for the page that shows it and for the tests of its result."""
    out = Path("build/run/converters-chamber")
    line = f".venv/bin/psabench run compare-converters --chamber --verbose --out {out} 2> /dev/null"
    shutil.rmtree(ROOT / out, ignore_errors=True)
    done = subprocess.run(line, shell=True, cwd=ROOT, stdout=subprocess.PIPE, text=True, timeout=550)
    kept = tmp_path_factory.mktemp("chamber") / "run"
    shutil.copytree(ROOT / out, kept)
    return done, kept


@pytest.fixture
def make_rig() -> Iterator[MakeRig]:
    """make_rig(transport, scenario, pace="step", extra=[...]) -> Rig; everything is closed at the end of the test."""
    with ExitStack() as stack:

        def make(
            transport: str,
            scenario: str | Path = BENCH,
            *,
            pace: str = "step",
            seed: int | None = None,
            extra: Sequence[str | Path] = (),
        ) -> Rig:
            if transport == "slc0":
                return _rig_outside(stack)
            emulator = Emulator(scenario, cans=[ADAPTERS[transport]], pace=pace, seed=seed, truth=True, extra=extra)
            stack.enter_context(emulator)
            stack.callback(_end, emulator)
            assert emulator.control_path is not None
            spec = bus_spec(emulator.endpoints[0])
            host = stack.enter_context(CanHost(open_bus(spec), WallClock()))
            control = stack.enter_context(Control(emulator.control_path))
            if pace == "step":
                host.clock = StepClock(control)
            return Rig(spec=spec, host=host, unit=Psa2(host), running=emulator, port=control)

        yield make


def _end(emulator: Emulator) -> None:
    """End it as a user would, however the test went, and see that no sanitizer has anything to say."""
    emulator.signal(signal.SIGTERM)
    emulator.wait(TIMEOUT_S)
    said = emulator.messages()
    assert not re.search(r"Sanitizer|runtime error:|assert", said, re.IGNORECASE), said


def _rig_outside(stack: ExitStack) -> Rig:
    """The bench of tests/uml/slc0, as it is after Res: one emulator serves all tests there."""
    host = stack.enter_context(CanHost(open_bus(SLC0), WallClock()))
    unit = Psa2(host)
    booted: list[bool] = []
    host.listeners.append(lambda m: booted.append((m.arbitration_id, bytes(m.data)) == BOOT_UP))
    unit.reset()
    assert host.pump_until(lambda: any(booted), TIMEOUT_S), "no boot-up message from the bench outside"
    return Rig(spec=SLC0, host=host, unit=unit)
