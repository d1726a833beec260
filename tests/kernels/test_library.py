"""The door of the compiled kernels: what does not fit raises an error, and crashes nothing."""

import contextlib
import pickle
import subprocess
import sys
from unittest import mock

import nicmm_kernels
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nicmm_kernels import KernelError

from building import environment
from nicmm_core import shapes
from nicmm_core.geometry.mesh import opposite_sides
from tests.core.checks import curve_through, points_near

BALL = shapes.sphere(2)
CONTACT_RULES = nicmm_kernels.ContactRules(2.0, 4.0, 0.3, 1e-12, 2.0)
PLACEMENT = nicmm_kernels.PlacementRules(1e-6, 1e-5, 1.0, 0.1, 6)
LIMITS = nicmm_kernels.TraceLimits(1e-6, 4096)
FEW_WINDOWS = 4_000
BAD_NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf])
BAD_INDICES = st.integers(-(2**62), 2**62).filter(lambda i: not 0 <= i < len(BALL.faces))


def nothing():
    pass


def arguments_from(m=4):
    """Arguments of `trace_from` for m points, by name."""
    return {
        "mesh": BALL.for_kernels,
        "faces": np.arange(m),
        "barycentric": np.full((m, 3), 1.0 / 3.0),
        "directions": np.cross(BALL.face_normals[:m], [0.1, 0.2, 0.3]),
        "lengths": np.full(m, 0.5),
        "folded": np.zeros(len(BALL.faces), dtype=bool),
        "limits": LIMITS,
        "meanwhile": nothing,
    }


def arguments_between(m=4):
    """Arguments of `trace_between` for m pairs of points, by name."""
    third = np.full((m, 3), 1.0 / 3.0)
    return {
        "mesh": BALL.for_kernels,
        "starts": (np.arange(m), third),
        "ends": (np.arange(m) + 7, third.copy()),
        "normals": BALL.face_normals[:m].copy(),
        "longest": np.full(m, 5.0),
        "folded": np.zeros(len(BALL.faces), dtype=bool),
        "fold_margin": 0.1,
        "ahead": None,
        "most_faces": 4096,
        "meanwhile": nothing,
    }


def tangled_curves(c, n=60):
    """Places of the nodes of c closed curves that cross and approach themselves."""
    angle = np.arange(n) * 2.0 * np.pi / n
    height = 0.4 * np.sin(3.0 * angle + np.arange(c)[:, None])
    angle = 2.0 * angle + 0.1 * np.sin(angle)
    ring = np.sqrt(1.0 - height**2)
    positions = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=-1)
    places = points_near(BALL, positions.reshape(-1, 3))
    return places.faces.reshape(c, n), places.barycentric.reshape(c, n, 3)


def rules(smoothness=1.0):
    return nicmm_kernels.RelaxationRules(
        LIMITS,
        CONTACT_RULES,
        nicmm_kernels.SpacingRules(1.0, 1e-3),
        nicmm_kernels.EnergyRules(smoothness, 1.0, 4.0, 10.0),
        nicmm_kernels.StepRules(3, 9, 1, 1.0, 1e-6, 1e2, 10.0, 1e-12),
    )


def arguments_relax(c=4):
    """Arguments of `relax_curves` for c curves, by name."""
    faces, barycentric = tangled_curves(c)
    fixed = np.zeros(faces.shape, dtype=bool)
    fixed[:, ::20] = True
    return {
        "surface": surface_arrays(),
        "faces": faces,
        "barycentric": barycentric,
        "fixed": fixed,
        "corners": fixed.copy(),
        "closed": True,
        "rules": rules(),
        "batch": nicmm_kernels.BatchRules(9, 3, 2, 1e-3),
        "meanwhile": nothing,
    }


def arguments_even(c=4, n=9):
    """Arguments of `even_places` for c curves, by name."""
    fixed = np.zeros((c, n), dtype=bool)
    fixed[:, ::4] = True
    return {
        "normals": np.tile([0.0, 0.0, 1.0], (c, n, 1)),
        "step_lengths": np.ones((c, n)),
        "lengths": np.linspace(1.0, 2.0, c * n).reshape(c, n),
        "fixed": fixed,
        "closed": True,
        "times": 3,
        "rules": nicmm_kernels.SpacingRules(1.0, 1e-3),
    }


def surface_arrays():
    """The ball with a map."""
    vertices = BALL.vertices.copy()
    feature_map = 1.0 + 0.5 * np.sin(9.0 * vertices[:, 0])
    return nicmm_kernels.SurfaceArrays(BALL.for_kernels, vertices, None, feature_map, 5.0, 0.5)


def arguments_place():
    """Arguments of `place_nodes`, by name."""
    faces, barycentric = tangled_curves(1)
    return {"surface": surface_arrays(), "faces": faces[0], "barycentric": barycentric[0]}


def arguments_nodes():
    """Arguments of `NodeArrays` for one curve, by name."""
    given = arguments_place()
    positions, normals, phi_fea = nicmm_kernels.place_nodes(**given)
    return {
        "faces": given["faces"],
        "barycentric": given["barycentric"],
        "positions": positions,
        "normals": normals,
        "phi_fea": phi_fea,
        "closed": True,
        "corners": np.arange(60) % 20 == 0,
    }


def arguments_contacts():
    """Arguments of `find_contacts`, by name."""
    return {"nodes": nicmm_kernels.NodeArrays(**arguments_nodes()), "rules": CONTACT_RULES}


