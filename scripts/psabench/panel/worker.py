"""The thread that has the bench: it moves time, carries out what pages ask for, and publishes 30 times a second."""

from __future__ import annotations

import json
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from psabench.errors import BenchError, LinkError, expected
from psabench.output import without_nan
from psabench.panel.bench_view import BenchView
from psabench.panel.converter import describe_converters
from psabench.panel.inbox import Asked, Inbox
from psabench.panel.lending import check_free, fitting_procedures, options_of
from psabench.panel.procedures import OFFERED, Runs
from psabench.panel.recorded.opening import Opening
from psabench.panel.recorded.source import RecordingSource
from psabench.panel.source import bench_view
from psabench.panel.view import Source, View

UPDATE_S = 1 / 30
STATE_S = 0.25
CAN_S = 0.2
OVERVIEW_S = 0.5
RETRY_S = 1.0  # real time between looks whether an emulator is there again
FIRST = "first"  # bench; others are its forks
SLOWEST, FASTEST = 0.001, 1000.0  # of simulated time to real time


class Outlet(Protocol):
    """Where texts go; called in the worker's thread."""

    def publish(self, text: str, *, truth: bool = False) -> None: ...
    def answer(self, number: int, text: str) -> None: ...
    def wants_truth(self) -> bool: ...
    def wants_lines(self) -> bool: ...
    def is_watched(self) -> bool: ...


