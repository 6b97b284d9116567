"""Host side of psabench: converter boards over CAN and the line port, instruments, calibration procedures.

    from psabench import Bench

    with Bench.start("quiet") as bench:
        bench.unit.register("x", "CONFIG0")   # of the converter of channel X
        bench.unit.stream(100).axis("x")      # volts at the load, shape (100,)

`psabench.load("build/run")` gives what a run left on disk as arrays with units.

Conventions, everywhere: SI inside, the unit at the end of a name (u_v, t_s, angle_deg); voltages are at the board's
load resistors, before its divider; g is the local gravity, coefficients are per local g; time is the bench's, seconds
since power-on, simulated or real. Raw integers end in `frames` and `lineport`.

Everything raises `errors.BenchError` or one of its kinds when the bench is at fault, `ValueError` for bad arguments.
"""

from typing import TYPE_CHECKING

from psabench import moved

__all__ = ["Bench", "load"]

moved.install()

if TYPE_CHECKING:
    from psabench.bench import Bench
    from psabench.report.load import load_run as load
else:
    _HOMES = {"Bench": ("bench", "Bench"), "load": ("report.load", "load_run")}

    def __getattr__(name: str) -> object:
        """Loaded when asked for: `psa-emu` and `psabench.chips` start at once, without NumPy and python-can."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        module, own = _HOMES[name]
        return getattr(import_module(f"psabench.{module}"), own)
