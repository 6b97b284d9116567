"""The same seed gives the same bytes: recordings, traces, paces, compilers, with and without somebody watching."""

from __future__ import annotations

import hashlib
import os
import re
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import can
import pytest
from psabench.emulator import Emulator
from psabench.errors import ControlError
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from psabench.link.record import record
from rig import BENCH, HERE, ROOT, TIMEOUT_S, bus_spec, psa_emu, talker, tool_env, unread, until

pytestmark = pytest.mark.host

NOISY = "stream"  # article's profile, noise of sensor and converters on
FORMATS = pytest.mark.parametrize("ending", [".log", ".blf"])


def same(make: Callable[[Path], None], folder: Path, ending: str) -> bytes:
    """Make the file twice; its bytes, which must not differ."""
    first, second = folder / f"first{ending}", folder / f"second{ending}"
    make(first)
    make(second)
    assert first.read_bytes() == second.read_bytes()
    return first.read_bytes()


def record_free(path: Path, *, seed: int = 1, count: int = 1000) -> None:
    """Record an emulator that runs as fast as it goes, beginning with its first client."""
    extra = ("--wait-client", "--for", "1s")
    with Emulator(NOISY, pace="free", seed=seed, control=False, extra=extra) as emulator:
        got = record(open_bus(bus_spec(emulator.endpoints[0])), path, 5, TIMEOUT_S, count)
    assert got.stored == count
    assert (got.counters.lost, got.counters.torn) == (0, 0)


def record_step(
    path: Path,
    *,
    scenario: str | Path = NOISY,
    seed: int = 1,
    extra: tuple[str | Path, ...] = (),
    between: Callable[[Control], None] = lambda control: None,
) -> None:
    """Record half a second in steps of changing length."""
    with Emulator(scenario, pace="step", seed=seed, extra=extra) as emulator, ExitStack() as watching:
        assert emulator.control_path is not None
        if "--line" in extra:
            watching.enter_context(reading(emulator.endpoint(line="sampled")["pty"]))
        bus = open_bus(bus_spec(emulator.endpoints[0]))
        with can.Logger(path) as log, CanHost(bus, WallClock()) as host, Control(emulator.control_path) as control:
            host.listeners.append(log)
            host.clock = StepClock(control)
            for k in range(50):
                host.advance(1e-3 * (1 + k % 19))
                between(control)
            assert host.received > 500


@contextmanager
def reading(pty: str) -> Iterator[None]:
    """Somebody reads the line port, and throws away what comes."""
    fd = os.open(pty, os.O_RDONLY | os.O_NOCTTY)
    stop, came = threading.Event(), threading.Event()

    def read() -> None:
        while not stop.is_set():
            if select.select([fd], [], [], 0.1)[0] and os.read(fd, 65536):
                came.set()

    reader = threading.Thread(target=read)
    reader.start()
    try:
        yield
        assert came.is_set(), "nothing came from the line port"
    finally:
        stop.set()
        reader.join()
        os.close(fd)


@FORMATS
def test_two_recordings_in_free_pace_are_the_same_bytes(tmp_path: Path, ending: str) -> None:
    same(record_free, tmp_path, ending)


@FORMATS
def test_two_recordings_in_step_pace_are_the_same_bytes(tmp_path: Path, ending: str) -> None:
    same(record_step, tmp_path, ending)


def test_another_seed_gives_other_bytes(tmp_path: Path) -> None:
    record_free(tmp_path / "1.log", seed=1, count=600)
    record_free(tmp_path / "2.log", seed=2, count=600)
    assert (tmp_path / "1.log").read_bytes() != (tmp_path / "2.log").read_bytes()


def test_free_and_step_pace_send_the_same_frames(tmp_path: Path) -> None:
    record_free(tmp_path / "free.log", count=500)
    record_step(tmp_path / "step.log")
    free = (tmp_path / "free.log").read_text().splitlines()
    assert free == (tmp_path / "step.log").read_text().splitlines()[: len(free)]


