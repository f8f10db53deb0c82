"""Messages that nobody should send, drawn by a seed: frames for ZeroMQ, bytes for the bare port."""

import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from legato.control.table import METHODS
from legato.wire.jsonrpc import MAX_BYTES

Rng = np.random.Generator
Frames = list[bytes]

WRONG: tuple[Any, ...] = (
    None, True, -1, 0, 1.5, 1e308, 2**70, -(2**63) - 1, "", "x" * 4096, "\u0000", "../../etc", [],
    [[]], {}, {"a": {}}, ["P1"], {"xyz_mm": None}, "NaN", [1, 2], "\ufffe", -0.0, 1e-320,
)  # fmt: skip
NAMES = (
    "key", "lease", "expires_at", "session", "timeout_s", "limit", "boot", "seq", "xyz_mm",
    "pitch_deg", "roll_deg", "picks", "duration_s", "deadman", "job", "count", "every_s", "for_s",
    "until", "resets", "campaign", "nothing", "__class__",
)  # fmt: skip
UNKNOWN = (
    "",
    "Run",
    "run ",
    "estop\u0000",
    "__init__",
    "eval",
    "describe.describe",
    "x" * 60_000,
    "🦵",
)
HARMLESS = tuple(m for m in METHODS if m not in ("shutdown", "estop", "stop", "reset"))
BODIES = (
    b"", b" ", b"\x00", b"{", b"}", b"[]", b"[{}]", b"null", b"true", b"1", b'"x"', b"{}\n{}",
    b'{"jsonrpc":"2.0"', b'{"jsonrpc":"2.0","id":1,"method":"status"}x', b"\xff\xfe\x00",
    b'{"jsonrpc":"2.0","id":1,"method":"\xc3\x28"}', b'{"jsonrpc":"2.0","id":1,"method":"\\ud800"}',
    b'{"jsonrpc":"2.0","id":NaN,"method":"status"}',
    b'{"jsonrpc":"2.0","id":1,"method":"reference","params":{"pitch_deg":NaN}}',
    b'{"jsonrpc":"2.0","id":1,"method":"reference","params":{"pitch_deg":Infinity}}',
    b'{"jsonrpc":"2.0","id":1e999,"method":"status"}', b'{"jsonrpc":"1.0","id":1,"method":"ping"}',
    b'{"jsonrpc":"2.0","id":1,"id":2,"method":"ping","method":"nothing"}',
    b'{"jsonrpc":"2.0","id":{},"method":"ping"}', b'{"jsonrpc":"2.0","id":true,"method":"ping"}',
    b'{"jsonrpc":"2.0","id":1,"method":7}', b'{"jsonrpc":"2.0","id":1,"method":"ping","params":[]}',
    b'{"jsonrpc":"2.0","id":1,"method":"ping","key":"x"}', b"\xef\xbb\xbf{}",
)  # fmt: skip


def message(rng: Rng) -> Frames:
    """Return the frames of one message that is no request, or one that asks for nonsense."""
    kinds: tuple[Callable[[Rng], Frames], ...] = (
        fixed, many, noise, huge, deep, misspelt, misfit, cut, empty_delimiters,
    )  # fmt: skip
    return kinds[rng.integers(len(kinds))](rng)


def fixed(rng: Rng) -> Frames:
    """Return a body of the list."""
    return [BODIES[rng.integers(len(BODIES))]]


def many(rng: Rng) -> Frames:
    """Return too many frames."""
    return [rng.bytes(int(rng.integers(0, 20))) for _ in range(rng.integers(2, 200))]


def noise(rng: Rng) -> Frames:
    """Return random bytes."""
    return [rng.bytes(int(rng.integers(1, 2000)))]


def huge(rng: Rng) -> Frames:
    """Return what is longer than allowed, by a byte or by far."""
    size = MAX_BYTES + int(rng.choice([1, 100, 1_000_000]))
    return [call("status", {"x": "y" * size})]


def deep(rng: Rng) -> Frames:
    """Return brackets in brackets."""
    depth = int(rng.choice([17, 40, 1000, 30_000]))
    opened = b"[" * depth
    closed = b"]" * depth if rng.random() < 0.7 else b""
    return [b'{"jsonrpc":"2.0","id":1,"method":"status","params":{"x":' + opened + closed + b"}}"]


def misspelt(rng: Rng) -> Frames:
    """Return a method that does not exist."""
    return [call(str(rng.choice(UNKNOWN)), {})]


def misfit(rng: Rng) -> Frames:
    """Return a method with parameters of the wrong kind; none that would act."""
    return [call(str(rng.choice(HARMLESS)), wrong_params(rng))]


def wrong_params(rng: Rng) -> dict[str, Any]:
    """Return parameters of which at least one does not exist."""
    names = rng.choice(NAMES, int(rng.integers(1, 4)), replace=False)
    found = {str(name): WRONG[rng.integers(len(WRONG))] for name in names}
    return found | {"nothing": 1}


def cut(rng: Rng) -> Frames:
    """Return half a request, or one with a byte changed to what JSON does not have."""
    body = bytearray(call("status", {}))
    if rng.random() < 0.5:
        return [bytes(body[: rng.integers(1, len(body))])]
    body[rng.integers(len(body))] = int(rng.integers(128, 256))
    return [bytes(body)]


def empty_delimiters(rng: Rng) -> Frames:
    """Return frames that are empty, with or without something behind them."""
    return [b""] * int(rng.integers(1, 5)) + ([call("status", {})] if rng.random() < 0.3 else [])


def call(method: str, params: Any) -> bytes:
    """Return a request as bytes."""
    document = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params}
    return json.dumps(document, ensure_ascii=False).encode("utf-8", "surrogatepass")


def wish(rng: Rng) -> bytes:
    """Return what a subscriber never sends to an XPUB."""
    first = bytes([int(rng.choice([0, 1, 2, 255]))])
    return first + rng.bytes(int(rng.choice([0, 1, 30, 60_000])))


GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x01"


def raw(rng: Rng) -> bytes:
    """Return what comes to the bare TCP port: no ZeroMQ, half a greeting, half a handshake."""
    curve = GREETING + b"CURVE".ljust(20, b"\0") + bytes(32)
    null = GREETING + b"NULL".ljust(20, b"\0") + bytes(32)
    hello = b"\x04\xc8\x05HELLO\x01\x00" + bytes(72) + rng.bytes(120)
    ready = b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x06DEALER"
    size = struct.pack(">Q", int(rng.choice([2**63 - 1, 2**40, 65_537])))
    choices = (
        b"", b"GET / HTTP/1.1\r\nHost: cell\r\n\r\n", b"\x16\x03\x01\x02\x00\x01", rng.bytes(300),
        GREETING, GREETING[:5], b"\x01\x00", b"\xff" * 64, curve, curve + hello[:60], curve + hello,
        null + ready, null + ready + b"\x02" + size, null + ready + b"\x00\xff" + rng.bytes(10),
        null + rng.bytes(200), GREETING + b"PLAIN".ljust(20, b"\0") + bytes(32) + b"\x04\x06\x05HE",
        null + ready + b"\x04\x05\x04PING" + rng.bytes(30), curve + rng.bytes(100),
    )  # fmt: skip
    return choices[rng.integers(len(choices))]
