"""Forks of the panel's own bench: one is shown and goes on, the others rest. In step pace, where time can rest."""

from __future__ import annotations

from typing import Any

from psabench.errors import BenchError, expected
from psabench.panel.bench_view import BenchView
from psabench.panel.source import Source, bench_view, forked_view, own_source
from psabench.panel.view import View
from psabench.panel.worker import Worker, text_of

MOST = 4  # benches that rest: each is a process with a whole bench


def show_fork(w: Worker, file: str, seed: int | None) -> dict[str, Any]:
    """A fork of the present state, or from a snapshot, is shown; its noise is that of another seed where one is given.

    Raises BenchError, and the bench that is shown goes on.
    """
    source, view = own_source(w.source, "fork"), bench_view(w.view)
    if view.pace != "step":
        raise BenchError(expected("step pace", view.pace, "fork"))
    if len(w.resting) >= MOST:
        raise BenchError(expected(f"up to {MOST} benches beside the one that is shown", "more", "fork"))
    new = _from_snapshot(source, view, file) if file else forked_view(view)
    try:
        if seed is not None:
            new.line(f"reseed {seed}")
    except BaseException:
        new.close()
        raise
    of = f"snapshot {file}" if file else w.name
    name = _free_name(w)
    w.show(name, new, f"{name}, of {of}{'' if seed is None else f', seed {seed}'}")
    return {"time": w.time(), "name": name}


def _from_snapshot(source: Source, view: BenchView, file: str) -> BenchView:
    new = source.restored(view.file(file))
    new.go_on_from(file)
    return new


def _free_name(w: Worker) -> str:
    taken = {w.name, *w.resting}
    return next(name for k in range(1, MOST + 2) if (name := f"fork {k}") not in taken)


def show_resting(w: Worker, name: str) -> dict[str, Any]:
    """A bench that rests goes on, and ours rests."""
    assert w.view is not None  # raises while it is lost, and the other one goes on resting
    w.show(name, _take_resting(w, name), name)
    return {"time": w.time()}


def end_fork(w: Worker, name: str) -> dict[str, Any]:
    """End a bench that rests."""
    _take_resting(w, name).close()
    w.outlet.publish(text_of(w.benches()))
    return {}


def _take_resting(w: Worker, name: str) -> View:
    if name not in w.resting:
        known = ", ".join(w.resting) or "a bench that rests: there is none"
        raise BenchError(expected(known, repr(name[:40]), "bench"))
    return w.resting.pop(name)
