"""sigrok-cli reads our recordings: set-up and frames as the emulator drew them, beside CAN and the line port.

Then the shipped decoders on lines written here bit by bit, right and wrong.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest
from psabench.boards.board import PARALLEL_BUS
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, Message, StepClock, open_bus
from psabench.link.control import Control
from psabench.link.lineport import Frames, LineDecoder, concat, decode_stream, open_line
from psabench.link.vcd import read_vcd

ROOT = Path(__file__).resolve().parents[3]
HALF_NS = 250  # of CLK and SClk

ARTICLE_SETUP = [  # section 5: data, then command bytes as drawn; sent command first (docs/boards/psa2.md)
    *[("DIn", byte) for byte in ("41", "00", "56")],
    *[("DInT", byte) for byte in ("50", "00", "02", "50", "00", "04", "53", "00", "82")],
    ("SYNC_T", ""),
    ("SYNC_A", ""),
]
SPI_IDLE = {"SClk": 0, "DIn": 0, "DOutX": 0, "CST": 1, "DInT": 0, "DOutT": 0}
ACCEL = "spi:clk=SClk:mosi=DIn:miso=DOutX:cs=CST:cs_polarity=active-high"
TEMP = "spi:clk=SClk:mosi=DInT:miso=DOutT:cs=CST:cpha=1"
LINES = "psa2frame:int=Int:data=Data:clk=CLK"
PSD1 = "psd1cycle:a0=A0:rfx=RFX:rfy=RFY:rfz=RFZ:sclk=SCLK:sdat=SDAT:fl2=FL2:cs=CS:rw=RW"
PSABUS = ":".join(["psabus", *(f"{line.lower()}={line}" for line in PARALLEL_BUS)])
AD7712_ALONE = "ad7712:sclk=SCLK:sdata=SDATA:rfs=RFS"
AD7712 = f"{AD7712_ALONE}:tfs=TFS:a0=A0:drdy=DRDY:mode=MODE"
XY, ZT = 0x185, 0x285  # CAN identifiers of node 5

pytestmark = pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")

Edge = tuple[int, str, int]


def sigrok(vcd: Path, decoders: str, show: str, *options: str) -> list[str]:
    """Annotations as lines, without the decoder's name."""
    run = subprocess.run(
        ["sigrok-cli", "-i", str(vcd), "-P", decoders, "-A", show, *options],
        env={**os.environ, "SIGROKDECODE_DIR": str(ROOT / "decoders")},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, ""), run.stdout
    return [re.sub(r"\S+-1: ", "", line, count=1) for line in run.stdout.splitlines()]


