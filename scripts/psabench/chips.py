"""Converter chips and boards in this process, register by register and edge by edge: for drivers under test.

    from psabench.chips import Bench, ads1256_volts

    with Bench(seed=1) as bench:
        adc = bench.part("ads1256", vref_v=2.5)
        adc.set_volts(0, 1.25)                       # AIN0
        adc.run_until_level("DRDY", 0)               # its self-calibration after power-up
        adc.pins["CS"].set(0)
        adc.spi(b"\\x01")                             # RDATA
        bench.run_for(7e-6)                          # t6
        code = int.from_bytes(adc.spi(bytes(3)), "big", signed=True)
        print(ads1256_volts(code, vref_v=2.5))

Simulated time stands still between calls: it moves in `run_for`, `run_until_...`, `spi`, `board_read` and
`board_write`. Functions given to `watch`, `set_input` and `on_frame` are called from in there and must not call these
or `close`; those given to `interrupt` may, but for `close`. What they raise comes out of the call that moved time.
Durations are float seconds and end in _s, instants are whole nanoseconds since the bench was made and end in _ns. The
same calls give the same answers on every machine.

`psabench.errors`: BadInput for what does not exist (part, option, pin, register), TimeOut, BenchError for the rest.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

from psabench.errors import BadInput, BenchError, TimeOut, expected
from psabench.native.clib import DEADLINE, FRAME, INPUT, INTERRUPT, WATCH, FrameStruct, library

NEVER_NS = 2**63 - 1
SLICE_NS = 100_000_000  # time runs in slices of this length, so that Ctrl-C and what callbacks raise come out soon
BAD_ARGUMENT, NOT_HERE, REFUSED, TIMEOUT, SYSTEM, LATE, VIOLATED = -1, -2, -3, -4, -5, -6, -7  # enum psabench_error
ERRORS = {BAD_ARGUMENT: BadInput, NOT_HERE: BadInput, TIMEOUT: TimeOut, LATE: TimeOut}  # BenchError: the others
ONE_BIT, M0_M1 = 1, 2  # enum psabench_bits
EDGES = ("falling", "rising", "either")  # enum psabench_edge


def parts() -> tuple[str, ...]:
    """The parts there are: "ads1256", "ads1282", "psa2", ..."""
    return tuple(library().parts().decode().split())


def options(part: str) -> str:
    """What `Bench.part` takes for it: a line "key=default  meaning, unit, range" for each option."""
    text = library().options(part.encode())
    if text is None:
        raise BadInput(expected(", ".join(parts()), part, "part"))
    return str(text.decode())


def ads1256_volts(code: int, *, vref_v: float = 2.5, gain: int = 1) -> float:
    """Volts between the selected inputs for a code of an ADS1255/1256: full scale, 2 VREF / gain, is 2^23."""
    return code * 2 * vref_v / (gain * 2**23)


def ads1282_volts(word: int, *, vref_v: float = 5.0, gain: int = 1) -> float:
    """Volts for a signed 32-bit word of an ADS1281/1282 behind its FIR filter: full scale, VREF / (2 gain), is 2^31."""
    return word * vref_v / (2 * gain * 2**31)


def ad7712_volts(
    code: int, *, vref_v: float = 2.5, gain: int = 1, bits: int = 24, unipolar: bool = False, high_level: bool = False
) -> float:
    """Volts at an input of an AD7710..AD7712 for a code of 16 or 24 bits: bipolar codes are offset binary, full scale
    is VREF / gain. high_level: AIN2 of the AD7712, whose divider makes it four times that."""
    full_v = vref_v * (4 if high_level else 1) / gain
    return full_v * (code / (1 << bits) if unipolar else code / (1 << (bits - 1)) - 1)


@dataclass(frozen=True, slots=True)
class Frame:
    """What a board sent in one of its frames."""

    seq: int
    t_sample_ns: int
    t_int_fall_ns: int
    t_int_rise_ns: int
    code: tuple[int, ...]  # X, Y, Z: 24 bits, sign-extended
    word: tuple[int, ...]  # as they went over the Data line
    temp_code: int
    temp_channel: int
    status: int


class Bench(AbstractContextManager["Bench"]):
    """Simulated time and the parts on it. Every noise source draws from a stream of its own, made from the seed."""

    def __init__(self, seed: int = 1) -> None:
        self.raised: BaseException | None = None  # by the first callback that raised within the running call
        self.inside = 0  # callbacks that are running
        self._handle: int | None = None
        self._lib = library()
        self._handle = self._lib.new(seed)
        self._parts: list[Part] = []  # C calls what they hold
        if self._handle is None:
            raise BenchError("bench: out of memory")

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Frees the bench with its parts and ends the recording; they cannot be used any more. Twice is allowed."""
        if self.inside:  # the library would go on with what it no longer has
            raise BenchError("bench: close() called from a callback; call it between steps")
        handle, self._handle = self._handle, None
        if handle:
            self._lib.free(handle)

    @property
    def now_ns(self) -> int:
        """Simulated nanoseconds since the bench was made."""
        return int(self._lib.now_ns(self.live()))

    @property
    def next_ns(self) -> int | None:
        """When something will happen by itself; None: never."""
        t_ns = int(self._lib.next_ns(self.live()))
        return None if t_ns == NEVER_NS else t_ns

    def run_for(self, dt_s: float) -> None:
        """Lets time pass, to the nearest nanosecond."""
        dt_ns = round(dt_s * 1e9)
        if dt_ns > SLICE_NS:
            self.run_until_ns(self.now_ns + dt_ns)
        else:
            self.done(self._lib.run_for(self.live(), dt_ns))

    def run_until_ns(self, t_ns: int) -> None:
        """Lets time pass until an instant; BadInput when it is over already."""
        handle = self.live()
        while True:
            self.done(self._lib.run_until(handle, min(t_ns, self.now_ns + SLICE_NS)))
            if self.now_ns >= t_ns:  # later than that if an interrupt took long
                return

    def run_until_interrupt(self, timeout_s: float = 10.0) -> None:
        """Lets time pass until a handler of `Pin.interrupt` has run. TimeOut after timeout_s."""
        if not self.wait(lambda left_ns: self._lib.run_until_interrupt(self.live(), left_ns), timeout_s):
            raise TimeOut(expected(f"an interrupt within {timeout_s:g} s", "none", "bench"))

    @contextmanager
    def masked(self) -> Iterator[None]:
        """Interrupts wait within the block."""
        was = self.done(self._lib.mask(self.live(), 1))
        try:
            yield
        finally:
            self._lib.mask(self.live(), was)

    def deadline(self, dt_s: float | None) -> None:
        """The program under test has dt_s from now (None: no end). Then what would move time raises TimeOut, and so
        does the millionth look at a pin while no time passes: a loop that waits in vain comes to an end."""
        t_ns = NEVER_NS if dt_s is None else self.now_ns + round(dt_s * 1e9)
        self.done(self._lib.deadline(self.live(), t_ns, DEADLINE(), None))

    def part(self, part: str, *, name: str | None = None, **options: float | str | bool) -> Part:
        """Puts a part on the bench, with supplies and clock. `options(part)` lists its options; name: for the
        recording and the noise streams, unique on the bench, the part's own by default."""
        words = " ".join(f"{key}={_option(value)}" for key, value in options.items())
        handle = self._lib.part_new(self.live(), part.encode(), (name or part).encode(), words.encode())
        self.done(0 if handle else BAD_ARGUMENT)
        new = Part(self, handle)
        self._parts.append(new)
        return new

    def vcd(self, path: str | PathLike[str]) -> None:
        """Records the pins of the parts on the bench from now on (VCD, 1 ns), until `vcd_close` or the next call."""
        self.done(self._lib.vcd(self.live(), fspath(path).encode()))

    def vcd_close(self) -> None:
        """Ends the recording; the file is complete."""
        self.done(self._lib.vcd_close(self.live()))

    # For Part and Pin.

    def live(self) -> int:
        """The handle, while there is one."""
        if self._handle is None:
            raise BenchError("bench: closed")
        return self._handle

    def done(self, result: int, *, allow: int = 0) -> int:
        """What every call ends with: raise what a callback raised, then what the library says (one code is allowed)."""
        if self.raised is not None:
            e, self.raised = self.raised, None
            raise e
        if result < 0 and result != allow:
            raise ERRORS.get(result, BenchError)(self._error_text())
        return result

    def wait(self, call: Callable[[int], int], timeout_s: float) -> bool:
        """Whether what call(left_ns) waits for came within timeout_s; in slices."""
        end_ns = self.now_ns + round(timeout_s * 1e9)
        while (left_ns := end_ns - self.now_ns) > SLICE_NS:
            if self.done(call(SLICE_NS), allow=TIMEOUT) != TIMEOUT:
                return True
        return self.done(call(left_ns if timeout_s < 0 else max(left_ns, 0)), allow=TIMEOUT) != TIMEOUT

    def _error_text(self) -> str:
        return str(self._lib.error_text(self.live()).decode(errors="replace"))


