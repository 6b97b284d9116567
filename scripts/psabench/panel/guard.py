"""Who may talk to the panel: this machine's browser, with the token, from the panel's own page.

An ASGI middleware in front of everything, WebSockets too. The Host header stops DNS rebinding (a name of the attacker
that resolves to 127.0.0.1), the Origin header stops pages of other origins, the token stops other users of the machine.
HTTP only reads: what changes the bench goes through the WebSocket. RFC 6455, 10.2; OWASP, WebSocket security.
"""

from __future__ import annotations

import secrets
import sys
import time
from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qs

from psabench.errors import expected

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LOGGED = 100  # different refusals that are reported; more would let a hostile page fill the disk
SAFE_METHODS = ("GET", "HEAD")
HEADERS = (
    (b"content-security-policy", b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
     b"connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cache-control", b"no-store"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Refusal:
    """status: of HTTP; a WebSocket that is refused gets 403 whatever it is."""

    status: int
    why: str


@dataclass(slots=True)
class Log:
    """One line on standard error for each different thing, however often it comes."""

    say: Callable[[str], None] = lambda text: print(f"panel: {text}", file=sys.stderr, flush=True)
    _said: set[str] = field(default_factory=set)

    def once(self, text: str) -> None:
        if text not in self._said and len(self._said) < LOGGED:
            self._said.add(text)
            self.say(text)


@dataclass(slots=True)
class Door:
    """Address and token. port: known when the server listens."""

    port: int = 0
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @property
    def hosts(self) -> tuple[str, str]:
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    @property
    def cookie(self) -> str:
        """Browsers share cookies between the ports of a host; two panels must not take each other's."""
        return f"psabench_panel_{self.port}"

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    def is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self.token.encode())

    def refusal(self, scope: Mapping[str, Any]) -> Refusal | None:
        """Why a request is not served; None: it is."""
        hosts, origins = header_values(scope, b"host"), header_values(scope, b"origin")
        if len(hosts) != 1 or hosts[0] not in self.hosts:
            return Refusal(421, expected(f"Host {self.hosts[0]}", _shown_values(hosts), "host"))
        own = [f"http://{hosts[0]}"]
        if origins != own and (origins or scope["type"] == "websocket"):
            return Refusal(403, expected(f"Origin {own[0]}", _shown_values(origins), "origin"))
        if scope["type"] == "http" and scope["method"] not in SAFE_METHODS:
            return Refusal(405, expected(" or ".join(SAFE_METHODS), scope["method"], "method"))
        if not self._has_cookie(scope) and not self.brings_token(scope):
            return Refusal(
                401, "expected the token of the address that psabench panel has printed, got none or another"
            )
        return None

    def brings_token(self, scope: Mapping[str, Any]) -> bool:
        """Whether it is the first request, of the address that was printed; a WebSocket needs the cookie."""
        words = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        return scope["type"] == "http" and scope["path"] == "/" and len(words) == 1 and self.is_token(words[0])

    def _has_cookie(self, scope: Mapping[str, Any]) -> bool:
        """Cookies of other programs on this machine come, too, of whatever form."""
        pairs = [c.strip().partition("=") for value in header_values(scope, b"cookie") for c in value.split(";")]
        return any(name == self.cookie and self.is_token(value) for name, _, value in pairs)


def header_values(scope: Mapping[str, Any], name: bytes) -> list[str]:
    """All values of a header, as often as it was sent."""
    pairs: Iterable[tuple[bytes, bytes]] = scope["headers"]
    return [value.decode("latin-1") for key, value in pairs if key.lower() == name]


def _shown_values(values: list[str]) -> str:
    return ", ".join(repr(v[:80]) for v in values) or "none"


class Guard:
    """The middleware."""

    def __init__(self, app: App, door: Door, log: Log) -> None:
        self._app, self._door, self._log = app, door, log

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            return
        refusal = self._door.refusal(scope)
        if refusal is not None:
            self._log.once(f"refused a {scope['type']} request: {refusal.why}")
            await _refuse(scope, send, refusal)
        elif self._door.brings_token(scope):
            await _answer(send, 303, b"", [(b"location", b"/"), (b"set-cookie", self._cookie())])
        else:
            await self._app(scope, receive, _with_headers(send))

    def _cookie(self) -> bytes:
        return f"{self._door.cookie}={self._door.token}; Path=/; HttpOnly; SameSite=Strict".encode()


async def _refuse(scope: Scope, send: Send, refusal: Refusal) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
    else:
        await _answer(send, refusal.status, f"{refusal.why}\n".encode(), [])


async def _answer(send: Send, status: int, body: bytes, headers: list[tuple[bytes, bytes]]) -> None:
    head = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": [*head, *HEADERS, *headers]})
    await send({"type": "http.response.body", "body": body})


def _with_headers(send: Send) -> Send:
    async def sender(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            own = {key.lower() for key, _ in message.get("headers", ())}  # a report has a policy of its own
            message["headers"] = [*message.get("headers", ()), *(h for h in HEADERS if h[0] not in own)]
        await send(message)

    return sender


@dataclass(slots=True)
class Allowance:
    """Messages that a client may send: a token bucket."""

    per_s: float = 20.0
    burst: float = 60.0
    clock: Callable[[], float] = time.monotonic
    _left: float = field(init=False)
    _at_s: float = field(init=False)

    def __post_init__(self) -> None:
        self._left, self._at_s = self.burst, self.clock()

    def take(self) -> bool:
        """Whether one more is within it."""
        now_s = self.clock()
        self._left = min(self.burst, self._left + (now_s - self._at_s) * self.per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
