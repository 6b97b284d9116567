"""`psa-emu --lcm`: logs and multicast, read by LCM's own programs and library, beside the CAN log of the same run."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import can
import lcm
import numpy as np
import pytest
from psabench.boards.devices import reader_of
from psabench.boards.psa2.frames import Frames
from psabench.boards.readings import Readings
from psabench.lcm.event_log import Event, read_events
from psabench.lcm.frames import read_frames
from psabench.link.control import Control
from psabench.places import find_emulator
from rig import HOST, PSABENCH, ROOT, TIMEOUT_S, MakeRig, one_line, psa_emu, until

pytestmark = HOST

NETWORK = ["unshare", "--user", "--map-root-user", "--net", "--mount"]
URL, PORT = "udpm://239.255.76.67:7667?ttl=0", 7667
FREE = ("--pace", "free", "--quiet")

FORMS = """
seed: 1
start: true
bus: {bitrate_hz: 1000000, data_bitrate_hz: 8000000}
site: {g_mps2: 9.8094}
head: {resolution_arcsec: 0}
table: {axes: [{along: z}]}
chamber: {}
supply: {volt_v: 12}
units:
"""
UNIT = "  - {{name: f{form}, node: {node}, serial: {node}, frame_form: {form}, axes: {{x: {{sensor: mems}}}}}}\n"


def recorded(tmp_path: Path, scenario: str | Path, *more: str) -> tuple[list[Event], Path]:
    """The LCM log of a run in free pace, and its path."""
    path = tmp_path / "run.lcmlog"
    done = psa_emu(scenario, "--lcm", f"file://{path}", *FREE, *more)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"ready lcm=file://{path}\n" in done.stdout
    return list(read_events(path)), path


def on(events: Sequence[Event], channel: str) -> list[dict[str, Any]]:
    return [e.values for e in events if e.channel == channel]


def column(values: Sequence[dict[str, Any]], name: str) -> np.ndarray[Any, np.dtype[Any]]:
    return np.array([v[name] for v in values])


# ---- logs


def test_a_log_has_each_frame_of_the_candump_log_of_the_same_run_and_each_sample_once(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    events, path = recorded(tmp_path, "stream", "--for", "2s", "--can", f"log:{log}", "--epoch", "1000")
    with can.LogReader(log) as reader:
        candump = list(reader)
    frames = list(read_frames(path))
    assert len(frames) == len(candump) > 3000
    for ours, theirs in zip(frames, candump, strict=True):
        assert ours.equals(theirs, timestamp_delta=1.1e-6, check_direction=False), (ours, theirs)
    pairs = sum(m.arbitration_id == 0x285 for m in candump)
    counts = Counter(e.channel for e in events)
    assert counts == {"PSABENCH_CAN_can0": len(candump), "PSABENCH_PSA2_a": pairs, "PSABENCH_INSTRUMENTS": 21}
    assert [e.number for e in events] == list(range(len(events)))
    assert all(e.t_us == (e.values["t_ns"] + e.values["epoch_ns"]) // 1000 for e in events)
    assert [(e.eventnum, e.channel) for e in lcm.EventLog(str(path))] == [(e.number, e.channel) for e in events]


def test_the_same_run_writes_the_same_bytes_at_every_pace(tmp_path: Path) -> None:
    options = ("stream", "--can", "none", "--for", "300ms", "--quiet", "--lcm-truth")
    for pace in ("free", "wall"):
        done = psa_emu(*options, "--pace", pace, "--lcm", f"file://{tmp_path / pace}")
        assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "free").read_bytes() == (tmp_path / "wall").read_bytes() != b""


def test_readings_in_each_frame_form_are_those_of_the_host_s_decoder(tmp_path: Path) -> None:
    scenario = tmp_path / "forms.yaml"
    scenario.write_text(FORMS + "".join(UNIT.format(form=k, node=5 + k) for k in range(4)))
    events, path = recorded(tmp_path, scenario, "--for", "1s", "--can", "none")
    for form in range(4):
        reader = reader_of("psa2", 5 + form)
        for m in read_frames(path):
            reader.on_message(m)
        want = reader.take()
        assert isinstance(want, Frames)
        got = on(events, f"PSABENCH_PSA2_f{form}")
        assert len(got) == len(want) > 700
        assert {v["form"] for v in got} == {form}
        assert {v["unit"] for v in got} == {f"f{form}"}
        for k, axis in enumerate("xyz"):
            assert np.array_equal(column(got, f"{axis}_v"), want.u_v[:, k])
            assert np.array_equal(column(got, f"{axis}_code") * 10.0 / 2**23, want.u_v[:, k])
        assert np.any(column(got, "x_code"))
        if form != 1:  # which has none of them
            for name, theirs in (("temp_code", want.temp_code), ("temp_channel", want.temp_channel)):
                assert np.array_equal(column(got, name), theirs)
            assert np.array_equal(column(got, "settled"), want.settled)
            assert np.array_equal(column(got, "clipped"), want.clipped)
        assert np.array_equal(column(got, "sequence"), want.seq if form == 0 else np.full(len(got), -1))
        stamps = column(got, "t_sample_s")
        assert np.all(np.isnan(stamps)) if form == 1 else stamps[0] == pytest.approx(want.t_sample_s[0], abs=1e-9)
        assert not np.any(np.isnan(stamps[:: 5 if form == 3 else 1])) or form == 1
        if form == 3:  # the frame has the instant of its first sample alone
            assert np.all(np.isnan(stamps.reshape(-1, 5)[:, 1:]))
        assert np.array_equal(column(got, "sample"), np.arange(len(got)) % 5 if form == 3 else np.zeros(len(got)))


# What a board's readings have in common with the columns of the host's decoder: field, column, factor.
COLUMNS: dict[str, list[tuple[str, str, float]]] = {
    "psd1": [("x_code", "X", 1), ("y_code", "Y", 1), ("z_code", "Z", 1), ("count", "CNT", 1), ("read_x", "READ_X", 1)],
    "pmka": [("x_v", "X", 1), ("z_v", "Z", 1), ("k_v", "K", 1), ("temp_degc", "T", 1), ("sequence", "SEQ", 1)],
    "pik": [("x_pulses", "X", 1), ("y_pulses", "Y", 1), ("z_pulses", "Z", 1), ("sequence", "SEQ", 1)],
    "gyro": [
        ("u1_radps", "U1", math.pi / 648000),
        ("u2_radps", "U2", math.pi / 648000),
        ("encoder_deg", "ENCODER", 1),
        ("beta_deg", "BETA", 1),
        ("gamma_deg", "GAMMA", 1),
        ("step", "STEP", 1),
        ("mode", "MODE", 1),
    ],
}
UNITS = [("converters", "can1", "pik", "pik", 8), ("converters", "can1", "pmka", "pmka", 11)]
UNITS += [("gyrocompass", "can0", "gyro", "gyro", 9)]


@pytest.mark.parametrize(("scenario", "bus", "board", "name", "node"), UNITS)
def test_readings_of_the_other_boards_are_those_of_the_host_s_decoder(
    scenario: str, bus: str, board: str, name: str, node: int, tmp_path: Path
) -> None:
    events, path = recorded(tmp_path, scenario, "--start", "--for", "2s", "--can", "none")
    assert_same_readings(events, path, bus, board, name, node)


def test_readings_of_a_psd1_are_those_of_the_host_s_decoder(tmp_path: Path) -> None:
    scenario = tmp_path / "psd1.yaml"
    scenario.write_text("seed: 1\nstart: true\nunits:\n  - {name: b, board: psd1, node: 6, serial: 1}\n")
    events, path = recorded(tmp_path, scenario, "--for", "2s", "--can", "none")
    assert_same_readings(events, path, "can0", "psd1", "b", 6)
    (first, *_) = on(events, "PSABENCH_PSD1_b")
    assert first["x_v"] == (first["x_code"] - 32768) * 10 / 32768


def assert_same_readings(events: Sequence[Event], path: Path, bus: str, board: str, name: str, node: int) -> None:
    reader = reader_of(board, node)
    for m in read_frames(path, bus):
        reader.on_message(m)
    want = reader.take()
    assert isinstance(want, Readings)
    got = on(events, f"PSABENCH_{board.upper()}_{name}")
    assert abs(len(got) - len(want)) <= 1  # the last one may have begun
    n = min(len(got), len(want))
    assert n > 10
    for ours, theirs, factor in COLUMNS[board]:
        assert column(got, ours)[:n] == pytest.approx(want[theirs][:n] * factor, rel=1e-12, abs=1e-30), ours


def test_register_accesses_are_published_with_their_names(make_rig: MakeRig, tmp_path: Path) -> None:
    path = tmp_path / "run.lcmlog"
    rig = make_rig("socketcand", extra=["--lcm", f"file://{path}"])
    rig.host.advance(0.5)  # until the board has been set up
    node = rig.unit.node
    assert node.read(0x2000, 2) == 0x56  # CONFIG0 as the set-up leaves it
    node.write(0x2000, 3, 0x09)
    with pytest.raises(Exception, match=r"(?i)06010002|read-only|abort"):
        node.write(0x2000, 1, 0x00)
    with pytest.raises(Exception, match=r"(?i)06020000|abort|exist"):
        node.read(0x5000, 0)
    assert rig.emulator.stop() == 0
    keys = ("object", "name", "address", "index", "sub", "write", "value", "abort")
    got = [tuple(v[k] for k in keys) for v in on(list(read_events(path)), "PSABENCH_REGISTER_a")]
    x = "Accelerometer converter X"
    assert (x, "CONFIG0", 1, 0x2000, 2, False, 0x56, 0) in got
    assert (x, "CONFIG1", 2, 0x2000, 3, True, 0x09, 0) in got
    assert (x, "ID", 0, 0x2000, 1, True, 0, 0x06010002) in got
    assert ("", "", -1, 0x5000, 0, False, 0, 0x06020000) in got


def test_instruments_show_what_their_readouts_show(make_rig: MakeRig, tmp_path: Path) -> None:
    path, scenario = tmp_path / "run.lcmlog", tmp_path / "s.yaml"
    scenario.write_text(FORMS + UNIT.format(form=0, node=5))
    rig = make_rig("socketcand", scenario, extra=["--lcm", f"file://{path}"])
    rig.control.call("head.turn", angle_deg=30.0)
    rig.control.call("table.rate", axis=1, rate_dps=10.0)
    for _ in range(3):
        rig.host.advance(1.0)  # the stream of a longer one waits for its reader
    shown = {name: rig.control.call(f"{name}.read").result for name in ("head", "supply", "chamber")}
    assert rig.emulator.stop() == 0
    events = list(read_events(path))
    last = on(events, "PSABENCH_INSTRUMENTS")[-1]
    for name, theirs in (("head_deg", "angle_deg"), ("supply_v", "measured_v"), ("chamber_degc", "temp_degc")):
        (want,) = (s[theirs] for s in shown.values() if theirs in s)
        assert last[name] == pytest.approx(want, rel=1e-12), name
    assert last["head_deg"] == pytest.approx(30.0)
    assert last["head_face"] == "direct"
    assert last["head_at_rest"]
    assert last["table_axes"] == 1
    assert last["table_dps"] == pytest.approx((10.0,), abs=1e-6)
    assert last["supply_v"] == pytest.approx(12.0)
    assert last["supply_on"]
    assert not [e for e in events if e.channel.startswith("PSABENCH_TRUTH")], "only for who asks for it"


def test_truth_is_published_for_who_asks_and_is_that_of_the_truth_log(tmp_path: Path) -> None:
    log = tmp_path / "truth.jsonl"
    more = ("--for", "500ms", "--can", "none", "--truth-log", str(log), "--truth-every", "100ms", "--lcm-truth")
    events, _ = recorded(tmp_path, "calibrate", *more)
    rows = [json.loads(line) for line in log.read_text().splitlines()]
    got = on(events, "PSABENCH_TRUTH_a")
    assert len(got) == len(rows) == 6
    for v, row in zip(got, rows, strict=True):
        assert v["t_ns"] == row["t_ns"]
        for name in ("f_mps2", "w_radps", "sensor_v", "sensor_a"):
            assert v[name] == tuple(row["unit"][name] if isinstance(row["unit"], dict) else row[name]), name
        assert v["head_deg"] == row["head"]["angle_deg"]


# ---- refusals


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--lcm", "udpm://239.255.76.67:7667?ttl=1"), "expected ttl=0, so that messages stay on this machine"),
        (("--lcm", "tcpq://127.0.0.1:7700"), "--lcm: expected file://PATH or udpm://[GROUP[:PORT]], got"),
        (("--lcm-truth",), "--lcm-truth: expected --lcm URL, got none"),
    ],
)
def test_what_is_not_possible_is_refused(options: Sequence[str], words: str) -> None:
    done = psa_emu("stream", "--can", "none", "--for", "1ms", *options)
    assert done.returncode == 2
    assert words in one_line(done.stderr, "psa-emu")


def in_namespace(*argv: str | Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [*NETWORK, *map(str, argv)], capture_output=True, text=True, timeout=TIMEOUT_S, check=False, cwd=ROOT
    )
    if "unshare failed" in done.stderr:
        pytest.skip("no network namespace of one's own here")
    return done


def test_a_missing_route_is_one_line_and_a_fault_of_the_machine() -> None:
    done = in_namespace(find_emulator(), "stream", "--can", "none", "--for", "1ms", "--lcm", URL)
    assert done.returncode == 3
    assert one_line(done.stderr, "psa-emu").endswith("(as root: ip route add 224.0.0.0/4 dev lo), got none")


def test_a_missing_library_is_one_line_and_files_need_none(tmp_path: Path) -> None:
    library = next(Path("/usr/lib").glob("*/liblcm.so.1")).resolve()
    hide = f'mount --bind /dev/null {library} && exec "$@"'
    run = ["sh", "-c", hide, "sh", str(find_emulator()), "stream", "--can", "none", "--for", "10ms", "--quiet", "--lcm"]
    done = in_namespace(*run, URL)
    assert done.returncode == 3
    assert f"--lcm {URL}: expected liblcm.so.1 (Debian: liblcm1), got: " in one_line(done.stderr, "psa-emu")
    done = in_namespace(*run, f"file://{tmp_path / 'run.lcmlog'}")
    assert (done.returncode, done.stderr) == (0, "")
    assert list(read_frames(tmp_path / "run.lcmlog"))


# ---- multicast, by lcm-logger, lcm-logplayer and what lcm-gen generates


class Network:
    """A network namespace with a route for multicast; see support/lcm_net.py."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._started = 0

    def ask(self, word: str, value: object) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({word: value}) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            pytest.fail(f"the network ended at {word} {value}")
        return json.loads(answer)

    def start(self, *argv: str | Path) -> int:
        """A program that listens on the port of LCM, once it does."""
        self.ask("start", [str(a) for a in argv])
        assert self.ask("port", PORT)
        self._started += 1
        return self._started - 1

    def run(self, *argv: str | Path) -> list[Any]:
        status, out, err = self.ask("run", [str(a) for a in argv])
        return [status, out, err]


