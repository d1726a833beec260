"""The pages of the documentation, and the code in them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import nicmm_core as nicmm

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


def numbered(mesh: nicmm.Mesh) -> nicmm.Mesh:
    """The mesh with its vertices with x > 0.2 first, in random order.

    The documentation uses some of the first ones, which lie on one side of the plane x = 0. The
    seed is one with which, on a sphere, curves that avoid each other do not separate points.
    """
    order = np.random.default_rng(34).permutation(len(mesh.vertices))
    order = order[np.argsort(mesh.vertices[order, 0] <= 0.2, kind="stable")]
    place = np.argsort(order)
    return nicmm.Mesh(mesh.vertices[order], place[mesh.faces])
