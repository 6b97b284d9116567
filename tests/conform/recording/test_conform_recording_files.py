"""Readers of recordings: damaged, cut, hostile and random files end in BadInput with file and place, or in a take.

The seed of the random files is fixed and is in every message of a failure.
"""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

import made_recordings as make
import numpy as np
import pytest
from made_recordings import Made, judge
from psabench.cli import main
from psabench.conform import recording, suite
from psabench.conform.profile import variant
from psabench.conform.sources import blf
from psabench.conform.sources.files import CAN_ENDINGS, Recording, read_files
from psabench.conform.sources.taken import Bounds
from psabench.errors import BadInput
from psabench.link.vcd import Wire, read_vcd
from psabench.procedures.head_bench import Silent

SEED = 20261122
ROUNDS = 40  # of each kind of file
METADATA = """[global]
sigrok version=0.5.2

[device 1]
capturefile=logic-1
total probes=3
samplerate=8 MHz
total analog=0
probe1=Int
probe2=Data
probe3=CLK
unitsize=1
"""


@pytest.fixture(scope="module")
def psa2(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return make.record(tmp_path_factory.mktemp("psa2"), "psa2", dwell="230ms")


@pytest.fixture(scope="module")
def files(psa2: Made) -> Mapping[str, bytes]:
    """One good file of each kind by its ending."""
    wires, end_ns = make.port_lines(psa2), make.span_ns(psa2)
    capture = make.samples(wires, end_ns, 8e6)
    found = {".log": psa2.log.read_bytes(), ".bin": capture[-400_000:], ".sr": session(capture)}
    found[".vcd"] = make.write_vcd(psa2.vcd.with_name("three.vcd"), wires, end_ns).read_bytes()
    return found | {e: make.converted(psa2.log, e).read_bytes() for e in CAN_ENDINGS if e not in (".log", ".mf4")}


def session(capture: bytes, metadata: str = METADATA, parts: int = 3) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("version", "2")
        archive.writestr("metadata", metadata)
        for k in range(parts):
            archive.writestr(f"logic-1-{k + 1}", capture[k * len(capture) // parts : (k + 1) * len(capture) // parts])
    return out.getvalue()


def read(path: Path, data: bytes, **bounds: float) -> Recording:
    path.write_bytes(data)
    return read_files([path], "psa2", {}, Bounds(**bounds))


# ---- cut and damaged files


@pytest.mark.parametrize("ending", [".log", ".blf", ".asc", ".vcd"])
def test_what_came_before_a_cut_is_judged_and_said(
    ending: str, files: Mapping[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, data = tmp_path / f"cut{ending}", files[ending]
    if ending == ".vcd":  # a cut VCD is a shorter one; a broken word is damage
        at = data.rindex(b"\n#", 0, len(data) * 95 // 100) + 1
        path.write_bytes(data[:at] + b"?broken\n" + data[at:])
    else:
        path.write_bytes(data[: len(data) * 95 // 100 - 3])
    said = judge(tmp_path, path)
    assert said.clean, [said.told(i) for i in said.failed]  # no frame is a shorter one by the cut
    assert said.passed
    printed = capsys.readouterr().out
    assert f"{path}: " in printed
    assert any(word in printed for word in ("a line feed at the end", "container", "unpacked byte", "got '?broken'"))


def test_a_damaged_chunk_of_a_session_ends_it_there(
    files: Mapping[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("psabench.conform.sources.sigrok.BLOCK", 4096)
    data = bytearray(files[".sr"])
    with zipfile.ZipFile(io.BytesIO(bytes(data))) as archive:
        info = archive.getinfo("logic-1-3")
        at = info.header_offset + 30 + len(info.filename) + info.compress_size // 2
    data[at : at + 20] = b"\xff" * 20
    found = read(tmp_path / "x.sr", bytes(data))
    assert found.lines is not None
    assert "logic-1-3 is damaged" in found.notes[0]
    with zipfile.ZipFile(io.BytesIO(files[".sr"])) as archive:
        before = sum(archive.getinfo(f"logic-1-{k}").file_size for k in (1, 2))
    assert found.lines.end_ns == before * 125  # of the damaged one nothing is sure


def test_a_damaged_container_is_left_out_whole(psa2: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("can.io.blf.BLFWriter.max_container_size", 1024)
    data = bytearray(make.converted(psa2.log, ".blf").read_bytes())
    whole = read(tmp_path / "x.blf", bytes(data)).can
    data[-60] ^= 0xFF
    found = read(tmp_path / "x.blf", bytes(data))
    assert whole is not None
    assert found.can is not None
    assert found.can.frames == whole.frames[: len(found.can)]
    assert len(whole) // 2 < len(found.can) < len(whole)
    assert "nothing of it is sure in the container at byte" in found.notes[0]


# ---- bounds


def test_no_more_is_judged_than_was_asked(files: Mapping[str, bytes], tmp_path: Path) -> None:
    for ending, data in files.items():
        found = read(tmp_path / f"x{ending}", data, max_s=0.01)
        assert "judged to 0.01 s" in found.notes[0], ending
        if found.lines is not None:
            assert found.lines.end_ns <= 10_100_000
        else:
            assert found.can is not None
            assert found.can.frames[-1].t_s - found.can.frames[0].t_s <= 0.01


def refused(tmp_path: Path, name: str, data: bytes) -> str:
    path = tmp_path / name
    path.write_bytes(data)
    tracemalloc.start()
    with pytest.raises(BadInput) as e:
        read_files([path], "psa2", {}, Bounds())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100e6
    assert str(path) in str(e.value)
    return str(e.value)


def test_zip_bombs_are_refused(tmp_path: Path) -> None:
    bomb = bytearray(session(b"\1" * 300))
    with zipfile.ZipFile(io.BytesIO(bytes(bomb))) as archive:
        at = archive.start_dir
    while (at := bomb.find(b"PK\1\2", at)) >= 0:  # the directory claims 4 GB for each member
        struct.pack_into("<L", bomb, at + 24, 0xFFFFFFF0)
        at += 4
    assert "expected at most " in refused(tmp_path, "bomb.sr", bytes(bomb))
    padded = METADATA + ";" * 70_000
    assert "metadata of" in refused(tmp_path, "padded.sr", session(b"\1", padded))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("metadata", METADATA)
    assert "expected members packed as sigrok does" in refused(tmp_path, "lzma.sr", out.getvalue())


def test_a_blf_bomb_is_not_unpacked(
    files: Mapping[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blf, "MOST_UNPACKED", 1 << 20)
    packed = zlib.compress(b"\0" * (64 << 20), 9)
    container = blf.CONTAINER.pack(2, 64 << 20) + packed
    base = blf.BASE.pack(b"LOBJ", 16, 1, blf.BASE.size + len(container), 10)
    refused(tmp_path, "bomb.blf", files[".blf"][:144] + base + container)


@pytest.mark.timeout(60)
def test_an_object_without_a_length_does_not_hang(files: Mapping[str, bytes], tmp_path: Path) -> None:
    odd = struct.pack("<4sHHLL", b"LOBJ", 32, 7, 0, 1) + bytes(32)  # python-can's reader would not end
    container = blf.CONTAINER.pack(0, len(odd)) + odd
    base = blf.BASE.pack(b"LOBJ", 16, 1, blf.BASE.size + len(container), 10)
    assert "an object of 0 bytes" in refused(tmp_path, "odd.blf", files[".blf"][:144] + base + container)


def test_lines_without_an_end_are_refused(tmp_path: Path) -> None:
    assert "characters at most, got more" in refused(tmp_path, "long.log", b"(1.0) can0 185#00" * 20_000)
    assert "characters at most, got more" in refused(tmp_path, "late.asc", b"date\n" * 300_000 + b"x" * 70_000)


# ---- random files


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes changed, taken out, put in or doubled; or the end cut off."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 12))):
        at, n = int(rng.integers(0, len(out))), int(rng.integers(1, 40))
        kind = int(rng.integers(0, 5))
        if kind == 0:
            out[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 1:
            del out[at : at + n]
        elif kind == 2:
            out[at:at] = rng.bytes(n)
        elif kind == 3:
            out[at:at] = out[at : at + n]
        else:
            del out[max(1, int(len(out) * rng.random())) :]
        if not out:
            return b"x"
    return bytes(out)


def near_the_head(data: bytes, rng: np.random.Generator) -> bytes:
    """Heads are where lengths and numbers stand."""
    return mutated(data[:600], rng) + data[600:]


@pytest.mark.parametrize("change", [mutated, near_the_head], ids=lambda f: f.__name__)
@pytest.mark.parametrize("ending", [*(e for e in CAN_ENDINGS if e != ".mf4"), ".vcd", ".sr", ".bin"])
def test_mutated_files_end_in_words(
    ending: str,
    change: Callable[[bytes, np.random.Generator], bytes],
    files: Mapping[str, bytes],
    tmp_path: Path,
) -> None:
    suite.load()
    rng = np.random.default_rng([SEED, len(ending), *ending.encode(), len(change.__name__)])
    path = tmp_path / f"x{ending}"
    taken, refusals = 0, dict[int, str]()
    for n in range(ROUNDS):
        data = change(files[ending], rng)
        try:
            found = read(path, data, max_s=1.0)
            judged(found, f"seed {SEED}, {ending}, {change.__name__}, round {n}", every=n % 10 == 0)
            taken += 1
        except BadInput as e:
            refusals[n] = str(e)
    assert all(str(path) in why for why in refusals.values()), f"seed {SEED}: {refusals}"
    print(f"seed {SEED}: {taken} of {ROUNDS} {ending} were taken")


def judged(found: Recording, which: str, *, every: bool) -> None:
    """No check ends in an exception; of some files all are run."""
    bench = recording.Bench(recording=found, variant=variant("psa2"), node=5)
    bench.clocks.facts()
    if every:
        outcomes = recording.run(bench, Silent())
        bad = [(o.test, o.reason) for o in outcomes if o.reason.startswith("the test itself failed")]
        assert not bad, f"{which}: {bad}"


@pytest.mark.parametrize("ending", [*CAN_ENDINGS, ".vcd", ".sr", ".bin"])
def test_random_bytes_end_in_words(ending: str, tmp_path: Path) -> None:
    rng = np.random.default_rng([SEED, *ending.encode()])
    path, refusals = tmp_path / f"x{ending}", dict[int, str]()
    for n in range(ROUNDS):
        data = rng.bytes(int(rng.integers(0, 5000)))
        try:
            judged(read(path, data), f"seed {SEED}, round {n}", every=n < 3)
        except BadInput as e:
            refusals[n] = str(e)
    assert all(str(path) in why for why in refusals.values()), f"seed {SEED}: {refusals}"


# ---- what a VCD may hold


VCD = """$date today $end $version x $end
$comment #5 is no time here $end
$timescale
  100 ps
$end
$scope module top $end $scope module dut $end
$var wire 1 $ Int [0] $end
$var wire 1 # Data[0] $end
$var wire 8 bus BUS [7:0] $end
$var real 64 r volts $end
$upscope $end
$var logic 1 clk CLK $end
$var wire 1 ! Int $end
$upscope $end $enddefinitions $end
$dumpvars x$ 0# bxxxxxxxx bus r0 r 0clk z! $end
#0 1$ #25 b10000001 bus r1.25 r #30 0$ 1#
$comment in the middle #99 1clk $end
#40 b1 clk
#50 0clk x# #60 1$ 1$
"""


def test_all_that_a_vcd_may_hold(tmp_path: Path) -> None:
    found = read(tmp_path / "x.vcd", VCD.encode())
    assert not found.notes
    assert found.lines is not None
    edges = {
        n: list(zip(w.t_ns.tolist(), w.level.tolist(), strict=True)) for n, w in found.lines.recording.wires.items()
    }
    assert edges == {"Int": [(0, 1), (3, 0), (6, 1)], "Data": [(0, 0), (3, 1)], "CLK": [(0, 0), (4, 1), (5, 0)]}
    assert (found.lines.start_ns, found.lines.end_ns, found.lines.resolution_ns) == (0, 6, 1.0)


@pytest.mark.parametrize(
    ("odd", "why"),
    [
        ("#70 ?x", r"after #70: expected a time or a level of a declared wire, got '\?x'"),
        ("#70 1nobody", "got '1nobody'"),
        ("#55 0$", "expected a time after the one before it, got '#55'"),
        ("#999999999999999999999 0$", "expected a time or a level"),
        ("#70 $wrong", r"got '\$wrong'"),
    ],
)
def test_a_broken_word_ends_a_vcd(odd: str, why: str, tmp_path: Path) -> None:
    found = read(tmp_path / "x.vcd", (VCD + odd + "\n#80 0$\n").encode())
    assert found.notes
    with pytest.raises(AssertionError, match=why):
        raise AssertionError(found.notes[0])
    assert found.lines is not None
    assert found.lines["Int"].level.tolist() == [1, 0, 1]


def test_a_vcd_is_the_same_in_any_pieces(psa2: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = psa2.vcd.read_bytes()[:3_000_000]
    data = data[: data.rindex(b"\n#")]
    whole = read(tmp_path / "x.vcd", data).lines
    monkeypatch.setattr("psabench.link.vcd.BLOCK", 4099)
    parts = read(tmp_path / "x.vcd", data).lines
    assert whole is not None
    assert parts is not None
    ours = read_vcd(tmp_path / "x.vcd").wires
    for name, wire in ours.items():
        for other in (whole[name], parts[name]):
            assert np.array_equal(wire.t_ns, other.t_ns)
            assert np.array_equal(wire.level, other.level)


def test_samples_are_the_same_from_a_capture_and_a_session(files: Mapping[str, bytes], tmp_path: Path) -> None:
    capture = files[".bin"]
    a, b = read(tmp_path / "x.bin", capture).lines, read(tmp_path / "x.sr", session(capture)).lines
    assert a is not None
    assert b is not None
    for name in ("Int", "Data", "CLK"):
        assert len(a[name].t_ns) > 10
        assert np.array_equal(a[name].t_ns, b[name].t_ns)


def test_holes_of_a_capture_are_kept(tmp_path: Path) -> None:
    found = read(tmp_path / "x.bin", bytes([1, 1, 0, 0x80, 4, 5, 5]), line_hz=1e6).lines
    assert found is not None
    assert found.gaps_ns.tolist() == [3000]
    assert (found.falls("Int").tolist(), found.rises("CLK").tolist()) == ([2000], [4000])


# ---- bad input


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["run.txt"], "expected an ending of .asc .blf"),
        (["none.log"], "no such file"),
        (["a.log", "b.log"], "b.log: expected one log of the CAN bus, got a second"),
        (["a.log", "--line", "Int=D0"], "--line: expected a recording of lines"),
        (["a.vcd", "--line", "Nix=Int"], "--line Nix=Int: expected SYNC_A"),
        (["a.vcd", "--line", "Int=D9"], "--line Int=D9: expected Int Data CLK, got D9"),
        (["a.log", "--node", "9"], "CAN log: expected frames of node 9 (--node), got frames of 5"),
        (["a.log", "--max-seconds", "0"], "--max-seconds: expected more than 0, got 0"),
        (["a.log", "--only", "XYZ"], "--only: expected ids or prefixes of psa2"),
        (["a.log", "--input", "x=much"], "--input x: expected a number, got 'much'"),
    ],
)
def test_bad_input_is_named(
    words: list[str], why: str, files: Mapping[str, bytes], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    for name in ("a.log", "b.log", "run.txt"):
        Path(name).write_bytes(files[".log"])
    Path("a.vcd").write_bytes(files[".vcd"])
    assert main(["conform", "recording", *words, "--board", "psa2"]) == 2
    assert why in capsys.readouterr().err


def test_a_wire_of_one_level_is_a_line(tmp_path: Path) -> None:
    still = {n: Wire(np.array([0], np.int64), np.array([1], np.uint8)) for n in ("Int", "Data", "CLK")}
    path = make.write_vcd(tmp_path / "still.vcd", still, 10**9)
    said = judge(tmp_path, path)
    assert (said.status, said.passed) == (make.NO_VIOLATION, set())
