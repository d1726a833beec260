/* Shortest paths in a graph of hops in which turning has a cost.

   A state is a directed hop. Going on from a state to another one costs their bending, and the
   weight of the other one. States are m hops between cells, then d departures from control points,
   then d arrivals, which are the departures reversed. */
#include <math.h>

#include "scratch.h"

/* For each of n states, those that may follow it or precede it. */
typedef struct {
    int64_t n, count;
    const int64_t *begins;  /* (n + 1) index of the first pair of each state; and `count` */
    const int64_t *states;  /* (count) the other states, ascending for each of the n states */
    const double *bendings; /* (count) costs of the turn between both */
} Pairs;

typedef struct {
    int64_t k;             /* number of control points */
    const int64_t *begins; /* (k + 1) index of the first departure of each control point; and d */
    const double *weights; /* (m + 2 d) of the states */
    Pairs onward;          /* hops that follow the m hops */
    Pairs leaving;         /* hops that follow the d departures */
    Pairs arriving;        /* hops and departures that precede the d arrivals */
} HopGraph;

/* The best paths from one control point to all m + 2 d states. */
typedef struct {
    double *costs;     /* infinite if there is no path */
    int64_t *previous; /* the state before each state, -1 if it is the first */
    int64_t *first;    /* the first state of the path; the state itself if there is no path */
} Paths;

enum { BUCKETS = 1024 };

/* Width of a bucket, in mean weights of the hops. Hardly any pair of states costs less. */
static const double WIDTH = 0.25;

/* The states to be looked at, in buckets by cost (Dial, "Algorithm 360: Shortest-path forest with
   topological ordering", Communications of the ACM, 1969). A state whose cost decreases after it
   has left its bucket is looked at once more. So the width affects only the time, and states that
   cost too much for any bucket may wait in the last one. */
typedef struct {
    double width;
    int64_t capacity; /* states are 0 ... capacity - 1 */
    int64_t count;    /* number of states in all buckets */
    int64_t now;      /* number of buckets that were left */
    int64_t *heads;   /* (BUCKETS) first state of each bucket, of number modulo BUCKETS, or -1 */
    int64_t *tails;   /* (BUCKETS) last state of each bucket, or -1 */
    int64_t *places;  /* (capacity) bucket of each state, -1 outside */
    int64_t *before;  /* (capacity) state before each one in its bucket, or -1 */
    int64_t *after;   /* (capacity) state after each one, or -1 */
} Buckets;

static int take_buckets(Scratch *scratch, int64_t capacity, double width, Buckets *buckets)
{
    *buckets = (Buckets){.width = width, .capacity = capacity};
    TRY(take_integers(scratch, BUCKETS, &buckets->heads));
    TRY(take_integers(scratch, BUCKETS, &buckets->tails));
    TRY(take_integers(scratch, capacity, &buckets->places));
    TRY(take_integers(scratch, capacity, &buckets->before));
    TRY(take_integers(scratch, capacity, &buckets->after));
    for (int64_t i = 0; i < BUCKETS; i++) buckets->heads[i] = buckets->tails[i] = -1;
    for (int64_t state = 0; state < capacity; state++) buckets->places[state] = -1;
    return OK;
}

static void remove_state(Buckets *buckets, int64_t state)
{
    int64_t bucket = buckets->places[state];
    int64_t before = buckets->before[state], after = buckets->after[state];
    *(before < 0 ? &buckets->heads[bucket] : &buckets->after[before]) = after;
    *(after < 0 ? &buckets->tails[bucket] : &buckets->before[after]) = before;
    buckets->places[state] = -1;
    buckets->count--;
}

/* Puts a state at the end of the bucket of its cost. */
static int put_state(Buckets *buckets, int64_t state, double cost)
{
    CHECK(state, buckets->capacity);
    double ahead = cost / buckets->width - (double)buckets->now;
    int64_t steps = ahead < BUCKETS - 1 ? (ahead > 0.0 ? (int64_t)ahead : 0) : BUCKETS - 1;
    int64_t bucket = (buckets->now + steps) % BUCKETS;
    if (buckets->places[state] == bucket) return OK;
    if (buckets->places[state] >= 0) remove_state(buckets, state);
    int64_t last = buckets->tails[bucket];
    *(last < 0 ? &buckets->heads[bucket] : &buckets->after[last]) = state;
    buckets->tails[bucket] = state;
    buckets->before[state] = last;
    buckets->after[state] = -1;
    buckets->places[state] = bucket;
    buckets->count++;
    return OK;
}

/* Takes the next state out of buckets that are not empty. */
static int64_t next_state(Buckets *buckets)
{
    while (buckets->heads[buckets->now % BUCKETS] < 0) buckets->now++;
    int64_t state = buckets->heads[buckets->now % BUCKETS];
    remove_state(buckets, state);
    return state;
}

static int pairs_of(const Pairs *pairs, int64_t i, int64_t *first, int64_t *end)
{
    CHECK(i, pairs->n);
    *first = pairs->begins[i];
    *end = pairs->begins[i + 1];
    CHECK(*first, pairs->count + 1);
    CHECK(*end, pairs->count + 1);
    return OK;
}

