"""Earlier names of public modules: `import psabench.lineport` gives psabench.link.lineport."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

NAMES = {
    "device": "boards.psa2.device",
    "devices": "boards.devices",
    "frames": "boards.psa2.frames",
    "readings": "boards.readings",
    "unit": "boards.unit",
    "busport": "link.busport",
    "can_host": "link.can_host",
    "can_log": "link.can_log",
    "canopen_host": "link.canopen_host",
    "control": "link.control",
    "lineport": "link.lineport",
    "probe": "link.probe",
    "protocol_files": "link.protocol_files",
    "signals": "link.signals",
    "vcd": "link.vcd",
    "nav": "native.nav",
    "nav_mc": "native.nav_mc",
    "store": "campaign.store",
    "waveform": "report.waveform",
}
PACKAGE = "psabench."


class _Finder:
    """Finds an earlier name; the module is the one of today, imported once."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: object = None) -> ModuleSpec | None:
        now = NAMES.get(name.removeprefix(PACKAGE)) if name.startswith(PACKAGE) else None
        return ModuleSpec(name, _Loader(PACKAGE + now)) if now else None  # type: ignore[arg-type]


class _Loader:
    def __init__(self, now: str) -> None:
        self._module = import_module(now)
        self._spec = self._module.__spec__

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return self._module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # importlib has put that of the earlier name there


def install() -> None:
    """Behind all other finders: a module of that name comes first."""
    sys.meta_path.append(_Finder())
