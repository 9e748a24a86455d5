"""Every notebook runs to its end, where its own check is; the interactive one does what it says in a real browser."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from nbconvert import HTMLExporter
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
INTERACTIVE = ROOT / "notebooks" / "3_pareto.ipynb"
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--window-size=1200,1500",
)  # fmt: skip


def executed(path: Path, folder: Path) -> Any:
    """The notebook with its outputs, run in ``folder``. Raises what a cell raises."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def test_there_is_a_notebook_for_everything_and_none_holds_outputs() -> None:
    assert [path.stem[0] for path in NOTEBOOKS] == list("12345678")
    for path in NOTEBOOKS:
        cells = nbformat.read(path, as_version=4).cells
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), path.name
        assert cells[-1].source.count("assert ") >= 1, f"{path.name} ends without a check"


@pytest.mark.parametrize("path", [path for path in NOTEBOOKS if path != INTERACTIVE], ids=lambda path: path.stem)
def test_it_runs_and_its_check_holds(path: Path, tmp_path: Path) -> None:
    notebook = executed(path, tmp_path)
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ()) if "data" in output]
    for output in shown:
        seen = "image/png" in output["data"] or not output["data"].get("text/plain", "").startswith("<Figure")
        assert seen, "a figure that nobody sees"
    assert any("image/png" in output["data"] for output in shown)


@pytest.fixture
def browser() -> Iterator[webdriver.Chrome]:
    """Debian's Chromium, which `make test` installs."""
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for flag in FLAGS:
        options.add_argument(flag)
    found = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
    yield found
    found.quit()


def _state(browser: webdriver.Chrome) -> dict[str, Any]:
    """What the page shows: the words, the place of the marker, the velocity curve, and the slider."""
    state: dict[str, Any] = browser.execute_script("""
        const page = document.querySelector('.plotly-graph-div');
        return {words: document.querySelector('.annotation-text').textContent, x: page._fullData[1].x[0],
                velocity: Array.from(page._fullData[3].y), slider: page.layout.sliders[0].active,
                curves: page._fullData.slice(1).map(x => [x.name, Math.min(...x.y), Math.max(...x.y)])};""")
    peaks = {name: max(-low, high) for name, low, high in state["curves"][1:6]}
    assert peaks["velocity"] <= 0.5 and 1.0 < peaks["acceleration"] <= 4.905 and peaks["jerk"] == pytest.approx(98.1)
    assert peaks["power"] == pytest.approx(
        float(state["words"].partition("peak power ")[2].partition(" W")[0]), rel=2e-2
    )
    limits = {name: peak for name, _, peak in state["curves"][6:]}
    assert set(limits) == {"limit"}, "a curve took the place of a limit"
    return state


def _changed(browser: webdriver.Chrome, before: dict[str, Any]) -> dict[str, Any]:
    """The state once it is another. Raises TimeoutError after ten seconds."""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        if (now := _state(browser))["words"] != before["words"]:
            return now
        time.sleep(0.02)
    raise TimeoutError(f"the page still shows {before['words']}")


def test_a_click_and_the_slider_show_another_point_of_the_front(browser: webdriver.Chrome, tmp_path: Path) -> None:
    notebook = executed(INTERACTIVE, tmp_path)
    page = tmp_path / "pareto.html"
    page.write_text(HTMLExporter().from_notebook_node(notebook)[0])
    browser.get(page.as_uri())
    browser.switch_to.frame(browser.find_element(By.CSS_SELECTOR, "iframe[srcdoc]"))
    first = _state(browser)
    assert "peak power" in first["words"] and "+1 % time" in first["words"] and "to gain" in first["words"]

    dots = browser.find_elements(By.CSS_SELECTOR, ".scatterlayer .trace:first-child .points path")
    wanted = 1 if first["slider"] != 1 else 2
    ActionChains(browser).move_to_element(dots[wanted]).click().perform()
    clicked = _changed(browser, first)
    assert clicked["slider"] == wanted and clicked["x"] != first["x"] and clicked["velocity"] != first["velocity"]
    assert f"{clicked['x']:.5g} J" in clicked["words"]

    rail = browser.find_element(By.CSS_SELECTOR, ".slider-rail-touch-rect")
    ActionChains(browser).move_to_element_with_offset(rail, int(0.45 * rail.size["width"]), 0).click().perform()
    drawn = _changed(browser, clicked)
    assert drawn["slider"] == len(dots) - 1 and drawn["velocity"] != clicked["velocity"]
    assert browser.save_screenshot(str(tmp_path / "pareto.png"))
