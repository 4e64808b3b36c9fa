"""The door of the studio: one address, its own names, its own page, and only who has the token."""

from __future__ import annotations

import hmac
import logging
import mimetypes
import os
import re
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from http import HTTPStatus
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from warpflat.core import InputError, quote_value

__all__ = ["Door"]

# What a browser names in Host, and in Origin after "http://": a name or an address, and the port unless that is 80.
_AUTHORITY = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([\w.-]+))(?::([1-9]\d{0,4}))?", re.ASCII)
# The page's messages take some hundred bytes.
_LONGEST_MESSAGE = 2**16
# The page is dark where the system is; viser's own page would be light everywhere.
_FOLLOW_SYSTEM = (
    b"<script>window.__VISER_EMBED_CONFIG__="
    b"{darkMode:matchMedia('(prefers-color-scheme: dark)').matches}</script></head>"
)
# How a connection ends whose client does not keep to the protocol: wrong frames, no UTF-8, too long.
_UNREADABLE = (1002, 1007, 1009)


class Door:
    """Where a studio listens, and who may come in.

    A browser lets any page talk to this machine, and a name of somebody else may be made to mean it (DNS rebinding). So a request must
    name this studio by one of its own names, come from its own page, and have the token in its path.

    Attributes:
        url: of the page, with the token in its path.
        opens: who can reach it besides this machine, one line; empty if nobody can.
    """

    def __init__(self, host: str, port: int) -> None:
        """Listen on an address and no other.

        Args:
            host: a name or an address of this machine; 0.0.0.0 or :: for all of its addresses.
            port: 0 for any that is free.

        Raises:
            InputError: the port is taken, or the address is not of this machine.
        """
        if not host.strip():
            raise InputError(
                "--host is empty; give 127.0.0.1 for this machine only, or 0.0.0.0 for every network it is in"
            )
        try:
            family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            self._socket = socket.create_server(address, family=family)
        except (OSError, ValueError) as error:
            # What Python adds to the system's words names the address once more.
            number = error.errno or 0 if isinstance(error, OSError) else 0
            reason = (os.strerror(number) if number > 0 else getattr(error, "strerror", str(error))).lower()
            raise InputError(f"cannot serve on {host}:{port}: {reason}; give another --port, or --host") from None
        self._port: int = self._socket.getsockname()[1]
        bound = ip_address(self._socket.getsockname()[0].partition("%")[0])
        # Browsers take no address that means all of them.
        shown = host if not bound.is_unspecified else "127.0.0.1" if bound.version == 4 else "::1"
        authority = f"[{shown}]:{self._port}" if ":" in shown else f"{shown}:{self._port}"
        if not _AUTHORITY.fullmatch(authority):
            self._socket.close()
            raise InputError(
                f"--host {quote_value(host)} is no address that browsers take; give 127.0.0.1, or [::1] as ::1"
            )
        self._names = {_name(name) for name in ("localhost", "127.0.0.1", "::1", shown)} | {bound}
        self._token = secrets.token_hex(16)
        self.url, self.opens = f"http://{authority}/{self._token}/", ""
        if bound.is_unspecified:
            others = socket.gethostname()
            self._names.add(_name(others))
            self.opens = (
                f"--host {host} opens the studio to every machine that can reach this one; there it is "
                f"http://{others}:{self._port}/{self._token}/"
            )
        elif not bound.is_loopback:
            self.opens = f"--host {host} opens the studio to every machine that can reach that address"
        if self.opens:
            self.opens += (
                "; who has the address with its token can change, save and run the scene, and nothing is encrypted: "
                "use it only in a network that you trust"
            )

    @contextmanager
    def guard(
        self,
        read: Callable[[str | bytes], bytes],
        refuse: Callable[[str], None],
        saved_file: Callable[[str], Path | None],
    ) -> Iterator[None]:
        """Let the viser server that is started meanwhile listen here, and hear only what may come in.

        viser leaves no way to look at a request before it is answered, so the function that it serves with is replaced.

        Args:
            read: returns what the server is to read instead of a message; raises InputError if it is to read nothing.
            refuse: called with the reason, in one line, why a message of the page was not read.
            saved_file: returns the file that "saved/NAME" means, None for none.
        """

        class Connection(ServerConnection):
            async def recv(self, decode: bool | None = None) -> Any:
                while True:
                    try:
                        return read(await super().recv(decode))
                    except InputError as error:
                        refuse(f"a message of the page was refused: {error}")
                    except ConnectionClosed as closed:
                        if closed.sent is not None and closed.sent.code in _UNREADABLE:
                            refuse(f"a page was cut off, since its message cannot be read: {closed.sent.reason}")
                        raise

        serve = websockets.asyncio.server.serve
        served = False

        def guarded(handler: Any, host: str, port: int, *, process_request: Any, **options: Any) -> Any:
            nonlocal served
            served = True

            def answer(connection: ServerConnection, request: Request) -> Response | None:
                refusal = self._refusal(connection, request)
                if request.path == "/":
                    # The page itself is changed below.
                    request.headers.pop("Accept-Encoding", None)
                try:
                    response = (
                        refusal or _saved(connection, request, saved_file) or process_request(connection, request)
                    )
                    if response is not None and not refusal and request.path == "/":
                        response.body = response.body.replace(b"</head>", _FOLLOW_SYSTEM, 1)
                        del response.headers["Content-Length"]
                        response.headers["Content-Length"] = str(len(response.body))
                except Exception:  # whatever viser stumbles over in a request is the fault of who sent it
                    response = connection.respond(HTTPStatus.BAD_REQUEST, "no browser asks like this\n")
                if response is not None:
                    response.headers["Referrer-Policy"] = "no-referrer"
                    response.headers["Cache-Control"] = "no-store"
                return response

            # Faults of the program are logged, and nothing of requests that are none.
            logger = logging.getLogger("warpflat.app.studio.door")
            logger.filters = [lambda record: record.getMessage() == "connection handler failed"]
            options |= {"create_connection": Connection, "max_size": _LONGEST_MESSAGE, "logger": logger}
            return serve(handler, sock=self._socket, process_request=answer, **options)

        websockets.asyncio.server.serve = guarded
        try:
            yield
        finally:
            websockets.asyncio.server.serve = serve
        if not served:
            raise RuntimeError(f"viser {viser.__version__} does not serve through websockets.asyncio.server.serve")

    def _refusal(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to who may not come in; take the token from the path of who may."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        names = {*self._names, _name(str(connection.local_address[0]))}
        if len(hosts) != 1 or not self._is_own(hosts[0], names):
            return connection.respond(HTTPStatus.FORBIDDEN, "this is not a name of the studio\n")
        if any(not origin.startswith("http://") or not self._is_own(origin[7:], names) for origin in origins):
            return connection.respond(HTTPStatus.FORBIDDEN, "the studio talks to its own page only\n")
        root, token, path = (request.path.partition("?")[0] + "//").split("/", 2)
        if root or not hmac.compare_digest(token.encode("utf-8", "surrogateescape"), self._token.encode()):
            return connection.respond(HTTPStatus.FORBIDDEN, "open the address that warpflat studio has printed\n")
        request.path = f"/{path.rstrip('/')}"
        asked = request.headers.get_all("Sec-WebSocket-Protocol")
        if "Upgrade" in request.headers and asked != [f"viser-v{viser.__version__}"]:
            return connection.respond(HTTPStatus.BAD_REQUEST, f"the page speaks viser-v{viser.__version__}\n")
        return None

    def _is_own(self, authority: str, names: set[str | IPv4Address | IPv6Address]) -> bool:
        found = _AUTHORITY.fullmatch(authority)
        return found is not None and int(found[3] or 80) == self._port and _name(found[1] or found[2]) in names


def _saved(connection: ServerConnection, request: Request, saved_file: Callable[[str], Path | None]) -> Response | None:
    """Return the answer to a request for a file that was saved; None for any other request."""
    if not request.path.startswith("/saved/"):
        return None
    path = saved_file(unquote(request.path.removeprefix("/saved/")))
    try:
        content = None if path is None else path.read_bytes()
    except OSError:
        content = None
    if path is None or content is None:
        return connection.respond(HTTPStatus.NOT_FOUND, "the run that was saved last has no such file\n")
    response = connection.respond(HTTPStatus.OK, "")
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    del response.headers["Content-Type"], response.headers["Content-Length"]
    response.headers.update({"Content-Type": kind, "Content-Length": str(len(content))})
    return replace(response, body=content)


def _name(host: str) -> str | IPv4Address | IPv6Address:
    """Return a host so that two spellings of one address are equal."""
    try:
        return ip_address(host.partition("%")[0])
    except ValueError:
        return host.lower()
