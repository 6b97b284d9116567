"""Bad lines on the ports: a coded refusal and a counter each, and nothing reaches the bus.

`make test` runs this file a second time against the emulator under AddressSanitizer and UBSan.
"""

from __future__ import annotations

import json
import os
import random
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest
from psabench.errors import ControlError
from rig import HOST, SEED, TIMEOUT_S, MakeRig, Rig, talker, until

# ---- the socketcand port


def ask(s: socket.socket, message: bytes, end: bytes = b"< echo >") -> bytes:
    """Send a message and then an echo request; everything that comes back up to the echo."""
    s.sendall(message + b"< echo >")
    got = b""
    while end not in got:
        chunk = s.recv(4096)
        assert chunk, f"the emulator hung up on {message!r}"
        got += chunk
    return got


@HOST
@pytest.mark.parametrize(
    ("message", "says"),
    [
        (b"nonsense >", "expected an opening angle bracket"),
        (b">", "expected an opening angle bracket"),
        (b"< >", "expected an opening angle bracket"),
        (b"< frobnicate >", "expected open, rawmode, send or echo"),
        (b"< bcmmode >", "mode: expected rawmode"),
        (b"< open can0 >", "a channel is already open"),
        (b"< rawmode >", "rawmode: already active"),
        (b"< send >", "arguments: expected"),
        (b"< send 1234 0 >", "identifier: expected"),
        (b"< send 800 0 >", "identifier: expected"),
        (b"< send 20000000 0 >", "identifier: expected"),
        (b"< send xyz 0 >", "identifier: expected"),
        (b"< send 123 9 1 2 3 4 5 6 7 8 9 >", "length: expected 0 to 8"),
        (b"< send 123 8 1 2 3 >", "data: expected as many bytes"),
        (b"< send 123 2 1 2 3 >", "data: expected as many bytes"),
        (b"< send 123 1 1ff >", "data: expected bytes"),
        (b"< send 123 1 g >", "data: expected bytes"),
        (b"< send 123 1 \x00 >", "data: expected bytes"),
        (b"< send 123 1 \xff\xfe >", "data: expected bytes"),
        (b"< send 123 8 " + b"1 " * 300 + b">", "message: expected at most 200"),
        (b"x" * 100_000 + b">", "message: expected at most 200"),
    ],
)
def test_a_bad_socketcand_message_is_answered_and_counted_and_does_not_reach_the_bus(
    make_rig: MakeRig, message: bytes, says: str
) -> None:
    rig = make_rig("socketcand")
    with talker(rig.emulator) as s:
        assert says in ask(s, message).decode()
        client = rig.clients()[1]
        assert (client["refused"], client["taken"]) == (1, 0)
        ask(s, b"< send 123 2 a ff >")
        assert rig.clients()[1]["taken"] == 1
    rig.unit.wait_ready()