def arguments_step():
    """Arguments of `damped_step`, by name."""
    nodes = nicmm_kernels.NodeArrays(**arguments_nodes())
    system = nicmm_kernels.Linearised(surface_arrays(), nodes, rules())
    return {
        "bands": system.bands,
        "slope": system.slope,
        "fixed": np.arange(60) % 20 == 0,
        "damping": 1e-3,
    }


def arguments_placing():
    """Arguments of `place_on_polyline` for a simple curve, by name."""
    angle = np.arange(60) * 2.0 * np.pi / 60
    height = 0.3 * np.sin(5.0 * angle)
    ring = np.sqrt(1.0 - height**2)
    positions = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    curve = curve_through(BALL, positions, np.array([0, 20, 40]))
    return {
        "surface": surface_arrays(),
        "faces": curve.faces,
        "barycentric": curve.barycentric,
        "closed": True,
        "controls": curve.control_index,
        "corners": np.array([False, True, False]),
        "count": 40,
        "rules": PLACEMENT,
    }


def arguments_curve():
    """The arrays of a `CurveArrays`, by name."""
    return nicmm_kernels.place_on_polyline(**arguments_placing())._asdict()


def on_level(**arrays):
    """Relaxes a curve on a level, and returns it."""
    level = nicmm_kernels.LevelRules(PLACEMENT, 3.0, 0.1, 1e-12, 1.6, 1e-2, 50, 1)
    relaxation = nicmm_kernels.CurveRelaxation(
        surface_arrays(), nicmm_kernels.CurveArrays(**arrays)
    )
    state = nicmm_kernels.LevelState(
        most_iterations=5, most_work=100.0, damping=1e-6, least_energy=np.inf
    )
    relaxation.begin_level(rules(), level)
    while state.outcome == nicmm_kernels.LevelOutcome.GOES_ON:
        movable = np.ones(len(relaxation.positions), dtype=bool)
        relaxation.iterate(rules(), level, movable, state)
    assert relaxation.trace(rules(), level)
    return relaxation.arrays


def arguments_steps(m=59):
    """Arguments of `trace_steps` for m steps of a curve, by name."""
    given = arguments_nodes()
    return {
        "surface": surface_arrays(),
        "nodes": nicmm_kernels.NodeArrays(**given),
        "places": (given["faces"], np.clip(given["barycentric"], 1e-6, None)),
        "start": np.arange(m) + 1,
        "end": np.arange(m),
        "limits": nicmm_kernels.StepLimits(3.0, 0.1, 4096),
        "meanwhile": nothing,
    }


def arguments_polyline(m=30):
    """Arguments of `trace_polyline` that traces m steps and keeps the others, by name."""
    given = arguments_steps()
    faces, barycentric = given["places"]
    return {
        **{name: given[name] for name in ("surface", "nodes", "places", "limits", "meanwhile")},
        "is_control": np.arange(60) % 20 == 0,
        "kept": np.arange(60) >= m,
        "former_index": np.arange(60),
        "former": (faces, barycentric),
    }


def arguments_segments(s=40):
    """Arguments of `meeting_segments` for s segments in two groups, by name."""
    generator = np.random.default_rng(5)
    return {
        "groups": generator.integers(0, 2, s),
        "starts": generator.random((s, 2)),
        "ends": generator.random((s, 2)),
        "touching": 1e-12,
        "meanwhile": nothing,
    }


def arguments_crossings(n=40):
    """Arguments of `polyline_crossings` for n random points in two faces, by name."""
    generator = np.random.default_rng(6)
    return {
        "all_faces": BALL.faces,
        "faces": generator.integers(0, 2, n),
        "barycentric": generator.dirichlet([1.0, 1.0, 1.0], n),
        "closed": True,
        "touching": 1e-12,
        "meanwhile": nothing,
    }


def arguments_traces():
    """Arguments of `TraceArrays` for the traces of a curve, by name; one of them failed."""
    counts, faces, barycentric = nicmm_kernels.trace_steps(**arguments_steps())
    begins = np.append(0, np.cumsum(np.insert(counts, 20, 0)))
    return {"mesh": BALL.for_kernels, "begins": begins, "faces": faces, "barycentric": barycentric}


def arguments_on_traces():
    """Arguments of `places_on_traces`, by name."""
    traces = nicmm_kernels.TraceArrays(**arguments_traces())
    nodes, shares = np.arange(60), np.linspace(0.0, 1.0, 60)
    return {"traces": traces, "nodes": nodes, "shares": shares, "least_inside": 1e-6}


def arguments_ends():
    """Arguments of `segment_ends`, by name."""
    given = arguments_traces()
    return {
        "all_faces": BALL.faces,
        "faces": given["faces"],
        "barycentric": given["barycentric"],
        "segments": np.arange(50),
    }


def arguments_distances(k=4):
    """Arguments of `distances_along_edges` for k points, by name."""
    return {
        "graph": BALL.edge_graph,
        "corners": BALL.faces[10 : 10 + k].copy(),
        "away": np.linspace(0.1, 0.2, 3 * k).reshape(k, 3),
        "meanwhile": nothing,
    }


