"""A Raspberry Pi's pigpio over a simulated chip, so that drivers for it run here as they are.

A driver that was written for hardware touches it in three places, and all three are replaced from outside:

1. `import pigpio` finds the module made here, because it is in sys.modules before the driver is imported;
2. the object `pigpio.pi()` passes levels and bytes to a part of a psabench bench: 15 lines for this API, and as few
   for spidev, RPi.GPIO or whatever yours talks to;
3. the name `time` in the driver's modules is a clock that moves the bench: a sleep takes no real time, and the chip
   goes on working meanwhile.

`with_pipyadc.py` uses it.
"""

import importlib
import sys
from types import ModuleType

from psabench.chips import Bench, Part


class Pi:
    """What `pigpio.pi()` returns, with one chip on its SPI bus and some of its GPIO numbers wired to pins."""

    connected = True

    def __init__(self, chip: Part, wiring: dict[int, str]) -> None:
        self.chip = chip
        self.pins = {gpio: chip.pins[name] for gpio, name in wiring.items()}

    def set_mode(self, gpio: int, mode: int) -> int:
        return 0  # which side drives a line follows from the chip's pin

    def write(self, gpio: int, level: int) -> int:
        if gpio in self.pins:  # others are wired to something that is not here
            self.pins[gpio].set(level)
        return 0

    def read(self, gpio: int) -> int:
        return self.pins[gpio].level if gpio in self.pins else 0

    def spi_open(self, spi_channel: int, baud: int, spi_flags: int = 0) -> int:
        self.chip.spi_clock(baud, gap_s=1 / baud)  # a Pi's SPI pauses for a clock between bytes
        return 0

    def spi_xfer(self, handle: int, data: list[int]) -> tuple[int, bytearray]:
        received = bytearray(self.chip.spi(bytes(data)))  # a number above 255 is a ValueError, as it is there
        return len(received), received

    def spi_write(self, handle: int, data: list[int]) -> int:
        return self.spi_xfer(handle, data)[0]

    def spi_read(self, handle: int, count: int) -> tuple[int, bytearray]:
        return self.spi_xfer(handle, [0] * count)

    def spi_close(self, handle: int) -> int:
        return 0

    def stop(self) -> None:
        pass


class SimulatedTime:
    """The module `time` for a driver: the bench's time."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.sleep = bench.run_for

    def time(self) -> float:
        return self.bench.now_ns * 1e-9

    monotonic = perf_counter = time


def load(driver: str, pi: Pi) -> ModuleType:
    """Imports a driver's package and gives it this Pi and this Pi's time; again for another Pi."""
    pigpio = ModuleType("pigpio")
    vars(pigpio).update(INPUT=0, OUTPUT=1, pi=lambda: pi)
    sys.modules["pigpio"] = pigpio
    package = importlib.import_module(driver)
    clock = SimulatedTime(pi.chip.bench)
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] == driver:
            for used, replacement in (("pigpio", pigpio), ("time", clock)):
                if isinstance(getattr(module, used, None), (ModuleType, SimulatedTime)):
                    setattr(module, used, replacement)
    return package
