"""The instruments of a laboratory over SCPI: dividing head, rate table, thermal chamber, power supply.

    head = open_instrument("head", "TCPIP::127.0.0.1::5025::SOCKET", Head, wait=bench.wait)
    head.turn(90.0)  # returns when it stands still, with what its scale shows, deg

The address is VISA's, so the same script runs with an instrument on a network, a serial line or a bus adapter. After
each setting the instrument's error queue is read: a rejection is raised where it happened, and in lockstep the setting
has been made when the call returns. Nothing blocks on `*OPC?`, which would block where time moves only
when the host says so: the state is asked, and the bench's time moves in between. Where an emulator says when a motion
ends (`lasts`), the looks before that are left out; what is seen, and when, is the same. The only file that imports
PyVISA.

Angles are degrees and rates degrees a second, as on the instruments' own scales; temperatures degrees Celsius.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from psabench.errors import BadInput, InstrumentError, LinkError, TimeOut, expected, link_error
from psabench.estimate.face import Face

if TYPE_CHECKING:
    from pyvisa.resources import MessageBasedResource

REPLY_S = 10.0  # timeout for an answer, real time
CONNECT_S = 5.0
LATE_S = 0.05  # real time in which what came late is read away
REST_LIMIT_S = 3600.0  # timeout for it, bench time
LOG_COUNT = 400  # angles that a table gives at a time
TURN_OFF_DEG = 5.0  # a head that is farther off did not turn: five times the largest setting error of a scenario
NS = 1_000_000_000

Value = TypeVar("Value")
Wait = Callable[[float], None]
Lasts = Callable[..., float | None]  # (command of the control socket, its arguments): s to the end of a motion


def _no_one_says(_: str, **__: object) -> None:
    """An instrument that is watched until it stands still."""


class Instrument:
    """What all of them have: identity, raw commands, the error queue. `wait` lets the bench's time pass."""

    poll_s = 0.1  # bench time between looks at something that moves
    lasts: Lasts = staticmethod(_no_one_says)

    def __init__(self, name: str, address: str, resource: MessageBasedResource, wait: Wait) -> None:
        self.name = name
        self.address = address
        self._resource = resource
        self._wait = wait
        self._owes = False  # an answer: the latest command had none in time

    def close(self) -> None:
        self._resource.close()

    @property
    def identity(self) -> str:
        """Maker, model, serial number and version: the answer to *IDN?."""
        return self.query("*IDN?")

    def reset(self) -> None:
        """*RST."""
        self.write("*RST")

    def write(self, command: str) -> None:
        """Send a command that has no answer. Raises InstrumentError when the instrument rejects it."""
        self._raise_error(command, self._ask(f"{command}\nSYST:ERR?", command))

    def query(self, command: str) -> str:
        """Send a command that has an answer, a program message with several `?` included: "TEMP?;TEMP:SETP?"."""
        try:
            return self._ask(command, command)
        except TimeOut:
            self._raise_error(command, self._ask("SYST:ERR?", command))
            raise

    def numbers(self, command: str) -> tuple[float, ...]:
        """The answers to a query, separated by commas or semicolons, as numbers."""
        answer = self.query(command)
        try:
            return tuple(float(x) for x in answer.replace(";", ",").split(","))
        except ValueError as e:
            raise LinkError(expected("numbers", repr(answer), f"{self.name}: {command}")) from e

    def number(self, command: str) -> float:
        """The answer to a query as a number, the first of several."""
        return self.numbers(command)[0]

    def _until(self, done: Callable[[], bool], what: str, limit_s: float, *motion: str, **args: object) -> None:
        """Let the bench's time pass until done() says so; motion, args: what `lasts` is asked, if there is anything."""
        waited_s = self._pass_looks(limit_s, motion, args)
        while not done():
            if waited_s >= limit_s:
                raise TimeOut(f"{self.name}: {what} not reached within {limit_s:g} s")
            self._wait(self.poll_s)
            waited_s += self.poll_s

    def _pass_looks(self, limit_s: float, motion: Sequence[str], args: Mapping[str, object]) -> float:
        """Go in one step to the first look that can find the motion ended; returns the time that took, s."""
        lasts_s = self.lasts(*motion, **args) if motion else None
        looks = -(-round(min(lasts_s or 0.0, limit_s) * NS) // round(self.poll_s * NS))
        if looks:
            self._wait(looks * self.poll_s)
        return looks * self.poll_s

    def _ask(self, message: str, command: str) -> str:
        from pyvisa.constants import StatusCode
        from pyvisa.errors import VisaIOError

        where = f"{self.name} at {self.address}: {command}"
        try:
            self._read_away()
            return self._resource.query(message).strip()
        except VisaIOError as e:
            if e.error_code == StatusCode.error_timeout:
                self._owes = True
                raise TimeOut(f"{where}: no answer within {REPLY_S:g} s") from e
            raise LinkError(f"{where}: {e.description}") from e
        except UnicodeDecodeError as e:
            raise LinkError(expected("ASCII text", repr(e.object), where)) from e
        except OSError as e:
            raise LinkError(f"{where}: {e}") from e

    def _read_away(self) -> None:
        """An answer that came after its time-out is not that to the next command."""
        from pyvisa.errors import VisaIOError

        if not self._owes:
            return
        self._owes = False
        timeout_ms, self._resource.timeout = self._resource.timeout, round(LATE_S * 1000)
        try:
            while True:
                self._resource.read_raw()
        except VisaIOError:
            return
        finally:
            self._resource.timeout = timeout_ms

    def _raise_error(self, command: str, error: str) -> None:
        """`error` is the oldest entry of the error queue: -222,"Data out of range;..."; the younger ones go with it."""
        number, _, text = error.partition(",")
        if not number.lstrip("+-").isdecimal():
            raise LinkError(expected("a number and a text", repr(error), f"{self.name}: SYST:ERR?"))
        if int(number) == 0:
            return
        for _ in range(100):  # a queue has an end; an instrument that says something else each time has none
            if self._ask("SYST:ERR?", command).partition(",")[0].lstrip("+-0") == "":
                break
        raise InstrumentError(self.name, command, int(number), text.strip().strip('"'))


class _Shown(Generic[Value]):
    """An attribute that asks the instrument each time: a query, and what its number is here."""

    def __init__(self, query: str, value: Callable[[float], Value]) -> None:
        self._query, self._value = query, value

    def __get__(self, instrument: Instrument, _: type[Instrument] | None = None) -> Value:
        return self._value(instrument.number(self._query))


class Head(Instrument):
    """A dividing head: sets an angle about its axis and takes the sensor's mount with one of four faces."""

    angle_deg = _Shown("ANGL?", float)  # by the scale, deg
    at_rest = _Shown("REST?", bool)

    def turn(self, angle_deg: float) -> float:
        """Turn to angle_deg; returns what the scale shows when it stands still, deg.

        Raises TimeOut if that is another attitude: it sticks.
        """
        self.write(f"ANGL {angle_deg!r}")
        shown_deg = self._rest_angle_deg()
        if abs((shown_deg - angle_deg + 180.0) % 360.0 - 180.0) > TURN_OFF_DEG:
            raise TimeOut(f"{self.name}: {angle_deg:g} deg not reached: at rest its scale shows {shown_deg:g} deg")
        return shown_deg

    def mount(self, face: Face | str) -> float:
        """Put the unit on the mount with this face; returns the scale's reading, deg."""
        self.write(f"FACE {Face(face).value.upper()}")
        return self._rest_angle_deg()

    def _rest_angle_deg(self) -> float:
        self._until(lambda: self.at_rest, "rest", REST_LIMIT_S, "head.read")
        return self.angle_deg

    @property
    def face(self) -> Face:
        return Face(self.query("FACE?").lower())


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisState:
    """What a table shows of one axis."""

    angle_deg: float
    rate_dps: float
    mode: str  # position, rate, sine, profile, stop
    at_rest: bool


class Table(Instrument):
    """A rate table of one to three axes; axis 1 is the outermost."""

    def position(self, angle_deg: float, rate_dps: float | None = None, *, axis: int = 1, wait: bool = True) -> None:
        """Go to an angle, at most at rate_dps; returns when it is there, or at once."""
        rate = "" if rate_dps is None else f",{rate_dps!r}"
        self.write(f"AXIS{axis}:POS {angle_deg!r}{rate}")
        if wait:
            self.wait_rest(axis=axis)

    def rate(self, rate_dps: float, *, axis: int = 1) -> None:
        """Turn at a rate from now on."""
        self.write(f"AXIS{axis}:RATE {rate_dps!r}")

    def sine(self, amplitude_deg: float, frequency_hz: float, *, axis: int = 1) -> None:
        """Swing about where it is."""
        self.write(f"AXIS{axis}:SINE {amplitude_deg!r},{frequency_hz!r}")

    def profile(self, times_s: Sequence[float], rates_dps: Sequence[float], *, axis: int = 1) -> None:
        """Run through rates: rates_dps[k] at times_s[k] from now, linear between them."""
        if len(times_s) != len(rates_dps):
            raise ValueError(expected("as many times as rates", f"{len(times_s)} and {len(rates_dps)}"))
        pairs = ",".join(f"{t!r},{r!r}" for t, r in zip(times_s, rates_dps, strict=True))
        self.write(f"AXIS{axis}:PROF {pairs}")

    def stop(self, *, axis: int = 1, wait: bool = True) -> None:
        """Slow down to a stop, as fast as the axis may."""
        self.write(f"AXIS{axis}:STOP")
        if wait:
            self.wait_rest(axis=axis)

    def zero(self, angle_deg: float = 0.0, *, axis: int = 1) -> None:
        """From now on the readout shows angle_deg here."""
        self.write(f"AXIS{axis}:ZERO {angle_deg!r}")

    def read(self, *, axis: int = 1) -> AxisState:
        """Angle and rate as the readout shows them, mode, and whether the axis stands still."""
        a = f"AXIS{axis}"
        angle, rate, mode, rest = self.query(f"{a}:POS?;:{a}:RATE?;:{a}:MODE?;:{a}:REST?").split(";")
        return AxisState(angle_deg=float(angle), rate_dps=float(rate), mode=mode.lower(), at_rest=float(rest) != 0.0)

    def angle_deg(self, *, axis: int = 1) -> float:
        return self.number(f"AXIS{axis}:POS?")

    def stamped(self, *, axis: int = 1) -> tuple[float, float]:
        """Time of the reading, s, and the angle, deg: the table's own clock; a coarse table shows 9.91e37."""
        t_s, angle_deg = self.query(f"AXIS{axis}:STAM?").split(",")
        return float(t_s), float(angle_deg)

    def log(self, from_s: float, every_s: float, count: int, *, axis: int = 1) -> list[float]:
        """Angles of the readout at past instants, deg: its log goes back to the last four motions of the axis."""
        angles: list[float] = []
        while len(angles) < count:
            part = min(count - len(angles), LOG_COUNT)
            at_s = from_s + len(angles) * every_s
            command = f"AXIS{axis}:LOG? {at_s:.9f},{every_s:.9f},{part}"
            answer, _, error = self.query(f"{command};:SYST:ERR?").partition(";")
            self._raise_error(command, error if '"' not in answer else f"{answer};{error}")
            angles += [float(a) for a in answer.split(",")]
        return angles

    def rate_dps(self, *, axis: int = 1) -> float:
        return self.number(f"AXIS{axis}:RATE?")

    def wait_rest(self, *, axis: int = 1, limit_s: float = REST_LIMIT_S) -> None:
        """Let time pass until the axis stands still. Raises TimeOut after limit_s of bench time."""
        self._until(
            lambda: self.number(f"AXIS{axis}:REST?") != 0.0, f"rest of axis {axis}", limit_s, "table.read", axis=axis
        )


class Chamber(Instrument):
    """A thermal chamber: air at a temperature, changed at a ramp."""

    poll_s = 1.0
    temp_degc = _Shown("TEMP?", float)  # of the air, by the chamber's own sensor
    setpoint_degc = _Shown("TEMP:SETP?", float)
    ramp_k_per_min = _Shown("RAMP?", float)
    stable = _Shown("STAB?", bool)

    def set(self, temp_degc: float, *, wait: bool = False, limit_s: float = 24 * 3600.0) -> None:
        """New set-point; with wait, returns when the chamber calls its air stable there."""
        self.write(f"TEMP {temp_degc!r}")
        if wait:
            self.wait_stable(limit_s=limit_s)

    def ramp(self, ramp_k_per_min: float) -> None:
        """How fast the air's set-point moves from now on, K/min."""
        self.write(f"RAMP {ramp_k_per_min!r}")

    def wait_stable(self, *, limit_s: float = 24 * 3600.0) -> None:
        """Let time pass until the air is stable. Raises TimeOut after limit_s of bench time."""
        self._until(lambda: self.stable, "a stable temperature", limit_s)


class Supply(Instrument):
    """A power supply with one output."""

    volt_v = _Shown("VOLT?", float)  # what it is set to
    measured_v = _Shown("MEAS:VOLT?", float)  # what is at the terminals now
    is_on = _Shown("OUTP?", bool)

    def set(self, volt_v: float) -> None:
        """New voltage."""
        self.write(f"VOLT {volt_v!r}")

    def output(self, on: bool) -> None:
        self.write(f"OUTP {'ON' if on else 'OFF'}")

    def ripple(self, amplitude_v: float, frequency_hz: float) -> None:
        """Sine on top of the voltage; amplitude 0: none."""
        self.write(f"RIPP {amplitude_v!r},{frequency_hz!r}")


KINDS: dict[str, type[Instrument]] = {"head": Head, "table": Table, "chamber": Chamber, "supply": Supply}

Kind = TypeVar("Kind", bound=Instrument)


def open_instrument(name: str, address: str, kind: type[Kind], wait: Wait) -> Kind:
    """Open an instrument at a VISA address. Raises BadInput for what is no address, LinkError when nothing is there."""
    from pyvisa.errors import Error

    try:
        _knock(name, address)
        resource: Any = _manager().open_resource(
            address, read_termination="\n", write_termination="\n", timeout=round(REPLY_S * 1000)
        )
    except (ValueError, Error) as e:
        raise BadInput(expected(f"a VISA address as {EXAMPLES}", f"{address} ({e})", name)) from e
    except LinkError:
        raise
    except Exception as e:  # PyVISA-py raises bare ones for what it cannot open
        raise LinkError(f"{name} at {address}: {e}") from e
    return kind(name, address, resource, wait)


EXAMPLES = "TCPIP::127.0.0.1::5025::SOCKET, ASRL/dev/ttyUSB0::INSTR"


def visa_address(endpoint: Mapping[str, str]) -> str:
    """VISA's address of a `ready scpi=...` line of the emulator."""
    if "pty" in endpoint:
        return f"ASRL{endpoint['pty']}::INSTR"
    return f"TCPIP::{endpoint['host']}::{endpoint['port']}::SOCKET"


def _manager() -> Any:
    """VISA in Python, which needs no vendor's library; $PYVISA_LIBRARY names another."""
    import pyvisa

    return pyvisa.ResourceManager(os.environ.get("PYVISA_LIBRARY", "@py"))


def _knock(name: str, address: str) -> None:
    """Make sure that somebody listens at a socket: PyVISA-py takes a rejected connection for an open one."""
    words = address.split("::")
    if len(words) != 4 or words[3].upper() != "SOCKET":
        return
    if not words[2].isdecimal():
        raise ValueError(expected("a port", repr(words[2])))
    try:
        socket.create_connection((words[1], int(words[2])), CONNECT_S).close()
    except (OSError, OverflowError) as e:
        hint = "is the instrument switched on, or psa-emu running?"
        raise link_error(f"{name} at {address}", "an instrument", e, hint) from e
