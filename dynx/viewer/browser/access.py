"""Access to the page: the token in its address, hosts and origins of requests, and what its scripts may do.

A web page from anywhere can open a socket to this machine, and a name of its own that resolves to 127.0.0.1
makes it the same origin (DNS rebinding). So every request needs the token, which only the address of the page
has, names a host of this machine, and comes from the page itself.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from collections.abc import Iterator, Mapping, Sequence
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")

TOKEN_BYTES = 18
"""Length of the token, beyond what anybody can try [bytes]."""


def is_loopback(host: str) -> bool:
    """Check whether an address to listen on is reached from this machine alone."""
    if host in LOOPBACK_NAMES:
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Access:
    """What may use a page: requests for ``/TOKEN/``, for a host of this machine, from the page itself."""

    def __init__(self, host: str) -> None:
        """`host` is the address that the page listens on."""
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        """Secret part of the address of the page."""
        self._names = {host.lower(), *LOOPBACK_NAMES}
        self._any_address = not is_loopback(host)
        if self._any_address:
            name = socket.gethostname().lower()
            self._names |= {name, f"{name}.local"}

    def path_below(self, path: str) -> str | None:
        """Return the path of a request below the token, such as ``/``; None for one without the token."""
        given, slash, rest = path.partition("?")[0].removeprefix("/").partition("/")
        if not secrets.compare_digest(given.encode(), self.token.encode()):
            return None
        return f"/{rest}" if slash else "/"

    def is_ours(self, hosts: Sequence[str], origins: Sequence[str]) -> bool:
        """Check the headers Host and Origin of a request: a host of this machine, and its origin or none."""
        if len(hosts) != 1 or len(origins) > 1:
            return False
        host = hosts[0].strip().lower()
        if not self._is_known(host):
            return False
        return all(urlsplit(each.strip().lower()).netloc == host for each in origins)

    def guard(self, answer: Any, headers: Sequence[tuple[str, str]]) -> Any:
        """Return a function that answers requests of the page as `answer` does, with `headers` added, and
        refuses every other request."""

        def guarded(connection: Any, request: Any) -> Any:
            path = self.path_below(request.path)
            given = request.headers
            if path is None or not self.is_ours(given.get_all("Host"), given.get_all("Origin")):
                return connection.respond(
                    HTTPStatus.FORBIDDEN, "wanted the address of the page, with its token\n"
                )
            request.path = path
            response = answer(connection, request)
            for name, value in headers if response is not None else ():
                response.headers[name] = value
            return response

        return guarded

    def _is_known(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        # A page cannot have an address for its name, unless it comes from there.
        return self._any_address or address.is_loopback


class ContentPolicy:
    """Content security policy of a page: its own scripts alone run, and it reaches nothing else.

    A script of the page has the nonce, which is new for every page; text of a robot cannot have it.
    """

    def __init__(self, connect: str) -> None:
        """`connect` is what the page may fetch, as sources of a policy."""
        self.nonce = secrets.token_urlsafe(TOKEN_BYTES)
        self._connect = connect

    def text(self, handlers: Sequence[str] = ()) -> str:
        """Return the policy; `handlers` are the hashes of handlers that stand in HTML."""
        # The bindings of viser's WebAssembly compile text with Function.
        scripts = [f"'nonce-{self.nonce}'", "'unsafe-eval'", "blob:"]
        if handlers:
            scripts += ["'unsafe-hashes'", *(f"'{each}'" for each in handlers)]
        directives: Mapping[str, str] = {
            "default-src": "'none'",
            "script-src": " ".join(scripts),
            "style-src": "'unsafe-inline'",
            "img-src": "data: blob:",
            "font-src": "data: blob:",
            "media-src": "data: blob:",
            "worker-src": "blob:",
            "connect-src": self._connect,
            "base-uri": "'none'",
            "form-action": "'none'",
        }
        return "; ".join(f"{name} {value}" for name, value in directives.items())

    def headers(self, handlers: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Yield the headers of a page with this policy."""
        yield "Content-Security-Policy", self.text(handlers)
        yield "Referrer-Policy", "no-referrer"
        yield "X-Content-Type-Options", "nosniff"
        yield "Cross-Origin-Resource-Policy", "same-origin"
        yield "Cache-Control", "no-store"
