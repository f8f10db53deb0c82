"""What a page may ask for: token, role, names."""

import pytest

from legato.web.acts import METHODS, Acts, Line, Refused


def acts(token: str | None, role: str = "operator") -> Acts:
    """Return acts whose lines lead nowhere; none is used here."""
    nowhere = "ipc:///nonexistent/line"
    return Acts(Line(nowhere, None, "a"), Line(nowhere, None, "b"), token, role)


@pytest.mark.parametrize("shown", [None, "", "secre", "secret2", "\u00e9"])
def test_without_the_token_nothing_may_be_asked(shown: str | None) -> None:
    """A wrong token is 401 and says where the right one is."""
    with pytest.raises(Refused) as refused:
        acts("secret").check(shown)
    assert refused.value.status == 401
    assert "legato web" in refused.value.hint


def test_a_server_that_only_observes_lets_nobody_act() -> None:
    """No token is the right one."""
    with pytest.raises(Refused) as refused:
        acts(None).check("")
    assert refused.value.status == 403


@pytest.mark.parametrize(
    ("role", "may"), [("operator", METHODS), ("stopper", ("stop", "estop")), ("observer", ())]
)
def test_a_page_may_what_the_servers_key_may(role: str, may: tuple[str, ...]) -> None:
    """The token adds nothing to the key's role."""
    assert acts("secret", role).check("secret") == may


def test_stops_have_a_line_of_their_own() -> None:
    """Whatever a request waits for, no stop waits behind it."""
    both = acts("secret")
    assert both.line_of("stop") is both.line_of("estop")
    assert both.line_of("stop") is not both.line_of("reset")
    assert both.line_of("reset") is both.line_of("run")


def test_neither_lease_nor_shutdown_is_for_pages() -> None:
    """A page is closed by mistake; nothing may hang on it."""
    assert {"lease", "shutdown"}.isdisjoint(METHODS)


@pytest.mark.parametrize("name", ["self", "method", "seconds", "expires_at", "timeout_s"])
def test_what_the_server_says_itself_no_page_can_give(name: str) -> None:
    """It is refused as a bad request before it gets anywhere."""
    with pytest.raises(Refused, match=name) as refused:
        acts("secret").act("home", {name: 1})
    assert (refused.value.status, bool(refused.value.hint)) == (400, True)
