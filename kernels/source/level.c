/* Relaxes one curve that is traced over the surface, with about the same number of nodes.

   The curve is retraced after every iteration. A node whose trace fails, or would cross another
   trace, stays where it was, so the curve is simple after every iteration. For a curve that has
   nearly converged, tracing can be deferred; then it may cross itself. */
#include <string.h>

#include "crossings.h"
#include "curve.h"
#include "levenberg_marquardt.h"
#include "node_traces.h"

#define RELEASES 2     /* number of times that stuck nodes are released after convergence */
#define NEGLIGIBLE 0.1 /* predicted decrease, relative to the least decrease, up to which no step is
                          tried; damping makes predictions too small */
#define MOST_STALLED 4 /* number of consecutive iterations without a new least energy after which it
                          ends: on folds, respacing may cost more energy than steps gain */
#define SMALL_MOVE 0.1 /* greatest move that does not disturb the spacing, in mean steps */
#define MOST_ROUNDS 32 /* number of rounds in which nodes that cannot be retraced are put back */
#define PAIRS 256      /* number of crossings that are found at a time */

#define ROUGHNESS 1e-3 /* amount by which the energy of a curve that has converged may then be above
                          the least one, relative to the energy without a map; that of a nearly
                          straight curve changes so much with the places of its nodes */

enum { GOES_ON = 0, CONVERGED = 1, LIMITED = 2, STALLED = 3, LOST = 4 };

typedef struct {
    PlacementRules placement;
    double detour;         /* greatest length of a trace, relative to the distance of its nodes */
    double fold_margin;    /* length of a trace before backward parts over folds are subtracted */
    double touching;       /* distance in barycentric coordinates up to which strands touch */
    double spacing_ratio;  /* ratio of the longest to the shortest step of a leg above which nodes
                              are respaced */
    double least_decrease; /* decrease of the energy in an iteration, relative to the bending
                              energy, up to which the curve has converged */
    int64_t count;         /* approximate number of nodes */
    int64_t is_traced;     /* whether the curve is traced after every iteration */
} LevelRules;

/* How far a curve has been relaxed. */
typedef struct {
    int64_t outcome;         /* GOES_ON, or why no further iteration follows */
    int64_t has_moved;       /* whether the last iteration lowered the energy */
    int64_t iterations;      /* number of iterations so far */
    int64_t most_iterations; /* number after which no further one is made */
    int64_t releases;        /* number of times that stuck nodes have been released */
    int64_t stalled;         /* number of latest iterations without a new least energy */
    double work;             /* so far, in moves of all nodes */
    double most_work;        /* after which no further step is tried */
    double damping;          /* of the next trial step */
    double least_energy;     /* so far */
} LevelState;

/* Three curves in turn: the given one, the result, and scratch. */
typedef struct {
    Curve curve, next, spare;
} CurveBuffers;

/* Number of items of scratch for curves of n nodes and polylines of `points` points. */
EXPORTED int64_t level_items(int64_t n, int64_t points, int64_t pair_room)
{
    int64_t one = items_of_placement(n, points) + n + n / 8 + 1;
    int64_t other = items_of_crossings(points) + 2 * PAIRS;
    return items_of_workspace(n, pair_room) + 3 * (n / 8 + 1) + 2 * (points + 1) +
           (one > other ? one : other);
}

/* Traces the polyline of `next` through nodes; see `TracedPolyline`. */
static int trace_nodes(const Surface *surface, const RelaxationRules *rules,
                       const LevelRules *level, const Curve *old, const Nodes *nodes,
                       const uint8_t *kept, Curve *next, uint8_t *lost)
{
    NodePlaces places = {nodes->faces, nodes->barycentric, level->detour, level->fold_margin,
                         rules->traces.most_faces};
    TracedPolyline polyline = {.is_control = old->is_control,
                               .kept = kept,
                               .former_index = old->node_index,
                               .former_count = old->polyline.count,
                               .former_faces = old->polyline.faces,
                               .former_places = old->polyline.barycentric,
                               .node_index = next->node_index,
                               .lost = lost};
    int64_t done = 0;
    if (nodes->n > next->room) return ARRAY_TOO_SMALL;
    memset(lost, 0, (size_t)nodes->n);
    next->polyline.count = 0;
    TRY(trace_polyline(surface, &places, nodes, &polyline, &next->polyline, INT64_MAX, &done));
    return done < nodes->n ? ARRAY_TOO_SMALL : OK;
}

