"""The results channel takes any bytes; what was on the bus is read by rules of the protocol alone."""

from __future__ import annotations

import random

import pytest
from psabench.conform.host import results
from psabench.conform.host.capture import Bus, SentSample, read_log
from psabench.conform.host.check import HostCapture, match
from psabench.conform.host.results import Told
from psabench.conform.verdict import Failed

FRAME = b'{"frame": 7, "x": 1, "y": -2, "z": 3, "t": 4, "channel": 1, "t_us": 6000.5, "v": [1, 2.5, 3]}\n'


def test_what_can_be_told() -> None:
    told = results.read(
        [b"\n", FRAME, b'{"lost": 2}\n', b'{"note": [1]}\n', b'{"over_range": "x"}\n', b'{"end": true}']
    )
    assert [(s.number, s.codes, s.channel, s.t_us, s.volts) for s in told.samples] == [
        (7, (1, -2, 3, 4), 1, 6000.5, (1.0, 2.5, 3.0))
    ]
    assert [(e.name, e.value, e.at) for e in told.events] == [("lost", 2, 1), ("over_range", "x", 1), ("end", True, 1)]
    assert (told.bad_lines, told.sum("lost"), told.places("end")) == (0, 2, [1])


@pytest.mark.parametrize(
    "line",
    [
        b"lost 2",
        b"[]",
        b"7",
        b"{}",
        b'{"lost": 0}',
        b'{"lost": true}',
        b'{"lost": 2, "torn": 1}',
        b'{"losst": 2}',
        b'{"over_range": "w"}',
        b'{"over_range": []}',
        b'{"stale": 1}',
        b'{"emcy": 65536}',
        b'{"wrong_setup": ""}',
        b'{"frame": 1}',
        b'{"frame": 1.5, "x": 1, "y": 1, "z": 1, "t": 1, "t_us": 0}',
        b'{"frame": 1, "x": 1, "y": 1, "z": 1, "t": 1, "t_us": NaN}',
        b'{"frame": 1, "x": 1, "y": 1, "z": 1, "t": 1, "t_us": null}',
        b'{"frame": 1, "x": 1, "y": 1, "z": 1, "t": 1, "t_us": 0, "v": [1, 2]}',
        b'{"frame": 1, "x": 1, "y": 1, "z": 1, "t": 1, "t_us": 0, "channel": "2"}',
        b'{"lost": 99999999999999999999999999}',
        b"\xff\xfe",
        b"[" * 400,
        b'{"note": "' + b"x" * 600 + b'"}',
    ],
)
def test_what_is_no_line_is_a_finding(line: bytes) -> None:
    told = results.read([line + b"\n", FRAME])
    assert (told.bad_lines, len(told.bad), len(told.samples), told.events) == (1, 1, 1, [])


def test_any_bytes_are_taken() -> None:
    rng = random.Random(7)
    pieces = [
        b'{"frame"',
        b": ",
        b"1",
        b", ",
        b'"x"',
        b"}",
        b"\n",
        b"\x00",
        b'{"lost": 1}\n',
        b"[",
        b"1e999",
        FRAME,
        b'"',
    ]
    for _ in range(300):
        text = b"".join(rng.choices(pieces, k=rng.randrange(40)))
        told = results.read(text.splitlines(keepends=True))
        assert len(told.bad) <= results.MOST_BAD


def test_bad_lines_are_counted_not_kept() -> None:
    assert len(results.read([b"?\n"] * 100).bad) == results.MOST_BAD


def log(*frames: tuple[float, str]) -> list[str]:
    return [f"({t:017.6f}) can0 {f}\n" for t, f in frames]


def pair(n: int, delay_s: float = 0.0, stamp_of: int | None = None) -> list[tuple[float, str]]:
    """Both halves of sample n, whose instant is n ms; stamp_of: the ZT of that one instead."""
    stamp = (n if stamp_of is None else stamp_of) * 250 % 65536
    t = n * 1e-3 + delay_s
    return [
        (t + 0.0002, f"185#0100000200{n % 251:02X}{(n % 65536).to_bytes(2, 'little').hex()}".upper()),
        (t + 0.0003, f"285#030000040021{stamp.to_bytes(2, 'little').hex()}".upper()),
    ]


def sent(*frames: tuple[float, str]) -> list[SentSample]:
    return read_log(log((0.0, "705#00"), (0.001, "000#0105"), *frames), 5).samples


