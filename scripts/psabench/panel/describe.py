"""What a bench has, for the page, from the tables that there are: commands, registers with their fields, units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from psabench.boards.unit import Unit
from psabench.link.protocol_files import message
from psabench.shell.commands import Arg, Command
from psabench.shell.registers import FIELDS, group
from psabench.shell.session import Session

# A page may not end or double the emulator under other programs' hands: the terminal can.
NOT_HERE = ("bench.quit", "bench.fork", "help")


def describe_argument(a: Arg) -> dict[str, Any]:
    """One input of a form."""
    limits = {k: v for k, v in (("low", a.low), ("high", a.high)) if not math.isinf(v)}
    return {
        "name": a.name,
        "kind": a.kind.name.lower(),
        "unit": a.unit,
        "optional": a.optional,
        "choices": list(a.offers),
        "strict": a.strict,
        "what": a.what,
        **limits,
    }


def describe_command(c: Command) -> dict[str, Any]:
    """One form; of a fault one for each kind."""
    found: dict[str, Any] = {"what": c.what, "args": [describe_argument(a) for a in c.args]}
    if c.variants:
        found["variants"] = {name: describe_command(variant) for name, variant in c.variants.items()}
        found["args"] = [describe_argument(c.args[0])]
    return found


def register_fields(unit: Unit) -> dict[str, Any]:
    """By bank and register: its fields with mask, shift and meanings; [] where a register is a plain number."""
    found: dict[str, Any] = {}
    for bank in unit.banks:
        key = unit.board if bank == "bus" else group(bank)
        rows = {name: FIELDS.get((key, name), ()) for name in unit.registers(bank).values()}
        found[bank] = {
            name: [
                {"name": b.name, "high": b.mask >> b.shift, "meaning": {str(k): v for k, v in b.meaning.items()}}
                for b in fields
            ]
            for name, fields in rows.items()
        }
    return found


def signal_choices(unit: Unit) -> dict[str, Any]:
    """By signal of its readings: what its numbers mean, where the DBC has words for them."""
    layout = getattr(unit, "layout", None)
    signals = [s for name in layout.messages for s in message(name).signals] if layout else []
    return {s.name: {str(k): str(v) for k, v in s.choices.items()} for s in signals if s.choices}


def describe_bench(session: Session) -> Mapping[str, Any]:
    """All of it."""
    bench = session.bench
    return {
        "pace": bench.pace,
        "units": [{"name": n, "board": u.title, "node": u.node.node_id} for n, u in bench.units.items()],
        "unit": session.dut_name,
        "registers": register_fields(session.dut) if bench.units else {},
        "choices": signal_choices(session.dut) if bench.units else {},
        "commands": {n: describe_command(c) for n, c in session.vocabulary.commands.items() if n not in NOT_HERE},
        "absent": dict(session.vocabulary.absent),
        "truth": bench.truth_path is not None,
    }
