"""What the shell can do with the device: registers with their fields, stream, objects, state. Over CAN alone."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import Form, Frames
from psabench.boards.readings import Readings
from psabench.boards.unit import BANKS, Unit
from psabench.errors import CycleRefused, expected
from psabench.link.signals import Floats
from psabench.shell import registers
from psabench.shell.commands import Arg, Command, Kind
from psabench.shell.lexer import Wrong
from psabench.shell.row import Args, Context, Handler, Row, number, row

CONVERTERS = tuple(BANKS)
A_WORD = "a word, as A55Ah"
PSA2_ONLY = ("dut.opcode", "dut.form")
BUS = "bus"  # the board's parallel bus: a read is a cycle, which the board may reject


def here(bench: Bench) -> bool:
    """Whether there is a device: a unit on a bus that was opened."""
    return bool(bench.units)


def _unit_names(dut: Unit, converter: str) -> dict[int, str]:
    """Addresses and names of a converter's or the bus's registers, from the EDS."""
    try:
        return dut.registers(converter)
    except ValueError as e:
        raise Wrong(f"converter: {e}") from e


def _psa2(session: Context) -> Psa2:
    """The unit, for what only a PSA-2 has."""
    if isinstance(session.dut, Psa2):
        return session.dut
    raise Wrong(expected("a PSA-2 for this command", f"{session.dut_name}, a {session.dut.title}", "unit"))


def of_unit(command: Command, unit: Unit) -> Command:
    """A command of `dut` as it is with this unit: of its choices those that the unit has are offered."""
    if command.name in PSA2_ONLY and not isinstance(unit, Psa2):
        args = tuple(replace(a, offered=()) for a in command.args)
        return replace(command, what=f"Not of a {unit.title}: only a PSA-2 has this.", args=args)
    banks = tuple(unit.banks)
    narrowed = {_CONVERTER.name: {"offered": banks}} | ({_VALUE.name: {"what": A_WORD}} if banks == (BUS,) else {})
    changes = narrowed if command.arg(_CONVERTER.name) else {}
    return replace(command, args=tuple(replace(a, **changes.get(a.name, {})) for a in command.args))


def _address(session: Context, args: Args) -> tuple[str, int, str]:
    converter, wanted = str(args["converter"]), str(args["register"])
    names = _unit_names(session.dut, converter)
    for address, name in names.items():
        if wanted.upper() == name.upper() or wanted.upper() == f"{address:02X}H":
            return converter, address, name
    raise Wrong(expected(f"{', '.join(names.values())} or an address (01h)", repr(wanted), f"register of {converter}"))


def _register_row(session: Context, converter: str, address: int, name: str) -> dict[str, Any]:
    value = session.dut.register(converter, address)
    return {
        "address": f"{address:02X}h",
        "register": name,
        "value": f"{value:04X}h" if converter == BUS else f"{value:02X}h",
        "fields": registers.explain(session.dut.board if converter == BUS else converter, name, value),
    }


def _row_or_refusal(session: Context, converter: str, address: int, name: str) -> dict[str, Any]:
    """In a list of all of them a cycle that the board rejects now is one of the things to see."""
    try:
        return _register_row(session, converter, address, name)
    except CycleRefused as e:
        return {"address": f"{address:02X}h", "register": name, "value": "-", "fields": e.text}


def _registers(session: Context, args: Args) -> Mapping[str, Any]:
    converter = str(args.get("converter", next(iter(session.dut.banks), BUS)))
    names = _unit_names(session.dut, converter)
    return {"registers": [_row_or_refusal(session, converter, a, n) for a, n in names.items()]}


def _register(session: Context, args: Args) -> Mapping[str, Any]:
    return _register_row(session, *_address(session, args))


def _write(session: Context, args: Args) -> Mapping[str, Any]:
    converter, address, name = _address(session, args)
    text = str(args["value"])
    if converter == BUS:
        session.dut.write_register(converter, address, registers.word(name, text))
        return {}
    before = session.dut.register(converter, address) if "=" in text else 0
    session.dut.write_register(converter, address, registers.changed(converter, name, before, text))
    return _register_row(session, converter, address, name)


def _opcode(session: Context, args: Args) -> Mapping[str, Any]:
    _psa2(session).opcode(str(args["group"]), int(number(args, "code")))
    return {}


def _read_object(session: Context, args: Args) -> Mapping[str, Any]:
    value = session.dut.node.read(int(number(args, "index")), int(number(args, "sub")))
    return {"value": value.hex() if isinstance(value, bytes) else value}


def _object_value(text: str) -> int | float:
    whole = registers.number(text)
    if whole is not None:
        return whole
    try:
        return int(text, 0)
    except ValueError:
        return float(text)


def _write_object(session: Context, args: Args) -> Mapping[str, Any]:
    index, sub, text = int(number(args, "index")), int(number(args, "sub")), str(args["value"])
    try:
        session.dut.node.write(index, sub, text if session.dut.node.is_text(index, sub) else _object_value(text))
    except (TypeError, ValueError, AttributeError, struct.error) as e:  # python-canopen cannot make its type of it
        raise Wrong(f"value: {text!r}: {e}") from e
    return {}


def _stream(session: Context, args: Args) -> Mapping[str, Any]:
    taken = session.dut.stream(int(number(args, "count", 100)))
    lost = session.dut.frames.counters.lost
    return _of_frames(taken, lost) if isinstance(taken, Frames) else _of_readings(taken, lost)


def _of_readings(taken: Readings, lost: int) -> Mapping[str, Any]:
    """Mean and spread of each column."""
    rows = [{"signal": name, "unit": taken.units[name], **_spread(c)} for name, c in taken.columns.items()]
    return {"frames": len(taken), "lost": lost, "signals": rows}


def _of_frames(frames: Frames, lost: int) -> Mapping[str, Any]:
    return {
        "frames": len(frames),
        "settled": bool(np.all(frames.settled)),
        "clipped": bool(np.any(frames.clipped)),
        "lost": lost,
        "axes": [{"axis": axis, **_spread(frames.axis(axis), "_v")} for axis in "xyz"],
    }


def _spread(x: Floats, unit: str = "") -> dict[str, float]:
    """unit: the end of the names."""
    figures = {"mean": x.mean(), "std": x.std(), "min": x.min(), "max": x.max()}
    return {name + unit: float(value) for name, value in figures.items()}


def _form(session: Context, args: Args) -> Mapping[str, Any]:
    if "form" in args:
        _psa2(session).form = Form[str(args["form"]).upper()]
    return {"form": _psa2(session).form.name.lower()}


def _use(session: Context, args: Args) -> Mapping[str, Any]:
    name = str(args.get("unit", session.dut_name))
    if name not in session.bench.units:
        raise Wrong(expected(", ".join(session.bench.units), repr(name), "unit"))
    session.use(name)
    return {"unit": name, "node": session.dut.node.node_id}


def _simple(call: Callable[[Unit], object]) -> Handler:
    def run(session: Context, _: Args) -> Mapping[str, Any]:
        call(session.dut)
        return {}

    return run


# ---- the table

_CONVERTER = Arg(
    name="converter",
    kind=Kind.CHOICE,
    choices=CONVERTERS,
    what="x, y, z: accelerometers; t: temperature; bus: cycles on the board's parallel bus",
)
_REGISTER = Arg(name="register", what="name, as CONFIG0, or address, as 01h")
_VALUE = Arg(name="value", what="a byte (56h), or fields (DR=3,PHASE=0)")
_GROUP = Arg(name="group", kind=Kind.CHOICE, choices=("accel", "temp"), what="which converters")
_CODE = Arg(name="code", kind=Kind.COUNT, low=0, high=255, what="the byte, as 04h: SYNC")
_COUNT = Arg(name="count", kind=Kind.COUNT, optional=True, low=1, high=1e6, what="samples, 100 without it")
_FORM = Arg(
    name="form", kind=Kind.CHOICE, optional=True, choices=tuple(f.name.lower() for f in Form), what="frame form"
)
_INDEX = Arg(name="index", kind=Kind.COUNT, low=0, high=0xFFFF, what="of the object, as 2030h")
_SUB = Arg(name="sub", kind=Kind.COUNT, low=0, high=255, what="sub-index")
_UNIT = Arg(name="unit", optional=True, what="name of a unit of the scenario")
_ANY = Arg(name="value", what="number (86, 56h, 0x56) or text")


def _row(name: str, what: str, run: Handler, *args: Arg) -> Row:
    return row(f"dut.{name}", what, run, *args, here=here)


ROWS: tuple[Row, ...] = (
    _row("use", "Tells or chooses which unit dut is.", _use, _UNIT),
    _row(
        "ready", "Waits until the set-up after Res is over and frames are settled.", _simple(lambda d: d.wait_ready())
    ),
    _row(
        "registers", "Shows the registers of a converter, fields named.", _registers, replace(_CONVERTER, optional=True)
    ),
    _row("register", "Reads one register.", _register, _CONVERTER, _REGISTER),
    _row("write", "Writes one register; x, y and z are written together.", _write, _CONVERTER, _REGISTER, _VALUE),
    _row("opcode", "Sends a command byte to the converters.", _opcode, _GROUP, _CODE),
    _row("stream", "Takes samples and tells their mean and spread, volts at the loads.", _stream, _COUNT),
    _row("start", "Starts the stream of frames.", _simple(Unit.start)),
    _row("stop", "Stops it.", _simple(Unit.stop)),
    _row("reset", "Pulses Res: NMT reset node.", _simple(Unit.reset)),
    _row("form", "Tells or sets how a sample travels.", _form, _FORM),
    _row("counters", "Tells the counters of the device, object 2030h.", lambda s, _: s.dut.counters()),
    _row("object", "Reads an object of the dictionary.", _read_object, _INDEX, replace(_SUB, optional=True)),
    _row("set", "Writes an object of the dictionary.", _write_object, _INDEX, _SUB, _ANY),
)
