"""Draw the pictures of pages in a browser: `python docs/browser_pictures.py` (a minute; needs the extra view).

The browser is Chromium, at the path in CHROMIUM or where playwright installs it.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from apo_bench.benchmark.report.report import write_report
from apo_bench.trial.request import Request, run_request
from apo_bench.trial.rollout import Rollout
from apo_bench.viz.browser import PORT, Page

PICTURES = Path(__file__).parent / "pictures"
SWEEP = Path(__file__).parents[1] / "tests" / "kept" / "sweep"
COLOURS = 200  # of the palette of a picture
WAIT_MS = 250
WAITS = 40  # until the viewer has drawn everything
SLOW_MS = 200_000  # a picture of WebGL without a graphics card takes this long at most


def main() -> None:
    with browser() as chromium, tempfile.TemporaryDirectory() as folder:
        shoot_report(chromium, Path(folder) / "small")
        run_request(
            Request("stick_in_tower", {"noise_level": 1.0, "seed": 7, "method": "uncorrected"}),
            lambda rollout: shoot_viewer(chromium, rollout),
        )


@contextmanager
def browser() -> Iterator[Any]:
    """Start Chromium, which draws WebGL without a graphics card."""
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        chromium = playwright.chromium.launch(executable_path=os.environ.get("CHROMIUM"), args=options)
        yield chromium
        chromium.close()


def shoot_report(chromium: Any, folder: Path) -> None:
    """Write the report of a small sweep, and take its top."""
    shutil.copytree(SWEEP, folder)
    page = chromium.new_page(viewport={"width": 1180, "height": 880})
    page.goto(write_report(folder).page.resolve().as_uri())
    shoot(page, "report.png")


def shoot_viewer(chromium: Any, rollout: Rollout) -> None:
    """Serve a trial, and take the page as it opens."""
    served = Page(rollout, PORT)
    page = chromium.new_page(viewport={"width": 1240, "height": 640})
    page.goto(served.address)
    for _ in range(WAITS):
        served.draw()
        page.wait_for_timeout(WAIT_MS)
    page.add_style_tag(content=".mantine-Notifications-root { display: none; }")  # a warning of slow graphics
    shoot(page, "view_browser.png")
    served.close()


def shoot(page: Any, name: str) -> None:
    """Write what a page shows as PNG with a palette."""
    path = PICTURES / name
    page.screenshot(path=path, timeout=SLOW_MS)
    Image.open(path).convert("RGB").quantize(COLOURS).save(path, optimize=True)


if __name__ == "__main__":
    main()
