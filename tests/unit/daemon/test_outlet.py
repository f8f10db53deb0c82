"""Lines to a descriptor: in their order, never waited for, counted where they are lost."""

import fcntl
import io
import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from legato.daemon.log import make_log
from legato.daemon.outlet import Outlet

LINE = "x" * 99 + "\n"


@contextmanager
def pipe() -> Iterator[tuple[int, int]]:
    """Give a pipe's two ends; whoever has closed one has taken it out of the way."""
    receive, send = os.pipe()
    try:
        yield receive, send
    finally:
        for end in (receive, send):
            try:
                os.close(end)
            except OSError:
                continue


def read_on(receive: int, count: int) -> list[str]:
    """Return so many lines as they come."""
    with os.fdopen(os.dup(receive), encoding="utf-8") as stream:
        return [stream.readline() for _ in range(count)]


def test_lines_come_in_their_order_whoever_writes_them() -> None:
    """Each thread's own lines, whole."""
    with pipe() as (receive, send):
        outlet = Outlet(send)
        writers = [
            threading.Thread(target=lambda n=n: [outlet.write(f"{n} {k}\n") for k in range(200)])
            for n in range(3)
        ]
        for writer in writers:
            writer.start()
        found = [line.split() for line in read_on(receive, 600)]
        for writer in writers:
            writer.join()
        assert outlet.close()
        for n in "012":
            assert [int(k) for own, k in found if own == n] == list(range(200))


def filled(send: int) -> int:
    """Fill a pipe that nobody reads; return how many bytes it took."""
    os.set_blocking(send, False)
    count = 0
    with suppress(BlockingIOError):
        while True:
            count += os.write(send, b"." * 4096)
    os.set_blocking(send, True)
    return count


def test_whoever_reads_nothing_keeps_nobody_waiting() -> None:
    """A full pipe: what fits waits, the rest is lost and counted; what waited comes later."""
    with pipe() as (receive, send):
        before = filled(send)
        outlet = Outlet(send, most_bytes=100 * 100)
        for number in range(300):
            outlet.write(f"{number:99d}\n")
        assert not outlet.take_lost(), "there is no room yet"
        assert not outlet.close(timeout_s=0.05), "its thread waits for the reader"
        assert len(os.read(receive, before)) == before
        assert outlet.close(timeout_s=20.0)
        assert [int(line) for line in read_on(receive, 100)] == list(range(100))
        assert outlet.take_lost() == 200


def test_the_log_says_how_many_lines_were_lost() -> None:
    """Before the next line that is taken."""
    with pipe() as (receive, send), os.fdopen(os.dup(send), "w") as stderr:
        before = filled(send)
        log = make_log(stderr)
        for number in range(60):  # 1.8 MB
            log.info("big", number=number, text="x" * 30_000)
        assert len(os.read(receive, before)) == before
        with os.fdopen(os.dup(receive), encoding="utf-8") as stream:
            numbers = [json.loads(stream.readline())["number"] for _ in range(25)]
            log.info("small")
            rest = [json.loads(stream.readline())]
            while rest[-1]["event"] != "small":
                rest.append(json.loads(stream.readline()))
        numbers += [line["number"] for line in rest if line["event"] == "big"]
        assert numbers == list(range(len(numbers)))
        assert rest[-2]["event"] == "lines_lost"
        assert rest[-2]["count"] == 60 - len(numbers)


def test_a_line_that_was_cut_by_a_full_disk_gets_its_other_half(tmp_path: Path) -> None:
    """No two lines run into each other."""
    path, before = tmp_path / "log", signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with path.open("wb") as file:
        outlet = Outlet(file.fileno())
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (150, limits[1]))
            for number in range(3):
                outlet.write(f"{number:99d}\n")
            give_up = time.monotonic() + 20.0
            while outlet.take_lost() == 0:
                assert time.monotonic() < give_up
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            signal.signal(signal.SIGXFSZ, before)
        outlet.write("3\n")
        assert outlet.close()
    assert [int(line) for line in path.read_text().splitlines()] == [0, 1, 3]


def test_a_pipe_that_others_have_made_non_blocking_is_waited_for() -> None:
    """By the thread alone; nothing is lost."""
    with pipe() as (receive, send):
        flags = fcntl.fcntl(send, fcntl.F_GETFL)
        fcntl.fcntl(send, fcntl.F_SETFL, flags | os.O_NONBLOCK)
        outlet = Outlet(send)
        for _ in range(1000):  # 100 kB
            outlet.write(LINE)
        assert read_on(receive, 1000) == [LINE] * 1000
        assert outlet.close()
        assert outlet.take_lost() == 0


def test_the_last_line_leaves_before_the_process_ends() -> None:
    """A program that logs and returns has said it; one that nobody reads ends all the same."""
    code = "from legato.daemon.log import make_log; make_log().info('last')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stderr)["event"] == "last"
    code = "from legato.daemon.outlet import Outlet; Outlet(2).write('x' * 200_000)"
    with pipe() as (_, send):
        subprocess.run([sys.executable, "-c", code], stderr=send, timeout=20.0, check=True)


def test_a_stream_in_memory_is_written_at_once() -> None:
    """It keeps nobody waiting."""
    out = io.StringIO()
    make_log(out).info("press")
    assert json.loads(out.getvalue())["event"] == "press"
