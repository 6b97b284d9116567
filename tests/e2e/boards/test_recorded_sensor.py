"""A sensor that a file drives: the codes on the bus are those of the exact cascade for all its samples."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from psabench import Bench
from psabench.boards.psa2 import converter_filter as reference
from rig import one_line, psa_emu

pytestmark = pytest.mark.host

G_MPS2 = 9.8094
FULL_SCALE_V, FULL_SCALE = 1.25, 2**23  # of the article's board: +-1.25 V at the converter, 24-bit codes
BLOCK_NS = 31_250  # of the sinc at 1000 SPS, between two looks at the input
TOLERANCE = 1.0  # the board cuts a word to 24 bits
LATEST_NS = 1_000_000  # from the sample to the frame on the bus

SCENARIO = """\
seed: 1
start: true
bus: {bitrate_hz: 0, data_bitrate_hz: 0}
site: {g_mps2: 9.8094}
units:
  - name: a
    board: psa2
    profile: article
    adc_noise_scale: 0
    axes:
      x: {sensor: recorded, signal: {file: s.csv, column: x_v, BETWEEN}, afe: DIRECT}
      y: {sensor: mems, kx_v_per_g: 0.1, signal: {file: s.csv, column: y_mps2, BETWEEN}, afe: DIRECT}
""".replace("DIRECT", "{divider_ratio: 1, filter_hz: 0, clip_v: 100}")

Floats = NDArray[np.float64]


def write(folder: Path, rows: Sequence[tuple[str, float, float]], between: str = "between: hold") -> Path:
    """The scenario and its file of (t_s, x_v, y_mps2)."""
    text = "".join(f"{t},{x!r},{y!r}\n" for t, x, y in rows)
    (folder / "s.csv").write_text("t_s,x_v,y_mps2\n" + text)
    path = folder / "s.yaml"
    path.write_text(SCENARIO.replace("BETWEEN", between))
    return path


def codes(scenario: Path, for_s: float, *more: str | Path) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Stamps of the pairs' first frames, ns, and their codes X and Y, shape (n, 2)."""
    log = scenario.parent / "bus.log"
    done = psa_emu(scenario, "--pace", "free", "--for", f"{for_s}s", "--can", f"log:{log}", "--quiet", *more)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in log.read_text().splitlines() if " 185#" in line]
    stamps = [int(r[0][1:-1].replace(".", "")) * 1000 for r in rows]
    words = [bytes.fromhex(r[2].partition("#")[2]) for r in rows]
    pairs = [[int.from_bytes(w[k : k + 3], "little", signed=True) for k in (0, 3)] for w in words]
    return np.array(stamps), np.array(pairs)


def cascade(t_ns: NDArray[np.int64], latency_ns: int, times_ns: NDArray[np.int64], v: Floats, linear: bool) -> Floats:
    """Codes of frames at t_ns, whose newest block was looked at latency_ns before: the exact weights, newest first."""
    h = np.array([float(w) for w in reference.weights(32, "minimum")])
    at_ns = t_ns[:, None] - latency_ns - np.arange(len(h))[None, :] * BLOCK_NS
    if linear:
        felt = np.interp(at_ns, times_ns, v)
    else:
        felt = v[np.maximum(np.searchsorted(times_ns, at_ns, side="right") - 1, 0)]
    return np.asarray(felt @ h / FULL_SCALE_V * FULL_SCALE)


