/* Removes self-crossings of curves by joining their nodes in another order.

   Where two strands cross twice, without a control point between the crossings, they exchange the
   parts between them. A loop with at most one control point is traversed in the other direction;
   if the control points may be visited in any order, every other loop is reversed as well. */
#include <string.h>

#include "crossings.h"
#include "node_traces.h"

typedef struct {
    int64_t rounds;         /* rounds in which crossings are removed; steps between nodes in a new
                               order may cross again */
    int64_t most_crossings; /* number of crossings above which a curve is left unchanged */
    int64_t any_order;      /* whether control points may be visited in another order */
    double touching;        /* distance in barycentric coordinates up to which segments touch */
} UncrossingRules;

/* The nodes of one curve in their present order, with their steps that cross. */
typedef struct {
    int64_t n, closed;
    const uint8_t *control; /* (n) which of the given nodes are control points */
    int64_t *sequence;      /* (n) the given nodes in the new order */
    int64_t *place;         /* (n) places of the given nodes in it */
    int64_t *before;        /* (n + 1) number of control points before each place */
    int64_t *copy;          /* (n) */
    uint8_t *gone;          /* (n) given nodes whose steps no longer exist */
    int64_t left;           /* number of crossings that are left */
    int64_t *crossings;     /* (left, 2) given nodes whose steps to the next nodes cross */
    int64_t *steps;         /* (left, 2) places of these steps, ascending */
} Reordering;

/* Consecutive parts of a sequence in a new order, each reversed if its first place is not below its
   end; and the crossings that it removes. */
typedef struct {
    int64_t count, first[5], end[5];
    int64_t removed_count, removed[2];
} Move;

static void add_part(int64_t first, int64_t end, Move *move)
{
    move->first[move->count] = first;
    move->end[move->count++] = end;
}

/* Finds the places of the steps of all crossings, and counts the control points. */
static int find_steps(Reordering *curve)
{
    int64_t n = curve->n;
    curve->before[0] = 0;
    for (int64_t i = 0; i < n; i++) {
        CHECK(curve->sequence[i], n);
        curve->before[i + 1] = curve->before[i] + curve->control[curve->sequence[i]];
    }
    for (int64_t k = 0; k < 2 * curve->left; k++) {
        int64_t node = curve->crossings[k];
        CHECK(node, n);
        int64_t one = curve->place[node], other = curve->place[node + 1 < n ? node + 1 : 0];
        int64_t low = one < other ? one : other, high = one < other ? other : one;
        curve->steps[k] = high - low > 1 ? high : low; /* or from the last node to the first */
    }
    for (int64_t *pair = curve->steps; pair < curve->steps + 2 * curve->left; pair += 2)
        if (pair[0] > pair[1]) {
            int64_t high = pair[0];
            pair[0] = pair[1];
            pair[1] = high;
        }
    return OK;
}

/* Exchanges the shortest pair of strands between two of their crossings; returns whether there is
   one. */
static int exchange(const Reordering *curve, Move *move)
{
    const int64_t *before = curve->before;
    int64_t shortest = INT64_MAX, one = 0, other = 0;
    for (int64_t i = 0; i < curve->left; i++)
        for (int64_t j = 0; j < curve->left; j++) {
            int64_t begin = curve->steps[2 * i], end = curve->steps[2 * j];
            int64_t of_one = curve->steps[2 * i + 1], of_other = curve->steps[2 * j + 1];
            int64_t low = of_one < of_other ? of_one : of_other;
            int64_t high = of_one < of_other ? of_other : of_one;
            if (!(begin < end && end < low && low < high)) continue;
            if (before[end + 1] != before[begin + 1] || before[high + 1] != before[low + 1])
                continue;
            if (end - begin + high - low >= shortest) continue;
            shortest = end - begin + high - low;
            one = i;
            other = j;
        }
    if (shortest == INT64_MAX) return 0;
    int64_t begin = curve->steps[2 * one], end = curve->steps[2 * other];
    int64_t of_one = curve->steps[2 * one + 1], of_other = curve->steps[2 * other + 1];
    int opposite = of_other < of_one; /* the strands run in opposite directions */
    int64_t low = opposite ? of_other : of_one, high = opposite ? of_one : of_other;
    *move = (Move){.removed_count = 2, .removed = {one, other}};
    add_part(0, begin + 1, move);
    add_part(opposite ? high + 1 : low + 1, opposite ? low + 1 : high + 1, move);
    add_part(end + 1, low + 1, move);
    add_part(opposite ? end + 1 : begin + 1, opposite ? begin + 1 : end + 1, move);
    add_part(high + 1, curve->n, move);
    return 1;
}

