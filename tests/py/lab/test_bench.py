"""The programs of `make bench`, on a small scale: they do the same work, whoever watches. No time is asserted here."""

from __future__ import annotations

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from psabench.places import find_emulator

from tests.bench import cases, page, peers
from tests.bench.targets import WHY_LINES, Result

DIRECT = ("frames-direct", "frames-watched-direct", "frames-vcd")  # which has no decimation chain
ROOT = Path(__file__).resolve().parents[3]
FRAMES = 40
PEERS = {*peers.NAMES, peers.PSD1}
REQUIRED = {"vcd", "frames-vcd", *page.UNWATCHED, *page.ENGINES, *page.PSD1_ENGINES} - PEERS


def driver(name: str) -> Path:
    exe = find_emulator().resolve().parent / "bench" / name
    if not exe.exists():
        pytest.skip(f"{exe} is not built: `make bench-bin` builds it")
    return exe


def printed(exe: Path, case: str, count: int) -> dict[str, str]:
    return dict(word.split("=") for word in peers.run([exe, case, str(count)]).split()[1:])


@pytest.mark.parametrize("cases_of_one_chain", [("frames", "frames-watched"), DIRECT])
def test_a_watched_board_sends_what_an_unwatched_one_sends(cases_of_one_chain: tuple[str, ...]) -> None:
    core = driver("bench_core")
    unwatched, *watched = (printed(core, case, FRAMES) for case in cases_of_one_chain)
    assert int(unwatched["edges"]) == 0
    for run in watched:
        assert run["hash"] == unwatched["hash"]
        assert int(run["edges"]) == int(watched[0]["edges"]) > FRAMES * (48 + 256 + 4)  # SClk, CLK, DRD_A, Int
    assert printed(core, cases_of_one_chain[0], FRAMES + 1)["hash"] != unwatched["hash"]


@pytest.mark.parametrize("case", ["kf-joseph", "kf-ud", "kf-dense"])
def test_filters_that_are_timed_end_with_the_same_covariance(case: str) -> None:
    """The program compares, to 1e-9, and fails."""
    assert printed(driver("bench_kf"), case, 10)["steps"] == "10"


def test_a_watched_psd_1_reads_what_an_unwatched_one_reads() -> None:
    core = driver("bench_core")
    unwatched, cycle, watched = (printed(core, f"psd1-{case}", FRAMES) for case in ("unwatched", "cycle", "watched"))
    assert unwatched["hash"] == cycle["hash"] == watched["hash"]
    assert int(unwatched["edges"]) == 0
    assert int(cycle["edges"]) > FRAMES * (96 + 6 + 6 + 6)  # SCLK, RFX, RFY, RFZ, FL2, CS
    assert int(watched["edges"]) >= int(cycle["edges"]) + (FRAMES - 1) * 2432  # of 1M25


def test_the_words_for_the_model_of_psd_1_are_those_on_its_bus(tmp_path: Path) -> None:
    words = tmp_path / "words.hex"
    board = peers.facts(peers.run([driver("bench_psd1_words"), words, str(FRAMES)]))
    rows = [[int(w, 16) for w in line.split()] for line in words.read_text().splitlines()]
    assert len(rows) == FRAMES
    checksum = 0
    for word in (w for row in rows for w in row):
        checksum = (checksum * 31 + word) & 0xFFFFFFFF
    assert board["checksum"] == f"{checksum:08x}"
    edges = [int(board[f"edges of line {i}"]) for i in range(peers.PSD1_LINES)]
    per_cycle = {0: 2, 3: 6, 4: 2, 5: 2, 6: 2, 7: 2, 8: 0, 9: 96, 11: 2432, 12: 6}  # A0 FL2 DR RFX.. TFS SCLK 1M25 CS
    assert {i: edges[i] for i in per_cycle} == {i: n * FRAMES for i, n in per_cycle.items()}


def test_every_case_of_the_board_runs() -> None:
    core = driver("bench_core")
    assert cases.has_cases(core) >= REQUIRED
    for case in cases.has_cases(core):
        got = printed(core, case, 100)
        assert int(got["frames"]) == 100
        assert int(got["ns"]) > 0


def test_a_driver_gets_the_same_from_bytes_and_pins() -> None:
    lib = driver("bench_lib")
    assert printed(lib, "spi", 1300)["hash"] == printed(lib, "spi-pins", 1300)["hash"]
    assert int(printed(lib, "readings", 400)["readings"]) == 100


def test_the_words_for_the_models_are_those_that_the_board_sent(tmp_path: Path) -> None:
    words = tmp_path / "words.hex"
    said = peers.facts(peers.run([driver("bench_words"), words, str(FRAMES)]))
    rows = [[int(w, 16) for w in line.split()] for line in words.read_text().splitlines()]
    total = 0
    for x, y, z, t in rows:
        for code in (x >> 8, y >> 8, z >> 8):
            total = (total * 31 + (code | 0xFF000000 * (code >> 23))) % 2**32  # sign-extended to 32 bits
        total = (total * 31 + t) % 2**32
    assert len(rows) == FRAMES
    assert said["checksum"] == f"{total:08x}"
    edges = [int(said[f"edges of line {i}"]) for i in range(9)]
    assert [edges[i] for i in (0, 1, 2, 7, 8)] == [n * FRAMES for n in (48, 2, 0, 256, 2)]  # SClk DRD_A DIn CLK Int
    sent = [
        sum((w >> (i + 1) ^ w >> i) & 1 for row in rows for i in range(7, 31) for w in row[axis : axis + 1])
        for axis in range(3)
    ]  # changes inside the 25 bits that DOut shows of a word
    for axis, inside in enumerate(sent):
        assert inside <= edges[3 + axis] <= inside + FRAMES


