"""psabench.chips: the library from Python. What the chips do is proved elsewhere; here it is how it comes across."""

from __future__ import annotations

import gc
import itertools
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from psabench import chips
from psabench.chips import Bench, Frame, Part, ad7712_volts, ads1256_volts, ads1282_volts
from psabench.errors import BadInput, BenchError, TimeOut
from psabench.link.vcd import read_vcd

ROOT = Path(__file__).resolve().parents[3]
HEADER = (ROOT / "emu/api/psabench.h").read_text()

STATUS, MUX, DRATE = 0, 1, 3
RDATA, RREG, WREG = 0x01, 0x10, 0x50
T6_S = 7e-6
SPS_30000_NS = 33_333
SETTLED_S = 200e-6  # five conversions that no one synchronised, and one more


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench(seed=1) as bench:
        yield bench


@pytest.fixture
def adc(bench: Bench) -> Part:
    """An ADS1256 without noise, past its self-calibration and selected, 30 000 conversions a second."""
    adc = bench.part("ads1256", name="adc", vref_v=2.5, noise_scale=0)
    adc.run_until_level("DRDY", 0)
    adc.pins["CS"].set(0)
    return adc


def read_code(adc: Part) -> int:
    adc.run_until_level("DRDY", 1)
    adc.run_until_level("DRDY", 0)
    adc.spi(bytes([RDATA]))
    adc.bench.run_for(T6_S)
    return int.from_bytes(adc.spi(bytes(3)), "big", signed=True)


# ---- reading


def test_a_voltage_comes_out_as_its_code(adc: Part) -> None:
    for volts in (0.0, 1.25, -1.25, 2.4):
        adc.set_volts(0, volts)
        adc.bench.run_for(SETTLED_S)
        assert ads1256_volts(read_code(adc)) == pytest.approx(volts, abs=2 * 5.0 / 2**23)


def test_codes_in_volts() -> None:
    assert ads1256_volts(2**22, vref_v=2.5, gain=1) == 2.5
    assert ads1256_volts(-(2**23), vref_v=2.0, gain=4) == -1.0
    assert ads1282_volts(2**30, vref_v=5.0, gain=1) == 1.25
    assert ads1282_volts(-(2**31), vref_v=4.0, gain=8) == -0.25
    assert ad7712_volts(0xC00000) == 1.25
    assert ad7712_volts(0x0000, bits=16, gain=2) == -1.25
    assert ad7712_volts(0x8000, bits=16, unipolar=True) == 1.25
    assert ad7712_volts(0xA000, bits=16, high_level=True, vref_v=2.0) == 2.0


def test_registers_are_written_over_spi_and_peeked_at(adc: Part) -> None:
    adc.spi(bytes([WREG | MUX, 0, 0x23]))
    adc.bench.run_for(T6_S)
    assert adc.peek(MUX) == 0x23
    adc.spi(bytes([RREG | MUX, 0]))
    adc.bench.run_for(T6_S)
    assert adc.spi(bytes(1)) == b"\x23"
    with pytest.raises(BadInput, match=r"adc"):
        adc.peek(0x0B)


@pytest.mark.parametrize("number", [-1, 1 << 32, 2**40 + 1, "AIN0"])
def test_numbers_that_c_would_cut_are_refused(adc: Part, number: int) -> None:
    calls: dict[str, Callable[[], object]] = {
        "address": lambda: adc.peek(number),
        "input": lambda: adc.set_volts(number, 1.0),
        "sclk_hz": lambda: adc.spi_clock(number),
        "group": lambda: adc.board_read(number, 0),
        "value": lambda: adc.board_write(0, 0, number),
    }
    for what, call in calls.items():
        with pytest.raises(BadInput, match=rf"^{what}: expected a whole number, 0 to .*, got {number!r}$"):
            call()


def test_pins_moved_one_by_one_do_what_bytes_do(adc: Part) -> None:
    def exchange(byte: int) -> int:
        got = 0
        for bit in range(7, -1, -1):
            adc.pins["SCLK"].set(1)
            adc.pins["DIN"].set(byte >> bit & 1)
            adc.bench.run_for(500e-9)
            got = got << 1 | adc.pins["DOUT"].level
            adc.pins["SCLK"].set(0)
            adc.bench.run_for(500e-9)
        return got

    for byte in (WREG | DRATE, 0, 0xA1):
        exchange(byte)
    assert adc.peek(DRATE) == 0xA1
    adc.bench.run_for(T6_S)
    exchange(RREG | STATUS)
    exchange(0)
    adc.bench.run_for(T6_S)
    assert exchange(0) >> 4 == 3  # the chip's ID


