"""What a host of any unit must have told; checks of one board are in boards/<name>/conform/host_checks.py."""

from __future__ import annotations

from psabench.conform.host.check import HostCapture
from psabench.conform.host.results import Reading
from psabench.conform.verdict import Failed


def readings_told(e: HostCapture) -> list[Reading]:
    if not e.streamed:
        raise Failed(f"no stream was started{e.last_words()}", "NMT start")
    if not e.told.readings:
        raise Failed(f"no reading was reported{e.last_words()}", '{"reading": ...}')
    return e.told.readings
