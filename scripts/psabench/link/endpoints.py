"""The endpoints of a running emulator: how python-can opens its buses, and VISA its instruments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from psabench.instruments import visa_address
from psabench.link.control import Control

FIRST = "can0"  # name of a bus that has no other


def emulator_endpoints(control: Path) -> list[dict[str, str]]:
    """Those of an emulator that is there. Raises LinkError."""
    with Control(control) as c:
        return [{k: str(v) for k, v in e.items()} for e in c.call("endpoints").result["endpoints"]]


def opening_order(endpoint: Mapping[str, str]) -> int:
    """Adapters that more than one program may open come first: a pseudo-terminal and a tunnel have room for one."""
    return ("socketcand", "socketcan", "udp", "slcan", "cannelloni").index(endpoint["can"]) if "can" in endpoint else -1


def emulator_buses(endpoints: Sequence[Mapping[str, str]], control: Path | None) -> dict[str, str | None]:
    """How python-can opens the buses of an emulator that units are on, by name, through its `ready` endpoints."""
    with ExitStack() as stack:
        units = stack.enter_context(Control(control)).call("units").result["units"] if control else []
    buses = list(dict.fromkeys(u.get("bus", FIRST) for u in units)) or [FIRST]
    found: dict[str, str | None] = {}
    for e in (e for e in endpoints if "can" in e):
        # a socketcand without a bus of its own serves them all, by the name that a client opens
        serves = [e["bus"]] if "bus" in e else buses if e["can"] == "socketcand" else buses[:1]
        for bus in serves:
            found.setdefault(bus, bus_spec(e, bus if len(buses) > 1 else None))
    return found


def bus_spec(endpoint: Mapping[str, str], bus: str | None = None) -> str:
    """How python-can opens a CAN endpoint of an emulator; bus: its name there, for a server of several."""
    kind = endpoint["can"]
    if kind == "socketcand":
        return f"socketcand:{endpoint['host']}:{endpoint['port']}" + (f",channel={bus}" if bus else "")
    if kind == "slcan":
        return f"slcan:{endpoint['pty']}"
    if kind == "cannelloni":
        return f"cannelloni:{endpoint['port']}:{endpoint['peer_port']}"
    if kind == "udp":
        return f"udp:[{endpoint['group']}]:{endpoint['port']}"
    return f"socketcan:{endpoint['channel']},fd=true,receive_own_messages=false"


def scpi_addresses(endpoints: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """VISA addresses of an emulator's instruments, by name."""
    return {e["scpi"]: visa_address(e) for e in endpoints if "scpi" in e}