def arguments_hops(n=30):
    """Arguments of `surface_hops` for n cells and up to two points, by name."""
    points = BALL.faces[5 : 5 + min(n, 2)]
    corners = np.concatenate([np.repeat(3 * np.arange(n), 3).reshape(-1, 3), points])
    positions = BALL.vertices[corners].mean(axis=1)
    return {
        "graph": BALL.edge_graph,
        "vertex_normals": BALL.vertices.copy(),
        "places": nicmm_kernels.HopPlaces(n, corners, positions, positions.copy()),
        "first": 0,
        "most": 5,
        "longest": 2.0,
        "meanwhile": nothing,
    }


def arguments_paths(q=12):
    """Arguments of `points_on_edge_paths` for q paths, by name."""
    return {
        "graph": BALL.edge_graph,
        "starts": np.arange(q),
        "ends": 40 + np.arange(q),
        "shares": np.linspace(0.0, 1.0, q),
        "longest": 10.0,
        "meanwhile": nothing,
    }


def arguments_point_paths(q=12):
    """Arguments of `paths_along_edges` for q paths, by name."""
    third = np.full((q, 3), 1.0 / 3.0)
    return {
        "graph": BALL.edge_graph,
        "starts": (np.arange(q), third),
        "ends": (40 + np.arange(q), third.copy()),
        "longest": np.full(q, 10.0),
        "meanwhile": nothing,
    }


def arguments_segments_in_faces(s=6):
    """Arguments of `distances_from_segments` for s separate segments and s points, by name."""
    third, half = np.full((s, 3), 1.0 / 3.0), np.tile([0.5, 0.3, 0.2], (s, 1))
    return {
        "mesh": BALL.for_kernels,
        "faces": 3 * np.arange(s),
        "starts": third,
        "ends": half,
        "previous": np.full(s, -1),
        "following": np.full(s, -1),
        "arcs": np.stack([np.arange(s), np.arange(s) + 1.0], axis=1),
        "limit": 0.8,
        "scale": 1e-14,
        "meanwhile": nothing,
        "at_faces": 3 * np.arange(s) + 1,
        "at_barycentric": third.copy(),
    }


def distances_from_segments(at_faces, at_barycentric, **given):
    """The sides that shortest paths enter, and the nearest places to points."""
    with mock.patch.object(nicmm_kernels.segment_distances, "MOST_WINDOWS", FEW_WINDOWS):
        paths = nicmm_kernels.SegmentPaths(**given)
    return paths.sides, *paths.nearest(at_faces, at_barycentric)


def arguments_refinement(f=12):
    """Arguments of `refined` for the first f faces of the ball as parts, by name."""
    opposite = opposite_sides(BALL.faces[:f])
    return {
        "paths": nicmm_kernels.SegmentPaths(
            **{k: v for k, v in arguments_segments_in_faces().items() if not k.startswith("at_")}
        ),
        "faces": BALL.faces[:f].copy(),
        "opposite": opposite.astype(np.int64),
        "parents": np.arange(f),
        "corners": np.broadcast_to(np.eye(3), (f, 3, 3)).copy(),
        "vertices": BALL.vertices.copy(),
        "distances": np.linspace(0.0, 0.6, len(BALL.vertices)),
        "fixed": np.zeros(len(BALL.vertices), dtype=bool),
        "reached": np.ones(len(BALL.faces), dtype=bool),
        "limits": nicmm_kernels.LevelLimits(0.3, 0.3, 0.2, 0.05, 0.01),
        "meanwhile": nothing,
    }


def refined(paths, reached, limits, meanwhile, **parts):
    """The triangles after bisection."""
    return nicmm_kernels.refine_at_level(
        paths, nicmm_kernels.PartArrays(**parts), reached, limits, meanwhile
    )


def arguments_turning(k=2, n=8):
    """Arguments of `turning_paths` with k control points among n cells, all joined, by name."""
    generator = np.random.default_rng(7)
    start, end = np.nonzero(~np.eye(n, dtype=bool))
    cell = generator.integers(0, n, (k, 4)).ravel()
    m, d = len(start), len(cell)

    def pairs(begins, states):
        counts = [len(of_one) for of_one in states]
        states = np.concatenate([begins[:0], *states])
        return (
            np.append(0, np.cumsum(counts)).astype(np.int64),
            states,
            generator.random(len(states)),
        )

    none = np.zeros(0, dtype=np.int64)
    return {
        "begins": np.arange(0, d + 1, 4),
        "weights": generator.random(m + 2 * d),
        "onward": pairs(none, [np.flatnonzero(start == of_hop) for of_hop in end]),
        "leaving": pairs(none, [np.flatnonzero(start == at) for at in cell]),
        "arriving": pairs(none, [np.flatnonzero(np.append(end, cell) == at) for at in cell]),
        "meanwhile": nothing,
    }


def path_arrays(n=8):
    """The states and paths of the graph of `arguments_turning`; cells are followed by points."""
    given = arguments_turning(2, n)
    costs, previous, first = nicmm_kernels.turning_paths(**given)
    start, end = np.nonzero(~np.eye(n, dtype=bool))
    cell = np.random.default_rng(7).integers(0, n, 8)
    point, m, d = n + np.arange(8) // 4, len(start), 8
    reverse = np.searchsorted(start * n + end, end * n + start)
    return nicmm_kernels.PathArrays(
        n + 2,
        np.concatenate([start, point, cell]),
        np.concatenate([end, cell, point]),
        np.concatenate([reverse, np.arange(m + d, m + 2 * d), np.arange(m, m + d)]),
        costs,
        previous,
        first,
    )


