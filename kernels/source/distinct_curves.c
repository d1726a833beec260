/* Curves that differ from each other. */
#include "errors.h"
#include "vectors.h"

/* The nodes of c curves. */
typedef struct {
    int64_t c, n;
    const double *positions; /* (c, n, 3) */
} CurveNodes;

/* Whether every node of a curve is within a distance of some node of another one. */
static int is_near(const CurveNodes *curves, int64_t one, int64_t other, double limit,
                   int64_t *work)
{
    const double *nodes = curves->positions + 3 * curves->n * one;
    const double *others = curves->positions + 3 * curves->n * other;
    int64_t at = 0; /* the search begins where it ended for the node before */
    for (int64_t i = 0; i < curves->n; i++) {
        int64_t tried = 0;
        while (tried < curves->n && !(distance_between(nodes + 3 * i, others + 3 * at) <= limit)) {
            at = at + 1 < curves->n ? at + 1 : 0;
            tried++;
        }
        *work += tried + 1;
        if (tried == curves->n) return 0;
    }
    return 1;
}

/* Chooses curves in turn, unless each node of the curve and of an earlier chosen one is within a
   distance of a node of the other one.

   order : (c) indices of the curves
   chosen : (c) become indices of the chosen ones; `count` is raised to their number
   It returns early after `most_work` distances; `done` is raised to the number of finished curves.
 */
EXPORTED int distinct_curves(const CurveNodes *curves, const int64_t *order, double limit,
                             int64_t most_work, int64_t *done, int64_t *count, int64_t *chosen)
{
    int64_t work = 0;
    for (; *done < curves->c && work < most_work; ++*done) {
        CHECK(*done, curves->c);
        int64_t one = order[*done], differs = 1;
        CHECK(one, curves->c);
        for (int64_t i = 0; differs && i < *count; i++) {
            CHECK(i, curves->c);
            int64_t other = chosen[i];
            differs = !is_near(curves, one, other, limit, &work) ||
                      !is_near(curves, other, one, limit, &work);
        }
        if (!differs) continue;
        CHECK(*count, curves->c);
        chosen[(*count)++] = one;
    }
    return OK;
}