def test_pairs_are_samples() -> None:
    found = sent(*pair(10), *pair(11), *pair(12, delay_s=0.03))
    assert [(p.seq, p.t_us, p.due, p.settled, p.channel) for p in found] == [
        (10, 10000, True, True, 2),
        (11, 11000, True, True, 2),
        (12, 12000, True, True, 2),
    ]
    assert found[0].codes == (1, 10 << 16 | 2, 3, 4)


def test_halves_of_two_samples_are_none() -> None:
    xy, _ = pair(11)
    _, zt = pair(12)
    assert [p.seq for p in sent(*pair(10), xy, zt, *pair(13))] == [10, 13]


def test_a_late_half_may_be_taken_and_need_not() -> None:
    (xy_t, xy), (_, zt) = pair(11)
    late = [(xy_t, xy), (0.0125, zt)]
    found = sent(*pair(10), late[0], *pair(12), (0.01235, zt), *pair(13))
    assert {p.seq: p.due for p in found} == {10: True, 11: False, 12: True, 13: True}


def test_what_comes_twice_is_one() -> None:
    xy, zt = pair(11)
    assert [(p.seq, p.due) for p in sent(*pair(10), xy, xy, zt, zt, *pair(12))] == [
        (10, True),
        (11, True),
        (12, True),
    ]


def test_a_restart_begins_anew() -> None:
    second = [(1.0, "705#00"), *[(t + 1.0, f) for t, f in pair(10)]]
    assert [(p.seq, p.epoch) for p in sent(*pair(10), *second)] == [(10, 0), (10, 1)]


def told_of(*numbers: int) -> Told:
    lines = [
        b'{"frame": %d, "x": %d, "y": %d, "z": 3, "t": 4, "channel": 2, "t_us": %d}\n' % (n, *p.codes[:2], n * 1000)
        for n, p in ((n, sent(*pair(n))[0]) for n in numbers)
    ]
    return results.read(lines)


def capture(told: Told) -> HostCapture:
    bus = read_log(log((0.001, "000#0105"), *pair(10), *pair(11), *pair(12)), 5)
    return HostCapture(case="", bus=bus, told=told)


def test_samples_are_held_against_what_was_played() -> None:
    assert len(capture(told_of(10, 11, 12)).samples().pairs) == 3
    for numbers in ((10, 12), (10, 11, 11, 12), (11, 10, 12), (10, 11, 12, 13), (), (10, 11)):
        with pytest.raises(Failed):
            capture(told_of(*numbers)).samples()


def test_other_codes_are_wrong() -> None:
    told = told_of(10, 11, 12)
    e = capture(told)
    told.samples[1] = results.Sample(number=11, codes=(9, 9, 9, 9), t_us=0.0)
    assert [s.number for s, _ in match(told.samples, e.bus.samples).wrong] == [11]
    with pytest.raises(Failed, match="11"):
        e.samples()


def test_silence_of_the_stage_is_no_alarm() -> None:
    e = capture(results.read([b'{"stale": true}\n']))
    with pytest.raises(Failed):
        e.nothing_but()
    e.stood_s = 0.2
    e.nothing_but()
    e.told.events.append(results.Event("torn", 1, 0))
    with pytest.raises(Failed):
        e.nothing_but()


def test_a_slow_machine_is_no_alarm() -> None:
    """Simulated time passes at a quarter of the wall's: a heartbeat every 4 s of the host's own clock."""
    e = capture(results.read([b'{"gone": true}\n']))
    with pytest.raises(Failed):
        e.nothing_but()
    e.clock = [(0.25 * t, t) for t in range(20)]
    assert (e.wall_s(1.1, 1.9), e.longest_s(1.0)) == (4.0, 4.0)
    e.nothing_but()
    e.clock = [(t / 3, t / 3) for t in range(20)]
    with pytest.raises(Failed):
        e.nothing_but()


def test_any_log_is_read() -> None:
    rng = random.Random(3)
    frames = [f for n in range(10, 40) for f in pair(n)]
    for _ in range(200):
        some = [(t, f[: rng.randrange(5, len(f) + 1) // 2 * 2]) if rng.random() < 0.05 else (t, f) for t, f in frames]
        rng.shuffle(some)
        assert isinstance(read_log(log((0.0, "000#0105"), *some), 5), Bus)
