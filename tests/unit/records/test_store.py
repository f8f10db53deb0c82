"""The store: ids, atomic state, interrupted sessions, pruning, and disks that refuse."""

import signal
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from legato.records.chain import EVENTS, verify_chain
from legato.records.errors import RecordError
from legato.records.files import replace_file
from legato.records.ids import session_id
from legato.records.session import SessionWriter
from legato.records.store import Store

Begin = Callable[..., SessionWriter]
NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)


def at(days_ago: float) -> str:
    """Return the ISO time so many days before NOW."""
    return (NOW - timedelta(days=days_ago)).isoformat()


def test_ids_tell_the_time_in_utc() -> None:
    """An id is the time in UTC and a token, whatever zone the time was given in."""
    assert session_id("2026-11-22T01:47:00Z", "5f3a") == "20261122T014700Z-5f3a"
    assert session_id("2026-11-22T03:47:00.5+02:00", "5f3a") == "20261122T014700Z-5f3a"


def test_ids_are_unique_within_a_second(tmp_path: Path) -> None:
    """A token that is taken is drawn again; with none left the error says so."""
    tokens = iter(["aaaa", "aaaa", "bbbb"])
    store = Store(tmp_path, token=lambda: next(tokens))
    meta = {"job": "run", "started": at(0)}
    assert [store.begin(meta).id[-4:] for _ in range(2)] == ["aaaa", "bbbb"]
    stuck = Store(tmp_path, token=lambda: "aaaa")
    with pytest.raises(RecordError, match="no free id"):
        stuck.begin(meta)
    assert len(stuck.sessions()) == 2


def test_sessions_are_listed_newest_first(store: Store, begin: Begin) -> None:
    """The list is by the time of the request, and each line has the request and its outcome."""
    assert store.sessions() == []
    old, new = begin(1, at(2)), begin(1, at(1))
    old.finish("refused", "blind", "calibration_rejected", at(2))
    listed = store.sessions()
    assert [s.id for s in listed] == [new.id, old.id]
    assert (listed[1].outcome, listed[1].reason, listed[1].cause) == (
        "refused", "blind", "calibration_rejected",
    )  # fmt: skip
    assert listed[0].outcome is None
    assert listed[0].simulated
    assert store.unfinished() == [new.id]


@pytest.mark.parametrize(
    "session", ["..", "../state.json", "/etc", "", "20261122T014700Z-../x", "20261122T014700Z-a\n"]
)
def test_a_path_is_no_session_id(store: Store, begin: Begin, session: str) -> None:
    """Text from a client cannot lead out of the folder of sessions."""
    begin(1)
    with pytest.raises(RecordError, match="no session id"):
        store.read(session)
    with pytest.raises(RecordError, match="no session id"):
        store.close_interrupted(session)


def test_a_linked_session_is_not_followed(store: Store, begin: Begin, tmp_path: Path) -> None:
    """A symbolic link among the sessions is neither listed, read nor pruned."""
    begin(1).finish("done", None, None, at(100))
    outside = tmp_path / "outside"
    (store.folder / store.sessions()[0].id).rename(outside)
    link = store.folder / "20200101T000000Z-aaaa"
    link.symlink_to(outside)
    assert store.sessions() == []
    assert store.prune(1, NOW) == []
    with pytest.raises(RecordError, match="no session"):
        store.read(link.name)
    assert (outside / EVENTS).exists()


def test_state_comes_back(store: Store) -> None:
    """The last state saved is the one loaded; before the first there is an empty one."""
    assert store.load_state() == {}
    store.save_state({"registers": [1, 2, 3]})
    store.save_state({"registers": (4, 5, 6)})
    assert store.load_state() == {"registers": [4, 5, 6]}


def test_a_damaged_state_is_named(store: Store) -> None:
    """A state file that is no JSON is an error with its path, not an empty state."""
    store.save_state({})
    (store.state_dir / "state.json").write_bytes(b"{")
    with pytest.raises(RecordError, match=r"state\.json"):
        store.load_state()


