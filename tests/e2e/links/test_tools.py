"""Other people's programs, unmodified, against the emulator: python-can's and cantools' tools, can-utils."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest
from psabench.boards.decode import decode_can
from rig import DBC, TIMEOUT_S, MakeRig, Rig, over, tool_env, unread, until
from terminal import Terminal

PYTHON = sys.executable
LSB_V = 10.0 / 2**23


@contextmanager
def running(*argv: str | Path, rig: Rig) -> Iterator[subprocess.Popen[str]]:
    """A program on the rig's bus, ended by force if the test has not ended it."""
    with subprocess.Popen(
        [str(a) for a in argv],
        env=tool_env(rig.spec),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as program:
        try:
            yield program
        finally:
            program.kill()


def run(*argv: str | Path, rig: Rig, stdin: str | None = None) -> str:
    """Run a program on the rig's bus to its end and return what it printed."""
    done = subprocess.run(
        [str(a) for a in argv],
        env=tool_env(rig.spec),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        input=stdin,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def heard(rig: Rig) -> list[can.Message]:
    """A list that grows with every frame our own host receives."""
    messages: list[can.Message] = []
    rig.host.listeners.append(messages.append)
    return messages


def contents(messages: list[can.Message]) -> list[tuple[int, bytes]]:
    return [(m.arbitration_id, bytes(m.data)) for m in messages]


# ---- python-can


@pytest.mark.host
@pytest.mark.parametrize("ending", [".log", ".blf", ".asc", ".csv", ".db", ".trc"])
def test_the_logger_writes_all_it_was_sent_in_each_format(make_rig: MakeRig, tmp_path: Path, ending: str) -> None:
    rig = make_rig("socketcand", "stream")
    ours = heard(rig)
    port = int(rig.emulator.endpoints[0]["port"])
    log = tmp_path / f"bus{ending}"
    with running(PYTHON, "-m", "can.logger", "-c", "can0", "-f", log, rig=rig) as logger:
        until(lambda: len(rig.clients()) == 2, "the logger on the bus")
        rig.host.advance(0.5)
        until(lambda: unread(port) == 0, "the logger to read")
        certain = len(ours)
        rig.host.advance(0.1)  # more than it reads at once: when this is read, that was written
        until(lambda: unread(port) == 0, "the logger to read")
        logger.send_signal(signal.SIGINT)
        assert logger.wait(TIMEOUT_S) == 0
    logged = list(can.LogReader(log))
    assert 400 < certain <= len(ours)
    # On Ctrl-C python-can's database writer breaks off between its batches of 500.
    assert (200 if ending == ".db" else certain) <= len(logged) <= len(ours)
    assert contents(logged) == contents(ours)[: len(logged)]
    if ending in (".log", ".blf"):  # the others keep times relative to something
        assert [round(m.timestamp * 1e6) for m in logged] == [round(m.timestamp * 1e6) for m in ours[: len(logged)]]


@pytest.mark.vcan
def test_the_logger_writes_what_is_on_vcan0(make_rig: MakeRig, tmp_path: Path) -> None:
    """No more than the kernel keeps for a program that has not asked for more: none is lost, however long it waits."""
    rig = make_rig("vcan", "stream")
    rig.host.advance(0.3)
    ours = heard(rig)
    log = tmp_path / "bus.log"
    with running(PYTHON, "-m", "can.logger", "-c", "vcan0", "-f", log, rig=rig) as logger:
        until(log.exists, "the logger on the bus")  # it opens the bus first
        rig.host.advance(0.1)
        until(lambda: log.stat().st_size > 0, "8 kB of lines in the file")
        logger.send_signal(signal.SIGINT)
        assert logger.wait(TIMEOUT_S) == 0
    logged = contents(list(can.LogReader(log)))
    assert len(logged) > 120
    assert logged == contents(ours)[: len(logged)]
    with (tmp_path / "out.csv").open("w") as out:
        counters = decode_can(log, 5, out).counters
    assert (counters.lost, counters.torn) == (0, 0)


@over("socketcand", "vcan")
def test_the_player_puts_a_log_on_the_bus_frame_by_frame(transport: str, make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(transport, pace="wall")
    ours = heard(rig)
    log = tmp_path / "in.log"
    frames = 300
    with can.Logger(log) as writer:
        for k in range(frames):
            payload = k.to_bytes(2, "little") + bytes(k % 7)
            writer(can.Message(timestamp=k * 1e-3, arbitration_id=0x123, is_extended_id=False, data=payload))
    before = sum(c["taken"] for c in rig.clients())
    run(PYTHON, "-m", "can.player", log, rig=rig)
    assert rig.host.pump_until(lambda: sum(m.arbitration_id == 0x123 for m in ours) >= frames, TIMEOUT_S)
    with can.LogReader(log) as played:
        assert contents([m for m in ours if m.arbitration_id == 0x123]) == contents(list(played))
    frames_of = rig.control.call("frames").result
    taken = sum(c["taken"] for c in [*frames_of["clients"], frames_of["gone"]])
    assert taken - before == frames


@over("socketcand", "vcan")
def test_the_viewer_shows_the_stream(transport: str, make_rig: MakeRig) -> None:
    rig = make_rig(transport, "stream", pace="wall")
    channel = tool_env(rig.spec)["CAN_CHANNEL"]
    with Terminal([PYTHON, "-m", "can.viewer", "-c", channel], tool_env(rig.spec)) as screen:
        screen.wait_for(r"(?s)\A(?=.*185 +8 )(?=.*285 +8 )")  # in the order of their first coming
        screen.type("\x1b")
        assert screen.wait_end() == 0
        assert "incomplete" not in screen.text


@pytest.mark.host
def test_python_can_gets_whole_messages_however_late_it_reads(
    make_rig: MakeRig, caplog: pytest.LogCaptureFixture
) -> None:
    """It reads 1024 bytes at a time, and a message that is cut there would be a line on can_viewer's screen."""
    rig = make_rig("socketcand", "stream", pace="wall")
    port = int(rig.emulator.endpoints[0]["port"])
    with can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=port, tcp_tune=True) as late:
        until(lambda: unread(port) > 80_000, "80 kB for our host and this one, which do not read")
        with caplog.at_level("DEBUG", "can"):
            assert all(late.recv(TIMEOUT_S) for _ in range(500))
    assert [r.getMessage() for r in caplog.records if r.levelname != "DEBUG"] == []


# ---- cantools


@over("socketcand", "vcan")
def test_the_monitor_shows_volts_by_their_names(transport: str, make_rig: MakeRig) -> None:
    rig = make_rig(transport, "stream", pace="wall")
    argv = [PYTHON, "-m", "cantools", "monitor", "--single-line", str(DBC)]
    with Terminal(argv, tool_env(rig.spec)) as screen:
        x_v = float(screen.wait_for(r"PSA2_XY\( ?X: ([-0-9.e]+) V").group(1))
        screen.type("q")
        assert screen.wait_end() == 0
    assert abs(x_v - 2.4887) < 1e-3


@pytest.mark.host
def test_decode_gives_a_log_the_names_and_units_of_the_dbc(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig("socketcand", "stream")
    ours = heard(rig)
    rig.host.advance(0.3)
    log = tmp_path / "bus.log"
    with can.Logger(log) as writer:
        for m in ours:
            writer(m)
    lines = run(PYTHON, "-m", "cantools", "decode", "--single-line", DBC, rig=rig, stdin=log.read_text()).splitlines()
    assert len(lines) == len(ours)
    pairs = [(m, line) for m, line in zip(ours, lines, strict=True) if m.arbitration_id == 0x185]
    assert len(pairs) > 100
    for m, line in pairs:
        name, _, values = line.partition("::")[2].strip().partition("(")
        x_v, _y, seq = (v.split(": ")[1] for v in values.rstrip(")").split(", "))
        assert name == "PSA2_XY"
        assert float(x_v.removesuffix(" V")) == int.from_bytes(m.data[:3], "little", signed=True) * LSB_V
        assert int(seq) == int.from_bytes(m.data[6:8], "little")


# ---- can-utils; over slc0 see test_slc0.py


@contextmanager
def candump(rig: Rig) -> Iterator[Iterator[tuple[str, str]]]:
    """(id, data) of each frame, as candump prints them, from a moment on at which it is certainly listening."""
    with running("candump", "-L", "-r", "4000000", "vcan0", rig=rig) as dump:
        assert dump.stdout is not None
        beacon = can.Message(arbitration_id=0x7FF, is_extended_id=False)
        task = rig.host.bus.send_periodic(beacon, 0.02)  # candump does not say when it is ready
        assert "7FF#" in dump.stdout.readline()
        task.stop()
        rows = (line.split()[2].split("#") for line in dump.stdout)
        yield ((row[0], row[1]) for row in rows)


@pytest.mark.vcan
def test_candump_sees_as_many_frames_as_the_emulator_sent(make_rig: MakeRig) -> None:
    rig = make_rig("vcan")
    rig.unit.wait_ready()
    ours = heard(rig)
    with candump(rig) as rows:
        before = rig.clients()[0]["delivered"]
        rig.unit.start()
        while rig.clients()[0]["delivered"] <= before + 2000:  # however fast this machine is
            rig.host.advance(0.05)
        rig.unit.stop()
        sent = rig.clients()[0]["delivered"] - before
        run("cansend", "vcan0", "7FE#", rig=rig)
        until_end = itertools.takewhile(lambda row: row[0] != "7FE", rows)
        hosts = {"000", "605", "7FF"}  # our own requests, which the emulator took and did not send
        seen = [row for row in until_end if row[0] not in hosts]
    assert len(seen) == sent
    assert seen == [(f"{i:03X}", d.hex().upper()) for i, d in contents(ours) if i not in (0x000, 0x605, 0x7FF)]


@pytest.mark.vcan
def test_cansend_reaches_the_sdo_server(make_rig: MakeRig) -> None:
    rig = make_rig("vcan", pace="wall")
    ours = heard(rig)
    run("cansend", "vcan0", "605#4018100400000000", rig=rig)  # upload 1018h:4, serial number
    assert rig.host.pump_until(lambda: any(m.arbitration_id == 0x585 for m in ours), TIMEOUT_S)
    answer = next(m for m in ours if m.arbitration_id == 0x585)
    assert bytes(answer.data) == bytes.fromhex("4318100401000000")


@pytest.mark.vcan
@pytest.mark.parametrize("gap_ms", ["1", "0"])
def test_the_emulator_takes_every_frame_of_cangen(make_rig: MakeRig, gap_ms: str) -> None:
    rig = make_rig("vcan", pace="wall")
    before = rig.clients()[0]
    frames = 1000
    run("cangen", "vcan0", "-g", gap_ms, "-p", "10", "-n", str(frames), "-I", "7EF", "-L", "8", "-D", "i", rig=rig)
    until(lambda: rig.clients()[0]["taken"] >= before["taken"] + frames, "the emulator to take them")
    after = rig.clients()[0]
    assert after["taken"] - before["taken"] == frames
    assert (after["overrun"], after["refused"]) == (0, 0)
    assert rig.unit.register("x", 1) == 0x56  # and the unit goes on


@pytest.mark.vcan
def test_canbusload_counts_the_stream(make_rig: MakeRig) -> None:
    rig = make_rig("vcan", "stream", pace="wall")
    with running("stdbuf", "-oL", "canbusload", "vcan0@1000000", rig=rig) as program:
        assert program.stdout is not None
        # " vcan0@1000000  2001  222111  128064  22%": frames and bits of the last second
        rows = (line.split() for line in program.stdout if "vcan0@1000000" in line)
        frames, bits = next((int(r[1]), int(r[2])) for r in rows if int(r[1]) > 0)
    assert 47 <= bits / frames <= 135  # a heartbeat is shorter than a sample's halves of 111 bits and stuffing
