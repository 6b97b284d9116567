"""The decoder ad7712: frames on the pins beside what the driver wrote and read, right and wrong; those of a PSD-1."""

from __future__ import annotations

import random
import shutil
import struct
from collections import Counter
from pathlib import Path

import pytest
from chip_bench import Ad7712
from psabench.boards.psd1.device import Psd1
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, Message, StepClock, open_bus
from psabench.link.control import Control

from tests.py.boards.test_sigrok import ROOT, Edge, sigrok, write

pytestmark = pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")

PINS = "ad7712:sclk=SCLK:sdata=SDATA:rfs=RFS:tfs=TFS:a0=A0:drdy=DRDY:mode=MODE"
TEXTS = "ad7712=control:data:coefficient:warning"
COARSE = ("-I", "vcd:downsample=10")  # the library records at 1 ns
SELF_CAL, ZERO, FULL, WORDS = 0x228146, 0xC28013, 0xE28013, 0x028013
IDLE = {"SCLK": 0, "SDATA": 0, "RFS": 1, "TFS": 1, "A0": 0, "DRDY": 0, "MODE": 0}


def chip(path: Path, **options: float | str) -> Ad7712:
    return Ad7712(path, seed=1, noise_scale=0, **options)  # type: ignore[arg-type]


def decoded(s: Ad7712, path: Path, decoder: str = PINS, show: str = TEXTS) -> list[str]:
    s.wait_ns(1000)
    s.recording()
    return sigrok(path, decoder, show, *COARSE)


def test_a_session_is_what_the_driver_wrote_and_read(tmp_path: Path) -> None:
    vcd = tmp_path / "a.vcd"
    want = []
    with chip(vcd, offset_v=0.02, gain_error=-0.01) as s:
        s.adc.set_volts(2, 3.0)
        s.write(0x220013)
        want.append("Control = 220013h: self-calibration, gain 1, AIN2, 16 bits, bipolar, first notch 1028 Hz")
        s.adc.run_until_level("DRDY", 1, 1.0)
        s.fall()
        want.append(f"Code {s.read(count=16) - 0x8000}")
        control = s.read(a0=0)
        assert control == 0x020013  # the calibration has ended
        want.append("Control is 020013h: normal, gain 1, AIN2, 16 bits, bipolar, first notch 1028 Hz")
        s.write(WORDS | 0x1000)
        want.append("Control = 029013h: normal, gain 1, AIN2, 24 bits, unipolar, first notch 1028 Hz")
        s.fall()
        want.append(f"Code {s.read()}")
        for md, name in ((ZERO, "Zero-scale"), (FULL, "Full-scale")):
            s.write(md)
            want.append(
                f"Control = {md:06X}h: {name.lower()} coefficient, gain 1, AIN2, 24 bits, bipolar, first notch 1028 Hz"
            )
            want.append(f"{name} coefficient is {s.read():06X}h")
            s.write(0x123456, a0=1)
            want.append(f"{name} coefficient = 123456h")
        assert decoded(s, vcd) == want
    assert len({w for w in want if "coefficient is" in w} & {"800000h", "400000h"}) == 0
    fields = sigrok(vcd, PINS, "ad7712=field", *COARSE)
    assert fields[:9] == [
        *("MD = 1: self-calibration", "G = 0: gain 1", "CH = 1: AIN2", "PD = 0", "WL = 0: 16 bits"),
        *("IO/RO = 0", "BO = 0", "B/U = 0: bipolar", "FS = 19: first notch 1028 Hz"),
    ]


def test_a_self_clocked_word_and_one_in_three_parts(tmp_path: Path) -> None:
    vcd = tmp_path / "a.vcd"
    with chip(vcd) as s:
        s.write(WORDS)
        s.fall()
        parts = []
        for _ in range(3):
            s.begin("RFS", 1)
            s.wait_ns(s.FIRST_NS)
            parts.append(s.bits(8))
            s.end("RFS")
        s.pin("MODE", 1)
        s.fall()
        s.begin("RFS", 1)
        s.wait_ns(8000)
        s.end("RFS")
        first, second = decoded(s, vcd)[1:]
    assert first == f"Code {int.from_bytes(bytes(parts), 'big') - 0x800000}"
    assert second == first  # the input stands still


