"""Session ids: the time in UTC and a token, such as 20261122T014700Z-5f3a; they sort by time."""

import re
from datetime import UTC, datetime

from legato.records.errors import RecordError

SESSION_ID = re.compile(r"\d{8}T\d{6}Z-[0-9a-z]{1,32}", re.ASCII)
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", re.ASCII)


def session_id(started: str, token: str) -> str:
    """Return the id of a session begun at an ISO time; a time without a zone is UTC."""
    time = moment(started).strftime("%Y%m%dT%H%M%SZ")
    return checked_id(f"{time}-{token}")


def began(session: str) -> datetime:
    """Return the second at which a session began, as its id tells it; raises ValueError."""
    return datetime.fromisoformat(session.partition("-")[0])


def is_id(text: str) -> bool:
    """Say whether `text` is a session id, of a time that there is."""
    if SESSION_ID.fullmatch(text) is None:
        return False
    try:
        began(text)
    except ValueError:
        return False
    return True


def moment(iso: str) -> datetime:
    """Return an ISO time in UTC; raises ValueError."""
    time = datetime.fromisoformat(iso)
    if time.tzinfo is None:
        return time.replace(tzinfo=UTC)
    try:
        return time.astimezone(UTC)
    except OverflowError as error:
        raise ValueError(f"{iso} is before or after all time") from error


def checked_id(text: str) -> str:
    """Return `text` where it is a session id; no path gets through here."""
    if not is_id(text):
        raise RecordError(
            f"{text!r} is no session id", "ids look like 20261122T014700Z-5f3a: `legato sessions`"
        )
    return text


def checked_name(text: str) -> str:
    """Return `text` where it may name a picture or document of a session."""
    if not NAME.fullmatch(text):
        raise ValueError(f"{text!r} names no part of a record: letters, digits, - and _ only")
    return text
