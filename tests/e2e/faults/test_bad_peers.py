"""Programs that vanish, do not read, send too much, are interrupted or die: nothing hangs, no recording is lost.

`make test` runs this file a second time against the emulator under AddressSanitizer and UBSan.
"""

from __future__ import annotations

import json
import signal
import socket
import struct
from pathlib import Path

import can
import numpy as np
import pytest
from psabench.boards.psa2.device import Psa2
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from psabench.link.vcd import read_vcd
from psabench.procedures.recording import load_csv
from rig import HOST, TIMEOUT_S, MakeRig, addresses, one_line, psabench, talker, until

# ---- who vanishes, does not read, or sends too much


@HOST
@pytest.mark.parametrize("how", ["close", "reset"])
@pytest.mark.parametrize("pace", ["step", "wall"])
def test_a_program_that_vanishes_in_the_stream_disturbs_nobody_and_may_return(
    make_rig: MakeRig, how: str, pace: str
) -> None:
    rig = make_rig("socketcand", "stream", pace=pace)
    assert rig.host.pump_until(lambda: len(rig.unit.frames) > 200, TIMEOUT_S)
    for _ in range(3):
        with talker(rig.emulator) as s:
            assert rig.host.pump_until(lambda: rig.clients()[1]["delivered"] > 40, TIMEOUT_S)
            assert s.recv(64)
            if how == "reset":
                s.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        assert rig.host.pump_until(lambda: len(rig.clients()) == 1, TIMEOUT_S)
    assert (rig.unit.frames.counters.lost, rig.unit.frames.counters.torn) == (0, 0)
    assert rig.control.call("frames").result["gone"]["delivered"] > 100
    assert rig.clients()[0]["dropped"] == 0


@HOST
def test_a_serial_port_that_is_closed_in_the_stream_can_be_opened_again(make_rig: MakeRig) -> None:
    rig = make_rig("slcan", "stream", pace="wall")
    rig.host.advance(0.3)
    rig.host.close()
    until(lambda: rig.clients() == [], "the channel to be closed")
    with CanHost(open_bus(rig.spec), WallClock()) as again:
        seen: list[int] = []
        again.listeners.append(lambda m: seen.append(m.arbitration_id))
        assert again.pump_until(lambda: len(seen) > 100, TIMEOUT_S)
    assert set(seen) <= {0x185, 0x285, 0x705}


def flood(count: int, can_id: int = 0x7F0) -> bytes:
    return b"".join(b"< send %03X 8 %x %x 0 0 0 0 0 0 >" % (can_id, k >> 8 & 255, k & 255) for k in range(count))


