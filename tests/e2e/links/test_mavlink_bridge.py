"""`psabench mavlink`: calibrations that run, asked for by MAVSDK and pymavlink; cancelled, failed; a log."""

from __future__ import annotations

import json
import random
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import pytest
from mavlink_client import TIMEOUT_S, command, free_port, parameters, receive, set_parameter, station
from psabench.emulator import Emulator
from psabench.link.control import Control
from psabench.link.log_file import LogFile
from rig import HERE, HOST, SEED, addresses, one_line, psabench

pytestmark = HOST
CALIBRATE = (241, 0.0, 0.0, 0.0, 0.0, 1.0)
QUICK = ("--scenario", "quiet", "--realisations", "2", "--average", "0", "--gravity", "9.8094")


@contextmanager
def bridge(*words: str | Path, port: str = "tcp:0") -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A running bridge and its address; ended as a user ends it."""
    process = psabench("mavlink", "--mavlink", port, *words)
    try:
        assert process.stdout is not None
        head = process.stdout.readline()
        assert head.startswith("ready mavlink="), head + process.communicate()[1]
        assert process.stdout.readline() == "ready all\n"
        host, number = (word.partition("=")[2] for word in head.split()[2:])
        yield process, f"{host}:{number}"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == 0, said
    finally:
        process.kill()
        process.wait()


def acknowledgements(gcs: Any) -> list[tuple[int, int]]:
    """(result, progress) until the last one."""
    seen: list[tuple[int, int]] = []
    while not seen or seen[-1][0] in (1, 5):
        m = receive(gcs, "COMMAND_ACK", where=lambda m: m.command == 241)
        seen.append((m.result, m.progress))
    return seen


def test_mavsdk_runs_the_calibration_and_its_results_are_in_the_unit() -> None:
    port = free_port()
    with bridge(*QUICK, port=f"udp:{port}"):
        words = [sys.executable, str(HERE / "mavsdk_client.py"), str(port)]
        done = subprocess.run([*words, "calibrate"], capture_output=True, text=True, timeout=TIMEOUT_S, check=True)
        seen = json.loads(done.stdout.splitlines()[-1])
        assert seen["found"]
        assert seen["error"] == "", done.stdout
        assert seen["progress"] == sorted(seen["progress"])
        assert seen["progress"][-1] > 0.9
        assert "[cal] calibration done: accel" in done.stderr
        done = subprocess.run(
            [*words, "params", "SAMPLE_NTH", "1"], capture_output=True, text=True, timeout=TIMEOUT_S, check=True
        )
        found = json.loads(done.stdout.splitlines()[-1])["float"]
    assert found["CAL_VALID"] == 1.0
    assert found["V_PER_G_X"] == pytest.approx(found["CAL_KX"], rel=1e-7)  # the unit has it
    assert found["CAL_KX"] == pytest.approx(1.0, abs=1e-3)  # of the scenario
    assert found["CAL_KY"] == pytest.approx(0.0118, abs=1e-4)  # what test turns see: turns.py, eq. (8)
    assert found["CAL_U0_V"] == pytest.approx(2.5, abs=1e-3)


def test_a_calibration_is_followed_and_a_second_one_is_told_to_wait() -> None:
    with bridge(*QUICK) as (_, address), station(f"tcp:{address}") as gcs:
        before = receive(gcs, "PSABENCH_ACCEL")
        assert before.scale == 0
        for _ in range(2):
            gcs.mav.command_long_send(1, 1, 241, 0, 0, 0, 0, 0, 1, 0, 0)
        seen = acknowledgements(gcs)
        assert seen[0] == (5, 0)
        assert seen.count((1, 0)) == 1  # temporarily rejected
        assert seen[-1] == (0, 0)
        running = [progress for result, progress in seen if result == 5]
        assert running == sorted(running)
        assert len(running) > 5
        after = receive(gcs, "PSABENCH_ACCEL", where=lambda m: m.scale == 1)
        assert gcs.packet_loss() == 0.0
        assert command(gcs, 512, 54103) == 0  # the results again
        found = parameters(gcs)
    assert after.accel_mps2[0] == pytest.approx(
        (after.volts[0] - found["ZERO_V_X"]) / found["V_PER_G_X"] * 9.8094, abs=1e-5
    )


def test_a_cancelled_calibration_leaves_the_unit_as_it_was() -> None:
    long = ("--scenario", "quiet", "--realisations", "5000", "--average", "16")
    with bridge(*long) as (_, address), station(f"tcp:{address}") as gcs:
        gcs.mav.command_long_send(1, 1, 241, 0, 0, 0, 0, 0, 1, 0, 0)
        receive(gcs, "STATUSTEXT", where=lambda m: m.text.startswith("[cal] calibration started"))
        receive(gcs, "PSABENCH_ANGLES")
        said = set_parameter(gcs, "SAMPLE_NTH", 2)[1]
        assert "".join(said) == "SAMPLE_NTH: expected no calibration under way, got one"
        gcs.mav.command_long_send(1, 1, 241, 0, 0, 0, 0, 0, 0, 0, 0)
        seen = acknowledgements(gcs)
        assert seen[-1][0] == 6
        assert gcs.messages["STATUSTEXT"].text == "[cal] calibration cancelled"
        receive(gcs, "PSABENCH_ACCEL")  # the stream goes on
        found = parameters(gcs)
        assert (found["ZERO_V_X"], found["V_PER_G_X"], found["CAL_VALID"]) == (2.5, 1.0, 0.0)
        assert command(gcs, *CALIBRATE[:5], 2.0) == 3  # level: unsupported
        assert command(gcs, 80000 % 65536) == 3


def test_a_bench_that_vanishes_ends_the_calibration_as_failed() -> None:
    with Emulator("quiet", pace="wall", scpi=True) as emu, Control(emu.control_path) as control:  # type: ignore[arg-type]
        control_words = addresses(emu)
        with bridge(*control_words, "--realisations", "5000") as (process, address):
            with station(f"tcp:{address}") as gcs:
                gcs.mav.command_long_send(1, 1, 241, 0, 0, 0, 0, 0, 1, 0, 0)
                receive(gcs, "PSABENCH_ANGLES")
                control.call("quit")
                assert acknowledgements(gcs)[-1][0] == 4
                assert gcs.messages["STATUSTEXT"].severity == 2
            _, said = process.communicate(timeout=TIMEOUT_S)
            assert process.returncode == 3
            assert "psabench: " in said
            process.returncode = 0  # as bridge() expects of those that it ends


def test_a_recorded_log_is_a_device_with_the_same_codes(tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    with (
        Emulator("stream", pace="step", cans=[f"log:{log}"]) as emu,
        Control(emu.control_path) as control,  # type: ignore[arg-type]
    ):
        control.call("run", for_s=0.5)
    pairs = [line.split("#")[1] for line in log.read_text().splitlines() if " 185#" in line]
    codes = [[_signed(p[0:6]), _signed(p[6:12])] for p in pairs]
    with bridge("--log", log, "--speed", "0") as (process, address), station(f"tcp:{address}") as gcs:
        got = [receive(gcs, "PSABENCH_ACCEL").code[:2] for _ in range(len(codes) - 1)]
        assert got == codes[: len(got)]
        assert process.wait(TIMEOUT_S) == 0


def _signed(digits: str) -> int:
    return int.from_bytes(bytes.fromhex(digits), "little", signed=True)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--mavlink", "usb"), "--mavlink: expected udp[:PORT], udpin[:PORT] or tcp[:PORT], got 'usb'"),
        (("--mavlink", "udp:0"), "--mavlink: expected a port from 1 to 65535, got 'udp:0'"),
        (("--log", "no.log"), "no.log: expected a CAN log, got no such file"),
        (("--log", "no.txt"), "no.txt: expected an ending of .asc"),
        (("--log", "x.log", "--can", "y"), "--log: expected a log or a bench, got both"),
        (("--imu", "-5"), "--imu: expected 0 or a number from 0.01 to 10000, got '-5'"),
        (("--sysid", "256"), "--sysid: expected an integer from 1 to 255, got '256'"),
    ],
)
def test_a_wrong_option_is_one_line_and_status_2(words: tuple[str, ...], expected: str) -> None:
    process = psabench("mavlink", *words)
    _, said = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 2
    assert expected in one_line(said, "psabench")


def test_a_damaged_log_is_sent_up_to_the_damage(tmp_path: Path) -> None:
    log = tmp_path / "bad.log"
    log.write_text(
        "(0000000001.000000) can0 185#15DA1F010000FFFF\n"
        "(0000000001.000200) can0 285#000000000000FFFF\n"
        "(0000000001.0x0400) can0 185#15DA1F0100000000\n"
    )
    process = psabench("mavlink", "--mavlink", "udp:9", "--log", log)
    _, said = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 2
    assert "message 3: expected a whole message" in said
    assert "readings 1," in said


@pytest.mark.parametrize("ending", [".log", ".mcap", ".pcap"])
def test_a_log_of_another_node_is_bad_input(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"other{ending}"
    log = LogFile(path, {6: "psd1"})
    log(can.Message(arbitration_id=0x186, data=bytes(8), is_extended_id=False, timestamp=1.0))
    log.close()
    process = psabench("mavlink", "--mavlink", "udp:9", "--log", path)
    _, said = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 2
    assert f"psabench: {path}: expected frames of node 5, got none" in said


def test_hostile_bytes_do_not_end_the_bridge() -> None:
    noise = random.Random(SEED)
    with bridge(*QUICK) as (_, address), station(f"tcp:{address}") as gcs:
        for _ in range(3):
            with socket.create_connection(("127.0.0.1", int(address.split(":")[1]))) as s:
                s.sendall(b"\xfd\xff" + noise.randbytes(20000) + b"\xfe\xff" * 50)
        assert command(gcs, 400, 1) == 3
        receive(gcs, "PSABENCH_ACCEL")
        assert gcs.packet_loss() == 0.0
