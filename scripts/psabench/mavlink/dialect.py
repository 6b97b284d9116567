"""The Python module of proto/mavlink/psabench.xml, which the build generates. Imports pymavlink."""

from __future__ import annotations

import importlib.util
import os
import sys
from functools import cache
from types import ModuleType

import pymavlink.dialects.v20 as dialects

from psabench.errors import BadInput, expected
from psabench.places import mavlink_module

NAME = "psabench"
PYMAVLINK = f"pymavlink.dialects.v20.{NAME}"


@cache
def mavlink() -> ModuleType:
    """Constants, message classes and the class MAVLink. Raises BadInput where the module was not built.

    pymavlink's own programs find it, too: `mavutil.set_dialect("psabench")` after this call.
    """
    path = mavlink_module()
    os.environ.setdefault("MAVLINK20", "1")  # mavutil speaks version 1 otherwise
    spec = importlib.util.spec_from_file_location(PYMAVLINK, path)
    if spec is None or spec.loader is None:
        raise BadInput(expected("a Python module", "another file", path))
    module = importlib.util.module_from_spec(spec)
    sys.modules[PYMAVLINK] = module
    spec.loader.exec_module(module)
    setattr(dialects, NAME, module)
    return module
