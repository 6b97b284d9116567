"""Linux's spidev and gpiod over a simulated chip, so that drivers for them run here as they are.

As pigpio_shim.py, for the two modules that a driver uses where the kernel owns SPI and GPIO. A system call takes time,
`call_s`, which the bench moves on by: that is how a loop around `get_value()` sees DRDY fall.
"""

import importlib
import sys
from dataclasses import dataclass
from enum import Enum
from types import ModuleType
from typing import Any

from psabench.chips import Part


class Value(Enum):
    """gpiod.line.Value: the level of a line that is not inverted."""

    INACTIVE = 0
    ACTIVE = 1


class Direction(Enum):
    """gpiod.line.Direction."""

    INPUT = 1
    OUTPUT = 2


@dataclass(frozen=True, slots=True)
class LineSettings:
    """gpiod.LineSettings, as far as levels go."""

    direction: Direction = Direction.INPUT
    output_value: Value = Value.INACTIVE


class Lines:
    """What `gpiod.request_lines()` returns."""

    def __init__(self, machine: "Machine") -> None:
        self.machine = machine

    def get_value(self, line: int) -> Value:
        self.machine.call()
        return Value(self.machine.pin(line).level)

    def set_value(self, line: int, value: Value) -> None:
        self.machine.call()
        self.machine.pin(line).set(value.value)


class SpiDev:
    """`spidev.SpiDev()`; every transfer is a call of its own, its bytes without a pause between them."""

    machine: "Machine"
    mode = 0

    def open(self, bus: int, device: int) -> None:
        pass

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "max_speed_hz":
            self.machine.chip.spi_clock(value)
        super().__setattr__(name, value)

    def xfer(self, data: list[int]) -> list[int]:
        self.machine.call()
        return list(self.machine.chip.spi(bytes(data)))

    def writebytes(self, data: list[int]) -> None:
        self.xfer(data)

    def readbytes(self, count: int) -> list[int]:
        return self.xfer([0] * count)


@dataclass(frozen=True, slots=True)
class Machine:
    """A computer with one chip on its SPI bus: GPIO line to pin of the chip, and what a system call takes (E0)."""

    chip: Part
    wiring: dict[int, str]
    call_s: float = 10e-6

    def call(self) -> None:
        self.chip.bench.run_for(self.call_s)

    def pin(self, line: int) -> Any:
        return self.chip.pins[self.wiring[line]]

    def request_lines(self, path: str, *, consumer: str, config: dict[int, LineSettings]) -> Lines:
        for line, settings in config.items():
            if settings.direction is Direction.OUTPUT:
                self.pin(line).set(settings.output_value.value)
        return Lines(self)


def load(driver: str, machine: Machine) -> ModuleType:
    """Imports a driver's module with this machine's spidev and gpiod; again for another machine."""
    spidev, gpiod, line = ModuleType("spidev"), ModuleType("gpiod"), ModuleType("gpiod.line")
    vars(spidev).update(SpiDev=type("SpiDev", (SpiDev,), {"machine": machine}))
    vars(line).update(Direction=Direction, Value=Value)
    vars(gpiod).update(LineSettings=LineSettings, request_lines=machine.request_lines, line=line)
    sys.modules.update({"spidev": spidev, "gpiod": gpiod, "gpiod.line": line})
    for name in [n for n in sys.modules if n.split(".")[0] == driver.split(".")[0]]:
        del sys.modules[name]  # it took the names of the modules it was first imported with
    return importlib.import_module(driver)