class Pin:
    """A pin of a part, named as in its data sheet. Levels are those on the wire: DRDY and CS are active at 0."""

    def __init__(self, part: Part, number: int, name: str) -> None:
        self._part, self._bench = part, part.bench
        self._get, self._set = library().get, library().set
        self.number, self.name = number, name
        self.is_input = library().pin_is_input(part.live(), number) == 1  # of the part: the program sets it

    def __repr__(self) -> str:
        return f"<{'input' if self.is_input else 'output'} {self._part.name}.{self.name}>"

    @property
    def level(self) -> int:
        """0 or 1, now. BadInput for the lines of psa2 that carry bits: watch or record them."""
        return self._bench.done(self._get(self._part.live(), self.number))

    def set(self, level: int) -> None:
        """Drives an input of the part, now."""
        self._bench.done(self._set(self._part.live(), self.number, level))

    def watch(self, fn: Callable[[int, int], None] | None) -> None:
        """Calls fn(level, t_ns) at each change of an output, at its own instant (lines of psa2 up to 0.2 ms later, in
        order of time). None: no more; one watcher a pin."""
        self._part.install("watch", WATCH, fn and (lambda _ctx, _part, _pin, *args: fn(*args)), self.number)

    def interrupt(self, fn: Callable[[], None] | None, edge: str = "falling") -> None:
        """Calls fn() at each such edge of a chip's output ("falling", "rising", "either") in place of the program,
        between two instants of what moves time: it may exchange bytes and wait. One runs at a time. None: no more."""
        self._part.install("on_interrupt", INTERRUPT, fn and (lambda *_: fn()), self.number, _edge_number(edge))


