"""Pages and the WebSocket. HTTP only reads; requests come through the WebSocket, one JSON object each."""

from __future__ import annotations

import asyncio
import json
import queue
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from psabench.errors import expected
from psabench.panel.frames import FRAGMENTS
from psabench.panel.guard import Allowance, Door, Guard, Log
from psabench.panel.hub import Client, Hub
from psabench.panel.procedures import OFFERED, REPORT

MESSAGE_BYTES = 4096  # of a request; a line of the shell is shorter
PAGES = 32  # at the same time
POLICY, TOO_MANY = 1008, 1013  # RFC 6455, 7.4.1, and its registry
WRONG_FRAMES = {  # by the code with which frames.py and its library close
    1002: expected("frames of RFC 6455", "others", "page"),
    1007: expected("UTF-8", "other bytes", "page"),
    1008: expected(f"up to {Allowance().per_s:g} messages a second", "more", "page"),
    1009: expected(f"messages of up to {MESSAGE_BYTES} bytes in up to {FRAGMENTS} frames", "more", "page"),
}
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; sandbox"
KINDS = {"html": "text/html", "js": "text/javascript", "css": "text/css", "LICENSE": "text/plain"}

Ask = Callable[[int, dict[str, Any]], None]
Greet = Callable[[int], None]


class ThreadedHub:
    """The hub as the worker's thread sees it: everything is done in the server's loop."""

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self.loop: asyncio.AbstractEventLoop | None = None  # when the server runs

    def publish(self, text: str, *, truth: bool = False) -> None:
        self._later(lambda: self.hub.publish(text, truth=truth))

    def answer(self, number: int, text: str) -> None:
        self._later(lambda: self.hub.answer(number, text))

    def wants_truth(self) -> bool:
        return any(c.truth for c in list(self.hub.clients.values()))

    def wants_lines(self) -> bool:
        return any(c.lines and c.live for c in list(self.hub.clients.values()))

    def is_watched(self) -> bool:
        return any(c.live for c in list(self.hub.clients.values()))

    def _later(self, call: Callable[[], None]) -> None:
        if self.loop is not None:
            with suppress(RuntimeError):  # the loop has ended
                self.loop.call_soon_threadsafe(call)


class Pages:
    """The application. ask: hands a request to the worker, raises queue.Full; greet: that a page needs the state."""

    def __init__(self, hub: Hub, ask: Ask, greet: Greet, log: Log, reports: Path) -> None:
        self._hub, self._ask, self._greet, self._log, self._reports = hub, ask, greet, log, reports
        folder = files("psabench.panel") / "static"
        self._files = {f.name: f.read_bytes() for f in folder.iterdir() if f.is_file()}

    def app(self, door: Door) -> Guard:
        routes = [
            Route("/", self._file, methods=["GET"]),
            Route("/static/{name}", self._file, methods=["GET"]),
            Route("/reports/{name}/report.html", self._report, methods=["GET"]),
            WebSocketRoute("/ws", self._socket),
        ]
        return Guard(Starlette(routes=routes), door, self._log)

    async def _file(self, request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        body = self._files.get(name)
        if body is None:
            return Response("no such file\n", status_code=404, media_type="text/plain")
        return Response(body, media_type=KINDS.get(name.rpartition(".")[2], "application/octet-stream"))

    async def _report(self, request: Request) -> Response:
        """Of a procedure that was started here; in a sandbox, where no script runs."""
        path = self._reports / request.path_params["name"] / REPORT
        if request.path_params["name"] not in OFFERED or not path.is_file():
            return Response("no such report\n", status_code=404, media_type="text/plain")
        return Response(path.read_bytes(), media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})

    async def _socket(self, socket: WebSocket) -> None:
        await socket.accept()
        if len(self._hub.clients) >= PAGES:
            await socket.close(TOO_MANY, f"{PAGES} pages are open")
            return
        client = Client()
        self._hub.clients[client.number] = client
        sender = asyncio.create_task(self._send_all(socket, client))
        try:
            self._greet(client.number)
            async for request in self._requests(socket):
                self._take(client, request)
        finally:
            del self._hub.clients[client.number]
            sender.cancel()
            with suppress(asyncio.CancelledError, RuntimeError, WebSocketDisconnect):
                await sender

    async def _send_all(self, socket: WebSocket, client: Client) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):  # gone; the receiver knows, too
            while True:
                text = await client.next_text()
                await socket.send_text(text)
                if client.missed:
                    client.missed = False
                    self._greet(client.number)

    async def _requests(self, socket: WebSocket) -> AsyncIterator[dict[str, Any]]:
        """Until the page goes, or does what ours never does: then it is closed and one line is logged."""
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                why = WRONG_FRAMES.get(message.get("code", 0))
                if why:
                    self._log.once(f"closed a page: {why}")
                return
            request = parse_request(message.get("text") or "")
            if request is None:
                why = expected("requests, JSON objects with a text do", "another message", "page")
                self._log.once(f"closed a page: {why}")
                with suppress(RuntimeError):
                    await socket.close(POLICY, why)
                return
            yield request

    def _take(self, client: Client, request: dict[str, Any]) -> None:
        if request["do"] == "watch":
            woken = request.get("live") is True and not client.live
            client.live, client.truth = request.get("live") is True, request.get("truth") is True
            client.lines = request.get("lines") is True
            if woken:
                self._greet(client.number)
            return
        self._ask_worker(client, request)

    def _ask_worker(self, client: Client, request: dict[str, Any]) -> None:
        try:
            self._ask(client.number, request)
        except queue.Full:
            error = expected("at most a few requests at a time", "more", "panel")
            client.put_answer(json.dumps({"kind": "answer", "id": request.get("id"), "error": error}))


def parse_request(text: str) -> dict[str, Any] | None:
    """A request: an object with a text "do"; None: malformed, or with half a surrogate pair, which no file takes."""
    if len(text.encode()) > MESSAGE_BYTES:
        return None
    try:
        request = json.loads(text)
        json.dumps(request, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        return None
    is_one = isinstance(request, dict) and isinstance(request.get("do"), str)
    return request if is_one and isinstance(request.get("id", 0), int) else None