/* Whether a path to a state through another one precedes its path so far, which costs as much. The
   state before it that costs least counts, and of several ones that of the lowest index. It costs
   less than the state itself, so that paths have no cycles. */
static int precedes(const Paths *paths, int64_t next, int64_t state)
{
    int64_t so_far = paths->previous[next];
    if (so_far == state) return paths->first[next] != paths->first[state];
    double cost = paths->costs[state], cost_so_far = paths->costs[so_far];
    if (!(cost < paths->costs[next])) return 0;
    return cost < cost_so_far || (cost == cost_so_far && state < so_far);
}

/* Goes on from a state. */
static int go_on(const HopGraph *graph, const Pairs *pairs, int64_t i, int64_t state, Paths *paths,
                 Buckets *buckets, int64_t *work)
{
    int64_t first, end, m = graph->onward.n;
    TRY(pairs_of(pairs, i, &first, &end));
    *work += 1 + end - first;
    const int64_t *states = pairs->states;
    const double *bendings = pairs->bendings, *weights = graph->weights;
    double before = paths->costs[state], *costs = paths->costs;
    for (int64_t k = first; k < end; k++) {
        int64_t next = states[k];
        CHECK(next, m);
        double cost = before + (bendings[k] + weights[next]);
        if (cost > costs[next] || !(cost < INFINITY)) continue;
        if (cost == costs[next] && !precedes(paths, next, state)) continue;
        if (cost < before) return NEGATIVE_COST; /* the loop over states might not end */
        costs[next] = cost;
        paths->previous[next] = state;
        paths->first[next] = paths->first[state];
        TRY(put_state(buckets, next, cost));
    }
    return OK;
}

/* Finds the best state before an arrival; of several ones, that of the lowest index. */
static int arrive(const HopGraph *graph, int64_t i, Paths *paths)
{
    int64_t first, end, so_far = graph->onward.n + graph->leaving.n, arrival = so_far + i;
    TRY(pairs_of(&graph->arriving, i, &first, &end));
    for (int64_t k = first; k < end; k++) {
        int64_t state = graph->arriving.states[k];
        CHECK(state, so_far);
        double added = graph->arriving.bendings[k] + graph->weights[arrival];
        double cost = paths->costs[state] + added;
        if (!(cost < paths->costs[arrival])) continue;
        paths->costs[arrival] = cost;
        paths->previous[arrival] = state;
        paths->first[arrival] = paths->first[state];
    }
    return OK;
}

static int paths_from(const HopGraph *graph, int64_t control, Paths *paths, Buckets *buckets,
                      int64_t *work)
{
    int64_t m = graph->onward.n, d = graph->leaving.n;
    for (int64_t i = 0; i < m + 2 * d; i++) {
        paths->costs[i] = INFINITY;
        paths->previous[i] = -1;
        paths->first[i] = i;
    }
    buckets->now = 0;
    for (int64_t i = graph->begins[control]; i < graph->begins[control + 1]; i++) {
        CHECK(i, d);
        paths->costs[m + i] = graph->weights[m + i];
        TRY(put_state(buckets, m + i, paths->costs[m + i]));
    }
    while (buckets->count > 0) {
        int64_t state = next_state(buckets);
        if (state < m)
            TRY(go_on(graph, &graph->onward, state, state, paths, buckets, work));
        else
            TRY(go_on(graph, &graph->leaving, state - m, state, paths, buckets, work));
    }
    for (int64_t i = 0; i < d; i++) TRY(arrive(graph, i, paths));
    return OK;
}

/* Number of items of scratch of `turning_paths` for m hops and d departures. */
EXPORTED int64_t turning_items(int64_t m, int64_t d)
{
    return 2 * BUCKETS + 3 * (m + d);
}

/* Finds the best paths from k control points, from that of index `done` on.

   costs, previous, first : (k, m + 2 d), see `Paths`
   It returns early after `most_work` pairs of states; `done` is raised to the number of finished
   control points. */
EXPORTED int turning_paths(const HopGraph *graph, double *costs, int64_t *previous, int64_t *first,
                           double *scratch, int64_t scratch_items, int64_t most_work,
                           int64_t *done)
{
    int64_t m = graph->onward.n, d = graph->leaving.n, states = m + 2 * d, work = 0;
    if (graph->arriving.n != d) return ARRAY_TOO_SMALL;
    Scratch memory = {scratch, scratch_items};
    Buckets buckets;
    double total = 0.0;
    for (int64_t i = 0; i < m; i++) total += graph->weights[i];
    double width = total > 0.0 ? WIDTH * total / (double)m : 1.0;
    TRY(take_buckets(&memory, m + d, width, &buckets));
    for (; *done < graph->k && work < most_work; ++*done) {
        CHECK(*done, graph->k);
        int64_t row = *done * states;
        Paths paths = {costs + row, previous + row, first + row};
        TRY(paths_from(graph, *done, &paths, &buckets, &work));
    }
    return OK;
}
