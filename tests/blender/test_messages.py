"""Every message of the extension is explained in docs/troubleshooting.md."""

import ast
import re

import pytest

from building import environment

DOCUMENT = environment.ROOT / "docs" / "troubleshooting.md"
SHORTEST, WORDS = 12, 6
"""Fewest letters of a part of a message to compare, and the number of its words compared."""

# Modules of the core with messages about a request, a start or an argument.
CORE = (
    "arguments.py",
    "designer.py",
    "repaired_surface.py",
    "start.py",
    "repair/free_surface.py",
    "avoidance/barriers.py",
    "avoidance/clearance.py",
    "avoidance/contacts.py",
    "avoidance/off_curves.py",
    "offsets/curve_offsets.py",
    "strokes/feature_lines.py",
    "measures.py",
    "strokes/stroke_fit.py",
    "outputs/cut.py",
    "outputs/region.py",
    "path/legs.py",
    "path/initial_path.py",
)
KINDS = {
    "ArgumentError",
    "ControlPointError",
    "CurveError",
    "UnreachableError",
}


def pieces(node):
    """The first words of the fixed parts of a message, without inserted values."""
    found = [
        part.value
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    ]
    begun = [
        " ".join(plain(text).removeprefix("control points ").split()[:WORDS]) for text in found
    ]
    return [piece for piece in begun if len(piece) >= SHORTEST]


def plain(text):
    """A text in lower case, without punctuation."""
    return " ".join(re.sub(r"[\W_]+", " ", text).split()).lower()


def messages(paths, kinds):
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            raised = isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
            if raised and node.exc.args:
                name = getattr(node.exc.func, "attr", getattr(node.exc.func, "id", ""))
                if name in kinds and (found := pieces(node.exc.args[0])):
                    yield f"{path.name}:{node.lineno}", found


def of_blender():
    return messages(sorted((environment.ROOT / "nicmm_blender").rglob("*.py")), {"InputError"})


def of_core():
    return messages([environment.ROOT / "nicmm_core" / name for name in CORE], KINDS)


def polls():
    """Messages of disabled buttons: constants in polls.py, and literals in other modules."""
    for path in sorted((environment.ROOT / "nicmm_blender").rglob("*.py")):
        text = path.read_text("utf-8")
        for message in re.findall(r'poll_message_set\("([^"]+)"\)', text):
            yield path.name, [plain(message)]
        if path.name == "polls.py":
            values = [part.value for part in ast.parse(text).body if isinstance(part, ast.Assign)]
            for part in (part for value in values for part in ast.walk(value)):
                if isinstance(part, ast.Constant) and " " in part.value:
                    yield path.name, [plain(part.value)]


@pytest.mark.parametrize("source", [of_blender, of_core, polls])
def test_messages_are_explained(source):
    explained = plain(DOCUMENT.read_text(encoding="utf-8"))
    found = list(source())
    assert len(found) > 5
    missing = [place for place, parts in found if not any(part in explained for part in parts)]
    assert not missing


def test_statuses_are_explained():
    explained = plain(DOCUMENT.read_text(encoding="utf-8"))
    text = (environment.ROOT / "nicmm_core" / "status.py").read_text(encoding="utf-8")
    (status,) = (
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ClassDef) and node.name == "Status"
    )
    for line in status.body:
        if isinstance(line, ast.Assign) and line.targets[0].id not in ("CONVERGED", "CANCELLED"):
            first = re.split("[;,]", line.value.value)[0]
            assert plain(first) in explained, first
