"""The virtual logic analyser: sigrok-cli on a running emulator, samples beside a recording, misbehaving clients."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench.emulator import Emulator
from psabench.errors import BadInput
from psabench.link.control import Control
from psabench.link.vcd import read_vcd

ROOT = Path(__file__).resolve().parents[3]
TIMEOUT_S = 60.0
SIGROK_S = 240.0  # a minute's samples are 240 million: 15 s of CPU time, and as many more as a busy machine makes of it
PINS = "P8_45 P8_46 P8_43 P8_44 P8_41 P8_42 P8_39 P8_40 P8_27 P8_29 P8_28 P8_30 P8_21 P8_20".split()
FRAME = re.compile(r"X=(-?\d+) Y=(-?\d+) Z=(-?\d+) T=([0-9A-F]+)h")
CAN = re.compile(r"\(\S+\) can0 (185|285)#(\w+)")


class Analyser:
    """A client of the protocol, bare: what libsigrok does, and what it does not."""

    def __init__(self, emulator: Emulator) -> None:
        e = emulator.endpoint(logic="beaglelogic")
        self.lines = e["lines"].split(",")
        self.socket = socket.create_connection((e["host"], int(e["port"])), TIMEOUT_S)

    def __enter__(self) -> Analyser:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def ask(self, line: str) -> str:
        self.socket.sendall(line.encode() + b"\n")
        answer = b""
        while not answer.endswith(b"\n"):
            more = self.socket.recv(1024)
            assert more, answer
            answer += more
        return answer.decode().rstrip("\n")

    def read(self, count: int) -> bytes:
        """That many bytes."""
        data = bytearray()
        while len(data) < count:
            more = self.socket.recv(min(1 << 16, count - len(data)))
            assert more, f"the stream ends after {len(data)} bytes"
            data += more
        return bytes(data)


def logic(control: Control) -> dict[str, Any]:
    counters: dict[str, Any] = control.call("counters").result["logic"][0]
    return counters


def until(control: Control, key: str, least: int) -> dict[str, Any]:
    """The counters, once one of them has come so far."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while (counters := logic(control))[key] < least:
        assert time.monotonic() < deadline_s, counters
    return counters


@contextmanager
def bench(pace: str = "step", port: str = "0", *extra: str | Path) -> Iterator[tuple[Emulator, Control]]:
    with (
        Emulator("stream", cans=["none"], pace=pace, seed=3, extra=["--logic", f"beaglelogic:{port}", *extra]) as emu,
        Control(emu.directory / "control") as control,
    ):
        yield emu, control


# ---- sigrok-cli


def can_words(log: Path) -> list[tuple[int, int, int, int]]:
    """X, Y, Z and T of each pair of frames."""
    frames: dict[str, list[bytes]] = {"185": [], "285": []}
    for line in log.read_text().splitlines():
        if m := CAN.fullmatch(line):
            frames[m[1]].append(bytes.fromhex(m[2]))
    pairs = zip(frames["185"], frames["285"], strict=False)
    return [(_s24(a[:3]), _s24(a[3:6]), _s24(b[:3]), int.from_bytes(b[3:5], "little")) for a, b in pairs]


def _s24(raw: bytes) -> int:
    return int.from_bytes(raw, "little", signed=True)


def sigrok(port: str, hz: int, samples: int, channels: dict[str, str], *more: str) -> subprocess.CompletedProcess[str]:
    names = ",".join(f"{pin}={name}" for pin, name in channels.items())
    device = f"beaglelogic:conn=tcp_raw/127.0.0.1/{port}"
    return subprocess.run(
        ["sigrok-cli", "-d", device, "-c", f"samplerate={hz}", "--samples", str(samples), "-C", names, *more],
        env={**os.environ, "SIGROKDECODE_DIR": str(ROOT / "decoders")},
        capture_output=True,
        text=True,
        timeout=SIGROK_S,
        check=False,
    )


@pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")
@pytest.mark.parametrize(
    ("lines", "hz", "seconds"),
    [("", 8_000_000, 0.5), ("Int,Data,CLK", 8_000_000, 0.5), ("Int,Data,CLK", 4_000_000, 60.0)],
    ids=["16-bits", "8-bits", "minute"],
)
def test_sigrok_decodes_what_the_board_sends_on_can(lines: str, hz: int, seconds: float, tmp_path: Path) -> None:
    log = tmp_path / "can.log"
    port = f"beaglelogic:0:{lines}" if lines else "beaglelogic:0"
    extra: list[str | Path] = ["--wait-client", "--for", f"{seconds + 0.1}s", "--logic", port]
    with Emulator("stream", cans=[f"log:{log}"], pace="free", seed=1, control=False, extra=extra) as emu:
        e = emu.endpoint(logic="beaglelogic")
        channels = dict(zip(PINS, e["lines"].split(","), strict=False))
        decode = ["-P", "psa2frame:int=Int:data=Data:clk=CLK", "-A", "psa2frame=frame:warning"]
        run = sigrok(e["port"], hz, int(seconds * hz), channels, *decode)
        assert (run.returncode, run.stderr) == (0, "")
        assert emu.wait(TIMEOUT_S) == 0
        assert "lost 0 in 0 places" in emu.messages()
    frames = [FRAME.search(line) for line in run.stdout.splitlines()]
    assert None not in frames, "a torn frame"
    seen = [(int(f[1]), int(f[2]), int(f[3]), int(f[4], 16)) for f in frames if f]
    assert len(seen) > 1000 * (seconds - 0.25)  # the set-up takes 0.19 s
    assert seen == can_words(log)[: len(seen)]


@pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")
def test_sigrok_captures_in_real_time() -> None:
    with bench("wall", "0:Int,Data,CLK") as (emu, control):
        e = emu.endpoint(logic="beaglelogic")
        began_s = time.monotonic()
        run = sigrok(e["port"], 1_000_000, 300_000, {PINS[0]: "Int"}, "-O", "bits:width=0")
        assert time.monotonic() - began_s > 0.25
        assert (run.returncode, run.stderr) == (0, "")
        assert sum(c in "01" for c in run.stdout.split("Int:")[1]) == 300_000
        counters = logic(control)
        assert (counters["lost"], counters["running"], counters["captures"]) == (0, 0, 1)


# ---- samples


@pytest.mark.parametrize(("hz", "unit"), [(8_000_000, 0), (7_372_800, 0), (1_000_003, 1)])
def test_each_sample_is_the_level_at_its_instant(hz: int, unit: int, tmp_path: Path) -> None:
    vcd = tmp_path / "run.vcd"
    with bench("step", "0", "--vcd", vcd, "--vcd-unit", "1") as (emu, control), Analyser(emu) as a:
        control.call("run", for_s=0.21)  # the set-up is over
        assert a.ask(f"samplerate {hz}") == a.ask(f"sampleunit {unit}") == "ok"
        a.socket.sendall(b"get\n")
        until(control, "captures", 1)
        thread = threading.Thread(target=control.call, args=("run",), kwargs={"for_s": 0.01})
        thread.start()
        size = 2 - unit
        data = a.read(int(0.0098 * hz) * size)
        thread.join()
        counters = logic(control)
    samples = np.frombuffer(data, dtype="<u2" if size == 2 else "u1").astype(np.uint64)
    k0 = round(counters["first_ns"] * hz / 1e9)
    k = np.arange(k0, k0 + samples.size)
    t_ns = k // hz * 10**9 + k % hz * 10**9 // hz
    assert t_ns[0] == counters["first_ns"]
    recording = read_vcd(vcd)
    lines = a.lines[:8] if size == 1 else a.lines
    assert len(a.lines) == 14
    for bit, name in enumerate(lines):
        assert np.array_equal(samples >> np.uint64(bit) & np.uint64(1), recording.wires[name].at(t_ns)), name
    assert not (samples >> np.uint64(len(lines))).any()
    assert len(set(samples.tolist())) > 5


def test_a_slow_reader_gets_every_sample_where_time_waits_and_never_half_a_word() -> None:
    hz, seconds = 100_000_000, 0.5
    with bench("free", "0", "--wait-client", "--for", f"{seconds}s") as (emu, _), Analyser(emu) as a:
        assert a.ask(f"samplerate {hz}") == "ok"
        a.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 200_001)
        a.socket.sendall(b"get\n")
        total = 0
        expected = int((seconds - 0.0002) * hz) * 2
        while total < expected:
            more = a.socket.recv(1 << 17)
            assert len(more) % 2 == 0, f"half a word after {total} bytes"
            total += len(more)
        assert total == expected
        a.socket.close()
        assert emu.wait(TIMEOUT_S) == 0
        assert f"samples {expected // 2}, lost 0 in 0 places" in emu.messages()


def test_a_slow_reader_loses_whole_buffers_in_real_time_and_is_told_so() -> None:
    with bench("wall") as (emu, control), Analyser(emu) as a:
        assert a.ask("samplerate 100000000") == a.ask("bufunitsize 8192") == "ok"
        a.socket.sendall(b"get\n")
        until(control, "lost", 1)
        slow = re.compile(r"reads too slowly: samples are lost in buffers of 8192 bytes, first after \d+\n")
        while not slow.search(emu.messages()):
            control.call("time")
        a.socket.sendall(b"close\n")
        while (counters := logic(control))["running"]:
            pass
        while "end of a capture" not in (messages := emu.messages()):
            control.call("time")
        assert counters["holes"] == 1
        assert f"lost {counters['lost']} samples in 1 places, delivered {counters['samples']}\n" in messages
        assert control.call("time").result["pace"] == "wall"