@HOST
def test_a_message_cut_off_by_the_end_is_no_message(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", pace="wall")
    with talker(rig.emulator) as s:
        ask(s, b"")
        s.sendall(b"< send 123 2 a")
    until(lambda: len(rig.clients()) == 1, "the client to be gone")
    gone = rig.control.call("frames").result["gone"]
    assert (gone["taken"], gone["refused"]) == (0, 0)


@HOST
def test_words_before_the_handshake_are_refused(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand")
    with talker(rig.emulator, ()) as s:
        assert b"send: expected open" in ask(s, b"< send 123 0 >")
        assert b"rawmode: expected open" in ask(s, b"< rawmode >")
    rig.unit.wait_ready()


@HOST
def test_a_handshake_in_one_piece_is_taken_word_by_word(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand")
    with talker(rig.emulator, words=()) as s:
        got = ask(s, b"< open can0 >< rawmode >< rawmode >< send 7F0 1 1 >")
        assert got.startswith(b"< ok >< ok >< error ")
        assert got.count(b"< error ") == 1
        assert b"rawmode: already active" in got
        clients = rig.clients()
        assert len(clients) == 2
        assert clients[1]["taken"] == 1


@HOST
def test_garbage_on_every_port_leaves_the_unit_working(make_rig: MakeRig) -> None:
    print(f"TEST_SEED={SEED}")
    rng = random.Random(SEED)
    rig = make_rig("socketcand", extra=("--can", "slcan", "--line", "-"))
    with talker(rig.emulator) as s:
        ask(s, rng.randbytes(50_000).replace(b">", b"?") + b">")
        some = b"".join(rng.choice([b"<", b" ", b"send", b"123", b">", b"8", b"ff", b"\0", b"\n"]) for _ in range(5000))
        # Frames may have come about: what counts is that each end is answered.
        s.sendall(some + b"> < echo >")
        got = b""
        while b"< echo >" not in got:
            got += s.recv(65536)
    for endpoint in (rig.emulator.endpoint(can="slcan"), rig.emulator.endpoint(line="sampled")):
        fd = os.open(endpoint["pty"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        with suppress(BlockingIOError):  # no one must take it all
            os.write(fd, rng.randbytes(4000))
        os.close(fd)
    with socket.socket(socket.AF_UNIX) as c:
        c.connect(str(rig.emulator.control_path))
        c.sendall(rng.randbytes(20_000))
    rig.unit.wait_ready()
    assert len(rig.unit.stream(10)) == 10


# ---- the slcan port


@contextmanager
def serial(rig: Rig) -> Iterator[Any]:
    """The emulator's pty; say(bytes) -> answer up to and with CR or BEL."""
    fd = os.open(rig.emulator.endpoint(can="slcan")["pty"], os.O_RDWR | os.O_NOCTTY)

    def say(line: bytes) -> bytes:
        os.write(fd, line)
        got = b""
        while not got.endswith((b"\r", b"\a")):
            got += os.read(fd, 1)
        return got

    try:
        yield say
    finally:
        os.close(fd)


@HOST
@pytest.mark.parametrize(
    "line",
    [
        b"t1231\r",  # truncated payload must not be completed from an earlier line
        b"t12381122334455667\r",
        b"t1239112233445566778899\r",
        b"t12g0\r",
        b"t8000\r",
        b"T200000000\r",
        b"t123\r",
        b"t1232112233\r",
        b"b1239" + b"11" * 11 + b"\r",
        b"x\r",
        b"S9\r",
        b"S3\r",  # not the bus's bit rate
        b"Z1\r",  # while open
        b"\x00\r",
        b"\xff\xfe\r",
        b"t1238" + b"1" * 5000 + b"\r",
    ],
)
def test_a_bad_slcan_line_is_answered_by_bel_and_counted(make_rig: MakeRig, line: bytes) -> None:
    rig = make_rig("socketcand", extra=("--can", "slcan"))
    with serial(rig) as say:
        assert say(b"S8\r") == say(b"O\r") == b"\r"
        assert say(b"t12381122334455667788\r") == b"z\r"
        assert say(line) == b"\a"
        client = next(c for c in rig.clients() if c["adapter"] == "slcan")
        assert (client["taken"], client["refused"]) == (1, 1)
        assert say(b"t1230\r") == b"z\r"
        assert say(b"C\r") == b"\r"
        assert say(b"t1230\r") == b"\a"  # closed


@HOST
def test_a_channel_that_is_closed_twice_leaves_the_bus_when_its_frame_is_out(make_rig: MakeRig) -> None:
    """In step pace the frame waits for time, and the channel for the frame."""
    rig = make_rig("socketcand", extra=("--can", "slcan"))
    with serial(rig) as say:
        assert say(b"O\r") == b"\r"
        assert say(b"t1230\r") == b"z\r"
        assert say(b"C\r") == say(b"C\r") == b"\r"
        assert [c["adapter"] for c in rig.clients()] == ["socketcand", "slcan"]
        rig.host.advance(0.1)
        until(lambda: len(rig.clients()) == 1, "the channel to leave the bus")
    assert rig.control.call("frames").result["gone"]["taken"] == 1


@HOST
def test_frames_of_a_program_that_opens_again_before_they_are_out_stay_counted(make_rig: MakeRig) -> None:
    """In step pace they wait for time, and the next host's barrier counts all that were ever taken."""
    rig = make_rig("socketcand", extra=("--can", "slcan"))

    def taken() -> int:
        frames = rig.control.call("frames").result
        return sum(int(c["taken"]) for c in [*frames["clients"], frames["gone"]])

    before = taken()
    with serial(rig) as say:
        assert say(b"O\r") == b"\r"
        assert say(b"t1230\r") == b"z\r"
        assert say(b"C\r") == say(b"O\r") == b"\r"
        assert taken() == before + 1


@HOST
def test_a_line_begun_by_one_program_is_not_ended_by_the_next(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", pace="wall", extra=("--can", "slcan"))
    with serial(rig) as say:
        assert say(b"S8\r") == say(b"O\r") == b"\r"
        fd = os.open(rig.emulator.endpoint(can="slcan")["pty"], os.O_RDWR | os.O_NOCTTY)
        os.write(fd, b"t12381122")
        os.close(fd)
    until(lambda: all(c["adapter"] != "slcan" for c in rig.clients()), "the channel to be closed")
    with serial(rig) as say:
        assert say(b"S8\r") == b"\r"
        assert say(b"O\r") == b"\r"
        assert say(b"t1230\r") == b"z\r"


@HOST
def test_an_answer_that_one_program_has_not_read_is_not_for_the_next(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", pace="wall", extra=("--can", "slcan"))
    with serial(rig) as say:
        assert say(b"O\rN\r") == b"\r"
    until(lambda: all(c["adapter"] != "slcan" for c in rig.clients()), "the channel to be closed")
    with serial(rig) as say:
        assert say(b"V\r") == b"V1013\r"


# ---- the control socket


@HOST
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("nonsense", "syntax"),
        ("[]", "syntax"),
        ("{}", "syntax"),
        ('{"cmd": 7}', "syntax"),
        ('{"cmd": "time", "extra": 1}', "syntax"),
        ('{"cmd": "time"', "syntax"),
        ('{"cmd": "time", "args": []}', "syntax"),
        ('{"cmd": "fly"}', "command"),
        ('{"cmd": "truth"}', "command"),  # of the truth port alone
        ('{"cmd": "run"}', "argument"),
        ('{"cmd": "time", "args": {"for_s": 1}}', "argument"),
        ('{"cmd": "run", "args": {"for_s": "1"}}', "type"),
        ('{"cmd": "run", "args": {"for_s": -1}}', "range"),
        ('{"cmd": "run", "args": {"for_s": 1e99}}', "range"),
        ('{"cmd": "run", "args": {"for_s": 1, "after_tx": 0.5}}', "type"),
        ('{"cmd": "head.turn", "args": {"angle_deg": 1e9}}', "range"),
        ('{"cmd": "head.mount", "args": {"face": "up"}}', "range"),
        ('{"cmd": "counters", "args": {"unit": "q"}}', "range"),
        ('{"cmd": "vcd.flush"}', "state"),
        ('{"cmd": "' + "x" * 5000 + '"}', "syntax"),
        ("[" * 3000, "syntax"),
    ],
)
def test_a_bad_command_is_refused_by_code_and_changes_nothing(make_rig: MakeRig, line: str, code: str) -> None:
    rig = make_rig("socketcand")
    t_ns = rig.control.call("time").t_ns
    with socket.socket(socket.AF_UNIX) as s:
        s.settimeout(TIMEOUT_S)
        s.connect(str(rig.emulator.control_path))
        s.sendall(line.encode() + b"\n")
        reply = json.loads(s.makefile().readline())
    assert reply["ok"] is False
    assert reply["error"]["code"] == code
    assert len(reply["error"]["text"]) > 10
    assert rig.control.call("time").t_ns == t_ns
    assert rig.control.call("counters").result["control"]["refused"] == 1


@HOST
def test_time_is_not_moved_by_hand_in_real_time(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", pace="wall")
    with pytest.raises(ControlError, match="run requires --pace step") as refused:
        rig.control.call("run", for_s=1)
    assert refused.value.code == "state"


@HOST
def test_a_run_ends_with_the_program_that_asked_for_it(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand")
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(str(rig.emulator.control_path))
        s.sendall(b'{"id": 1, "cmd": "run", "args": {"for_s": 1, "after_tx": 1000000}}\n')  # which will never be sent
        until(lambda: rig.control.call("counters").result["control"]["commands"] > 2, "the command to be taken")
        with pytest.raises(ControlError, match="another run is in progress"):
            rig.control.call("run", for_s=1)

    def is_free() -> bool:
        try:
            rig.control.call("run", for_s=0)
        except ControlError:
            return False
        return True

    until(is_free, "the run to be given up")
    rig.unit.wait_ready()