/* Reverses the shortest loop, preferably one with at most one control point; returns whether one
   may be reversed. The rest of a closed curve is a loop, too. */
static int reverse(const Reordering *curve, int64_t any_order, Move *move)
{
    int64_t n = curve->n, least = INT64_MAX, which = 0, rest = 0;
    for (int64_t k = 0; k < curve->left; k++) {
        int64_t begin = curve->steps[2 * k], end = curve->steps[2 * k + 1];
        int64_t inside = curve->before[end + 1] - curve->before[begin + 1];
        for (int around = 0; around <= (curve->closed != 0); around++) {
            int64_t size = around ? n - (end - begin) : end - begin;
            int64_t points = around ? curve->before[n] - inside : inside;
            int64_t rank = size + (points > 1 ? n : 0);
            if (rank >= least) continue;
            least = rank;
            which = k;
            rest = around;
        }
    }
    int64_t begin = curve->steps[2 * which], end = curve->steps[2 * which + 1];
    int64_t inside = curve->before[end + 1] - curve->before[begin + 1];
    int64_t points = rest ? curve->before[n] - inside : inside;
    if (points > 1 && !any_order) return 0;
    *move = (Move){.removed_count = 1, .removed = {which}};
    if (rest) {
        add_part(0, 1, move);
        add_part(n, end + 1, move);
        add_part(begin + 1, end + 1, move);
        add_part(begin + 1, 1, move);
    } else {
        add_part(0, begin + 1, move);
        add_part(end + 1, begin + 1, move);
        add_part(end + 1, n, move);
    }
    return 1;
}

/* Puts the sequence in a new order, and leaves out all crossings of steps that no longer exist. */
static int apply(const Move *move, Reordering *curve)
{
    int64_t n = curve->n, count = 0, kept = 0;
    memcpy(curve->copy, curve->sequence, (size_t)n * sizeof *curve->copy);
    for (int64_t part = 0; part < move->count; part++) {
        int64_t first = move->first[part], end = move->end[part];
        int64_t steps = first <= end ? end - first : first - end;
        for (int64_t k = 0; k < steps; k++, count++) {
            int64_t from = first <= end ? first + k : first - 1 - k;
            CHECK(from, n);
            CHECK(count, n);
            curve->sequence[count] = curve->copy[from];
        }
    }
    if (count != n) return INDEX_OUT_OF_RANGE;
    for (int64_t i = 0; i < n; i++) curve->place[curve->sequence[i]] = i;
    memset(curve->gone, 0, (size_t)n);
    for (int64_t k = 0; k < move->removed_count; k++) {
        CHECK(move->removed[k], curve->left);
        curve->gone[curve->crossings[2 * move->removed[k]]] = 1;
        curve->gone[curve->crossings[2 * move->removed[k] + 1]] = 1;
    }
    for (int64_t k = 0; k < curve->left; k++) {
        int64_t one = curve->crossings[2 * k], other = curve->crossings[2 * k + 1];
        if (curve->gone[one] || curve->gone[other]) continue;
        curve->crossings[2 * kept] = one;
        curve->crossings[2 * kept++ + 1] = other;
    }
    curve->left = kept;
    return OK;
}

/* Finds the order of the nodes of one curve without its crossings; `sequence` and `place` begin
   with the given one. */
