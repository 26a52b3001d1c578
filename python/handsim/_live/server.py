"""The page's server: HTTP and WebSocket of one session, for those who have its token.

aiohttp serves both on one port, limits the size of messages, waits for slow readers, and has kept its interface for years.
It runs in a thread of its own and never waits for the session, nor the session for it: a page that reads slowly gets newer
views less often, and nothing queues up for it.
"""
from __future__ import annotations

import asyncio
import hmac
import json
import logging
import re
import secrets
import threading
import time
from typing import Any, Callable, Optional

from aiohttp import WSMsgType, web

from .._errors import Error, input_error
from .commands import Command, read_command
from .frames import encode
from .page import Parts, page_text
from .session import Session
from .views import View

PAGES = 8
"""Open at most."""
SOCKETS = 64
"""Connections at most; others are closed at once."""
LARGEST_MESSAGE = 1 << 16
"""Bytes of a message from a page."""
FAULTS = 50
"""Wrong messages after which a page is closed."""
PATIENCE = 10.0
"""Seconds for a connection to become a page's, and for a page to read a message."""
MESSAGES_PER_SECOND = 1000
POLICY = ("default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'self' "
          "ws: blob:; frame-ancestors 'self' http://localhost:* http://127.0.0.1:* vscode-webview:; base-uri 'none'; form-action 'none'")
HEADERS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff",
           "Content-Security-Policy": POLICY, "Cross-Origin-Resource-Policy": "same-origin"}


class Page:
    """A page that is open."""

    def __init__(self, socket: web.WebSocketResponse, transport: Optional[asyncio.BaseTransport]) -> None:
        self.socket, self.transport = socket, transport
        self.news = asyncio.Event()
        self.springs: set[int] = set()
        self.faults = 0
        self.second, self.count = 0, 0
        self.seen: Optional[View] = None
        self.told: Optional[dict[str, Any]] = None
        self.scene = 0


