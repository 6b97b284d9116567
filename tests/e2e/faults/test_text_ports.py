"""Every text port against HTTP and TLS, garbage, silence, a line of a megabyte, too many clients.

A web page can make a browser send its bytes to any port of this machine. Nothing of them may be obeyed.
"""

from __future__ import annotations

import http.client
import json
import os
import random
import resource
import select
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

import pytest
from psabench.emulator import Emulator
from psabench.link.control import Control
from psabench.places import find_emulator
from rig import HOST, ROOT, SEED, TIMEOUT_S, one_line, until

pytestmark = HOST

PORTS = ["socketcand", "scpi", "control", "truth"]
CANS = ["socketcand:0", "slcan"]
EXTRA: list[str | Path] = ["--scpi", "head:0", "--quiet"]

# What each port would obey if it took the lines of a request's body.
ORDERS = {
    "socketcand": b"< open can0 >< rawmode >< send 123 1 5 >",
    "scpi": b"ANGLE 90\n",
    "control": b'{"id":1,"cmd":"head.turn","args":{"angle_deg":90}}\n',
    "truth": b'{"id":1,"cmd":"truth"}\n',
}
ANSWER_OF_GARBAGE = {
    "socketcand": b"expected an opening angle bracket",
    "scpi": b"",  # it is in the error queue
    "control": b'"code":"syntax"',
    "truth": b'"code":"syntax"',
}
# What Chromium 156 sends (recorded) for fetch("http://127.0.0.1:5025/", {method: "POST", mode: "no-cors", body: ...})
# on a page of another port, which needs no leave of the port's owner (Fetch, "simple request"); for the preflight of a
# PUT; for new WebSocket("ws://127.0.0.1:5025/ws").
AGENT = (
    b"User-Agent: Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 (KHTML, like Gecko) HeadlessChrome/156.0.0.0 "
    b"Safari/537.36\r\n"
)
LANGUAGES = b"Accept-Encoding: gzip, deflate, br, zstd\r\nAccept-Language: en-US,en;q=0.9\r\n"
BROWSER = {
    "fetch": b"POST / HTTP/1.1\r\nHost: 127.0.0.1:5025\r\nConnection: keep-alive\r\nContent-Length: %d\r\n"
    b'sec-ch-ua-platform: "Linux"\r\n' + AGENT + b'sec-ch-ua: "Not:A-Brand";v="8", "Chromium";v="156"\r\n'
    b"Content-Type: text/plain;charset=UTF-8\r\nsec-ch-ua-mobile: ?0\r\nAccept: */*\r\n"
    b"Origin: http://127.0.0.1:8123\r\nSec-Fetch-Site: same-site\r\nSec-Fetch-Mode: no-cors\r\n"
    b"Sec-Fetch-Dest: empty\r\nReferer: http://127.0.0.1:8123/\r\n" + LANGUAGES + b"\r\n%s",
    "preflight": b"OPTIONS /opt HTTP/1.1\r\nHost: 127.0.0.1:5025\r\nConnection: keep-alive\r\nAccept: */*\r\n"
    b"Access-Control-Request-Method: PUT\r\nOrigin: http://127.0.0.1:8123\r\n" + AGENT + b"Sec-Fetch-Mode: cors\r\n"
    b"Sec-Fetch-Site: same-site\r\nSec-Fetch-Dest: empty\r\nReferer: http://127.0.0.1:8123/\r\n" + LANGUAGES + b"\r\n",
    "WebSocket": b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:5025\r\nConnection: Upgrade\r\nPragma: no-cache\r\n"
    b"Cache-Control: no-cache\r\n" + AGENT + b"Upgrade: websocket\r\nOrigin: http://127.0.0.1:8123\r\n"
    b"Sec-WebSocket-Version: 13\r\n" + LANGUAGES + b"Sec-WebSocket-Key: fpGpoNWHsjMgOUsYSnqwFw==\r\n"
    b"Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\r\n",
}
TLS_HELLO = bytes.fromhex("16030100c8010000c40303") + bytes(60)


@pytest.fixture
def emulator() -> Iterator[Emulator]:
    with Emulator("calibrate", cans=CANS, pace="step", truth=True, extra=EXTRA) as e:
        yield e


