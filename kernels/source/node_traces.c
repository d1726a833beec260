/* Straight traces between the nodes of curves. */
#include "nodes.h"
#include "tracing.h"

/* The steps of which traces are asked for, and what was found. */
typedef struct {
    int64_t m;
    const int64_t *faces;      /* (n) faces of the nodes */
    const double *barycentric; /* (n, 3) coordinates in them; those of starts strictly inside */
    const int64_t *from;       /* (m) nodes at which the traces start */
    const int64_t *to;         /* (m) nodes at which they end: the next ones or the previous ones */
    double detour;             /* greatest length of a trace, relative to the distance of its nodes */
    double fold_margin;        /* length allowed before backward parts over folds are subtracted */
    uint8_t *reached;          /* (m) becomes whether each trace reached its end */
    int64_t *crossing_counts;  /* (m) becomes the number of crossings of each trace */
} StepTraces;

/* Traces in the plane that contains the mean normal of both nodes. */
static int trace_step(const Surface *surface, int64_t most_faces, const Nodes *nodes, int64_t from,
                      int64_t to, TraceRequest *request, Crossings *crossings, uint8_t *reached,
                      int64_t *work)
{
    const double *one = nodes->normals + 3 * from, *other = nodes->normals + 3 * to;
    /* Without an orientation, both normals are turned to the same side. */
    double sign = !surface->mesh.is_oriented && dot(one, other) < 0.0 ? -1.0 : 1.0, normal[3];
    for (int axis = 0; axis < 3; axis++) normal[axis] = one[axis] + sign * other[axis];
    request->normal = normal;
    return trace_to(&surface->mesh, surface->folded, most_faces, request, crossings, reached,
                    work);
}

/* Traces in the plane that contains the mean direction of the curve before and after the step.
   Around the edge of a thin part the normals of both nodes may be opposite, and no plane that
   contains their mean contains a trace. */
static int trace_around_edge(const Surface *surface, int64_t most_faces, const Nodes *nodes,
                             int64_t per_curve, int64_t from, int64_t to, double detour,
                             TraceRequest *request, Crossings *crossings, uint8_t *reached,
                             int64_t *work)
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
    request->longest = greater(request->longest, detour * greater(before, after));
    return trace_to(&surface->mesh, surface->folded, most_faces, request, crossings, reached,
                    work);
}

/* Traces from m nodes of c curves to the next or previous nodes, from the step of index `done` on.

   It returns early when the traces have passed `most_work` faces, or when the room that is left may
   not suffice for another trace; `done` is raised to the number of steps that have been traced. */
EXPORTED int trace_steps(const Surface *surface, int64_t most_faces, const Nodes *nodes, int64_t c,
                         const StepTraces *steps, Crossings *crossings, int64_t most_work,
                         int64_t *done)
{
    if (crossings->room < most_faces) return ARRAY_TOO_SMALL;
    if (c < 1 || nodes->n < c) return INDEX_OUT_OF_RANGE;
    int64_t work = 0;
    for (; *done < steps->m && work < most_work; ++*done) {
        if (crossings->room - crossings->count < most_faces) return OK;
        CHECK(*done, steps->m);
        int64_t from = steps->from[*done], to = steps->to[*done], first = crossings->count;
        CHECK(from, nodes->n);
        CHECK(to, nodes->n);
        uint8_t *reached = steps->reached + *done;
        double distance =
            distance_between(nodes->positions + 3 * to, nodes->positions + 3 * from);
        TraceRequest request = {.start_face = steps->faces[from],
                                .start = steps->barycentric + 3 * from,
                                .end_face = steps->faces[to],
                                .end = steps->barycentric + 3 * to,
                                .longest = steps->detour * distance,
                                .fold_margin = steps->fold_margin};
        work++;
        TRY(trace_step(surface, most_faces, nodes, from, to, &request, crossings, reached, &work));
        if (!*reached)
            TRY(trace_around_edge(surface, most_faces, nodes, nodes->n / c, from, to,
                                  steps->detour, &request, crossings, reached, &work));
        steps->crossing_counts[*done] = crossings->count - first;
    }
    return OK;
}
