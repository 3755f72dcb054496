"""The player in a real browser (Debian's Chromium by Playwright): load, scrub, pick, play, watch a run that goes on.

`pip install playwright` and `apt-get install chromium`; skipped by name where either is missing.
"""

from __future__ import annotations

import shutil
import time

import numpy as np
import pytest
import synthetic_run as made

from geomech.output import Histories, Run, Series
from geomech.player.page import write_player
from geomech.player.server import Viewer

pytestmark = pytest.mark.slow

_CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
READY = "#geomech-player[data-ready=yes]"


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if _CHROMIUM is None:
        pytest.skip("no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=_CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def opened(browser, run_folder, tmp_path):
    """A function from (runs, options of the context) to a page that has loaded without a word in its console."""
    contexts, said = [], []

    def open_page(address: str, **options):
        context = browser.new_context(**{"viewport": {"width": 1200, "height": 800}, "color_scheme": "light"} | options)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if address.startswith("file") and not
                request.url.startswith(("file:", "blob:", "data:")) else None)  # fmt: skip
        page.goto(address)
        page.wait_for_selector(READY, timeout=20_000)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert said == []


@pytest.fixture
def address(run_folder, tmp_path) -> str:
    return write_player([Run(run_folder)], tmp_path / "page.html").as_uri()


def until(page, expression: str, seconds: float = 10.0) -> None:
    """Wait for an expression to be true; the page's own policy lets no string be run inside it, so ask from outside."""
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < end, expression
        page.wait_for_timeout(10)


def middle_of_rock(page, x: float = 0.012, y: float = 0.03) -> list[float]:
    """Where a point of the specimen is on the screen."""
    return page.evaluate(
        "([x, y]) => { const d = geomechPlayer.drawings[0], b = d.canvas.getBoundingClientRect();"
        "return [b.left + d.view.x + d.view.scale * x, b.top + d.view.y - d.view.scale * y]; }", [x, y]
    )  # fmt: skip


def colour_at(page, x: float, y: float) -> list[int]:
    return page.evaluate(
        "([x, y]) => { const c = geomechPlayer.drawings[0].canvas, b = c.getBoundingClientRect(), r = c.width / b.width;"
        "return [...c.getContext('2d').getImageData((x - b.left) * r, (y - b.top) * r, 1, 1).data].slice(0, 3); }",
        [x, y],
    )


def test_the_colour_on_the_screen_is_that_of_the_stress(opened, address):
    """Uniform compression, coloured by ColorBrewer's YlGnBu as in the pictures, at two cycles."""
    from matplotlib import colormaps

    page = opened(address)
    page.evaluate("geomechPlayer.setField('yy'); geomechPlayer.setScale(0); geomechPlayer.fit()")
    low, high = page.evaluate("geomechPlayer.range()")
    assert high == 0 and low == pytest.approx(-0.6e6, rel=1e-3)
    for at, cycle in ((1, 1), (2, 4)):
        page.evaluate(f"geomechPlayer.go({at}); geomechPlayer.paint()")
        stress = -made.RATE * page.evaluate("geomechPlayer.frameOf(geomechPlayer.runs[0]).time")
        share = (stress - low) / (high - low)
        wanted = 255 * np.array(colormaps["YlGnBu"](0.96 - 0.92 * share)[:3])
        assert colour_at(page, *middle_of_rock(page)) == pytest.approx(wanted, abs=6)
        assert page.locator(".gm-moment").inner_text().find(f"cycle {cycle}") > 0


def test_the_slider_the_keys_and_play(opened, address):
    page = opened(address)
    slider = page.locator(".gm-slider")
    slider.focus()
    page.keyboard.press("Home")
    until(page, "geomechPlayer.root.dataset.cycle === '0'")
    page.keyboard.press("ArrowRight")
    until(page, "geomechPlayer.root.dataset.cycle === '1'")
    before = page.locator(".gm-canvas").screenshot()
    page.keyboard.press("End")
    until(page, "geomechPlayer.root.dataset.cycle === '6'")
    assert page.locator(".gm-canvas").screenshot() != before
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press(" ")
    until(page, "geomechPlayer.root.dataset.cycle !== '6'")
    until(page, "!geomechPlayer.playing")
    until(page, "geomechPlayer.root.dataset.cycle === '6'")  # drawn in the browser's next frame
    page.keyboard.press("f")
    assert page.locator("[data-role=field]").input_value() != "yy"
    page.keyboard.press("?")
    assert page.locator(".gm-help").is_visible()


