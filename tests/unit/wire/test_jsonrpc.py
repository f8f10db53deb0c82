"""The wire's law: every message is a call or gets its error; nothing raises."""

import json
import math
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.wire import jsonrpc
from legato.wire.jsonrpc import CODES, MAX_BYTES, Call, Failure, Malformed, receive
from legato.wire.requests import REQUESTS, Massage, Reference, Wait, describe_methods

scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text()
documents = st.recursive(
    scalars, lambda c: st.lists(c) | st.dictionaries(st.text(), c), max_leaves=20
)


def message(**members: object) -> bytes:
    """Return a request's bytes, version and id added."""
    return json.dumps({"jsonrpc": "2.0", "id": 1, "method": "status"} | members).encode()


def received(body: bytes) -> Call | Malformed:
    """Return what a DEALER's one-frame message says."""
    return receive([b"me", body])


def test_a_req_clients_delimiter_is_kept_for_the_answer() -> None:
    """The answer's frames mirror the request's: identity, delimiter if any, JSON."""
    with_delimiter = receive([b"me", b"", message()])
    without = receive([b"me", message()])
    assert isinstance(with_delimiter, Call)
    assert isinstance(without, Call)
    assert jsonrpc.answer(with_delimiter.route, 1, {})[:-1] == [b"me", b""]
    assert jsonrpc.answer(without.route, 1, {})[:-1] == [b"me"]


@pytest.mark.parametrize("call_id", ["a", "", 0, -7, 2**63, 1.5, None])
def test_ids_come_back_as_they_were(call_id: object) -> None:
    """Any id that JSON-RPC allows is returned unchanged, null included."""
    call = received(message(id=call_id))
    assert isinstance(call, Call)
    assert not call.notification
    assert json.loads(jsonrpc.answer(call.route, call.id, 5)[-1])["id"] == call_id


def test_a_request_without_id_is_a_notification() -> None:
    """A missing id is not a null id."""
    call = received(b'{"jsonrpc": "2.0", "method": "status"}')
    assert isinstance(call, Call)
    assert call.notification


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (b"", "parse_error"),
        (b"\xff\xfe", "parse_error"),
        (b'"\xff"', "parse_error"),
        (b'{"jsonrpc": "2.0"', "parse_error"),
        (b'{"jsonrpc": "2.0", "id": NaN, "method": "status"}', "parse_error"),
        (b'{"jsonrpc": "2.0", "id": 1, "method": "wait", "params": {"timeout_s": Infinity}}',
         "parse_error"),
        (b"[" * 30000, "parse_error"),
        (b"[" * 20 + b"]" * 20, "invalid_request"),
        (b"[" + message() + b"]", "invalid_request"),
        (b"7", "invalid_request"),
        (b"{}", "invalid_request"),
        (b" " * (MAX_BYTES + 1), "invalid_request"),
        (message(jsonrpc="1.0"), "invalid_request"),
        (message(method=3), "invalid_request"),
        (message(id=True), "invalid_request"),
        (message(id=[1]), "invalid_request"),
        (message(id=2**70), "invalid_request"),
        (message(id="x" * 300), "invalid_request"),
        (message(key="k"), "invalid_request"),
        (message(params=[1]), "invalid_params"),
        (message(params=None), "invalid_params"),
    ],
)  # fmt: skip
def test_what_is_no_request_gets_its_error(body: bytes, error: str) -> None:
    """Each kind of junk has one designed answer."""
    junk = received(body)
    assert isinstance(junk, Malformed)
    assert junk.failure.name == error


def test_depth_is_limited_where_json_is_still_readable() -> None:
    """A request nested past the limit is refused, one within it is not."""
    assert isinstance(received(message(params={"a": {"b": [1]}})), Call)
    deep: object = 1
    for _ in range(jsonrpc.MAX_DEPTH):
        deep = [deep]
    assert isinstance(received(message(params={"a": deep})), Malformed)


def test_an_error_keeps_the_id_where_it_can_be_read() -> None:
    """A client can match the error of a malformed request to its call."""
    junk = received(message(id=9, method=None))
    assert isinstance(junk, Malformed)
    assert junk.id == 9


@pytest.mark.parametrize(
    ("head", "found"),
    [(b'{"id": 7, "x": "', 7), (b'{"id": {}, "x": "', None), (b'{"id": true, "x": "', None),
     (b'["', None), (b"\xff", None), (b"[" * 3000, None), (b'{"id": "' + b"i" * 300 + b'"', None)],
)  # fmt: skip
def test_of_what_is_too_long_only_the_id_is_read(head: bytes, found: object) -> None:
    """Its sender can match the error, which names the limit."""
    junk = received(head + b"y" * MAX_BYTES + b'"}')
    assert isinstance(junk, Malformed)
    assert junk.id == found
    assert f"at most {MAX_BYTES}" in junk.failure.reason


@pytest.mark.parametrize("rest", [[], [b"a", b"b"], [b"", b"a", b"b"], [b"", b"", b""]])
def test_a_wrong_number_of_frames_is_answered(rest: list[bytes]) -> None:
    """A message of none or many frames is refused, on the way that it came."""
    junk = receive([b"me", *rest])
    assert isinstance(junk, Malformed)
    assert junk.route[0] == b"me"


