"""The host's end of the bus port against a stand-in: a pseudo-terminal that says what the test wants."""

from __future__ import annotations

import os
import pty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from psabench.errors import CycleRefused, LinkError
from psabench.link.busport import CODES, BusPort, Cycle, Who, parse


class Board:
    """The other end: `answer` makes of each line what comes back; asked for only when the bench's time passes."""

    def __init__(self, answer: Callable[[str], str]) -> None:
        self.master, self.slave = pty.openpty()
        os.set_blocking(self.master, False)
        self.answer = answer
        self.lines: list[str] = []
        self.passed_s = 0.0
        self._rest = ""

    def advance(self, dwell_s: float) -> None:
        self.passed_s += dwell_s
        try:
            self._rest += os.read(self.master, 4096).decode()
        except BlockingIOError:
            return
        *whole, self._rest = self._rest.split("\n")
        self.lines += whole
        os.write(self.master, "".join(self.answer(line) for line in whole).encode())


@contextmanager
def port(answer: Callable[[str], str]) -> Iterator[tuple[BusPort, Board]]:
    board = Board(answer)
    with BusPort(os.ttyname(board.slave), board.advance) as p:
        yield p, board
    os.close(board.master)
    os.close(board.slave)


def test_a_read_cycle() -> None:
    with port(lambda _: "R C 8001 t=2500000000\n") as (p, board):
        assert p.read(12) == Cycle(write=False, address=12, data=0x8001, t_s=2.5)
        assert board.lines == ["R C"]
        assert 0.0 < board.passed_s <= 0.01


def test_a_write_cycle_with_its_strobe() -> None:
    with port(lambda _: "W F A55A t=2000000000\n") as (p, board):
        assert p.write(15, 0xA55A, strobe_ns=1600) == Cycle(write=True, address=15, data=0xA55A, t_s=2.0)
        assert board.lines == ["W F A55A 1600"]


def test_who_is_there() -> None:
    with port(lambda _: "I psd1 0=X 1=Y F=FLAGS t=7\n") as (p, board):
        who = p.who()
        assert (who.board, who.names) == ("psd1", {0: "X", 1: "Y", 15: "FLAGS"})
        assert board.lines == ["?"]


def test_many_lines_on_their_way_are_answered_in_order() -> None:
    def answer(line: str) -> str:
        return f"R {line[2:]} 000{line[2:]} t=1\n"

    with port(answer) as (p, _):
        for k in range(5):
            p.ask(f"R {k}")
        answers = [p.answer() for _ in range(5)]
    assert [a.data for a in answers if isinstance(a, Cycle)] == [0, 1, 2, 3, 4]


def test_an_answer_in_pieces_is_put_together() -> None:
    with port(lambda _: "") as (p, board):
        p.ask("R 1")
        pieces = iter(["R 1", " 00", "FF t=", "9\r", "\n"])
        board.answer = lambda _: ""

        def drip(dwell_s: float) -> None:
            board.passed_s += dwell_s
            os.write(board.master, next(pieces).encode())

        p._advance = drip
        assert p.answer() == Cycle(write=False, address=1, data=0xFF, t_s=9 * 1e-9)


@pytest.mark.parametrize("code", CODES)
def test_a_refusal_of_the_board_has_the_code_it_has_over_can(code: str) -> None:
    with port(lambda _: f"E {code} R 0 t=100\n") as (p, _), pytest.raises(CycleRefused) as refused:
        p.read(0)
    assert refused.value.abort_code == CODES[code][0]
    assert CODES[code][1] in str(refused.value)


@pytest.mark.parametrize(
    "line", ["E syntax - - t=0", "E new-word R 0 t=0", "", "R 1", "R 1 12345 t=0", "ok", "I  t=", "R 1 00ZZ t=0"]
)
def test_what_is_no_answer_is_a_broken_link(line: str) -> None:
    with pytest.raises(LinkError):
        parse(line)


def test_a_line_without_an_end_is_no_bus_port() -> None:
    with port(lambda _: "x" * 3000) as (p, _):
        p.ask("R 0\nR 1\nR 2")
        with pytest.raises(LinkError, match="expected an end of line"):
            p.answer()


def test_the_page_has_each_code_with_the_one_over_can() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs/busport.md").read_text(encoding="utf-8")
    for code, (abort, _) in CODES.items():
        row = next(line for line in page.splitlines() if line.startswith("| ") and code in line.split("|")[1])
        assert f"{abort:08X}h" in row, code


def test_silence_is_told_with_the_timeout() -> None:
    with port(lambda _: "") as (p, board):
        p.ask("R 0")
        with pytest.raises(LinkError, match=r"no answer within 0.01 s"):
            p.answer(0.01)
        assert board.passed_s == pytest.approx(0.01)


def test_a_board_that_goes_is_a_broken_link() -> None:
    master, slave = pty.openpty()
    with BusPort(os.ttyname(slave)) as p:
        os.close(slave)
        os.close(master)
        with pytest.raises(LinkError, match="has gone"):
            p.answer(1.0)
    with pytest.raises(LinkError, match="closed"):
        p.answer(1.0)


def test_a_path_that_is_not_there_is_a_broken_link() -> None:
    with pytest.raises(LinkError, match="expected a bus port, got no such file"):
        BusPort("/nowhere/at/all")


def test_a_word_that_has_no_place_is_a_bad_argument() -> None:
    with port(lambda _: "") as (p, board), pytest.raises(ValueError, match="expected a 16-bit word"):
        p.write(0, 0x10000)
    assert board.lines == []


def test_an_answer_to_another_question_is_a_broken_link() -> None:
    with port(lambda _: "I psd1 0=X t=7\n") as (p, _), pytest.raises(LinkError, match="expected an answer to 'R 0'"):
        p.read(0)
    with port(lambda _: "R 0 0000 t=7\n") as (p, _), pytest.raises(LinkError, match="expected the board's name"):
        p.who()
    assert isinstance(parse("I psd1 t=7"), Who)