static int reorder(int64_t any_order, Reordering *curve)
{
    Move move;
    for (int64_t i = 0; i < curve->n; i++) curve->sequence[i] = curve->place[i] = i;
    while (curve->left) {
        TRY(find_steps(curve));
        if (!exchange(curve, &move) && !reverse(curve, any_order, &move)) break;
        TRY(apply(&move, curve));
    }
    return OK;
}

static int take_reordering(Scratch *scratch, int64_t n, int64_t crossings, int64_t closed,
                           Reordering *curve)
{
    curve->n = n;
    curve->closed = closed;
    TRY(take_integers(scratch, n, &curve->sequence));
    TRY(take_integers(scratch, n, &curve->place));
    TRY(take_integers(scratch, n + 1, &curve->before));
    TRY(take_integers(scratch, n, &curve->copy));
    TRY(take_bytes(scratch, n, &curve->gone));
    TRY(take_integers(scratch, 2 * crossings, &curve->crossings));
    return take_integers(scratch, 2 * crossings, &curve->steps);
}

/* Number of items of scratch of `reordered_nodes`. */
EXPORTED int64_t reordered_items(int64_t n, int64_t crossings)
{
    return 5 * n + n / 8 + 2 + 4 * crossings;
}

/* Finds the order, (n), of the nodes of one curve after some crossings have been removed.

   crossings : (count, 2) nodes whose steps to the next nodes cross
   control : (n) which nodes are control points; the first one is */
EXPORTED int reordered_nodes(int64_t n, int64_t count, const int64_t *crossings,
                             const uint8_t *control, int64_t closed, int64_t any_order,
                             double *scratch, int64_t scratch_items, int64_t *order)
{
    Scratch memory = {scratch, scratch_items};
    Reordering curve;
    TRY(take_reordering(&memory, n, count, closed, &curve));
    curve.control = control;
    curve.left = count;
    memcpy(curve.crossings, crossings, (size_t)(2 * count) * sizeof *crossings);
    TRY(reorder(any_order, &curve));
    memcpy(order, curve.sequence, (size_t)n * sizeof *order);
    return OK;
}

/* Curves of n nodes each, up to that of index c. */
typedef struct {
    int64_t c, n;
    const uint8_t *control; /* (c, n) control points; the first node of each curve is one */
    int64_t *order;         /* (c, n) becomes the order of the nodes of each curve */
    uint8_t *simple;        /* (c) becomes whether no steps of the curve cross each other */
} CrossingCurves;

/* Memory for one curve. */
typedef struct {
    Nodes nodes;            /* in their present order */
    PointList points;       /* of the traces of its steps */
    int64_t *node;          /* (room) node before each of them */
    int64_t *faces;         /* (room) of the segments between points of one trace */
    int64_t *from;          /* (room) nodes from which these lead */
    int64_t *order;         /* (room) */
    double *starts, *ends;  /* (room, 2) */
    int64_t *pairs;         /* (room, 2) segments that meet */
    int64_t *keys;          /* (room) pairs of nodes whose steps cross, as one number each */
    Reordering reordering;
    Scratch sorting;
} CurveSpace;

/* Number of items of scratch for curves of n nodes whose traces have up to `room` points. */
EXPORTED int64_t uncrossing_items(int64_t n, int64_t room, int64_t most_crossings)
{
    return 14 * n + 15 * room + reordered_items(n, most_crossings) + order_items(room);
}

