"""The server of the page: its address, and the access control."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import secrets
import signal
import socket
import threading
import webbrowser
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import SimpleCookie
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from gyrocal.errors import GyrocalError, InputError
from gyrocal.extras import want

LOCAL = ("127.0.0.1", "localhost", "::1")
DEFAULT_PORT = 8750
TRIES = 20
COOKIE = "gyrocal-token"
ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32"><circle cx="16" cy="16" r="13" fill="none" stroke="#0072B2" '
    'stroke-width="4"/><path d="M16 16 L25 9" stroke="#E69F00" stroke-width="4" stroke-linecap="round"/></svg>'
)

POLICY = "; ".join(
    [
        "default-src 'self'", "script-src 'self' 'unsafe-inline' 'unsafe-eval'", "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:", "font-src 'self' data:", "object-src 'none'", "base-uri 'none'", "form-action 'self'",
        "frame-ancestors 'none'",
    ]
)  # fmt: skip
"""Content security policy. NiceGUI's page holds inline scripts, and it compiles its templates in the browser."""
SECURITY_HEADERS = {
    "content-security-policy": POLICY,
    "x-frame-options": "DENY",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
}

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Any]]
Send = Callable[[Any], Awaitable[None]]


class Guard:
    """Checks every request: pages of other sites are refused, and requests from other machines need a token.

    On this machine the Host header must name it. Otherwise a foreign page could reach it by a name of its own (DNS rebinding).
    """

    def __init__(self, app: Any, token: str | None) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        refusal = self._refusal(headers, query)
        send = _with_security_headers(send)
        if refusal is not None:
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1008})
            else:
                await _answer(send, 403, refusal)
        elif self.token is not None and "token" in query and scope["type"] == "http" and scope["method"] == "GET":
            cookie = f"{COOKIE}={self.token}; Path=/; HttpOnly; SameSite=Strict"
            await _answer(send, 303, "", [(b"location", scope["path"].encode()), (b"set-cookie", cookie.encode())])
        else:
            await self.app(scope, receive, send)

    def _refusal(self, headers: dict[str, str], query: dict[str, list[str]]) -> str | None:
        host = headers.get("host", "")
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return "This page is not for other sites.\n"
        if self.token is None:
            return None if urlsplit(f"//{host}").hostname in LOCAL else "This page is for this machine alone.\n"
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        given = [*query.get("token", []), *([] if cookie is None else [cookie.value])]
        if any(secrets.compare_digest(g.encode(), self.token.encode()) for g in given):
            return None
        return "Open the address that `gyrocal workbench` printed, with its token.\n"


def _with_security_headers(send: Send) -> Send:
    """``send`` with :data:`SECURITY_HEADERS` in every HTTP response."""
    own = [(name.encode(), value.encode()) for name, value in SECURITY_HEADERS.items()]

    async def send_with_headers(message: Any) -> None:
        if message["type"] == "http.response.start":
            others = [header for header in message.get("headers", []) if header[0].decode("latin-1") not in SECURITY_HEADERS]
            message = {**message, "headers": [*others, *own]}
        await send(message)

    return send_with_headers


async def _answer(send: Send, status: int, text: str, headers: list[tuple[bytes, bytes]] | None = None) -> None:
    kind = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": status, "headers": [kind, *(headers or [])]})
    await send({"type": "http.response.body", "body": text.encode()})


def listening(host: str, wanted: int | None) -> socket.socket:
    """A listening socket at the wanted port, or at the first free one from the default on. Raises InputError if it fails.

    It listens at once, so that a browser that is faster than the server waits.
    """
    problem = ""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for number in [wanted] if wanted is not None else range(DEFAULT_PORT, DEFAULT_PORT + TRIES):
        taken = socket.socket(family, socket.SOCK_STREAM)
        try:
            taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            taken.bind((host, number))
            taken.listen(128)
            return taken
        except (OSError, OverflowError) as error:
            taken.close()
            problem = getattr(error, "strerror", None) or str(error)
    where = f"--http-port {wanted}" if wanted is not None else f"--host {host}"
    raise InputError(f"{where}: cannot be used ({problem}); choose another")


def _end_with_the_terminal() -> None:
    """Let SIGHUP end the server as SIGTERM does, so that its traces are removed, unless it is ignored (``nohup``)."""
    hangup = getattr(signal, "SIGHUP", None)
    if hangup is not None and signal.getsignal(hangup) == signal.SIG_DFL:
        signal.signal(hangup, lambda *_: signal.raise_signal(signal.SIGTERM))


def serve(session: Path | None, device: str | None, host: str, http_port: int | None, *, browser: bool) -> None:
    """Serve the page until Ctrl-C. Raises InputError if a package that it needs is not installed."""
    want("the workbench", "page")
    taken = listening(host, http_port)
    number = int(taken.getsockname()[1])
    token = None if host in LOCAL else secrets.token_urlsafe(18)
    shown = socket.gethostname() if host in ("0.0.0.0", "::") else host
    url = f"http://{f'[{shown}]' if ':' in shown else shown}:{number}/"
    address = f"{url}?token={token}" if token else url
    if browser:
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()  # it starts while this does

    gc.disable()  # what is imported is no garbage
    from gyrocal.web.state.workbench import Workbench

    bench = Workbench([Path.cwd()] if session is None else [Path.cwd(), session], lambda topic: page.tell(topic))
    if session is not None:
        with contextlib.suppress(GyrocalError):  # told when it is opened
            path = bench.places.session(session)
            if not bench.places.is_by_gravity(path):
                bench.jobs.prepare("open", path)
    from nicegui import app, ui

    from gyrocal.web import page

    opening: list[asyncio.Task[None]] = []

    async def start() -> None:
        gc.freeze()
        gc.enable()
        page.serve(bench)
        if device is not None:
            bench.live.trusted.add(device)
            bench.live.connect(device)
        print(f"workbench: {address}  (Ctrl-C ends it)", flush=True)
        if session is not None:
            opening.append(asyncio.create_task(bench.open(session)))
            await asyncio.sleep(0)

    app.on_startup(start)
    app.on_shutdown(bench.close)
    app.add_middleware(Guard, token=token)
    ui.add_css((files("gyrocal") / "web" / "style.css").read_text(encoding="utf-8"), shared=True)
    page.register()
    _end_with_the_terminal()
    with contextlib.suppress(KeyboardInterrupt):
        ui.run(
            host=host, port=number, fd=taken.fileno(), title="gyrocal workbench", favicon=ICON, dark=None, language="en-US",
            reload=False, show=False, tailwind=False, show_welcome_message=False, message_history_length=200,
            reconnect_timeout=15.0,
            ws_per_message_deflate=False, gzip_middleware_factory=None,  # to this machine, or by the local network
            uvicorn_logging_level="critical",  # a request cut off by Ctrl-C is no error
        )  # fmt: skip
