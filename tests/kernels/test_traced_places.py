"""Points on traces and segments of them."""

import nicmm_kernels
import numpy as np

from tests.kernels.test_library import BALL, arguments_on_traces, arguments_traces


def positions(faces, barycentric):
    return np.einsum("kj,kjd->kd", barycentric, BALL.vertices[BALL.faces[faces]])


def test_points_lie_at_their_shares_of_the_traces():
    given = arguments_traces()
    begins = given["begins"]
    points = positions(given["faces"], given["barycentric"])
    asked = arguments_on_traces()
    faces, barycentric, lost = nicmm_kernels.places_on_traces(**asked)
    np.testing.assert_array_equal(lost, np.diff(begins) == 0)
    np.testing.assert_array_equal(np.flatnonzero(lost), [20])
    found = positions(faces, barycentric)
    for i in np.flatnonzero(~lost):
        trace = points[begins[i] : begins[i + 1]]
        steps = np.linalg.norm(np.diff(trace, axis=0), axis=1)
        arc = np.append(0.0, np.cumsum(steps))
        own = asked["traces"].arcs[begins[i] : begins[i + 1]]
        np.testing.assert_allclose(own, arc, rtol=1e-12)
        expected = [np.interp(asked["shares"][i] * arc[-1], arc, axis) for axis in trace.T]
        np.testing.assert_allclose(found[i], expected, atol=1e-5)  # strictly inside the face
    assert (barycentric[~lost] > 0.0).all()


def test_the_ends_of_segments_are_the_following_points():
    given = arguments_traces()
    first = np.flatnonzero(np.diff(np.repeat(np.arange(60), np.diff(given["begins"]))) == 0)
    ends = nicmm_kernels.segment_ends(BALL.faces, given["faces"], given["barycentric"], first)
    whole = np.column_stack([ends, 1.0 - ends.sum(axis=1)])
    points = positions(given["faces"], given["barycentric"])
    np.testing.assert_allclose(
        positions(given["faces"][first], whole), points[first + 1], atol=1e-9
    )
