"""Wide tables on the page: within the width of the paper, and reachable on the screen."""

import json
import re
import shutil
import subprocess

import pytest

from alphacut.base.number_text import Table
from alphacut.report.page import render_template

HEAD = ("output", *(f"α = {k / 20:g}: mean over records" for k in range(21)))
ROW = ("overturning_moment", *["1.234 … 2.345 MN*m"] * 21)
A4 = 688  # px of 210 mm less both margins of 14 mm, at 96 px an inch
MEASURED = """
<p id="measured"></p><script>
const box = document.querySelector(".scroll"), table = box.querySelector("table");
const cells = [...table.querySelectorAll("td, th")];
const cut = cells.filter((cell) => cell.scrollWidth > cell.clientWidth + 1).length;
document.getElementById("measured").textContent = JSON.stringify({
  table: table.getBoundingClientRect().right, page: document.documentElement.clientWidth, cut,
  overflow: getComputedStyle(box).overflowX, scrolled: box.scrollWidth, width: box.clientWidth });
</script></body>"""


def measured(folder, *, printed):
    """Places of a wide table in px, as chromium lays the page out on paper or on a screen."""
    table = Table(HEAD, [ROW] * 3)
    text = render_template("comparison.html", title="t", name="n", about="", comparison=table)
    if printed:  # the rules of the paper, in a window as wide as the paper
        text = text.replace("@media print", "@media all")
    (folder / "page.html").write_text(text.replace("</body>", MEASURED), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile"]
    size = f"--window-size={A4 if printed else 1000},900"
    command = ["chromium", *options, size, "--dump-dom", (folder / "page.html").as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    return json.loads(re.search(r'id="measured">(.*?)</p>', dom)[1])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_wide_table_is_whole_on_paper(tmp_path):
    found = measured(tmp_path, printed=True)
    assert found["table"] <= found["page"] + 1
    assert found["cut"] == 0


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_wide_table_scrolls_on_the_screen(tmp_path):
    found = measured(tmp_path, printed=False)
    assert found["overflow"] == "auto"
    assert found["scrolled"] >= found["width"]
    assert found["width"] <= found["page"]
