"""JSON-RPC 2.0 over ZeroMQ frames: bytes to calls and back, without a socket.

Every message gives a `Call` or a `Malformed` with the error to answer; nothing raises. One frame
of JSON follows the sender's identity, with or without an empty delimiter, and the answer goes back
the same way. Batches, NaN, deep or huge documents and parameters by position are refused.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, cast

import msgspec
from msgspec import UNSET, Struct, UnsetType

from legato.wire.requests import REQUESTS, STOP_LINE, Ping, Request, StopNow

MAX_BYTES: Final = 64 * 1024
MAX_DEPTH: Final = 16
MAX_ID_LENGTH: Final = 256

Id = str | int | float | None
Route = tuple[bytes, ...]

CODES: Final[dict[str, int]] = {
    "parse_error": -32700,
    "invalid_request": -32600,
    "method_not_found": -32601,
    "invalid_params": -32602,
    "internal_error": -32603,
    "refused_in_state": -32000,
    "precondition": -32001,
    "not_authorised": -32002,
    "busy": -32003,
    "in_fault": -32004,
    "unavailable": -32005,
    "expired": -32006,
}


class Failure(Exception):
    """An error to answer with: its name in CODES, why, and what to do."""

    def __init__(self, name: str, reason: str, hint: str = "") -> None:
        self.name = name
        self.code = CODES[name]
        self.reason = reason
        self.hint = hint
        super().__init__(f"{name}: {reason}")


class Call(Struct, frozen=True):
    """A well-formed request: who is to be answered, and what is asked."""

    route: Route
    method: str
    params: Mapping[str, Any] = {}
    id: Id = None
    notification: bool = False


class Malformed(Struct, frozen=True):
    """A message that is no request, with the error to answer."""

    route: Route
    failure: Failure
    id: Id = None


class _Envelope(Struct, frozen=True, forbid_unknown_fields=True):
    """A request as nearly all are."""

    jsonrpc: Literal["2.0"]
    method: str
    id: int | float | str | UnsetType | None = UNSET
    params: dict[str, Any] = {}


class _Id(Struct, frozen=True):
    """Of a request that is not read, the one thing that its sender knows the answer by."""

    id: int | float | str | None = None


_ENVELOPE: Final = msgspec.json.Decoder(_Envelope)
_ID: Final = msgspec.json.Decoder(_Id)
# msgspec learns a type when it is first used, and crashes the process where two threads, here the
# loop and the stop line, come to do so at once: it learns them all while there is but one.
_LEARNT: Final = [msgspec.json.Decoder(kind) for kind in (*REQUESTS.values(), *STOP_LINE.values())]


def receive(frames: Sequence[bytes]) -> Call | Malformed:
    """Return what the frames of one ROUTER message say; the first is the sender's identity."""
    route, body = _split(frames)
    if body is None:
        text = f"a request is one frame of JSON, this message has {len(frames) - 1}"
        return Malformed(route, Failure("invalid_request", text))
    if len(body) > MAX_BYTES:
        return Malformed(route, too_long(len(body)), _id_of(body))
    # So few brackets cannot nest too deep; most requests need no closer look.
    shallow = body.count(b"{") + body.count(b"[") <= MAX_DEPTH
    usual = _usual(route, body) if shallow else None
    if usual is not None:
        return usual
    try:
        document = msgspec.json.decode(body)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, ValueError) as error:
        return Malformed(route, Failure("parse_error", f"not JSON: {error}"))
    return _call(route, document, shallow=shallow)


def too_long(size: int) -> Failure:
    """Return the error of a request of so many bytes."""
    reason = f"the request has {size} bytes, at most {MAX_BYTES} are allowed"
    return Failure("invalid_request", reason, "send less at a time")


def decode_params(call: Call) -> Request:
    """Return the typed request of a call; raises Failure (unknown method, unfit parameters)."""
    return cast(Request, _converted(call, REQUESTS, "describe lists them all"))


def decode_stop(call: Call) -> Ping | StopNow:
    """Return the typed request of a call on the stop line; raises Failure."""
    hint = "this is the stop line: ping, stop and estop; ask the request line for all else"
    return cast(Ping | StopNow, _converted(call, STOP_LINE, hint))