@pytest.mark.parametrize(
    ("case", "count", "says"),
    [
        ("decode", 1000, "frames=1000 samples=8000000"),
        ("start", 2, "starts=2"),
        ("can", 2000, "frames="),
        ("chips-spi", 130, "bytes=130"),
    ],
)
def test_what_is_measured_in_python_runs(case: str, count: int, says: str) -> None:
    done = subprocess.run(cases.python(case, count), cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    assert says in done.stdout
    assert cases.parse(done.stdout)["ns"] > 0


BOARD = "frames 512 checksum 0badcafe\n" + "".join(f"line {i} edges {i * 7} when {i}\n" for i in range(9))


def echo(text: str) -> peers.Peer:
    command = (sys.executable, "-c", f"print({text!r})")
    return peers.Peer("echo", command, command, "")


def test_a_model_that_does_something_else_is_no_peer() -> None:
    peers.prove({"echo": echo(BOARD)}, BOARD)
    for wrong in (
        BOARD.replace("0badcafe", "0badcaff"),
        BOARD.replace("edges 21", "edges 22"),
        BOARD.replace("when 3", "when 4"),
        "",
    ):
        with pytest.raises(RuntimeError, match="echo does not do what the board does"):
            peers.prove({"echo": echo(wrong)}, BOARD)
    with pytest.raises(RuntimeError, match="echo"):
        peers.prove({"echo": echo("")}, "")  # a board that says nothing proves nothing


@pytest.mark.parametrize(
    ("text", "want"),
    [
        ("vcd frames=100 edges=40534 ns=239 hash=0123456789abcdef", {"frames": 100, "edges": 40534, "ns": 239}),
        ("frames 7 checksum 80f30bce edges 99 ns 12", {"frames": 7, "edges": 99, "ns": 12}),
        ("frames 7 checksum 80300211 edges 99 ns 12", {"frames": 7, "checksum": 80300211, "edges": 99, "ns": 12}),
    ],
)
def test_what_the_drivers_print_is_read(text: str, want: dict[str, int]) -> None:
    assert cases.parse(text + "\n") == want


@pytest.mark.parametrize(
    ("x", "want"),
    [
        (None, ""),
        (0, "0"),
        (0.0123, "0.0123"),
        (5.996, "6.00"),
        (12.34, "12.3"),
        (1234567, "1,230,000"),
        (999.6, "1,000"),
    ],
)
def test_figures_have_three_digits(x: float | None, want: str) -> None:
    assert page.figure(x) == want


def result(**rows: dict[str, object]) -> Result:
    """As bench makes it, with only these rows besides the peer."""
    peer = {"unit": "frames", "per_s": 1e5, "times_peer": 1.0, "ms": 1.0, "edges_per_unit": 395.0}
    words = "arch cc cflags cxx peer_cflags verilator icarus valgrind python numpy".split()
    return {"machine": {"cores": 2} | {w: w for w in words}, "rounds": 5, "cases": {"verilator": peer} | rows}


def test_a_target_is_reached_or_missed_or_not_measured() -> None:
    watched: dict[str, object] = {
        "unit": "frames",
        "per_s": 8e5,
        "times_peer": 8.0,
        "ms": 1.0,
        "instructions_per_edge": 51.0,
    }
    rows = page.targets(result(**{"frames-watched-direct": watched})).splitlines()[2:]
    assert rows[0].endswith("| ≥ 6.00 | 8.00 | reached |")
    assert rows[1].endswith("| ≤ 34.0 | 51.0 | missed by 50% (a) |")
    assert rows[-1] == f"(a) {WHY_LINES[0].upper()}{WHY_LINES[1:]}."
    assert rows[3].endswith("| ≥ 700 | 800 | reached |")
    assert rows[6].endswith("| ≥ 5,000 |  | not measured |")
    assert page.targets(result(start={"unit": "starts", "ms": 51.0})).splitlines()[-1].endswith("missed by 2% |")


def test_the_page_is_filled_between_its_markers_and_nowhere_else() -> None:
    text = (ROOT / "docs/reference/performance.md").read_text(encoding="utf-8")
    r = json.loads(json.dumps(result(frames={"unit": "frames", "per_s": 2.5e6, "times_peer": 25.0, "ms": 1.0})))
    once = page.fill(text, r)
    assert page.fill(once, r) == once
    assert "2,500,000" in once
    assert page.fill(once, result()) == page.fill(text, result())
    with pytest.raises(ValueError, match="bench:engines"):
        page.fill(text.replace("<!-- bench:engines -->", ""), r)


def test_the_picture_has_a_bar_for_each_engine() -> None:
    r = result(frames={"unit": "frames", "per_s": 2.5e6, "times_peer": 25.0, "ms": 1.0})
    svg = ET.fromstring(page.picture(r))
    bars = [float(e.get("width", "0")) for e in svg if e.get("class") in ("peer", "ours")]
    assert bars == [pytest.approx(page.BAR_W * decades / 4, abs=0.1) for decades in (2, 3.39794)]
