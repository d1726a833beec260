/* Nodes of a curve on a surface. */
#include "nodes.h"

#include <string.h>

#include "arc_tangent.h"

int64_t items_of_nodes(int64_t n)
{
    return 19 * n;
}

int take_nodes(Scratch *scratch, int64_t n, int64_t closed, Nodes *nodes)
{
    nodes->n = n;
    nodes->closed = closed;
    nodes->is_corner = NULL;
    TRY(take_integers(scratch, n, &nodes->faces));
    TRY(take(scratch, 3 * n, &nodes->barycentric));
    TRY(take(scratch, 3 * n, &nodes->positions));
    TRY(take(scratch, 3 * n, &nodes->normals));
    TRY(take(scratch, n, &nodes->phi_fea));
    TRY(take(scratch, 3 * n, &nodes->steps));
    TRY(take(scratch, n, &nodes->step_lengths));
    TRY(take(scratch, 3 * n, &nodes->conormals));
    TRY(take(scratch, n, &nodes->angles));
    return OK;
}

int place_nodes(const Surface *surface, const Nodes *nodes)
{
    for (int64_t i = 0; i < nodes->n; i++) {
        const double *corners[3], *barycentric = nodes->barycentric + 3 * i;
        double at_corners[3][3], *normal = nodes->normals + 3 * i;
        int64_t face = nodes->faces[i];
        TRY(corners_of(&surface->mesh, face, corners));
        TRY(corner_normals(surface, face, at_corners));
        const double *const normals[3] = {at_corners[0], at_corners[1], at_corners[2]};
        interpolate(corners, barycentric, nodes->positions + 3 * i);
        interpolate(normals, barycentric, normal);
        double length = greater(length_of(normal), TINY);
        for (int axis = 0; axis < 3; axis++) normal[axis] /= length;
        nodes->phi_fea[i] = 1.0;
        if (surface->feature_map)
            TRY(weighted_feature(surface, face, barycentric, nodes->phi_fea + i));
    }
    return OK;
}

Turn turn_at(const double before[3], const double after[3], const double normal[3])
{
    Turn turn;
    turn.out_before = dot(before, normal);
    turn.out_after = dot(after, normal);
    cross(before, after, turn.product);
    turn.sine = dot(turn.product, normal);
    turn.cosine = dot(before, after) - turn.out_before * turn.out_after;
    return turn;
}

void measure_nodes(const Nodes *nodes)
{
    for (int64_t i = 0; i < nodes->n; i++) {
        const double *here = nodes->positions + 3 * i;
        const double *next = nodes->positions + 3 * node_after(nodes, i);
        double *step = nodes->steps + 3 * i;
        for (int axis = 0; axis < 3; axis++)
            step[axis] = has_step(nodes, i) ? next[axis] - here[axis] : 0.0;
        nodes->step_lengths[i] = length_of(step);
    }
    for (int64_t i = 0; i < nodes->n; i++) {
        int64_t h = node_before(nodes, i);
        const double *after = nodes->steps + 3 * i, *before = nodes->steps + 3 * h;
        const double *normal = nodes->normals + 3 * i;
        double length_after = greater(nodes->step_lengths[i], TINY);
        double length_before = greater(nodes->step_lengths[h], TINY);
        double along[3], *conormal = nodes->conormals + 3 * i;
        for (int axis = 0; axis < 3; axis++)
            along[axis] = after[axis] / length_after + before[axis] / length_before;
        cross(normal, along, conormal);
        double length = greater(length_of(conormal), TINY);
        for (int axis = 0; axis < 3; axis++) conormal[axis] /= length;
        Turn turn = turn_at(before, after, normal);
        nodes->angles[i] = turns_freely(nodes, i) ? 0.0 : angle_of(turn.sine, turn.cosine);
    }
}

/* Measures c curves, whose nodes are all in one set of arrays. */
EXPORTED int measure_curves(const Nodes *all, int64_t c)
{
    if (c < 1 || all->n % c != 0) return INDEX_OUT_OF_RANGE;
    int64_t n = all->n / c;
    for (int64_t curve = 0; curve < c; curve++) {
        int64_t first = curve * n;
        Nodes nodes = {.n = n,
                       .closed = all->closed,
                       .positions = all->positions + 3 * first,
                       .normals = all->normals + 3 * first,
                       .steps = all->steps + 3 * first,
                       .step_lengths = all->step_lengths + first,
                       .conormals = all->conormals + 3 * first,
                       .angles = all->angles + first,
                       .is_corner = all->is_corner ? all->is_corner + first : NULL};
        measure_nodes(&nodes);
    }
    return OK;
}

void copy_places(const Nodes *from, const Nodes *to)
{
    memcpy(to->faces, from->faces, (size_t)from->n * sizeof *from->faces);
    memcpy(to->barycentric, from->barycentric, (size_t)from->n * 3 * sizeof *from->barycentric);
}

double length_of_curve(const Nodes *nodes)
{
    double sum = 0.0;
    for (int64_t i = 0; i < nodes->n; i++) sum += nodes->step_lengths[i];
    return sum;
}

double mean_step(const Nodes *nodes)
{
    int64_t steps = nodes->closed ? nodes->n : nodes->n - 1;
    return steps > 0 ? length_of_curve(nodes) / (double)steps : 0.0;
}
