"""What a page may ask for, by its `do`; `watch` and `interrupt` are answered before (server, worker)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from psabench.errors import BenchError, expected
from psabench.panel import forks, scenarios
from psabench.panel.converter import read_converter
from psabench.panel.recording_view import RecordingSource
from psabench.panel.source import Source, bench_view, own_source
from psabench.panel.worker import Worker
from psabench.shell.lexer import Wrong

Request = Mapping[str, Any]
Handler = Callable[[Worker, Request], dict[str, Any]]
SEEDS = 2**53  # of psa-emu, whose numbers are those of JSON


def _run_procedure(w: Worker, request: Request) -> dict[str, Any]:
    w.runs.start(_text(request, "name"))
    return {}


def _stop_procedure(w: Worker, _: Request) -> dict[str, Any]:
    w.runs.stop()
    return {}


def _scenarios(w: Worker, _: Request) -> dict[str, Any]:
    """Names, and the text of the one that runs."""
    source = own_source(w.source, "scenario")
    names = [{"name": s.name, "what": s.what} for s in scenarios.shipped()]
    return {"names": names, "name": source.scenario, "text": scenarios.text_of(source.scenario)}


def _scenario(w: Worker, request: Request) -> dict[str, Any]:
    name, known = _text(request, "name"), _known(own_source(w.source, "scenario"))
    if name not in known:
        raise Wrong(expected(", ".join(known), repr(name[:40]), "scenario"))
    return {"text": scenarios.text_of(name)}


def _known(source: Source) -> list[str]:
    """What a page may read: those that are shipped, and the file that was named when the panel was started."""
    return list(dict.fromkeys([*(s.name for s in scenarios.shipped()), source.scenario]))


def _begin(w: Worker, request: Request) -> dict[str, Any]:
    """A scenario as it stands in the page takes the place of the one that runs."""
    source = own_source(w.source, "start")
    text, name, seed = _text(request, "text"), _text(request, "name"), _seed(request)
    unchanged = name in _known(source) and scenarios.text_of(name) == text
    scenario = name if unchanged else str(scenarios.checked_file(text, source.out))
    new = source.begin(scenario, seed)
    w.exchange(new, f"scenario {scenario}{'' if seed is None else f', seed {seed}'}")
    return {"time": w.time()}


def _restore(w: Worker, request: Request) -> dict[str, Any]:
    """Go back: an emulator from the snapshot takes the place of ours."""
    source, name = own_source(w.source, "go back"), _text(request, "file")
    before = bench_view(w.view)
    new = source.restored(before.file(name))
    new.go_on_from(name, before)
    w.exchange(new, f"snapshot {name}", playing=False)
    return {"time": w.time()}


def _recording(w: Worker, request: Request) -> dict[str, Any]:
    """Another file of the folder that the panel was started with."""
    name = _text(request, "name")
    if not isinstance(w.source, RecordingSource):
        raise BenchError(expected("a recording", "a bench", "panel"))
    source = w.source.choose(name)
    new = source.open()
    w.source = source
    w.exchange(new, f"recording {name}", playing=False)
    return {"time": w.time()}


def _text(request: Request, name: str) -> str:
    value = request.get(name, "")
    if not isinstance(value, str):
        raise Wrong(expected("a text", repr(value)[:40], name))
    return value


def _seed(request: Request) -> int | None:
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
    "scenarios": _scenarios,
    "scenario": _scenario,
    "begin": _begin,
    "restore": _restore,
    "fork": lambda w, request: forks.fork(w, _text(request, "file"), _seed(request)),
    "show": lambda w, request: forks.show(w, _text(request, "name")),
    "drop": lambda w, request: forks.drop(w, _text(request, "name")),
    "recording": _recording,
    "run": _run_procedure,
    "stop": _stop_procedure,
}
