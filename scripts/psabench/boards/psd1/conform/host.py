"""A host of PSD-1 on its bus port: reads words where the board has no host of its own, and brings the board to rest."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from psabench.boards.objects import Psd1Objects as OD
from psabench.conform.bus_host import line
from psabench.conform.dut import Dut
from psabench.conform.profile import Variant
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Failed, known
from psabench.errors import CycleRefused
from psabench.link.busport import Cycle

STATUS, COMMAND, FLAGS, UC_HIGH, UC_LOW = 3, 14, 15, 12, 13
BOTH = 0x0003  # of FLAGS: INT0 and FL1
BEGUN = ("PSD1_TIME", "PSD1_GYRO", "PSD1_RATE")
TPDOS = {name: OD.TPDO + 1 + k for k, name in enumerate(BEGUN)}
OFF = 0x80000000
TURN_DPS, TURN_DPS2 = 50.0, 400.0  # of the rate table: its rate, and what it speeds up with


def has_host(variant: Variant) -> bool:
    """Whether the board strobes its words itself."""
    return bool(variant["host_strobe_ns"])


def period_s(variant: Variant) -> float:
    """From one word of a converter to the next."""
    row = requirements()["PSD1-CHIP-02"]
    return float(variant["adc_fs"] * row.limit("divider") / row.limit("clkin_hz"))


def setup_s(variant: Variant) -> float:
    """Timeout for the set-up."""
    return 12 * period_s(variant)


def status(s: Dut) -> int:
    return line(s, "R 3").data


def calm(s: Dut) -> None:
    """Set up with its defaults, as after power-on."""
    s.reset()
    s.run_for(0.002 + setup_s(s.variant))


def kept_coefficients(s: Dut) -> list[int]:
    """Zero of X, Y, Z and full scale of X, Y, Z, as 2044h and 2045h show them."""
    return [int(s.unit.node.read(index, k)) for index in (OD.ZERO_COEF, OD.FULL_COEF) for k in (1, 2, 3)]


@contextmanager
def while_turning(s: Dut) -> Iterator[bool]:
    """The rate table turns within; False: there is none."""
    if "table" not in s.probes:
        yield False
        return
    s.bench.table.rate(TURN_DPS)
    s.run_for(TURN_DPS / TURN_DPS2 + 0.1)
    try:
        yield True
    finally:
        s.bench.table.stop()


def messages_on(s: Dut, on: bool) -> None:
    """Switch PSD1_TIME, PSD1_GYRO and PSD1_RATE on or off."""
    for index in TPDOS.values():
        value = int(s.unit.node.read(index, 1))
        s.unit.node.write(index, 1, value & ~OFF if on else value | OFF)


def run_cycles(s: Dut, count: int) -> None:
    """Let so many cycles pass, reading their words where the board does not."""
    if has_host(s.variant):
        s.run_for((count + 1) * period_s(s.variant))
    else:
        drive(s, count)


def drive(s: Dut, count: int, slow_s: float = 0.0) -> list[Cycle]:
    """Let count cycles run and read their words, slow_s after they come. Raises Failed where none comes."""
    line(s, f"W F {BOTH:04X}")
    words = []
    for k in range(3 * count):
        if k == 3 * count - 1:
            line(s, "W F 0000")
        words.append(word(s, k % 3, slow_s))
    return words


def word(s: Dut, axis: int, slow_s: float = 0.0) -> Cycle:
    """The next word of an axis as soon as it waits."""
    known(s.port, "a board without a built-in host wants a bus port to be read")
    wait_s = period_s(s.variant) / 20
    if slow_s:
        s.run_for(slow_s)
    for _ in range(80):
        try:
            return line(s, f"R {axis:X}")
        except CycleRefused as e:
            if e.abort_code != requirements()["PSD1-BUS-03"].limit("abort_code"):
                raise
        s.run_for(wait_s)
    raise Failed(f"no word of {'XYZ'[axis]} on the bus within four periods", "a word that waits")
