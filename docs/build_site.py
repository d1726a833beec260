# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the site of the documentation: ``python -m docs.build_site FOLDER``.

The pages are copied to a temporary folder, together with those from other folders of the project,
whose links are adapted. A warning of Sphinx, such as a link that leads nowhere, is an error.
"""

import re
import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd import build as sphinx

ROOT = Path(__file__).resolve().parents[1]

FURTHER_PAGES = {
    "measurements.md": "benchmarks/RESULTS.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
}
"""Pages of the site that lie elsewhere in the project."""

LINKS = (
    (r"\]\((?:\.\./)?benchmarks/RESULTS\.md", "](measurements.md"),
    (r"\]\((?:\.\./)?CHANGELOG\.md", "](changelog.md"),
    (r"\]\((?:\.\./)?CONTRIBUTING\.md", "](contributing.md"),
    (r"\]\((?:\.\./)?README\.md(#[\w-]*)?", "](index.md"),
    (r"\]\((?:\.\./)?docs/", "]("),
    (r"\]\(figures/", "](_figures/"),
)
"""Patterns of links between folders of the project, and what replaces them on the site."""


def staged(folder: Path) -> None:
    """Write the sources of all pages to a folder."""
    shutil.copytree(ROOT / "docs", folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "benchmarks" / "figures", folder / "_figures")
    for page, source in FURTHER_PAGES.items():
        shutil.copy(ROOT / source, folder / page)
    for path in folder.rglob("*.md"):
        text = path.read_text(encoding="utf-8")
        for pattern, replacement in LINKS:
            text = re.sub(pattern, replacement, text)
        path.write_text(text, encoding="utf-8")


def build_site(output: Path) -> int:
    """Build the site in a folder, which is emptied first; returns Sphinx's exit status."""
    shutil.rmtree(output, ignore_errors=True)
    with tempfile.TemporaryDirectory() as temporary:
        source = Path(temporary) / "docs"
        staged(source)
        folders = {"-c": ROOT / "docs", "-d": Path(temporary) / "doctrees"}
        options = [str(each) for pair in folders.items() for each in pair]
        options += ["-b", "html", "-W", "--keep-going", "-q"]
        return int(sphinx.main([*options, str(source), str(output)]))


if __name__ == "__main__":
    sys.exit(build_site(Path(sys.argv[1])))
