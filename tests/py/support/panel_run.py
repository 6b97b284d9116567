"""A panel that runs, and a page's end of its WebSocket without a browser."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from socket import SO_RCVBUF, SOL_SOCKET
from socket import socket as TcpSocket
from typing import Any

from websockets.sync.client import ClientConnection, connect

WAIT_S = 30.0


@dataclass(slots=True)
class Running:
    """A panel: its process, address, and what it has said on standard error when it has ended."""

    process: subprocess.Popen[str]
    address: str
    said: str = ""

    @property
    def port(self) -> int:
        found = re.search(r":(\d+)/", self.address)
        assert found is not None
        return int(found[1])

    @property
    def token(self) -> str:
        return self.address.partition("token=")[2]

    @property
    def cookie(self) -> str:
        return f"psabench_panel_{self.port}={self.token}"

    def http(self, path: str, method: str = "GET", **headers: str) -> HTTPResponse:
        """One request; headers as Host="..." override the true ones."""
        connection = HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        connection.putrequest(method, path, skip_host="Host" in headers, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        return connection.getresponse()

    def sleeping_socket(self) -> ClientConnection:
        """Of a page that does not read: as little as possible waits on its side."""
        end = TcpSocket()
        end.setsockopt(SOL_SOCKET, SO_RCVBUF, 4096)
        end.connect(("127.0.0.1", self.port))
        return self._opened({}, sock=end, max_queue=1)

    def socket(self, **headers: str) -> ClientConnection:
        """A WebSocket as the page opens it, unless headers say otherwise."""
        return self._opened(headers)

    def _opened(self, headers: dict[str, str], **how: Any) -> ClientConnection:
        own = {"Cookie": self.cookie, "Origin": f"http://127.0.0.1:{self.port}"} | headers
        opened: ClientConnection = connect(
            f"ws://127.0.0.1:{self.port}/ws",
            additional_headers={k: v for k, v in own.items() if v},
            open_timeout=WAIT_S,
            close_timeout=0.2,  # a client that does not read never sees the answer to its close
            max_size=None,
            proxy=None,
            **how,
        )
        return opened

    def end(self) -> str:
        """Ctrl-C; returns standard error."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            self.said = self.process.communicate(timeout=WAIT_S)[1]
        return self.said


@contextmanager
def running(*options: str | Path) -> Iterator[Running]:
    """psabench panel with these options."""
    command = [sys.executable, "-m", "psabench.cli", "panel", *map(str, options)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as process:  # type: ignore[call-overload]
        try:
            assert process.stdout is not None
            words = process.stdout.readline().split()
            assert words[:1] == ["ready"], process.communicate(timeout=WAIT_S)
            panel = Running(process, words[1])
            yield panel
            panel.end()
        finally:  # of a test that fails, too: killed at once, a panel leaves its forks
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(5.0)
            process.kill()


def command(*words: str) -> int:
    """Exit status of psabench with these words."""
    return subprocess.run([sys.executable, "-m", "psabench.cli", *words], capture_output=True, check=False).returncode


def received(socket: ClientConnection, kind: str) -> dict[str, Any]:
    """The next message of a kind."""
    while True:
        message: dict[str, Any] = json.loads(socket.recv(timeout=WAIT_S))
        if message.get("kind") == kind:
            return message


def asked(socket: ClientConnection, number: int, **request: object) -> dict[str, Any]:
    """The answer to a request."""
    socket.send(json.dumps({"id": number, **request}))
    while True:
        message: dict[str, Any] = json.loads(socket.recv(timeout=WAIT_S))
        if message.get("id") == number:
            return message


def said(socket: ClientConnection, number: int, line: str) -> dict[str, Any]:
    """The answer to a line of the shell."""
    return asked(socket, number, do="line", line=line)


def children(pid: int) -> list[int]:
    """Processes that any thread of this one has started."""
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(word) for path in lists for word in path.read_text().split()]


def assert_refuses(recording: Path, out: Path) -> None:
    """A recording that cannot be read ends the command with one line that names it, and status 2."""
    words = [sys.executable, "-m", "psabench.cli", "panel", "--recording", str(recording), "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=WAIT_S)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert str(recording) in done.stderr