def arguments_legs():
    """Arguments of `best_legs`, by name."""
    weights = arguments_turning()["weights"]
    return {"graph": path_arrays(), "leg": (0, 1), "weights": weights, "rounding": 1e-9}


def arguments_routes():
    """Arguments of `distinct_routes`, by name."""
    beside = np.eye(10, dtype=bool)
    beside[[0, 1, 2, 3], [1, 0, 3, 2]] = True
    return {
        "graph": path_arrays(),
        "leg": (0, 1),
        "beside": nicmm_kernels.cell_sets(beside),
        "via": np.arange(0, 72, 2),
        "first_count": 20,
        "aligned": 40,
        "different": 40,
    }


def arguments_distinct(c=4):
    """Arguments of `distinct_curves` for c circles, every second one like the one before."""
    angle = np.arange(30) * 2.0 * np.pi / 30
    radius = 1.0 + np.arange(c)[:, None] // 2 + 0.01 * np.arange(c)[:, None]
    positions = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * radius * angle], -1)
    return {"positions": positions, "order": np.arange(c), "limit": 0.1, "meanwhile": nothing}


def arguments_flips(n=40):
    """Arguments of `flip_diagonals` for n faces, by name."""
    return {
        "vertices": BALL.vertices.copy(),
        "faces": BALL.faces[:n].copy(),
        "opposites": opposite_sides(BALL.faces[:n]),
        "flattest": 0.5,
        "tie": 0.01,
        "meanwhile": nothing,
    }


def arguments_nearest(n=4):
    """Arguments of `nearest_places` for n positions and two groups, by name."""
    faces = np.arange(9)
    return {
        "mesh": BALL.for_kernels,
        "positions": 1.1 * BALL.vertices[BALL.faces[:n, 0]],
        "groups": np.arange(n) % 2,
        "begins": np.array([0, 4, 9]),
        "faces": faces,
        "meanwhile": nothing,
    }


def arguments_sums():
    """Arguments of `least_sums`, by name."""
    generator = np.random.default_rng(3)
    return {"one": generator.random((4, 5)), "other": generator.random((5, 3))}


CALLS = {
    "least_sums": (nicmm_kernels.least_sums, arguments_sums),
    "distinct_curves": (nicmm_kernels.distinct_curves, arguments_distinct),
    "flip_diagonals": (nicmm_kernels.flip_diagonals, arguments_flips),
    "nearest_places": (nicmm_kernels.nearest_places, arguments_nearest),
    "turning_paths": (nicmm_kernels.turning_paths, arguments_turning),
    "best_legs": (nicmm_kernels.best_legs, arguments_legs),
    "distinct_routes": (nicmm_kernels.distinct_routes, arguments_routes),
    "TraceArrays": (nicmm_kernels.TraceArrays, arguments_traces),
    "places_on_traces": (nicmm_kernels.places_on_traces, arguments_on_traces),
    "segment_ends": (nicmm_kernels.segment_ends, arguments_ends),
    "EdgeGraphArrays": (
        nicmm_kernels.EdgeGraphArrays,
        lambda: {"mesh": BALL.for_kernels},
    ),
    "distances_along_edges": (nicmm_kernels.distances_along_edges, arguments_distances),
    "surface_hops": (nicmm_kernels.surface_hops, arguments_hops),
    "points_on_edge_paths": (nicmm_kernels.points_on_edge_paths, arguments_paths),
    "paths_along_edges": (nicmm_kernels.paths_along_edges, arguments_point_paths),
    "distances_from_segments": (distances_from_segments, arguments_segments_in_faces),
    "refine_at_level": (refined, arguments_refinement),
    "trace_steps": (nicmm_kernels.trace_steps, arguments_steps),
    "trace_polyline": (nicmm_kernels.trace_polyline, arguments_polyline),
    "meeting_segments": (nicmm_kernels.meeting_segments, arguments_segments),
    "polyline_crossings": (nicmm_kernels.polyline_crossings, arguments_crossings),
    "place_nodes": (nicmm_kernels.place_nodes, arguments_place),
    "NodeArrays": (nicmm_kernels.NodeArrays, arguments_nodes),
    "find_contacts": (nicmm_kernels.find_contacts, arguments_contacts),
    "damped_step": (nicmm_kernels.damped_step, arguments_step),
    "place_on_polyline": (nicmm_kernels.place_on_polyline, arguments_placing),
    "CurveRelaxation": (on_level, arguments_curve),
    "trace_from": (nicmm_kernels.trace_from, arguments_from),
    "trace_between": (nicmm_kernels.trace_between, arguments_between),
    "relax_curves": (nicmm_kernels.relax_curves, arguments_relax),
    "even_places": (nicmm_kernels.even_places, arguments_even),
}

FINITE = {
    "trace_from": [("barycentric", None), ("directions", None), ("lengths", None)],
    "trace_between": [("starts", 1), ("ends", 1), ("normals", None)],
    "distances_from_segments": [("starts", None), ("ends", None)],
    "trace_steps": [("places", 1)],
    "nearest_places": [("positions", None)],
    "relax_curves": [("barycentric", None)],
    "CurveRelaxation": [("barycentric", None)],
}
"""Arrays whose values have to be finite; others may have any values."""

