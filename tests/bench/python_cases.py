"""What `make bench` measures in Python, each in a process of its own: python -m tests.bench.python_cases CASE COUNT.

Prints CASE key=value ... ns=T like bench_core.
"""

from __future__ import annotations

import os
import random
import re
import resource
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from psabench.link.control import Control
from psabench.link.lineport import BLOCK, CLK, DATA, INT, LineDecoder
from psabench.places import find_emulator

from tests.bench.cases import FLEETS, ROOT, fleet_scenario
from tests.bench.nav_cases import NAV_CASES

SAMPLES = 8000  # of a frame period: 8 MHz, 1 ms
SET_UP_S = 0.3  # of a PSA-2, and some


def _sampled(words: list[int], phase: float) -> bytes:
    """A frame of the article's profile (2 MHz CLK, 8 lead-in, 4 x 32 bits, pauses of 4) at 8 MHz, then idle."""
    samples = bytearray([INT]) * SAMPLES
    for k in range(4 * 148):
        clk = (k + phase) / 4
        word, bit = divmod(int(clk) - 8, 36)
        sending = clk >= 8 and bit < 32
        samples[k + 50] = (DATA * (words[word] >> bit & 1) | CLK * (clk % 1 >= 0.5)) if sending else 0
    return bytes(samples)


def decode(count: int) -> str:
    """Bytes of the line port in memory to words, block by block as they are read."""
    rng = random.Random(1)
    once = b"".join(_sampled([rng.getrandbits(32) for _ in range(4)], rng.random()) for _ in range(1000))
    blocks = [once[i : i + BLOCK] for i in range(0, len(once), BLOCK)]
    decoder = LineDecoder()
    began_ns = time.process_time_ns()
    while decoder.counts.frames < count:
        for block in blocks:
            decoder.feed(block)
    ns = time.process_time_ns() - began_ns
    c = decoder.counts
    if c.torn or c.lost or c.late or c.early or c.gaps:
        raise RuntimeError(f"decode: frames that were whole are not: {c}")
    return f"frames={c.frames} samples={c.samples} ns={ns}"


def start(count: int) -> str:
    """From spawning the emulator to `ready all`; the median of count starts."""
    command = [str(find_emulator()), "calibrate", "--can", "socketcand:0", "--quiet"]
    took_ns = []
    for _ in range(count):
        began_ns = time.perf_counter_ns()
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as p:
            assert p.stdout is not None
            for line in p.stdout:
                if line == b"ready all\n":
                    took_ns.append(time.perf_counter_ns() - began_ns)
                    break
            p.terminate()
    if len(took_ns) != count:
        raise RuntimeError("start: the emulator did not come up")
    return f"starts={count} ns={int(statistics.median(took_ns))}"