/* Index of the node at or before a point of the polyline. */
static int64_t node_of_point(const Curve *curve, int64_t point)
{
    int64_t low = 0, high = curve->n; /* it is `low` or later, before `high` */
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (curve->node_index[middle] <= point)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Marks the nodes after which the polyline crosses itself. */
static int mark_crossings(const Surface *surface, const LevelRules *level, const Curve *curve,
                          Scratch scratch, uint8_t *bad)
{
    PairSearch search = {.room = PAIRS, .first = 0, .second = 1};
    TRY(take_integers(&scratch, 2 * PAIRS, &search.pairs));
    while (search.first <= curve->polyline.count) {
        search.count = 0;
        TRY(find_crossings(&surface->mesh, &curve->polyline, curve->closed, level->touching,
                           scratch, INT64_MAX, &search));
        for (int64_t k = 0; k < 2 * search.count; k++)
            bad[node_of_point(curve, search.pairs[k])] = 1;
    }
    return OK;
}

static int may_move(const uint8_t *movable, int64_t i)
{
    return !movable || movable[i];
}

static int any_of(const uint8_t *marks, int64_t n)
{
    for (int64_t i = 0; i < n; i++)
        if (marks[i]) return 1;
    return 0;
}

static void put_back(const Curve *old, int64_t i, const Nodes *nodes)
{
    nodes->faces[i] = old->faces[i];
    memcpy(nodes->barycentric + 3 * i, old->barycentric + 3 * i, 3 * sizeof(double));
}

/* The curve of nodes at other places, with the polyline that has been traced through them. */
static void finish_curve(const Curve *old, const Nodes *nodes, Curve *next)
{
    size_t n = (size_t)nodes->n;
    next->n = nodes->n;
    next->closed = old->closed;
    memcpy(next->is_control, old->is_control, n);
    memcpy(next->is_corner, old->is_corner, n);
    memcpy(next->is_stuck, old->is_stuck, n);
    memcpy(next->faces, nodes->faces, n * sizeof *nodes->faces);
    memcpy(next->barycentric, nodes->barycentric, 3 * n * sizeof *nodes->barycentric);
}

/* Retraces a simple curve through the present nodes, wherever it stays simple.

   `stays`, (n), becomes which nodes were put back to their old places; the present nodes become
   those of the retraced curve. */
static int retrace(const Surface *surface, const RelaxationRules *rules, const LevelRules *level,
                   const Curve *old, Workspace *space, Curve *next, uint8_t *stays)
{
    const Nodes *nodes = &space->now;
    int64_t n = nodes->n;
    Scratch scratch = space->rest;
    uint8_t *kept, *bad;
    TRY(take_bytes(&scratch, n, &kept));
    TRY(take_bytes(&scratch, n, &bad));
    memset(kept, 0, (size_t)n);
    memset(stays, 0, (size_t)n);
    for (int64_t round = 0; round < MOST_ROUNDS; round++) {
        int is_new = 0;
        TRY(trace_nodes(surface, rules, level, old, nodes, kept, next, bad));
        finish_curve(old, nodes, next);
        if (!any_of(bad, n)) {
            TRY(mark_crossings(surface, level, next, scratch, bad));
            if (!any_of(bad, n)) return OK;
        }
        for (int64_t i = 0; i < n; i++) {
            if (!bad[i]) continue;
            is_new |= !kept[i];
            kept[i] = stays[i] = stays[node_after(nodes, i)] = 1;
        }
        if (!is_new) break;
        for (int64_t i = 0; i < n; i++)
            if (stays[i]) put_back(old, i, nodes);
        TRY(locate_nodes(surface, nodes));
    }
    for (int64_t i = 0; i < n; i++) {
        stays[i] = 1;
        put_back(old, i, nodes);
    }
    TRY(locate_nodes(surface, nodes));
    return copy_curve(old, next);
}

/* Whether a node is where it was when the curve was traced. */
static int is_still(const Curve *curve, int64_t i)
{
    const double *now = curve->barycentric + 3 * i;
    const double *then = curve->polyline.barycentric + 3 * curve->node_index[i];
    if (curve->is_control[i]) return 1;
    return curve->faces[i] == curve->polyline.faces[curve->node_index[i]] && now[0] == then[0] &&
           now[1] == then[1] && now[2] == then[2];
}

/* Traces a curve whose nodes have moved since it was traced, simple or not. The polyline is kept
   between nodes that have not moved, where a straight trace may fail. */
static int trace_deferred(const Surface *surface, const RelaxationRules *rules,
                          const LevelRules *level, const Curve *curve, const Workspace *space,
                          Curve *next, int *is_lost)
{
    const Nodes *nodes = &space->now;
    Scratch scratch = space->rest;
    uint8_t *kept, *lost;
    TRY(take_bytes(&scratch, nodes->n, &kept));
    TRY(take_bytes(&scratch, nodes->n, &lost));
    TRY(copy_curve(curve, next));
    finish_curve(curve, nodes, next);
    for (int64_t i = 0; i < nodes->n; i++) CHECK(curve->node_index[i], curve->polyline.count);
    for (int64_t i = 0; i < nodes->n; i++)
        kept[i] = is_still(next, i) && is_still(next, node_after(nodes, i));
    TRY(trace_nodes(surface, rules, level, curve, nodes, kept, next, lost));
    *is_lost = any_of(lost, nodes->n);
    return OK;
}

/* Greatest ratio of the longest to the shortest step of a leg. */
static double unevenness(const Curve *curve, const Nodes *nodes)
{
    double greatest = 0.0, longest = 0.0, shortest = INFINITY;
    int64_t steps = nodes->closed ? nodes->n : nodes->n - 1;
    for (int64_t i = 0; i < steps; i++) {
        if (curve->is_control[i]) {
            longest = 0.0;
            shortest = INFINITY;
        }
        longest = greater(longest, nodes->step_lengths[i]);
        shortest = lesser(shortest, nodes->step_lengths[i]);
        greatest = greater(greatest, longest / greater(shortest, TINY));
    }
    return greatest;
}

/* Spaces the nodes anew on the polyline of a curve, unless that would make strands touch. */
static int respace(const Surface *surface, const LevelRules *level, const Curve *curve,
                   Scratch scratch, Curve *next)
{
    Scratch for_crossings = scratch;
    int64_t *controls, k = 0;
    uint8_t *corners, *bad;
    TRY(take_integers(&scratch, curve->n, &controls));
    TRY(take_bytes(&scratch, curve->n, &corners));
    for (int64_t i = 0; i < curve->n; i++) {
        if (!curve->is_control[i]) continue;
        corners[k] = curve->is_corner[i];
        controls[k++] = curve->node_index[i];
    }
    TRY(place_on_polyline(surface, &level->placement, &curve->polyline, curve->closed, k, controls,
                          corners, level->count, scratch, next));
    if (!level->is_traced) return OK;
    TRY(take_bytes(&for_crossings, next->n, &bad));
    memset(bad, 0, (size_t)next->n);
    TRY(mark_crossings(surface, level, next, for_crossings, bad));
    return any_of(bad, next->n) ? copy_curve(curve, next) : OK;
}

static int find_positions(const Surface *surface, const Curve *curve)
{
    for (int64_t i = 0; i < curve->n; i++)
        TRY(position_in_face(&surface->mesh, curve->faces[i], curve->barycentric + 3 * i,
                             curve->positions + 3 * i));
    return OK;
}

/* The chord from a node to the next one, divided by the length of the curve between them; `step` is
   this length. `i` may be -1 or n - 1: those of a closed curve join its ends, and those of an open
   one are the nearest chord. */
static int chord_at(const Surface *surface, const Curve *curve, const double *arcs, int64_t i,
                    double chord[3], double *step)
{
    int64_t n = curve->n, last = curve->closed ? n - 1 : n - 2;
    if (i < 0) i = curve->closed ? last : 0;
    if (i > last) i = curve->closed ? 0 : last;
    int64_t next = i + 1 < n ? i + 1 : 0;
    double begin[3], end[3], total = arcs[curve->polyline.count];
    CHECK(i, n);
    CHECK(curve->node_index[i], curve->polyline.count);
    CHECK(curve->node_index[next], curve->polyline.count);
    *step = (next ? arcs[curve->node_index[next]] : total) - arcs[curve->node_index[i]];
    TRY(position_in_face(&surface->mesh, curve->faces[i], curve->barycentric + 3 * i, begin));
    TRY(position_in_face(&surface->mesh, curve->faces[next], curve->barycentric + 3 * next, end));
    for (int axis = 0; axis < 3; axis++)
        chord[axis] = (end[axis] - begin[axis]) / greater(*step, TINY);
    return OK;
}

/* Finds the moves of the present nodes, those of `fine`, onto a cubic spline through the nodes of
   `coarse` on the same polyline. The spline turns freely at corners. None moves if two coarse nodes
   coincide. */
static int find_smoothing(const Surface *surface, const Curve *coarse, const Curve *fine,
                          const Workspace *space)
{
    Scratch scratch = space->rest;
    double *coarse_arcs, *fine_arcs, chords[3][3], steps[3];
    TRY(take(&scratch, coarse->polyline.count + 1, &coarse_arcs));
    TRY(take(&scratch, fine->polyline.count + 1, &fine_arcs));
    TRY(find_arcs_of_points(&surface->mesh, &coarse->polyline, coarse->closed, coarse_arcs));
    TRY(find_arcs_of_points(&surface->mesh, &fine->polyline, fine->closed, fine_arcs));
    int64_t last = coarse->closed ? coarse->n - 1 : coarse->n - 2;
    int is_even = last >= 0;
    for (int64_t i = 0, at = -1; i < fine->n; i++) {
        double along = fine_arcs[fine->node_index[i]];
        while (at < 0 || (at < last && coarse_arcs[coarse->node_index[at + 1]] <= along)) {
            at++;
            for (int part = 0; part < 3; part++)
                TRY(chord_at(surface, coarse, coarse_arcs, at + part - 1, chords[part],
                             steps + part));
            is_even &= steps[1] > 0.0;
            if (coarse->is_corner[at]) memcpy(chords[0], chords[1], sizeof chords[0]);
            int64_t end = at + 1 < coarse->n ? at + 1 : 0;
            if (coarse->is_corner[end]) memcpy(chords[2], chords[1], sizeof chords[2]);
        }
        double t = (along - coarse_arcs[coarse->node_index[at]]) / greater(steps[1], TINY);
        t = lesser(greater(t, 0.0), 1.0);
        double move = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            /* The slope at a node is the mean of the two chords there. */
            double before = 0.5 * (chords[0][axis] - chords[1][axis]);
            double after = 0.5 * (chords[2][axis] - chords[1][axis]);
            double aside = (t - 2.0 * t * t + t * t * t) * before + (t * t * t - t * t) * after;
            move += steps[1] * aside * space->now.conormals[3 * i + axis];
        }
        space->moves[i] = fine->is_control[i] ? 0.0 : move;
    }
    for (int64_t i = 0; i < fine->n && !is_even; i++) space->moves[i] = 0.0;
    return OK;
}