INDICES = {
    "refine_at_level": [("faces", None), ("parents", None)],
    "distances_from_segments": [("faces", None), ("at_faces", None)],
    "trace_steps": [("places", 0), ("start", None), ("end", None)],
    "place_nodes": [("faces", None)],
    "place_on_polyline": [("faces", None), ("controls", None)],
    "CurveRelaxation": [("faces", None), ("node_index", None), ("polyline_faces", None)],
    "trace_from": [("faces", None)],
    "trace_between": [("starts", 0), ("ends", 0)],
    "relax_curves": [("faces", None)],
    "TraceArrays": [("begins", None), ("faces", None)],
    "places_on_traces": [("nodes", None)],
    "segment_ends": [("segments", None)],
    "polyline_crossings": [("faces", None)],
    "distances_along_edges": [("corners", None)],
    "surface_hops": [("places", 1)],
    "points_on_edge_paths": [("starts", None), ("ends", None)],
    "paths_along_edges": [("starts", 0), ("ends", 0)],
    "turning_paths": [("onward", 1), ("leaving", 1), ("arriving", 1)],
    "best_legs": [("graph", 2), ("graph", 3)],
    "distinct_curves": [("order", None)],
    "flip_diagonals": [("faces", None), ("opposites", None)],
    "nearest_places": [("groups", None), ("faces", None)],
    "distinct_routes": [("via", None)],
}
"""Arrays of indices."""

OF_ANY_LENGTH = [
    ("refine_at_level", "faces"),
    ("refine_at_level", "vertices"),
    ("TraceArrays", "begins"),
    ("segment_ends", "segments"),
    ("polyline_crossings", "all_faces"),
    ("nearest_places", "begins"),
    ("nearest_places", "faces"),
    ("turning_paths", "begins"),
    ("distinct_routes", "via"),
    ("least_sums", "other"),
    ("place_on_polyline", "controls"),
    ("place_on_polyline", "corners"),
]
"""Arrays whose last axis has a length that no other array has."""

ON_MESHES = [
    "EdgeGraphArrays",
    "TraceArrays",
    "distances_from_segments",
    "nearest_places",
    "place_nodes",
    "relax_curves",
    "trace_between",
    "trace_from",
    "trace_steps",
]
"""Kernels that read a mesh."""

RESUMED = [
    "distances_from_segments",
    "distinct_curves",
    "distances_along_edges",
    "flip_diagonals",
    "meeting_segments",
    "nearest_places",
    "paths_along_edges",
    "points_on_edge_paths",
    "polyline_crossings",
    "relax_curves",
    "surface_hops",
    "trace_between",
    "trace_from",
    "trace_steps",
    "turning_paths",
]
"""Kernels whose work has no small bound."""


def with_mesh(given, mesh):
    """Arguments with other arrays of the mesh."""
    if "surface" not in given:
        return {**given, "mesh": mesh}
    normals = BALL.vertices.copy()
    return {**given, "surface": nicmm_kernels.SurfaceArrays(mesh, normals, None, None, 0.0, 0.0)}


def arrays_in(given):
    """Names of the arrays among arguments; those in tuples also have a number."""
    for name, value in given.items():
        if isinstance(value, np.ndarray):
            yield name, None
        if isinstance(value, tuple):
            arrays = (number for number, part in enumerate(value) if isinstance(part, np.ndarray))
            yield from ((name, number) for number in arrays)


def replaced(given, place, change):
    """Arguments with one array replaced by a function of it."""
    name, number = place
    value = given[name]
    if number is not None:
        changed = list(value)
        changed[number] = change(changed[number])
        kept = type(value)(*changed) if hasattr(value, "_fields") else tuple(changed)
        return {**given, name: kept}
    return {**given, name: change(value)}


PLACES = [
    (name, place) for name, (_, arguments) in CALLS.items() for place in arrays_in(arguments())
]


@pytest.mark.parametrize("name", CALLS)
def test_the_arguments_of_these_tests_are_valid(name):
    function, arguments = CALLS[name]
    function(**arguments())


def array_at(given, place):
    name, number = place
    return given[name] if number is None else given[name][number]


@pytest.mark.parametrize(("name", "place"), PLACES)
def test_arrays_that_do_not_fit_are_refused(name, place):
    function, arguments = CALLS[name]
    given = arguments()
    array = array_at(given, place)
    other_type = np.float32 if array.dtype == np.float64 else np.int32
    for changed, message in (
        (array.astype(other_type), f"type {np.dtype(other_type)}; pass"),
        (array[..., :-1].copy(), "shape .*; pass"),
        (array[..., None], "shape .*; pass"),
        (np.repeat(array, 2, axis=0)[::2], "strides .*; pass"),
        (array[::-1], "strides .*; pass"),
        (array.tolist(), "is list; pass an array"),
    ):
        if (name, place[0]) in OF_ANY_LENGTH and np.size(changed) < array.size:
            continue
        with pytest.raises(KernelError, match=message):
            function(**replaced(given, place, lambda array, changed=changed: changed))


@pytest.mark.slow
@given(st.sampled_from(sorted(FINITE)), st.data())
def test_numbers_that_are_not_finite_are_refused(name, data):
    function, arguments = CALLS[name]

    def spoilt(array):
        array = array.copy()
        array.flat[data.draw(st.integers(0, array.size - 1))] = data.draw(BAD_NUMBERS)
        return array

    with pytest.raises(KernelError, match="NaN or infinite"):
        function(**replaced(arguments(), data.draw(st.sampled_from(FINITE[name])), spoilt))


