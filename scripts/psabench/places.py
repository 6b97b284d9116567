"""Where the parts of psabench lie that are not Python: emulator, library, protocol files.

An environment variable names one place and no other. Without it: `bundle/` in this package, which a wheel brings and
which is laid out like an installation (bin, lib, include, share/psabench); the checkout around this file; the system.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from psabench.errors import BadInput, expected

PACKAGE = Path(__file__).resolve().parent
BUNDLE = PACKAGE / "bundle"
CHECKOUT = PACKAGE.parents[1]


def own_emulators() -> list[Path]:
    """Where psa-emu of this very package would be: in the bundle, in the build tree of the checkout."""
    return [BUNDLE / "bin" / "psa-emu", CHECKOUT / "build" / "psa-emu"]


def executable(path: Path) -> bool:
    """Is it a file that this user may run?"""
    return path.is_file() and os.access(path, os.X_OK)


def find_emulator() -> Path:
    """Path of psa-emu: $PSA_EMU, the bundle, the build tree of this checkout, or the PATH. Raises BadInput."""
    on_path = [Path(d) / "psa-emu" for d in os.environ.get("PATH", "").split(os.pathsep) if d]
    return _find("psa-emu", "PSA_EMU", own_emulators(), on_path, executable)


def find_library(name: str, variable: str = "PSABENCH_LIB") -> Path | None:
    """Path of a shared library: $variable, the bundle, this checkout; None: the system's loader may know it."""
    ours = [BUNDLE / "lib" / name, CHECKOUT / "build" / name]
    if not os.environ.get(variable) and not any(p.is_file() for p in ours):
        return None
    return _find(name, variable, ours, [], Path.is_file)


def proto_file(name: str) -> Path:
    """Path of a file of proto/: in $PSABENCH_PROTO, the bundle, this checkout, or after `make install`."""
    named = os.environ.get("PSABENCH_PROTO")
    bundled, installed = (root / "share" / "psabench" / "proto" for root in (BUNDLE, Path(sys.prefix)))
    folders = [Path(named)] if named else [bundled, CHECKOUT / "proto", installed]
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise BadInput(expected(f"a file in {' or '.join(str(p) for p in folders)} (or PSABENCH_PROTO)", "none", name))


def mavlink_module() -> Path:
    """Path of our MAVLink dialect's generated Python module: the bundle, this checkout, or after `make install`."""
    bundled, installed = (root / "share" / "psabench" / "mavlink" for root in (BUNDLE, Path(sys.prefix)))
    places = [folder / "psabench_mavlink.py" for folder in (bundled, CHECKOUT / "build/gen/mavlink", installed)]
    return _find("psabench_mavlink.py", "PSABENCH_MAVLINK", places, [], Path.is_file)


def _find(what: str, variable: str, ours: Sequence[Path], more: Sequence[Path], fits: Callable[[Path], bool]) -> Path:
    named = os.environ.get(variable)
    for place in [Path(named)] if named else [*ours, *more]:
        if fits(place):
            return place
    where = f"{variable}={named}" if named else f"{' or '.join(str(p) for p in ours)} or on the PATH"
    raise BadInput(expected(f"a file at {where} (make builds it)", "none", what))
