"""A PSD-1 whose host is a test: cycles with given strobes, recorded, and what a reader needs of the recording.

The host strobes over the control command `bus.read` in step pace, to the nanosecond. Times are ns of simulated time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from psabench.emulator import Emulator
from psabench.errors import ControlError
from psabench.link.control import Control
from psabench.link.vcd import Vcd

LINES = (
    *("A0", "INT0", "FL1", "FL2", "DR", "RFX", "RFY", "RFZ", "TFS", "SCLK", "SDAT", "CLK_1M25", "CS", "RW"),
    *(f"AB{i}" for i in range(4)),
    *(f"D{i}" for i in range(16)),
)
HALF_NS, PERIOD_NS = 400, 800  # of 1M25
SET_UP_S = 0.02

SCENARIO = """
seed: {seed}
start: true
units:
  - name: a
    board: psd1
    profile_set: {{host_strobe_ns: 0}}
    axes:
      x: {{sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0, reading_noise_v: 1.0}}
      y: {{sensor: mems, u0_v: -4.1, kx_v_per_g: 1.0, reading_noise_v: 1.0}}
      z: {{sensor: mems, u0_v: 0.0, kx_v_per_g: 1.0, reading_noise_v: 1.0}}
"""


@dataclass(frozen=True, slots=True)
class Strobe:
    """A read, or a write of data: delay after the rise of FL2, or after the strobe before; length; address; whether a
    word is to be had. before_dr_ns: it begins so long before DR falls, whatever its delay; end_ns: and ends so long
    after the rise of 1M25 which follows that, where a cycle would begin, whatever its length."""

    after_fl2: bool
    delay_ns: int
    length_ns: int
    address: int
    good: bool = True
    data: int | None = None
    before_dr_ns: int | None = None
    end_ns: int | None = None


FLAGS, BOTH = 15, 3  # its address; INT0 and FL1 active


def writes(rng: np.random.Generator, before: list[Strobe], rows: list[tuple[int, int]]) -> list[Strobe]:
    """FLAGS is written so long after the strobe before, with these data; some writes end with a rise of 1M25."""
    since_ns = HALF_NS + sum(s.delay_ns + s.length_ns for s in before)  # FL2 rises with a fall of 1M25
    strobes = []
    for wait_ns, data in rows:
        length_ns = int(rng.integers(200, 900))
        if rng.random() < 0.3:
            length_ns = 200 + (-since_ns - wait_ns - 200) % PERIOD_NS
        since_ns += wait_ns + length_ns
        strobes.append(Strobe(False, wait_ns, length_ns, FLAGS, data=data))
    return strobes


def random_flags(rng: np.random.Generator, before: list[Strobe], first_ns: int = 0) -> list[Strobe]:
    """Behind these strobes INT0, FL1 or both are taken away and given again, for an instant; now and then given for
    about a period of 1M25 in between. Over before the next FL2, 13.6 us later at least. first_ns: they are away
    already, and given after so long."""
    rows = [(int(rng.integers(10, 3000)), int(rng.integers(0, 3))), (int(rng.integers(10, 3000)), BOTH)]
    if first_ns:
        rows = [(first_ns, BOTH)]
    if rng.random() < 0.5:
        rows += [(int(rng.integers(10, 300)), int(rng.integers(0, 3))), (int(rng.integers(10, 3000)), BOTH)]
    return writes(rng, before, rows)


def held_back(rng: np.random.Generator, last: Strobe) -> list[Strobe]:
    """INT0, FL1 or both are taken away before the last word is read, and given again maybe conversions later."""
    off = Strobe(True, int(rng.integers(0, 3000)), int(rng.integers(200, 900)), FLAGS, data=int(rng.integers(0, 3)))
    before = [off, Strobe(False, 10 + last.delay_ns, last.length_ns, last.address)]
    return before + random_flags(rng, before, int(rng.integers(10, 3_000_000)))


def coincident(rng: np.random.Generator, last: Strobe) -> list[Strobe]:
    """As held_back, but all three conditions of a cycle hold from a fall of DR on, and the strobe that takes INT0 or
    FL1 away, under way already, ends just where the cycle begins: mostly at the very instant, else about it."""
    off = Strobe(True, int(rng.integers(0, 3000)), int(rng.integers(200, 900)), FLAGS, data=int(rng.integers(0, 3)))
    read = Strobe(False, 10 + last.delay_ns, last.length_ns, last.address)
    given = Strobe(False, 0, int(rng.integers(200, 900)), FLAGS, data=BOTH, before_dr_ns=int(rng.integers(5000, 40000)))
    end_ns = int(rng.choice([0, 0, 0, 0, -1, 1, int(rng.integers(-300, 300))]))
    data, before_ns = int(rng.integers(0, 3)), int(rng.integers(600, 3000))  # 600 - 300 is no strobe too short
    away = Strobe(False, 0, 0, FLAGS, data=data, before_dr_ns=before_ns, end_ns=end_ns)
    again = Strobe(False, int(rng.integers(10, 3000)), int(rng.integers(200, 900)), FLAGS, data=BOTH)
    return [off, read, given, away, again]


def scenario(directory: Path, seed: int) -> Path:
    path = directory / "psd1.yaml"
    path.write_text(SCENARIO.format(seed=seed), encoding="utf-8")
    return path


def random_strobes(
    rng: np.random.Generator, cycles: int, flags: float = 0.0, coincide: float = 0.0
) -> Iterator[list[Strobe]]:
    """Of each word of each cycle: mostly prompt, at times late or so late that conversions are lost; now and then a
    strobe at another word's address first, or one more behind it, which must both change nothing. flags: behind so many
    of the words INT0 and FL1 change. coincide: in so many of those cases at the instant of an edge of 1M25 that
    matters."""
    for _ in range(cycles):
        for axis in range(3):
            delay = int(rng.choice([rng.integers(0, 3000), rng.integers(0, 200_000), 800 * rng.integers(0, 4)]))
            if rng.random() < 0.004:
                delay = int(rng.integers(500_000, 2_500_000))
            strobes = [Strobe(True, delay, int(rng.integers(200, 4000)), axis)]
            if rng.random() < 0.1:
                other = (axis + int(rng.integers(1, 3))) % 3
                strobes.insert(0, Strobe(True, int(rng.integers(0, 2000)), int(rng.integers(200, 900)), other, False))
                strobes[1] = Strobe(False, 10 + delay, strobes[1].length_ns, axis)
            if rng.random() < 0.1:
                wait = int(rng.integers(10, 8000))
                strobes.append(Strobe(False, wait, int(rng.integers(200, 900)), axis, False))
            elif rng.random() < flags:
                held = axis == 2 and len(strobes) == 1 and rng.random() < 0.5
                if held and coincide and rng.random() < coincide:
                    strobes = coincident(rng, strobes[0])
                else:
                    strobes = held_back(rng, strobes[0]) if held else strobes + random_flags(rng, strobes)
            yield strobes


class Host:
    """Strobes of a board in step pace."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._dr_ns = 0  # when DR will fall
        self.now_ns = control.call("time").t_ns
        self._end_ns = self.now_ns  # of the strobe before

    def run(self, dt_ns: int) -> None:
        if dt_ns > 0:
            self.now_ns = self._control.call("run", for_s=dt_ns * 1e-9).t_ns

    def await_event(self, event: str) -> None:
        reply = self._control.call("run.until", event=event)
        assert reply.result["reached"], f"no {event}"
        self.now_ns = reply.t_ns

    def timed(self, s: Strobe) -> Strobe:
        """The same with delay and length as numbers. Words that is not read end in a steady row; DR falls at each."""
        if s.before_dr_ns is None:
            return s
        if self._dr_ns - s.before_dr_ns <= self.now_ns:
            self.await_event("DR")
            before_ns = self.now_ns
            self.await_event("DR")
            self._dr_ns = 2 * self.now_ns - before_ns
        begin_ns, length_ns = self._dr_ns - s.before_dr_ns, s.length_ns
        if s.end_ns is not None:
            length_ns = (self._dr_ns // PERIOD_NS + 1) * PERIOD_NS + s.end_ns - begin_ns
        return replace(s, delay_ns=begin_ns - self._end_ns, length_ns=length_ns, before_dr_ns=None, end_ns=None)

    def do(self, s: Strobe) -> int | None:
        """The word; None of a write, and when the board refuses. It ends with the end of the strobe, refused or not."""
        if s.after_fl2:
            self.await_event("FL2")
        begin_ns = (self.now_ns if s.after_fl2 else self._end_ns) + s.delay_ns
        self.run(begin_ns - self.now_ns)
        end_ns = self._end_ns = begin_ns + s.length_ns
        word, args = None, {"unit": "a", "address": s.address, "strobe_ns": s.length_ns}
        try:
            if s.data is None:
                word = int(self._control.call("bus.read", **args).result["data"])
            else:
                self._control.call("bus.write", **args, data=s.data)
        except ControlError:
            if s.good:
                raise
        self.now_ns = self._control.call("time").t_ns
        self.run(end_ns - self.now_ns)
        assert self.now_ns == end_ns, f"{s}: the strobe ended at {self.now_ns} ns, not at {end_ns}"
        assert (word is not None) == (s.good and s.data is None)
        return word


def record(
    directory: Path,
    seed: int,
    strobes: Iterable[Sequence[Strobe]],
    clock_ppm: int = 0,
    unit_ns: int = 1,
    done: list[Strobe] | None = None,
) -> tuple[Path, list[list[int]]]:
    """The recording from power-on, and the words of each cycle as the host read them. done: gets the strobes as they
    were, those that wait for DR, too, with delay and length."""
    vcd, words = directory / "psd1.vcd", list[int]()
    extra: list[str | Path] = ["--vcd", vcd, "--vcd-unit", str(unit_ns)]
    with (
        Emulator(scenario(directory, seed), cans=["none"], pace="step", extra=extra) as emu,
        Control(emu.directory / "control") as control,
    ):
        host = Host(control)
        for i, row in enumerate(strobes):
            if clock_ppm and i == 3:  # of converter X, after the first cycle: DR then meets the clock at any phase
                control.call("fault.add", kind="chip.clock", point="a.adc.x", clock_ppm=clock_ppm)
            for wanted in row:
                strobe = host.timed(wanted)
                word = host.do(strobe)
                if done is not None:
                    done.append(strobe)
                if word is not None:
                    words.append(word)
        host.run(1_000_000)
    return vcd, [words[i : i + 3] for i in range(0, len(words) - len(words) % 3, 3)]


@dataclass(frozen=True, slots=True)
class Cycle:
    """From the rise of A0 to its fall."""

    start_ns: int
    end_ns: int


def cycles(vcd: Vcd) -> list[Cycle]:
    """Whole cycles of reading: in the set-up A0 rises, too, but no word is offered."""
    a0, fl2 = vcd.wires["A0"], vcd.wires["FL2"].edges_ns(1)
    first = a0.edges_ns(1)[a0.edges_ns(1) < fl2[0]][-1]
    starts, ends = (t[t >= first].tolist() for t in (a0.edges_ns(1), a0.edges_ns(0)))
    return [Cycle(start, end) for start, end in zip(starts, ends, strict=False)]