def test_hover_and_click_tell_the_numbers_of_the_run(opened, address):
    page = opened(address)
    page.evaluate("geomechPlayer.setField('yy'); geomechPlayer.setScale(0); geomechPlayer.fit(); geomechPlayer.go(4)")
    x, y = middle_of_rock(page)
    page.mouse.move(x, y)
    page.wait_for_selector(".gm-tip:visible")
    told = page.locator(".gm-tip").inner_text()
    assert "Block 1" in told and "−0.6 MPa" in told
    page.mouse.click(x, y)
    until(page, "geomechPlayer.root.dataset.selected === 'block'")
    curve = page.evaluate("geomechPlayer.history.lines[0].y")
    assert curve == pytest.approx(np.full(5, 1e-3), rel=1e-2)  # lifted by a millimetre
    tip = page.evaluate(
        "() => { const d = geomechPlayer.drawings[0], p = d.tipPlaces(), b = d.canvas.getBoundingClientRect(),"
        "r = d.ratio; return [b.left + p[2] / r, b.top + p[3] / r]; }"
    )
    page.mouse.click(*tip)
    until(page, "geomechPlayer.root.dataset.selected === 'tip'")
    assert "Tip of" in page.locator(".gm-chart-title").nth(1).inner_text()
    # From tips.csv: K_I in every cycle, −0.0626 of the load.
    values = page.evaluate("geomechPlayer.history.lines[0].y")
    assert len(values) == 7 and values[-1] == pytest.approx(-0.0626 * 3 * made.RATE, rel=1e-6)
    # A click on the curve goes to its cycle.
    page.locator(".gm-chart").nth(1).scroll_into_view_if_needed()
    box = page.locator(".gm-chart").nth(1).bounding_box()
    page.mouse.click(box["x"] + 60, box["y"] + box["height"] / 2)
    until(page, "geomechPlayer.at < 3")


def test_what_is_zoomed_moves_under_the_pointer(opened, address):
    page = opened(address)
    x, y = middle_of_rock(page)
    page.evaluate("geomechPlayer.drawings[0].canvas.focus()")
    page.mouse.move(x, y)
    before = page.evaluate("geomechPlayer.drawings[0].view.scale")
    page.mouse.wheel(0, -400)
    until(page, f"geomechPlayer.drawings[0].view.scale > 1.5 * {before}")
    assert middle_of_rock(page) == pytest.approx([x, y], abs=1.5)
    page.mouse.down()
    page.mouse.move(x + 60, y + 20, steps=4)
    page.mouse.up()
    # A drag begins after 4 pixels.
    assert middle_of_rock(page) == pytest.approx([x + 60, y + 20], abs=16)
    page.keyboard.press("0")
    assert page.evaluate("geomechPlayer.drawings[0].view.scale") == pytest.approx(before)


def test_two_runs_have_one_range(opened, run_folder, tmp_path):
    made.write(tmp_path / "other", [Histories(), Series(interior_every=1)], steps=8)
    page = opened(write_player([Run(run_folder), Run(tmp_path / "other")], tmp_path / "two.html").as_uri())
    page.evaluate("geomechPlayer.setField('yy')")
    assert page.evaluate("geomechPlayer.range()")[0] == pytest.approx(-7 * made.RATE, rel=1e-3)
    assert page.evaluate("geomechPlayer.drawings.length") == 2
    page.evaluate("geomechPlayer.goTo(1.0, (f) => f.time); geomechPlayer.paint()")
    assert page.evaluate("geomechPlayer.drawings.map((d) => d.frame.time)") == [1.0, 1.0]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_on_a_phone_nothing_is_wider_than_the_screen(opened, address, scheme):
    page = opened(address, viewport={"width": 390, "height": 844}, has_touch=True, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert background == ("rgb(22, 24, 28)" if scheme == "dark" else "rgb(255, 255, 255)")
    page.locator(".gm-controls summary").click()
    assert page.locator("[data-role=field]").is_visible()


def test_a_page_prints_in_light_colours_without_controls(opened, address):
    page = opened(address, color_scheme="dark")
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert not page.locator(".gm-controls").is_visible() and not page.locator(".gm-slider").is_visible()
    corner = page.evaluate("[...geomechPlayer.drawings[0].context.getImageData(3, 3, 1, 1).data].slice(0, 3)")
    assert corner == [255, 255, 255]
    assert len(page.pdf()) > 10_000


def test_new_cycles_appear_while_the_run_goes_on(opened, tmp_path):
    folder, watching = tmp_path / "run", [Histories(), Series(interior_every=0)]
    cycles = made.cycles()
    for observer in watching:
        observer.on_start(made.problem(), folder)
        for each in cycles[:3]:
            observer.on_cycle(each)
    # At first there are no contacts.
    pvd = folder / "contacts.pvd"
    pvd.rename(folder / "hidden")
    viewer = Viewer([folder]).start()
    try:
        page = opened(viewer.address)
        until(page, "geomechPlayer.count === 3")
        page.evaluate("geomechPlayer.go(1)")
        assert page.locator("[data-role=joints]").count() == 0
        (folder / "hidden").rename(pvd)
        for observer in watching:
            for each in cycles[3:]:
                observer.on_cycle(each)
        # Who looks at an earlier cycle stays there.
        until(page, "geomechPlayer.count === 7")
        assert page.evaluate("geomechPlayer.at") == 1
        assert page.evaluate("geomechPlayer.chart.lines[0].x.length") == 7
        assert page.locator("[data-role=joints]").count() == 1 and page.locator("[data-role=field]").count() == 1
        page.goto("about:blank")
    finally:
        viewer.close()
