"""The rules that the C sources follow."""

import re

from building import environment

SOURCES = sorted((environment.KERNELS / "source").glob("*.[ch]"))


def test_lines_fit_and_are_plain_text():
    for path in SOURCES:
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            assert line.isascii() and len(line) <= 100 and line == line.rstrip(), (path, number)


def test_nothing_allocates_or_depends_on_the_platform():
    """The C libraries of the platforms round these functions differently."""
    forbidden = r"\b(malloc|calloc|realloc|free|pow|exp|log|sin|cos|tan|atan2?|acos|asin|fma)\s*\("
    for path in SOURCES:
        assert not re.search(forbidden, path.read_text()), path


def test_there_is_no_state():
    """Static data are constants."""
    for path in SOURCES:
        for line in path.read_text().splitlines():
            assert not re.match(r"static (?!inline|const)[^(]*[=;]", line), (path, line)
