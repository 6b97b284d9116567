"""The shell's own commands but those of the device: time, CAN and SCPI as they are, checks, the session itself."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from psabench.bench import NS, Bench, slices_s
from psabench.errors import BenchError, expected
from psabench.instruments import KINDS, Instrument
from psabench.link.can_host import Message
from psabench.link.own import replace_file
from psabench.link.protocol_files import message_name
from psabench.shell import dut
from psabench.shell.commands import EVENTS, OBJECTS, Arg, Kind
from psabench.shell.expect import USAGE, Expectation
from psabench.shell.grammar import describe
from psabench.shell.lexer import Wrong
from psabench.shell.row import Args, Context, Handler, Row, number, row

SLICE_NS = NS // 10  # of a wait, between two looks at Ctrl-C and the status
SHOWN = 32  # CAN frames that are listed
LISTEN_S = 0.02  # bench time in which an answer is waited for
FRAME = re.compile(r"(?P<id>[0-9A-Fa-f]{3})#(?P<fd>#[0-9A-Fa-f])?(?P<data>(?:[0-9A-Fa-f]{2}\.?)*)")
FRAME_USAGE = "ID#DATA in hexadecimal, as 605#4018100400000000; an FD frame with ##F"

# ---- time


def pass_time(session: Context, for_s: float) -> None:
    """Let the bench's time pass, in slices."""
    for slice_s in slices_s(for_s, SLICE_NS):
        session.bench.wait(slice_s)
        session.tick()


def _wait(session: Context, args: Args) -> Mapping[str, Any]:
    pass_time(session, number(args, "for_s"))
    return {}


def _at(session: Context, args: Args) -> Mapping[str, Any]:
    now_ns = session.now_ns()
    assert now_ns is not None
    left_ns = round(number(args, "t_s") * NS) - now_ns
    if left_ns > 0:
        pass_time(session, left_ns / NS)
    return {"late_s": -left_ns / NS} if left_ns < 0 else {}


def _until(session: Context, args: Args) -> Mapping[str, Any]:
    unit = args.get("unit")
    session.bench.run_until(
        str(args["event"]),
        int(number(args, "count", 1)),
        unit=None if unit is None else str(unit),
        limit_s=number(args, "limit_s", 60.0),
    )
    return _time(session, {})


def _time(session: Context, _: Args) -> Mapping[str, Any]:
    t_ns = session.now_ns()
    return {"t_s": time.monotonic() if t_ns is None else t_ns / NS, "pace": session.bench.pace}


# ---- as it is


def _listen(session: Context, args: Args) -> Mapping[str, Any]:
    heard: list[Message] = []
    host = session.dut.host
    host.listeners.append(heard.append)
    try:
        pass_time(session, number(args, "for_s", LISTEN_S))
    finally:
        host.listeners.remove(heard.append)
    boards = {u.node.node_id: u.board for u in session.bench.units.values() if u.host is host}
    rows = [_frame_row(m, boards) for m in heard[:SHOWN]]
    return {"frames": rows, **({"more": len(heard) - SHOWN} if len(heard) > SHOWN else {})}


def _frame_row(m: Message, boards: Mapping[int, str]) -> dict[str, Any]:
    can_id, name = f"{m.arbitration_id:03X}", message_name(m.arbitration_id, boards)
    if m.is_error_frame:
        can_id, name = "error", ""
    return {"t_s": m.timestamp, "id": can_id, "data": bytes(m.data).hex().upper(), "name": name}


def _send(session: Context, args: Args) -> Mapping[str, Any]:
    text = str(args["frame"])
    m = FRAME.fullmatch(text)
    data = bytes.fromhex(m["data"].replace(".", "")) if m else b""
    if not m or int(m["id"], 16) > 0x7FF or len(data) > (64 if m["fd"] else 8):
        raise Wrong(expected(FRAME_USAGE, repr(text), "frame"))
    session.dut.host.send(int(m["id"], 16), data, fd=bool(m["fd"]))
    return _listen(session, {"for_s": LISTEN_S})


def instrument(session: Context, name: str) -> Instrument:
    """An instrument with an address."""
    if name not in session.bench.addresses:
        raise Wrong(expected(", ".join(session.bench.addresses) or "no name", repr(name), "instrument"))
    found: Instrument = getattr(session.bench, name)
    return found


def _scpi(session: Context, args: Args) -> Mapping[str, Any]:
    on, line = instrument(session, str(args["instrument"])), str(args["line"])
    if "?" in re.sub(r'"[^"]*"|\'[^\']*\'', "", line):
        return {"answer": on.query(line)}
    on.write(line)
    return {}


