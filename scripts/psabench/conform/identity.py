"""Who was tested, with what: facts for the head of a report."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from importlib.metadata import version

from psabench.boards.objects import Common
from psabench.conform.dut import Dut
from psabench.conform.requirements import INDEX, requirements
from psabench.errors import BenchError
from psabench.places import find_emulator, proto_file

# Objects of CiA 301 that name a device: what a report calls them.
OBJECTS: Mapping[str, tuple[int, int]] = {
    "device": (Common.DEVICE_NAME, 0),
    "hardware": (Common.HARDWARE_VERSION, 0),
    "software": (Common.SOFTWARE_VERSION, 0),
    "serial number": (Common.IDENTITY, 4),
}


def suite_facts() -> dict[str, str]:
    """Of the suite itself."""
    return {
        "suite": f"psabench {version('psabench')}",
        "requirements": f"version {requirements().version}, {requirements_hash()[:16]}",
        "date": datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
    }


def requirements_hash() -> str:
    """SHA-256 over the files of the requirements in order."""
    digest = hashlib.sha256(proto_file(INDEX).read_bytes())
    for group in requirements().groups:
        digest.update(proto_file(f"requirements/{group.name}.yaml").read_bytes())
    return digest.hexdigest()


def dut_facts(s: Dut) -> dict[str, str]:
    """What the board says of itself, and how it was reached."""
    found = {"board": s.variant.name}
    for name, (index, sub) in OBJECTS.items():
        with suppress(BenchError):
            found[name] = str(s.unit.node.read(index, sub))
    found["node"] = str(s.node)
    found["probes"] = ", ".join(sorted(s.probes))
    if s.bench.emulator is not None:
        found["emulator"] = f"psa-emu, {hashlib.sha256(find_emulator().read_bytes()).hexdigest()[:16]}"
    return found