def connect(emulator: Emulator, port: str) -> socket.socket:
    """A connection to a port, after what it greets with."""
    if port in ("control", "truth"):
        s = socket.socket(socket.AF_UNIX)
        s.connect(str(emulator.control_path if port == "control" else emulator.truth_path))
        s.settimeout(TIMEOUT_S)
        return s
    e = emulator.endpoint(can="socketcand") if port == "socketcand" else emulator.endpoint(scpi="head")
    s = socket.create_connection((e["host"], int(e["port"])), TIMEOUT_S)
    if port == "socketcand":
        assert s.recv(64) == b"< hi >"
    return s


def until_closed(s: socket.socket) -> bytes:
    """All that comes until the port hangs up."""
    got = b""
    try:
        while chunk := s.recv(65536):
            got += chunk
    except ConnectionResetError:  # it had not read all
        pass
    return got


def assert_untouched(emulator: Emulator) -> None:
    """Nothing was obeyed, and the ports serve whoever knows them."""
    assert emulator.control_path is not None
    with Control(emulator.control_path) as control:
        head = control.call("head.read").result
        assert (head["angle_deg"], head["at_rest"]) == (0.0, True), "it turns"
        assert control.call("frames").result["clients"] == []
    with closing(connect(emulator, "scpi")) as s:
        s.sendall(b"*IDN?\n")
        assert s.recv(200).count(b",") == 3
    with closing(connect(emulator, "socketcand")) as s:
        s.sendall(b"< open can0 >")
        assert s.recv(64) == b"< ok >"


# ---- HTTP and TLS


@pytest.mark.parametrize("port", PORTS)
@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "HEAD", "OPTIONS", "PATCH", "DELETE", "\r\nPOST", "FOO"])
def test_http_is_hung_up_on_and_not_obeyed(emulator: Emulator, port: str, method: str) -> None:
    with closing(connect(emulator, port)) as s:
        body = ORDERS[port]
        s.sendall(
            b"%s / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n" % (method.encode(), len(body)) + body
        )
        assert until_closed(s) == b""
    assert_untouched(emulator)
    said = one_line(emulator.messages(), "psa-emu")
    assert said.endswith("HTTP or TLS, as a web browser sends it: connection closed")


@pytest.mark.parametrize("port", PORTS)
@pytest.mark.parametrize("begin", [b"Host: 127.0.0.1\r\n", b"HOST: x\r\n", TLS_HELLO], ids=["Host", "HOST", "TLS"])
def test_so_are_a_header_and_a_handshake(emulator: Emulator, port: str, begin: bytes) -> None:
    with closing(connect(emulator, port)) as s:
        s.sendall(begin + ORDERS[port])
        assert until_closed(s) == b""
    assert_untouched(emulator)


@pytest.mark.parametrize("port", PORTS)
@pytest.mark.parametrize("kind", sorted(BROWSER))
@pytest.mark.parametrize("cut", [None, 1, 3])
def test_a_browser_s_request_is_not_obeyed_in_whatever_pieces_it_comes(
    emulator: Emulator, port: str, kind: str, cut: int | None
) -> None:
    body = ORDERS[port]
    request = BROWSER[kind] % (len(body), body) if b"%s" in BROWSER[kind] else BROWSER[kind] + body
    with closing(connect(emulator, port)) as s:
        if cut:
            s.sendall(request[:cut])
            assert select.select([s], [], [], 0.05)[0] == []  # it can be anything yet
            request = request[cut:]
        s.sendall(request)
        assert until_closed(s) == b""
    assert_untouched(emulator)


def test_a_browser_that_connects_in_a_loop_does_not_fill_the_log(emulator: Emulator) -> None:
    for _ in range(1010):
        with closing(connect(emulator, "scpi")) as s:
            s.sendall(b"GET / HTTP/1.1\r\n\r\n")
            assert until_closed(s) == b""
    lines = emulator.messages().splitlines()
    assert len(lines) == 1001
    assert lines[-1] == "psa-emu: links: further messages are suppressed"