class _Pins(dict[str, Pin]):
    def __init__(self, part: Part) -> None:
        names = iter(lambda: library().pin_name(part.live(), len(self)), None)
        for name in names:
            self[name.decode()] = Pin(part, len(self), name.decode())
        self._part = part.name

    def __missing__(self, name: str) -> Pin:
        raise BadInput(expected(" ".join(self), name, f"pin of {self._part}"))


class Part:
    """A chip or a board on a bench; made by `Bench.part`."""

    def __init__(self, bench: Bench, handle: int) -> None:
        self.bench, self._lib, self._handle = bench, library(), handle
        self._callbacks: dict[tuple[str, tuple[int, ...]], object] = {}  # C knows only their addresses: kept alive here
        self._replaced: list[object] = []
        self._bits: bytes | None = None
        self.name = str(self._lib.part_name(handle).decode())
        self.pins: Mapping[str, Pin] = _Pins(self)

    def __repr__(self) -> str:
        return f"<part {self.name}>"

    # Inputs

    def set_volts(self, input: int, volts: float) -> None:
        """A constant voltage at an input from now on. Numbers: ads1256 0..7 AIN0..AIN7, 8 AINCOM, to AGND; ads1255 0,
        1, 8; ads1282 0 AIN1, 1 AIN2, differential; ads1281 0; ad7710 0 AIN1(+), 1 AIN1(-), 2 AIN2(+), 3 AIN2(-); ad7711
        0..2, 2 AIN2; ad7711a 0, 1; ad7712 0..2, 2 AIN2, to VBIAS; psa2 0..2 sensors X, Y, Z (with a current input
        amperes), 3..6 the temperatures of these sensors and of the board, degC."""
        self.bench.done(self._lib.set_volts(self.live(), _word("input", input), volts))

    def set_input(self, fn: Callable[[int, int], float] | None) -> None:
        """Inputs come from fn(input, t_ns) -> volts, asked at the instants of sampling: for one input never earlier
        than before, perhaps up to a data period ago. None: constants again."""
        self.install("set_input", INPUT, fn and (lambda _ctx, _part, *args: float(fn(*args))))

    def play_bits(self, m0: Iterable[int] | None, m1: Iterable[int] | None = None) -> None:
        """Bits of a modulator in place of the model's own and of the input, a level a clock of CLK/4: M0 and M1 of a
        real ADS1281 or ADS1282, or one bit of another modulator. The converter restarts; the first bits are of the
        first clock that it samples. After the last, zero is converted and the counter bits_missing counts. None: the
        model again. BadInput for parts without modulator output, levels beside 0 and 1, streams of different length."""
        kind, bits = _pack_bits(m0, m1)
        self.bench.done(self._lib.play_bits(self.live(), bits, len(bits or b""), kind))
        self._bits = bits  # C knows only its address

    # SPI

    def spi(self, tx: bytes | bytearray) -> bytes:
        """Exchanges bytes at the part's SCLK frequency (`spi_clock`); time passes. CS is a pin like others."""
        n = len(tx)
        rx = ctypes.create_string_buffer(n)
        self.bench.done(self._lib.spi(self.live(), bytes(tx), rx, n))
        return rx.raw

    def spi_clock(self, sclk_hz: int, gap_s: float = 0.0) -> None:
        """Frequency of SCLK from now on, and the pause between two bytes of an exchange."""
        self.bench.done(self._lib.spi_clock(self.live(), _word("sclk_hz", sclk_hz), round(gap_s * 1e9)))

    # Waiting

    def run_until_level(self, pin: str, level: int, timeout_s: float = 10.0) -> None:
        """Lets time pass until an output pin has the level, at once if it has it now. TimeOut after timeout_s."""
        number = self.pins[pin].number
        call = self._lib.run_until_level
        if not self.bench.wait(lambda left_ns: call(self.live(), number, level, left_ns), timeout_s):
            raise TimeOut(expected(f"{level} within {timeout_s:g} s", "no change", f"{self.name}: {pin}"))

    def run_until_edge(self, pin: str, edge: str = "falling", timeout_s: float = 10.0) -> None:
        """Lets time pass until the next edge of a chip's output, never at once: "falling", "rising" or "either"."""
        number, kind = self.pins[pin].number, _edge_number(edge)
        call = self._lib.run_until_edge
        if not self.bench.wait(lambda left_ns: call(self.live(), number, kind, left_ns), timeout_s):
            raise TimeOut(expected(f"an edge within {timeout_s:g} s", "none", f"{self.name}: {pin}"))

    # Inside

    def peek(self, address: int) -> int:
        """A register, 0..255, without the side effects of reading it over SPI. psa2: 256 * group + address."""
        return self.bench.done(self._lib.peek(self.live(), _word("address", address)))

    @property
    def counters(self) -> dict[str, int]:
        """What the part did, suffered and rejected so far."""
        return self._counted(self._lib.counter)

    @property
    def violations(self) -> dict[str, int]:
        """Those of the counters that stay 0 while the program keeps to the data sheet."""
        return self._counted(self._lib.violation)

    def check(self) -> None:
        """BenchError if one of the violations is not 0; its text names them."""
        self.bench.done(self._lib.check(self.live()))

    def _counted(self, listed: Callable[..., bytes | None]) -> dict[str, int]:
        handle, value, found = self.live(), ctypes.c_uint64(), dict[str, int]()
        while name := listed(handle, len(found), value):
            found[name.decode()] = value.value
        return found

    # Boards

    def on_frame(self, fn: Callable[[Frame], None] | None) -> None:
        """Calls fn(frame) at each frame a board sends. None: no more."""
        self.install("on_frame", FRAME, fn and (lambda _ctx, _part, f: fn(_frame(f.contents))))

    def board_read(self, group: int, address: int, timeout_s: float = 1.0) -> int:
        """A register of a board's converter, through the board's controller. group: 0..2 X, Y, Z; 3 temperature."""
        where = _word("group", group), _word("address", address)
        return self.bench.done(self._lib.board_read(self.live(), *where, round(timeout_s * 1e9)))

    def board_write(self, group: int, address: int, value: int, timeout_s: float = 1.0) -> None:
        """The same, writing 0..255. Groups 0, 1 and 2 are written together."""
        what = _word("group", group), _word("address", address), _word("value", value, 8)
        self.bench.done(self._lib.board_write(self.live(), *what, round(timeout_s * 1e9)))

    # For Bench and Pin.

    def live(self) -> int:
        """The handle, while there is one."""
        self.bench.live()
        return self._handle

    def install(self, function: str, kind: Any, fn: Callable[..., Any] | None, *where: int) -> None:
        """Hands fn to the library as its callback of a kind; NULL for None."""
        callback = kind(self._guarded(fn)) if fn else kind()
        self.bench.done(getattr(self._lib, function)(self.live(), *where, callback, None))
        if not self.bench.inside:
            self._replaced.clear()
        self._replaced.append(self._callbacks.get((function, where)))  # it may be running: it replaces itself
        self._callbacks[function, where] = callback

    def _guarded(self, fn: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any) -> Any:
            self.bench.inside += 1
            try:
                return 0.0 if self.bench.raised else fn(*args)
            except BaseException as e:  # C cannot pass it on: Bench.done raises it when the call is over
                self.bench.raised = e
                return 0.0
            finally:
                self.bench.inside -= 1

        return call