def frame(
    t_ns: int, name: str, word: int, bits: int = 24, *, high_ns: int = 400, last_ns: int = 500, period_ns: int = 800
) -> list[Edge]:
    """RFS or TFS low at t_ns, bits before the rises of SCLK; the frame ends last_ns after the last fall."""
    edges: list[Edge] = [(t_ns, name, 0)]
    for n in range(bits):
        rise = t_ns + 700 + period_ns * n
        edges += [(rise - 100, "SDATA", word >> (bits - 1 - n) & 1), (rise, "SCLK", 1), (rise + high_ns, "SCLK", 0)]
    return [*edges, (t_ns + 700 + period_ns * (bits - 1) + high_ns + last_ns, name, 1)]


UP: list[Edge] = [(40_000, "A0", 1)]
DOWN: list[Edge] = [(100_000, "A0", 0)]
SET = frame(10_000, "TFS", WORDS)
CASES = {
    "set-up": ([*SET, *UP, *frame(40_190, "RFS", 5)], "A0 to RFS: 190 ns, not 200"),
    "high": ([*SET, *UP, *frame(50_000, "RFS", 5, high_ns=190)], "SCLK high: 190 ns, not 200"),
    "low": ([*SET, *UP, *frame(50_000, "RFS", 5, high_ns=610)], "SCLK low: 190 ns, not 200"),
    "end of a write": (frame(10_000, "TFS", 5, last_ns=390), "SCLK to TFS: 390 ns, not 400"),
    "short write": (frame(10_000, "TFS", 5, bits=23), "Cut write: 23 bits, not 24"),
    "long write": (frame(10_000, "TFS", 5, bits=25), "1 pulses after the last bit"),
    "short read": ([*SET, *UP, *frame(50_000, "RFS", 5, bits=23), *DOWN], "Cut read: 23 bits, not 24"),
    "replaced": (
        [*SET, *UP, *frame(50_000, "RFS", 5, bits=8), (80_000, "DRDY", 1), (90_000, "DRDY", 0)],
        "Cut read: 8 bits, not 24",
    ),
    "lost": ([*SET, *UP, *frame(50_000, "TFS", 5)], "Write with A0 high, MD not 110 or 111"),
    "moved": ([*SET, *UP, *frame(90_000, "RFS", 5), *DOWN], "A0 moved in a frame"),
    "both": ([*frame(10_000, "TFS", WORDS), (20_000, "RFS", 0), (21_000, "RFS", 1)], "RFS and TFS low"),
    "stale": ([*SET, (35_000, "DRDY", 1), *UP, *frame(50_000, "RFS", 5)], "Read while DRDY is high"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_breaks_a_limit_or_the_order_is_told(name: str, tmp_path: Path) -> None:
    edges, warning = CASES[name]
    vcd = write(tmp_path / "a.vcd", IDLE, edges, 200_000)
    assert sigrok(vcd, PINS, "ad7712=warning") == [warning] * (24 if name == "high" else 23 if name == "low" else 1)


@pytest.mark.parametrize("high_ns", [200, 300])
def test_limits_that_are_just_kept_are_no_warnings(high_ns: int, tmp_path: Path) -> None:
    edges = frame(10_000, "TFS", WORDS, high_ns=high_ns, last_ns=400, period_ns=500)
    edges += [*UP, *frame(40_200, "RFS", 0x800005, high_ns=high_ns, last_ns=10, period_ns=500)]
    vcd = write(tmp_path / "a.vcd", IDLE, edges, 200_000)
    assert sigrok(vcd, PINS, "ad7712=data:warning") == ["Code 5"]


def test_what_is_unknown_or_not_connected_is_taken_from_the_frame(tmp_path: Path) -> None:
    edges = [
        *frame(10_000, "RFS", 0x8001, bits=16),
        *frame(40_000, "RFS", 0x7FFFFF),
        *frame(80_000, "RFS", 0x80, bits=8),
    ]
    vcd = write(tmp_path / "a.vcd", IDLE, [*edges, *frame(100_000, "RFS", 0x02, bits=8)], 200_000)
    plain = "ad7712:sclk=SCLK:sdata=SDATA:rfs=RFS"
    assert sigrok(vcd, plain, TEXTS) == ["Code 1", "Code -1", "Code 2"]
    assert sigrok(vcd, f"{plain}:format=hex", TEXTS) == ["Code 8001h", "Code 7FFFFFh", "Code 8002h"]
    assert sigrok(vcd, f"{plain}:word_bits=24", TEXTS) == ["16 pulses after the last bit", "Code 383"]


def test_a_waiting_word_comes_before_the_control_register(tmp_path: Path) -> None:
    vcd = tmp_path / "a.vcd"
    with chip(vcd) as s:
        s.write(WORDS)
        s.fall()
        first, second = s.read(a0=0), s.read(a0=0)
        assert decoded(s, vcd)[1:] == [
            f"Code {first - 0x800000}",
            f"Control is {second:06X}h: normal, gain 1, AIN2, 24 bits, bipolar, first notch 1028 Hz",
        ]
    assert second == WORDS


def random_frames(s: Ad7712, draw: random.Random, count: int) -> None:
    """Reads and writes, some cut, some too long, with any control word that keeps the chip running."""
    for _ in range(count):
        if draw.random() < 0.4:
            s.fall()
        s.begin("TFS" if (writes := draw.random() < 0.4) else "RFS", draw.randrange(2))
        s.pin("SDATA", draw.randrange(2))
        s.wait_ns(s.FIRST_NS)
        if writes:
            s.bits(2)  # MD is 000, 011, 100 or 111
            s.pin("SDATA", 0)
            s.wait_ns(s.HALF_NS)
        s.bits(draw.choice([22, 22, 22, 21, 25]) if writes else draw.choice([8, 16, 16, 24, 24, 30]))
        s.end("TFS" if writes else "RFS")


@pytest.mark.parametrize("seed", [1, 2])
def test_warnings_are_what_the_converter_has_counted(seed: int, tmp_path: Path) -> None:
    vcd = tmp_path / "a.vcd"
    with chip(vcd) as s:
        s.write(0x020013)
        random_frames(s, random.Random(seed), 150)
        n = s.adc.counters
        warnings = decoded(s, vcd, show="ad7712=warning")
    seen = Counter(warning.lstrip("0123456789 ") for warning in warnings)
    pulses = sum(int(w.split()[0]) for w in warnings if w[0].isdigit())
    assert n["dropped"] == sum(k for w, k in seen.items() if w.startswith("Cut write")) > 5
    assert n["refused"] == seen["Write with A0 high, MD not 110 or 111"] > 5
    assert n["stale_reads"] == seen["Read while DRDY is high"] > 3
    assert n["over_reads"] + n["over_writes"] == pulses > 5
    assert not [w for w in warnings if " ns, not " in w or "moved" in w]
    assert n["a0_violations"] == n["sclk_violations"] == n["frame_violations"] == 0


def test_the_set_up_and_the_words_of_a_psd1_are_those_on_can(tmp_path: Path) -> None:
    vcd, messages = tmp_path / "run.vcd", list[Message]()
    scenario = ROOT / "tests/golden/psd1.yaml"
    with Emulator(scenario, pace="step", extra=["--vcd", vcd]) as emu:
        can = emu.endpoint(can="socketcand")
        with (
            Control(emu.directory / "control") as control,
            CanHost(open_bus(f"socketcand:{can['host']}:{can['port']}"), StepClock(control)) as host,
        ):
            host.listeners.append(messages.append)
            host.advance(0.02)
            node = Psd1(host).node
            coefficients = [[node.read(index, axis) for index in (0x2044, 0x2045)] for axis in (1, 2, 3)]
    words = [struct.unpack("<3H", m.data[:6]) for m in messages if m.arbitration_id == 0x186]
    assert len(words) >= 8
    for axis, name in enumerate("XYZ"):
        pins = f"ad7712:sclk=SCLK:sdata=SDAT:rfs=RF{name}:tfs=TFS:a0=A0"
        seen = sigrok(vcd, pins, TEXTS)
        zero, full = coefficients[axis]
        names = [text.split(":")[0] for text in seen[:6]]
        assert names == [
            *("Control = 220013h", "Control = C20013h", f"Zero-scale coefficient is {zero:06X}h"),
            *("Control = E20013h", f"Full-scale coefficient is {full:06X}h", "Control = 020013h"),
        ]
        assert seen[6 : 6 + len(words)] == [f"Code {word[axis] - 0x8000}" for word in words]