@contextmanager
def network() -> Iterator[Network]:
    argv = [*NETWORK, sys.executable, str(ROOT / "tests/e2e/support/lcm_net.py")]
    in_namespace("true")
    with subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        yield Network(process)
        assert process.stdin is not None
        process.stdin.close()


@pytest.fixture
def net() -> Iterator[Network]:
    with network() as n:
        yield n


def program(name: str) -> str:
    """Debian's, or that of the `lcm` package."""
    return shutil.which(name) or str(Path(sys.executable).with_name(name))


MARK = "MARK"  # a channel of the test's own
QUEUE = 30  # messages that a subscriber of LCM keeps unless it asks for more, as lcm-logger does not


NUMBERS = count(1)  # of marks: one that was sent before says nothing of now


def await_logged(net: Network, log: Path) -> None:
    """Until the logger has a new mark on disk: it listens, and what was sent before it has read."""
    sent: list[str] = []

    def has_new_mark() -> bool:
        look = next(looks)
        if look & (look - 1) == 0:  # more and more seldom: it flushes as it writes, and marks wait in its queue, too
            sent.append(f"{MARK}{next(NUMBERS):06}")
            net.ask("publish", [URL, sent[-1]])
        data = log.read_bytes() if log.exists() else b""
        return any(name.encode() in data for name in sent)

    looks = count(1)
    until(has_new_mark, f"a mark in {log}")