def _frame(f: FrameStruct) -> Frame:
    return Frame(
        f.seq,
        f.t_sample_ns,
        f.t_int_fall_ns,
        f.t_int_rise_ns,
        tuple(f.code),
        tuple(f.word),
        f.temp_code,
        f.temp_channel,
        f.status,
    )


def _pack_bits(m0: Iterable[int] | None, m1: Iterable[int] | None) -> tuple[int, bytes | None]:
    """enum psabench_bits, and a byte a clock; M1 weighs 2."""
    if m0 is None:
        return M0_M1, None
    first = _read_levels("M0", m0)
    if m1 is None:
        return ONE_BIT, first
    second = _read_levels("M1", m1)
    if len(first) != len(second):
        raise BadInput(expected(f"{len(first)} levels, as of M0", len(second), "M1"))
    return M0_M1, bytes(a + 2 * b for a, b in zip(first, second, strict=True))


def _read_levels(what: str, levels: Iterable[int]) -> bytes:
    try:
        found = bytes(int(level) for level in levels)
    except ValueError:
        found = b"\2"
    if found.strip(b"\0\1"):
        raise BadInput(expected("levels 0 and 1", "others", what))
    return found


def _word(what: str, value: int, bits: int = 32) -> int:
    """The number, if it fits into an unsigned word; ctypes would cut it without a word."""
    if not isinstance(value, int) or not 0 <= value < 1 << bits:
        raise BadInput(expected(f"a whole number, 0 to {(1 << bits) - 1}", repr(value), what))
    return value


def _edge_number(name: str) -> int:
    if name not in EDGES:
        raise BadInput(expected(", ".join(EDGES), name, "edge"))
    return EDGES.index(name)


def _option(value: float | str | bool) -> str:
    return str(int(value)) if isinstance(value, bool) else str(value)
