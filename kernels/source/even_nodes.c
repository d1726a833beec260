/* Spaces the nodes of a curve evenly between its fixed nodes. */
#include "even_nodes.h"

int64_t items_of_even_nodes(int64_t n)
{
    return 2 * (n + 1);
}

/* Weighted arc lengths at the nodes and at the end of the curve, (n + 1), which is the first node
   again if the curve is closed. `lengths`, (n), are those of the ways to the next nodes. */
static void find_arcs(const Nodes *nodes, const SpacingRules *rules, const double *lengths,
                      double *arcs)
{
    double mean = 0.0;
    for (int64_t i = 0; i < nodes->n; i++) mean += lengths[i];
    mean /= (double)nodes->n;
    arcs[0] = 0.0;
    for (int64_t i = 0; i < nodes->n; i++) {
        const double *normal = nodes->normals + 3 * i;
        double turning = distance_between(nodes->normals + 3 * node_after(nodes, i), normal);
        if (nodes->step_lengths[i] == 0.0) turning = 0.0; /* at the end of an open curve */
        arcs[i + 1] = arcs[i] + (lengths[i] + rules->nodes_per_radian * mean * turning);
    }
}

/* Arc lengths, (m), at which m new nodes are even, where m is `times` the number of nodes of a
   closed curve, and the number of steps of an open one. They are linear between two fixed nodes. */
static void find_even_arcs(const Nodes *nodes, const uint8_t *fixed, int64_t times,
                           const double *arcs, double *wanted)
{
    for (int64_t first = 0; first < nodes->n;) {
        int64_t last = first + 1;
        while (last < nodes->n && !fixed[last]) last++;
        double slope = (arcs[last] - arcs[first]) / (double)(last - first);
        int64_t end = !nodes->closed && last == nodes->n ? times * (last - 1) + 1 : times * last;
        wanted[times * first] = arcs[first];
        for (int64_t k = times * first + 1; k < end; k++)
            wanted[k] = slope * ((double)k / (double)times - (double)first) + arcs[first];
        first = last;
    }
}

/* Finds where new nodes of c curves of n nodes are even: the node before each, and the share of the
   way from there to the next node.

   lengths : (c, n) of the ways from each node to the next
   fixed : (c, n) nodes that stay; the first of each curve is one of them
   arcs : (n + 1) scratch
   at, shares : (c, m) become the nodes, by their index in their curve, and the shares, see
       `find_even_arcs` */
EXPORTED int even_places(const SpacingRules *rules, int64_t c, int64_t n, int64_t closed,
                         int64_t times, double *normals, double *step_lengths,
                         const double *lengths, const uint8_t *fixed, double *arcs, int64_t *at,
                         double *shares)
{
    int64_t m = closed ? times * n : times * (n - 1) + 1;
    if (times < 1) return INDEX_OUT_OF_RANGE;
    for (int64_t curve = 0; curve < c; curve++) {
        Nodes nodes = {.n = n,
                       .closed = closed,
                       .normals = normals + 3 * curve * n,
                       .step_lengths = step_lengths + curve * n};
        double *wanted = shares + curve * m;
        find_arcs(&nodes, rules, lengths + curve * n, arcs);
        find_even_arcs(&nodes, fixed + curve * n, times, arcs, wanted);
        for (int64_t k = 0, i = 0; k < m; k++) {
            while (i < n - 1 && arcs[i + 1] <= wanted[k]) i++;
            double share = (wanted[k] - arcs[i]) / greater(arcs[i + 1] - arcs[i], TINY);
            at[curve * m + k] = i;
            wanted[k] = lesser(greater(share, 0.0), 1.0);
        }
    }
    return OK;
}

/* The point at an arc length on the straight lines between the nodes; `at` is raised to the last
   node before it. */
static void point_at(const Nodes *nodes, const double *arcs, double wanted, int64_t *at,
                     double point[3])
{
    while (*at < nodes->n - 1 && arcs[*at + 1] <= wanted) ++*at;
    int64_t next = nodes->closed || *at < nodes->n - 1 ? node_after(nodes, *at) : *at;
    const double *begin = nodes->positions + 3 * *at, *end = nodes->positions + 3 * next;
    double length = arcs[*at + 1] - arcs[*at], along = wanted - arcs[*at];
    for (int axis = 0; axis < 3; axis++) {
        double slope = length > 0.0 ? (end[axis] - begin[axis]) / length : 0.0;
        point[axis] = slope * along + begin[axis];
    }
}

int space_evenly(const Surface *surface, const TraceLimits *limits, const SpacingRules *rules,
                 const Nodes *nodes, const uint8_t *fixed, Scratch scratch, const Nodes *spaced,
                 int64_t *work)
{
    double *arcs, *wanted;
    TRY(take(&scratch, nodes->n + 1, &arcs));
    TRY(take(&scratch, nodes->n + 1, &wanted));
    find_arcs(nodes, rules, nodes->step_lengths, arcs);
    find_even_arcs(nodes, fixed, 1, arcs, wanted);
    double least = rules->short_move * (length_of_curve(nodes) / (double)nodes->n);
    copy_places(nodes, spaced);
    for (int64_t i = 0, at = 0; i < nodes->n; i++) {
        const double *here = nodes->positions + 3 * i, *normal = nodes->normals + 3 * i;
        double move[3];
        point_at(nodes, arcs, wanted[i], &at, move);
        for (int axis = 0; axis < 3; axis++) move[axis] -= here[axis];
        double out = dot(move, normal);
        for (int axis = 0; axis < 3; axis++) move[axis] -= out * normal[axis];
        double length = length_of(move);
        if (fixed[i] || length < least || length == 0.0) continue;
        for (int axis = 0; axis < 3; axis++) move[axis] /= greater(length, TINY);
        uint8_t blocked;
        int64_t passed = 0;
        TRY(move_point(&surface->mesh, surface->folded, limits, move, length, spaced->faces + i,
                       spaced->barycentric + 3 * i, &blocked, &passed));
        *work += passed;
    }
    TRY(place_nodes(surface, spaced));
    measure_nodes(spaced);
    return OK;
}
