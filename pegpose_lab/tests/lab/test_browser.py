"""What a reader sees in a browser: JupyterLab's explorers move, nothing shows an error, and the page works from a file.

Needs Chromium and Playwright; without them these tests are skipped.
"""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request

import cv2
import nbformat
import numpy as np
import pytest

from pegpose_lab.lab import command_line, widgets
from pegpose_lab.lab.environment import CHECKOUT
from pegpose_lab.lab.notebooks import exploring

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
PAGE = CHECKOUT / "figures" / "index.html"
MOVES = 10  # of each slider, for the median
READY = 120_000  # ms, for a kernel to start and a cell to run
ATTEMPTS = 3
CLICK = 10_000  # ms


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


# ---- the page ----


@pytest.mark.parametrize("width", [390, 1280])
def test_the_page_works_from_a_file(browser, width):
    page = browser.new_page(viewport={"width": width, "height": 800})
    asked, errors = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(PAGE.as_uri())
    sliders = page.locator(".slider")
    assert sliders.count() >= 6
    for k in range(sliders.count()):
        box = sliders.nth(k)
        text, drawn = box.locator("output").inner_text(), box.locator("svg").inner_html()
        taken = box.evaluate(
            """box => { const input = box.querySelector('input'), times = [];
            for (let k = 0; k <= Number(input.max); k++) { const start = performance.now();
              input.value = k; input.dispatchEvent(new Event('input')); times.push(performance.now() - start); }
            return times.sort((a, b) => a - b)[Math.floor(times.length / 2)]; }"""
        )
        print(f"{box.get_attribute('data-slider')}: {taken:.2f} ms a move")
        assert box.locator("output").inner_text() != text and box.locator("svg").inner_html() != drawn
    assert page.evaluate("document.documentElement.scrollWidth") <= width  # nothing to scroll sideways
    assert all(url.startswith(("file:", "data:")) for url in asked) and errors == []
    page.close()


# ---- JupyterLab ----


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """JupyterLab as the command ``lab`` starts it, on a copy of the notebooks; its address."""
    root = tmp_path_factory.mktemp("lab")
    shutil.copytree(CHECKOUT / "notebooks", root / "notebooks", ignore=shutil.ignore_patterns("scratch"))
    (root / "figures").symlink_to(CHECKOUT / "figures")
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    options = command_line.parse(["lab", "--no-browser", "--allow-root", f"--port={port}"], root)
    arguments = exploring.jupyterlab_arguments(options, root)
    extra = ["--IdentityProvider.token=", "--ServerApp.password=", "--ServerApp.disable_check_xsrf=True"]
    environment = os.environ | {"PEGPOSE_OUTPUT": str(tmp_path_factory.mktemp("scratch"))}
    log = open(root / "server.log", "w")  # noqa: SIM115  the server writes to it until it ends
    process = subprocess.Popen(
        [sys.executable, "-m", "jupyterlab", *arguments, *extra], env=environment, stdout=log, stderr=log
    )
    address = f"http://localhost:{port}"
    try:
        _wait_for(f"{address}/api/status", process, root / "server.log")
        yield address
    finally:
        process.terminate()
        process.wait(20)
        log.close()


def _wait_for(url, process, log):
    for _ in range(240):
        if process.poll() is not None:
            raise AssertionError(f"JupyterLab ended: {log.read_text()[-2000:]}")
        try:
            with urllib.request.urlopen(url, timeout=2) as answer:
                json.load(answer)
                return
        except OSError:
            time.sleep(0.25)
    raise AssertionError(f"JupyterLab did not start: {log.read_text()[-2000:]}")


def _open(browser, server, name):
    """A page with a notebook whose kernel is idle; the kernels of earlier ones are ended."""
    with urllib.request.urlopen(f"{server}/api/sessions") as answer:
        for session in json.load(answer):
            request = urllib.request.Request(f"{server}/api/sessions/{session['id']}", method="DELETE")
            urllib.request.urlopen(request).close()
    page = browser.new_page(viewport={"width": 1300, "height": 1000})
    page.goto(f"{server}/lab/tree/notebooks/{name}.ipynb?reset")
    page.wait_for_selector(".jp-Notebook-cell", timeout=READY)
    page.wait_for_selector(
        '.jp-NotebookPanel-toolbar [data-status="idle"], .jp-Notebook-ExecutionIndicator[data-status="idle"]',
        timeout=READY,
    )
    return page


def _code_cells(name):
    """Numbers and sources of a notebook's code cells."""
    cells = nbformat.read(CHECKOUT / "notebooks" / f"{name}.ipynb", as_version=4).cells
    return [(k, cell.source) for k, cell in enumerate(cells) if cell.cell_type == "code"]


def _accept_dialog(page):
    """Answer a dialog of JupyterLab, such as the choice of a kernel while the list of kernels is still loading."""
    dialog = page.locator(".jp-Dialog")
    if dialog.count():
        print("dialog:", " ".join(dialog.first.inner_text().split()))
        dialog.locator(".jp-mod-accept").first.click()
        dialog.first.wait_for(state="detached", timeout=READY)


def _run(page, number):
    """Run one cell; a dialog that appears meanwhile is answered, and the cell run then."""
    for attempt in range(ATTEMPTS):
        _accept_dialog(page)
        cell = _scrolled_to(page, number)
        try:
            cell.locator(".cm-content").first.click(timeout=CLICK)
            break
        except playwright.TimeoutError:
            if attempt == ATTEMPTS - 1:
                raise
    page.keyboard.press("Control+Enter")
    return cell


