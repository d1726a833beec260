/* Legs between two control points, from the best paths of both to the states of a hop graph. */
#include <math.h>

#include "scratch.h"

/* States are directed hops between n cells. */
typedef struct {
    int64_t n, states;
    const int64_t *starts;  /* (states) cells */
    const int64_t *ends;    /* (states) cells */
    const int64_t *reverse; /* (states) index of the reverse of each state */
} States;

/* The best paths from the control points at both ends of a leg, see `turning_paths`. The path from
   the end of the leg passes the states in reverse. */
typedef struct {
    const double *costs[2];     /* (states) */
    const int64_t *previous[2]; /* (states) */
    const int64_t *first[2];    /* (states) */
} LegPaths;

static int reverse_of(const States *states, int64_t state, int64_t *reverse)
{
    CHECK(state, states->states);
    *reverse = states->reverse[state];
    CHECK(*reverse, states->states);
    return OK;
}

/* Computes the costs of the best legs through all states, (states): multiples of `rounding` times
   the least of them, so that the same leg has the same cost at each of its states. */
static int find_totals(const States *states, const LegPaths *paths, const double *weights,
                       double rounding, double *totals)
{
    double least = INFINITY;
    for (int64_t i = 0; i < states->states; i++) {
        int64_t reverse;
        TRY(reverse_of(states, i, &reverse));
        totals[i] = paths->costs[0][i] + paths->costs[1][reverse] - weights[i];
        if (totals[i] < least) least = totals[i];
    }
    double unit = rounding * least;
    if (!(unit > 0.0) || unit == INFINITY) return OK;
    for (int64_t i = 0; i < states->states; i++) totals[i] = rint(totals[i] / unit) * unit;
    return OK;
}

/* The first and the last state of the best leg through a state. */
static int ends_of_leg(const States *states, const LegPaths *paths, int64_t state, int64_t *first,
                       int64_t *last)
{
    int64_t reverse;
    TRY(reverse_of(states, state, &reverse));
    *first = paths->first[0][state];
    return reverse_of(states, paths->first[1][reverse], last);
}

/* A table of states by the first and the last state of their legs. */
typedef struct {
    int64_t size;   /* a power of two, greater than the number of states */
    int64_t *least; /* (size) the state of least cost, -1 if the place is free */
} Directions;

/* Enters a state unless one of the same first and last state costs as little. */
static int enter(const States *states, const LegPaths *paths, const double *totals, int64_t state,
                 Directions *table)
{
    int64_t first, last, own_first, own_last;
    TRY(ends_of_leg(states, paths, state, &first, &last));
    uint64_t key = ((uint64_t)first * (uint64_t)states->states + (uint64_t)last);
    uint64_t place = key * UINT64_C(0x9E3779B97F4A7C15) >> 20;
    for (int64_t tried = 0; tried < table->size; tried++, place++) {
        int64_t *own = table->least + (place & (uint64_t)(table->size - 1));
        if (*own < 0) {
            *own = state;
            return OK;
        }
        TRY(ends_of_leg(states, paths, *own, &own_first, &own_last));
        if (own_first != first || own_last != last) continue;
        if (totals[state] < totals[*own]) *own = state;
        return OK;
    }
    return ARRAY_TOO_SMALL;
}

/* Number of items of scratch of `best_legs`: the least power of two above the number of states. */
EXPORTED int64_t direction_items(int64_t states)
{
    int64_t size = 1;
    while (size <= 2 * states) size *= 2;
    return size;
}

/* Finds the cheapest legs with different first or last states, and those through different cells.
   Of several states of the same cost, that of the lowest index counts.

   weights : (states) costs of the states without bending, which both paths contain
   rounding : difference of costs that is a rounding error, relative to the least cost
   totals : (states) become the costs of the best legs through all states
   by_direction : (states) become states, in no particular order; `count` becomes their number
   by_cell : (n) become states that end at each cell, -1 where there is none */
EXPORTED int best_legs(const States *states, const LegPaths *paths, const double *weights,
                       double rounding, double *scratch, int64_t scratch_items, double *totals,
                       int64_t *by_direction, int64_t *count, int64_t *by_cell)
{
    Scratch memory = {scratch, scratch_items};
    Directions table = {.size = direction_items(states->states)};
    TRY(take_integers(&memory, table.size, &table.least));
    for (int64_t i = 0; i < table.size; i++) table.least[i] = -1;
    for (int64_t cell = 0; cell < states->n; cell++) by_cell[cell] = -1;
    TRY(find_totals(states, paths, weights, rounding, totals));
    for (int64_t i = 0; i < states->states; i++) {
        int64_t cell = states->ends[i];
        CHECK(cell, states->n);
        if (!isfinite(totals[i])) continue;
        TRY(enter(states, paths, totals, i, &table));
        if (by_cell[cell] < 0 || totals[i] < totals[by_cell[cell]]) by_cell[cell] = i;
    }
    *count = 0;
    for (int64_t i = 0; i < table.size; i++)
        if (table.least[i] >= 0) by_direction[(*count)++] = table.least[i];
    return OK;
}

/* Sets of cells, one bit for each. */
enum { BITS = 64 };

static int64_t words_for(int64_t n)
{
    return (n + BITS - 1) / BITS;
}

static int contains(const uint64_t *set, const uint64_t *other, int64_t words)
{
    for (int64_t i = 0; i < words; i++)
        if (other[i] & ~set[i]) return 0;
    return 1;
}