/* The nodes of a curve become the present ones. */
static int load_nodes(const Surface *surface, const Curve *curve, const Workspace *space)
{
    if (!are_finite(curve->barycentric, 3 * curve->n)) return NOT_FINITE;
    for (int64_t i = 0; i < curve->n; i++) put_back(curve, i, &space->now);
    return locate_nodes(surface, &space->now);
}

static int64_t controls_of(const Curve *curve)
{
    int64_t count = 0;
    for (int64_t i = 0; i < curve->n; i++) count += curve->is_control[i];
    return count;
}

/* Spaces the nodes of a curve anew and moves them onto a smooth curve, if that bends less.

   Between nodes the polyline is straight. So with four times as many nodes it bends only at a
   quarter of them, which costs four times the bending energy. A cubic spline through the former
   nodes gives the moves of the new ones. */
static int refine(const Surface *surface, const RelaxationRules *rules, const LevelRules *level,
                  CurveBuffers *buffers, int64_t pair_room, Scratch scratch)
{
    const Curve *coarse = &buffers->curve;
    Curve *fine = &buffers->spare, *next = &buffers->next;
    Workspace space;
    uint8_t *stays;
    int64_t work = 0;
    TRY(respace(surface, level, coarse, scratch, fine));
    TRY(copy_curve(fine, next));
    if (fine->n <= coarse->n) return OK;
    TRY(take_workspace(scratch, fine->n, fine->closed, pair_room, &space));
    TRY(take_bytes(&space.rest, fine->n, &stays));
    set_corners(&space, fine->is_corner);
    TRY(load_nodes(surface, fine, &space));
    TRY(find_smoothing(surface, coarse, fine, &space));
    double before = bending_energy(&space.now, surface->normal_bending);
    TRY(move_nodes(surface, &rules->traces, &space, 1.0, &space.trial, &work));
    take_trial(&space);
    TRY(retrace(surface, rules, level, fine, &space, next, stays));
    double after = bending_energy(&space.now, surface->normal_bending);
    return after < before ? OK : copy_curve(fine, next);
}

