"""A long random session with every part of libpsabench, and one line: a hash of all that it gave back.

    PSABENCH_LIB=build-O0/libpsabench.so.0 python random_session.py SEED

Pins, bytes, voltages, registers, options and waiting are drawn from the seed alone, so that libraries built differently
are asked the same questions. Prints "SHA-256 calls edges"; -v prints every answer, to be compared with diff.
"""

from __future__ import annotations

import hashlib
import random
import sys

from psabench.chips import Bench, Part, options, parts
from psabench.errors import BenchError

SETTINGS = 16  # sets of options a chip, half as many a board
CALLS = 120  # a set of options
TOO_BUSY = ("M0", "M1", "MCLK")  # to be watched for seconds; their levels are looked at after each call

COMMANDS = {  # what makes a chip do something, so that not all bytes are noise
    "ads128": (b"\x10", b"\x11", b"\x12", b"\x04", b"\x02", b"\x00", b"\x60", b"\x61", b"\x21\x09" + bytes(10)),
    "ads125": (
        b"\x01",
        b"\x03",
        b"\x0f",
        b"\xf0",
        b"\xf1",
        b"\xf2",
        b"\xf3",
        b"\xf4",
        b"\xfc\x00",
        b"\xfd",
        b"\x10\x0a",
    ),
}


class Answers:
    """What came back, as a hash."""

    def __init__(self, verbose: bool) -> None:
        self.hash = hashlib.sha256()
        self.verbose = verbose
        self.calls = self.edges = 0

    def note(self, *answer: object) -> None:
        line = repr(answer)
        self.hash.update(line.encode())
        if self.verbose:
            print(line)

    def edge(self, name: str, level: int, t_ns: int) -> None:
        self.edges += 1
        self.note(name, level, t_ns)


def drawn(rng: random.Random, line: str) -> tuple[str, str]:
    """A value for an option, from its line "key=default  what it is, range"."""
    key, _, rest = line.partition("=")
    default, _, text = rest.partition("  ")
    span = text.rpartition(", ")[2]
    if span == "0 or 1":
        return key, rng.choice("01")
    if "|" in span:
        return key, rng.choice(span.split("|"))
    low, high = (float(x) for x in span.split(" to "))
    if key == "power_up_tclk":
        return key, rng.choice(("0", "0", "1000", default))
    if rng.random() < 0.6 or key in ("sclk_hz", "cells_max"):
        return key, default
    high = min(high, 2.0) if key.endswith("scale") else min(high, 1e7)
    if key.endswith(("_hz", "_ns")):
        return key, str(rng.randint(int(low), int(high)))
    return key, f"{low + (high - low) * rng.random():.6f}"


def spi_bytes(rng: random.Random, part: str) -> bytes:
    kind = rng.random()
    if kind < 0.35:
        return rng.choice(COMMANDS[part[:6]])
    if kind < 0.65:  # a write to a register or two
        first = 0x50 if part.startswith("ads125") else 0x40
        return bytes((first | rng.randrange(6), rng.randrange(2), rng.randrange(256), rng.randrange(256)))
    return rng.randbytes(rng.randint(1, 6)) if kind < 0.8 else bytes(rng.randint(1, 6))


def frame(rng: random.Random, bench: Bench, p: Part) -> str:
    """A read or a write of an AD771x, mostly of a whole word and in time."""
    write = rng.random() < 0.3
    word = rng.choice((0, 1, 1, 2, 3, 4, 5, 6, 7)) << 21 | rng.randrange(8) << 18 | rng.randrange(256) << 12
    word = (word & ~0x10000 if rng.random() < 0.9 else word) | rng.choice((19, 25, 60))
    p.pins["A0"].set(rng.randrange(2))
    bench.run_for(1e-6)
    p.pins["TFS" if write else "RFS"].set(0)
    bench.run_for(1e-6)
    bits = ""
    for i in range(24 if write else rng.choice((16, 24, 24, 8))):
        if write:
            p.pins["SDATA"].set(word >> (23 - i) & 1)
        bench.run_for(5e-7)
        p.pins["SCLK"].set(1)
        bits += str(p.pins["SDATA"].level)
        bench.run_for(5e-7)
        p.pins["SCLK"].set(0)
    bench.run_for(1e-6)
    p.pins["TFS" if write else "RFS"].set(1)
    return bits