@pytest.mark.parametrize("port", ["socketcand", "scpi"])
def test_a_client_of_http_hears_that_there_is_no_server(emulator: Emulator, port: str) -> None:
    e = emulator.endpoint(can="socketcand") if port == "socketcand" else emulator.endpoint(scpi="head")
    web = http.client.HTTPConnection(e["host"], int(e["port"]), timeout=TIMEOUT_S)
    web.request("POST", "/", ORDERS[port])
    with pytest.raises((http.client.HTTPException, ConnectionError)):
        web.getresponse()
    assert_untouched(emulator)


# ---- garbage, silence, a line without end


@pytest.mark.parametrize("port", PORTS)
def test_garbage_is_answered_by_the_port_s_own_error(emulator: Emulator, port: str) -> None:
    print(f"TEST_SEED={SEED}")
    rng = random.Random(SEED)
    end = b">" if port == "socketcand" else b"\n"
    with closing(connect(emulator, port)) as s:
        for _ in range(20):
            garbage = bytes(b for b in rng.randbytes(150) if b not in b"<>\n")
            s.sendall(b"~" + garbage + end)
            if port == "scpi":
                s.sendall(b"SYST:ERR?\n")
            got = s.recv(4096)
            assert ANSWER_OF_GARBAGE[port] in got
            got.decode()  # what is not text is not repeated
            assert port != "scpi" or int(got.split(b",")[0]) < 0
    assert_untouched(emulator)


@pytest.mark.parametrize("port", PORTS)
def test_a_line_of_a_megabyte_is_refused_and_the_next_one_is_taken(emulator: Emulator, port: str) -> None:
    line = b"x" * 1_000_000
    with closing(connect(emulator, port)) as s:
        if port == "socketcand":
            s.sendall(line + b">< echo >")
            got = b""
            while b"< echo >" not in got:
                got += s.recv(4096)
            assert b"message: expected at most 200 characters" in got
        elif port == "scpi":
            s.sendall(line + b"\nSYST:ERR?\n")
            assert int(s.recv(4096).split(b",")[0]) < 0
        else:
            s.sendall(line + b"\n" + b'{"id":"next","cmd":"help"}\n')
            got = b""
            while got.count(b"\n") < 2:
                got += s.recv(65536)
            first, second = (json.loads(answer) for answer in got.splitlines())
            assert first["error"]["code"] == "syntax"
            assert (second["id"], second["ok"]) == ("next", True)
    assert_untouched(emulator)


@pytest.mark.parametrize("port", PORTS)
def test_who_says_nothing_disturbs_no_one(emulator: Emulator, port: str) -> None:
    with closing(connect(emulator, port)) as silent:
        assert_untouched(emulator)
        assert select.select([silent], [], [], 0.0)[0] == []


@pytest.mark.parametrize("line", [b"\x00\x01nonsense", b"x" * 1_000_000], ids=["garbage", "a megabyte"])
def test_a_serial_port_answers_what_is_no_command_and_goes_on(emulator: Emulator, line: bytes) -> None:
    fd = os.open(emulator.endpoint(can="slcan")["pty"], os.O_RDWR | os.O_NOCTTY)
    try:
        left = line + b"\r"
        while left:
            left = left[os.write(fd, left[:4000]) :]
        assert os.read(fd, 100) == b"\a"
        os.write(fd, b"V\r")
        assert os.read(fd, 100).startswith(b"V")
    finally:
        os.close(fd)
    assert_untouched(emulator)