/* Prepares a curve for a level: respaces its nodes if there are too many or too few of them, or if
   they are uneven. */
EXPORTED int begin_level(const Surface *surface, const RelaxationRules *rules,
                         const LevelRules *level, CurveBuffers *buffers, int64_t pair_room,
                         double *scratch, int64_t scratch_items)
{
    const Curve *curve = &buffers->curve;
    const Scratch memory = {scratch, scratch_items};
    Workspace space;
    int64_t away = curve->n - level->count, controls = controls_of(curve);
    TRY(take_workspace(memory, curve->n, curve->closed, pair_room, &space));
    set_corners(&space, curve->is_corner);
    TRY(load_nodes(surface, curve, &space));
    if (away > controls || -away > controls)
        TRY(refine(surface, rules, level, buffers, pair_room, memory));
    else if (unevenness(curve, &space.now) > level->spacing_ratio)
        TRY(respace(surface, level, curve, memory, &buffers->next));
    else
        TRY(copy_curve(curve, &buffers->next));
    return find_positions(surface, &buffers->next);
}

/* Decides what follows after an iteration, or if no step lowers the energy. */
static void judge(const RelaxationRules *rules, const LevelRules *level, const Nodes *nodes,
                  const Steps *found, const Weights *weights, Curve *next, LevelState *state)
{
    if (state->has_moved) {
        state->stalled = found->after < state->least_energy ? 0 : state->stalled + 1;
        state->least_energy = lesser(state->least_energy, found->after);
        if (state->stalled == MOST_STALLED) {
            double above = found->after - state->least_energy;
            state->outcome = above <= ROUGHNESS * found->scale ? CONVERGED : STALLED;
            return;
        }
        double least = level->least_decrease * scale_of_decrease(nodes, found, weights);
        if (found->before - found->after > least) return;
    }
    if (state->releases == RELEASES || !any_of(next->is_stuck, next->n)) {
        state->outcome = CONVERGED;
        return;
    }
    /* Converged with stuck nodes: release them, as they may be able to move now. */
    state->releases++;
    state->damping = rules->steps.least_damping;
    memset(next->is_stuck, 0, (size_t)next->n);
}

