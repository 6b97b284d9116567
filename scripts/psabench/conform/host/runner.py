"""Plays the cases to a host and has them checked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

from psabench.conform.host import check_can as can_checks
from psabench.conform.host import check_line as line_checks
from psabench.conform.host.capture import Bus, read_log
from psabench.conform.host.cases_can import CASES, NODE, Case
from psabench.conform.host.cases_line import LINE_CASES, LineCase, samples
from psabench.conform.host.cases_units import UNIT_CASES, load_checks
from psabench.conform.host.check import CaseCheck, HostCapture, case_checks
from psabench.conform.host.line_waves import form_of
from psabench.conform.host.stimulus import READY_S, ByHand, HostBench, Program, expand
from psabench.conform.host.stimulus_bus import BusBridge
from psabench.conform.host.stimulus_line import LinePort
from psabench.conform.profile import variant
from psabench.conform.verdict import Inconclusive, Outcome, decide, not_decided
from psabench.emulator import Emulator
from psabench.errors import BadInput, BenchError, StartError, expected
from psabench.link.control import Control
from psabench.procedures.head_bench import Progress

Say = Callable[[str], None]
ALL: Mapping[str, Case | LineCase] = {**CASES, **LINE_CASES, **UNIT_CASES}
load_checks()
MODULES = (can_checks, line_checks)  # imported, they have registered their tests


@dataclass(frozen=True, slots=True, kw_only=True)
class Play:
    """How a host is tested. command "": it is started by hand, and tells into the file `results`."""

    folder: Path  # for logs and what was reported
    board: str = "psa2"
    profile: str = "article"
    command: str = ""
    results: Path | None = None
    link: str = "can"
    speed: float = 1.0
    say: Say = lambda _: None
    port: int = 0  # of socketcand; 0: any
    terminal: TextIO | None = None  # of who starts the host by hand

    @property
    def adapter(self) -> str:
        return "slcan" if self.link == "pty" else f"socketcand:{self.port}"


def wanted(
    only: Sequence[str] = (), cases: Sequence[str] = (), board: str = "psa2", link: str = "can"
) -> list[CaseCheck]:
    """Tests of requirements that begin so, of these cases, with that board and link; in the order of the cases."""
    order = [name for name, c in ALL.items() if board in c.boards and link in c.links]
    if unknown := [c for c in cases if c not in order]:
        raise BadInput(expected(f"a case of {board} at this link: {', '.join(order)}", ", ".join(unknown), "--case"))
    found = [
        j
        for j in case_checks()
        if j.case in (cases or order) and (not only or any(i.startswith(tuple(only)) for i in j.ids))
    ]
    return sorted(found, key=lambda j: order.index(j.case))


def run(play: Play, tests: Sequence[CaseCheck], progress: Progress, told: Callable[[Outcome], None]) -> None:
    """Each case once, then its tests; told: of each outcome as it comes. Raises StartError for the first."""
    names = list(dict.fromkeys(j.case for j in tests))
    with progress.step("host", max(1, len(names))) as advance:
        for name in names:
            begun_s = time.monotonic()
            try:
                shown: HostCapture | Exception = perform(play, name)
            except BadInput:
                raise
            except BenchError as e:
                if isinstance(e, StartError) and name == names[0]:
                    raise
                shown = e
            took_s = time.monotonic() - begun_s
            for j in (j for j in tests if j.case == name):
                told(replace(judge(j, shown, play.folder), took_s=took_s))
                took_s = 0.0
            advance()


def judge(j: CaseCheck, shown: HostCapture | Exception, folder: Path) -> Outcome:
    """One test of the capture of its case."""
    excerpts = tuple(f"{j.case}.{end}" for end in ("log", "jsonl", "stderr") if (folder / f"{j.case}.{end}").exists())

    def test() -> str:
        if isinstance(shown, Exception):
            raise Inconclusive(str(shown))
        return j.test(shown)

    return decide(not_decided(j.test, j.ids, j.case), test, lambda _: excerpts)


def perform(play: Play, name: str) -> HostCapture:
    """Play one case. Raises BenchError where it cannot be carried out."""
    play.folder.mkdir(parents=True, exist_ok=True)
    case = ALL[name]
    return on_line(play, case) if isinstance(case, LineCase) else on_board(play, case)


def on_line(play: Play, case: LineCase) -> HostCapture:
    """Samples on a pseudo-terminal of ours."""
    with ExitStack() as stack:
        port = stack.enter_context(closing(LinePort()))
        host = _host(play, case.name, case.title, {"line": str(port.path), **_form(play.profile)})
        stack.callback(host.kill)
        host.start()
        port.play((block.tobytes() for block in samples(case, form_of(play.profile))), host)
        port.close()
        status = host.wait()
        return HostCapture(
            case=case.name,
            bus=Bus([], NODE),
            told=host.told(),
            profile=play.profile,
            status=status,
            errors=_errors(host),
        )


def _form(profile: str) -> dict[str, str]:
    form = form_of(profile)
    return {"word_bits": str(form.word_bits), "code_bits": str(form.code_bits)}


def on_board(play: Play, case: Case) -> HostCapture:
    """An emulator in lockstep."""
    log = play.folder / f"{case.name}.log"
    with TemporaryDirectory(prefix="psabench-") as made:
        scenario = Path(made) / "host.yaml"
        profile = case.profile or play.profile
        text = case.scenario.replace("BOARD", play.board).replace("PROFILE", profile)
        scenario.write_text(text, encoding="utf-8")
        status, bench, streamed = _perform(play, case, scenario, log)
    return HostCapture(
        case=case.name,
        bus=read_log(log.read_text(encoding="ascii").splitlines(), NODE) if log.exists() else Bus([], NODE),
        told=bench.host.told(),
        profile=profile,
        status=status,
        marks=bench.marks,
        stood_s=bench.stood_s,
        clock=bench.clock,
        streamed=streamed,
        cycles=bench.bridge.cycles if isinstance(bench.bridge, BusBridge) else (),
        errors=_errors(bench.host),
    )


def _perform(play: Play, case: Case, scenario: Path, log: Path) -> tuple[int | None, HostBench, bool]:
    with ExitStack() as stack:
        emulator = stack.enter_context(Emulator(scenario, cans=[play.adapter, f"log:{log}"], pace="step"))
        control = stack.enter_context(Control(emulator.control_path or Path()))
        bridge = BusBridge(variant(play.board).family) if play.link == "bus" else None
        if bridge:
            stack.callback(bridge.close)
        where = {"bus": str(bridge.path)} if bridge else _places(emulator, play.link)
        host = _host(play, case.name, case.title, {**where, "form": str(case.form)})
        stack.callback(host.kill)
        pty = Path(emulator.endpoint(can="slcan")["pty"]) if play.link == "pty" else None
        bench = HostBench(emulator, control, host, speed=play.speed, node=NODE, bridge=bridge, pty=pty)
        case.before(bench)
        if bridge:
            bench.run(READY_S, speed=0.0)
        bench.stood_s = 0.0
        host.start()
        streamed = bridge is not None or _streams(bench, case)
        if streamed:
            case.play(bench)
        if bridge:
            bridge.close()
        bench.await_read()
        control.close()
        emulator.stop()
        return host.wait(), bench, streamed


def _streams(bench: HostBench, case: Case) -> bool:
    """Whether the host has come, and has started the stream where there is one."""
    bench.await_host()
    return not case.streams or not case.busy or bench.await_stream(case.busy, case.ready_s)


def _errors(host: Program | ByHand) -> str:
    return host.errors.read_text(errors="replace") if isinstance(host, Program) else ""


def _places(emulator: Emulator, link: str) -> dict[str, str]:
    if link == "pty":
        return {"pty": emulator.endpoint(can="slcan")["pty"]}
    at = emulator.endpoint(can="socketcand")
    return {"can": f"{at['host']}:{at['port']}"}


def _host(play: Play, case: str, title: str, where: dict[str, str]) -> Program | ByHand:
    kept = play.folder / f"{case}.jsonl"
    results = play.results or kept
    if not play.command:
        places = {k: _fixed(play.folder / k, v) if k in ("pty", "line", "bus") else v for k, v in where.items()}
        words = " ".join(f"{k}={v}" for k, v in {**places, "node": str(NODE), "results": str(results)}.items())
        invite = f"{case}: {title}\n  start the host now, Enter skips: {words}"
        return ByHand(results, kept, lambda: play.say(invite), play.terminal)
    places = {"node": str(NODE), "results": str(results), "form": "0", **where}
    return Program(
        expand(play.command, places),
        results=results,
        errors=play.folder / f"{case}.stderr",
        on_stdout="{results}" not in play.command,
    )


def _fixed(link: Path, pty: str) -> str:
    """A name of the pseudo-terminal that is the same in every case."""
    link.unlink(missing_ok=True)
    link.symlink_to(pty)
    return str(link)