static int take_space(Scratch scratch, int64_t n, int64_t closed, int64_t room,
                      int64_t most_crossings, CurveSpace *space)
{
    Nodes *nodes = &space->nodes;
    PointList *points = &space->points;
    *nodes = (Nodes){.n = n, .closed = closed};
    *points = (PointList){.room = room};
    TRY(take_integers(&scratch, n, &nodes->faces));
    TRY(take(&scratch, 3 * n, &nodes->barycentric));
    TRY(take(&scratch, 3 * n, &nodes->positions));
    TRY(take(&scratch, 3 * n, &nodes->normals));
    TRY(take(&scratch, 3 * n, &nodes->steps));
    TRY(take_integers(&scratch, room, &points->faces));
    TRY(take(&scratch, 3 * room, &points->barycentric));
    TRY(take_integers(&scratch, room, &space->node));
    TRY(take_integers(&scratch, room, &space->faces));
    TRY(take_integers(&scratch, room, &space->from));
    TRY(take_integers(&scratch, room, &space->order));
    TRY(take(&scratch, 2 * room, &space->starts));
    TRY(take(&scratch, 2 * room, &space->ends));
    TRY(take_integers(&scratch, 2 * room, &space->pairs));
    TRY(take_integers(&scratch, room, &space->keys));
    TRY(take_reordering(&scratch, n, most_crossings, closed, &space->reordering));
    space->sorting = scratch;
    return OK;
}

/* Copies the nodes of a curve in an order, with their steps. */
static int gather(const NodePlaces *places, const Nodes *given, int64_t first, const int64_t *order,
                  const Nodes *nodes)
{
    for (int64_t i = 0; i < nodes->n; i++) {
        CHECK(order[i], nodes->n);
        int64_t from = first + order[i];
        CHECK(from, given->n);
        nodes->faces[i] = places->faces[from];
        memcpy(nodes->barycentric + 3 * i, places->barycentric + 3 * from, 3 * sizeof(double));
        memcpy(nodes->positions + 3 * i, given->positions + 3 * from, 3 * sizeof(double));
        memcpy(nodes->normals + 3 * i, given->normals + 3 * from, 3 * sizeof(double));
    }
    for (int64_t i = 0; i < nodes->n; i++)
        for (int axis = 0; axis < 3; axis++)
            nodes->steps[3 * i + axis] =
                has_step(nodes, i) ? nodes->positions[3 * node_after(nodes, i) + axis] -
                                         nodes->positions[3 * i + axis]
                                   : 0.0;
    return OK;
}

/* Traces the steps between the nodes; where a trace fails, there are no points. */
static int trace_all(const Surface *surface, const NodePlaces *limits, CurveSpace *space,
                     int64_t *work)
{
    const Nodes *nodes = &space->nodes;
    PointList *points = &space->points;
    NodePlaces places = *limits;
    places.faces = nodes->faces;
    places.barycentric = nodes->barycentric;
    points->count = 0;
    for (int64_t i = 0; i < nodes->n && has_step(nodes, i); i++) {
        int64_t first = points->count, next = node_after(nodes, i);
        uint8_t reached = 0;
        if (points->room - first < places.most_faces + 2) return ARRAY_TOO_SMALL;
        TRY(append_point(places.faces[i], places.barycentric + 3 * i, points));
        TRY(trace_step(surface, &places, nodes, nodes->n, i, next, points, &reached, work));
        if (reached) TRY(append_point(places.faces[next], places.barycentric + 3 * next, points));
        if (!reached) points->count = first;
        for (int64_t k = first; k < points->count; k++) space->node[k] = i;
    }
    return OK;
}

/* Divides the traces into segments, and returns their number in `count`. */
static int find_segments(const Mesh *mesh, CurveSpace *space, int64_t *count)
{
    const PointList *points = &space->points;
    int64_t s = 0;
    for (int64_t k = 0; k + 1 < points->count; k++) {
        if (space->node[k] != space->node[k + 1]) continue;
        double end[3];
        const double *start = points->barycentric + 3 * k;
        TRY(change_face(mesh, points->faces[k + 1], start + 3, points->faces[k], end));
        for (int axis = 0; axis < 2; axis++) {
            space->starts[2 * s + axis] = start[axis];
            space->ends[2 * s + axis] = end[axis];
        }
        space->faces[s] = points->faces[k];
        space->from[s++] = space->node[k];
    }
    *count = s;
    return OK;
}

/* Finds the pairs of steps that cross. There are too many of them, one more than `most`, also if
   more segments meet than there is room for. */