# ---- the control socket's own lines


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b'{"id":1,"cmd":"\xff\xfe"}', "expected a line of UTF-8"),
        (b'{"id":1,"cmd":"\xed\xa0\x80"}', "expected a line of UTF-8"),
        (b'{"id":1,"cmd":"\xc0\xaf"}', "expected a line of UTF-8"),
        (b'{"id":1,"cmd":"time"}\0 and more', "expected a line of UTF-8 without NUL"),
        (b'{"id":1,"cmd":"time\\u0000x"}', "expected a line of UTF-8 without NUL"),
        (b'{"id":9007199254740992,"cmd":"time"}', "id: expected numbers below 2^53 in it"),
        (b'{"id":' + b"9" * 400 + b',"cmd":"time"}', "id: expected numbers below 2^53 in it"),
        (b'{"id":-1e300,"cmd":"time"}', "id: expected numbers below 2^53 in it"),
        (b'{"id":[1,{"x":1e400}],"cmd":"time"}', "id: expected numbers below 2^53 in it"),
        ('{"id":1,"cmd":"a' + "я" * 200 + '"}', "unknown command"),  # cut in the message, within a character
    ],
)
def test_a_reply_is_json_in_utf_8_whatever_was_asked(emulator: Emulator, line: bytes | str, says: str) -> None:
    with closing(connect(emulator, "control")) as s:
        s.sendall((line.encode() if isinstance(line, str) else line) + b"\n")
        reply = json.loads(s.recv(65536).decode("utf-8"))
        assert reply["ok"] is False
        assert says in reply["error"]["text"]
        assert reply["id"] in (None, 1)


@pytest.mark.parametrize("number", [0, 1 - 2**53, 2**53 - 1, 1.5])
def test_an_id_comes_back_as_it_was(emulator: Emulator, number: float) -> None:
    with closing(connect(emulator, "control")) as s:
        s.sendall(json.dumps({"id": number, "cmd": "time"}).encode() + b"\n")
        assert json.loads(s.recv(65536))["id"] == number


# ---- too many, and nothing left to take them with


@pytest.mark.parametrize("port", PORTS)
def test_one_client_too_many_is_told_and_the_others_stay(emulator: Emulator, port: str) -> None:
    most = 32 if port == "socketcand" else 16
    with ExitStack() as stack:
        many = [stack.enter_context(closing(connect(emulator, port))) for _ in range(most)]
        if port == "socketcand":
            e = emulator.endpoint(can="socketcand")
            late = socket.create_connection((e["host"], int(e["port"])), TIMEOUT_S)
        else:
            late = connect(emulator, port)
        with closing(late):
            got = until_closed(late)
        if port == "socketcand":
            assert b"too many clients" in got
        elif port != "scpi":
            assert "expected up to 16 clients, got one more" in json.loads(got)["error"]["text"]
        until(lambda: emulator.messages().endswith("too many clients: connection closed\n"), "the notice")
        assert all(select.select([s], [], [], 0.0)[0] == [] for s in many)
    until(lambda: _serves(emulator, port), "room for a client")


def _serves(emulator: Emulator, port: str) -> bool:
    try:
        with closing(connect(emulator, port)) as s:
            return select.select([s], [], [], 0.05)[0] == []
    except (AssertionError, OSError):
        return False


def test_a_hundred_connections_at_once_wait_for_their_turn(tmp_path: Path) -> None:
    """They come while the loop is busy with a run: the queue of the socket holds them."""
    with Emulator("calibrate", cans=["none"], pace="step", extra=["--quiet"]) as emulator:
        assert emulator.pid is not None
        os.kill(emulator.pid, signal.SIGSTOP)
        try:
            with ExitStack() as stack:
                for _ in range(100):
                    s = stack.enter_context(closing(socket.socket(socket.AF_UNIX)))
                    s.setblocking(False)
                    s.connect(str(emulator.control_path))
        finally:
            os.kill(emulator.pid, signal.SIGCONT)
        assert_time(emulator)


def assert_time(emulator: Emulator) -> None:
    assert emulator.control_path is not None
    with Control(emulator.control_path) as control:
        assert control.call("time").result["pace"] == "step"