class Server:
    """Serves a session from `start` to `close`. :raises Error: of kind input where the port is taken"""

    def __init__(self, session: Session, port: int = 0, address: str = "127.0.0.1",
                 on_frame: Optional[Callable[[Any], None]] = None) -> None:
        self.session, self.address, self.port = session, address, port
        self.token = secrets.token_urlsafe(24)
        self.parts = Parts(session.files, session.course.overrides)
        session.shape_index = self.parts.shape_index
        self.pages: set[Page] = set()
        self.refused = 0
        """Requests and connections that were turned away."""
        self._on_frame = on_frame
        self._built, self._coming = 0, 0
        self._loop = asyncio.new_event_loop()
        self._ready: "threading.Event" = threading.Event()
        self._failure: Optional[Exception] = None
        self._thread = threading.Thread(target=self._run, name="handsim live server", daemon=True)

    @property
    def url(self) -> str:
        host = f"[{self.address}]" if ":" in self.address else self.address
        if self.address in ("0.0.0.0", "::"):
            host = "127.0.0.1"
        return f"http://{host}:{self.port}/?token={self.token}"

    def start(self) -> None:
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            self._thread.join()
            reason = getattr(self._failure, "strerror", None) or self._failure
            raise input_error("port", f"{self.address}:{self.port} ({reason})", "a free port of an address of this machine")
        self.session.on_view = self._announce

    def close(self) -> None:
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join()

    def _announce(self) -> None:
        """In the session's thread: a view is there."""
        try:
            self._loop.call_soon_threadsafe(self._ring)
        except RuntimeError:  # closed
            pass

    def _ring(self) -> None:
        for page in self.pages:
            page.news.set()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.set_exception_handler(lambda _, found: self._report(found.get("exception") or RuntimeError(found["message"])))
        try:
            self._loop.run_until_complete(self._serve())
            self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        except Exception as error:
            if self._ready.is_set():
                self.session.report(error)
            self._failure = error
        finally:
            self._ready.set()
            self._loop.close()

    def _report(self, error: BaseException) -> None:
        """What went wrong with one page or request: the others go on."""
        self.session.notice(f"the page's server: {type(error).__name__}: {error}")

    async def _serve(self) -> None:
        self._stop = asyncio.Event()
        app = web.Application(middlewares=[self._guard], client_max_size=LARGEST_MESSAGE)
        app.add_routes([web.get("/", self._page), web.get("/socket", self._socket), web.get("/save/{what}", self._save)])
        # Requests that are none are answered and said nowhere: who reaches the port could fill the terminal. `_guard` reports.
        quiet = logging.Logger("handsim live")
        quiet.addHandler(logging.NullHandler())
        runner = web.AppRunner(app, access_log=None, logger=quiet, handle_signals=False, keepalive_timeout=5)
        await runner.setup()
        assert runner.server is not None
        self._handlers = runner.server
        try:
            listening = await self._loop.create_server(self._connection, self.address, self.port, backlog=64)
        except Exception:  # no such port or address; `_run` says it
            await runner.cleanup()
            raise
        self.port = listening.sockets[0].getsockname()[1]
        self._ready.set()
        await self._stop.wait()
        listening.close()
        for page in list(self.pages):
            await page.socket.close(code=1001)
        await runner.cleanup()
        rest = asyncio.all_tasks() - {asyncio.current_task()}
        for task in rest:
            task.cancel()
        await asyncio.gather(*rest, return_exceptions=True)

    def _connection(self) -> asyncio.Protocol:
        """A connection; one too many is closed, and one that does not become a page's is, too."""
        if len(self._handlers.connections) + self._coming >= SOCKETS:
            self.refused += 1
            return _Closed()
        self._coming += 1
        self._loop.call_soon(self._came)
        handler: Any = self._handlers()
        self._loop.call_later(PATIENCE, self._forget, handler)
        return handler  # type: ignore[no-any-return]

    def _came(self) -> None:
        self._coming -= 1

    def _forget(self, handler: Any) -> None:
        transport = getattr(handler, "transport", None)
        if transport is not None and all(page.transport is not transport for page in self.pages):
            transport.abort()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Token, Host and Origin: a page of another site has none of them, even if its name leads here."""
        if not request.raw_path.isascii():
            self.refused += 1
            return web.Response(status=400, text="An address has no byte above 0x7f.\n", headers={**HEADERS, "Connection": "close"})
        token = request.query.get("token", "")
        origin, host = request.headers.get("Origin"), request.headers.get("Host", "")
        ok = hmac.compare_digest(token.encode("utf-8", "backslashreplace"), self.token.encode()) and host in self._hosts()
        if origin is not None or request.path == "/socket":
            ok = ok and origin == f"http://{host}"
        if not ok:
            self.refused += 1
            return web.Response(status=403, text="The address with its token is needed, as the program has printed it.\n",
                                headers={**HEADERS, "Connection": "close"})
        try:
            response: web.StreamResponse = await handler(request)
        except (web.HTTPException, ConnectionError):
            raise
        except Exception as error:
            self._report(error)
            return web.Response(status=500, text=f"{type(error).__name__}: {error}\n", headers={**HEADERS, "Connection": "close"})
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    def _hosts(self) -> set[str]:
        names = {"127.0.0.1", "localhost", "[::1]", f"[{self.address}]" if ":" in self.address else self.address}
        if self.address in ("0.0.0.0", "::"):
            import socket

            names |= {socket.gethostname(), socket.getfqdn()} | {each[4][0] for each in _own_addresses()}
        return {f"{name}:{self.port}" for name in names}

    async def _page(self, request: web.Request) -> web.Response:
        return web.Response(text=page_text(self.parts, self._facts()), content_type="text/html")

    def _facts(self) -> dict[str, Any]:
        facts, scene = self.session.facts, self.session.facts.scene
        limits = scene.limits.tolist()
        return {"built": self._built, "axes": facts.axes, "axis_coordinates": scene.axis_coordinates.tolist(),
                "coordinates": facts.coordinates, "limits": [[_bound(x) for x in row] for row in limits],
                "poses": facts.poses, "objects": facts.objects, "all_objects": [name for name, _ in scene._core.all_objects()], "driven": facts.driven,
                "masses": facts.masses.tolist(), "muscles": [each.name for each in scene.muscles],
                "muscle_groups": {name: of.tolist() for name, of in scene.muscle_groups.items()},
                "hands": scene.hands, "persons": _persons(scene.resolved), "effects": scene.effects, "duration": scene.duration,
                "numbers": facts.numbers}

    async def _save(self, request: web.Request) -> web.Response:
        """The moment or the recording, as a file."""
        from .saving import save

        what = request.match_info["what"]
        try:
            name, data = await asyncio.wrap_future(self.session.call(lambda session: save(session, what)))
        except Error as error:
            return web.Response(status=409, text=str(error) + "\n")
        return web.Response(body=data, content_type="application/octet-stream",
                            headers={"Content-Disposition": f'attachment; filename="{name}"'})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if len(self.pages) >= PAGES:
            self.refused += 1
            return web.Response(status=503, text=f"{PAGES} pages are open, and no more can be.\n")
        socket = web.WebSocketResponse(max_msg_size=LARGEST_MESSAGE, compress=False, heartbeat=20, timeout=2)
        await socket.prepare(request)
        page = Page(socket, request.transport)
        page.scene = self._built
        self.pages.add(page)
        sender = asyncio.ensure_future(self._feed(page, request))
        page.news.set()
        try:
            async for message in socket:
                if message.type is not WSMsgType.TEXT or not await self._heard(page, message.data):
                    break
        finally:
            self.pages.discard(page)
            sender.cancel()
            for slot in page.springs:
                self._send(page, Command("spring", {"id": slot, "row": None}, f"spring {slot}"))
            await socket.close()
        return socket

    async def _heard(self, page: Page, text: str) -> bool:
        """A message of a page. :returns: False where the page is to be closed"""
        now = int(time.monotonic())
        page.second, page.count = now, page.count + 1 if now == page.second else 1
        if page.count > MESSAGES_PER_SECOND:
            page.faults = FAULTS
        try:
            message = json.loads(text)
            if isinstance(message, dict) and "hands" in message and self._on_frame is not None:
                self._on_frame(message)
            else:
                command = read_command(message, self.session.facts)
                if command.name == "spring":
                    (page.springs.discard if command.values["row"] is None else page.springs.add)(command.values["id"])
                self._send(page, command)
            return True
        except (ValueError, RecursionError):
            problem = "got a text that is no JSON"
        except Error as error:
            problem = str(error)
        except Exception as error:  # of a frame, whose numbers may be any
            problem = f"{type(error).__name__}: {error}"
        page.faults += 1
        if page.faults >= FAULTS:
            return False
        try:
            await asyncio.wait_for(page.socket.send_str(json.dumps({"problem": problem})), PATIENCE)
        except (asyncio.TimeoutError, ConnectionError, RuntimeError):
            return False
        return True

    def _send(self, page: Page, command: Command) -> None:
        try:
            self.session.send(command)
        except Error:
            page.faults += 1

    async def _feed(self, page: Page, request: web.Request) -> None:
        """Sends a page what is new, as fast as it reads."""
        try:
            while True:
                await page.news.wait()
                page.news.clear()
                await asyncio.wait_for(self._tell(page), PATIENCE)
        except Exception as error:
            if not isinstance(error, (asyncio.TimeoutError, ConnectionError, RuntimeError)):
                self._report(error)
            if request.transport is not None:
                request.transport.abort()

    async def _tell(self, page: Page) -> None:
        view, state = self.session.view, self.session.state
        if view.built != self._built:
            await self._rebuild(view.built)
        if page.scene != self._built:
            page.scene, page.seen = self._built, None
            await page.socket.send_str(json.dumps({**self.parts.scene, **self._facts()}, allow_nan=False))
        if view is not page.seen and view.built == self._built:
            await page.socket.send_bytes(encode(view, page.seen))
            page.seen = view
        if state is not page.told:
            changed = {key: value for key, value in state.items() if page.told is None or page.told.get(key) != value}
            page.told = state
            if changed:
                await page.socket.send_str(json.dumps({"state": changed}, allow_nan=False))

    async def _rebuild(self, built: int) -> None:
        """The page's parts of a scene that was built anew; in another thread."""
        course = self.session.course
        parts = await self._loop.run_in_executor(None, Parts, self.session.files, dict(course.overrides))
        self.session.shape_index = parts.shape_index
        self.parts, self._built = parts, built


class _Closed(asyncio.Protocol):
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        transport.abort()  # type: ignore[attr-defined]


def _persons(resolved: str) -> list[dict[str, float]]:
    """Stature [m] and mass [kg] of the persons of a resolved scene, hand by hand."""
    found = re.findall(r"^    person:\n((?:      .*\n)*)", resolved, re.M)
    values = [dict(re.findall(r"^      (stature|mass): \"?([-+.\de]+)", text, re.M)) for text in found]
    return [{key: float(value) for key, value in each.items()} for each in values]


def _bound(value: float) -> Optional[float]:
    return value if abs(value) < 1e9 else None


def _own_addresses() -> Any:
    import socket

    try:
        return socket.getaddrinfo(socket.gethostname(), None)
    except OSError:
        return []