def test_the_set_up_is_the_articles_bytes_in_order(tmp_path: Path) -> None:
    vcd = tmp_path / "run.vcd"
    with Emulator(cans=["none"], pace="free", seed=1, control=False, extra=["--for", "150ms", "--vcd", vcd]) as emu:
        assert emu.wait(30) == 0
    seen: list[tuple[int, str, str]] = []
    for line, port in (("DIn", ACCEL), ("DInT", TEMP)):
        for text in sigrok(vcd, port, "spi=mosi-data", "--protocol-decoder-samplenum"):
            sample, byte = text.split(" ")
            seen.append((int(sample.split("-")[0]), line, byte))
    recording = read_vcd(vcd)
    seen += [(recording.wires[line].t_ns[1] // recording.unit_ns, line, "") for line in ("SYNC_T", "SYNC_A")]
    in_order = [(line, byte) for _, line, byte in sorted(seen)]
    assert in_order[: len(ARTICLE_SETUP)] == ARTICLE_SETUP


def signed24(raw: bytes | bytearray) -> int:
    return int.from_bytes(raw, "little", signed=True)


def record_everything(vcd: Path, link: Path) -> tuple[list[Message], Frames, LineDecoder]:
    """0.3 simulated seconds on CAN, on the line port and in a VCD at once."""
    decoder, got, messages = LineDecoder(), list[Frames](), list[Message]()
    with Emulator(pace="step", seed=7, extra=["--start", "--vcd", vcd, "--line", link]) as emu:
        line = open_line(link)
        reader = threading.Thread(target=lambda: got.extend(decode_stream(line, decoder)), daemon=True)
        reader.start()
        can = emu.endpoint(can="socketcand")
        with (
            Control(emu.directory / "control") as control,
            CanHost(open_bus(f"socketcand:{can['host']}:{can['port']}"), StepClock(control)) as host,
        ):
            host.listeners.append(messages.append)
            host.advance(0.3)
    reader.join(10)
    line.close()
    return messages, concat(got), decoder


def test_can_line_port_and_vcd_carry_the_same_words(tmp_path: Path) -> None:
    vcd = tmp_path / "run.vcd"
    messages, line, decoder = record_everything(vcd, tmp_path / "line")
    xy = [m.data for m in messages if m.arbitration_id == XY]
    zt = [m.data for m in messages if m.arbitration_id == ZT]
    can = [
        [signed24(a[0:3]), signed24(a[3:6]), signed24(b[0:3]), int.from_bytes(b[3:5], "little")]
        for a, b in zip(xy, zt, strict=False)
    ]
    assert len(can) >= 50
    words = [[x, y, z, t & 0xFFFF] for x, y, z, t in line.signed(32).tolist()]
    assert decoder.counts.torn == decoder.counts.lost == decoder.counts.gaps == 0
    frames = sigrok(vcd, LINES, "psa2frame=frame:warning")
    drawn = [[int(v.split("=")[1].rstrip("h"), 16 if v[0] == "T" else 10) for v in f.split()[2:6]] for f in frames]
    assert drawn[: len(can)] == can
    # what is still on its way to a reader when the emulator ends is lost: up to the buffers of the pty
    assert len(words) >= 50
    assert words == can[: len(words)]


def write(path: Path, idle: dict[str, int], edges: Sequence[Edge], end_ns: int) -> Path:
    """A VCD as emu/trace/vcd.c writes it, 10 ns a unit."""
    code = {name: chr(ord("!") + i) for i, name in enumerate(idle)}
    out = ["$version psabench $end\n$timescale 10 ns $end\n$scope module psa2 $end\n"]
    out += [f"$var wire 1 {c} {name} $end\n" for name, c in code.items()]
    out += ["$upscope $end\n$enddefinitions $end\n#0\n$dumpvars\n"]
    out += [f"{v}{code[name]}\n" for name, v in idle.items()] + ["$end\n"]
    level = dict(idle)
    for t_ns, name, v in sorted(edges, key=lambda e: e[0]):
        if level[name] != v:
            level[name] = v
            out.append(f"#{t_ns // 10}\n{v}{code[name]}\n")
    path.write_text("".join(out) + f"#{end_ns // 10}\n", encoding="ascii")
    return path


def frame(
    t_ns: int, words: Sequence[int], word_bits: int = 32, msb_first: bool = False, clks: int = 10**6
) -> list[Edge]:
    """INT, DATA and CLK of a frame of which only the first clks bits are clocked."""
    period, lead_in = 2 * HALF_NS, 8
    edges: list[Edge] = [(t_ns, "Int", 0)]
    for w, word in enumerate(words):
        for bit in range(word_bits):
            at = t_ns + (lead_in + w * (word_bits + 4) + bit) * period
            place = word_bits - 1 - bit if msb_first else bit
            edges.append((at, "Data", word >> place & 1))
            if w * word_bits + bit < clks:
                edges += [(at + HALF_NS, "CLK", 1), (at + period, "CLK", 0)]
    return [*edges, (t_ns + (lead_in + 4 * word_bits + 12) * period, "Int", 1)]


FRAME_IDLE = {"Int": 1, "Data": 0, "CLK": 0}


def test_frames_on_int_data_clk(tmp_path: Path) -> None:
    edges = frame(1000, [1, 0xFFFFFC18, 8388607, 0x00921234]) + frame(1_001_000, [0, 0x80000000, 5, 0xFFFF])
    vcd = write(tmp_path / "f.vcd", FRAME_IDLE, edges, 2_000_000)
    assert sigrok(vcd, LINES, "psa2frame=frame:warning") == [
        "Frame 0: X=1 Y=-1000 Z=8388607 T=1234h ch2 st9",
        "Frame 1: X=0 Y=-2147483648 Z=5 T=FFFFh ch0 st0",
    ]


@pytest.mark.parametrize(
    ("word_bits", "order", "words", "want"),
    [
        (16, "lsb-first", [0x8000, 1, 2, 0xABCD], "Frame 0: X=-32768 Y=1 Z=2 T=ABCDh"),
        (
            24,
            "lsb-first",
            [0x800000, 0x7FFFFF, 0xFFFFFF, 0x91ABCD],
            "Frame 0: X=-8388608 Y=8388607 Z=-1 T=ABCDh ch1 st9",
        ),
        (32, "msb-first", [1, 2, 3, 0x00F3ABCD], "Frame 0: X=1 Y=2 Z=3 T=ABCDh ch3 stF"),
    ],
)
def test_width_and_order_are_options(tmp_path: Path, word_bits: int, order: str, words: list[int], want: str) -> None:
    vcd = write(tmp_path / "f.vcd", FRAME_IDLE, frame(1000, words, word_bits, order == "msb-first"), 200_000)
    got = sigrok(vcd, f"{LINES}:word_bits={word_bits}:bit_order={order}", "psa2frame=frame:warning")
    assert got == [want]


def test_order_of_words_is_an_option(tmp_path: Path) -> None:
    vcd = write(tmp_path / "f.vcd", FRAME_IDLE, frame(1000, [0x1234, 10, 20, 30]), 200_000)
    assert sigrok(vcd, f"{LINES}:words=TZYX", "psa2frame=word") == ["T=1234h ch0 st0", "Z=10", "Y=20", "X=30"]


def test_torn_frames_are_told_and_the_next_is_read(tmp_path: Path) -> None:
    stub: list[Edge] = [(0, "Int", 0), (90_000, "Int", 1)]  # under way when the recording begins: its fall is not seen
    edges = stub + frame(200_000, [1, 2, 3, 4], clks=127) + frame(400_000, [1, 2, 3, 4])
    edges += [(600_000, "Int", 0), (660_000, "Int", 1)]
    vcd = write(tmp_path / "f.vcd", FRAME_IDLE | {"Int": 0}, edges, 700_000)
    assert sigrok(vcd, LINES, "psa2frame=frame:warning") == [
        "Torn frame: 127 bits, not 128",
        "Frame 0: X=1 Y=2 Z=3 T=0004h ch0 st0",
        "Torn frame: 0 bits, not 128",
    ]


def accel(t_ns: int, mosi: bytes, miso: bytes = b"") -> list[Edge]:
    """SPI mode 0: data change where SClk falls and are taken where it rises."""
    edges: list[Edge] = []
    for i, out in enumerate(mosi):
        back = miso[i] if miso else 0
        for bit in range(8):
            at = t_ns + (8 * i + bit) * 2 * HALF_NS
            edges += [(at, "DIn", out >> (7 - bit) & 1), (at, "DOutX", back >> (7 - bit) & 1)]
            edges += [(at + HALF_NS, "SClk", 1), (at + 2 * HALF_NS, "SClk", 0)]
    return edges


def temp(t_ns: int, mosi: bytes, miso: bytes = b"") -> list[Edge]:
    """SPI mode 1 inside a chip select: data change where SClk rises and are taken where it falls."""
    edges: list[Edge] = [(t_ns - 500, "CST", 0)]
    for i, out in enumerate(mosi):
        back = miso[i] if miso else 0
        for bit in range(8):
            at = t_ns + (8 * i + bit) * 2 * HALF_NS
            edges += [(at, "DInT", out >> (7 - bit) & 1), (at, "DOutT", back >> (7 - bit) & 1)]
            edges += [(at, "SClk", 1), (at + HALF_NS, "SClk", 0)]
    return [*edges, (t_ns + 8 * len(mosi) * 2 * HALF_NS + 500, "CST", 1)]


def record(tmp_path: Path, *transfers: list[Edge]) -> Path:
    edges = [e for t in transfers for e in t]
    return write(tmp_path / "s.vcd", SPI_IDLE, edges, max(t for t, _, _ in edges) + 10_000)


def test_accelerometer_converter_commands_and_words(tmp_path: Path) -> None:
    vcd = record(
        tmp_path,
        accel(10_000, bytes.fromhex("410056")),
        temp(50_000, bytes.fromhex("500002")),  # on the same SClk, for the other converter
        accel(100_000, bytes(3), bytes.fromhex("123456")),
        accel(200_000, bytes(3), bytes.fromhex("FFFFFE")),
        accel(300_000, bytes(2)),  # no word: two WAKEUPs
        accel(400_000, bytes.fromhex("112100 00".replace(" ", "")), bytes.fromhex("00000056")),
        accel(500_000, bytes.fromhex("12000000"), bytes.fromhex("00800000")),
        accel(600_000, bytes.fromhex("7F4B0001")),
        accel(700_000, bytes.fromhex("0410")),
    )
    assert sigrok(vcd, f"{ACCEL},ads128x", "ads128x") == [
        "WREG 01h x1",
        "CONFIG0 = 56h: pulse sync, 1000 SPS, minimum phase, sinc + FIR",
        "Code 1193046",
        "Code -2",
        "WAKEUP",
        "WAKEUP",
        "SDATAC",
        "RREG 01h x1",
        "CONFIG0 is 56h: pulse sync, 1000 SPS, minimum phase, sinc + FIR",
        "RDATA",
        "Code -8388608",
        "Unknown opcode 7Fh",
        "WREG 0Bh x1",
        "No register 0Bh",
        "SYNC",
        "RDATAC",
    ]


def test_word_of_the_accelerometer_converter_may_have_32_bits(tmp_path: Path) -> None:
    vcd = record(tmp_path, accel(10_000, bytes(4), bytes.fromhex("80000001")))
    assert sigrok(vcd, f"{ACCEL},ads128x:word_bits=32", "ads128x=data") == ["Code -2147483647"]


def test_temperature_converter_commands_and_words(tmp_path: Path) -> None:
    vcd = record(
        tmp_path,
        temp(10_000, bytes.fromhex("500002")),
        temp(50_000, bytes.fromhex("500004")),
        accel(80_000, bytes.fromhex("410056")),  # on the same SClk, for the others
        temp(100_000, bytes.fromhex("530082")),
        temp(150_000, bytes.fromhex("51012820")),
        temp(200_000, bytes.fromhex("01000000"), bytes.fromhex("00008001")),
        temp(300_000, bytes.fromhex("03")),
        temp(400_000, bytes.fromhex("005100"), bytes.fromhex("7FFFFF")),  # inside a word nothing but SDATAC is obeyed
        temp(500_000, bytes.fromhex("0FFCFF")),
        temp(600_000, bytes.fromhex("5000")),
    )
    assert sigrok(vcd, f"{TEMP},ads1256", "ads1256") == [
        "WREG 00h x1",
        "STATUS = 02h: auto-calibration off, buffer on",
        "WREG 00h x1",
        "STATUS = 04h: auto-calibration on, buffer off",
        "WREG 03h x1",
        "DRATE = 82h: 100 SPS",
        "WREG 01h x2",
        "MUX = 28h: + AIN2, - AINCOM",
        "ADCON = 20h: gain 1",
        "RDATA",
        "Code 32769",
        "RDATAC",
        "Code 8388607",
        "SDATAC",
        "SYNC",
        "WAKEUP",
        "WREG 00h x1",
        "Chip select ended a command",
    ]


def test_sigrok_finds_every_decoder_whichever_it_loads_first(tmp_path: Path) -> None:
    shipped = {p.parent.name for p in ROOT.glob("decoders/*/pd.py")}
    assert shipped == {"ad7712", "ads1256", "ads128x", "psa2frame", "psabus", "psd1cycle"}
    assert not [p for p in (ROOT / "decoders").rglob("*") if p.is_symlink()], "a link does not survive every copy"
    shutil.copytree(ROOT / "decoders", tmp_path / "copy")
    run = subprocess.run(
        ["sigrok-cli", "-l", "2", "-L"],
        env={**os.environ, "SIGROKDECODE_DIR": str(tmp_path / "copy")},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert shipped <= {line.split()[0] for line in run.stdout.splitlines() if line.startswith("  ")}


GARBAGE: dict[str, tuple[str, dict[str, int]]] = {  # a decoder, its lines and how often each is drawn
    "psa2frame": (LINES, {"CLK": 3, "Int": 1, "Data": 1}),
    "psa2frame, 16 bits": (f"{LINES}:word_bits=16:words=T:format=hex", {"CLK": 9, "Int": 1, "Data": 1}),
    "ads128x": (f"{ACCEL},ads128x", {"SClk": 300, "DIn": 100, "DOutX": 100, "CST": 1}),
    "ads1256, continuous": (f"{TEMP},ads1256", {"SClk": 300, "DInT": 100, "DOutT": 100, "CST": 1}),
    "psd1cycle": (PSD1, {"SCLK": 3} | dict.fromkeys("A0 RFX RFY RFZ SDAT FL2 CS RW".split(), 1)),
    "psd1cycle, long": (PSD1, {"SCLK": 300, "SDAT": 100, "A0": 1} | dict.fromkeys("RFX RFY RFZ FL2 CS RW".split(), 5)),
    "psabus": (PSABUS, dict.fromkeys(PARALLEL_BUS, 1)),
    "ad7712": (AD7712, {"SCLK": 3} | dict.fromkeys("SDATA RFS TFS A0 DRDY MODE".split(), 1)),
    "ad7712, alone": (f"{AD7712_ALONE}:clock_hz=-1", {"SCLK": 40, "SDATA": 40, "RFS": 1}),
    "ad7712, long": (AD7712, {"SCLK": 200, "SDATA": 40} | dict.fromkeys("RFS TFS A0 DRDY MODE".split(), 1)),
    "ad7712, 16 bits": (
        f"{AD7712}:clock_hz=0:word_bits=16:format=hex",
        {"SCLK": 99, "SDATA": 40} | dict.fromkeys("RFS TFS A0 DRDY MODE".split(), 1),
    ),
}


@pytest.mark.parametrize("name", GARBAGE)
def test_arbitrary_levels_are_decoded_without_an_error(name: str, tmp_path: Path) -> None:
    decoder, lines = GARBAGE[name]
    draw = random.Random(name)
    drawn = draw.choices(list(lines), list(lines.values()), k=25_000)
    edges = [(10 * n, line, draw.randrange(2)) for n, line in enumerate(drawn)]
    vcd = write(tmp_path / "g.vcd", dict.fromkeys(lines, 0), edges, 300_000)
    assert len(sigrok(vcd, decoder, decoder.split(",")[-1].split(":")[0])) > 20  # and nothing on stderr


def test_the_shipped_sessions_name_lines_that_exist() -> None:
    recorded = set(read_vcd(ROOT / "tests/golden/setup.vcd").wires) | set(
        read_vcd(ROOT / "tests/golden/first_frames.vcd").wires
    )
    pvs = re.findall(r"assigned_signal_name=(\w+)", (ROOT / "share/psa2.pvs").read_text())
    gtkw = re.findall(r"^psa2\.(\w+)$", (ROOT / "share/psa2.gtkw").read_text(), re.MULTILINE)
    assert len(pvs) == 11
    assert len(gtkw) == 16
    assert {*pvs, *gtkw} <= recorded | {"DInT", "DOutT"}
    assert re.findall(r"id=(\w+)", (ROOT / "share/psa2.pvs").read_text()) == [
        "psa2frame",
        "spi",
        "ads128x",
        "spi",
        "ads1256",
    ]
