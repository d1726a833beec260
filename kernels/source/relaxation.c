/* Relaxes several curves, each on its own, by Levenberg-Marquardt steps.

   Only nodes move; the curves are not traced between them. A curve may cross itself, although the
   contact term resists it. */
#include <string.h>

#include "levenberg_marquardt.h"

typedef struct {
    int64_t iterations;    /* greatest number of iterations */
    int64_t respacing;     /* number of iterations from one respacing of the nodes to the next */
    int64_t quiet;         /* number of consecutive quiet iterations after which a curve has
                              converged */
    double least_decrease; /* relative decrease of the energy up to which an iteration is quiet, if
                              no node has moved by more than half of the longest move either */
} BatchRules;

/* c curves of n nodes each, and how far they have been relaxed. */
typedef struct {
    int64_t c, n;
    int64_t closed;
    int64_t *faces;        /* (c, n) */
    double *barycentric;   /* (c, n, 3) */
    const uint8_t *fixed;  /* (c, n) nodes that do not move; the first of each curve is one */
    const uint8_t *corners; /* (c, n) fixed nodes at which the curve may turn freely; or NULL */
    int64_t *iterations;   /* (c) number so far; that of the rules when a curve is done */
    int64_t *quiet;        /* (c) number of latest iterations that were quiet */
    double *dampings;      /* (c) of the next trial step */
} CurveBatch;

/* Number of items of scratch for curves of n nodes with at most `pair_room` close pairs. */
EXPORTED int64_t relaxation_items(int64_t n, int64_t pair_room)
{
    return items_of_workspace(n, pair_room);
}

/* Evens the spacing of the present nodes, after which pairs in contact are sought again. */
static int respace(const Surface *surface, const RelaxationRules *rules, const uint8_t *fixed,
                   Workspace *space, int64_t *work)
{
    TRY(space_evenly(surface, &rules->traces, &rules->spacing, &space->now, fixed, space->rest,
                     &space->trial, work));
    take_trial(space);
    space->contacts.reach = -1.0;
    return OK;
}

/* Relaxes a curve until it has converged, or until it is about to be respaced after enough work. */
static int relax_curve(const Surface *surface, const RelaxationRules *rules,
                       const BatchRules *batch, const CurveBatch *curves, int64_t curve,
                       Workspace *space, int64_t most_work, int64_t *work)
{
    int64_t n = curves->n, iteration = curves->iterations[curve], quiet = curves->quiet[curve];
    const uint8_t *fixed = curves->fixed + curve * n;
    Nodes given = {.n = n,
                   .faces = curves->faces + curve * n,
                   .barycentric = curves->barycentric + 3 * curve * n};
    Steps found = {.damping = curves->dampings[curve]};
    Weights weights;
    if (!are_finite(given.barycentric, 3 * n)) return NOT_FINITE;
    set_corners(space, curves->corners ? curves->corners + curve * n : NULL);
    copy_places(&given, &space->now);
    TRY(locate_nodes(surface, &space->now));
    while (iteration < batch->iterations) {
        if (iteration % batch->respacing == 0) {
            if (*work >= most_work) break;
            TRY(respace(surface, rules, fixed, space, work));
        }
        memcpy(space->fixed, fixed, (size_t)n);
        TRY(take_steps(surface, rules, 0.0, INT64_MAX, space, &found, &weights, work));
        int is_quiet = found.before - found.after <= batch->least_decrease * found.scale &&
                       found.farthest <= 0.5 * rules->steps.longest_move;
        quiet = is_quiet ? quiet + 1 : 0;
        iteration++;
        if (quiet >= batch->quiet || found.damping > rules->steps.most_damping)
            iteration = batch->iterations;
    }
    copy_places(&space->now, &given);
    curves->iterations[curve] = iteration;
    curves->quiet[curve] = quiet;
    curves->dampings[curve] = found.damping;
    return OK;
}

/* Relaxes curves from where the previous call has left them.

   It returns after `most_work` faces or the time of as many; then some curves are not done. If it
   returns ARRAY_TOO_SMALL, a curve has more than `pair_room` close pairs: a call with more room
   continues.

   scratch : items of eight bytes, as many as `relaxation_items` says */
EXPORTED int relax_curves(const Surface *surface, const RelaxationRules *rules,
                          const BatchRules *batch, const CurveBatch *curves, int64_t pair_room,
                          double *scratch, int64_t scratch_items, int64_t most_work)
{
    const Scratch all = {scratch, scratch_items};
    Workspace space;
    int64_t work = 0;
    if (batch->respacing < 1) return INDEX_OUT_OF_RANGE;
    TRY(take_workspace(all, curves->n, curves->closed, pair_room, &space));
    for (int64_t curve = 0; curve < curves->c && work < most_work; curve++)
        if (curves->iterations[curve] < batch->iterations)
            TRY(relax_curve(surface, rules, batch, curves, curve, &space, most_work, &work));
    return OK;
}
