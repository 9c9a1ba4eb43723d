"""Headless browser for pages on disk.

It is Debian's Chromium. Without it, the test is skipped with a reason.
"""

import contextlib
import importlib.util
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

BROWSER, DRIVER = "/usr/bin/chromium", "/usr/bin/chromedriver"


@contextlib.contextmanager
def chromium(*, dark: bool = False, width: int = 1280, height: int = 900) -> Iterator[Any]:
    """Start a new browser and yield its driver.

    Both paths are passed to selenium, so that it never downloads a driver.
    """
    for path in (BROWSER, DRIVER):
        if not shutil.which(path):
            pytest.skip(f"there is no {path}: on Debian `apt install chromium chromium-driver` brings it")
    if importlib.util.find_spec("selenium") is None:
        pytest.skip("selenium is not installed: the dev extra brings it")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", f"--window-size={width},{height}"):
        options.add_argument(argument)
    # Every network request fails, which reveals pages that need one.
    options.add_argument("--host-resolver-rules=MAP * ~NOTFOUND")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        yield driver
    finally:
        driver.quit()


def press(driver: Any, *keys: str) -> None:
    """Press keys: letters, or WebDriver's codes for other keys."""
    from selenium.webdriver.common.action_chains import ActionChains

    actions = ActionChains(driver)
    for key in keys:
        actions.send_keys(key)
    actions.perform()
