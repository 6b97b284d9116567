"""`psabench conform recording` on recordings of good boards, of broken ones, and of recorders whose clocks are off."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import made_recordings as make
import numpy as np
import pytest
from made_recordings import Judged, Made, judge
from psabench.boards.psa2.conform.capture_line import Transfers, transfers
from psabench.cli import main
from psabench.conform.capture.log import LineLog
from psabench.link.vcd import Vcd, Wire, read_vcd

BOARDS = {
    "psa2": {"PSA2-SETUP-02", "PSA2-FRAME-03", "PSA2-CAN-04", "PSA2-READ-04", "PSA2-TEMP-05"},
    "psa1": {"PSA1-SETUP-01", "PSA2-FRAME-03", "PSA2-CAN-04"},
    "psd1": {"PSD1-CYC-12"},
    "pmka": {"BUS-ID-05"},
    "pik": {"BUS-ID-05"},
    "gyro": {"GYRO-RES-01"},
}
LINE_ROWS = {"PSA2-FRAME-01", "PSA2-FRAME-02", "PSA2-FRAME-10", "PSA2-FRAME-11", "PSA2-INT-04", "PSA2-INT-03"}
WITH_SIGROK = pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")


@pytest.fixture(scope="module")
def psa2(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return make.record(tmp_path_factory.mktemp("psa2"), "psa2")


def transfers_of(wires: dict[str, Wire], end_ns: int) -> Transfers:
    return transfers(LineLog(recording=Vcd(1, 0, end_ns, wires)))


# ---- good boards


@pytest.mark.parametrize("board", BOARDS)
def test_a_recording_of_a_good_board_conforms(board: str, tmp_path: Path) -> None:
    made = make.record(tmp_path, board)
    said = judge(tmp_path, made.log, made.vcd, board=board)
    assert said.clean, said.failed
    assert said.passed >= BOARDS[board]
    assert any("SHA-256" in fact for fact in said.report["facts"].values())


@pytest.mark.parametrize(("board", "whose"), [("psa2", 2), ("psd1", 2), ("pmka", 2), ("gyro", 2), ("pik", 0)])
def test_clocks_are_found_by_the_board_s_beat(board: str, whose: int, tmp_path: Path) -> None:
    """Of the lines and of the log; a PIK has no fixed period."""
    made = make.record(tmp_path, board, dwell="700ms")
    said = judge(tmp_path, made.log, made.vcd, board=board)
    found = [fact for name, fact in said.report["facts"].items() if name.endswith("against the board's period")]
    assert len(found) == whose
    assert all(abs(float(fact.split()[0])) < 20.0 for fact in found)  # a frame may wait for another


@pytest.mark.parametrize("profile", ["w24", "w16", "intent", "ungated"])
def test_so_does_every_profile_of_a_psa2(profile: str, tmp_path: Path) -> None:
    made = make.record(tmp_path, "psa2", profile)
    said = judge(tmp_path, made.log, made.vcd, "--profile", profile)
    assert said.clean, (said.failed, [said.told(i) for i in said.failed])
    assert "PSA2-FRAME-03" in said.passed


MOVING = [
    {"kind": kind, "point": f"a.sensor.{axis}", **value}
    for kind, value in (("sensor.noise", {"rms_v": 0.05}), ("sensor.drift", {"drift_v_per_s": 0.3}))
    for axis in "xyz"
]


@pytest.mark.parametrize("board", ["psa2", "psa1", "psd1", "pmka", "pik", "pik6"])
def test_so_does_one_whose_inputs_move(board: str, tmp_path: Path) -> None:
    """A bench that no one has put to rest: what wants still inputs is not observable."""
    made = make.record(tmp_path, board, dwell="1500ms", faults=MOVING)
    said = judge(tmp_path, made.log, board=board)
    assert said.clean, [said.told(i) for i in said.failed]
    assert not {i for i in said.report["requirements"] if i.startswith("HOST-")}


@pytest.mark.parametrize(
    ("board", "requirement"), [("psa2", "PSA2-CHIP-07"), ("psa1", "PSA1-CHIP-01"), ("pik6", "PIK-RES-01")]
)
def test_inputs_that_are_said_to_stand_still_are_held_to_it(board: str, requirement: str, tmp_path: Path) -> None:
    made = make.record(tmp_path, board, dwell="1500ms", faults=MOVING)
    said = judge(tmp_path, made.log, *(f"--input={a}={v}" for a, v in make.INPUTS_V.items()), board=board)
    assert requirement in said.failed


@pytest.mark.parametrize("ending", [".blf", ".asc", ".trc", ".csv"])
def test_every_format_of_a_log_is_judged_alike(ending: str, psa2: Made, tmp_path: Path) -> None:
    said = judge(tmp_path, make.converted(psa2.log, ending))
    assert (said.clean, said.passed) == (True, judge(tmp_path, psa2.log).passed)
    assert "PSA2-TEMP-05" in said.passed


def test_stamps_of_a_calendar_are_as_good(psa2: Made, tmp_path: Path) -> None:
    said = judge(tmp_path, make.stamped(psa2.log, "calendar", 1.0, 1.7e9))
    assert said.clean
    assert "PSA2-TEMP-05" in said.passed


@WITH_SIGROK
@pytest.mark.parametrize(("downsample", "some"), [(41, {"PSA2-SIG-06", "PSA2-TEMP-06", "PSA2-SETUP-06"}), (100, set())])
def test_a_session_of_sigrok_conforms(downsample: int, some: set[str], psa2: Made, tmp_path: Path) -> None:
    session = tmp_path / "lines.sr"
    command = ["sigrok-cli", "-i", str(psa2.vcd), "-I", f"vcd:downsample={downsample}", "-o", str(session)]
    subprocess.run(command, check=True, timeout=200)
    said = judge(tmp_path, session, psa2.log)
    assert said.clean, [said.told(i) for i in said.failed]
    assert said.passed >= LINE_ROWS | some
    if not some:
        assert "edges are known to 100 ns" in said.told("PSA2-SETUP-02")


@WITH_SIGROK
def test_sigrok_s_vcd_knows_its_samples(psa2: Made, tmp_path: Path) -> None:
    path = tmp_path / "sampled.vcd"
    three = make.write_vcd(tmp_path / "three.vcd", make.port_lines(psa2), make.span_ns(psa2))
    command = ["sigrok-cli", "-i", str(three), "-I", "vcd:downsample=100", "-O", "vcd"]
    path.write_bytes(subprocess.run(command, check=True, timeout=200, capture_output=True).stdout)
    said = judge(tmp_path, path)
    assert (said.clean, said.passed >= LINE_ROWS) == (True, True)
    assert any("edges known to 100 ns" in fact for fact in said.report["facts"].values())


@pytest.mark.parametrize(("unit", "per_ns"), [("1 ns", 1), ("1 ps", 1000), ("100 fs", 10_000)])
def test_any_unit_and_any_capitals(unit: str, per_ns: int, psa2: Made, tmp_path: Path) -> None:
    wires = {n.upper(): w for n, w in make.port_lines(psa2).items()}
    path = make.write_vcd(tmp_path / "lines.vcd", wires, make.span_ns(psa2), unit, per_ns)
    said = judge(tmp_path, path, psa2.log)
    assert said.clean
    assert said.passed >= LINE_ROWS | {"PSA2-WORD-01"}


def test_channels_of_an_analyser_are_told(psa2: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    named = dict(zip(("D2", "D0", "D1"), make.port_lines(psa2).values(), strict=True))
    path = make.write_vcd(tmp_path / "lines.vcd", named, make.span_ns(psa2))
    told = ["--line", "INT=D2", "--line", "Data=D0", "--line", "clk=D1"]
    assert judge(tmp_path, path, *told).passed >= LINE_ROWS
    assert main(["conform", "recording", str(path), "--board", "psa2"]) == 2
    assert "expected channels named as lines, or --line LINE=CHANNEL, got D2, D0, D1" in capsys.readouterr().err


def test_a_capture_of_the_line_port_conforms(psa2: Made, tmp_path: Path) -> None:
    path = tmp_path / "capture.bin"
    path.write_bytes(make.samples(make.port_lines(psa2), make.span_ns(psa2), 8e6))
    said = judge(tmp_path, path, psa2.log)
    assert said.clean, [said.told(i) for i in said.failed]
    assert said.passed >= LINE_ROWS | {"PSA2-WORD-01"}


# ---- what is not there is not passed


def test_a_log_alone_passes_nothing_of_the_lines(psa2: Made, tmp_path: Path) -> None:
    said = judge(tmp_path, psa2.log)
    assert {"PSA2-FRAME-03", "PSA2-SETUP-02", "PSA2-INT-04"} <= said.of("not observable")
    assert "no lines were recorded" in said.told("PSA2-FRAME-03")


def test_without_a_reset_the_set_up_is_not_observable(psa2: Made, tmp_path: Path) -> None:
    wires = read_vcd(psa2.vcd)
    cut = {n: Wire(np.maximum(w.t_ns[k:], 250_000_000), w.level[k:]) for n, w, k in _from(wires, 250_000_000)}
    path = make.write_vcd(tmp_path / "later.vcd", cut, wires.end_ns)
    log = make.changed_log(psa2.log, "later", lambda lines: [x for x in lines if float(x[1:18]) > 0.25])
    said = judge(tmp_path, log, path)
    assert said.clean, [said.told(i) for i in said.failed]
    assert {f"PSA2-SETUP-{k:02}" for k in (1, 2, 9)} | {"PSA2-RES-05"} <= said.of("not observable")
    assert "no pulse on Res" in said.told("PSA2-SETUP-02")


def _from(v: Vcd, t_ns: int) -> list[tuple[str, Wire, int]]:
    return [(n, w, max(0, int(np.searchsorted(w.t_ns, t_ns, "right")) - 1)) for n, w in v.wires.items()]


def test_lines_that_nobody_recorded_are_named(psa2: Made, tmp_path: Path) -> None:
    path = make.write_vcd(tmp_path / "three.vcd", make.port_lines(psa2), make.span_ns(psa2))
    said = judge(tmp_path, path)
    assert said.clean
    assert "the recording has no line" in said.told("PSA2-SIG-01")
    assert "PSA2-SIG-01" in said.of("not observable")


@pytest.mark.parametrize("frames", [0, 4])
def test_a_board_that_nobody_started_is_not_broken(frames: int, psa2: Made, tmp_path: Path) -> None:
    def few(lines: list[str]) -> list[str]:
        samples = [x for x in lines if " 185#" in x or " 285#" in x]
        return [x for x in lines if x not in samples[frames:]]

    said = judge(tmp_path, make.changed_log(psa2.log, "few", few))
    assert said.clean, said.failed
    assert "PSA2-CAN-01" in said.of("not observable")


# ---- broken boards


def drop(lines: list[str]) -> list[str]:
    pairs = [k for k, x in enumerate(lines) if " 185#" in x]
    return [x for k, x in enumerate(lines) if k not in (pairs[40], pairs[40] + 1)]


def drop_half(lines: list[str]) -> list[str]:
    halves = [k for k, x in enumerate(lines) if " 285#" in x]
    return [x for k, x in enumerate(lines) if k != halves[40]]


def shorten(lines: list[str]) -> list[str]:
    return [x[:-2] if k == len(lines) - 41 else x for k, x in enumerate(lines)]


def swap_codes(lines: list[str]) -> list[str]:
    """X and Y of every sample."""
    cut = [x.partition(" 185#") for x in lines]
    return [f"{a}{b}{c[6:12]}{c[:6]}{c[12:]}" if b else a for a, b, c in cut]


def seq_stands_still(lines: list[str]) -> list[str]:
    return [f"{x[:-4]}0000" if " 185#" in x else x for x in lines]


@pytest.mark.parametrize(
    ("change", "requirement"),
    [
        (drop, "PSA2-CAN-04"),
        (drop_half, "PSA2-CAN-01"),
        (shorten, "PSA2-CAN-02"),
        (seq_stands_still, "PSA2-CAN-04"),
        (swap_codes, "PSA2-FRAME-04"),
    ],
)
def test_a_log_of_a_broken_board_fails(
    change: Callable[[list[str]], list[str]], requirement: str, psa2: Made, tmp_path: Path
) -> None:
    said = judge(tmp_path, make.changed_log(psa2.log, change.__name__, change), psa2.vcd)
    assert said.status == 1
    assert requirement in said.failed, said.failed


def reversed_words(bits: np.ndarray) -> np.ndarray:
    return bits.reshape(-1, 4, 32)[:, :, ::-1]


def swapped_words(bits: np.ndarray) -> np.ndarray:
    return bits.reshape(-1, 4, 32)[:, [1, 0, 2, 3], :]


@pytest.mark.parametrize(
    ("change", "requirement"), [(reversed_words, "PSA2-FRAME-03"), (swapped_words, "PSA2-FRAME-04")]
)
def test_words_the_wrong_way_round_fail(
    change: Callable[[np.ndarray], np.ndarray], requirement: str, psa2: Made, tmp_path: Path
) -> None:
    wires, end_ns = make.port_lines(psa2), make.span_ns(psa2)
    t = transfers_of(wires, end_ns)
    bits = t.bits(32).astype(np.int64)
    same = make.write_vcd(tmp_path / "same.vcd", make.with_bits(wires, t, bits), end_ns)
    assert judge(tmp_path, same, psa2.log).clean  # the script itself breaks nothing
    other = make.write_vcd(tmp_path / "other.vcd", make.with_bits(wires, t, change(bits)), end_ns)
    said = judge(tmp_path, other, psa2.log)
    assert said.status == 1
    assert requirement in said.failed, said.failed


@pytest.mark.parametrize(
    ("line", "requirement"), [("CLK", "PSA2-FRAME-06"), ("Int", "PSA2-FRAME-09"), ("Int", "PSA2-READ-06")]
)
def test_a_missing_pulse_fails(line: str, requirement: str, psa2: Made, tmp_path: Path) -> None:
    wires, end_ns = make.port_lines(psa2), make.span_ns(psa2)
    first = 2 * 128 * 30 + 41 if line == "CLK" else 2 * 30 + 1
    path = make.write_vcd(tmp_path / "lines.vcd", make.without_edges(wires, line, first), end_ns)
    said = judge(tmp_path, path, psa2.log)
    assert said.status == 1
    assert requirement in said.failed, (said.failed, said.told(requirement))
    shown = {name for t in said.report["tests"] for name in t["exhibits"]}
    assert shown
    assert all((tmp_path / "out" / name).stat().st_size for name in shown)


# ---- clocks


def clock(said: Judged, whose: str) -> float:
    fact = next(
        f for name, f in said.report["facts"].items() if name.startswith(f"clock of the {whose} against the board's p")
    )
    return float(fact.split()[0])


@pytest.mark.parametrize("ppm", [-80.0, 80.0])
def test_clocks_within_the_limit_pass_and_are_told(ppm: float, psa2: Made, tmp_path: Path) -> None:
    factor = 1.0 + ppm * 1e-6
    end_ns = round(make.span_ns(psa2) * factor)
    path = make.write_vcd(tmp_path / "lines.vcd", make.scaled(make.port_lines(psa2), factor), end_ns)
    said = judge(tmp_path, path, make.stamped(psa2.log, "fast", factor))
    assert said.clean, [said.told(i) for i in said.failed]
    assert (clock(said, "lines"), clock(said, "CAN log")) == pytest.approx((ppm, ppm), abs=4.0)
    assert said.passed >= LINE_ROWS


@pytest.mark.parametrize("ppm", [-500.0, 500.0])
def test_a_lone_recorder_far_off_fails_the_frequencies_alone(ppm: float, psa2: Made, tmp_path: Path) -> None:
    factor = 1.0 + ppm * 1e-6
    end_ns = round(make.span_ns(psa2) * factor)
    path = make.write_vcd(tmp_path / "lines.vcd", make.scaled(make.port_lines(psa2), factor), end_ns)
    said = judge(tmp_path, path)
    assert said.status == 1
    assert clock(said, "lines") == pytest.approx(ppm, abs=1.0)
    assert {"PSA2-FRAME-06", "PSA2-READ-06"} <= said.failed
    assert "no second recorder tells which" in said.told("PSA2-READ-06")
    assert {"PSA2-FRAME-02", "PSA2-FRAME-10", "PSA2-FRAME-11", "PSA2-INT-03"} <= said.passed


@pytest.mark.parametrize("ppm", [-500.0, 500.0])
def test_a_second_recorder_tells_whose_clock_is_off(ppm: float, psa2: Made, tmp_path: Path) -> None:
    factor = 1.0 + ppm * 1e-6
    end_ns = round(make.span_ns(psa2) * factor)
    path = make.write_vcd(tmp_path / "lines.vcd", make.scaled(make.port_lines(psa2), factor), end_ns)
    said = judge(tmp_path, path, psa2.log)
    assert said.clean, [said.told(i) for i in said.failed]
    assert "the clock of the lines' recorder is off" in said.report["facts"]["clocks"]
    words = said.report["facts"]["clock of the CAN log against that of the lines, by the same words"]
    assert float(words.split()[0]) == pytest.approx(-ppm, abs=5.0)
    both = judge(tmp_path, path, make.stamped(psa2.log, "off", factor))
    assert both.status == 1
    assert "the board's clock is off" in both.told("PSA2-READ-06")


@pytest.mark.parametrize(("ppm", "status"), [(-80.0, make.NO_VIOLATION), (80.0, make.NO_VIOLATION), (-400.0, 1)])
def test_a_board_s_own_clock(ppm: float, status: int, tmp_path: Path) -> None:
    made = make.record(tmp_path, "psa2", clock_ppm=ppm)
    said = judge(tmp_path, made.log, made.vcd)
    assert said.status == status, [said.told(i) for i in said.failed]
    assert clock(said, "lines") == pytest.approx(-ppm, abs=1.0)
    if status == 1:
        assert {"PSA2-READ-06", "PSA2-FRAME-06"} <= said.failed
