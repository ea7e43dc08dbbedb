"""Reports in a browser, on a wide and on a narrow window: nothing breaks, and all of it can be used with a keyboard."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from support.commands import run

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed: extra dev")
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from selenium.webdriver.support.ui import WebDriverWait  # noqa: E402

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("chromedriver"), reason="no chromedriver: Debian has it as chromium-driver"),
]

SPECS = Path(__file__).parent.parent / "specs"
SHOWN = ("pendulum", "cuk-kkl-pebo", "ferrante2019-robot", "infeasible/cuk-pebo-as-printed")
WINDOWS = {"wide": (1400, 900), "narrow": (400, 800)}
FAILED = "error => done({violations: [{id: String(error)}]})"
MOST = 2  # violations of axe that are quoted


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Page on a folder of results, as an address."""
    folder = tmp_path_factory.mktemp("results")
    for name in SHOWN:
        assert run("solve", SPECS / f"{name}.yaml", "-o", folder / f"{Path(name).name}.gains.json", "-q").exit_code in (
            0,
            3,
        )
    assert run("report", folder, "-o", folder / "report.html", "-q").exit_code == 0
    return (folder / "report.html").as_uri()


@pytest.fixture(scope="module", params=WINDOWS)
def window(request):
    """Browser with a window of some size."""
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--hide-scrollbars"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
    browser = webdriver.Chrome(options, service)
    width, height = WINDOWS[request.param]
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    yield browser
    browser.quit()


@pytest.fixture
def page(window, report):
    """The index, just opened."""
    window.get("about:blank")
    window.get(report)
    return window


@pytest.fixture(scope="session")
def axe(tmp_path_factory):
    """Text of axe-core, from npm."""
    folder = tmp_path_factory.mktemp("axe")
    try:
        subprocess.run(
            ["npm", "install", "--no-audit", "--no-fund", "--prefix", folder, "axe-core@4"],
            check=True,
            capture_output=True,
            timeout=60,
        )
    except (OSError, subprocess.SubprocessError) as error:
        pytest.skip(f"axe-core cannot be installed from npm: {error}")
    return (folder / "node_modules" / "axe-core" / "axe.min.js").read_text()


def shown(page, selector):
    """Elements of a page that can be seen."""
    return [element for element in page.find_elements(By.CSS_SELECTOR, selector) if element.is_displayed()]


def anchors(page):
    """Where the rows of the index lead."""
    links = page.find_elements(By.CSS_SELECTOR, ".results tbody th a")
    return [link.get_attribute("href").partition("#")[2] for link in links]


def opened(page, anchor):
    """Show one of the reports."""
    page.execute_script("location.hash = arguments[0]", anchor)


def test_nothing_is_wider_than_the_window_and_nothing_is_complained_of(page):
    for anchor in ["index", *anchors(page)]:
        opened(page, anchor)
        assert shown(page, "h1")
        width = page.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
        assert width[0] <= width[1], anchor
    assert page.get_log("browser") == []


def test_the_table_is_sorted_and_filtered(page):
    def names():
        return [row.text.split("\n")[0] for row in shown(page, ".results tbody th")]

    everything = names()
    assert len(everything) == len(SHOWN)
    button = shown(page, "button.sort")[0]
    button.send_keys(Keys.ENTER)
    assert names() == sorted(everything, key=str.lower)
    button.send_keys(Keys.ENTER)
    assert names() == sorted(everything, key=str.lower, reverse=True)
    page.find_element(By.ID, "filter").send_keys("pebo refuted")
    assert len(names()) == 1
    assert page.find_element(By.ID, "shown").text == f"1 of {len(SHOWN)} results"


def test_the_arrow_keys_read_the_values_of_a_chart(page):
    opened(page, next(a for a, name in zip(anchors(page), sorted(SHOWN), strict=True) if name == "pendulum"))
    plot = shown(page, ".plot")[0]
    page.execute_script("arguments[0].focus()", plot)
    plot.send_keys(Keys.HOME)
    first = plot.get_attribute("aria-valuetext")
    assert first.startswith("t = 0: angle 1.2, estimate of angle 0")
    plot.send_keys(Keys.ARROW_RIGHT)
    assert plot.get_attribute("aria-valuetext") != first
    figure = plot.find_element(By.XPATH, "./ancestor::figure")
    assert all(output.text for output in figure.find_elements(By.CSS_SELECTOR, ".legend output"))


def test_a_gain_is_copied(page):
    opened(page, anchors(page)[0])
    button = shown(page, "button.copy")[0]
    page.execute_script("arguments[0].focus()", button)
    button.send_keys(Keys.ENTER)
    WebDriverWait(page, 5).until(lambda _: button.text == "Copied")


def test_it_can_be_printed_and_has_a_dark_form(page):
    paper = page.print_page()
    assert len(paper) > 10_000
    background = "return getComputedStyle(document.body).backgroundColor"
    light = page.execute_script(background)
    features = [{"name": "prefers-color-scheme", "value": "dark"}]
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    assert page.execute_script(background) != light
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(page, axe, scheme):
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    page.execute_cdp_cmd("Runtime.evaluate", {"expression": axe})
    for anchor in ["index", *anchors(page)]:
        opened(page, anchor)
        found = page.execute_async_script(f"const done = arguments[0]; axe.run().then(done, {FAILED})")
        wrong = [(one["id"], [n["html"][:200] for n in one.get("nodes", [])[:MOST]]) for one in found["violations"]]
        assert wrong == [], json.dumps(wrong, indent=1)