# ---- the session


def _expect(session: Context, args: Args) -> Mapping[str, Any]:
    failed = Expectation.parse(str(args["check"])).failure(session.latest)
    return {"failed": failed} if failed else {}


def _save(session: Context, args: Args) -> Mapping[str, Any]:
    path = Path(str(args["file"]))
    text = session.transcript.script(session.now_ns())
    replace_file(path, text)
    return {"file": str(path), "lines": text.count("\n")}


def _help(session: Context, args: Args) -> Mapping[str, Any]:
    commands, wanted = session.vocabulary.commands, str(args.get("command", ""))
    if not wanted:
        absent = [{"object": n, "about": f"not available: {why}"} for n, why in session.vocabulary.absent.items()]
        here = {c.split(".")[0] for c in commands if "." in c}
        things = [{"object": n, "about": OBJECTS.get(n, "")} for n in OBJECTS if n in here]
        plain = [{"command": c.usage, "about": c.what} for n, c in commands.items() if "." not in n]
        return {"objects": things + absent, "commands": plain}
    if wanted in session.vocabulary.absent:
        raise BenchError(f"{wanted}: not available: {session.vocabulary.absent[wanted]}")
    found = [c for n, c in sorted(commands.items()) if n == wanted or n.startswith(f"{wanted}.")]
    if not found:
        raise Wrong(expected("a command or object that help lists", repr(wanted), "help"))
    if len(found) > 1:
        return {"commands": [{"command": c.usage, "about": c.what} for c in found]}
    rows = [{"argument": a.name, "needed": not a.optional, "about": describe(a)} for a in found[0].args]
    return {"usage": found[0].usage, "about": found[0].what, "arguments": rows}


# ---- the table


def _with_control(bench: Bench) -> bool:
    return bench.pace != "real"


_FOR = Arg(name="for_s", kind=Kind.REAL, unit="s", low=0, high=86400, what="of the bench's time")
_AT = Arg(name="t_s", kind=Kind.REAL, unit="s", low=0, high=1e9, what="simulated time since power-on")
_EVENT = Arg(name="event", choices=EVENTS, strict=False, what="of a board")
_COUNT = Arg(name="count", kind=Kind.COUNT, optional=True, low=1, high=1e9, what="how many of them")
_UNIT = Arg(name="unit", optional=True, what="the first without it")
_LIMIT = Arg(
    name="limit_s", kind=Kind.REAL, unit="s", optional=True, low=0, high=86400, what="timeout, 60 s without it"
)
_CHECK = Arg(name="check", kind=Kind.REST, what=USAGE)
_FILE = Arg(name="file", what="for psabench run script")
_COMMAND = Arg(name="command", optional=True, what="its name")
_FRAME = Arg(name="frame", kind=Kind.REST, what=FRAME_USAGE)
_INSTRUMENT = Arg(name="instrument", kind=Kind.CHOICE, choices=tuple(KINDS), what="which")
_LINE = Arg(name="line", kind=Kind.REST, what="as *IDN? or TEMP 25")


ROWS: tuple[Row, ...] = (
    row("wait", "Lets time pass: simulated in step pace, else real.", _wait, _FOR),
    row("at", "Waits until a simulated instant; tells by how much it is over.", _at, _AT, here=_with_control),
    row(
        "until",
        "Waits for an event of a unit; in step pace time stands still at it.",
        _until,
        *(_EVENT, _COUNT, _UNIT, _LIMIT),
        here=_with_control,
    ),
    row("time", "Tells the time and the pace.", _time),
    row("expect", "Checks the latest result; a script in which one fails ends with status 1.", _expect, _CHECK),
    row("save", "Writes what was said as a script.", _save, _FILE),
    row("help", "Tells of all, an object or a command.", _help, _COMMAND),
    *dut.ROWS,
    row("can.send", "Sends a frame and lists what comes within 20 ms.", _send, _FRAME, here=dut.here),
    row("can.listen", "Lists the frames that come.", _listen, replace(_FOR, optional=True), here=dut.here),
    row(
        "scpi.send",
        "Sends a line; shows the answer to a query.",
        _scpi,
        _INSTRUMENT,
        _LINE,
        here=lambda bench: bool(bench.addresses),
    ),
)
HANDLERS: Mapping[str, Handler] = {row.command.name: row.run for row in ROWS}
UNSAID = {"save", "help"}  # what a script need not say again