def test_the_exchange_takes_its_bytes_and_gaps(adc: Part) -> None:
    began_ns = adc.bench.now_ns
    adc.spi_clock(1_000_000, gap_s=3e-6)
    adc.spi(bytes(4))
    assert adc.bench.now_ns - began_ns == 4 * 8_000 + 3 * 3_000


# ---- time


def test_time_moves_only_when_it_is_told_to(bench: Bench) -> None:
    assert (bench.now_ns, bench.next_ns) == (0, None)
    bench.run_for(1.5e-6)
    assert bench.now_ns == 1500
    bench.run_until_ns(2_000_000)
    bench.part("ads1256")
    assert bench.now_ns == 2_000_000
    assert bench.next_ns is not None
    with pytest.raises(BadInput, match="1999999 ns"):
        bench.run_until_ns(1_999_999)
    with pytest.raises(BadInput, match="-1 ns"):
        bench.run_for(-1e-9)
    assert bench.now_ns == 2_000_000


def falls(slice_ns: int, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    monkeypatch.setattr(chips, "SLICE_NS", slice_ns)
    found: list[int] = []
    with Bench() as bench:
        adc = bench.part("ads1256")
        adc.pins["DRDY"].watch(lambda level, t_ns: None if level else found.append(t_ns))
        bench.run_for(1.23456e-3)
        adc.run_until_level("DRDY", 1)
        found.append(bench.now_ns)
        bench.run_for(1.5e-3)
        found.append(bench.now_ns)
    return found


def test_slices_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = falls(10**9, monkeypatch)
    assert len(whole) > 30
    assert falls(1_000, monkeypatch) == whole


def test_what_does_not_happen_in_time_is_a_timeout(adc: Part, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chips, "SLICE_NS", 1_000)
    adc.pins["RESET"].set(0)  # no conversions any more
    began_ns = adc.bench.now_ns
    with pytest.raises(TimeOut, match=r"^adc: DRDY: expected 0 within 1e-05 s, got no change$"):
        adc.run_until_level("DRDY", 0, timeout_s=1e-5)
    assert adc.bench.now_ns == began_ns + 10_000


def test_the_next_edge_is_waited_for_in_slices_too(adc: Part, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chips, "SLICE_NS", 1_000)
    fell_ns = adc.bench.now_ns
    adc.run_until_edge("DRDY")
    assert SPS_30000_NS <= adc.bench.now_ns - fell_ns <= SPS_30000_NS + 1
    assert adc.pins["DRDY"].level == 0
    adc.run_until_edge("DRDY", "either")
    assert adc.pins["DRDY"].level == 1
    with pytest.raises(TimeOut, match=r"^adc: DRDY: expected an edge within 1e-06 s, got none$"):
        adc.run_until_edge("DRDY", "rising", timeout_s=1e-6)
    with pytest.raises(BadInput, match="edge: expected falling, rising, either, got up"):
        adc.run_until_edge("DRDY", "up")
    adc.pins["SYNC"].set(0)
    with pytest.raises(TimeOut, match="expected an edge within 1e-05 s"):
        adc.run_until_edge("DRDY", timeout_s=1e-5)


def test_a_deadline_ends_a_program_that_waits_in_vain(adc: Part, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chips, "SLICE_NS", 1_000)
    adc.pins["SYNC"].set(0)
    end_ns = adc.bench.now_ns + 10_500
    adc.bench.deadline(10.5e-6)

    def poll() -> None:
        while adc.pins["DRDY"].level:
            adc.bench.run_for(1e-7)

    with pytest.raises(TimeOut, match=r"^deadline: expected the program to end by .* adc.DRDY=1 .*adc.SYNC=0"):
        poll()
    assert adc.bench.now_ns == end_ns
    for call in (
        lambda: adc.run_until_level("DRDY", 0),
        lambda: adc.run_until_edge("DRDY"),
        lambda: adc.bench.run_until_interrupt(),
        lambda: adc.spi(bytes(1)),
    ):
        with pytest.raises(TimeOut, match=r"^deadline"):
            call()
    adc.bench.deadline(None)
    adc.bench.run_for(1e-6)


# ---- interrupts


def test_a_handler_reads_what_drdy_announces(adc: Part, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chips, "SLICE_NS", 10_000)
    adc.set_volts(0, 1.25)
    adc.bench.run_for(SETTLED_S)
    adc.run_until_level("DRDY", 0)
    adc.spi_clock(1_900_000)
    codes: list[int] = []

    def on_drdy() -> None:
        adc.spi(bytes([RDATA]))
        adc.bench.run_for(T6_S)
        codes.append(int.from_bytes(adc.spi(bytes(3)), "big", signed=True))
        if len(codes) == 10:
            adc.pins["DRDY"].interrupt(None)

    adc.pins["DRDY"].interrupt(on_drdy)
    with adc.bench.masked():
        adc.bench.run_for(1e-4)
        assert codes == []
    adc.bench.run_for(20 * SPS_30000_NS * 1e-9)
    assert len(codes) == 10
    assert [ads1256_volts(code) for code in codes] == pytest.approx([1.25] * 10, abs=2e-6)
    adc.check()
    assert not any(adc.violations.values())
    adc.pins["DRDY"].interrupt(on_drdy, "rising")
    adc.bench.run_until_interrupt()
    assert len(codes) == 11
    adc.pins["DRDY"].interrupt(None)
    with pytest.raises(TimeOut, match="expected an interrupt within 1e-05 s, got none"):
        adc.bench.run_until_interrupt(1e-5)


def test_what_a_handler_raises_comes_out_of_the_call(adc: Part) -> None:
    def fails() -> None:
        adc.bench.run_for(1e-6)
        raise KeyError("in the handler")

    adc.pins["DRDY"].interrupt(fails)
    with pytest.raises(KeyError, match="in the handler"):
        adc.bench.run_for(1e-3)
    adc.pins["DRDY"].interrupt(lambda: adc.bench.close())
    with pytest.raises(BenchError, match="from a callback"):
        adc.bench.run_for(1e-3)


def test_violations_are_named(adc: Part) -> None:
    adc.spi(bytes([RDATA, 0, 0, 0]))  # no t6
    assert {name: n for name, n in adc.violations.items() if n} == {"gap_violations": 1}
    with pytest.raises(BenchError, match=r"^adc: expected no violations of the data sheet, got gap_violations 1$"):
        adc.check()


# ---- callbacks


def test_a_watcher_sees_each_edge_of_its_pin_at_its_instant(adc: Part) -> None:
    seen: list[tuple[int, int, int]] = []
    adc.pins["DRDY"].watch(lambda level, t_ns: seen.append((level, t_ns, adc.bench.now_ns)))
    adc.bench.run_for(100 * SPS_30000_NS * 1e-9)
    assert 198 <= len(seen) <= 201
    assert all(a[0] != b[0] and a[1] < b[1] for a, b in itertools.pairwise(seen))
    assert all(t_ns == now_ns for _, t_ns, now_ns in seen)
    adc.pins["DRDY"].watch(None)
    adc.bench.run_for(1e-3)
    assert len(seen) <= 201


def test_inputs_are_asked_at_the_instants_of_sampling(adc: Part) -> None:
    asked: dict[int, list[int]] = {}

    def ramp(number: int, t_ns: int) -> float:
        asked.setdefault(number, []).append(t_ns)
        return 0.5 if number == 0 else -0.25

    began_ns = adc.bench.now_ns
    adc.set_input(ramp)
    adc.bench.run_for(SETTLED_S)
    assert ads1256_volts(read_code(adc)) == pytest.approx(0.75, abs=2e-6)
    assert set(asked) == {0, 1}  # what the multiplexer has selected
    for instants in asked.values():
        assert instants == sorted(instants)
        assert began_ns - SPS_30000_NS <= instants[0] < instants[-1] <= adc.bench.now_ns
    adc.set_input(None)
    adc.set_volts(0, 1.0)
    adc.set_volts(1, 0.0)
    before = sum(map(len, asked.values()))
    adc.bench.run_for(SETTLED_S)
    assert ads1256_volts(read_code(adc)) == pytest.approx(1.0, abs=2e-6)
    assert sum(map(len, asked.values())) == before


def test_what_a_callback_raises_comes_out_of_the_call_once(adc: Part) -> None:
    calls: list[int] = []

    class OutOfPaper(Exception):
        pass

    def watcher(level: int, t_ns: int) -> None:
        calls.append(t_ns)
        raise OutOfPaper(f"at {t_ns}")

    adc.pins["DRDY"].watch(watcher)
    with pytest.raises(OutOfPaper) as caught:
        adc.bench.run_for(1e-3)
    assert len(calls) == 1  # nothing else is called until the call is over
    assert str(caught.value) == f"at {calls[0]}"
    adc.pins["DRDY"].watch(None)
    adc.bench.run_for(1e-3)

    def interrupted(number: int, t_ns: int) -> float:
        raise KeyboardInterrupt

    adc.set_input(interrupted)
    with pytest.raises(KeyboardInterrupt):
        adc.run_until_level("DRDY", 1 - adc.pins["DRDY"].level, timeout_s=100.0)
    adc.set_input(None)
    adc.run_until_level("DRDY", 0)


def test_a_callback_cannot_move_time(adc: Part) -> None:
    adc.pins["DRDY"].watch(lambda level, t_ns: adc.bench.run_for(1e-6))
    with pytest.raises(BadInput, match=r"expected a call outside callbacks, where time may advance"):
        adc.bench.run_for(1e-3)


def test_a_callback_cannot_close_the_bench(bench: Bench, adc: Part) -> None:
    adc.pins["DRDY"].watch(lambda level, t_ns: bench.close())
    with pytest.raises(BenchError, match="from a callback"):
        bench.run_for(0.01)
    adc.pins["DRDY"].watch(None)
    assert adc.pins["DRDY"].level in (0, 1)


def test_an_input_that_is_no_number_is_a_type_error(adc: Part) -> None:
    adc.set_input(lambda number, t_ns: "one volt")  # type: ignore[arg-type,return-value]
    with pytest.raises(ValueError, match="one volt"):
        adc.bench.run_for(1e-3)


def test_callbacks_outlive_the_names_they_had(adc: Part) -> None:
    seen: list[int] = []
    adc.pins["DRDY"].watch(lambda level, t_ns: seen.append(level))
    gc.collect()
    adc.bench.run_for(1e-3)
    assert len(seen) > 50


# ---- the parts, the same answers, what goes wrong


def test_parts_and_their_options_tell_what_there_is(bench: Bench) -> None:
    assert {"ads1281", "ads1282", "ads1255", "ads1256", "psa2"} <= set(chips.parts())
    assert {"ad7710", "ad7711", "ad7711a", "ad7712"} <= set(chips.parts())
    for part in chips.parts():
        keys = [line.split("=")[0] for line in chips.options(part).splitlines()]
        assert keys
        defaults = dict(line.split("  ")[0].split("=") for line in chips.options(part).splitlines())
        assert bench.part(part, **defaults).name == part
    assert "vref_v=" in chips.options("ads1256")


@pytest.mark.parametrize("part", ["ads1281", "ads1282", "ads1255", "ads1256", "ad7710", "ad7712"])
def test_pins_know_their_direction_and_level(bench: Bench, part: str) -> None:
    pins = bench.part(part).pins
    assert len(pins) > 6
    for name, pin in pins.items():
        assert pin.name == name
        assert pin.level in (0, 1)
        if pin.is_input:
            pin.set(1 - pin.level)
        else:
            with pytest.raises(BadInput, match=rf"^{part}: {name}"):
                pin.set(1)


def test_mistakes_are_told_in_one_line(bench: Bench, adc: Part) -> None:
    mistakes: dict[str, Callable[[], object]] = {
        "ads1299": lambda: bench.part("ads1299"),
        "part: expected ads1281, .*, got ads1299": lambda: chips.options("ads1299"),
        "option of ads1256: expected one of .*, got vref": lambda: bench.part("ads1256", name="b", vref=2.5),
        "adc": lambda: bench.part("ads1256", name="adc"),
        "pin of adc: expected .*DRDY.*, got DRYD": lambda: adc.pins["DRYD"],
        "input": lambda: adc.set_volts(9, 1.0),
        "2": lambda: adc.pins["CS"].set(2),
        "frames|board": lambda: adc.board_read(0, 0),
        "SPI": lambda: bench.part("psa2").spi(b"\0"),
        "SClk: the level is known only after the burst": lambda: bench.part("psa2", name="c").pins["SClk"].level,
    }
    for says, mistake in mistakes.items():
        with pytest.raises(BadInput, match=says) as caught:
            mistake()
        assert "\n" not in str(caught.value), says
        assert len(str(caught.value)) > 15, says


def test_a_recording_that_cannot_be_written_is_an_error(bench: Bench, tmp_path: Path) -> None:
    bench.part("ads1256")
    with pytest.raises(BenchError, match="nowhere"):
        bench.vcd(tmp_path / "nowhere" / "x.vcd")


def test_the_recording_shows_what_a_watcher_saw(adc: Part, tmp_path: Path) -> None:
    falls: list[int] = []
    adc.pins["DRDY"].watch(lambda level, t_ns: None if level else falls.append(t_ns))
    adc.bench.vcd(tmp_path / "adc.vcd")
    adc.bench.run_for(1e-3)
    adc.bench.vcd_close()
    recording = read_vcd(tmp_path / "adc.vcd")
    assert len(falls) > 25
    assert recording.wires["DRDY"].edges_ns(0).tolist() == falls


def codes(seed: int, name: str) -> list[int]:
    with Bench(seed) as bench:
        adc = bench.part("ads1256", name=name)
        adc.run_until_level("DRDY", 0)
        adc.pins["CS"].set(0)
        return [read_code(adc) for _ in range(20)]


def test_seed_and_name_make_the_noise() -> None:
    assert codes(1, "adc") == codes(1, "adc")
    assert codes(1, "adc") != codes(2, "adc")
    assert codes(1, "adc") != codes(1, "other")


def test_counters_count(adc: Part) -> None:
    before = adc.counters
    read_code(adc)
    after = adc.counters
    assert after.keys() == before.keys()
    assert after["conversions"] > before["conversions"]


def test_a_closed_bench_says_so(adc: Part) -> None:
    adc.bench.close()
    adc.bench.close()
    for use in (
        lambda: adc.bench.run_for(1e-3),
        lambda: adc.bench.part("psa2"),
        lambda: adc.pins["DRDY"].level,
        lambda: adc.spi(b"\0"),
        lambda: adc.peek(0),
        lambda: adc.counters,
    ):
        with pytest.raises(BenchError, match="bench: closed"):
            use()


# ---- a board


def test_a_board_sends_frames_and_answers_for_its_converters() -> None:
    frames: list[Frame] = []
    with Bench(seed=1) as bench:
        board = bench.part("psa2", noise_scale=0)
        for axis, volts in enumerate((1.0, -0.5, 0.25)):
            board.set_volts(axis, volts)
        board.on_frame(frames.append)
        bench.run_for(0.6)
        assert board.board_read(0, 1) == 0x56  # CONFIG0 as the article sets it up
        board.board_write(0, 5, 0x12)  # OFC0
        assert [board.board_read(group, 5) for group in range(3)] == [0x12] * 3
        with pytest.raises(BenchError):
            board.board_read(4, 0)
        board.on_frame(None)
        count = len(frames)
        bench.run_for(0.01)
    assert len(frames) == count > 300
    assert [f.seq for f in frames[-3:]] == [frames[-1].seq - 2, frames[-1].seq - 1, frames[-1].seq]
    last = frames[-1]
    x, y, z = last.code
    assert x == pytest.approx(-2 * y, rel=1e-3)
    assert y == pytest.approx(-2 * z, rel=1e-3)
    assert last.t_sample_ns < last.t_int_fall_ns < last.t_int_rise_ns <= last.t_sample_ns + 1_000_000
    assert len(last.word) == 4


def test_chips_and_the_emulators_command_start_without_the_heavy_packages() -> None:
    """Loading NumPy and python-can for them would make an installed psa-emu start in a third of a second."""
    code = "import sys, psabench.chips, psabench.emulator; print({'numpy', 'can', 'scipy', 'yaml'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "set()"
