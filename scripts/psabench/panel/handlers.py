"""What a page may ask for, by its `do`; `watch` and `interrupt` are answered before (server, worker)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from psabench.errors import BenchError, expected
from psabench.panel import forks, scenarios
from psabench.panel.converter import read_converter
from psabench.panel.recorded.lines_view import LinesView
from psabench.panel.recorded.source import RecordingSource
from psabench.panel.source import Source, bench_view, own_source
from psabench.panel.worker import Worker
from psabench.shell.lexer import Wrong

Request = Mapping[str, Any]
Handler = Callable[[Worker, Request], dict[str, Any]]
SEEDS = 2**53  # of psa-emu, whose numbers are those of JSON


def _run_procedure(w: Worker, request: Request) -> dict[str, Any]:
    """On the bench that is shown, or on one of its own."""
    name = _text_of(request, "name")
    if request.get("here") is True:
        w.lend(name)
        return {"time": w.time()}
    w.runs.start(name)
    return {}


def _stop_procedure(w: Worker, _: Request) -> dict[str, Any]:
    w.runs.stop()
    return {}


def _scenario_names(w: Worker, _: Request) -> dict[str, Any]:
    """Names, and the text of the one that runs."""
    source = own_source(w.source, "scenario")
    names = [{"name": s.name, "what": s.what} for s in scenarios.shipped_scenarios()]
    return {"names": names, "name": source.scenario, "text": scenarios.text_of(source.scenario)}


def _scenario_text(w: Worker, request: Request) -> dict[str, Any]:
    name, known = _text_of(request, "name"), _known_names(own_source(w.source, "scenario"))
    if name not in known:
        raise Wrong(expected(", ".join(known), repr(name[:40]), "scenario"))
    return {"text": scenarios.text_of(name)}


def _known_names(source: Source) -> list[str]:
    """What a page may read: those that are shipped, and the file that was named when the panel was started."""
    return list(dict.fromkeys([*(s.name for s in scenarios.shipped_scenarios()), source.scenario]))


def _begin_scenario(w: Worker, request: Request) -> dict[str, Any]:
    """The scenario with the text of the page takes the place of the one that runs."""
    source = own_source(w.source, "start")
    text, name, seed = _text_of(request, "text"), _text_of(request, "name"), _seed_of(request)
    unchanged = name in _known_names(source) and scenarios.text_of(name) == text
    scenario = name if unchanged else str(scenarios.checked_file(text, source.out))
    new = source.begin(scenario, seed)
    w.exchange(new, f"scenario {scenario}{'' if seed is None else f', seed {seed}'}")
    return {"time": w.time()}


def _restore_snapshot(w: Worker, request: Request) -> dict[str, Any]:
    """Go back: an emulator from the snapshot takes the place of ours."""
    source, name = own_source(w.source, "go back"), _text_of(request, "file")
    before = bench_view(w.view)
    new = source.restored(before.file(name))
    new.go_on_from(name)
    w.exchange(new, f"snapshot {name}", playing=False)
    return {"time": w.time()}


def _choose_recording(w: Worker, request: Request) -> dict[str, Any]:
    """Another file of the folder that the panel was started with."""
    name = _text_of(request, "name")
    if not isinstance(w.source, RecordingSource):
        raise BenchError(expected("a recording", "a bench", "panel"))
    source = w.source.choose(name)
    new = w.opened(source)
    w.source = source
    w.exchange(new, f"recording {name}", playing=False)
    return {"time": w.time()}


def _recorded_lines(w: Worker) -> LinesView:
    """Raises BenchError."""
    if not isinstance(w.view, LinesView):
        raise BenchError(expected("a recording of lines", "another bench or recording", "panel"))
    return w.view


def _text_of(request: Request, name: str) -> str:
    value = request.get(name, "")
    if not isinstance(value, str):
        raise Wrong(expected("a text", repr(value)[:40], name))
    return value


def _seed_of(request: Request) -> int | None:
    seed = request.get("seed")
    if seed is None or (isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed <= SEEDS):
        return seed
    raise Wrong(expected(f"an integer from 0 to {SEEDS}", repr(seed)[:40], "seed"))


HANDLERS: Mapping[str, Handler] = {
    "hello": lambda w, _: w.hello(),
    "play": lambda w, request: w.play(request),
    "line": lambda w, request: w.line(str(request.get("line", ""))),
    "frame": lambda w, _: dict(w.view.frame()),
    "converter": lambda _, request: read_converter(request),
    "statistics": lambda w, request: w.view.channel_statistics(str(request.get("channel", ""))),
    "scenarios": _scenario_names,
    "scenario": _scenario_text,
    "begin": _begin_scenario,
    "restore": _restore_snapshot,
    "fork": lambda w, request: forks.show_fork(w, _text_of(request, "file"), _seed_of(request)),
    "show": lambda w, request: forks.show_resting(w, _text_of(request, "name")),
    "drop": lambda w, request: forks.end_fork(w, _text_of(request, "name")),
    "recording": _choose_recording,
    "window": lambda w, request: _recorded_lines(w).window(request),
    "next": lambda w, request: _recorded_lines(w).next_frame(request),
    "run": _run_procedure,
    "stop": _stop_procedure,
}