def _explorers():
    """(notebook, number of the cell, its source) of every explorer."""
    names = sorted(path.stem for path in (CHECKOUT / "notebooks").glob("[0-9]*.ipynb"))
    return [(name, *cell) for name in names for cell in _code_cells(name) if "explorer(" in cell[1]]


@pytest.mark.parametrize(("name", "number", "source"), _explorers(), ids=lambda value: str(value)[:24])
def test_an_explorer_runs_from_its_own_cell_and_moves(browser, server, monkeypatch, name, number, source):
    page = _open(browser, server, name)
    cell = _run_until(page, number, "img.jupyter-widgets")
    assert (
        cell.locator("[data-mime-type='application/vnd.jupyter.stderr'], .jp-OutputArea-output.jp-mod-error").count()
        == 0
    )
    explorer = _in_this_process(source, monkeypatch)
    sliders = [(label, one) for label, one in explorer.controls.items() if hasattr(one, "step") and not one.disabled]
    boxes = cell.locator(".noUi-target:not([disabled])")
    assert boxes.count() == len(sliders) > 0
    for k, (label, control) in enumerate(sliders):
        times = _moved(page, cell, boxes.nth(k).locator(".noUi-handle").first)
        assert len(times) >= 3, f"{name}: {label} changes nothing"
        kernel = np.median(_kernel_times(control))
        print(
            f"{explorer.name:26} {label:14} {np.median(times):5.0f} ms from key to picture, {kernel:5.0f} ms of it kernel"
        )
    assert cell.locator(".jp-mod-error").count() == 0
    page.close()


def _run_until(page, number, selector):
    """Run a cell until something is in its output; a key pressed while the kernel was still starting is lost."""
    for attempt in range(ATTEMPTS):
        cell = _run(page, number)
        try:
            cell.locator(selector).first.wait_for(timeout=READY / ATTEMPTS)
            return cell
        except playwright.TimeoutError:
            if attempt == ATTEMPTS - 1:
                raise


def _moved(page, cell, handle):
    """Times (ms) from key to changed picture of moves by one step, to the right and at the end back."""
    key, times = "ArrowRight", []
    for _ in range(2 * MOVES):
        before, at, start = _shown(cell), _place(handle), time.perf_counter()
        handle.focus()
        page.keyboard.press(key)
        while (same := _shown(cell) == before) and time.perf_counter() - start < 3:
            page.wait_for_timeout(5)
        if _place(handle) == at:  # the slider's end
            key = "ArrowLeft"
        elif not same:
            times.append(1000 * (time.perf_counter() - start))
        if len(times) == MOVES:
            break
    return times


def _place(handle):
    """Where a slider's handle is (its accessible value has one decimal only)."""
    return handle.evaluate("handle => handle.parentElement.style.transform")


def _in_this_process(source, monkeypatch):
    """The explorer that a cell shows."""
    shown = []
    monkeypatch.setattr(widgets, "show", shown.append)
    exec(source, {})  # noqa: S102  a cell of the project's own notebooks
    return shown[0]


def _kernel_times(control):
    """Times (ms) of the same moves without a browser."""
    times, ahead = [], control.value
    for _ in range(MOVES):
        step = control.step if np.max(ahead) + control.step <= control.max else -control.step
        ahead = tuple(np.add(ahead, (step, 0)).tolist()) if isinstance(ahead, tuple) else ahead + step
        start = time.perf_counter()
        control.value = ahead
        times.append(1000 * (time.perf_counter() - start))
    return times


def _shown(cell):
    """The explorer's text and picture."""
    return cell.evaluate(
        """cell => [...cell.querySelectorAll('.widget-html-content pre')].map(pre => pre.textContent).join()
        + [...cell.querySelectorAll('img.jupyter-widgets')].map(image => image.src).join()"""
    )


def _scrolled_to(page, number):
    """The cell of that number; cells out of sight are not in the page, so it is scrolled until it is there."""
    cell = page.locator(f'.jp-Notebook-cell[data-windowed-list-index="{number}"]')
    outer = page.locator(".jp-WindowedPanel-outer").first
    for _ in range(200):
        if cell.count():
            cell.scroll_into_view_if_needed()
            return cell
        outer.evaluate("panel => panel.scrollBy(0, 600)")
        page.wait_for_timeout(100)
    raise AssertionError(f"cell {number} is not in the page")


def test_photographs_are_uploaded_and_run(browser, server, tmp_path):
    """The notebook for own images: a file dropped into the box is told, then the whole notebook runs without an error."""
    name = "13_your_images"
    image = tmp_path / "extra.png"
    cv2.imwrite(str(image), np.full((1200, 1600), 90, np.uint8))
    page = _open(browser, server, name)
    for number, source in _code_cells(name):
        cell = _run(page, number)
        if "upload_box(" in source:
            with page.expect_file_chooser(timeout=READY) as chooser:
                cell.locator("button.jupyter-button").first.click(timeout=READY)
            chooser.value.set_files(str(image))
            cell.locator("text=extra.png: 1600 x 1200 px").wait_for(timeout=READY)
        elif "def " not in source:
            cell.locator(".jp-OutputArea-output").first.wait_for(timeout=READY)
            page.wait_for_function(
                "cell => !cell.textContent.includes('[*]')", arg=cell.element_handle(), timeout=READY
            )
    assert page.locator(".jp-mod-error").count() == 0
    page.close()
