"""A report looked at in a real browser: Chromium without a window, without a network, driven by Playwright.

Both are optional (`pip install playwright`; Debian's package ``chromium``). What is checked is what a reader would notice: errors,
requests, whether the model turns, whether the page fits a telephone, words for pictures, the order of headings.
"""

from __future__ import annotations

import io
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfar_fem.errors import MissingDependencyError
from reconstruction.libraries import optional

NAMES = ("chromium", "chromium-browser", "google-chrome-stable", "google-chrome")
ARGUMENTS = (
    "--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-sandbox",
)  # fmt: skip
SIZES = ((1280, 900), (390, 844))
"""Widths and heights looked at, px: a desk and a telephone."""
_HEADINGS = """() => [...document.querySelectorAll('h1,h2,h3,h4')].map(h => Number(h.tagName[1]))"""
_ALT = """() => [...document.images].filter(i => !i.alt || !i.naturalWidth && i.complete).length"""
_FRAMES = """() => new Promise(done => { let n = 3; const next = () => n-- ? requestAnimationFrame(next) : done(); next(); })"""
_WIDTH = """() => document.documentElement.scrollWidth - document.documentElement.clientWidth"""


@dataclass(frozen=True)
class Seen:
    """What the browser found.

    Attributes
    ----------
    errors : tuple of str
        Of the console and of scripts.
    requests : tuple of str
        Addresses asked for, other than the file itself and data in it.
    live : bool
        WebGL runs and the model is drawn.
    drawn, dragged, keyed, switched : float
        Share of the model's pixels that differ: from the empty background; after a drag; after arrow keys; with the
        first model and its triangles (0 with one model).
    touched : float
        The same after a drag of a finger.
    restored : float
        After reset, from the first view: 0 if it is the same.
    moves_by_itself : bool
        Offers to turn although the reader asked for reduced motion (or never offers it).
    overflow : dict of int to int
        By width of the window, px that the page is wider.
    without_alt : int
        Pictures without words, or that do not show.
    headings : tuple of int
        Levels in order.
    fallback : bool
        Without WebGL the still picture and the reason are shown.
    """

    errors: tuple[str, ...]
    requests: tuple[str, ...]
    live: bool
    drawn: float
    dragged: float
    keyed: float
    switched: float
    touched: float
    restored: float
    moves_by_itself: bool
    overflow: dict[int, int]
    without_alt: int
    headings: tuple[int, ...]
    fallback: bool


def chromium() -> str:
    """Path of the browser.

    Raises
    ------
    MissingDependencyError
        There is none.
    """
    for name in NAMES:
        if found := shutil.which(name):
            return found
    raise MissingDependencyError(f"looking at a report needs a browser, one of {', '.join(NAMES)}: apt-get install chromium")


def look(path: str | Path, pictures: str | Path | None = None) -> Seen:
    """Open a report and try it out.

    Parameters
    ----------
    path : path-like
        A file of :func:`reconstruction.report.write.write_report` with at least one model.
    pictures : path-like, optional
        Folder for pictures of the page (wide, narrow, dark, in print) and of every model in every colour.

    Raises
    ------
    MissingDependencyError
        No Playwright or no Chromium.
    """
    api = optional("playwright.sync_api", "looking at a report needs", "playwright")
    address = Path(path).resolve().as_uri()
    folder = None if pictures is None else Path(pictures)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    with api.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium(), args=list(ARGUMENTS))
        try:
            return _look(browser, address, folder)
        finally:
            browser.close()


def _look(browser, address: str, folder: Path | None) -> Seen:
    errors: list[str] = []
    requests: list[str] = []
    overflow = {}
    values: dict[str, float] = {}
    for width, height in SIZES:
        context = browser.new_context(viewport={"width": width, "height": height}, offline=True, has_touch=width < 600)
        page = _open(context, address, errors, requests)
        overflow[width] = int(page.evaluate(_WIDTH))
        live = page.locator("#viewer.live").count() == 1
        if width < 600:
            values["touched"] = _touch(context, page) if live else 0.0
        else:
            values |= _try(page, folder) if live else {}
            without, headings = int(page.evaluate(_ALT)), tuple(page.evaluate(_HEADINGS))
            offers_here = page.locator(".turn").is_visible() if live else False
            if folder is not None:
                page.pdf(path=str(folder / "print.pdf"), format="A4", print_background=True)
        if folder is not None:
            page.evaluate("scrollTo(0, 0)")
            _whole_page(page, folder / f"page-{width}.png")
        context.close()
    desk = {"width": 1280, "height": 900}
    context = browser.new_context(viewport=desk, offline=True, reduced_motion="reduce", color_scheme="dark")
    page = _open(context, address, errors, requests)
    offers = page.locator(".turn").is_visible()
    if folder is not None:
        _whole_page(page, folder / "page-dark.png")
    context.close()
    context = browser.new_context(offline=True)
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = _open(context, address, errors, requests)
    fallback = page.locator(".fallback img").is_visible() and "WebGL" in page.locator(".why").inner_text()
    context.close()
    parts = {name: values.get(name, 0.0) for name in ("drawn", "dragged", "keyed", "switched", "touched", "restored")}
    return Seen(tuple(errors), tuple(requests), live, **parts, moves_by_itself=offers or not offers_here, overflow=overflow,
                without_alt=without, headings=headings, fallback=fallback)  # fmt: skip


