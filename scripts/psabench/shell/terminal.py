"""The shell in a terminal: prompt, completion, history, status bar, modes. The only file that imports prompt_toolkit.

One thread. The status bar looks at the bench while a line is being edited and between slices of a wait; a command that
runs has the bench to itself. Ctrl-C ends the command (or drops the line), Ctrl-D leaves a raw mode, then the shell.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from prompt_toolkit import PromptSession
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.buffer import Buffer
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import FileHistory, History
from prompt_toolkit.input import Input
from prompt_toolkit.output import Output
from prompt_toolkit.shortcuts import CompleteStyle

from psabench.errors import BenchError, expected
from psabench.places import no_package
from psabench.shell.complete import argument, candidates
from psabench.shell.grammar import describe
from psabench.shell.lexer import Wrong
from psabench.shell.session import Session
from psabench.shell.status import EVERY_S, Watch

GREETING = "Tab completes, help lists, Ctrl-D leaves. {bench}."
MAIN = "psa"
ERASE = "\x1b[K"  # to the end of the line
KEYBOARD = {"exit", "can", "scpi", "python"}  # what only somebody at a keyboard may say
KEYBOARD_HELP = """\
at the keyboard
  can               mode can>: frames as ID#DATA; an empty line listens for 20 ms
  scpi INSTRUMENT   mode scpi>: lines to one instrument
  python            IPython with bench and dut; Ctrl-D comes back
  exit, Ctrl-D      leaves a mode, then the shell"""


def history_path() -> Path:
    """Where lines are kept between sessions."""
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state")
    return state / "psabench" / "shell_history"


class ShellCompleter(Completer):
    """Candidates of `complete` as prompt_toolkit's."""

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal

    def get_completions(self, document: Document, event: CompleteEvent) -> Iterable[Completion]:
        before = self._terminal.as_line(document.text_before_cursor)
        for c in candidates(before, self._terminal.session.vocabulary) if self._terminal.mode == MAIN else ():
            yield Completion(c.text, start_position=-c.typed, display_meta=c.about)