/* Retraces the curve after steps, and finds out whether its energy is still lower. If not, it stays
   as it was, and the nodes that could not be retraced are stuck. */
static int retrace_after_steps(const Surface *surface, const RelaxationRules *rules,
                               const LevelRules *level, const Weights *weights, const Curve *curve,
                               Workspace *space, Curve *next, Steps *found, LevelState *state)
{
    int64_t n = space->now.n, newly_stuck = 0;
    uint8_t *stays;
    TRY(take_bytes(&space->rest, n, &stays));
    TRY(retrace(surface, rules, level, curve, space, next, stays));
    if (any_of(stays, n))
        TRY(energy_with_contact(rules, &space->now, weights, &space->contacts, &found->after));
    state->has_moved = found->after < found->before;
    if (!state->has_moved) TRY(copy_curve(curve, next));
    for (int64_t i = 0; i < n; i++) {
        if (!stays[i] || next->is_control[i]) continue;
        newly_stuck += !space->fixed[i];
        next->is_stuck[i] = 1;
    }
    if (!state->has_moved && newly_stuck == 0)
        state->damping *= rules->steps.damping_factor * rules->steps.damping_factor;
    return OK;
}

/* Completes an iteration after its steps. */
static int end_iteration(const Surface *surface, const RelaxationRules *rules,
                         const LevelRules *level, const Weights *weights, const uint8_t *movable,
                         CurveBuffers *buffers, Workspace *space, Steps *found,
                         LevelState *state)
{
    const Curve *curve = &buffers->curve;
    Curve *next = &buffers->next;
    int is_lost = 0;
    state->iterations += !found->is_negligible;
    state->damping = found->damping;
    state->has_moved = found->taken > 0;
    if (!state->has_moved || !level->is_traced) TRY(copy_curve(curve, next));
    if (state->has_moved) {
        if (level->is_traced)
            TRY(retrace_after_steps(surface, rules, level, weights, curve, space, next, found,
                                    state));
        else
            finish_curve(curve, &space->now, next);
        if (!state->has_moved) return OK; /* another iteration with more nodes that are stuck */
        for (int64_t i = 0; i < next->n; i++)
            next->is_stuck[i] |= space->fixed[i] && !next->is_control[i] && may_move(movable, i);
    }
    judge(rules, level, &space->now, found, weights, next, state);
    if (state->outcome != GOES_ON || !state->has_moved || found->farthest <= SMALL_MOVE ||
        unevenness(next, &space->now) <= level->spacing_ratio)
        return OK;
    if (!level->is_traced)
        TRY(trace_deferred(surface, rules, level, curve, space, next, &is_lost));
    if (is_lost) {
        state->outcome = LOST;
        return OK;
    }
    TRY(respace(surface, level, next, space->rest, &buffers->spare));
    return copy_curve(&buffers->spare, next);
}

