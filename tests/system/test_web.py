"""The live page in a browser, against the real daemon on the simulated cell."""

import json
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Position, expect

from tests.system.pictures import CAMERA_AT, LOOKS_AT, two_legs
from tests.system.process import Daemon, daemon
from tests.system.site import PASSES, RUN, Site, browser, cell, page_of, site, until_state

__all__ = ["browser"]

expect.set_options(timeout=15_000)

LENIENT = {"max_mark_size_percent": 1000.0, "max_station_sigma_mm": 1.0}  # for a far camera
# Whether the lit state of the graph is the page's.
PRESENT = """document.querySelector('#graph .present text').textContent
    == document.body.dataset.state.replace('_', ' ')"""
SPOKEN = {"capture": "Taking a picture", "calibrate": "Finding the leg", "verify": "Verifying",
          "move_home": "Moving home", "idle": "Idle",
          **{state: f"Massage at {state[8:]} mm" for state in PASSES}}  # fmt: skip


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Site]]:
    """Give one daemon and one page server to all tests that leave the cell in idle."""
    config = cell(tmp_path_factory.mktemp("cell"), {"seed": 1, "time_scale": 40.0})
    with daemon(config) as cell_daemon, site(config) as served:
        yield cell_daemon, served


def test_a_whole_session_is_watched_from_start_to_end(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """States, contacts, picture and report are seen, and nothing from elsewhere is asked for."""
    cell_daemon, served = running
    cell_daemon.to_idle()
    asked: set[str] = set()
    with page_of(browser, served.url) as page:
        page.on("request", lambda request: asked.add(request.url))
        expect(page.locator("#kind")).to_have_text("Simulated cell")
        expect(page).not_to_have_url(served.url)  # the token has left the address
        canvas = page.locator("#space canvas")
        before = canvas.get_attribute("aria-label")
        page.get_by_role("button", name="Run").click()
        until_state(page, *PASSES)
        expect(page.get_by_role("button", name="Run")).to_have_attribute("aria-disabled", "true")
        assert page.evaluate(PRESENT)
        expect(page.locator("#picture img")).to_have_js_property("naturalWidth", 768)
        expect(page.locator("#picture svg .seen")).to_have_count(10)
        expect(canvas).not_to_have_attribute("aria-label", str(before))
        until_state(page, "idle")
        listed = page.locator("#events [data-topic=state] span").all_text_contents()[::-1]
        assert [text.split(" (")[0] for text in listed[-len(RUN) :]] == [SPOKEN[s] for s in RUN]
        # One that is over within a frame, such as the way home from home, may not have been lit.
        seen, expected = page.evaluate("seenStates"), iter(["idle", *RUN])
        assert all(state in expected for state in seen), seen
        assert {"idle", "calibrate", *PASSES} <= set(seen)
        assert page.evaluate("contradictions") == []
        expect(page.locator("#space .empty")).to_be_hidden()
        expect(page.locator("#contacts svg .touch")).to_have_count(12)
        expect(page.locator("#contacts svg .band")).to_have_count(4)
        expect(page.locator("#contacts svg .limit-text").first).to_contain_text("accepted to +2.0")
        expect(page.locator("#contacts tbody tr td:last-child")).to_have_text(["3 of 3"] * 4)
        expect(page.locator("#known")).to_contain_text("Calibrationverified")
        expect(page.locator("#sessions tbody tr").first).to_contain_text("done")
        with page.context.expect_page() as opened:
            page.locator("#sessions a").first.click()
        session = cell_daemon.do("sessions")["sessions"][0]["id"]
        expect(opened.value.locator("body")).to_contain_text(session)
    assert {address.split("/")[2] for address in asked} == {f"127.0.0.1:{served.port}"}


def test_pause_and_stop_by_button_and_by_keyboard(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """Each works from wherever the focus is; the stop is confirmed by the driver."""
    cell_daemon, served = running
    cell_daemon.ready_to_massage()
    with page_of(browser, served.url) as page:
        for by_hand in (True, False):
            page.get_by_role("button", name="Massage", exact=True).click()
            until_state(page, *PASSES)
            press(page, "Pause", "Alt+KeyP" if not by_hand else None)
            until_state(page, "paused")
            if by_hand:  # the button that had the focus has made way for its opposite
                expect(page.get_by_role("button", name="Resume")).to_be_focused()
            assert cell_daemon.do("status")["state"] == "paused"
            expect(page.locator("#graph .present text")).to_have_text("paused")
            press(page, "Resume", "Alt+KeyP" if not by_hand else None)
            until_state(page, *PASSES)
            if not by_hand:
                page.locator("#space canvas").focus()
            press(page, "Stop", "Escape" if not by_hand else None)
            until_state(page, "idle")
            expect(page.locator("#said")).to_contain_text("stop given, confirmed")
            expect(page.locator("#sessions tbody tr").first).to_contain_text("stopped")
    assert cell_daemon.do("sessions")["sessions"][1]["outcome"] == "stopped"


def test_a_fault_is_shown_with_what_to_do_and_reset(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """Cause, text, hint and evidence are read out; reset leads back to idle."""
    cell_daemon, served = running
    cell_daemon.ready_to_massage()
    with page_of(browser, served.url) as page:
        page.get_by_role("button", name="Massage", exact=True).click()
        until_state(page, *PASSES)
        page.keyboard.press("Shift+Escape")
        until_state(page, "fault")
        fault = page.get_by_role("region", name="estop")
        expect(fault).to_contain_text("What to do")
        fault.get_by_text("Evidence").click()
        expect(fault.locator(".evidence")).to_contain_text("massage_")
        expect(page.locator("#urgent")).to_contain_text("Fault estop")
        expect(page).to_have_title("Fault \u2013 legato (simulated)")
        expect(page.get_by_role("button", name="Run")).to_have_attribute("aria-disabled", "true")
        page.keyboard.press("Alt+KeyP")
        expect(page.locator("#said")).to_have_text(re.compile("^Pause is not possible in fault;"))
        fault.get_by_role("button", name="Reset").click()
        until_state(page, "idle")
        expect(page.get_by_role("region", name="estop")).to_have_count(0)
        expect(page.locator("#urgent")).to_be_empty()
        expect(page.locator("#said")).not_to_contain_text("Pause")
        expect(page.locator("#state")).to_be_focused()
    told = cell_daemon.do("status")
    assert told["fault"] is None
    if not told["arm"]["referenced"]:
        cell_daemon.do("reference", xyz_mm=told["arm"]["xyz_mm"] or [127.0, 0.0, 150.0])


def test_a_failed_picking_is_repaired_by_clicks(tmp_path: Path, browser: Browser) -> None:
    """Of two legs the marks of one are pointed at, snapped, sent, solved, verified, recorded."""
    pattern, marks = two_legs(tmp_path)
    config = cell(
        tmp_path, {"seed": 1, "time_scale": 40.0}, calibration=LENIENT,
        camera={"driver": "opencv", "source": pattern},
        cell={"camera_at_mm": CAMERA_AT, "camera_looks_at_mm": LOOKS_AT},
    )  # fmt: skip
    del marks["P9"]  # one that the person leaves out
    with daemon(config) as cell_daemon, site(config) as served:
        with page_of(browser, served.url) as page:
            page.get_by_role("button", name="Run").click()
            until_state(page, "fault")
            expect(page.locator("#kind")).to_have_text("Simulated arm")  # its camera is a real one
            expect(page).to_have_title("Fault \u2013 legato (simulated arm)")
            fault = page.get_by_role("region", name="marks_not_found")
            expect(fault).to_contain_text("two legs are in sight")
            expect(page.get_by_role("button", name="Mark by hand")).to_have_count(0)  # not in fault
            fault.get_by_role("button", name="Reset").click()
            until_state(page, "idle")
            page.locator("#mark").click()
            assert not overlap(page, ".loupe", "#picture .frame")
            point_at(page, marks)
            page.get_by_role("button", name=f"Send {len(marks)} marks").click()
            expect(page.locator("#picture svg .seen")).to_have_count(len(marks))
            expect(page.locator("#picture")).to_contain_text("Accepted by the picture")
            until_state(page, "idle")
            assert page.evaluate("document.activeElement !== document.body")
            expect(page.locator("#known")).to_contain_text("Calibrationnot verified")
            page.get_by_role("button", name="Verify").click()
            expect(page.locator("#known")).to_contain_text("Calibrationverified")
            until_state(page, "idle")
        latest = cell_daemon.do("sessions")["sessions"]
        assert [s["outcome"] for s in latest] == ["done", "done", "fault"]
        assert cell_daemon.do("status")["calibration"]["valid"]
    folder = tmp_path / "state" / "sessions" / latest[1]["id"]
    asked = json.loads((folder / "session.json").read_text())
    assert (set(asked["params"]["picks"]), asked["by"]) == (set(marks), "local")
    solved = json.loads((folder / "calibration.json").read_text())
    assert solved["missing"] == {"P9": "not picked"}
    for name, place in marks.items():
        assert np.hypot(*np.subtract(solved["marks"][name], place)) < 0.3


def test_a_daemon_that_dies_under_the_page_is_missed_and_found_again(
    tmp_path: Path, browser: Browser
) -> None:
    """What is old looks old and cannot be acted on; the new daemon's fault is there at once.

    Nothing that the dead daemon knew is shown as what the new one knows.
    """
    config = cell(tmp_path, {"seed": 1, "time_scale": 4.0})
    with site(config) as served, daemon(config) as first, page_of(browser, served.url) as page:
        page.get_by_role("button", name="Run").click()
        page.locator("#contacts svg .touch").first.wait_for(state="attached")
        expect(page.locator("#space .empty")).to_be_hidden()
        first.process.send_signal(signal.SIGKILL)
        page.locator("body[data-line=lost]").wait_for(state="attached")
        expect(page.get_by_role("region", name="Connection")).to_contain_text("is old")
        expect(page.locator("#urgent")).to_contain_text("No connection to the daemon")
        expect(page.locator("#state")).to_have_text("No connection")
        expect(page.locator("#doing")).to_contain_text("Massage at 7 mm was the last")
        expect(page.locator("#hardware")).to_be_visible()
        expect(page.locator("main button:visible:not(.tools *)")).to_have_count(0)
        expect(page.locator(".stops button:visible")).to_have_count(0)
        expect(page.locator("#graph .present")).to_have_count(0)
        with daemon(config):
            page.locator("body[data-line=up]").wait_for(state="attached")
            until_state(page, "fault")
            expect(page.get_by_role("region", name="interrupted")).to_be_visible()
            expect(page.locator("#space .empty")).to_contain_text("Where the leg lies is not known")
            expect(page.locator("#picture .badge")).to_have_text("Earlier session")
            expect(page.locator("#picture svg .leg")).to_have_count(0)
            expect(page.locator("#contacts .badge")).to_have_text("Earlier session")
            expect(page.locator(".stops button:visible")).to_have_count(2)
            page.get_by_role("button", name="Reset").first.click()
            until_state(page, "idle")
            for method in ("Calibrate", "Verify", "Massage"):  # of what is not there
                button = page.get_by_role("button", name=method, exact=True)
                expect(button).to_have_attribute("aria-disabled", "true")
                expect(button).to_have_attribute("title", re.compile("; .*send "))
            expect(page.get_by_role("button", name="Mark by hand")).to_have_count(0)
            served.process.kill()
            page.locator("body[data-line=cut]").wait_for(state="attached")
            expect(page.get_by_role("region", name="Connection")).to_contain_text("server")
            old = re.compile(r"is old: the last was heard at \d\d:\d\d:\d\d UTC\.")
            expect(page.get_by_role("region", name="Connection")).to_contain_text(old)
            expect(page.locator("#state")).to_have_text("No connection")
            expect(page.locator("#hardware")).to_be_visible()


def press(page: Page, name: str, key: str | None) -> None:
    """Press a button, or a key."""
    if key is None:
        page.get_by_role("button", name=name).first.click()
    else:
        page.keyboard.press(key)


def overlap(page: Page, one: str, other: str) -> bool:
    """Say whether two elements cover each other."""
    a, b = page.locator(one).bounding_box(), page.locator(other).bounding_box()
    assert a is not None
    assert b is not None
    apart = a["y"] >= b["y"] + b["height"] or b["y"] >= a["y"] + a["height"]
    return not (apart or a["x"] >= b["x"] + b["width"] or b["x"] >= a["x"] + a["width"])


def point_at(page: Page, marks: dict[str, tuple[float, float]]) -> None:
    """Point at marks, the first wrongly at first, the last by keys."""
    picture = page.locator("#picture img")
    box = picture.bounding_box()
    assert box is not None
    scale = box["width"] / 768
    first, last = next(iter(marks)), list(marks)[-1]
    page.locator("#picture .frame").click(position={"x": 300 * scale, "y": 30 * scale})
    chip = page.get_by_role("button", name=f"{first}, ")
    expect(chip).to_have_attribute("title", "no mark within 12 px of the pick")
    page.get_by_role("button", name="Undo").click()
    for name, (u, v) in marks.items():
        page.get_by_role("button", name=f"{name}, ").click()
        place = Position(x=(u + 1.5) * scale, y=(v + 0.5) * scale)
        if name == last:
            page.locator("#picture .frame").hover(position=place)
            page.locator("#picture .frame").press("ArrowLeft")
            page.keyboard.press("Enter")
        else:
            page.locator("#picture .frame").click(position=place)
    expect(page.locator(".chip.good")).to_have_count(len(marks))
