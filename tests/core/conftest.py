"""Fixtures with small generated surfaces, shared by the tests of the core."""

import pytest
from hypothesis import HealthCheck, settings

import nicmm_core as nicmm
from nicmm_core import improvement, shapes
from nicmm_core.courses import course_surface

pytest.register_assert_rewrite("tests.core.checks")

# The same examples in every run, no files, and no deadline, since times depend on the machine.
settings.register_profile(
    "core",
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("core")


@pytest.fixture(scope="session")
def ball():
    """Unit sphere with 642 vertices."""
    return shapes.sphere(3)


@pytest.fixture(scope="session")
def small_ball():
    """Unit sphere with 162 vertices."""
    return shapes.sphere(2)


@pytest.fixture(scope="session")
def flat_disc():
    """Flat unit disc with a boundary."""
    return shapes.disc(12)


@pytest.fixture(scope="session")
def ring():
    """Torus about the z axis, radii 1 and 0.4."""
    return shapes.torus(around=36, across=18)


@pytest.fixture(scope="session")
def body():
    """An irregular body with thin limbs and without symmetry."""
    return shapes.creature(1, faces=200, subdivisions=1)


@pytest.fixture(scope="session", params=["ball", "flat_disc", "ring", "body"])
def surface(request) -> nicmm.Mesh:
    """Each of the surfaces above, in turn."""
    return request.getfixturevalue(request.param)


@pytest.fixture
def without_courses(monkeypatch):
    """Make curves start from the initial path, as if no course were found."""
    monkeypatch.setattr(course_surface, "find_courses", lambda *arguments, **named: iter(()))


@pytest.fixture
def one_attempt(monkeypatch):
    """Make only the first attempt at each curve, which must be valid too but may bend more."""
    monkeypatch.setattr(improvement, "MOST_WORK", 0)


@pytest.fixture(scope="module")
def one_attempt_each():
    """`one_attempt` for all tests of a module, which test anything but the course of a curve."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(improvement, "MOST_WORK", 0)
        yield
