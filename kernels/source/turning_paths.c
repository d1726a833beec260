/* Shortest paths in a graph of hops in which turning has a cost.

   A state is a directed hop. Going on from a state to another one costs their bending, and the
   weight of the other one. States are m hops between cells, then d departures from control points,
   then d arrivals, which are the departures reversed. */
#include <math.h>

#include "queue.h"

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

static int pairs_of(const Pairs *pairs, int64_t i, int64_t *first, int64_t *end)
{
    CHECK(i, pairs->n);
    *first = pairs->begins[i];
    *end = pairs->begins[i + 1];
    CHECK(*first, pairs->count + 1);
    CHECK(*end, pairs->count + 1);
    return OK;
}

/* Goes on from a state. Of several states before the same one at the same cost, that which leaves
   the queue first counts. */
static int go_on(const HopGraph *graph, const Pairs *pairs, int64_t i, int64_t state, Paths *paths,
                 Queue *queue, int64_t *work)
{
    int64_t first, end, m = graph->onward.n;
    TRY(pairs_of(pairs, i, &first, &end));
    *work += 1 + end - first;
    double before = paths->costs[state];
    for (int64_t k = first; k < end; k++) {
        int64_t next = pairs->states[k];
        CHECK(next, m);
        double cost = before + (pairs->bendings[k] + graph->weights[next]);
        if (!(cost < paths->costs[next])) continue;
        paths->costs[next] = cost;
        paths->previous[next] = state;
        paths->first[next] = paths->first[state];
        TRY(enqueue(queue, next, cost));
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

static int paths_from(const HopGraph *graph, int64_t control, Paths *paths, Queue *queue,
                      int64_t *work)
{
    int64_t m = graph->onward.n, d = graph->leaving.n, state;
    for (int64_t i = 0; i < m + 2 * d; i++) {
        paths->costs[i] = INFINITY;
        paths->previous[i] = -1;
        paths->first[i] = i;
    }
    for (int64_t i = graph->begins[control]; i < graph->begins[control + 1]; i++) {
        CHECK(i, d);
        paths->costs[m + i] = graph->weights[m + i];
        TRY(enqueue(queue, m + i, paths->costs[m + i]));
    }
    for (int64_t left = 0; queue->count > 0; left++) {
        CHECK(left, m + d); /* a state leaves the queue once, unless a cost is negative */
        TRY(dequeue(queue, &state));
        if (state < m)
            TRY(go_on(graph, &graph->onward, state, state, paths, queue, work));
        else
            TRY(go_on(graph, &graph->leaving, state - m, state, paths, queue, work));
    }
    for (int64_t i = 0; i < d; i++) TRY(arrive(graph, i, paths));
    return OK;
}

/* Number of items of scratch of `turning_paths` for m hops and d departures. */
EXPORTED int64_t turning_items(int64_t m, int64_t d)
{
    return items_of_queue(m + d);
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
    Queue queue;
    TRY(take_queue(&memory, m + d, &queue));
    for (; *done < graph->k && work < most_work; ++*done) {
        CHECK(*done, graph->k);
        int64_t row = *done * states;
        Paths paths = {costs + row, previous + row, first + row};
        TRY(paths_from(graph, *done, &paths, &queue, &work));
    }
    return OK;
}