def cpu_ticks(pid: int) -> int:
    """Clock ticks of user time a process has used (proc(5): utime)."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11])


@FORMATS
def test_python_cans_own_logger_writes_the_same_bytes_twice(tmp_path: Path, ending: str) -> None:
    def log(path: Path) -> None:
        with Emulator(NOISY, pace="free", control=False, extra=("--wait-client", "--for", "0.5s")) as emulator:
            spec = bus_spec(emulator.endpoints[0])
            argv = [sys.executable, "-m", "can.logger", "-c", "can0", "-f", str(path)]
            with subprocess.Popen(argv, env=tool_env(spec), stdout=subprocess.DEVNULL) as logger:
                try:
                    assert emulator.wait(TIMEOUT_S) == 0
                    until(lambda: unread(int(emulator.endpoints[0]["port"])) == 0, "the logger to read")
                    # python-can does not notice the end of a connection but asks again at once, without end.
                    enough = cpu_ticks(logger.pid) + 5
                    until(lambda: cpu_ticks(logger.pid) >= enough, "the logger to have written what it read")
                    logger.send_signal(signal.SIGINT)
                    assert logger.wait(TIMEOUT_S) == 0
                finally:
                    logger.kill()

    same(log, tmp_path, ending)
    with can.LogReader(tmp_path / f"first{ending}") as logged:
        assert len(list(logged)) > 600


def test_in_free_pace_time_waits_for_a_reader_that_is_slow(tmp_path: Path) -> None:
    """More than all buffers hold: the emulator stands still until the reader goes on, and nothing is lost."""
    extra = ("--wait-client", "--for", "200s")
    with Emulator(NOISY, pace="free", extra=extra) as emulator:
        assert emulator.control_path is not None
        with talker(emulator) as slow, Control(emulator.control_path) as control:
            seen: list[int] = []

            def stands_still() -> bool:
                seen.append(control.call("time").t_ns)
                return len(seen) > 50 and len(set(seen[-50:])) == 1

            until(stands_still, "time to stand still")
            assert seen[-1] < 200e9
            received = b"".join(iter(lambda: slow.recv(1 << 20), b""))
    halves = re.findall(rb"< frame ([0-9A-F]{3}) [0-9.]+ [0-9A-F]{12}([0-9A-F]{2})([0-9A-F]{2}) *>", received)
    seq = [int(low, 16) | int(high, 16) << 8 for can_id, low, high in halves if can_id == b"185"]
    assert len(seq) > 199_000
    assert seq == [(seq[0] + k) % 2**16 for k in range(len(seq))]


# ---- traces

TRACED_S = 0.25  # set-up and some tens of frames


def trace(path: Path, *, pace: str = "free", scenario: str | Path = BENCH) -> bytes:
    """VCD of the board's lines over TRACED_S."""
    if pace == "step":
        with Emulator(scenario, cans=["none"], pace=pace, extra=("--vcd", path)) as emulator:
            assert emulator.control_path is not None
            with Control(emulator.control_path) as control:
                for share in (0.4, 0.12, 0.48):
                    control.call("run", for_s=share * TRACED_S)
                control.call("quit")
            assert emulator.wait(TIMEOUT_S) == 0
    else:
        done = psa_emu(scenario, "--can", "none", "--pace", pace, "--for", f"{TRACED_S}s", "--vcd", path)
        assert done.returncode == 0, done.stderr
    return path.read_bytes()


@pytest.mark.parametrize("scenario", [BENCH, NOISY], ids=["quiet", "noisy"])
def test_a_trace_is_the_same_at_every_pace(tmp_path: Path, scenario: str | Path) -> None:
    free = trace(tmp_path / "free.vcd", scenario=scenario)
    assert free.count(b"\n") > 10_000
    assert trace(tmp_path / "step.vcd", pace="step", scenario=scenario) == free
    assert trace(tmp_path / "wall.vcd", pace="wall", scenario=scenario) == free


@pytest.mark.parametrize("build", ["build-clang", "build-O0", "build-san", "build-fuzz"])
def test_traces_and_recordings_are_the_same_from_every_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, build: str
) -> None:
    if not (ROOT / build / "psa-emu").exists():
        pytest.skip(f"{build}/psa-emu is not built; `make builds` makes it")
    for name in ("build", build):
        monkeypatch.setenv("PSA_EMU", str(ROOT / name / "psa-emu"))
        trace(tmp_path / f"{name}.vcd", scenario=NOISY)
        record_free(tmp_path / f"{name}.log")
    for ending in (".vcd", ".log"):
        assert (tmp_path / f"build{ending}").read_bytes() == (tmp_path / f"{build}{ending}").read_bytes()


def test_frames_are_the_same_whether_somebody_watches_the_lines_or_not(tmp_path: Path) -> None:
    record_step(tmp_path / "alone.log")
    record_step(tmp_path / "watched.log", extra=("--vcd", tmp_path / "lines.vcd", "--line", "-"))
    assert (tmp_path / "lines.vcd").stat().st_size > 100_000
    assert (tmp_path / "alone.log").read_bytes() == (tmp_path / "watched.log").read_bytes()