static int find_crossing_steps(const Mesh *mesh, double touching, int64_t most, CurveSpace *space,
                               int64_t *work)
{
    int64_t s, n = space->nodes.n, count = 0;
    Reordering *curve = &space->reordering;
    TRY(find_segments(mesh, space, &s));
    *work += s;
    TRY(order_of_groups(s, space->faces, space->sorting.next, space->sorting.left, space->order));
    const Segments segments = {s, space->order, space->faces, space->starts, space->ends};
    PairSearch search = {.room = space->points.room, .pairs = space->pairs, .second = 1};
    TRY(meeting_segments(&segments, touching, INT64_MAX, &search));
    for (int64_t p = 0; p < search.count; p++) {
        int64_t one = space->pairs[2 * p], other = space->pairs[2 * p + 1];
        int64_t apart = one > other ? one - other : other - one;
        if (space->nodes.closed && s - apart < apart) apart = s - apart;
        if (apart <= 1) continue;
        one = space->from[one];
        other = space->from[other];
        space->keys[count++] = one < other ? one * n + other : other * n + one;
    }
    TRY(order_of_groups(count, space->keys, space->sorting.next, space->sorting.left,
                        space->order));
    curve->left = 0;
    for (int64_t p = 0; p < count; p++) {
        int64_t key = space->keys[space->order[p]];
        if (p && key == space->keys[space->order[p - 1]]) continue;
        if (curve->left < most) {
            curve->crossings[2 * curve->left] = key / n;
            curve->crossings[2 * curve->left + 1] = key % n;
        }
        curve->left++;
    }
    if (search.first < s) curve->left = most + 1;
    return OK;
}

/* Removes the crossings of one curve. */
static int uncross(const Surface *surface, const NodePlaces *limits, const Nodes *given,
                   const UncrossingRules *rules, const CrossingCurves *curves, int64_t number,
                   CurveSpace *space, uint8_t *control, int64_t *work)
{
    int64_t n = curves->n, first = number * n, *order = curves->order + first;
    Reordering *curve = &space->reordering;
    for (int64_t i = 0; i < n; i++) order[i] = i;
    for (int64_t round = 0; round <= rules->rounds; round++) {
        TRY(gather(limits, given, first, order, &space->nodes));
        TRY(trace_all(surface, limits, space, work));
        TRY(find_crossing_steps(&surface->mesh, rules->touching, rules->most_crossings, space,
                                work));
        curves->simple[number] = curve->left == 0;
        if (!curve->left || curve->left > rules->most_crossings || round == rules->rounds) break;
        for (int64_t i = 0; i < n; i++) control[i] = curves->control[first + order[i]];
        curve->control = control;
        TRY(reorder(rules->any_order, curve));
        int changed = 0;
        for (int64_t i = 0; i < n; i++) changed |= curve->sequence[i] != i;
        if (!changed) break;
        for (int64_t i = 0; i < n; i++) curve->copy[i] = order[curve->sequence[i]];
        memcpy(order, curve->copy, (size_t)n * sizeof *order);
    }
    return OK;
}

/* Removes the crossings of c curves, from that of index `done` on.

   It returns early after `most_work` faces; `done` is raised to the number of finished curves. If
   it returns ARRAY_TOO_SMALL, the traces of a curve have more than `room` points: a call with more
   room continues.

   scratch : items of eight bytes, as many as `uncrossing_items` says */
EXPORTED int remove_crossings(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
                              const UncrossingRules *rules, const CrossingCurves *curves,
                              int64_t room, double *scratch, int64_t scratch_items,
                              int64_t most_work, int64_t *done)
{
    Scratch memory = {scratch, scratch_items};
    CurveSpace space;
    uint8_t *control;
    int64_t work = 0;
    TRY(take_bytes(&memory, curves->n, &control));
    TRY(take_space(memory, curves->n, nodes->closed, room, rules->most_crossings, &space));
    for (; *done < curves->c && work < most_work; ++*done)
        TRY(uncross(surface, places, nodes, rules, curves, *done, &space, control, &work));
    return OK;
}