def _whole_page(page, path: Path) -> None:
    """A picture of a page put together from its screens: beyond 8192 pixels a browser without a graphics card repeats itself."""
    from PIL import Image

    width, height, screen = page.evaluate("() => {const d = document.documentElement; return [d.clientWidth, d.scrollHeight, "
                                          "d.clientHeight]}")  # fmt: skip
    whole = Image.new("RGB", (width, height))
    for top in range(0, height, screen):
        start = max(0, min(top, height - screen))
        page.evaluate("y => scrollTo(0, y)", start)
        whole.paste(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), (0, start))
    whole.save(path)


def _open(context, address: str, errors: list[str], requests: list[str]):
    page = context.new_page()
    def said(message) -> None:
        if message.type in ("error", "warning") and not _driver(message.text):
            errors.append(f"{message.type}: {message.text}")

    page.on("console", said)
    page.on("pageerror", lambda e: errors.append(str(e)))
    page.on("request", lambda r: requests.append(r.url[:200]) if not r.url.startswith(("data:", address)) else None)
    page.goto(address)
    _settle(page)
    return page


def _driver(text: str) -> bool:
    """Remarks of the graphics driver on reading pixels back for a picture of the page."""
    return "GL Driver Message" in text


def _settle(page) -> None:
    """Wait until what was asked for has been drawn."""
    page.evaluate(_FRAMES)


def _pixels(page) -> np.ndarray:
    from PIL import Image

    _settle(page)
    return np.asarray(Image.open(io.BytesIO(page.locator("#viewer canvas").screenshot())).convert("RGB")).astype(int)


def _changed(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pixels of the model (in either picture) that differ."""
    background = a[3, -3]
    model = (np.abs(a - background).max(axis=2) > 8) | (np.abs(b - background).max(axis=2) > 8)
    return float((np.abs(a - b).max(axis=2) > 8)[model].mean()) if model.any() else 0.0


def _drag(page, dx: float, dy: float) -> None:
    box = page.locator("#viewer canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + dx, y + dy, steps=4)
    page.mouse.up()


def _try(page, folder: Path | None) -> dict[str, float]:
    page.locator("#viewer canvas").scroll_into_view_if_needed()
    first = _pixels(page)
    found = {"drawn": float((np.abs(first - first[3, -3]).max(axis=2) > 8).mean())}
    _drag(page, 160, 40)
    turned = _pixels(page)
    found["dragged"] = _changed(first, turned)
    if folder is not None:
        page.locator("#viewer").screenshot(path=str(folder / "model-dragged.png"))
    page.locator("#viewer canvas").focus()
    page.keyboard.press("Shift")  # the ring of the keyboard's focus is there before and after
    turned = _pixels(page)
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("+")
    found["keyed"] = _changed(turned, _pixels(page))
    page.locator("#viewer button[data-do=reset]").click()
    page.mouse.move(2, 2)
    page.evaluate("() => document.activeElement.blur()")
    found["restored"] = _changed(first, _pixels(page))
    found["switched"] = 0.0
    choices = page.locator("#viewer input[name=model]")
    if choices.count() > 1:
        for i in range(choices.count() - 1, -1, -1):
            choices.nth(i).check()
            colours = page.locator("#viewer select[name=scalar]")
            for value in colours.locator("option").evaluate_all("o => o.map(x => x.value)"):
                if colours.is_visible():
                    colours.select_option(value)
                _settle(page)
                if folder is not None:
                    page.locator("#viewer").screenshot(path=str(folder / f"model-{i}-colour{value}.png"))
        page.locator("#viewer input[name=edges]").check()
        found["switched"] = _changed(first, _pixels(page))
        page.locator("#viewer input[name=edges]").uncheck()
        choices.last.check()
    return found


def _touch(context, page) -> float:
    """A finger's drag aslant, by the protocol of the browser's tools; none if it scrolls the page."""
    page.locator("#viewer canvas").scroll_into_view_if_needed()
    before = _pixels(page)
    box = page.locator("#viewer canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tools = context.new_cdp_session(page)
    top = page.evaluate("() => scrollY")
    for kind, shift in (("touchStart", 0), ("touchMove", 40), ("touchMove", 80), ("touchMove", 120), ("touchEnd", None)):
        points = [] if shift is None else [{"x": x + shift / 2, "y": y - shift}]
        tools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    _settle(page)
    if page.evaluate("() => scrollY") != top:
        return 0.0
    return _changed(before, _pixels(page))
