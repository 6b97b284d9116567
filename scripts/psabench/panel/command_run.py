"""What `psabench panel` does: the bench in one thread, the server in another, until Ctrl-C."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import socket
from collections.abc import Iterator
from pathlib import Path

import uvicorn

from psabench.bench import Bench
from psabench.errors import LinkError
from psabench.options import of_fields
from psabench.panel.bench_view import BenchView
from psabench.panel.frames import BoundedSocket
from psabench.panel.guard import Door, Log
from psabench.panel.hub import Hub
from psabench.panel.procedures import Runs
from psabench.panel.server import MESSAGE_BYTES, Pages, ThreadedHub
from psabench.panel.worker import Worker, bench_of, text_of
from psabench.shell.connect import Opening, addresses


def run(args: argparse.Namespace) -> int:
    """Handler of `psabench panel`."""
    opening = of_fields(Opening, args, scpi=addresses(args.scpi))
    hub = ThreadedHub(Hub())

    out = args.out.resolve()

    def opened() -> BenchView:
        return bench_of(lambda: _open_bench(opening, args.truth), lambda b: BenchView(b, out, opening.start))

    def restored(path: Path) -> BenchView:
        return bench_of(lambda: Bench.restore(path, pace=opening.pace or "step"), lambda b: BenchView(b, out))

    runs = Runs(out / "procedures", lambda: hub.publish(text_of(runs.message())))
    worker = Worker(opened, hub, runs, None if opening.there else restored, playing=not args.paused)
    with _listen_loopback(args.port) as listener:
        try:
            worker.start()
            with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C, which uvicorn raises again, is how it ends
                asyncio.run(_serve(listener, hub, worker, runs.out))
        finally:
            runs.close()
            worker.stop()
    return 0


def _open_bench(opening: Opening, truth: Path | None) -> Bench:
    bench = opening.open()
    if truth is not None:
        bench.truth_path = truth
    return bench


@contextlib.contextmanager
def _listen_loopback(port: int) -> Iterator[socket.socket]:
    """Loopback only: there is no option for another address."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
            listener.listen(64)
        except OSError as e:
            raise LinkError(f"127.0.0.1:{port}: {e.strerror}") from e
        yield listener


async def _serve(listener: socket.socket, hub: ThreadedHub, worker: Worker, reports: Path) -> None:
    hub.loop = asyncio.get_running_loop()
    door = Door(port=listener.getsockname()[1])
    logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)  # a hostile client must not fill the terminal
    config = uvicorn.Config(
        Pages(hub.hub, worker.ask, Log(), reports).app(door),
        log_config=None,
        access_log=False,
        proxy_headers=False,  # there is no proxy whose headers could be trusted
        server_header=False,
        lifespan="off",
        http="h11",
        ws=BoundedSocket,
        ws_max_size=MESSAGE_BYTES,
        ws_per_message_deflate=False,  # loopback: it would cost more than it saves
        limit_concurrency=100,
        timeout_graceful_shutdown=1,
    )
    server = uvicorn.Server(config)
    print(f"ready {door.address}", flush=True)
    await server.serve(sockets=[listener])
