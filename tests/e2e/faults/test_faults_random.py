"""Faults of any kind at any point, many at once, begun by anything: the same each time, and over when cleared."""

from __future__ import annotations

import hashlib
import random
from pathlib import Path
from typing import Any

import pytest
from fault_host import SETUP_S, Host, fault_host
from psabench.errors import ControlError
from rig import HERE, SEED

pytestmark = pytest.mark.host

SCENARIO = HERE / "faults.yaml"
EVENTS = "RES SETUP_DONE SYNC_A SYNC_T DRD_A DRD_T INT_FALL INT_RISE POWER_DOWN POWER_UP".split()
ROUNDS = 150


def value(r: random.Random, row: dict[str, Any]) -> object:
    """Any value that the argument may have, its limits more often than others."""
    if row["type"] == "choice":
        return r.choice(row["choices"])
    low, high = row["min"], row["max"]
    x = r.choice([low, high, r.uniform(low, high), min(high, max(low, r.uniform(-10, 10)))])
    return int(x) if row["type"] == "integer" else x


def arguments(r: random.Random, kind: dict[str, Any]) -> dict[str, object]:
    args = {row["name"]: value(r, row) for row in kind["args"] if not row["optional"] or r.random() < 0.5}
    if not kind["once"]:
        args["for_s"] = r.choice([0.0005, 0.003, 0.02, 0.1])
    if r.random() < 0.4:
        after, since = r.sample(EVENTS, 2)
        args |= {
            "after": after,
            "count": r.randint(1, 5),
            "unit": r.choice("ab"),
            "delay_s": r.choice([0, 30e-6, 1e-3]),
        }
        if r.random() < 0.3:
            args["since"] = since
    return args


def disturb(host: Host, r: random.Random, kinds: list[dict[str, Any]]) -> bool:
    """One more fault, or something else; whether the fault was accepted."""
    kind = r.choice(kinds)
    points = [p for p in host.call("fault.points", kind=kind["kind"])["points"] if not p.startswith("client")]
    code = "accepted"
    try:
        host.add(kind["kind"], r.choice(points), **arguments(r, kind))
    except ControlError as e:
        code = e.code
    assert code in ("accepted", "point", "range")
    what = r.random()
    if what < 0.05:
        host.bus.send(0x000, bytes((0x81, 0)))
    elif what < 0.2:
        host.start()
    elif what < 0.3:
        host.turn(r.uniform(-180, 180))
    elif what < 0.33:
        host.call("fault.clear")
    host.bus.advance(r.choice([1e-4, 0.002, 0.01, 0.05]))
    return code == "accepted"


def run(seed: int, path: Path) -> str:
    """Digest of what came in the end, and of the lines of board a all the time."""
    r = random.Random(seed)
    with fault_host(SCENARIO) as host:
        kinds = [k for k in host.call("fault.kinds")["kinds"] if k["kind"] != "link.stall"]
        kinds = [k for k in kinds if host.call("fault.points", kind=k["kind"])["points"]]  # there is no platform here
        host.call("vcd.start", path=str(path), unit="a")
        accepted = sum(disturb(host, r, kinds) for _ in range(ROUNDS))
        assert accepted > ROUNDS / 2
        host.call("fault.clear")
        host.call("vcd.stop")
        host.bus.send(0x000, bytes((0x81, 0)))
        host.bus.advance(SETUP_S)
        host.start()
        host.bus.advance(0.2)
        seen = {unit: host.watch(unit, 0.05) for unit in host.node}
        assert {unit: s.complaints() for unit, s in seen.items()} == {"a": [], "b": []}
    return hashlib.sha256(repr(seen).encode() + path.read_bytes()).hexdigest()


def test_random_faults_are_the_same_each_time_and_over_when_cleared(tmp_path: Path) -> None:
    print(f"TEST_SEED={SEED}")
    assert run(SEED, tmp_path / "one.vcd") == run(SEED, tmp_path / "two.vcd")
