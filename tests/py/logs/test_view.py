"""The live view as a Foxglove client sees it: schemas, values, a slow reader, hostile bytes, Ctrl-C."""

from __future__ import annotations

import json
import re
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.emulator import Emulator
from psabench.errors import LinkError
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

PROTOCOL = Subprotocol("foxglove.sdk.v1")
WAIT_S = 20.0


@contextmanager
def viewed(*options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """An emulated PSA-2 that streams, its view, and the address of that."""
    with Emulator(cans=["socketcand:0"], pace="wall", seed=1, control=False, extra=["--start"]) as emu:
        can = next(e for e in emu.endpoints if "port" in e)
        command = [sys.executable, "-m", "psabench.cli", "view", "--port", "0"]
        command += ["--can", f"socketcand:{can['host']}:{can['port']}", *options]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        with subprocess.Popen(command, **pipes) as process:  # type: ignore[call-overload]
            try:
                assert process.stdout is not None
                word, address = process.stdout.readline().split()
                assert word == "ready"
                yield process, address
            finally:
                process.kill()


def client_of(address: str) -> ClientConnection:
    """close_timeout: of a peer that never reads, or that the server has dropped, no one waits for the last words."""
    return connect(address, subprotocols=[PROTOCOL], close_timeout=0.2)


def channels(client: ClientConnection, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Waits until the topics are advertised."""
    found: dict[str, dict[str, Any]] = {}
    while not wanted <= set(found):
        text = client.recv(timeout=WAIT_S)
        if isinstance(text, str) and (words := json.loads(text))["op"] == "advertise":
            found |= {c["topic"]: c for c in words["channels"]}
    return found


def subscribe(client: ClientConnection, *ids: int) -> None:
    pairs = [{"id": n, "channelId": channel} for n, channel in enumerate(ids)]
    client.send(json.dumps({"op": "subscribe", "subscriptions": pairs}))


def messages(client: ClientConnection, *ids: int) -> Iterator[tuple[int, int, bytes]]:
    """Subscription, time in ns, payload. Fails when the server rejects one."""
    subscribe(client, *ids)
    while True:
        data = client.recv(timeout=WAIT_S)
        assert not (isinstance(data, str) and json.loads(data)["op"] == "status"), data
        if isinstance(data, bytes) and data[0] == 1:
            subscription, t_ns = struct.unpack_from("<IQ", data, 1)
            yield subscription, t_ns, data[13:]


def end(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=WAIT_S)
    return process.returncode, out, err


def test_a_client_gets_schemas_and_values_and_ctrl_c_ends_it() -> None:
    topics = ("/can_raw", "/node5/PSA2_XY", "/node5/imu", "/view")
    with viewed("--v-per-g", "2") as (process, address):
        with client_of(address) as early:  # the SDK advertises a new channel a moment before it can be subscribed to
            channels(early, set(topics))
        with client_of(address) as client:  # on connection it advertises those that can be
            found = channels(client, set(topics))
            assert json.loads(found["/node5/PSA2_XY"]["schema"])["properties"]["X_V"]["type"] == "number"
            assert (found["/node5/imu"]["encoding"], found["/node5/imu"]["schemaName"]) == (
                "cdr",
                "sensor_msgs/msg/Imu",
            )
            got: dict[int, bytes] = {}
            for subscription, _, data in messages(client, *(found[t]["id"] for t in topics)):
                got[subscription] = data
                if len(got) == len(topics):
                    break
        raw, xy, imu, counters = (got[n] for n in range(len(topics)))
        assert len(json.loads(raw)["data"]) == 16
        x_v = json.loads(xy)["X_V"]
        assert 2.4 < x_v < 2.6
        x_mps2 = struct.unpack_from("<d", imu, len(imu) - 12 * 8)[0]  # three axes, nine covariances
        assert x_mps2 == pytest.approx(x_v / 2 * 9.80665, abs=0.1)
        assert json.loads(counters)["frames"] >= json.loads(counters)["decoded"] > 0
        status, out, err = end(process)
        assert (status, err) == (0, "")
        assert re.fullmatch(r"(\d+) frames, \1 decoded; 0 warnings about clients\n", out)
        host, _, port = address.removeprefix("ws://").partition(":")
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((host, int(port)), timeout=WAIT_S)


def test_hostile_bytes_and_vanished_and_slow_readers_disturb_no_one() -> None:
    with ExitStack() as peers:
        process, address = peers.enter_context(viewed())
        good = peers.enter_context(client_of(address))
        host, _, port = address.removeprefix("ws://").partition(":")
        found = channels(good, {"/can_raw", "/view"})
        slow = peers.enter_context(client_of(address))
        subscribe(slow, found["/can_raw"]["id"])  # and never reads
        for junk in (b"\0" * 4096, b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 100_000):
            with socket.create_connection((host, int(port))) as peer, suppress(ConnectionError):
                peer.sendall(junk)
        texts = ("", "{", "[]", '{"op":"subscribe"}', '{"op":"subscribe","subscriptions":[{"id":-1}]}', "x" * 70_000)
        for hostile in (*texts, b"", b"\x01", b"\xff" * 1000):
            with client_of(address) as peer_client:
                peer_client.send(hostile)
        received, counted = 0, list[int]()
        for subscription, _, data in messages(good, found["/can_raw"]["id"], found["/view"]["id"]):
            received += subscription == 0
            if subscription == 1:
                counted.append(json.loads(data)["frames"])
            if len(counted) == 4:
                break
        assert received >= counted[-1] - counted[0] > 300  # nothing was lost between the first and the last
        status, out, err = end(process)
        assert (status, err) == (0, "")
        warned = re.search(r"; (\d+) warnings about clients$", out)
        assert warned is not None
        assert int(warned[1]) >= 6


@pytest.mark.parametrize(
    "line", ["view --can virtual:x --port PORT", "panel --port PORT", "mavlink --log run.log --mavlink tcp:PORT"]
)
def test_a_port_in_use_is_a_failed_link_in_every_command(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.log").write_text("(0.1) can0 185#0000000000000000\n")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert cli.main(line.replace("PORT", port).split()) == LinkError.exit_status == 3
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert re.match(rf"psabench: --(port|mavlink): expected a free port of 127.0.0.1.*, got {port}\b", err)


@pytest.mark.parametrize("port", ["-1", "65536", "x"])
def test_a_port_is_checked(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["view", f"--port={port}"]) == 2
    assert "expected a TCP port" in capsys.readouterr().err