@given(st.sampled_from(sorted(INDICES)), BAD_INDICES, st.data())
def test_indices_of_what_does_not_exist_are_refused(name, index, data):
    function, arguments = CALLS[name]

    def spoilt(faces):
        faces = faces.copy()
        faces.flat[data.draw(st.integers(0, faces.size - 1))] = index
        return faces

    with pytest.raises(KernelError, match="index is out of range"):
        function(**replaced(arguments(), data.draw(st.sampled_from(INDICES[name])), spoilt))


@given(st.sampled_from(ON_MESHES), BAD_INDICES, st.booleans(), st.integers(0, 10**6))
def test_meshes_with_wrong_indices_crash_nothing(name, index, in_faces, at):
    """Only the indices that are used are checked, so a trace elsewhere may succeed."""
    function, arguments = CALLS[name]
    faces, opposite = BALL.faces.copy(), BALL.opposite_sides.copy()
    spoilt = faces.ravel() if in_faces else opposite
    spoilt[at % spoilt.size] = index if index < 0 else index + 3 * len(BALL.faces)
    mesh = nicmm_kernels.MeshArrays(BALL.vertices, faces, BALL.face_normals, opposite, True)
    try:
        function(**with_mesh(arguments(), mesh))
    except KernelError as error:
        assert "index is out of range" in str(error)


@given(st.sampled_from(ON_MESHES), st.integers(0, 2**32 - 1))
def test_meshes_with_arbitrary_neighbours_crash_nothing(name, seed):
    function, arguments = CALLS[name]
    rng = np.random.default_rng(seed)
    opposite = rng.integers(0, 3 * len(BALL.faces), 3 * len(BALL.faces))
    oriented = bool(rng.integers(2))
    mesh = nicmm_kernels.MeshArrays(
        BALL.vertices, BALL.faces, BALL.face_normals, opposite, oriented
    )
    # Paths over such a mesh may not end before there is no room for them.
    with contextlib.suppress(nicmm_kernels.TooManyWindowsError):
        function(**with_mesh(arguments(), mesh))


@pytest.mark.parametrize(
    ("place", "change"),
    [
        (0, lambda vertices: vertices[:, :2]),
        (1, lambda faces: faces.astype(np.int32)),
        (2, lambda normals: normals[:-1]),
        (3, lambda opposite: opposite.reshape(-1, 3)),
    ],
)
def test_mesh_arrays_that_do_not_fit_are_refused(place, change):
    arrays = [BALL.vertices, BALL.faces, BALL.face_normals, BALL.opposite_sides]
    arrays[place] = change(arrays[place])
    with pytest.raises(KernelError, match="pass"):
        nicmm_kernels.MeshArrays(*arrays, True)


def test_other_arrays_that_do_not_fit_are_refused():
    normals, none = BALL.vertices.copy(), None
    with pytest.raises(KernelError, match="vertex_normals has shape"):
        nicmm_kernels.SurfaceArrays(BALL.for_kernels, normals[1:], none, none, 0.0, 0.0)
    with pytest.raises(KernelError, match="feature_map has type int64"):
        nicmm_kernels.SurfaceArrays(
            BALL.for_kernels, normals, none, np.arange(len(normals)), 0.0, 0.0
        )
    with pytest.raises(KernelError, match="folded has shape"):
        nicmm_kernels.SurfaceArrays(BALL.for_kernels, normals, np.ones(3, bool), none, 0.0, 0.0)


def test_kernels_of_one_curve_refuse_several():
    nodes = nicmm_kernels.NodeArrays(**arguments_nodes(), curves=2)
    with pytest.raises(KernelError, match="2 curves; pass the nodes of one"):
        nicmm_kernels.find_contacts(nodes, CONTACT_RULES)
    with pytest.raises(KernelError, match="curves is 7; pass a divisor"):
        nicmm_kernels.NodeArrays(**arguments_nodes(), curves=7)


def test_pairs_that_do_not_fit_get_more_room(monkeypatch):
    found = nicmm_kernels.find_contacts(**arguments_contacts())
    assert len(found[0]) > 20
    nodes = nicmm_kernels.NodeArrays(**arguments_nodes())
    energy = nicmm_kernels.Linearised(surface_arrays(), nodes, rules()).energy
    relaxed = on_level(**arguments_curve())
    monkeypatch.setattr(nicmm_kernels.steps, "PAIRS_OF_A_NODE", 0)
    for one, other in zip(found, nicmm_kernels.find_contacts(**arguments_contacts()), strict=True):
        np.testing.assert_array_equal(one, other)
    assert nicmm_kernels.Linearised(surface_arrays(), nodes, rules()).energy == energy
    for one, other in zip(relaxed, on_level(**arguments_curve()), strict=True):
        np.testing.assert_array_equal(one, other)


def test_an_iteration_in_several_calls_lowers_the_energy_too(monkeypatch):
    """A call that ends after much work leaves the curve as it was, with more damping."""
    before = arguments_curve()
    whole = on_level(**before)
    monkeypatch.setattr(nicmm_kernels.library, "MOST_WORK", 1)
    parts = on_level(**before)
    for relaxed in (whole, parts):
        assert np.abs(relaxed.barycentric[:40] - before["barycentric"][:40]).max() > 1e-3


