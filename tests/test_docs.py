"""The pages in docs/ keep their word: their Python runs, block after block, in one namespace per page."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
PAGES = [page for page in sorted(DOCS.glob("*.md")) if "```python" in page.read_text(encoding="utf-8")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_python_of_a_page_runs(page, capsys):
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    names: dict = {"__name__": "page"}
    for block in blocks:
        exec(compile(block, page.name, "exec"), names)
    if page.name == "your-own-law.md":
        out = capsys.readouterr().out.splitlines()
        assert out[0].startswith("until ")
        assert 0.0 < float(out[1]) < 1.0
        plastic, expected = map(float, out[2].split())
        assert plastic == pytest.approx(expected, rel=1e-9)
        assert names["hard"].count(1) >= 1