def judge(scenario: Path, for_s: float, times_ns: NDArray[np.int64], volts: Floats, linear: bool = False) -> int:
    """All settled codes of X and Y are the cascade's within one for one latency, which is returned, ns."""
    t_ns, found = codes(scenario, for_s)
    settled = slice(200, None)
    t_ns, found = t_ns[settled], found[settled]
    few = slice(0, None, 9)
    tries = range(0, LATEST_NS, BLOCK_NS // 4)
    off = [np.abs(cascade(t_ns[few], d, times_ns, volts, linear) - found[few, 0]).max() for d in tries]
    good = [d for d, error in zip(tries, off, strict=True) if error <= TOLERANCE]
    assert good, f"no latency gives these codes; the best is off by {min(off)}"
    assert good[-1] - good[0] <= BLOCK_NS  # one block is the newest, and no other
    best = good[len(good) // 2]
    for channel in (0, 1):
        error = cascade(t_ns, best, times_ns, volts, linear) - found[:, channel]
        assert np.abs(error).max() <= TOLERANCE, (channel, best, float(np.abs(error).max()))
    return best


def test_every_sample_of_a_file_arrives_at_its_instant(tmp_path: Path) -> None:
    """Random samples a millisecond apart, as volts and as m/s^2: one left out, late or early shows in the codes."""
    rng = np.random.default_rng(21)
    volts = np.round(rng.uniform(-0.8, 0.8, 700), 6)
    f_mps2 = [float(-v / 0.1 * G_MPS2) for v in volts]
    rows = [(f"{i / 1000:.3f}", float(v), f) for i, (v, f) in enumerate(zip(volts, f_mps2, strict=True))]
    times_ns = np.arange(700) * 1_000_000
    judge(write(tmp_path, rows), 0.7, times_ns, volts)
    started = write(tmp_path, rows, "between: hold, start_s: 0.0123")
    judge(started, 0.7, times_ns + 12_300_000, volts)
    twice = np.concatenate([volts, volts])
    judge(write(tmp_path, rows, "between: hold, at_end: repeat"), 1.3, np.arange(1400) * 1_000_000, twice)


def test_the_end_of_a_file(tmp_path: Path) -> None:
    rows = [("0", 0.5, -0.5 / 0.1 * G_MPS2), ("0.5", 0.5, -0.5 / 0.1 * G_MPS2)]
    _, held = codes(write(tmp_path, rows, "at_end: hold"), 0.8)
    _, stopped = codes(write(tmp_path, rows, "at_end: stop"), 0.8)
    dc = 0.5 / FULL_SCALE_V * FULL_SCALE * float(np.sum(reference.weights(32, "minimum")))
    assert np.abs(held[-5:] - dc).max() <= 1
    assert np.abs(stopped[-5:]).max() <= 1


def test_a_foreign_data_set_drives_a_unit(tmp_path: Path) -> None:
    """Eleven seconds of PSINS' calibration, a turn of 90 degrees among them: velocity increments of 10 ms as m/s^2."""
    folder = os.environ.get("PSABENCH_RECORDINGS")
    if not folder:
        pytest.skip("no recordings: PSABENCH_RECORDINGS is not set")
    rows = np.fromfile(Path(folder) / "sins" / "imusysclbt.bin", "<f4").reshape(-1, 7)[6950:8050].astype(np.float64)
    f_mps2 = rows[:, 5] / 0.01
    assert np.ptp(f_mps2) > 5.0 or np.ptp(rows[:, 3]) > 0.05  # there is a turn
    volts = -f_mps2 / G_MPS2 * 0.1
    times_ns = np.arange(len(rows)) * 10_000_000
    lines = [(f"{i / 100:.2f}", float(v), float(f)) for i, (v, f) in enumerate(zip(volts, f_mps2, strict=True))]
    judge(write(tmp_path, lines, "between: linear"), 11.0, times_ns, volts, linear=True)


def test_a_snapshot_goes_on_and_refuses_a_changed_file(tmp_path: Path) -> None:
    rows = [(f"{i / 100:.2f}", (i * 37 % 100) / 100, float(i % 10)) for i in range(100)]
    scenario, saved = write(tmp_path, rows), tmp_path / "half.snapshot"
    with Bench.start(scenario) as bench:
        bench.wait(0.4)
        bench.snapshot(saved)
        bench.wait(0.3)
        want = bench.truth()["units"]
    with Bench.restore(saved) as bench:
        bench.wait(0.3)
        assert bench.truth()["units"] == want
    text = (tmp_path / "s.csv").read_bytes()
    (tmp_path / "s.csv").write_bytes(text.replace(b"0.5,", b"0.6,", 1))
    done = psa_emu("--restore", saved, "--pace", "free", "--for", "1ms")
    assert done.returncode == 2
    assert "expected the SHA-256 " + hashlib.sha256(text).hexdigest() in one_line(done.stderr, "psa-emu")


BAD = {
    "no file": (None, "s.csv: expected a recorded signal in CSV, got no such file"),
    "a cut line": ("t_s,x_v,y_mps2\n0,1,2\n0.1,1", "s.csv:3: expected a line feed at the end, got none"),
    "no sample": ("t_s,x_v,y_mps2\n", "s.csv:2: expected samples, got none"),
    "time goes back": (
        "t_s,x_v,y_mps2\n1,1,1\n0.5,1,1\n",
        's.csv:3: expected a time after that of the sample before, got "0.5"',
    ),
    "no number": ("t_s,x_v,y_mps2\n1,one,1\n", 's.csv:2: expected a number of magnitude up to 1e6, got "one"'),
    "another column": ("t_s,y_mps2\n1,1\n", "s.csv:1: expected a column x_v, got none"),
    "a long line": ("t_s,x_v,y_mps2\n" + "1" * 100_000, "s.csv:2: expected lines of up to 4096 bytes, got more"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    text, reason = BAD[name]
    scenario = write(tmp_path, [("0", 0.0, 0.0)])
    (tmp_path / "s.csv").unlink()
    if text is not None:
        (tmp_path / "s.csv").write_text(text)
    done = psa_emu(scenario, "--pace", "free", "--for", "1ms")
    assert done.returncode == 2
    line = one_line(done.stderr, "psa-emu")
    assert "units.a.axes.x.signal: " in line
    assert line.endswith(reason)


def test_a_device_is_no_recording(tmp_path: Path) -> None:
    scenario = write(tmp_path, [("0", 0.0, 0.0)])
    scenario.write_text(scenario.read_text().replace("file: s.csv", "file: /dev/zero"))
    done = psa_emu(scenario, "--pace", "free", "--for", "1ms")
    assert done.returncode == 2
    assert "expected a file, got another kind of file" in one_line(done.stderr, "psa-emu")


@pytest.mark.parametrize(
    ("channel", "reason"),
    [
        ("{sensor: recorded}", "expected a signal for a recorded sensor, got none"),
        ("{signal: {file: s.csv, column: x_v}}", "expected a sensor that takes it, got none"),
        ("{sensor: mems, signal: {file: s.csv, column: x_v}}", 'expected a column that ends in _mps2, got "x_v"'),
        (
            "{sensor: recorded, signal: {file: s.csv, column: x_mps2}}",
            'expected a column that ends in _v, got "x_mps2"',
        ),
        ("{sensor: recorded, signal: {column: x_v}}", "expected a file, got none"),
    ],
)
def test_a_signal_that_does_not_fit_its_sensor(channel: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(f"units: [{{name: a, board: psa2, axes: {{x: {channel}}}}}]\n")
    done = psa_emu(path, "--dump")
    assert done.returncode == 2
    assert one_line(done.stderr, "psa-emu").endswith(reason)