class Terminal:
    """`Terminal(session).run()`; input and output are the terminal's unless given (tests give a pipe)."""

    def __init__(
        self,
        session: Session,
        *,
        history: History | None = None,
        input: Input | None = None,
        output: Output | None = None,
    ) -> None:
        self.session = session
        self.mode = MAIN  # "psa", "can" or the name of an instrument
        self._watch = Watch(session.bench, session.now_ns)
        self._waiting = False  # a status line is below a command that runs
        self._prompting = False  # prompt_toolkit's event loop runs
        self._left: int | None = None  # exit status after leave()
        session.tick = self._tick
        self._prompt: PromptSession[str] = PromptSession(
            history=history or _file_history(),
            auto_suggest=AutoSuggestFromHistory(),
            completer=ShellCompleter(self),
            complete_while_typing=True,
            complete_style=CompleteStyle.COLUMN,
            bottom_toolbar=self._bar,
            refresh_interval=EVERY_S,
            reserve_space_for_menu=6,
            input=input,
            output=output,
        )

    def run(self) -> int:
        """Until Ctrl-D, exit or leave(); returns the exit status."""
        self._print(GREETING.format(bench=self._about()))
        while self._left is None:
            try:
                line = self._ask()
            except KeyboardInterrupt:
                continue
            except EOFError:
                if self.mode == MAIN:
                    break
                self.mode = MAIN
                continue
            if self._left is not None or (line.strip() == "exit" and self.mode == MAIN):
                break
            self._one(line)
        return self._left or 0

    def leave(self, status: int) -> None:
        """For handlers of signals: run() returns this status, a command under way ends with SystemExit.

        Nothing is raised within prompt_toolkit's event loop: it may swallow the exception and hang.
        """
        self._left = status
        if not self._prompting:
            sys.exit(status)
        if self._prompt.app.is_running and self._prompt.app.loop:
            self._prompt.app.loop.call_soon_threadsafe(self._end_prompt)

    def _ask(self) -> str:
        self._prompting = True
        try:
            return self._prompt.prompt(self._prompt_text(), pre_run=self._end_prompt)
        finally:
            self._prompting = False

    def _end_prompt(self) -> None:
        """End the prompt after leave(); pre_run calls it when the signal came before the event loop."""
        app = self._prompt.app
        if self._left is not None and app.is_running and not app.is_done:
            app.exit(exception=EOFError())

    @property
    def buffer(self) -> Buffer:
        """The line that is being edited."""
        return self._prompt.default_buffer

    def as_line(self, typed: str) -> str:
        """What is typed in this mode as a line of the shell."""
        if self.mode == "can":
            return f"can.send {typed.strip()}" if typed.strip() else "can.listen"
        if self.mode != MAIN:
            return f"scpi.send {self.mode} {typed.strip()}" if typed.strip() else ""
        return typed

    def _one(self, line: str) -> None:
        """Carry out what was typed and tell what came of it."""
        try:
            if not self._keyboard(line.split()):
                self._tell(self.as_line(line))
        except Wrong as e:
            mark = f"{' ' * (len(self._prompt_text()) + e.column - 1)}^\n" if self.mode == MAIN else ""
            self._print(f"{mark}{e}")
        except BenchError as e:
            self._print(str(e))
        except KeyboardInterrupt:
            self._print("interrupted")
        finally:
            self._clear_tick()

    def _tell(self, line: str) -> None:
        outcome = self.session.do(line)
        self._clear_tick()
        if outcome is None:
            return
        if text := outcome.text:
            self._print(text)
        if outcome.call.command.name == "help" and not outcome.call.args:
            self._print(KEYBOARD_HELP)

    def _keyboard(self, words: list[str]) -> bool:
        """Modes, and what only makes sense with somebody at the keyboard; False if the line is none of that."""
        if words == ["exit"]:
            self.mode = MAIN
        elif self.mode != MAIN or not words or words[0] not in KEYBOARD:
            return False
        elif words == ["python"]:
            self._python()
        elif words == ["can"] and "can.send" in self.session.vocabulary.commands:
            self.mode = "can"
        elif words[0] == "scpi" and "scpi.send" in self.session.vocabulary.commands:
            self._enter_scpi(words[1:])
        else:
            absent = self.session.vocabulary.absent.get(words[0])
            why = f"{words[0]} takes no argument" if absent is None else f"{words[0]}: not available: {absent}"
            raise Wrong(why)
        return True

    def _enter_scpi(self, words: list[str]) -> None:
        there = self.session.bench.addresses
        if len(words) != 1 or words[0] not in there:
            raise Wrong(expected(", ".join(there), " ".join(words) or "none", "scpi"), 6)
        self.mode = words[0]

    def _python(self) -> None:
        """The bench itself, in Python: what is done there is not in the transcript."""
        try:
            import IPython
            from traitlets.config import Config
        except ImportError as e:
            raise no_package(e, "python") from e

        config = Config()
        config.TerminalInteractiveShell.banner1 = "bench: psabench.Bench; dut: Psa2. Not in the transcript.\n"
        config.TerminalInteractiveShell.confirm_exit = False
        names: dict[str, Any] = {"bench": self.session.bench}
        if self.session.bench.units:
            names["dut"] = self.session.dut
        IPython.start_ipython(argv=[], user_ns=names, config=config)

    # ---- what is seen

    def _prompt_text(self) -> str:
        if self.mode in (MAIN, "can"):
            return f"{self.mode}> "
        return f"scpi {self.mode}> "

    def _about(self) -> str:
        names = ", ".join(self.session.bench.units) or "none on a bus"
        pace = self.session.bench.pace
        return f"units: {names}; " + ("a real bench" if pace == "real" else f"pace {pace}")

    def _bar(self) -> str:
        status = self._watch.text()
        typed = self.buffer.document.text_before_cursor
        found = argument(typed, self.session.vocabulary) if self.mode == MAIN else None
        if found is None:
            return status
        command, arg = found
        return f"{status}\n{command.usage}" + (f"   {arg.name}: {describe(arg)}" if arg else f"   {command.what}")

    def _tick(self) -> None:
        """While time passes inside a command: the status in the line below."""
        output = self._prompt.output
        output.write_raw(f"\r{ERASE}{self._watch.text()[: output.get_size().columns - 1]}")
        output.flush()
        self._waiting = True

    def _clear_tick(self) -> None:
        if self._waiting:
            self._prompt.output.write_raw(f"\r{ERASE}")
            self._prompt.output.flush()
            self._waiting = False

    def _print(self, text: str) -> None:
        print(text, flush=True)


def _file_history() -> FileHistory:
    path = history_path()
    path.parent.mkdir(parents=True, exist_ok=True)
    return FileHistory(str(path))
