"""The pages of the documentation, and the code in them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

NOT_RUN = "not run: "
"""Begins a comment before a block of code that no test runs; the reason follows."""


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code in a language on a page, except those that are marked as not run."""
    text = page.read_text(encoding="utf-8")
    pattern = rf"(<!-- {NOT_RUN}[^>]+ -->\n+)?```{language}\n(.*?)```"
    return [code for mark, code in re.findall(pattern, text, re.DOTALL) if not mark]


def is_for_blender(code: str) -> bool:
    return "bpy." in code


def numbered_sphere() -> nicmm.Mesh:
    """A sphere whose vertices with x > 0.2 come first, in random order.

    The documentation uses some of the first ones, which lie on one side of the plane x = 0. The
    seed is one with which curves that avoid each other do not separate the points of others.
    """
    mesh = shapes.sphere(4)
    order = np.random.default_rng(34).permutation(len(mesh.vertices))
    order = order[np.argsort(mesh.vertices[order, 0] <= 0.2, kind="stable")]
    place = np.argsort(order)
    return nicmm.Mesh(mesh.vertices[order], place[mesh.faces])
