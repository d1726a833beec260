/* Finds segments that have a common point, face by face. */
#include "scratch.h"
#include "vectors.h"

enum { DIGIT = 11, DIGITS = 1 << DIGIT }; /* number of bits, and of values, of a digit */

/* Number of items of scratch that `order_of_groups` takes. */
EXPORTED int64_t order_items(int64_t s)
{
    return s + DIGITS;
}

/* Sorts s segments by one digit of their groups; equal ones keep their order. */
static int sort_by_digit(int64_t s, const int64_t *groups, int shift, const int64_t *from,
                         int64_t *counts, int64_t *to)
{
    for (int64_t digit = 0; digit < DIGITS; digit++) counts[digit] = 0;
    for (int64_t i = 0; i < s; i++) counts[((uint64_t)groups[i] >> shift) % DIGITS]++;
    int64_t before = 0;
    for (int64_t digit = 0; digit < DIGITS; digit++) {
        int64_t count = counts[digit];
        counts[digit] = before;
        before += count;
    }
    for (int64_t i = 0; i < s; i++) {
        CHECK(from[i], s);
        int64_t place = counts[((uint64_t)groups[from[i]] >> shift) % DIGITS]++;
        CHECK(place, s);
        to[place] = from[i];
    }
    return OK;
}

/* Finds the order, (s), in which segments are sorted by their groups, (s), digit by digit. Segments
   of the same group keep their order. */
EXPORTED int order_of_groups(int64_t s, const int64_t *groups, double *scratch,
                             int64_t scratch_items, int64_t *order)
{
    Scratch memory = {scratch, scratch_items};
    int64_t *counts, *sorted;
    uint64_t used = 0;
    TRY(take_integers(&memory, DIGITS, &counts));
    TRY(take_integers(&memory, s, &sorted));
    for (int64_t i = 0; i < s; i++) {
        order[i] = i;
        used |= (uint64_t)groups[i];
    }
    for (int shift = 0; shift < 64 && used >> shift; shift += DIGIT) {
        TRY(sort_by_digit(s, groups, shift, order, counts, sorted));
        for (int64_t i = 0; i < s; i++) order[i] = sorted[i];
    }
    return OK;
}

/* s segments, each in a group whose segments all lie in one face. */
typedef struct {
    int64_t s;
    const int64_t *order;  /* (s) the segments, sorted by their groups */
    const int64_t *groups; /* (s) */
    const double *starts;  /* (s, 2) first two barycentric coordinates of the ends in the face */
    const double *ends;    /* (s, 2) */
} Segments;

/* Pairs found so far, and the places in the order of the two segments that are compared next. */
typedef struct {
    int64_t room;   /* number of pairs that the array can hold */
    int64_t count;
    int64_t *pairs; /* (room, 2) */
    int64_t first, second;
} PairSearch;

static int boxes_overlap(const double *a, const double *b, const double *c, const double *d,
                         double touching)
{
    for (int axis = 0; axis < 2; axis++) {
        if (!(lesser(a[axis], b[axis]) <= greater(c[axis], d[axis]) + touching)) return 0;
        if (!(lesser(c[axis], d[axis]) <= greater(a[axis], b[axis]) + touching)) return 0;
    }
    return 1;
}

/* Twice the signed area of the triangle abc. */
static double turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Whether c and d lie on different sides of the line ab, or at least one lies on it. */
static int reaches_across(const double *a, const double *b, const double *c, const double *d,
                          double touching)
{
    double one = turn(a, b, c), other = turn(a, b, d), x = b[0] - a[0], y = b[1] - a[1];
    double width = touching * sqrt(x * x + y * y);
    return lesser(one, other) <= width && greater(one, other) >= -width;
}

/* Finds the pairs of segments of one group that have a common point.

   It returns when all pairs have been compared, when there is no room for another one, or after
   `most_work` comparisons; another call continues. Then `first` is s when all is done.

   touching : distance in barycentric coordinates up to which segments touch */
EXPORTED int meeting_segments(const Segments *segments, double touching, int64_t most_work,
                              PairSearch *search)
{
    int64_t work = 0, s = segments->s;
    while (search->first < s) {
        CHECK(search->first, s);
        int64_t one = segments->order[search->first];
        CHECK(one, s);
        const double *a = segments->starts + 2 * one, *b = segments->ends + 2 * one;
        for (; search->second < s; search->second++) {
            CHECK(search->second, s);
            int64_t other = segments->order[search->second];
            CHECK(other, s);
            if (segments->groups[other] != segments->groups[one]) break;
            if (work++ >= most_work || search->count >= search->room) return OK;
            const double *c = segments->starts + 2 * other, *d = segments->ends + 2 * other;
            /* Boxes are necessary, since collinear segments pass the other tests even if they are
               disjoint. */
            if (!boxes_overlap(a, b, c, d, touching)) continue;
            if (!reaches_across(a, b, c, d, touching)) continue;
            if (!reaches_across(c, d, a, b, touching)) continue;
            search->pairs[2 * search->count] = one;
            search->pairs[2 * search->count + 1] = other;
            search->count++;
        }
        search->first++;
        search->second = search->first + 1;
    }
    return OK;
}
