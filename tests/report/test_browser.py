"""The page in a real browser: no error on its console, every picture loads, clips play."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PROBE = """
<script>
const errors = [];
addEventListener("error", (event) => errors.push(event.message || event.target.outerHTML.slice(0, 80)), true);
</script>
"""
VERDICT = """
<script>
addEventListener("load", async () => {
  const box = document.querySelectorAll(".player")[1];
  const clip = box.querySelector(".clip img");
  const shown = () => clip.getBoundingClientRect().top - clip.parentElement.getBoundingClientRect().top;
  const slider = box.querySelector("input");
  slider.value = 0;
  slider.dispatchEvent(new Event("input"));
  const first = shown();
  slider.value = slider.max;
  slider.dispatchEvent(new Event("input"));
  const travel = (first - shown()) / clip.parentElement.getBoundingClientRect().height;
  box.querySelector("button").click();
  const start = slider.value;
  await new Promise((resume) => setTimeout(resume, 3000));
  const choice = box.querySelector("select");
  choice.value = "1";
  choice.dispatchEvent(new Event("change"));
  const verdict = {
    errors,
    pictures: document.images.length,
    broken: [...document.images].filter((image) => !(image.complete && image.naturalWidth)).length,
    travel,
    played: slider.value !== start,
    hidden: [...box.querySelectorAll(".choice")].map((choice) => choice.hidden),
    overflow: document.documentElement.scrollWidth - innerWidth,
  };
  document.title = "verdict" + JSON.stringify(verdict);
});
</script>
"""


@pytest.fixture(scope="module")
def browser():
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip("no Chromium here; on Debian or Ubuntu: apt-get install chromium")
    return found


def visit(browser: str, page: Path, width: int, profile: Path) -> str:
    """The page's DOM after its scripts have run."""
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    options += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    options += [f"--user-data-dir={profile}", f"--window-size={width},900", "--virtual-time-budget=15000"]
    command = [browser, *options, "--enable-logging=stderr", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=os.environ)
    assert done.returncode == 0, done.stderr
    assert "CONSOLE" not in done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("width", [1200, 500])
def test_the_page_works(browser, full, report, tmp_path, width):
    assert report(full).returncode == 0
    text = (full / "data/report/index.html").read_text(encoding="utf-8")
    probed = tmp_path / "index.html"
    probed.write_text(text.replace("<head>", "<head>" + PROBE).replace("</body>", VERDICT + "</body>"))
    title = visit(browser, probed, width, tmp_path / "profile").split("<title>")[1].split("</title>")[0]
    verdict = json.loads(title.removeprefix("verdict").replace("&quot;", '"').replace("&amp;", "&"))
    assert verdict["errors"] == []
    assert verdict["broken"] == 0
    assert verdict["pictures"] > 50
    assert verdict["played"]
    assert verdict["travel"] == pytest.approx(25, abs=1)
    assert verdict["hidden"] == [True, False, True, True, True, True]
    assert verdict["overflow"] <= 0