@dataclass(slots=True)
class Due:
    """Whether something is due, by real time."""

    every_s: float
    _next_s: float = 0.0

    @property
    def left_s(self) -> float:
        """Until it is due again, at most every_s."""
        return min(max(self._next_s - time.monotonic(), 0.0), self.every_s)

    def __call__(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._next_s:
            return False
        self._next_s += self.every_s
        if self._next_s < now_s:  # late: no burst to catch up
            self._next_s = now_s + self.every_s / 2
        return True


@dataclass(slots=True)
class Worker:
    """handlers: what a page may ask for, by its "do" (psabench.panel.handlers)."""

    source: Source
    outlet: Outlet
    runs: Runs
    handlers: Mapping[str, Callable[[Worker, Mapping[str, Any]], dict[str, Any]]]
    playing: bool = True
    speed: float = 1.0
    inbox: Inbox = field(default_factory=Inbox)
    ready: threading.Event = field(default_factory=threading.Event)
    failed: BenchError | None = None  # of the first opening
    died: str = ""  # why the thread has ended by itself: an error of ours
    on_death: Callable[[], None] = lambda: None
    lost: str = ""
    name: str = FIRST  # of the bench that is shown
    lent: str = ""  # the procedure that has it
    resting: dict[str, View] = field(default_factory=dict)  # the others, whose time stands still
    _view: View | None = None
    _opening: Opening | None = None  # a recording that is being read
    _stop: threading.Event = field(default_factory=threading.Event)
    _updates: Due = field(default_factory=lambda: Due(UPDATE_S))
    _states: Due = field(default_factory=lambda: Due(STATE_S))
    _cans: Due = field(default_factory=lambda: Due(CAN_S))
    _openings: Due = field(default_factory=lambda: Due(CAN_S))
    _overviews: Due = field(default_factory=lambda: Due(OVERVIEW_S))
    _thread: threading.Thread | None = None
    _moved_s: float = 0.0

    # ---- from the server's thread

    def start(self) -> None:
        """Returns when the bench is up, or the first part of a recording is read. Raises its BenchError."""
        self._thread = threading.Thread(target=self._run, name="bench", daemon=True)
        self._thread.start()
        self.ready.wait()
        if self.failed is not None:
            raise self.failed

    def stop(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join(10.0)

    def ask(self, number: int, request: dict[str, Any]) -> None:
        """Raises queue.Full."""
        if request["do"] == "interrupt":
            answer = {"id": request.get("id"), "kind": "answer", "line": self.inbox.stop_line()}
            self.outlet.answer(number, text_of(answer))
            return
        self.inbox.put(number, request)

    # ---- in its own

    def _run(self) -> None:
        try:
            self._view = self._open()
        except BenchError as e:
            if not self._stop.is_set():
                self.failed = e
                self.outlet.publish(text_of({"kind": "lost", "why": str(e)}))
                self.on_death()
            return
        except Exception as e:
            self._die(e)
            return
        finally:
            self.ready.set()
        self.outlet.publish(text_of(self.hello()))
        try:
            while not self._stop.is_set():
                self._turn()
        except BaseException as e:
            self._die(e)
        finally:
            self._close()
            for view in self.resting.values():
                _close_bench(view)

    def _die(self, e: BaseException) -> None:
        self.died = f"panel: an error of its own has ended it: {e!r} at {_place_of(e)}"
        self.outlet.publish(text_of({"kind": "lost", "why": self.died}))
        self.on_death()

    def _open(self) -> View:
        source = self.source
        view = self.opened(source) if isinstance(source, RecordingSource) else source.open()
        self.playing = self.playing and not view.opens_paused
        return self._prepared(view)

    def opened(self, source: RecordingSource) -> View:
        """A recording, read in a thread while pages are served. Raises BenchError."""
        self._opening = Opening(source)
        try:
            with self.inbox.doing(f"opening {source.name}"):
                return self._opening.follow(self._while_opening)
        finally:
            self._opening = None
            self.outlet.publish(text_of({"kind": "opening", "name": source.name, "done": None}))

    def _while_opening(self) -> None:
        assert self._opening is not None
        if self._opening.done >= 0.0:
            self.ready.set()  # so much can be read
        if self._openings():
            self.outlet.publish(text_of(self._opening.message()))
        self._between()

    def _prepared(self, view: View) -> View:
        view.look_between(self._between)
        self._moved_s = time.monotonic()
        return view

    def _close(self) -> None:
        if self._view is not None:
            _close_bench(self._view)
        self._view = None

    def _turn(self) -> None:
        try:
            if self._view is None:
                self._come_back()
            if self.lent and not self.runs.is_running:
                self._take_back()
            self._answer(self.inbox.aside())
            self._answer(self.inbox.in_order())
            if self._view is not None:
                self._move(self._view)
                self._say_news()
        except (LinkError, OSError) as e:
            self._lose(str(e))
        except BenchError as e:
            self._lose(f"the bench does not go on: {e}")

    def lend(self, name: str) -> None:
        """The bench that is shown goes to a procedure until that ends; time is the procedure's. Raises BenchError."""
        view = bench_view(self.view)
        if self.inbox.busy:
            raise BenchError(f"bench: {self.inbox.busy} is being carried out; stop it first")
        self.runs.start(name, options_of(name, view))
        view.lend()
        self.lent, self.playing = name, False

    def _take_back(self) -> None:
        why, self.lent = f"the procedure {self.lent} had this bench until here; this script does not repeat it", ""
        bench_view(self.view).take_back(why)
        self.outlet.publish(text_of(self.hello()))

    def _lose(self, why: str) -> None:
        if self.lent:
            self.runs.stop()
            self.lent = ""
        self.lost = why
        self._close()
        self.outlet.publish(text_of({"kind": "lost", "why": why}))
        if self.resting:
            lost, self.name = self.name, FIRST if FIRST in self.resting else next(iter(self.resting))
            self.exchange(self.resting.pop(self.name), f"{self.name}: {lost} was lost: {why}", playing=False)

    def _come_back(self) -> None:
        self._stop.wait(RETRY_S)
        try:
            self._view, self.name = self._open(), FIRST
        except (BenchError, OSError):
            self.outlet.publish(text_of({"kind": "lost", "why": self.lost}))
            return
        self.lost = ""
        self.outlet.publish(text_of(self.hello() | {"began": "bench found again"}))

    def hello(self) -> dict[str, Any]:
        if self._view is None:
            return self._opening.message() if self._opening else {"kind": "lost", "why": self.lost}
        fits = fitting_procedures(self._view) if isinstance(self._view, BenchView) else []
        procedures = {"offered": dict(OFFERED), "procedure": self.runs.message(), "restores": self.source.is_own}
        return (
            self._view.describe()
            | {"time": self.time(), "benches": self.benches(), "converters": describe_converters()}
            | procedures
            | {"fits": fits}
        )

    def benches(self) -> dict[str, Any]:
        """Which bench is shown, and which rest; forks: whether one may be made."""
        forks = self.source.is_own and self.view.pace == "step"
        return {"kind": "benches", "shown": self.name, "resting": sorted(self.resting), "forks": forks}

    def _move(self, view: View) -> None:
        """Let time pass, an update's length; a real bench and one in wall pace receive meanwhile."""
        if view.pace != "step" or self.lent:
            view.receive(self._updates.left_s)
            if self.lent:
                bench_view(view).follow()
            return
        now_s = time.monotonic()
        if not self.playing:
            self._moved_s = now_s
            self._wait_request(self._updates.left_s)
            return
        passed_s, self._moved_s = min(now_s - self._moved_s, 2 * UPDATE_S), now_s
        view.wait(passed_s * self.speed)
        self.playing = not view.is_over
        self._wait_request(self._updates.left_s)

    def _wait_request(self, for_s: float) -> None:
        """Sleep, but not while a page waits for an answer."""
        deadline_s = time.monotonic() + for_s
        while self.inbox.is_empty and (left_s := deadline_s - time.monotonic()) > 0 and not self._stop.is_set():
            time.sleep(min(left_s, 0.005))

    def _between(self) -> None:
        """Between two slices of time: while a line goes on, pages see it go, and can stop it."""
        if not self.inbox.busy:
            return
        self.inbox.check()
        if self._stop.is_set():
            raise BenchError("panel: ended")
        self._answer(self.inbox.aside())
        self._say_news()

    def _say_news(self) -> None:
        view = self._view
        if view is None or not self._updates():
            return
        # A line of the unit waits for its frames: what it has not taken yet is not ours.
        buckets = {} if self.inbox.busy.startswith("dut.") else view.take(self._overviews())
        if not self.outlet.is_watched():
            return
        self.outlet.publish(text_of({"kind": "update", "time": self.time(), **({"new": buckets} if buckets else {})}))
        if self._states():
            self.outlet.publish(text_of(view.state(lines=self.outlet.wants_lines())))
            if self.outlet.wants_truth():
                self._say_truth(view)
        if self._cans():
            self.outlet.publish(text_of(view.can(view.now_s())))

    def _say_truth(self, view: View) -> None:
        try:
            message = view.truth()
        except BenchError as e:
            message = {"kind": "truth", "error": str(e)}
        self.outlet.publish(text_of(message), truth=True)

    def time(self) -> dict[str, Any]:
        assert self._view is not None
        return {
            "t_s": round(self._view.now_s(), 9),
            "playing": self.playing or self._view.pace != "step" or bool(self.lent),
            "speed": self.speed,
            "busy": self.inbox.busy,
            "lent": self.lent,
        }

    # ---- requests

    def _answer(self, requests: Iterable[Asked]) -> None:
        for number, request in requests:
            try:
                result = self._result(request)
            except Exception as e:  # whatever a page asks for, the others go on
                result = {"kind": "answer", "error": self._error_of(e)}
            self.outlet.answer(number, text_of({"id": request.get("id"), **result}))
            if "error" in result and self._view is not None:
                self._view.now_s()  # raises LinkError where the bench has gone, and not where a unit is silent

    def _error_of(self, e: Exception) -> str:
        if isinstance(e, BenchError | ValueError | OSError):
            return str(e)
        traceback.print_exception(e)
        return f"panel: internal error, see its terminal: {e!r}"

    def _result(self, request: dict[str, Any]) -> dict[str, Any]:
        """Raises BenchError for what cannot be done."""
        what = str(request.get("do"))
        check_free(what, self.lent)
        handler = self.handlers.get(what)
        if handler is None:
            raise BenchError(expected(", ".join(self.handlers), repr(what[:40]), "do"))
        return {"kind": "answer", **handler(self, request)}

    @property
    def view(self) -> View:
        """The bench. Raises BenchError while it is lost."""
        if self._view is None:
            raise BenchError(f"panel: no bench: {self.lost}")
        return self._view

    def line(self, text: str) -> dict[str, Any]:
        """Carry out a line of the shell."""
        before = self.view.unit
        with self.inbox.doing(text.strip()):
            done = self.view.line(text)
        self._moved_s = time.monotonic()
        if str(done.get("line", "")).startswith("bench.snapshot "):
            self.outlet.publish(text_of({"kind": "snapshots", "names": self.view.snapshots()}))
        if self.view.unit != before or done.get("rewound"):
            self.outlet.publish(text_of(self.hello()))
        return done | {"time": self.time()}

    def exchange(self, new: View, why: str, *, playing: bool | None = None) -> None:
        """A bench that takes the place of ours, which ends. playing: None: time goes on or stands still as before."""
        self._close()
        self._view, self.lost = self._prepared(new), ""
        self.playing = self.playing if playing is None else playing
        self.outlet.publish(text_of(self.hello() | {"began": why}))

    def show(self, name: str, view: View, why: str) -> None:
        """Another bench is shown; ours rests."""
        self.resting[self.name], self.name = self.view, name
        self._view = None
        self.exchange(view, why, playing=False)

    def play(self, request: Mapping[str, Any]) -> dict[str, Any]:
        speed = request.get("speed", self.speed)
        if isinstance(speed, bool) or not isinstance(speed, int | float) or not SLOWEST <= speed <= FASTEST:
            raise BenchError(expected(f"{SLOWEST:g} to {FASTEST:g}", repr(speed)[:40], "speed"))
        self.playing, self.speed = request.get("on") is True, float(speed)
        self._moved_s = time.monotonic()
        return {"time": self.time()}


def _close_bench(view: View) -> None:
    with suppress(Exception):  # a connection that is lost closes as it likes
        view.close()


def _place_of(e: BaseException) -> str:
    """The line of ours that raised it."""
    last = traceback.extract_tb(e.__traceback__)[-1]
    return f"{Path(last.filename).name}:{last.lineno}"


def text_of(message: dict[str, Any]) -> str:
    """JSON that a browser reads: it has no NaN."""
    try:
        return json.dumps(message, allow_nan=False, separators=(",", ":"))
    except ValueError:
        return json.dumps(without_nan(message), allow_nan=False, separators=(",", ":"))