def test_a_dark_board_is_sampled_without_loss() -> None:
    hz, seconds = 30_000_000, 0.45  # 27 MB without an event: more than a capture's ring holds
    extra = ["--logic", "beaglelogic:0"]
    with (
        Emulator("brownout", cans=["none"], extra=extra) as emu,
        Control(emu.directory / "control") as control,
        Analyser(emu) as a,
    ):
        control.call("supply.output", on=False)
        assert a.ask(f"samplerate {hz}") == "ok"
        a.socket.sendall(b"get\n")
        until(control, "captures", 1)
        thread = threading.Thread(target=control.call, args=("run",), kwargs={"for_s": seconds})
        thread.start()
        a.read(int((seconds - 0.0002) * hz) * 2)
        thread.join()
        assert logic(control)["lost"] == 0


# ---- clients


def test_clients_have_settings_and_captures_of_their_own() -> None:
    with bench() as (emu, control), Analyser(emu) as a, Analyser(emu) as b:
        assert a.ask("samplerate 1000000") == "ok"
        assert (a.ask("samplerate"), b.ask("samplerate"), b.ask("version")) == ("1000000", "8000000", "BeagleLogic 1.0")
        for client in (a, b):
            client.socket.sendall(b"get\n")
        until(control, "captures", 2)
        control.call("run", for_s=0.0102)
        assert (len(a.read(20_000)), len(b.read(160_000))) == (20_000, 160_000)
        a.socket.sendall(b"close\n")
        while logic(control)["running"] > 1:
            pass
        assert a.ask("triggerflags") == "0"  # a line again
        a.socket.sendall(b"get\n")
        until(control, "captures", 3)


def test_while_samples_flow_nothing_else_is_said() -> None:
    with bench() as (emu, control), Analyser(emu) as a:
        a.socket.sendall(b"get\nsamplerate 20\nversion\nget\n")
        until(control, "rejected", 3)
        control.call("run", for_s=0.0012)
        data = a.read(16_000)
        a.socket.sendall(b"close\n")
        while logic(control)["running"]:
            pass
        assert a.ask("samplerate") == "8000000"
        assert b"ok" not in data


def test_a_client_that_vanishes_leaves_nothing_behind() -> None:
    with bench() as (emu, control):
        for _ in range(3):
            with Analyser(emu) as a:
                a.socket.sendall(b"get\n")
                until(control, "running", 1)
            while logic(control)["clients"]:
                pass
        counters = logic(control)
        assert (counters["captures"], counters["running"]) == (3, 0)
        assert control.call("run", for_s=0.01).result == {}


def test_any_bytes_are_answered_in_lines_or_cut_off() -> None:
    rows = [
        (b"\xff\x00\x01\n", b"line: expected up to 80 printable characters\n"),
        (b"x" * 100_000 + b"\nversion\n", b"line: expected up to 80 printable characters\nBeagleLogic 1.0\n"),
        (b"samplerate 5\n", b'samplerate: expected an integer from 10 to 100000000, got "5"\n'),
        (b"POST / HTTP/1.1\r\n\r\nget\n", b""),
        (b"\x16\x03\x01\x00\xc8\x01", b""),
    ]
    with bench() as (emu, control):
        for sent, answer in rows:
            with Analyser(emu) as a:
                a.socket.sendall(sent)
                got = a.read(len(answer)) if answer else a.socket.recv(100)
                assert got == answer
        assert logic(control)["captures"] == 0


def test_too_many_clients_are_turned_away() -> None:
    with bench() as (emu, control):
        clients = [Analyser(emu) for _ in range(8)]
        until(control, "clients", 8)
        with Analyser(emu) as a:
            assert a.socket.recv(1) == b""
        for c in clients:
            c.socket.close()
        while logic(control)["clients"]:
            pass
        with Analyser(emu) as a:
            assert a.ask("version") == "BeagleLogic 1.0"


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("ipdbg", r'--logic: expected beaglelogic\[:PORT\[:LINE,...\]\], got "ipdbg"'),
        ("beaglelogic:x", r"--logic: expected a port from 0 \(any free port\) to 65535, got"),
        ("beaglelogic:70000", r"--logic: expected a port from 0 \(any free port\) to 65535, got"),
        ("beaglelogic:0:Int,Nix", r'--logic: expected lines of the watched unit, a PSA-2: .*SYNC_A.*, got "Nix"'),
        ("beaglelogic:0:Int,", r'--logic: expected lines of the watched unit, .*, got ""'),
        ("beaglelogic:0:" + ",".join(["Int"] * 15), "--logic: expected up to 14 lines, got"),
    ],
)
def test_options_are_checked(option: str, message: str) -> None:
    with pytest.raises(BadInput, match=message), Emulator(cans=["none"], extra=["--logic", option]):
        pass


def test_wide_boards_choose_their_lines() -> None:
    extra = ["--logic", "beaglelogic:0", "--logic", "beaglelogic:0:AB0,D15,A0"]
    with Emulator(ROOT / "tests/golden/psd1.yaml", cans=["none"], extra=extra) as emu:
        first, second = (e["lines"].split(",") for e in emu.endpoints if "logic" in e)
        assert len(first) == 14
        assert second == ["AB0", "D15", "A0"]