/* Makes an iteration: takes steps, retraces the curve unless that is deferred, and respaces its
   nodes if they have become uneven.

   Without iterations or work left, it is only found out whether the curve has converged. A call
   that ends after `most_faces` faces, before a step has lowered the energy, is continued by another
   call.

   movable : (n) nodes that may move, NULL for all */
EXPORTED int relax_on_level(const Surface *surface, const RelaxationRules *given_rules,
                            const LevelRules *level, const uint8_t *movable,
                            CurveBuffers *buffers, int64_t pair_room, double *scratch,
                            int64_t scratch_items, int64_t most_faces, LevelState *state)
{
    const Curve *curve = &buffers->curve;
    const Scratch memory = {scratch, scratch_items};
    RelaxationRules rules = *given_rules;
    LevelState changed = *state; /* the state changes only if nothing fails */
    Workspace space;
    Weights weights;
    Steps found = {.damping = changed.damping};
    int64_t work = 0, n = curve->n;
    double faces_of_move = (double)(FACES_OF_A_NODE * n);
    double left = (changed.most_work - changed.work) * faces_of_move;
    if (!(left > 0.0) || changed.iterations >= changed.most_iterations) rules.steps.steps = 0;
    if (left < (double)most_faces) most_faces = left > 1.0 ? (int64_t)left : 1;
    TRY(take_workspace(memory, n, curve->closed, pair_room, &space));
    set_corners(&space, curve->is_corner);
    TRY(load_nodes(surface, curve, &space));
    for (int64_t i = 0; i < n; i++)
        space.fixed[i] = curve->is_control[i] || curve->is_stuck[i] || !may_move(movable, i);
    TRY(take_steps(surface, &rules, NEGLIGIBLE * level->least_decrease, most_faces, &space, &found,
                   &weights, &work));
    changed.work += (double)work / faces_of_move;
    changed.has_moved = 0;
    if (found.taken > 0 || found.is_negligible || found.damping > rules.steps.most_damping) {
        TRY(end_iteration(surface, &rules, level, &weights, movable, buffers, &space, &found,
                          &changed));
    } else {
        TRY(copy_curve(curve, &buffers->next));
        changed.damping = found.damping;
        changed.outcome = rules.steps.steps == 0 ? LIMITED : GOES_ON;
    }
    TRY(find_positions(surface, &buffers->next));
    *state = changed;
    return OK;
}

/* Traces a curve whose nodes have moved since it was traced. `is_lost` becomes whether a trace
   failed. */
EXPORTED int trace_level(const Surface *surface, const RelaxationRules *rules,
                         const LevelRules *level, CurveBuffers *buffers, int64_t pair_room,
                         double *scratch, int64_t scratch_items, int64_t *is_lost)
{
    const Curve *curve = &buffers->curve;
    const Scratch memory = {scratch, scratch_items};
    Workspace space;
    int lost = 0;
    TRY(take_workspace(memory, curve->n, curve->closed, pair_room, &space));
    set_corners(&space, curve->is_corner);
    TRY(load_nodes(surface, curve, &space));
    TRY(trace_deferred(surface, rules, level, curve, &space, &buffers->next, &lost));
    *is_lost = lost;
    return find_positions(surface, &buffers->next);
}