def test_copies_of_a_mesh_have_their_own_pointers():
    copy = pickle.loads(pickle.dumps(BALL.for_kernels))
    assert copy.pointers.vertices != BALL.for_kernels.pointers.vertices
    one, other = (
        nicmm_kernels.trace_from(**{**arguments_from(), "mesh": mesh})
        for mesh in (BALL.for_kernels, copy)
    )
    assert (one[1] == other[1]).all()


@pytest.mark.parametrize("name", [*RESUMED, "trace_polyline"])
def test_calls_of_bounded_work_give_the_same_as_a_single_one(name, monkeypatch):
    function, arguments = CALLS[name]
    whole = function(**arguments(20))
    pauses = []
    monkeypatch.setattr(nicmm_kernels.library, "MOST_WORK", 7)
    # Other threads do not call the function.
    monkeypatch.setattr(nicmm_kernels.threads, "thread_count", lambda: 1)
    parts = function(**{**arguments(20), "meanwhile": lambda: pauses.append(None)})
    assert len(pauses) > 5
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one, other)


def test_crossings_that_do_not_fit_are_found_in_several_calls(monkeypatch):
    whole = nicmm_kernels.trace_between(**arguments_between(40))
    monkeypatch.setattr(nicmm_kernels.traces, "CROSSINGS_OF_A_TRACE", 0)
    few = nicmm_kernels.trace_between(**{**arguments_between(40), "most_faces": 30})
    for one, other in zip(whole, few, strict=True):
        assert np.array_equal(one, other)


def test_contacts_that_do_not_fit_get_more_room(monkeypatch):
    whole = nicmm_kernels.relax_curves(**arguments_relax())
    monkeypatch.setattr(nicmm_kernels.steps, "PAIRS_OF_A_NODE", 0)
    pauses = []
    given = {**arguments_relax(), "meanwhile": lambda: pauses.append(None)}
    few = nicmm_kernels.relax_curves(**given)
    assert pauses
    for one, other in zip(whole, few, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("name", ["relax_curves", "even_places"])
def test_curves_without_a_fixed_start_or_without_nodes_are_refused(name):
    function, arguments = CALLS[name]
    given = arguments()
    fixed = given["fixed"].copy()
    fixed[2, 0] = False
    with pytest.raises(KernelError, match="first node"):
        function(**{**given, "fixed": fixed})
    key = "faces" if "faces" in given else "fixed"
    with pytest.raises(KernelError, match="one row per curve"):
        function(**{**given, key: given[key][:, :0]})


@given(BAD_INDICES.filter(lambda i: i != -1), st.sampled_from(["previous", "following"]))
def test_neighbours_that_do_not_exist_are_refused(index, name):
    given = arguments_segments_in_faces()
    given[name][3] = index
    with pytest.raises(KernelError, match="index is out of range"):
        distances_from_segments(**given)


def test_bisected_triangles_conform_and_cover_the_same_area():
    given = arguments_refinement(len(BALL.faces))
    found = refined(**given)
    assert len(found.faces) > 2 * len(BALL.faces)
    mesh = type(BALL)(found.vertices, found.faces)
    np.testing.assert_array_equal(found.opposite, mesh.opposite_sides)
    assert mesh.is_oriented and not len(mesh.unpaired_edges[0])
    assert mesh.face_areas.sum() == pytest.approx(BALL.face_areas.sum(), rel=1e-12)
    in_parents = np.einsum("fcd,fdk->fck", found.corners, BALL.vertices[BALL.faces[found.parents]])
    np.testing.assert_allclose(in_parents, found.vertices[found.faces], atol=1e-14)
    new = np.arange(len(found.vertices)) >= len(BALL.vertices)
    row, corner = np.nonzero(new[found.faces])
    exact, _, _ = given["paths"].nearest(found.parents[row], found.corners[row, corner])
    near = exact < given["limits"].level
    assert near.sum() > 100
    there = found.distances[found.faces[row, corner]]
    np.testing.assert_allclose(there[near], exact[near], atol=1e-12)


def test_bisection_in_several_calls_gives_the_same(monkeypatch):
    whole = refined(**arguments_refinement(200))
    monkeypatch.setattr(nicmm_kernels.library, "MOST_WORK", 3)
    pauses = []
    parts = refined(**{**arguments_refinement(200), "meanwhile": lambda: pauses.append(None)})
    assert len(pauses) > 20
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one, other)


def test_a_side_between_fixed_vertices_is_not_bisected():
    given = arguments_refinement(200)
    given["fixed"][:] = True
    found = refined(**given)
    assert len(found.faces) == 200


def test_windows_that_do_not_fit_get_more_room_up_to_a_limit(monkeypatch):
    whole = distances_from_segments(**arguments_segments_in_faces())
    monkeypatch.setattr(nicmm_kernels.segment_distances, "WINDOWS_OF_A_SEGMENT", 1)
    few = distances_from_segments(**arguments_segments_in_faces())
    for one, other in zip(whole, few, strict=True):
        assert np.array_equal(one, other)
    monkeypatch.setitem(globals(), "FEW_WINDOWS", 20)
    with pytest.raises(nicmm_kernels.TooManyWindowsError, match="more than"):
        distances_from_segments(**arguments_segments_in_faces())


