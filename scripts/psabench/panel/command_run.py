"""What `psabench panel` does: the bench in one thread, the server in another, until Ctrl-C."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import uvicorn

from psabench.errors import BadInput, BenchError, expected, listen_error
from psabench.options import of_fields, refuse_beside
from psabench.output import show_event
from psabench.panel import view
from psabench.panel.frames import BoundedSocket
from psabench.panel.guard import Door, Log
from psabench.panel.handlers import HANDLERS
from psabench.panel.hub import Hub
from psabench.panel.procedures import Runs
from psabench.panel.prompt_http import PromptHttp
from psabench.panel.recorded.source import RecordingSource
from psabench.panel.server import MESSAGE_BYTES, Pages, ThreadedHub
from psabench.panel.source import Source
from psabench.panel.worker import Worker, text_of
from psabench.shell.connect import Opening, addresses

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # the last one when the terminal is closed


def run(args: argparse.Namespace) -> int:
    """Handler of `psabench panel`."""
    hub = ThreadedHub(Hub())

    out = args.out.resolve()
    source = _source_of(args, out)

    def ready(address: str) -> None:
        show_event(args, {"event": "ready", "address": address}, f"ready {address}")

    runs = Runs(out / "procedures", lambda: hub.publish(text_of(runs.message())))
    worker = Worker(source, hub, runs, HANDLERS, playing=not args.paused)
    with _listen_loopback(args.port) as listener, _handlers_kept():
        try:
            worker.start()
            with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C, which uvicorn raises again, is how it ends
                asyncio.run(_serve(listener, hub, worker, runs.out, ready))
        finally:
            for number in ENDING:  # once is enough: what was started is being ended, forks, too
                signal.signal(number, signal.SIG_IGN)
            runs.close()
            worker.stop()
    if worker.failed is not None:  # a recording that could not be read to its end
        raise worker.failed
    if worker.died:
        raise BenchError(worker.died)
    return 0


def _source_of(args: argparse.Namespace, out: Path) -> view.Source:
    """A recording, or a bench. Raises BadInput where options do not go together."""
    if args.recording is None:
        if args.board is not None:
            raise BadInput(expected("--recording with it", args.board, "--board"))
        return Source(of_fields(Opening, args, scpi=addresses(args.scpi)), out, args.truth)
    options = {f"--{n}": getattr(args, n) for n in ("pace", "connect", "truth", "seed", "can")}
    refuse_beside("--recording", {"scenario": args.scenario, "--scpi": args.scpi or None} | options, "panel")
    return RecordingSource(args.recording, args.board or "psa2", args.node)


@contextlib.contextmanager
def _handlers_kept() -> Iterator[None]:
    """Signals find the caller's handlers again: a program that calls us goes on."""
    before = [(number, signal.getsignal(number)) for number in ENDING]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


@contextlib.contextmanager
def _listen_loopback(port: int) -> Iterator[socket.socket]:
    """Loopback only: there is no option for another address."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
            listener.listen(64)
        except OSError as e:
            raise listen_error("--port", port, e) from e
        yield listener


async def _serve(
    listener: socket.socket, hub: ThreadedHub, worker: Worker, reports: Path, ready: Callable[[str], None]
) -> None:
    hub.loop = loop = asyncio.get_running_loop()
    door = Door(port=listener.getsockname()[1])
    logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)  # a hostile client must not fill the terminal
    config = uvicorn.Config(
        Pages(hub.hub, worker.ask, worker.inbox.greet, Log(), reports).app(door),
        log_config=None,
        access_log=False,
        proxy_headers=False,  # there is no proxy whose headers could be trusted
        server_header=False,
        lifespan="off",
        http=PromptHttp,
        ws=BoundedSocket,
        ws_max_size=MESSAGE_BYTES,
        ws_per_message_deflate=False,  # loopback: it would cost more than it saves
        limit_concurrency=100,
        timeout_graceful_shutdown=1,
    )
    server = uvicorn.Server(config)

    def end() -> None:
        loop.call_soon_threadsafe(setattr, server, "should_exit", True)

    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup has it
        signal.signal(signal.SIGHUP, lambda *_: end())
    worker.on_death = end
    if worker.died or worker.failed is not None:
        return
    ready(door.address)
    await server.serve(sockets=[listener])