@given(st.lists(st.binary(max_size=64), max_size=4))
def test_no_frames_raise(rest: list[bytes]) -> None:
    """Whatever bytes arrive, there is a call or an error that can be encoded."""
    found = receive([b"me", *rest])
    if isinstance(found, Malformed):
        json.loads(jsonrpc.refuse(found.route, found.id, found.failure, "idle")[-1])


@given(documents)
def test_no_document_raises(document: object) -> None:
    """Whatever JSON arrives (Python's NaN included), it is a call or an error."""
    found = received(json.dumps(document).encode())
    if isinstance(found, Malformed):
        json.loads(jsonrpc.refuse(found.route, found.id, found.failure, "idle")[-1])


@settings(max_examples=60)
@given(st.sampled_from(sorted(REQUESTS)), st.dictionaries(st.text(max_size=8), documents))
def test_no_parameters_raise_but_invalid_params(method: str, params: dict[str, object]) -> None:
    """Parameters of any shape give a typed request or the error invalid_params."""
    try:
        given_name = type(jsonrpc.decode_params(Call((b"me",), method, params))).__name__
    except Failure as failure:
        given_name = failure.name
    assert given_name in {"invalid_params", REQUESTS[method].__name__}


def test_parameters_become_typed_requests() -> None:
    """Numbers, points and keys arrive in the fields that the design names."""
    wait = jsonrpc.decode_params(Call((), "wait", {"session": "s", "timeout_s": 2}))
    assert wait == Wait(session="s", timeout_s=2.0)
    where = jsonrpc.decode_params(Call((), "reference", {"xyz_mm": [127, 0, 1.5]}))
    assert where == Reference(xyz_mm=(127.0, 0.0, 1.5))
    assert jsonrpc.decode_params(Call((), "massage", {"key": "k"})) == Massage(key="k")


@pytest.mark.parametrize(
    ("method", "params"),
    [
        ("status", {"verbose": True}),
        ("run", {"Key": "k"}),
        ("run", {"key": 5}),
        ("wait", {}),
        ("wait", {"session": "s", "timeout_s": -1}),
        ("wait", {"session": "s", "timeout_s": "5"}),
        ("reference", {"xyz_mm": [1, 2]}),
        ("reference", {"pitch_deg": True}),
        ("events_since", {"boot": "b", "seq": -1}),
    ],
)
def test_unknown_and_wrong_parameters_are_refused(method: str, params: dict[str, object]) -> None:
    """An unknown name, a wrong type or a value out of range is invalid_params with its method."""
    with pytest.raises(Failure, match=method) as caught:
        jsonrpc.decode_params(Call((), method, params))
    assert caught.value.code == -32602


@pytest.mark.parametrize("method", ["", "__class__", "Status", "rpc.status", "x" * 9000])
def test_only_the_listed_methods_exist(method: str) -> None:
    """No other name reaches anything, and the answer stays short."""
    with pytest.raises(Failure) as caught:
        jsonrpc.decode_params(Call((), method))
    assert caught.value.name == "method_not_found"
    assert len(caught.value.reason) < 120


def test_errors_carry_code_reason_state_and_hint() -> None:
    """An error has its code and name, and data with reason, state and hint."""
    frames = jsonrpc.refuse((b"me",), 4, Failure("busy", "why", "what to do"), "massage_7")
    assert json.loads(frames[-1]) == {
        "jsonrpc": "2.0",
        "id": 4,
        "error": {
            "code": -32003,
            "message": "busy",
            "data": {"reason": "why", "state": "massage_7", "hint": "what to do"},
        },
    }


def test_the_designs_codes_are_kept() -> None:
    """Codes are part of the wire."""
    ours = ("refused_in_state", "precondition", "not_authorised", "busy", "in_fault",
            "unavailable", "expired")  # fmt: skip
    assert [CODES[name] for name in ours] == [-32000 - i for i in range(7)]


def test_numbers_that_are_not_finite_leave_as_null() -> None:
    """A NaN inside the daemon never makes invalid JSON."""
    assert json.loads(jsonrpc.encode({"x": math.nan, "y": math.inf})) == {"x": None, "y": None}


def test_every_method_is_described_with_its_schema() -> None:
    """A client can learn each method's parameters from the description."""
    methods = describe_methods()
    assert set(methods) == set(REQUESTS)
    assert all(m["does"].endswith(".") for m in methods.values())
    json.dumps(methods)


def test_threads_may_be_the_first_to_use_a_request_together() -> None:
    """Loop and stop line read requests at once; fresh processes that do so do not crash."""
    program = """
import sys, threading
sys.setswitchinterval(1e-6)
from legato.wire.jsonrpc import Call, Failure, decode_params
from legato.wire.requests import REQUESTS

def first(together, method):
    together.wait()
    try:
        decode_params(Call((), method, {"key": "a", "picks": {"P1": [1.0, 2.0]}}))
    except Failure:
        pass

for method in REQUESTS:
    together = threading.Barrier(4)
    threads = [threading.Thread(target=first, args=(together, method)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
"""
    for _ in range(3):
        subprocess.run([sys.executable, "-c", program], check=True, timeout=60.0)
