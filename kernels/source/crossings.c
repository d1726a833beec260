/* Finds segments that have a common point, face by face. */
#include "errors.h"
#include "vectors.h"

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