@pytest.mark.parametrize("name", ["relax_curves", "even_places"])
def test_a_curve_does_not_depend_on_the_others(name):
    function, arguments = CALLS[name]
    given = arguments()
    together = function(**given)
    for curve in range(4):
        own = {k: v[[curve]] if isinstance(v, np.ndarray) else v for k, v in given.items()}
        for one, other in zip(function(**own), together, strict=True):
            assert np.array_equal(one[0], other[curve])


@given(BAD_INDICES, st.integers(31, 59))
def test_pieces_outside_the_former_polyline_are_refused(index, node):
    given = arguments_polyline()
    given["former_index"][node] = index
    with pytest.raises(KernelError, match="index is out of range"):
        nicmm_kernels.trace_polyline(**given)


def test_a_traced_polyline_has_the_traces_of_its_steps():
    """Steps from control points are traced backward, and the others forward."""
    given = arguments_polyline(60)
    faces, barycentric, node_index, lost = nicmm_kernels.trace_polyline(**given)
    assert not lost.any() and len(faces) > 120
    step = np.arange(60)
    ahead = (step, (step + 1) % 60)
    common = {name: given[name] for name in ("surface", "nodes", "places", "limits", "meanwhile")}
    for is_backward in (False, True):
        start, end = reversed(ahead) if is_backward else ahead
        counts, crossed, _ = nicmm_kernels.trace_steps(**common, start=start, end=end)
        pieces = np.split(crossed, np.cumsum(counts)[:-1])
        for i in np.flatnonzero(given["is_control"] == is_backward):
            last = node_index[i + 1] if i < 59 else len(faces)
            piece = faces[node_index[i] : last]
            # Each point belongs to the face of the segment after it.
            expected = pieces[i][:-1]
            np.testing.assert_array_equal(piece, expected[::-1] if is_backward else expected)
    sums = barycentric.sum(axis=1)
    np.testing.assert_allclose(sums[np.delete(np.arange(len(faces)), node_index)], 1.0)


def test_segments_that_meet_are_those_of_brute_force(monkeypatch):
    """Two segments meet if each one's ends lie on both sides of the other one."""
    given = arguments_segments()
    start, end = given["starts"], given["ends"]

    def side(a, b, c):
        return np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    expected = {
        (i, j)
        for i in range(40)
        for j in range(i + 1, 40)
        if given["groups"][i] == given["groups"][j]
        and side(start[i], end[i], start[j]) != side(start[i], end[i], end[j])
        and side(start[j], end[j], start[i]) != side(start[j], end[j], end[i])
    }
    for room in (4, 0):  # in one call or in many
        monkeypatch.setattr(nicmm_kernels.crossings, "PAIRS_OF_A_SEGMENT", room)
        found = nicmm_kernels.meeting_segments(**given)
        assert {tuple(sorted(pair)) for pair in found.tolist()} == expected
        assert len(found) == len(expected) > 50


def test_an_exception_between_two_calls_ends_the_function(monkeypatch):
    monkeypatch.setattr(nicmm_kernels.library, "MOST_WORK", 1)
    monkeypatch.setattr(nicmm_kernels.threads, "thread_count", lambda: 1)

    def cancel():
        raise InterruptedError

    for name in [*RESUMED, "trace_polyline"]:
        function, arguments = CALLS[name]
        with pytest.raises(InterruptedError):
            function(**{**arguments(), "meanwhile": cancel})


@pytest.mark.parametrize("name", [*RESUMED, "even_places"])
def test_no_points_or_curves_give_no_result(name):
    function, arguments = CALLS[name]
    for part in function(**arguments(0)):
        assert isinstance(part, int) or len(part) == 0


def test_least_sums_are_those_of_all_sums():
    one, other = arguments_sums().values()
    one[1, 2] = np.inf
    expected = (one[:, :, None] + other).min(axis=1)
    np.testing.assert_array_equal(nicmm_kernels.least_sums(one, other), expected)
    nothing_between = nicmm_kernels.least_sums(np.zeros((2, 0)), np.zeros((0, 3)))
    np.testing.assert_array_equal(nothing_between, np.full((2, 3), np.inf))


def test_a_library_of_another_version_says_what_to_do():
    """The extension reports ImportErrors in a message of its own."""
    for kind in (KernelError, ImportError):
        with pytest.raises(kind, match="have no future_kernel: they are those of another version"):
            nicmm_kernels.library.Kernel("future_kernel")()


@pytest.mark.slow
def test_missing_library_says_what_to_do(tmp_path):
    script = (
        "import nicmm_core as n, nicmm_core.shapes as s; n.design_curve(s.sphere(2), [0, 9, 50])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=environment.ROOT,
        env={"PYTHONPATH": "kernels", "NICMM_KERNELS_LIBRARY": str(tmp_path / "none.so")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "MissingLibraryError: The compiled kernels of NICMM Curves for" in ran.stderr
    assert "cannot be loaded" in ran.stderr and "Install the package" in ran.stderr


def test_the_library_is_that_of_the_present_sources():
    stamp = environment.KERNELS / "nicmm_kernels" / "compiled.sha256"
    ran = subprocess.run(
        [
            sys.executable,
            "-c",
            "import compile_library as c; print(c.fingerprint(c.this_platform()))",
        ],
        cwd=environment.KERNELS,
        capture_output=True,
        text=True,
        check=True,
    )
    assert stamp.read_text() == ran.stdout.strip(), "run python3 build.py test to compile it"