def pulse(rng: random.Random, bench: Bench, p: Part) -> str:
    """A pin changes, and mostly changes back."""
    pin = rng.choice([q for q in p.pins.values() if q.is_input])
    was = pin.level
    pin.set(1 - was)
    bench.run_for(rng.choice((3e-7, 2e-6, 7e-5)))
    if rng.random() < 0.9:
        pin.set(was)
    return pin.name


def recover(p: Part) -> None:
    """Out of whatever holds it, to the next word."""
    for name in ("RESET", "PWDN", "SYNC", "STANDBY", "RFS", "TFS"):
        if name in p.pins:
            p.pins[name].set(1)
    p.pins["SCLK"].set(0)
    p.run_until_level("DRDY", 0, 0.1)


def chip_call(rng: random.Random, bench: Bench, p: Part, kind: str) -> str:
    """One thing that a driver or a bad driver does."""
    what = rng.randrange(8)
    if what < 3 and kind.startswith("ad77"):
        return frame(rng, bench, p)
    if what < 3:
        return p.spi(spi_bytes(rng, kind)).hex()
    if what == 3:
        return pulse(rng, bench, p)
    if what == 4:
        p.set_volts(rng.randrange(2), rng.uniform(-3, 6))
    elif what == 5 and not kind.startswith("ad77"):
        p.spi_clock(rng.choice((100_000, 1_000_000, 2_000_000)), rng.choice((0.0, 7e-6)))
    elif what == 6:
        recover(p)
    else:
        bench.run_for(rng.choice((1e-6, 3e-5, 1e-3, 2e-2)))
    return ""


def board_call(rng: random.Random, bench: Bench, p: Part) -> int:
    """One thing that a board's host or its surroundings do."""
    what = rng.randrange(6)
    if what == 0:
        return p.board_read(rng.randrange(4), rng.randrange(11), 0.2)
    if what == 1:
        p.board_write(rng.randrange(4), rng.randrange(11), rng.randrange(256), 0.2)
    elif what == 2:
        p.set_volts(rng.randrange(3), rng.uniform(-5, 5))
    elif what == 3 and rng.random() < 0.2:
        p.pins["Res"].set(rng.randrange(2))
    else:
        bench.run_for(rng.choice((1e-4, 3e-3, 1e-2)))
    return 0


def session(rng: random.Random, kind: str, answers: Answers) -> None:
    """One part with one set of options."""
    chosen = dict(drawn(rng, line) for line in options(kind).splitlines() if line)
    answers.note(kind, chosen)
    with Bench(seed=rng.getrandbits(32)) as bench:
        p = bench.part(kind, name="part", **chosen)
        board = kind == "psa2"
        for name, pin in p.pins.items():
            if not pin.is_input and name not in TOO_BUSY:
                pin.watch(lambda level, t_ns, name=name: answers.edge(name, level, t_ns))  # type: ignore[misc]
        if board:
            p.on_frame(lambda frame: answers.note(frame))
        elif "CS" in p.pins:
            p.pins["CS"].set(0)
        for _ in range(CALLS // 6 if board else CALLS):
            answers.calls += 1
            try:
                answers.note(board_call(rng, bench, p) if board else chip_call(rng, bench, p, kind))
            except BenchError as e:
                answers.note(type(e).__name__, str(e))
            answers.note(bench.now_ns, bench.next_ns, [] if board else [pin.level for pin in p.pins.values()])
        answers.note(p.counters, [] if board else [p.peek(a) for a in range(11)])


def main(argv: list[str]) -> int:
    answers = Answers("-v" in argv)
    rng = random.Random(int(argv[0]))
    for kind in parts():
        for _ in range(SETTINGS // 4 if kind == "psa2" else SETTINGS):
            session(rng, kind, answers)
    print(answers.hash.hexdigest(), answers.calls, answers.edges)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
