/* Straight traces between the nodes of curves. */
#include "node_traces.h"

#include <string.h>

/* Traces in the plane that contains the mean normal of both nodes. */
static int trace_by_normals(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
                            int64_t from, int64_t to, TraceRequest *request, PointList *crossings,
                            uint8_t *reached, int64_t *work)
{
    const double *one = nodes->normals + 3 * from, *other = nodes->normals + 3 * to;
    /* Without an orientation, both normals are turned to the same side. */
    double sign = !surface->mesh.is_oriented && dot(one, other) < 0.0 ? -1.0 : 1.0, normal[3];
    for (int axis = 0; axis < 3; axis++) normal[axis] = one[axis] + sign * other[axis];
    request->normal = normal;
    return trace_to(&surface->mesh, surface->folded, places->most_faces, request, crossings,
                    reached, work);
}

/* Traces in the plane that contains the mean direction of the curve before and after the step.
   Around the edge of a thin part the normals of both nodes may be opposite, and no plane that
   contains their mean contains a trace. */
static int trace_around_edge(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
                             int64_t per_curve, int64_t from, int64_t to, TraceRequest *request,
                             PointList *crossings, uint8_t *reached, int64_t *work)
{
    int64_t from_first = from - from % per_curve, to_first = to - to % per_curve;
    int64_t before_from = from > from_first ? from - 1 : from_first + per_curve - 1;
    int64_t before_to = to > to_first ? to - 1 : to_first + per_curve - 1;
    int goes_on = before_to == from;
    const double *earlier = nodes->steps + 3 * (goes_on ? before_from : from);
    const double *later = nodes->steps + 3 * (goes_on ? to : before_to);
    double sign = goes_on ? 1.0 : -1.0, ahead[3];
    double before = length_of(earlier), after = length_of(later);
    for (int axis = 0; axis < 3; axis++)
        ahead[axis] = sign * (earlier[axis] / greater(before, TINY)) -
                      sign * (later[axis] / greater(after, TINY));
    request->normal = request->ahead = ahead;
    request->longest = greater(request->longest, places->detour * greater(before, after));
    return trace_to(&surface->mesh, surface->folded, places->most_faces, request, crossings,
                    reached, work);
}

int trace_step(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
               int64_t per_curve, int64_t from, int64_t to, PointList *crossings, uint8_t *reached,
               int64_t *work)
{
    double distance = distance_between(nodes->positions + 3 * to, nodes->positions + 3 * from);
    TraceRequest request = {.start_face = places->faces[from],
                            .start = places->barycentric + 3 * from,
                            .end_face = places->faces[to],
                            .end = places->barycentric + 3 * to,
                            .longest = places->detour * distance,
                            .fold_margin = places->fold_margin};
    ++*work;
    TRY(trace_by_normals(surface, places, nodes, from, to, &request, crossings, reached, work));
    if (*reached) return OK;
    return trace_around_edge(surface, places, nodes, per_curve, from, to, &request, crossings,
                             reached, work);
}

/* The steps of which traces are asked for, and what was found. */
typedef struct {
    int64_t m;
    const int64_t *from;      /* (m) nodes at which the traces start */
    const int64_t *to;        /* (m) nodes at which they end: the next ones or the previous ones */
    uint8_t *reached;         /* (m) becomes whether each trace reached its end */
    int64_t *point_counts;    /* (m) becomes the number of points of each trace, with both ends */
} StepTraces;

/* Traces from m nodes of c curves to the next or previous nodes, from the step of index `done` on.

   It returns early when the traces have passed `most_work` faces, or when the room that is left may
   not suffice for another trace; `done` is raised to the number of steps that have been traced. */