# A unit of each type; sensor and analog chain with white and slow noise, which the integrators take as they come.
BOARDS = """
seed: 3
start: true
chamber: {start_degc: 20}
supply: {volt_v: 12}
table: {axes: 1}
units:
  - name: a
    node: 5
    serial: 11
    axes:
      x: &noisy
        sensor: mems
        u0_v: 0.2
        kx_v_per_g: 1
        noise_v_rthz: 0.001
        bias_instability_v: 0.01
        afe: {noise_v_rthz: 0.001}
  - {name: d, board: psd1, node: 6, serial: 12, axes: {x: *noisy}}
  - {name: m, board: pmka, node: 7, serial: 13, axes: {x: *noisy}}
  - {name: p, board: pik, node: 8, serial: 14, axes: {x: *noisy}}
"""
REFUSED: list[tuple[str, dict[str, float | str]]] = [
    ("fault.add", {"kind": "sensor.noise", "point": "m.sensor.x", "rms_v": 2.5e-6}),
    ("fault.add", {"kind": "sensor.saturation", "point": "p.sensor.x", "high_v": 14.0}),
    ("supply.set", {"volt_v": 900.0}),
    ("chamber.set", {"temp_degc": 290.0}),
    ("table.rate", {"axis": 1.0, "rate_dps": 5e4}),
]


def refuse(control: Control) -> None:
    for command, arguments in REFUSED:
        with pytest.raises(ControlError):
            control.call(command, **arguments)


def test_looks_and_refused_commands_move_no_noise(tmp_path: Path) -> None:
    """Somebody looks at the truth each 0.7 ms, and asks for what is not done."""
    scenario = tmp_path / "boards.yaml"
    scenario.write_text(BOARDS, encoding="utf-8")
    record_step(tmp_path / "alone.log", scenario=scenario)
    truth = ("--truth-log", tmp_path / "truth", "--truth-every", "0.7ms")
    record_step(tmp_path / "asked.log", scenario=scenario, extra=truth, between=refuse)
    assert (tmp_path / "alone.log").read_bytes() == (tmp_path / "asked.log").read_bytes()


# ---- lines, frames and truth of one run

MOVING = HERE / "moving.yaml"  # instruments, ripple, noise and faults, all at once
MOVING_S = 0.4


def run_and_hash(folder: Path, pace: str) -> str:
    """SHA-256 of VCD, CAN log and truth log of a run from power-on, whoever moves the time."""
    vcd, log, truth = folder / f"{pace}.vcd", folder / f"{pace}.log", folder / f"{pace}.truth"
    extra: list[str | Path] = ["--vcd", vcd, "--truth-log", truth, "--truth-every", "2ms"]
    if pace != "step":
        extra += ["--wait-client", "--for", f"{MOVING_S}s"]
    with Emulator(MOVING, pace=pace, control=pace == "step", extra=extra) as emulator:
        if pace == "step":
            assert emulator.control_path is not None
            bus = open_bus(bus_spec(emulator.endpoints[0]))
            with (
                can.Logger(log) as logger,
                CanHost(bus, WallClock()) as host,
                Control(emulator.control_path) as control,
            ):
                host.listeners.append(logger)
                host.clock = StepClock(control)
                for share in (0.01, 0.4, 0.12, 0.47):
                    host.advance(share * MOVING_S)
                control.call("quit")
            assert emulator.wait(TIMEOUT_S) == 0
        else:
            record(open_bus(bus_spec(emulator.endpoints[0])), log, 5, TIMEOUT_S, 250)
            assert emulator.wait(TIMEOUT_S) == 0
    frames = log.read_bytes().splitlines(keepends=True)[:250]
    assert len(frames) == 250
    assert truth.read_bytes().count(b"\n") == 2 * round(MOVING_S / 2e-3 + 1)
    assert vcd.stat().st_size > 500_000
    return hashlib.sha256(vcd.read_bytes() + b"".join(frames) + truth.read_bytes()).hexdigest()


def test_lines_frames_and_truth_are_the_same_at_every_pace(tmp_path: Path) -> None:
    assert run_and_hash(tmp_path, "free") == run_and_hash(tmp_path, "step") == run_and_hash(tmp_path, "wall")


@pytest.mark.parametrize("build", ["build-clang", "build-O0", "build-san", "build-fuzz"])
def test_lines_frames_and_truth_are_the_same_from_every_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, build: str
) -> None:
    if not (ROOT / build / "psa-emu").exists():
        pytest.skip(f"{build}/psa-emu is not built; `make builds` makes it")
    monkeypatch.setenv("PSA_EMU", str(ROOT / "build" / "psa-emu"))
    want = run_and_hash(tmp_path, "free")
    monkeypatch.setenv("PSA_EMU", str(ROOT / build / "psa-emu"))
    assert run_and_hash(tmp_path, "free") == want
