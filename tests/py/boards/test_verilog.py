"""Every edge of the boards' lines beside Verilog models of tests/bench/verilog, simulated by Icarus.

The models were written from the article and the pages of the boards, the one of PSD-1 by somebody who had not read the
C. They are given only what a controller cannot know: when conversions end, the words, and what the host does. TEST_SEED
repeats a run.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psd1_bench
import pytest
from numpy.typing import NDArray
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, Message, StepClock, open_bus
from psabench.link.control import Control
from psabench.link.vcd import Ints, Vcd, Wire, read_vcd
from verilog_bench import Edges, between, difference, drawn, seed_of_test, simulate

pytestmark = pytest.mark.skipif(not shutil.which("iverilog"), reason="iverilog is not installed")

PSA2_MODEL = ("psa2", "kpsa", "adc_port")
PSA2_LINES = ("SClk", "DRD_A", "DIn", "DOutX", "DOutY", "DOutZ", "Data", "CLK", "Int")  # bits 0.. of psa2.v
PSA2_FRAMES, STARTS = 1000, 5
XY, ZT = 0x185, 0x285  # CAN identifiers of node 5


@dataclass(frozen=True, slots=True)
class Psa2Frame:
    """What goes into a frame: end of its conversions, their 32-bit words as far as they are shifted out, word T."""

    conv_ns: int
    words: tuple[int, int, int]
    word_t: int
    int_rise_ns: int


def record_psa2(vcd: Path, rng: np.random.Generator) -> list[list[Message]]:
    """Frames after several Res at odd instants, so that DRD_A meets the clocks at any phase; messages of each run."""
    runs: list[list[Message]] = []
    extra: list[str | Path] = ["--start", "--vcd", vcd, "--vcd-unit", "1"]
    with Emulator(pace="step", seed=int(rng.integers(2**31)), extra=extra) as emu:
        can = emu.endpoint(can="socketcand")
        with (
            Control(emu.directory / "control") as control,
            CanHost(open_bus(f"socketcand:{can['host']}:{can['port']}"), StepClock(control)) as host,
        ):
            host.listeners.append(lambda m: runs[-1].append(m))
            for _ in range(STARTS):
                runs.append([])
                host.advance(0.1895 + 0.001 * (PSA2_FRAMES / STARTS + 2))
                runs.append([])  # on the way to Res
                host.advance(int(rng.integers(1_000_000)) * 1e-9)
                control.call("unit.reset")
    return runs[::2]


def pairs(messages: list[Message]) -> list[tuple[bytes, bytes]]:
    """XY and ZT of each frame since Res, from the one with number 0 on."""
    data = [(m.arbitration_id, bytes(m.data)) for m in messages if m.arbitration_id in (XY, ZT)]
    first = next(i for i, (identifier, d) in enumerate(data) if identifier == XY and d[6:8] == b"\0\0")
    sent = data[first:]
    assert [identifier for identifier, _ in sent] == [XY, ZT] * (len(sent) // 2) + [XY] * (len(sent) % 2)
    return [(xy, zt) for (_, xy), (_, zt) in zip(sent[::2], sent[1::2], strict=False)]


def psa2_frames(vcd: Vcd, messages: list[list[Message]]) -> list[list[Psa2Frame]]:
    """The whole frames of each run, put together from CAN; times, and the bit that no frame shows, from the lines."""
    resets = [*vcd.wires["Res"].edges_ns(1).tolist(), vcd.end_ns]
    int_, drd_a = vcd.wires["Int"], vcd.wires["DRD_A"]
    found = []
    for start_ns, end_ns, sent in zip(resets, resets[1:], messages, strict=False):
        falls, rises = (t[(t > start_ns) & (t < end_ns)] for t in (int_.edges_ns(0), int_.edges_ns(1)))
        frames = []
        for fall, rise, (xy, zt) in zip(falls, rises, pairs(sent), strict=False):
            conv_ns = int(drd_a.edges_ns(0)[drd_a.edges_ns(0) < fall][-1])
            codes = [int.from_bytes(b, "little") for b in (xy[0:3], xy[3:6], zt[0:3])]
            rest = [int(vcd.wires[line].at(int(fall))) for line in ("DOutX", "DOutY", "DOutZ")]
            x, y, z = (code << 8 | bit << 7 for code, bit in zip(codes, rest, strict=True))
            word_t = int.from_bytes(zt[3:5], "little") | (zt[5] >> 4) << 16 | (zt[5] & 15) << 20
            frames.append(Psa2Frame(conv_ns, (x, y, z), word_t, int(rise)))
        found.append(frames)
    return found


def of_accelerometers(vcd: Vcd, line: str, start_ns: int, end_ns: int) -> Edges:
    """Edges of a line; SClk without the bursts of the temperature converter, which are not in the model."""
    edges = between(vcd.wires[line], start_ns, end_ns)
    if line != "SClk":
        return edges
    kept = vcd.wires["CST"].at(edges.t_ns) == 1
    return Edges(edges.before, edges.t_ns[kept], edges.level[kept])


def test_a_thousand_frames_of_psa_2_have_the_edges_of_the_verilog_model(tmp_path: Path) -> None:
    rng = np.random.default_rng(seed_of_test())
    path = tmp_path / "psa2.vcd"
    messages = record_psa2(path, rng)
    vcd = read_vcd(path)
    runs = psa2_frames(vcd, messages)
    frames = [f for run in runs for f in run]
    assert len(runs) == STARTS
    assert len(frames) >= PSA2_FRAMES
    assert len({f.conv_ns * 2048 % 1_000_000 for f in (run[0] for run in runs)}) > 1  # DRD_A against SClk
    rows = (f"{f.conv_ns} {f.words[0]:x} {f.words[1]:x} {f.words[2]:x} {f.word_t:x}\n" for f in frames)
    end_ns = frames[-1].int_rise_ns + 1000
    wires = drawn(simulate(tmp_path, "psa2_edges_tb", PSA2_MODEL, end_ns, frames="".join(rows)), PSA2_LINES)
    wrong = []
    for run in runs:
        within = (run[0].conv_ns, run[-1].int_rise_ns + 100)  # from where on DOut is known to the model
        for line in PSA2_LINES:
            ours, theirs = of_accelerometers(vcd, line, *within), between(wires[line], *within)
            assert len(ours.t_ns) > len(run) or line == "DIn" or line.startswith("DOut")
            wrong.append(difference(line, ours, theirs))
    assert "\n".join(w for w in wrong if w) == ""


PSD1_MODEL = ("psd1", "kpsd1", "ad7712_port")
PSD1_CYCLES = 1000
DRDY_PULSE_TAU = 500  # DRDY is high so long before an unread word is replaced (docs/chips/ad7712.md)


@pytest.mark.parametrize(
    ("clock_ppm", "tau_ns", "phases", "seed", "cycles"),
    [
        (0, 100, 1, None, PSD1_CYCLES),
        (-218_750, 128, 25, None, PSD1_CYCLES),
        # X is being read 500 tau before an update: DRDY stays low
        (0, 100, 1, 2167900355, 700),
        (-218_750, 128, 25, 1, 600),
    ],
)
def test_a_thousand_cycles_of_psd_1_have_the_edges_of_the_verilog_model(
    clock_ppm: int, tau_ns: int, phases: int, seed: int | None, cycles: int, tmp_path: Path
) -> None:
    """Random delays, lengths and mistakes of the host, which takes INT0 and FL1 away at times. On its own clock
    converter X ends its words where 1M25 rises; on another one, here 7.8125 MHz, at every 32 ns of a period. Without a
    seed: that of TEST_SEED, or a new one."""
    pinned = seed is not None  # for what it found: as it was then
    seed = seed_of_test() if seed is None else seed
    coincide = 0.0 if pinned else 0.5
    prompt = [[psd1_bench.Strobe(True, 1000, 800, axis)] for axis in range(3)]  # INT0 and FL1 come with the first cycle
    strobes = list(psd1_bench.random_strobes(np.random.default_rng(seed), cycles, 0.2, coincide))
    done = list[psd1_bench.Strobe]()
    path, words = psd1_bench.record(tmp_path, seed % 2**31, prompt + strobes, clock_ppm, done=done)
    vcd = read_vcd(path)
    whole, words = psd1_bench.cycles(vcd)[1 : len(words)], words[1:]
    assert len(whole) == len(words) == cycles
    dr_falls = vcd.wires["DR"].edges_ns(0)
    found = set((dr_falls[-cycles:] % 800).tolist())
    assert len(found) == phases
    start_ns = int(dr_falls[dr_falls < whole[0].start_ns][-1])
    end_ns = whole[-1].end_ns + 300
    host = "".join(
        f"{int(not s.after_fl2)} {s.delay_ns} {s.length_ns} {s.address} {int(s.data is None)} {s.data or 0}\n"
        for s in done[len(prompt) :]
    )
    int0, fl1 = (vcd.wires[name] for name in ("INT0", "FL1"))
    flags = np.unique([t for wire in (int0, fl1) for t in between(wire, start_ns, end_ns).t_ns])
    held = sum(int(np.any((dr_falls > s) & (dr_falls < e))) for s, e in absent(int0, fl1, flags))
    assert held > cycles // 50  # conversions end while the one or the other is away
    begun = np.isin(flags, vcd.wires["A0"].edges_ns(1))
    assert pinned or begun.sum() > cycles // 200  # one goes at the very instant at which it is looked at
    stimuli = {
        "updates": "".join(f"{t}\n" for t in dr_falls[(dr_falls >= start_ns) & (dr_falls < end_ns)].tolist()),
        "words": "".join(f"{x:x} {y:x} {z:x}\n" for x, y, z in words),
        "host": host,
        "flags": "".join(f"{t} {a} {b}\n" for t, a, b in zip(flags, int0.at(flags), fl1.at(flags), strict=True)),
    }
    edges = simulate(tmp_path, "psd1_tb", PSD1_MODEL, end_ns + 1, {"update_ns": DRDY_PULSE_TAU * tau_ns}, **stimuli)
    wires = drawn(edges, psd1_bench.LINES)
    clock = np.arange(start_ns // 400 * 400 + 400, end_ns + 1, 400)  # the model's own is the test bench's
    wires["CLK_1M25"] = Wire(np.append(start_ns // 400 * 400, clock), _levels(start_ns, clock))
    wrong = [
        difference(line, between(vcd.wires[line], start_ns, end_ns), between(wires[line], start_ns, end_ns))
        for line in psd1_bench.LINES
    ]
    assert "\n".join(w for w in wrong if w) == ""
    assert all(len(between(vcd.wires[n], start_ns, end_ns).t_ns) > cycles for n in ("A0", "FL2", "DR", "D7", "CS"))


def absent(int0: Wire, fl1: Wire, changes: Ints) -> list[tuple[int, int]]:
    """Stretches of time in which INT0 or FL1 is not active."""
    active = (int0.at(changes) == 1) & (fl1.at(changes) == 0)
    return [(int(s), int(e)) for s, e, on in zip(changes, changes[1:], active, strict=False) if not on]


def _levels(start_ns: int, clock: Ints) -> NDArray[np.uint8]:
    """1M25 rises at even multiples of 400 ns from power-up."""
    return (1 - np.append(start_ns // 400, clock // 400) % 2).astype(np.uint8)