EXPORTED int trace_steps(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
                         int64_t c, const StepTraces *steps, PointList *points,
                         int64_t most_work, int64_t *done)
{
    int64_t needed = places->most_faces + 2, work = 0;
    if (points->room < needed) return ARRAY_TOO_SMALL;
    if (c < 1 || nodes->n < c) return INDEX_OUT_OF_RANGE;
    for (; *done < steps->m && work < most_work; ++*done) {
        if (points->room - points->count < needed) return OK;
        CHECK(*done, steps->m);
        int64_t first = points->count, from = steps->from[*done], to = steps->to[*done];
        uint8_t *reached = steps->reached + *done;
        CHECK(from, nodes->n);
        CHECK(to, nodes->n);
        TRY(append_point(places->faces[from], places->barycentric + 3 * from, points));
        TRY(trace_step(surface, places, nodes, nodes->n / c, from, to, points, reached, &work));
        if (*reached)
            TRY(append_point(places->faces[to], places->barycentric + 3 * to, points));
        else
            points->count = first;
        steps->point_counts[*done] = points->count - first;
    }
    return OK;
}

/* Expresses a point of a polyline in another face that contains it. */
static int move_to_face(const Mesh *mesh, int64_t face, int64_t k, PointList *points)
{
    double changed[3], *place = points->barycentric + 3 * k;
    TRY(change_face(mesh, points->faces[k], place, face, changed));
    memcpy(place, changed, sizeof changed);
    points->faces[k] = face;
    return OK;
}

/* Reverses a trace that has come from `start_face`, whose last point is that of index `first`, and
   whose crossings follow. In the reverse, a crossing belongs to the face that the trace left there,
   and the last point to the face in which the trace ended. */
static int reverse_trace(const Mesh *mesh, int64_t start_face, int64_t first, PointList *points)
{
    int64_t *faces = points->faces;
    double *places = points->barycentric;
    int64_t last = points->count - 1, end_face = last > first ? faces[last] : start_face;
    TRY(move_to_face(mesh, end_face, first, points));
    for (int64_t k = last; k > first; k--) {
        int64_t left = k > first + 1 ? faces[k - 1] : start_face;
        TRY(move_to_face(mesh, left, k, points));
    }
    for (int64_t low = first + 1, high = last; low < high; low++, high--) {
        int64_t face = faces[low];
        double place[3];
        faces[low] = faces[high];
        faces[high] = face;
        memcpy(place, places + 3 * low, sizeof place);
        memcpy(places + 3 * low, places + 3 * high, sizeof place);
        memcpy(places + 3 * high, place, sizeof place);
    }
    return OK;
}

static int copy_piece(const TracedPolyline *polyline, int64_t n, int64_t i, PointList *points)
{
    int64_t first = polyline->former_index[i];
    int64_t end = i + 1 < n ? polyline->former_index[i + 1] : polyline->former_count;
    CHECK(first, polyline->former_count);
    CHECK(end, polyline->former_count + 1);
    for (int64_t k = first; k < end; k++)
        TRY(append_point(polyline->former_faces[k], polyline->former_places + 3 * k, points));
    return OK;
}

int trace_polyline(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
                            const TracedPolyline *polyline, PointList *points, int64_t most_work,
                            int64_t *done)
{
    int64_t n = nodes->n, work = 0;
    int64_t most = 1 + (polyline->former_count > places->most_faces ? polyline->former_count
                                                                    : places->most_faces);
    if (points->room < most) return ARRAY_TOO_SMALL;
    for (; *done < n && work < most_work; ++*done) {
        if (points->room - points->count < most) return OK;
        int64_t i = *done, next = node_after(nodes, i), first = points->count;
        CHECK(i, n);
        polyline->node_index[i] = polyline->before + first;
        int has_step = nodes->closed || i < n - 1;
        if (has_step && polyline->kept[i]) {
            TRY(copy_piece(polyline, n, i, points));
            continue;
        }
        TRY(append_point(places->faces[i], places->barycentric + 3 * i, points));
        if (!has_step) continue;
        /* A trace must start strictly inside a face. So traces from control points run backward,
           and no trace joins two control points. */
        uint8_t reached = 0, backward = polyline->is_control[i];
        if (!(backward && polyline->is_control[next]))
            TRY(trace_step(surface, places, nodes, n, backward ? next : i, backward ? i : next,
                           points, &reached, &work));
        polyline->lost[i] = !reached;
        if (reached && backward)
            TRY(reverse_trace(&surface->mesh, places->faces[next], first, points));
    }
    return OK;
}