def test_lcm_logger_has_every_message_or_the_kernel_has_counted_it(net: Network, tmp_path: Path) -> None:
    """By steps of 5 ms, 15 messages: a logger that a busy machine does not run drops what is beyond its queue."""
    log, want, control_path = tmp_path / "logger.lcmlog", tmp_path / "want.lcmlog", tmp_path / "control"
    logger = net.start(program("lcm-logger"), f"--lcm-url={URL}", "--quiet", "--flush-interval=1", log)
    await_logged(net, log)  # its socket is bound before it joins the group
    options = ("stream", "--can", "none")
    by_step = ("--pace", "step", "--control", control_path, "--lcm", URL)
    emulator = net.start(find_emulator(), *options, *by_step)
    until(control_path.exists, f"{control_path}")
    with Control(control_path) as control:
        for _ in range(200):
            control.call("run", for_s=0.005)
            await_logged(net, log)
        control.call("quit")
    status, _, err = net.ask("wait", emulator)
    assert status == 0, err
    sent, lost = next(line for line in err.splitlines() if "LCM" in line).split(": ")[2].split(", ")
    drops = net.ask("drops", PORT)
    await_logged(net, log)
    net.ask("stop", logger)
    assert psa_emu(*options, "--for", "1s", *FREE, "--lcm", f"file://{want}").returncode == 0
    events, expected = [e for e in read_events(log) if not e.channel.startswith(MARK)], list(read_events(want))
    assert sent == f"{len(expected)} messages"
    assert lost == "0 lost"
    assert len(events) + drops == len(expected) > 2000
    assert max(Counter(e.t_us // 5_000 for e in expected).values()) < QUEUE
    if not drops:
        assert [(e.channel, e.data) for e in events] == [(e.channel, e.data) for e in expected]


def test_messages_leave_with_hop_limit_0(net: Network) -> None:
    code = (
        "import socket, struct, subprocess, sys\n"
        "s = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(0x0800)); s.bind(('lo', 0))\n"
        "subprocess.run(sys.argv[1:], check=True, capture_output=True); s.settimeout(0)\n"
        "seen = set()\n"
        "try:\n    while True:\n        p = s.recv(65535)\n        seen |= {p[8]} if p[9] == 17 else set()\n"
        "except BlockingIOError:\n    print(sorted(seen))\n"
    )
    run = (find_emulator(), "stream", "--can", "none", "--for", "10ms", *FREE, "--lcm", "udpm://")
    assert net.run(sys.executable, "-c", code, *run) == [0, "[0]\n", ""]


def test_lcm_logplayer_feeds_psabench_record_and_a_subscriber_of_lcm_gen(net: Network, tmp_path: Path) -> None:
    """Each of the two makes a file when it has subscribed; their sockets are bound before they join the group."""
    log, out, types, ready = (tmp_path / name for name in ("run.lcmlog", "out.log", "types", "ready"))
    events, path = recorded(tmp_path, "stream", "--for", "200ms", "--can", f"log:{tmp_path / 'bus.log'}")
    assert path == log
    subprocess.run(
        [program("lcm-gen"), "-p", "--ppath", types, *sorted((ROOT / "proto/lcm").glob("*.lcm"))], check=True
    )
    frames = sum(e.channel == "PSABENCH_CAN_can0" for e in events)
    readings = on(events, "PSABENCH_PSA2_a")
    count = (
        "import sys; sys.path.insert(0, sys.argv[1]); import lcm; from psabench_lcm import psa2_reading_t\n"
        "got = []; link = lcm.LCM(sys.argv[2])\n"
        "s = link.subscribe('PSABENCH_PSA2_a', lambda _, d: got.append(psa2_reading_t.decode(d)))\n"
        "s.set_queue_capacity(10000); open(sys.argv[4], 'w').close()\n"
        "while len(got) < int(sys.argv[3]) and link.handle_timeout(30000): pass\n"
        "print(len(got), sum(r.x_code for r in got))\n"
    )
    net.ask("start", [sys.executable, "-c", count, str(types), URL, str(len(readings)), str(ready)])
    net.ask("start", [str(PSABENCH), "record", str(out), "--lcm", URL, "--count", str(frames)])
    until(lambda: out.exists() and ready.exists(), "two subscribers")
    status, _, err = net.run(program("lcm-logplayer"), f"--lcm-url={URL}", log)
    assert status == 0, err
    assert net.ask("wait", 0) == [0, f"{len(readings)} {sum(r['x_code'] for r in readings)}\n", ""]
    status, said, err = net.ask("wait", 1)
    assert (status, err) == (0, "")
    assert said.startswith(f"{frames} messages")
    with can.LogReader(out) as got, can.LogReader(tmp_path / "bus.log") as want:
        for ours, theirs in zip(got, want, strict=True):
            assert ours.equals(theirs, timestamp_delta=1.1e-6, check_direction=False)


def test_the_java_types_compile(tmp_path: Path) -> None:
    javac, jar = shutil.which("javac"), Path("/usr/share/java/lcm.jar")
    if javac is None or not jar.exists():
        pytest.skip("no javac or lcm.jar (Debian: default-jdk-headless, liblcm-java): lcm-spy is tried by hand")
    files = sorted((ROOT / "proto/lcm").glob("*.lcm"))
    subprocess.run([program("lcm-gen"), "-j", "--jpath", tmp_path, *files], check=True)
    subprocess.run([javac, "-cp", jar, "-d", tmp_path, *tmp_path.rglob("*.java")], check=True)


# ---- procedures


def test_a_procedure_publishes_its_progress_and_its_results(tmp_path: Path) -> None:
    log, out = tmp_path / "turns.lcmlog", tmp_path / "out"
    argv = [PSABENCH, "run", "turns", "--condition", "quiet", "--out", out, "--lcm", f"file://{log}"]
    done = subprocess.run(list(map(str, argv)), capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert done.returncode == 0, done.stderr
    events = list(read_events(log))
    progress, (result,) = on(events, "PSABENCH_PROGRESS"), on(events, "PSABENCH_RESULT")
    assert progress[0]["done"] == 0
    assert progress[-1]["done"] == progress[-1]["total"] > 0
    assert {v["procedure"] for v in progress} == {"turns"}
    written = json.loads((out / "result.json").read_text())
    text = json.dumps(written)
    assert result["procedure"] == "turns"
    assert result["condition"] == "quiet"
    assert result["within_limits"]
    assert result["count"] > 3
    assert all(name in text for name in result["name"])
