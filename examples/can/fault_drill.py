"""Inject faults one after the other and print what a host notices: lost samples, emergencies, flags, codes.

Starts its own emulator, whose time moves only while the script waits; so the same lines come each time.
"""

from collections import Counter
from typing import Any

import cantools
import numpy as np
from can import Message
from psabench import Bench

WINDOW_S = 0.3
DRILL: tuple[tuple[str, str, dict[str, float | str]], ...] = (
    ("sensor.bias", "a.sensor.x", {"bias_v": 0.1}),
    ("sensor.stuck", "a.sensor.x", {}),
    ("analog.ripple", "a.afe.x", {"amplitude_v": 0.001, "frequency_hz": 40}),
    ("chip.clock", "a.adc.x", {"clock_ppm": 2000}),
    ("chip.drdy_stuck", "a.adc.x", {"level": "high"}),
    ("controller.frozen_words", "a.kpsa", {}),
    ("link.drop", "bus.can0", {"probability": 0.05}),
    ("link.corrupt", "bus.can0", {"probability": 0.01}),
)
dbc: Any = cantools.database.load_file("proto/psabench.dbc")


class Witness:
    """What comes over CAN, as a navigation computer counts it."""

    def __init__(self) -> None:
        self.x_v: list[float] = []
        self.seen: Counter[str] = Counter()
        self.seq: int | None = None

    def on_message(self, m: Message) -> None:
        if m.is_error_frame or m.arbitration_id not in (0x185, 0x285, 0x085):
            return
        values = dbc.decode_message(m.arbitration_id, m.data, decode_choices=False)
        if m.arbitration_id == 0x085 and values["CODE"]:
            self.seen[f"EMCY {values['CODE']:04X}h"] += 1
        elif m.arbitration_id == 0x185:
            self.x_v.append(float(values["X"]))
            gap = 0 if self.seq is None else (int(values["SEQ"]) - self.seq - 1) % 65536
            self.seen["lost" if gap < 1000 else "odd SEQ"] += gap if gap < 1000 else 1
            self.seq = int(values["SEQ"])
        elif m.arbitration_id == 0x285:
            for flag in ("CLIP", "OVERRUN"):
                self.seen[flag] += int(values[flag])

    def words(self) -> str:
        x = np.array(self.x_v) if self.x_v else np.full(1, np.nan)
        seen = ", ".join(f"{what} {n}" for what, n in self.seen.items() if n)
        return f"{len(self.x_v):4} samples, X {x.mean():8.4f} V, sd {x.std() * 1e6:9.1f} uV   {seen}"


def watch(bench: Bench, name: str) -> None:
    witness = Witness()
    bench.host.listeners.append(witness.on_message)
    bench.wait(WINDOW_S)
    bench.host.listeners.remove(witness.on_message)
    print(f"{name:36} {witness.words()}".rstrip())


with Bench.start("stream", seed=1) as bench:
    bench.unit.wait_ready()
    bench.unit.start()
    bench.wait(0.1)
    watch(bench, "healthy")
    for kind, point, arguments in DRILL:
        with bench.fault(kind, point, **arguments):
            watch(bench, f"{kind} {point}")
        bench.wait(0.2)  # the filters settle again
    watch(bench, "healthy again")