def can(count: int) -> str:
    """CAN frames of the stream, one sample in two, through socketcand to a client that reads as fast as it can."""
    command = [str(find_emulator()), "stream", "--seed", "1", "--pace", "free", "--wait-client", "--quiet"]
    command += ["--can", "socketcand:0", "--for", f"{max(count // 2000, 1)}s"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as p:
        assert p.stdout is not None
        port = int(p.stdout.readline().partition("port=")[2])
        with socket.create_connection(("127.0.0.1", port)) as s:
            s.settimeout(60)
            _expect(s, b"< hi >")
            began_ns = time.perf_counter_ns()
            for command_line, answer in ((b"< open can0 >", b"< ok >"), (b"< rawmode >", b"< ok >")):
                s.sendall(command_line)
                _expect(s, answer)
            frames, tail = 0, b""
            while data := s.recv(1 << 18):
                data = tail + data
                frames += data.count(b"< frame ")
                tail = data[-7:]  # shorter than what is counted: nothing counts twice
        ns = time.perf_counter_ns() - began_ns
    return f"frames={frames} ns={ns}"


def _expect(s: socket.socket, answer: bytes) -> None:
    got = b""
    while not got.endswith(b">"):
        got += s.recv(len(answer) - len(got) if len(got) < len(answer) else 1)
    if got != answer:
        raise RuntimeError(f"socketcand: {got!r} instead of {answer!r}")


def chips_spi(count: int) -> str:
    """Bytes through psabench.chips: all registers of an ADS1256, 13 bytes a call."""
    from psabench.chips import Bench

    with Bench(seed=1) as bench:
        adc = bench.part("ads1256")
        adc.run_until_level("DRDY", 0)
        adc.spi_clock(1_000_000, 7e-6)
        adc.pins["CS"].set(0)
        request = bytes([0x10, 0x0A, *bytes(11)])
        want = adc.spi(request)
        began_ns = time.process_time_ns()
        for _ in range(max(count // len(request), 1)):
            got = adc.spi(request)
        ns = time.process_time_ns() - began_ns
    if got[3:] != want[3:]:  # STATUS holds DRDY
        raise RuntimeError(f"chips-spi: registers {got.hex()}, at first {want.hex()}")
    return f"bytes={max(count // len(request), 1) * len(request)} ns={ns}"


MC_BATCH = 1 << 15  # runs of the closed form a call: their results stay in the cache


def mc_numpy(count: int) -> str:
    """Gyrocompasses of NumPy, sample by sample, all of a batch at once; one thread."""
    from psabench.native.nav_mc import McConfig

    from tests.bench.numpy_gyrocompass import BATCH, batch

    cfg, rng = McConfig(), np.random.default_rng(1)
    batch(cfg, 10, rng)
    batches = max(round(count / BATCH), 1)
    began_ns = time.process_time_ns()
    for _ in range(batches):
        batch(cfg, BATCH, rng)
    return f"runs={batches * BATCH} ns={time.process_time_ns() - began_ns}"


def _closed(first: int, batches: int) -> None:
    from psabench.native.nav_mc import McConfig, closed

    cfg = McConfig()
    into = closed(cfg, 1, runs=MC_BATCH)
    for k in range(batches):
        closed(cfg, 1, first_run=(first + k) * MC_BATCH, runs=MC_BATCH, into=into)


def mc_closed(count: int) -> str:
    """The same by the closed form; one thread, CPU time."""
    batches = max(count // MC_BATCH, 1)
    _closed(0, 1)
    began_ns = time.process_time_ns()
    _closed(0, batches)
    return f"runs={batches * MC_BATCH} ns={time.process_time_ns() - began_ns}"


def mc_closed_all(count: int) -> str:
    """The same, a thread a core, real time."""
    threads = os.cpu_count() or 1
    batches = max(count // MC_BATCH // threads, 1)
    _closed(0, 1)
    began_ns = time.perf_counter_ns()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(lambda t: _closed(t * batches, batches), range(threads)))
    return f"runs={threads * batches * MC_BATCH} ns={time.perf_counter_ns() - began_ns}"


def mc_samples(count: int, threads: int = 1, clock_ns: Callable[[], int] = time.process_time_ns) -> str:
    """The same sample by sample; one thread, CPU time."""
    from psabench.native.nav_mc import McConfig, samples

    samples(McConfig(), 1, runs=threads, threads=threads)
    began_ns = clock_ns()
    samples(McConfig(), 1, runs=count, threads=threads)
    return f"runs={count} ns={clock_ns() - began_ns}"


def mc_samples_all(count: int) -> str:
    """The same, a thread a core, real time."""
    return mc_samples(count, os.cpu_count() or 1, time.perf_counter_ns)


def children_cpu_ns() -> int:
    """CPU time of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return int((used.ru_utime + used.ru_stime) * 1e9)


def _gyrocompassings(count: int) -> tuple[int, int]:
    """CPU time of the emulators and of this process for `count` runs through the full emulated chain in free pace: the
    article's positions, 3 x 10 s, 10 s of settling and turns of 9 deg/s, from power-on; a heading of each."""
    from psabench.campaign import emulated
    from psabench.campaign.setup import Setup, level_white_degph_rts

    setup = Setup(gimbal="corrected", slew_dps=9.0, settle_s=10.0, m2_per_s=2.0)
    setup = replace(setup, white_degph_rts=level_white_degph_rts(setup.window_s))
    platforms = emulated.recorded()
    emulated.runs(platforms, setup, 1, 0, 1)  # what is read once
    began_ns, children_ns = time.process_time_ns(), children_cpu_ns()
    rows = emulated.runs(platforms, setup, 1, 1, count)
    if not np.isfinite(rows[:, 1]).all():
        raise RuntimeError("gyro: a run gave no heading")
    return children_cpu_ns() - children_ns, time.process_time_ns() - began_ns


def gyro_emulator(count: int) -> str:
    """One gyrocompassing through the full emulated chain: what psa-emu takes of it, user and system."""
    return f"runs={count} ns={_gyrocompassings(count)[0]}"


def gyro_chain(count: int) -> str:
    """The same, with reading the recording of the bus and the host's procedure."""
    return f"runs={count} ns={sum(_gyrocompassings(count))}"


def fourier(count: int) -> str:
    """`count` positions of `run fourier` on the realistic bench: bench time and real time, host and emulator."""
    from psabench.bench import Bench
    from psabench.estimate.face import Face
    from psabench.procedures.command_line.offered import CONDITIONS
    from psabench.procedures.fourier import FourierParams
    from psabench.procedures.head_bench import Watch
    from psabench.procedures.series import measure_face
    from psabench.procedures.wire_bench import WireBench

    condition, times_ns = CONDITIONS["realistic"], []
    with Bench.start(condition.scenario) as bench:
        on_head = WireBench(bench.unit, bench.head, average=condition.average, g_mps2=condition.g_mps2)
        watch = Watch(record=lambda _: times_ns.append(time.perf_counter_ns()))
        readings = measure_face(on_head, FourierParams(realisations=1, positions=count), Face.DIRECT, watch)
    simulated_ms = round((readings[-1].t_s - readings[0].t_s) * 1000)
    return f"simulated_ms={simulated_ms} ns={times_ns[-1] - times_ns[0]}"


CHAMBER = """
chamber: {start_degc: 25, tau_case_s: 20, tau_element_s: 40}
timeline:
  - {at_s: 60, cmd: chamber.set, args: {temp_degc: 85}}
"""


def chamber(count: int) -> str:
    """`count` minutes in a chamber that heats up: each second in sixty is recorded by the host. Real time of both."""
    from psabench.bench import Bench

    path = ROOT / "build/bench/chamber.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text((ROOT / "proto/scenarios/calibrate.yaml").read_text(encoding="utf-8") + CHAMBER, encoding="utf-8")
    with Bench.start(path) as bench:
        began_ns = time.perf_counter_ns()
        for _ in range(count):
            bench.wait_away(59.0)
            bench.unit.stream(1000)
        ns = time.perf_counter_ns() - began_ns
    return f"simulated_s={60 * count} ns={ns}"


def fleet(units: int, count: int) -> str:
    """Units on eight buses, silent: real time from spawning to `ready all`, memory then, CPU time of `count` ms."""
    command = [str(find_emulator()), str(fleet_scenario(units)), "--pace", "step", "--can", "none", "--quiet"]
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        control = Path(folder) / "control"
        began_ns = time.perf_counter_ns()
        with subprocess.Popen([*command, "--control", str(control)], stdout=subprocess.PIPE) as p:
            assert p.stdout is not None
            while p.stdout.readline() not in (b"ready all\n", b""):
                pass
            ready_ns = time.perf_counter_ns() - began_ns
            rss_kb = int(re.findall(r"VmRSS:\s+(\d+)", Path(f"/proc/{p.pid}/status").read_text(encoding="utf-8"))[0])
            with Control(control) as c:
                c.call("run", for_s=SET_UP_S)
                cpu_ns = _cpu_ns(p.pid)
                c.call("run", for_s=count / 1000)
                cpu_ns = _cpu_ns(p.pid) - cpu_ns
                c.call("quit")
    return f"unit_ms={units * count} units={units} ready_ns={ready_ns} rss_kb={rss_kb} ns={cpu_ns}"


def fleet_wall(count: int) -> str:
    """64 units at 1,000 frames a second on buses that take any number, in real time: the emulator's CPU time."""
    command = [str(find_emulator()), str(fleet_scenario(64)), "--pace", "wall", "--can", "none", "--start"]
    used_ns = children_cpu_ns()
    done = subprocess.run(
        [*command, "--bitrate", "0", "--for", f"{count}s"], capture_output=True, text=True, check=True
    )
    used_ns = children_cpu_ns() - used_ns
    messages, late_us, slips = (
        int(re.findall(what, done.stderr)[0]) for what in (r"(\d+) frames on", r"p99 (\d+)", r"slips: (\d+)")
    )
    return f"wall_ms={count * 1000} messages={messages} late_p99_us={late_us} slips={slips} ns={used_ns}"


def _cpu_ns(pid: int) -> int:
    return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="utf-8").split()[0])


CASES: dict[str, Callable[[int], str]] = {
    "chamber": chamber,
    **{f"fleet-{n}": partial(fleet, n) for n in FLEETS},
    "fleet-wall": fleet_wall,
    "decode": decode,
    "start": start,
    "can": can,
    "chips-spi": chips_spi,
    "mc-numpy": mc_numpy,
    "mc-closed": mc_closed,
    "mc-closed-all": mc_closed_all,
    "mc-samples": mc_samples,
    "mc-samples-all": mc_samples_all,
    "gyro-emulator": gyro_emulator,
    "gyro-chain": gyro_chain,
    "fourier": fourier,
    **NAV_CASES,
}

if __name__ == "__main__":
    print(sys.argv[1], CASES[sys.argv[1]](int(sys.argv[2])))
