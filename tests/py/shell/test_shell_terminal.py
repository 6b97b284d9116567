"""The interactive part through prompt_toolkit's pipe: keys in, what is printed out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from prompt_toolkit.buffer import Buffer
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document
from prompt_toolkit.history import InMemoryHistory
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput
from psabench.shell.session import Session
from psabench.shell.terminal import ShellCompleter, Terminal
from shell_bench import FakeBench, fake

CTRL_C, CTRL_D, TAB, ENTER = "\x03", "\x04", "\t", "\r"


@pytest.fixture
def pipe() -> Iterator[Any]:
    with create_pipe_input() as p:
        yield p


def session(pipe: Any, keys: str) -> tuple[FakeBench, Terminal]:
    """A whole session of these keys."""
    bench, it = fake()
    terminal = Terminal(Session(it), history=InMemoryHistory(), input=pipe, output=DummyOutput())
    pipe.send_text(keys)
    assert terminal.run() == 0
    return bench, terminal


def test_lines_are_carried_out_until_ctrl_d(pipe: Any, capsys: pytest.CaptureFixture[str]) -> None:
    bench, _ = session(pipe, f"head.turn 5{ENTER}head.read{ENTER}{CTRL_D}")
    out = capsys.readouterr().out.splitlines()
    assert out == [
        "Tab completes, help lists, Ctrl-D leaves. units: none on a bus; pace step.",
        "angle_deg  5",
        "angle_deg  5",
    ]
    assert bench.control.angle_deg == 5.0


def test_exit_leaves(pipe: Any) -> None:
    session(pipe, f"exit{ENTER}")


def test_tab_completes(pipe: Any) -> None:
    bench, it = fake()
    terminal = Terminal(Session(it), history=InMemoryHistory(), input=pipe, output=DummyOutput())

    def offered(buffer: Buffer) -> None:
        if buffer.text == "head.tu" and buffer.complete_state:
            pipe.send_text(TAB)

    def taken(buffer: Buffer) -> None:
        if buffer.text == "head.turn":
            pipe.send_text(f" 7{ENTER}{CTRL_D}")

    terminal.buffer.on_completions_changed += offered
    terminal.buffer.on_text_changed += taken
    pipe.send_text("head.tu")
    assert terminal.run() == 0
    assert bench.control.angle_deg == 7.0


def test_a_wrong_line_is_marked_where_it_is_wrong(pipe: Any, capsys: pytest.CaptureFixture[str]) -> None:
    session(pipe, f"head.turn 5V{ENTER}{CTRL_D}")
    mark, text = capsys.readouterr().out.splitlines()[1:]
    assert mark == " " * len("psa> head.turn ") + "^"
    assert text.startswith("angle_deg: unit: expected one of deg")


def test_a_refusal_does_not_end_the_shell(pipe: Any, capsys: pytest.CaptureFixture[str]) -> None:
    session(pipe, f"bench.counters{ENTER}head.read{ENTER}{CTRL_D}")
    assert capsys.readouterr().out.splitlines()[1:] == ["bench.counters: not now", "angle_deg  0"]


def test_ctrl_c_drops_the_line_or_ends_the_command_not_the_shell(pipe: Any, capsys: pytest.CaptureFixture[str]) -> None:
    bench, _ = session(pipe, f"head.turn 5{CTRL_C}probe.lines{ENTER}head.read{ENTER}{CTRL_D}")
    assert capsys.readouterr().out.splitlines()[1:] == ["interrupted", "angle_deg  0"]
    assert ("head.turn", {"angle_deg": 5.0}) not in bench.control.calls


def test_modes_that_the_bench_has_not_say_why(pipe: Any, capsys: pytest.CaptureFixture[str]) -> None:
    session(pipe, f"can{ENTER}scpi table{ENTER}{CTRL_D}")
    said = [line for line in capsys.readouterr().out.splitlines()[1:] if line.strip() != "^"]
    assert said[0].startswith("can: not available: it needs a bus")
    assert said[1].startswith("scpi: not available: no instrument has an address")


def test_what_is_typed_in_a_mode_is_a_line_of_the_shell(pipe: Any) -> None:
    _, terminal = session(pipe, CTRL_D)
    terminal.mode = "can"
    assert terminal.as_line(" 605#40 ") == "can.send 605#40"
    assert terminal.as_line("") == "can.listen"
    terminal.mode = "table"
    assert terminal.as_line("*IDN?") == "scpi.send table *IDN?"
    assert terminal.as_line(" ") == ""


def test_the_menu_tells_unit_and_range(pipe: Any) -> None:
    _, terminal = session(pipe, CTRL_D)
    (c,) = ShellCompleter(terminal).get_completions(Document("head.turn "), CompleteEvent())
    assert (c.text, c.display_meta_text) == ("angle_deg=", "on its scale, deg, -3600 to 3600")


def test_help_at_the_keyboard_names_its_modes(pipe: Any, capsys: pytest.CaptureFixture[str]) -> None:
    session(pipe, f"help{ENTER}{CTRL_D}")
    out = capsys.readouterr().out
    assert "the dividing head" in out
    assert "python            IPython" in out