/* Legs that differ from each other. The row after the last of them is that of a leg that may become
   the next one. */
typedef struct {
    int64_t room;       /* number of rows */
    int64_t count;      /* becomes the number of routes */
    int64_t *legs;      /* (room) become indices of the legs that are routes */
    int64_t *first;     /* (room) become their first states */
    int64_t *last;      /* (room) become their last states */
    int64_t *lengths;   /* (room) become their numbers of cells */
    int64_t *cells;     /* (room, n) become their cells, with both control points */
    uint8_t *alike;     /* (room, room) becomes whether a route runs beside an earlier one */
    uint64_t *passed;   /* (room, words) the cells as sets */
    uint64_t *near;     /* (room, words) the cells beside them */
} Routes;

/* Adds a cell to the leg in the last row; `is_simple` becomes false if the leg has passed it. */
static int pass(const States *states, int64_t cell, Routes *routes, int *is_simple)
{
    CHECK(cell, states->n);
    uint64_t bit = UINT64_C(1) << (cell % BITS);
    uint64_t *word = routes->passed + routes->count * words_for(states->n) + cell / BITS;
    int64_t *length = routes->lengths + routes->count;
    *is_simple = !(*word & bit);
    if (!*is_simple) return OK;
    *word |= bit;
    CHECK(*length, states->n);
    routes->cells[routes->count * states->n + (*length)++] = cell;
    return OK;
}

/* Puts the best leg through a state into the last row. If it passes a cell twice, it ends there. */
static int follow_leg(const States *states, const LegPaths *paths, int64_t via, Routes *routes,
                      int *is_simple)
{
    int64_t row = routes->count, words = words_for(states->n), state;
    CHECK(via, states->states);
    int64_t *first = routes->first + row, *last = routes->last + row;
    for (int64_t i = 0; i < words; i++) routes->passed[row * words + i] = 0;
    routes->lengths[row] = 0;
    *first = *last = via;
    *is_simple = 1;
    for (state = via; *is_simple && state >= 0; state = paths->previous[0][state]) {
        CHECK(state, states->states);
        TRY(pass(states, states->ends[state], routes, is_simple));
        *first = state;
    }
    if (*is_simple) TRY(pass(states, states->starts[*first], routes, is_simple));
    int64_t *cells = routes->cells + row * states->n;
    for (int64_t low = 0, high = routes->lengths[row] - 1; low < high; low++, high--) {
        int64_t cell = cells[low];
        cells[low] = cells[high];
        cells[high] = cell;
    }
    TRY(reverse_of(states, via, &state));
    for (state = paths->previous[1][state]; *is_simple && state >= 0;
         state = paths->previous[1][state]) {
        TRY(reverse_of(states, state, last));
        TRY(pass(states, states->ends[*last], routes, is_simple));
    }
    return OK;
}

/* Whether the leg in the last row differs from all routes. Two legs that run beside each other
   differ if their ends count and are different. */
static int differs(const States *states, int ends_count, const Routes *routes)
{
    int64_t words = words_for(states->n), row = routes->count;
    for (int64_t i = 0; i < row; i++) {
        uint8_t *alike = routes->alike + row * routes->room + i;
        *alike = contains(routes->near + i * words, routes->passed + row * words, words) &&
                 contains(routes->near + row * words, routes->passed + i * words, words);
        int same_ends =
            states->ends[routes->first[i]] == states->ends[routes->first[row]] &&
            states->starts[routes->last[i]] == states->starts[routes->last[row]];
        if (*alike && (same_ends || !ends_count)) return 0;
    }
    return 1;
}

/* Adds the legs through some states to the routes while they differ, up to `most` routes. */
static int add_routes(const States *states, const LegPaths *paths, const uint64_t *beside,
                      const int64_t *via, int64_t begin, int64_t end, int ends_count,
                      int64_t most, Routes *routes)
{
    int64_t n = states->n, words = words_for(n);
    for (int64_t i = begin; i < end && routes->count < most; i++) {
        int64_t row = routes->count;
        int is_simple;
        CHECK(row, routes->room);
        TRY(follow_leg(states, paths, via[i], routes, &is_simple));
        if (!is_simple) continue;
        uint64_t *near = routes->near + row * words;
        for (int64_t w = 0; w < words; w++) near[w] = 0;
        for (int64_t k = 0; k < routes->lengths[row]; k++) {
            const uint64_t *around = beside + routes->cells[row * n + k] * words;
            for (int64_t w = 0; w < words; w++) near[w] |= around[w];
        }
        routes->legs[row] = i;
        if (differs(states, ends_count, routes)) routes->count++;
    }
    return OK;
}

/* Chooses legs that differ from each other, in turn, among the best ones through p states.

   Up to `aligned` of the first `first_count` legs become routes, then up to `different` of the
   others. Among aligned routes, two also differ if their second cells differ, or their last but
   one.

   beside : (n, words) the cells beside each cell, as sets */
EXPORTED int distinct_routes(const States *states, const LegPaths *paths, const uint64_t *beside,
                             int64_t p, const int64_t *via, int64_t first_count, int64_t aligned,
                             int64_t different, Routes *routes)
{
    if (first_count < 0 || first_count > p) return INDEX_OUT_OF_RANGE;
    routes->count = 0;
    TRY(add_routes(states, paths, beside, via, 0, first_count, 1, aligned, routes));
    int64_t most = routes->count + different;
    return add_routes(states, paths, beside, via, first_count, p, 0, most, routes);
}
