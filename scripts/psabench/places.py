"""Where the parts of psabench lie that are not Python: emulator, library, protocol files; which packages are there.

An environment variable names one place and no other. Without it: `bundle/` in this package, which a wheel brings and
which is laid out like an installation (bin, lib, include, share/psabench); the checkout around this file; the system.

The extras are those of pyproject.toml, read from the metadata of the installation (docs/tools/packages.md).
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path

from psabench.errors import BadInput, expected

PACKAGE = Path(__file__).resolve().parent
BUNDLE = PACKAGE / "bundle"
CHECKOUT = PACKAGE.parents[1]
_REQUIREMENT = re.compile(r"([\w.-]+).*\bextra\s*==\s*['\"]([\w-]+)['\"]")
# Distributions whose module has another name than theirs.
_MODULES = {"dask": "distributed", "ipython": "IPython", "foxglove-sdk": "foxglove", "mcap-ros2-support": "mcap_ros2"}


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


def need_extra(extra: str, where: object) -> None:
    """For a command, before it starts. Raises BadInput where a package is not installed; loads none of them."""
    from importlib import util  # it and metadata take longer to load than most commands need for --help

    for name, module in extra_packages():
        if name == extra and util.find_spec(module) is None:
            raise _missing_extra(extra, where)


def no_package(e: ImportError, where: object) -> BadInput:
    """The error of a command that could not load a package of others."""
    module = (e.name or "").partition(".")[0]
    extra = next((name for name, of_it in extra_packages() if of_it == module), "")
    return _missing_extra(extra, where) if extra else BadInput(expected(f"the Python package {e.name}", "none", where))


def _missing_extra(extra: str, where: object) -> BadInput:
    return BadInput(f"{expected(f'the extra {extra!r}', 'none', where)}; pip install 'psabench[{extra}]'")


@cache
def extra_packages() -> Sequence[tuple[str, str]]:
    """Extra and module of each package of an extra; none where psabench is not installed."""
    from importlib import metadata

    try:
        return tuple(_of_extras(metadata.requires("psabench") or ()))
    except metadata.PackageNotFoundError:
        return ()


def _of_extras(requirements: Sequence[str]) -> Iterator[tuple[str, str]]:
    for text in requirements:
        if m := _REQUIREMENT.match(text):
            yield m[2], _MODULES.get(m[1].lower(), m[1].replace("-", "_"))
