"""Key files: secrets that others can read and lists that others can change are refused."""

import os
from pathlib import Path

import pytest

from legato.config.errors import ConfigError
from legato.config.schema import CurveTable, ServerTable
from legato.daemon.keys import (
    client_keys,
    is_closed,
    make_keys,
    read_clients,
    read_public,
    read_secret,
)
from legato.daemon.who import Who


def test_a_pair_reads_back_and_its_secret_is_its_owners(tmp_path: Path) -> None:
    """Mode 0600 whatever the umask; the public file has name and role, and no secret."""
    before = os.umask(0)
    try:
        secret, public = make_keys(tmp_path / "keys", "anna", "operator")
    finally:
        os.umask(before)
    assert secret.stat().st_mode & 0o777 == 0o600
    assert public.stat().st_mode & 0o777 == 0o644
    keys = read_secret(secret, "server.client_secret")
    shown = read_public(public, "server.server_public")
    assert (shown.name, shown.role, shown.public.encode()) == ("anna", "operator", keys.public)
    assert keys.secret.decode() not in public.read_text()
    assert keys.secret.decode() not in repr(keys)


def test_a_key_is_never_replaced(tmp_path: Path) -> None:
    """Neither file is written over, and no name leads out of the folder."""
    make_keys(tmp_path, "anna", "operator")
    kept = (tmp_path / "anna.secret").read_text()
    with pytest.raises(FileExistsError):
        make_keys(tmp_path, "anna", "observer")
    assert (tmp_path / "anna.secret").read_text() == kept
    for name in ("../anna", "", "a b", "x" * 65):
        with pytest.raises(ValueError, match="name"):
            make_keys(tmp_path, name, "operator")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644])
def test_a_secret_that_others_can_read_is_refused(tmp_path: Path, mode: int) -> None:
    """The error names file and key, and says what to do."""
    secret, _ = make_keys(tmp_path, "cell", "server")
    secret.chmod(mode)
    with pytest.raises(ConfigError, match=r"server\.curve\.secret.*chmod 600"):
        read_secret(secret, "server.curve.secret")


def test_systemds_credentials_are_read_as_they_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Systemd closes its folder to others, and shows other bits on the files."""
    secret, _ = make_keys(tmp_path / "c", "cell", "server")
    secret.chmod(0o440)
    secret.parent.chmod(0o500)
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(secret.parent))
    assert read_secret(secret, "server.curve.secret").secret
    secret.parent.chmod(0o700)


@pytest.mark.parametrize("mode", [0o755, 0o711, 0o720, 0o770])
def test_a_folder_that_others_may_enter_is_none_of_systemds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    """A variable alone lifts no check: the folder itself has to be closed."""
    secret, _ = make_keys(tmp_path / "c", "cell", "server")
    secret.chmod(0o440)
    secret.parent.chmod(mode)
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(secret.parent))
    with pytest.raises(ConfigError, match=r"server\.curve\.secret.*chmod 600"):
        read_secret(secret, "server.curve.secret")


@pytest.mark.parametrize(
    ("mode", "owner", "group", "closed"),
    [
        (0o500, 7, 7, True), (0o700, 7, 7, True), (0o500, 0, 0, True), (0o550, 0, 0, True),
        (0o550, 7, 7, False), (0o550, 0, 7, False), (0o570, 0, 0, False), (0o501, 0, 0, False),
        (0o500, 8, 7, False), (0o700, 8, 8, False),
    ],
)  # fmt: skip
def test_a_closed_folder_is_roots_or_our_own(
    mode: int, owner: int, group: int, closed: bool
) -> None:
    """Nobody else may enter it; a group of root shows what an access list allows."""
    assert is_closed(mode, owner, group, us=7) is closed


def test_a_credential_stands_before_a_file_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The configuration names keys/server.secret; under systemd that is the credential's copy."""
    configured, _ = make_keys(tmp_path / "keys", "server", "server")
    given, _ = make_keys(tmp_path / "credentials", "server", "server")
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path / "credentials"))
    own = read_secret(given, "server.curve.secret")
    assert read_secret(configured, "server.curve.secret").public == own.public
    configured.unlink()
    assert read_secret(configured, "server.curve.secret").public == own.public
    given.unlink()
    with pytest.raises(ConfigError, match=r"server\.secret"):
        read_secret(configured, "server.curve.secret")