@HOST
def test_a_program_that_never_reads_loses_frames_and_the_others_do_not(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", pace="wall", extra=("--bitrate", "0"))
    rig.unit.wait_ready()
    seen: list[int] = []
    rig.host.listeners.append(lambda m: seen.append(m.data[0] << 8 | m.data[1]) if m.arbitration_id == 0x7F0 else None)
    batch = flood(2000)
    with talker(rig.emulator) as deaf, talker(rig.emulator) as loud:
        assert deaf.fileno() >= 0
        sent = 0
        while rig.clients()[1]["dropped"] == 0:
            assert sent < 2_000_000, "nothing was dropped: is its buffer without bounds?"
            loud.sendall(batch)
            sent += 2000
            assert rig.host.pump_until(lambda expected=sent: len(seen) >= expected, TIMEOUT_S)  # type: ignore[misc]
        assert seen == list(range(2000)) * (sent // 2000)
        assert rig.clients()[0]["dropped"] == 0
        assert "reads too slowly, frames are dropped" in rig.emulator.messages()
        assert rig.unit.register("x", 1) == 0x56


@HOST
def test_in_step_pace_time_waits_for_a_program_that_does_not_read(make_rig: MakeRig) -> None:
    """Nothing is lost to it; when it has gone, time goes on."""
    rig = make_rig("socketcand", "stream", extra=("--can", "slcan"))
    rig.host.close()
    until(lambda: rig.clients() == [], "our own host to be gone")
    with talker(rig.emulator) as deaf:
        until(lambda: len(rig.clients()) == 1, "the client")
        with socket.socket(socket.AF_UNIX) as s:
            s.settimeout(TIMEOUT_S)
            s.connect(str(rig.emulator.control_path))
            s.sendall(b'{"id": 1, "cmd": "run", "args": {"for_s": 600}}\n')
            # Time stands still when two looks, each after a turn of the loop, see the same instant.
            instants: list[int] = []
            until(
                lambda: instants.append(rig.control.call("time").t_ns) or instants[-50:-1].count(instants[-1]) == 49,  # type: ignore[func-returns-value]
                "time to stand still",
            )
            assert instants[-1] < 600e9
            assert rig.clients()[0]["dropped"] == 0
            deaf.close()
            assert json.loads(s.makefile().readline())["t_ns"] == 600_000_000_000


@HOST
def test_a_full_bus_costs_samples_that_are_counted_and_told(make_rig: MakeRig) -> None:
    """Half a second of frames with a higher priority than the stream's leaves it no room."""
    rig = make_rig("socketcand")
    rig.unit.wait_ready()
    emergencies: list[int] = []
    rig.host.listeners.append(
        lambda m: emergencies.append(m.data[0] | m.data[1] << 8) if m.arbitration_id == 0x085 else None
    )
    before = rig.unit.counters()
    rig.unit.frames.forget()
    rig.unit.start()
    rig.host.advance(0.05)
    with talker(rig.emulator) as loud:
        loud.settimeout(TIMEOUT_S)
        loud.sendall(flood(4000, can_id=0x010))
        rig.host.advance(0.3)
    rig.host.advance(3.0)  # the rest of the flood, and a second of calm
    rig.unit.stop()
    rig.unit.frames.take()
    dropped = rig.unit.counters()["Dropped"] - before["Dropped"]
    assert dropped > 100
    assert rig.unit.frames.counters.lost == dropped
    assert rig.unit.frames.counters.torn == 0
    assert emergencies == [0x8110, 0x0000]


@HOST
@pytest.mark.parametrize(
    ("can_id", "data"),
    [(0x605, b""), (0x605, b"\x40\x08\x10"), (0x000, b"\x01"), (0x000, b"\x01\x05\x00"), (0x080, b"\1\2\3")],
)
def test_a_request_of_the_wrong_length_is_counted(make_rig: MakeRig, can_id: int, data: bytes) -> None:
    rig = make_rig("socketcand")
    rig.unit.wait_ready()
    before = rig.unit.counters()["Malformed requests"]
    rig.host.send(can_id, data)
    assert rig.unit.counters()["Malformed requests"] == before + 1
    assert len(rig.unit.stream(5)) == 5


# ---- Ctrl-C, and programs that die


@HOST
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_a_signal_ends_the_emulator_with_its_files_complete(tmp_path: Path, number: int, status: int) -> None:
    vcd, link = tmp_path / "t.vcd", tmp_path / "port"
    extra = ("--vcd", vcd, "--can", f"slcan:{link}")
    with Emulator("stream", pace="wall", extra=extra) as emulator:
        assert emulator.control_path is not None
        control_path = emulator.control_path
        with Control(control_path) as control:
            until(lambda: control.call("time").t_ns > 250_000_000, "some frames")
        assert link.is_symlink()
        emulator.signal(number)
        assert emulator.wait(TIMEOUT_S) == status
        assert not control_path.exists()
        assert not link.is_symlink()
        assert "frames on the bus" in emulator.messages()
    lines = read_vcd(vcd)
    assert len(lines.wires["Int"].t_ns) > 20
    assert vcd.read_bytes().endswith(b"\n")


def rows(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


@HOST
def test_ctrl_c_in_a_calibration_keeps_its_readings_and_ends_its_emulator(tmp_path: Path) -> None:
    csv = tmp_path / "fourier-realistic.csv"
    with psabench("run", "fourier", "--condition", "realistic", "--realisations", "500", "--out", tmp_path) as run:
        try:
            until(lambda: rows(csv) > 30, "some readings")
            emulator = int(Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()[0])
            run.send_signal(signal.SIGINT)
            _, err = run.communicate(timeout=TIMEOUT_S)
        finally:
            run.kill()
    assert run.returncode == 130
    assert "psabench: interrupted; what was measured is kept" in err
    assert "Traceback" not in err
    assert not Path(f"/proc/{emulator}").exists()
    readings = load_csv(csv)
    assert len(readings) >= 29
    assert len(readings) == rows(csv) - 1


@HOST
def test_a_bench_that_was_interrupted_can_be_used_again(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig("socketcand", "quiet", extra=["--scpi", "head:0"])
    rig.host.close()
    there: tuple[str | Path, ...] = (*addresses(rig.emulator), "--average", "0", "--out", tmp_path)
    with psabench("run", "fourier", *there, "--realisations", "500") as first:
        try:
            until(lambda: rows(tmp_path / "fourier.csv") > 30, "some readings")
            first.send_signal(signal.SIGINT)
            first.communicate(timeout=TIMEOUT_S)
        finally:
            first.kill()
    assert first.returncode == 130
    with psabench("run", "turns", *there) as second:
        try:
            out, err = second.communicate(timeout=TIMEOUT_S)
        finally:
            second.kill()
    assert second.returncode == 0, out + err


@HOST
def test_an_emulator_that_dies_in_a_calibration_is_told_in_one_line(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig("socketcand", "quiet", extra=["--scpi", "head:0"])
    rig.host.close()
    there: tuple[str | Path, ...] = (*addresses(rig.emulator), "--average", "0", "--out", tmp_path)
    with psabench("run", "fourier", *there, "--realisations", "500") as run:
        try:
            until(lambda: rows(tmp_path / "fourier.csv") > 30, "some readings")
            rig.emulator.signal(signal.SIGKILL)
            _, err = run.communicate(timeout=TIMEOUT_S)
        finally:
            run.kill()
    assert run.returncode == 3
    assert "Traceback" not in err
    assert err.splitlines()[-1].startswith("psabench: ")
    assert len(load_csv(tmp_path / "fourier.csv")) >= 29


@HOST
@pytest.mark.parametrize("ending", [".log", ".blf", ".asc"])
@pytest.mark.parametrize("how", ["Ctrl-C", "emulator ends", "emulator is killed"])
def test_a_recording_is_complete_whatever_ends_it(make_rig: MakeRig, tmp_path: Path, how: str, ending: str) -> None:
    rig = make_rig("socketcand", "stream", pace="wall")
    log = tmp_path / f"bus{ending}"
    with psabench("record", "--can", rig.spec, log) as record:
        try:
            until(lambda: len(rig.clients()) == 2 and rig.clients()[1]["delivered"] > 500, "the recording to run")
            until(log.exists, "the recording's file")
            if how == "Ctrl-C":
                record.send_signal(signal.SIGINT)
            elif how == "emulator ends":
                rig.control.call("quit")
            else:
                rig.emulator.signal(signal.SIGKILL)
            out, err = record.communicate(timeout=TIMEOUT_S)
        finally:
            record.kill()
    assert record.returncode == (0 if how == "Ctrl-C" else 3)
    assert "Traceback" not in err
    if how != "Ctrl-C":
        assert "the recording up to there is complete" in one_line(err, "psabench")
    with can.LogReader(log) as logged:
        count = len(list(logged))
    assert out.splitlines()[0].startswith(f"{count} messages")
    assert "lost 0, torn 0" in out


@HOST
@pytest.mark.parametrize(("transport", "count"), [("socketcand", 2000), ("slcan", 250)])  # a terminal takes 4 KiB
def test_time_moves_for_a_host_that_has_sent_more_than_its_queue_holds(
    make_rig: MakeRig, tmp_path: Path, transport: str, count: int
) -> None:
    """In step pace 128 frames wait for the bus, the others follow as it has room, and it never rests in between."""
    log = tmp_path / "bus.log"
    rig = make_rig(transport, extra=("--can", f"log:{log}"))
    rig.unit.wait_ready()
    for k in range(count):
        rig.host.send(0x7F0, bytes([k >> 8, k & 255, 0, 0, 0, 0, 0, 0]))
    rig.host.advance(0.5)
    rig.emulator.stop()
    frames = [line.split() for line in log.read_text().splitlines() if " 7F0#" in line]
    assert [int(data[4:8], 16) for _, _, data in frames] == list(range(count))
    gaps_s = np.diff([float(stamp.strip("()")) for stamp, _, _ in frames])
    assert gaps_s.max() < 300e-6, "a frame of 8 bytes takes 111 to 135 us, and one of the unit's may come between"


@HOST
def test_a_host_that_left_frames_behind_does_not_count_for_the_next_one(make_rig: MakeRig) -> None:
    """In step pace its frames go out only when time moves; until then it is still on the bus."""
    rig = make_rig("socketcand", "stream")
    rig.host.advance(0.5)
    rig.host.send(0x123, b"left")
    rig.host.close()
    until(lambda: rig.clients()[0]["taken"] == 1, "its frame to be taken")
    with CanHost(open_bus(rig.spec), WallClock()) as host:
        host.clock = StepClock(rig.control)
        for k in range(1, 6):
            host.advance(0.1)
            assert host.received >= 190 * k
        assert Psa2(host).register("x", 1) == 0x56


@HOST
def test_what_a_host_that_left_had_asked_for_is_not_the_next_ones_answer(make_rig: MakeRig) -> None:
    """In step pace its request is carried out only when the next one lets time pass."""
    rig = make_rig("socketcand")
    rig.unit.wait_ready()
    with talker(rig.emulator) as s:
        s.sendall(b"< send 605 8 40 1 22 3 0 0 0 0 >")  # the whole word of Z
        until(lambda: rig.clients()[1]["taken"] == 1, "its request to be taken")
    assert rig.unit.register("x", 1) == 0x56
