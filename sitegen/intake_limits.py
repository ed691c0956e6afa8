"""Who may send an upload now: rate, origin and token. Knows headers as a mapping, no web framework."""

import hmac
import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil
from urllib.parse import urlsplit

_LOOPBACK = {"localhost", "127.0.0.1", "::1"}
_MAX_TOKEN_CHARS = 500


class RefusalError(Exception):
    """A request that is not answered as asked: the HTTP status, a plain sentence, further headers."""

    def __init__(self, status: int, message: str, headers: Mapping[str, str] | None = None) -> None:
        """`message` is shown to the visitor."""
        super().__init__(message)
        self.status = status
        self.message = message
        self.headers = dict(headers or {})


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """What a server takes. `token` is empty when none is asked for; `idle_seconds` bound each wait for
    bytes, `total_seconds` a whole request; `only_local` says that the server answers to this computer's
    own names only."""

    max_bytes: int = 64 * 2**20
    per_minute: int = 30
    burst: int = 60
    token: str = ""
    trust_proxy: bool = False
    only_local: bool = True
    idle_seconds: float = 20.0
    total_seconds: float = 600.0


class RateLimit:
    """A token bucket an address; the addresses seen longest ago are forgotten.

    An IPv6 network of 64 bits is one address.
    """

    def __init__(
        self,
        per_minute: int,
        burst: int,
        *,
        remembered: int = 10_000,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`clock` gives seconds."""
        self._rate = per_minute / 60
        self._burst = float(burst)
        self._remembered = remembered
        self._clock = clock
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait(self, address: str) -> int:
        """0 when the address may go on, and it is counted; else the seconds to wait."""
        address = _network(address)
        now = self._clock()
        left, before = self._buckets.pop(address, (self._burst, now))
        left = min(self._burst, left + (now - before) * self._rate)
        may = left >= 1
        self._buckets[address] = (left - 1 if may else left, now)
        while len(self._buckets) > self._remembered:
            self._buckets.popitem(last=False)
        return 0 if may else max(1, ceil((1 - left) / self._rate))


def _network(address: str) -> str:
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return "unknown"
    if isinstance(parsed, ipaddress.IPv6Address):
        if parsed.ipv4_mapped:
            return str(parsed.ipv4_mapped)
        return str(ipaddress.ip_network((parsed, 64), strict=False))
    return str(parsed)


def client_address(peer: str, headers: Mapping[str, str], trust_proxy: bool) -> str:
    """The address of the visitor: the peer's, or the last one that a trusted proxy wrote down."""
    if not trust_proxy:
        return peer
    return headers.get("x-forwarded-for", "").rpartition(",")[2].strip() or peer


def check_origin(headers: Mapping[str, str], only_local: bool) -> None:
    """Raise RefusalError for a request that another site makes through a visitor's browser.

    Programs that are no browsers send none of these headers and pass. A server for this computer only
    must be called by a name of it, so that no other site's name can be made to lead here.
    """
    host = headers.get("host", "")
    if only_local and _host_name(host) not in _LOOPBACK:
        raise RefusalError(
            403,
            "This server answers to this computer's own names only. Behind a proxy, start it with "
            "--trust-proxy.",
        )
    site = headers.get("sec-fetch-site")
    origin = headers.get("origin")
    foreign = site not in {"same-origin", "none"} if site else bool(origin) and not _is_same(origin, host)
    if foreign:
        raise RefusalError(
            403, "This came from another site's page. Open the upload page here and send it again."
        )


def _is_same(origin: str | None, host: str) -> bool:
    """Whether an Origin names the host that was asked; a proxy may have taken off the TLS."""
    parts = urlsplit(origin or "")
    return parts.scheme in {"http", "https"} and bool(host) and parts.netloc.lower() == host.lower()


def _host_name(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def bearer(headers: Mapping[str, str]) -> str:
    """The token of an Authorization header, empty when there is none."""
    kind, _, value = headers.get("authorization", "").partition(" ")
    return value.strip() if kind.lower() == "bearer" else ""


def check_token(given: str, wanted: str) -> None:
    """Raise RefusalError unless the token is right; takes as long for one wrong token as for another."""
    if not wanted:
        return
    if not hmac.compare_digest(given[:_MAX_TOKEN_CHARS].encode("utf-8", "replace"), wanted.encode()):
        raise RefusalError(
            401,
            "The token is missing or wrong. Ask the organiser for it; in a form it goes before the file, "
            "else in the header `Authorization: Bearer TOKEN`.",
            {"WWW-Authenticate": "Bearer"},
        )