@pytest.mark.parametrize(
    ("old", "new"),
    [('secret = "', 'secret = "0'), ('name = "', 'nom = "'), ("secret = ", "# secret = ")],
)
def test_a_damaged_secret_is_refused(tmp_path: Path, old: str, new: str) -> None:
    """What is no pair is an error of the file, not of the handshake."""
    secret, _ = make_keys(tmp_path, "cell", "server")
    secret.write_text(secret.read_text().replace(old, new))
    with pytest.raises(ConfigError, match=r"cell\.secret"):
        read_secret(secret, "server.curve.secret")


def test_a_secret_of_another_pair_is_refused(tmp_path: Path) -> None:
    """Public and secret key in one file belong together."""
    secret, _ = make_keys(tmp_path, "cell", "server")
    other, _ = make_keys(tmp_path, "other", "server")
    lines = secret.read_text().splitlines()
    lines[-1] = other.read_text().splitlines()[-1]
    secret.write_text("\n".join(lines))
    with pytest.raises(ConfigError, match="secret of the public key"):
        read_secret(secret, "server.curve.secret")


def test_the_list_is_the_folder_of_public_files(tmp_path: Path) -> None:
    """Each file lets in one key under its name and role; other files are nobody's."""
    for name, role in (("anna", "operator"), ("ben", "observer"), ("cleo", "stopper")):
        make_keys(tmp_path, name, role)
    (tmp_path / "README").write_text("who is who")
    assert set(read_clients(tmp_path).values()) == {
        Who("anna", "operator"), Who("ben", "observer"), Who("cleo", "stopper"),
    }  # fmt: skip


def test_a_list_that_others_can_change_is_refused(tmp_path: Path) -> None:
    """Nobody grants himself a role: neither by a file nor by the folder."""
    _, public = make_keys(tmp_path, "anna", "operator")
    public.chmod(0o666)
    with pytest.raises(ConfigError, match="only its owner can change"):
        read_clients(tmp_path)
    public.chmod(0o644)
    tmp_path.chmod(0o777)
    with pytest.raises(ConfigError, match="only its owner can change"):
        read_clients(tmp_path)


def test_odd_lists_are_refused(tmp_path: Path) -> None:
    """A missing folder, a role that no client has, one name or key twice."""
    with pytest.raises(ConfigError, match=r"server\.curve\.clients"):
        read_clients(tmp_path / "none")
    _, public = make_keys(tmp_path, "anna", "operator")
    copy = tmp_path / "copy.public"
    copy.write_text(public.read_text())
    with pytest.raises(ConfigError, match="no other file has"):
        read_clients(tmp_path)
    copy.unlink()
    make_keys(tmp_path, "cell", "server")
    with pytest.raises(ConfigError, match="observer, stopper, operator"):
        read_clients(tmp_path)


def test_a_client_takes_its_keys_from_the_configuration(tmp_path: Path) -> None:
    """Its own pair and the daemon's public key; without encryption none."""
    secret, _ = make_keys(tmp_path, "anna", "operator")
    _, public = make_keys(tmp_path, "cell", "server")
    server = ServerTable(client_secret=str(secret), server_public=str(public))
    keys = client_keys(server, "cell.toml")
    assert keys is not None
    assert keys.server == read_public(public, "").public.encode()
    assert client_keys(ServerTable(), "cell.toml") is None
    curve = CurveTable(secret="s", clients="c")
    with pytest.raises(ConfigError, match=r"server\.client_secret"):
        client_keys(ServerTable(curve=curve), "cell.toml")
