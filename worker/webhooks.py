"""Tells the address that a job names how the job fares, after the Standard Webhooks specification.

What is to be told is written to Redis by the same atomic step that changes the job (`worker.steps`), so
nothing is forgotten; it may be told twice, under the same id.

    gcvec:deliveries      "ID STATUS" by the time at which it is to be told
    gcvec:told:ID STATUS  how often that was tried
    gcvec:try:ID STATUS   a token of who has begun to try it last
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import json
import socket
import uuid
from datetime import UTC, datetime
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address
from typing import Any, Final
from urllib.parse import urlsplit

import httpx

from worker.job import Job
from worker.steps import Call

DELIVERIES: Final = "gcvec:deliveries"
SECRET_PREFIX: Final = "whsec_"

_SECONDS: Final = 10.0
_TRIES_KEPT_SECONDS: Final = 7 * 86_400
_EMBEDDING: Final = tuple(
    map(
        IPv6Network,
        (
            "::/96",
            "::ffff:0:0/96",
            "::ffff:0:0:0/96",
            "64:ff9b::/96",
            "64:ff9b:1::/48",
            "2001::/32",
            "2002::/16",
            "fec0::/10",
        ),
    )
)
"""Addresses that lead to one of IPv4: compatible, mapped and translated ones, NAT64 (RFC 6052 and 8215),
Teredo and 6to4; and those of sites, which there are no longer (RFC 3879)."""

_SCHEMES: Final = {"https": 443, "http": 80}


_BEGIN_TRY = """
if not redis.call('ZSCORE', KEYS[1], ARGV[1]) then return 0 end
if redis.call('GET', KEYS[3]) == ARGV[4] then return 1 end
if (redis.call('GET', KEYS[2]) or '0') ~= ARGV[2] then return 0 end
redis.call('SET', KEYS[2], ARGV[2] + 1, 'EX', ARGV[3])
redis.call('SET', KEYS[3], ARGV[4], 'EX', ARGV[3])
return 1
"""


class UnsafeTargetError(Exception):
    """The address may not be called."""


def tries_key(entry: str) -> str:
    return f"gcvec:told:{entry}"


def token_key(entry: str) -> str:
    return f"gcvec:try:{entry}"


def begin_try(entry: str, tries: int) -> Call:
    """Count a try that follows on so many others; returns 0 if it has been made, or the entry is settled.

    While messages wait the same may be sent more than once: whichever is taken first makes the try, and a
    token says that it does where the answer is lost.
    """
    keys = (DELIVERIES, tries_key(entry), token_key(entry))
    return Call(_BEGIN_TRY, keys, (entry, tries, _TRIES_KEPT_SECONDS, uuid.uuid4().hex))


def event_name(status: str) -> str:
    """The event that a job with this status amounts to."""
    return f"job.{'started' if status == 'running' else status}"


def message(job: Job, status: str) -> bytes:
    """What is told: small, with links to the rest."""
    data: dict[str, Any] = {"id": job.id, "status": status, "links": {"self": f"/v1/jobs/{job.id}"}}
    if status == "failed":
        data["error"] = job.error
    at = job.started_at if status == "running" else job.finished_at
    timestamp = datetime.fromtimestamp(at or job.created_at, UTC).isoformat()
    return json.dumps({"type": event_name(status), "timestamp": timestamp, "data": data}).encode()


def signed_headers(secret: str, identity: str, seconds: int, body: bytes) -> dict[str, str]:
    """The headers by which a receiver checks that the message is ours, and recent."""
    key = base64.b64decode(secret.removeprefix(SECRET_PREFIX))
    content = b".".join((identity.encode(), str(seconds).encode(), body))
    signature = base64.b64encode(hmac.new(key, content, hashlib.sha256).digest()).decode()
    return {
        "webhook-id": identity,
        "webhook-timestamp": str(seconds),
        "webhook-signature": f"v1,{signature}",
        "content-type": "application/json",
    }


def check_target(url: str, *, private: bool) -> None:
    """Raise UnsafeTargetError for an address that could not be called, as far as can be seen without asking.

    `private` allows addresses of our own network, and plain HTTP.
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname or "", parts.port
    except ValueError:
        raise UnsafeTargetError("this is not a URL") from None
    if parts.scheme not in _SCHEMES or not host or not url.isascii() or not url.isprintable() or " " in url:
        raise UnsafeTargetError("this is not an https URL")
    if parts.username is not None or parts.password is not None:
        raise UnsafeTargetError("a URL with a user name is not accepted")
    if private:
        return
    if parts.scheme != "https":
        raise UnsafeTargetError("only https is called")
    try:
        address = ip_address(host)
    except ValueError:
        return
    if not is_public(address):
        raise UnsafeTargetError("this is not a public address")


def post(url: str, headers: dict[str, str], body: bytes, *, private: bool) -> int:
    """Call the address; the status of the answer. Redirects and proxies are not followed.

    The name is resolved once, and the connection goes to the address that was checked. Raises
    UnsafeTargetError, OSError (TimeoutError where the call takes more than ten seconds, once the name is
    resolved) and httpx.HTTPError.
    """
    check_target(url, private=private)
    parts = urlsplit(url)
    host = parts.hostname or ""
    port = parts.port or _SCHEMES[parts.scheme]
    address = _resolve(host, port, private=private)
    place = f"[{address}]:{port}" if address.version == 6 else f"{address}:{port}"
    pinned = parts._replace(netloc=place, fragment="").geturl()
    named = {**headers, "host": parts.netloc}
    return asyncio.run(_status_of(pinned, named, body, host))


async def _status_of(url: str, headers: dict[str, str], body: bytes, host: str) -> int:
    """The status of the answer, which has to be there soon: a receiver may not hold us by dribbling."""
    verified = {"sni_hostname": host}  # the certificate must be the name's
    async with (
        asyncio.timeout(_SECONDS),
        httpx.AsyncClient(trust_env=False, timeout=_SECONDS) as client,
        client.stream("POST", url, headers=headers, content=body, extensions=verified) as answer,
    ):
        return answer.status_code


def _resolve(host: str, port: int, *, private: bool) -> IPv4Address | IPv6Address:
    """The address of a name; all that it has must be allowed."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    addresses = [ip_address(str(entry[4][0]).partition("%")[0]) for entry in found]
    if not private and not all(map(is_public, addresses)):
        raise UnsafeTargetError("the name leads to an address that is not public")
    return addresses[0]


def is_public(address: IPv4Address | IPv6Address) -> bool:
    """Whether it is an address of the internet; one that embeds another is not."""
    if isinstance(address, IPv6Address) and any(address in network for network in _EMBEDDING):
        return False
    return address.is_global and not address.is_multicast