def test_a_kill_before_the_rename_leaves_the_old_state(store: Store) -> None:
    """A process killed with the new file written and not yet in place changes nothing."""
    store.save_state({"seq": 1})
    code = (
        "import os, signal, sys; from pathlib import Path\n"
        "from legato.records.files import replace_file\n"
        "die = lambda a, b: os.kill(os.getpid(), signal.SIGKILL)\n"
        "replace_file(Path(sys.argv[1]), b'{\"seq\": 2}', rename=die)\n"
    )
    state = store.state_dir / "state.json"
    killed = subprocess.run([sys.executable, "-c", code, str(state)], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert len(list(store.state_dir.iterdir())) == 2
    assert store.load_state() == {"seq": 1}
    store.save_state({"seq": 3})
    assert store.load_state() == {"seq": 3}
    assert [p.name for p in store.state_dir.iterdir()] == ["state.json"]


def test_a_failed_rename_leaves_the_old_file(tmp_path: Path) -> None:
    """An error on the way keeps the old content and leaves nothing beside it."""

    def refuse(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device", str(source), None, str(target))

    path = tmp_path / "x.json"
    path.write_bytes(b"old")
    with pytest.raises(RecordError, match="No space left"):
        replace_file(path, b"new", rename=refuse)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["x.json"]


def test_an_unfinished_session_is_closed_as_interrupted(store: Store, begin: Begin) -> None:
    """It gets the outcome, the time of its last event, and a seal; its lines stay as they were."""
    writer = begin(3)
    writer.close()
    with (writer.path / EVENTS).open("ab") as file:
        file.write(b'{"seq":4,"wa')
    content = (writer.path / EVENTS).read_bytes()
    store.close_interrupted(writer.id)
    record = store.read(writer.id)
    assert (record.meta["outcome"], record.meta["cause"]) == ("interrupted", "interrupted")
    assert record.meta["ended"] == "2026-11-22T01:47:02+00:00"
    assert "torn after event 3" in record.meta["reason"]
    assert record.torn
    assert (writer.path / EVENTS).read_bytes() == content
    assert store.unfinished() == []
    assert verify_chain(writer.path).ok


def test_an_outcome_is_not_replaced(store: Store, begin: Begin) -> None:
    """Closing a session that has ended changes nothing."""
    writer = begin(1)
    writer.finish("done", None, None, at(0))
    store.close_interrupted(writer.id)
    assert store.read(writer.id).meta["outcome"] == "done"


def test_a_session_with_a_damaged_head_is_closed_too(store: Store, begin: Begin) -> None:
    """It is listed as unfinished, closed from its name and events, and the damage kept aside."""
    writer = begin(2)
    writer.close()
    (writer.path / "session.json").write_bytes(b"")
    assert store.unfinished() == [writer.id]
    store.close_interrupted(writer.id)
    assert store.sessions()[0].outcome == "interrupted"
    assert (writer.path / "session.damaged").exists()


def test_prune_removes_old_finished_sessions_only(store: Store, begin: Begin) -> None:
    """Age counts from the end; what is young, running or nameless stays."""
    old, young, running = begin(1, at(40)), begin(1, at(40)), begin(1, at(400))
    old.finish("done", None, None, at(31))
    young.finish("done", None, None, at(29))
    (store.folder / "notes").mkdir()
    assert store.prune(30, NOW) == [old.id]
    assert {s.id for s in store.sessions()} == {young.id, running.id}
    assert (store.folder / "notes").is_dir()
    assert store.prune(30, NOW) == []


def test_with_too_little_room_the_oldest_go_first(store: Store, begin: Begin) -> None:
    """Only as many as it takes; never the newest, the unfinished, or those of the last day."""
    ages = (50, 40, 30, 20, 10)
    old = [begin(1, at(days)) for days in ages]
    running, today = begin(1, at(60)), begin(1, at(0.9))
    for writer, days in zip([*old, today], [*ages, 0.9], strict=True):
        writer.finish("done", None, None, at(days))
    rooms = iter([100.0, 150.0, 300.0, 300.0, 300.0, 300.0])
    store.free_mb = lambda: next(rooms)  # type: ignore[method-assign] # a disk that fills up
    assert store.prune(90, NOW, min_free_mb=200, keep_newest=2) == [old[0].id, old[1].id]
    store.free_mb = lambda: 0.0  # type: ignore[method-assign]
    removed = store.prune(90, NOW, min_free_mb=200, keep_newest=2)
    assert removed == [old[2].id, old[3].id]
    left = {s.id for s in store.sessions()}
    assert left == {running.id, today.id, old[4].id}
    assert store.prune(90, NOW, min_free_mb=200) == [old[4].id]
    running.close()


def test_a_clock_that_jumps_ahead_leaves_the_newest(store: Store, begin: Begin) -> None:
    """By a clock that is years off everything is old: the newest stay all the same."""
    writers = [begin(1, at(days)) for days in (3, 2, 1)]
    for writer in writers:
        writer.finish("done", None, None, at(0))
    future = NOW + timedelta(days=9000)
    assert store.prune(90, future, keep_newest=2) == [writers[0].id]


def test_one_that_cannot_be_removed_keeps_no_other(store: Store, begin: Begin) -> None:
    """The others go, then it is said which could not."""
    ids = []
    for days in (30, 20, 10):
        writer = begin(1, at(days))
        writer.finish("done", None, None, at(days))
        ids.append(writer.id)
    (store.folder / f".pruned-{ids[0]}").write_text("in the way")
    with pytest.raises(RecordError, match=rf"cannot remove .*{ids[0]}.*; 2 others are removed"):
        store.prune(1.0, NOW)
    assert [s.id for s in store.sessions()] == ids[:1]


def test_what_a_crash_left_is_swept_away(store: Store, begin: Begin) -> None:
    """Half a removal or half a beginning is no session; a beginning under way is let be."""
    begin(1)
    for left in (".pruned-20200101T000000Z-aaaa", ".begun-20200101T000000Z-bbbb"):
        (store.folder / left).mkdir()
    assert len(store.sessions()) == 1
    store.prune(30, NOW)
    assert len(list(store.folder.glob(".begun-*"))) == 1
    assert not list(store.folder.glob(".pruned-*"))
    store.sweep()
    assert len(list(store.folder.iterdir())) == 1


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    """Where the folder cannot be made there is no session, and the error says which and why."""
    (tmp_path / "file").write_bytes(b"")
    store = Store(tmp_path / "file")
    with pytest.raises(RecordError, match=r"file.*state_dir"):
        store.begin({"job": "run", "started": at(0)})
    with pytest.raises(RecordError, match=r"file.*state_dir"):
        store.save_state({})


def test_free_space_is_known_before_there_is_a_folder(tmp_path: Path) -> None:
    """The figure is that of the disk on which the folder will be."""
    assert Store(tmp_path / "not" / "yet").free_mb() == pytest.approx(
        Store(tmp_path).free_mb(), rel=0.2
    )