def test_without_descriptors_connections_are_refused_once_said_and_the_loop_sleeps(tmp_path: Path) -> None:
    control = tmp_path / "control"
    ports_of = ["--can", "socketcand:0", "--scpi", "head:0", "--control", str(control)]
    argv = [str(find_emulator()), "calibrate", *ports_of, "--pace", "step", "--until-eof", "--quiet"]

    def few() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (20, 20))

    pipe = subprocess.PIPE
    with subprocess.Popen(argv, stdin=pipe, stdout=pipe, stderr=pipe, text=True, cwd=ROOT, preexec_fn=few) as run:
        assert run.stdout is not None
        ports = [int(line.split("port=")[1]) for line in iter(run.stdout.readline, "ready all\n") if "port=" in line]
        held = Path(f"/proc/{run.pid}/fd")
        idle = len(list(held.iterdir()))
        with ExitStack() as stack:
            taken = 0
            for _ in range(30):
                s = stack.enter_context(closing(socket.create_connection(("127.0.0.1", ports[1]), TIMEOUT_S)))
                s.sendall(b"*IDN?\n")
                with suppress(ConnectionResetError):
                    taken += bool(s.recv(100))
            assert 0 < taken < 20
            before = cpu_s(run.pid)
            late = stack.enter_context(closing(socket.create_connection(("127.0.0.1", ports[1]), TIMEOUT_S)))
            assert until_closed(late) == b""
            assert select.select([late], [], [], 0.5)[0] == [late]
            assert cpu_s(run.pid) - before < 0.1, "it turns in circles"
        until(lambda: len(list(held.iterdir())) == idle, "descriptors of the connections that have ended are free")
        with Control(control) as c:  # there is room again
            assert c.call("time").result["t_s"] == 0.0
        _, err = run.communicate(timeout=TIMEOUT_S)
    said = [line for line in err.splitlines() if "no file descriptor is left (ulimit -n)" in line]
    assert len(said) == 1, err
    assert run.returncode == 0


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


# ---- readers that do not read


@contextmanager
def streaming(pace: str) -> Iterator[Emulator]:
    with Emulator("stream", cans=["socketcand:0"], pace=pace, extra=["--quiet", "--wait-client"]) as emulator:
        yield emulator


def test_a_reader_that_keeps_free_pace_waiting_is_named_once() -> None:
    with streaming("free") as emulator, closing(connect(emulator, "socketcand")) as s:
        port = s.getsockname()[1]
        for word in (b"< open can0 >", b"< rawmode >"):
            s.sendall(word)
            assert s.recv(64) == b"< ok >"
        words = f"socketcand client 127.0.0.1:{port}: does not read; simulated time waits for it"
        until(lambda: words in emulator.messages(), "the reader to be named")
        first = emulator.messages()
        for _ in range(3):  # it reads a little, and stops again
            left = 3_000_000
            while left > 0:
                left -= len(s.recv(65536))
        assert select.select([], [], [], 2.5) == ([], [], [])
        assert emulator.messages() == first


def test_a_reader_that_keeps_a_run_of_step_pace_waiting_is_named_too() -> None:
    """Its output may be far below what makes time stand still: the run is over when that has been taken."""
    with (
        Emulator("stream", cans=["socketcand:0"], pace="step", extra=["--quiet"]) as emulator,
        closing(socket.socket()) as s,
    ):
        s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        s.connect(("127.0.0.1", int(emulator.endpoint(can="socketcand")["port"])))
        for word in (b"< open can0 >", b"< rawmode >"):
            assert s.recv(64)
            s.sendall(word)
        assert s.recv(64) == b"< ok >"
        assert emulator.control_path is not None
        with closing(connect(emulator, "control")) as control:
            control.sendall(b'{"id":1,"cmd":"run","args":{"for_s":8}}\n')
            until(lambda: "does not read; simulated time waits for it" in emulator.messages(), "it to be named")
            while control not in (there := select.select([control, s], [], [], TIMEOUT_S)[0]):
                assert there
                s.recv(65536)
            assert json.loads(control.recv(65536))["ok"] is True


def test_a_flood_does_not_keep_a_signal_away(tmp_path: Path) -> None:
    """ppoll() takes no signal while a descriptor is ready each time."""
    with Path("/dev/zero").open("rb") as zero:
        argv = [str(find_emulator()), "calibrate", "--can", "none", "--until-eof", "--pace", "wall", "--quiet"]
        with subprocess.Popen(argv, stdin=zero, stdout=subprocess.PIPE, text=True, cwd=ROOT) as run:
            assert run.stdout is not None
            assert run.stdout.readline() == "ready all\n"
            try:
                run.send_signal(signal.SIGINT)
                assert run.wait(TIMEOUT_S) == 130
            finally:
                run.kill()