def _converted(call: Call, methods: Mapping[str, type[msgspec.Struct]], hint: str) -> Any:
    """Return a call's parameters as its method's type; `hint` helps with an unknown method."""
    kind = methods.get(call.method)
    if kind is None:
        raise Failure("method_not_found", f"there is no method {call.method[:64]!r} here", hint)
    try:
        return msgspec.convert(call.params, kind, strict=True)
    except msgspec.ValidationError as error:
        hint = "describe gives each method's parameters"
        raise Failure("invalid_params", f"{call.method}: {error}", hint) from error


def answer(route: Route, call_id: Id, result: Any) -> list[bytes]:
    """Return the frames of a result."""
    return [*route, encode({"jsonrpc": "2.0", "id": call_id, "result": result})]


def refuse(route: Route, call_id: Id, failure: Failure, state: str) -> list[bytes]:
    """Return the frames of an error, with the state that the cell is in."""
    data = {"reason": failure.reason, "state": state, "hint": failure.hint}
    error = {"code": failure.code, "message": failure.name, "data": data}
    return [*route, encode({"jsonrpc": "2.0", "id": call_id, "error": error})]


def encode(document: Any) -> bytes:
    """Return JSON; numbers that are not finite become null, since JSON has none.

    Arrays and numpy's numbers go as lists and numbers; what JSON cannot say goes as its text.
    """
    return _ENCODER.encode(document)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


_ENCODER: Final = msgspec.json.Encoder(enc_hook=_plain)


def _split(frames: Sequence[bytes]) -> tuple[Route, bytes | None]:
    """Return whom to answer and how, and the body, None where there is not exactly one."""
    if len(frames) == 2:
        return (frames[0],), frames[1]
    if len(frames) > 2 and frames[1] == b"":
        return (frames[0], b""), frames[2] if len(frames) == 3 else None
    return (frames[0],), None


def _usual(route: Route, body: bytes) -> Call | None:
    """Return the call of a body as nearly all are; None where it needs a closer look."""
    try:
        asked = _ENVELOPE.decode(body)
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None
    if asked.id is UNSET:
        return Call(route, asked.method, asked.params, notification=True)
    return Call(route, asked.method, asked.params, asked.id) if _is_id(asked.id) else None


def _call(route: Route, document: Any, *, shallow: bool) -> Call | Malformed:
    """Return the call that a decoded document is."""

    def malformed(reason: str, name: str = "invalid_request") -> Malformed:
        return Malformed(route, Failure(name, reason), call_id)

    call_id: Id = None
    if isinstance(document, list):
        return malformed("batches are not supported: send one request a message")
    if not isinstance(document, dict):
        return malformed("a request is a JSON object")
    if _is_id(document.get("id")):
        call_id = document.get("id")
    elif "id" in document:
        return malformed(f"id is a number, null, or a string of at most {MAX_ID_LENGTH} characters")
    if not shallow and _too_deep(document):
        return malformed(f"nested deeper than {MAX_DEPTH}")
    if document.get("jsonrpc") != "2.0":
        return malformed('jsonrpc must be "2.0"')
    method, params = document.get("method"), document.get("params", {})
    if not isinstance(method, str):
        return malformed("method must be a string")
    # A `key` beside `params` instead of in it would make a repeated job run twice.
    unknown = sorted(set(document) - {"jsonrpc", "id", "method", "params"})
    if unknown:
        return malformed(f"unknown member {unknown[0][:64]!r}: parameters belong into params")
    if not isinstance(params, dict):
        return malformed("params is an object: parameters go by name", "invalid_params")
    return Call(route, method, params, call_id, notification="id" not in document)


def _id_of(body: bytes) -> Id:
    """Return the id in a body that is not looked at any further, None where there is none."""
    try:
        found = _ID.decode(body).id
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return found if _is_id(found) else None


def _is_id(value: Any) -> bool:
    """Say whether a value can be a call's id and can be sent back as it came."""
    if isinstance(value, bool):
        return False
    if isinstance(value, int):
        return -(2**63) <= value < 2**64
    if isinstance(value, str):
        return len(value) <= MAX_ID_LENGTH
    return value is None or isinstance(value, float)


def _too_deep(document: Any) -> bool:
    """Say whether a decoded document is nested deeper than MAX_DEPTH."""
    level = [document]
    for _ in range(MAX_DEPTH + 1):
        level = [child for item in level for child in _children(item)]
        if not level:
            return False
    return True


def _children(item: Any) -> Sequence[Any]:
    if isinstance(item, dict):
        return list(item.values())
    return item if isinstance(item, list) else ()
