"""One unit on CAN or on its parallel bus as a host meets it; its cases are in boards/<name>/conform/host_cases.py."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from psabench.boards.registry import BOARDS
from psabench.conform.host.cases_can import NODE, Case

INPUT_V = (1.2, -0.6, 0.024)  # article: 1.2 V/g


def scenario(volts: tuple[float, float, float] = INPUT_V, degc: float = 25.0) -> str:
    """One unit with steady inputs; BOARD and PROFILE are filled in."""
    axes = "\n".join(
        f"      {axis}: {{sensor: mems, u0_v: {v}, kx_v_per_g: 0.0}}" for axis, v in zip("xyz", volts, strict=True)
    )
    return f"""\
seed: 1
bus: {{bitrate_hz: 1000000}}
site: {{g_mps2: 9.8}}
units:
  - name: a
    board: BOARD
    profile: PROFILE
    node: {NODE}
    serial: 1
    temp_degc: [{degc}, {degc}, {degc}, {degc}]
    axes:
{axes}
"""


def _parts(name: str) -> Iterator[ModuleType]:
    """That module of the conform folder of each board that has it."""
    for board in BOARDS:
        module = f"psabench.boards.{board}.conform.{name}"
        if find_spec(module):
            yield import_module(module)


UNIT_CASES: Mapping[str, Case] = {case.name: case for part in _parts("host_cases") for case in part.CASES}


def load_checks() -> None:
    """Import them: they register themselves."""
    for _ in _parts("host_checks"):
        pass
