/* Relaxes several curves, each on its own, by Levenberg-Marquardt steps.

   Only nodes move; the curves are not traced between them. A curve may cross itself, although the
   contact term resists it. */
#include "contact.h"
#include "damped_step.h"
#include "elastic_energy.h"
#include "even_nodes.h"
#include "nodes.h"
#include "tracing.h"

#define FACES_OF_A_NODE 4 /* number of faces that take as much time to cross as the rest of a step
                             of one node */

/* Lengths are in mean distances between neighbouring nodes. */
typedef struct {
    int64_t iterations;    /* greatest number of steps */
    int64_t respacing;     /* number of steps from one respacing of the nodes to the next */
    int64_t quiet;         /* number of consecutive quiet steps after which a curve has converged */
    double least_decrease; /* relative decrease of the energy up to which a step is quiet, if no
                              node has moved by more than half of longest_move either */
    double longest_move;   /* trust radius of the linearised energy */
    double least_damping;  /* of the first step, and lower bound afterwards */
    double most_damping;   /* damping above which a curve stays */
    double damping_factor; /* by which damping rises after a failed step, and falls otherwise */
    double shortest;       /* least length of a step by which the tension is divided, in mesh
                              units */
} StepRules;

typedef struct {
    TraceLimits traces;
    ContactRules contact;
    SpacingRules spacing;
    EnergyRules energy;
    StepRules steps;
} RelaxationRules;

/* c curves of n nodes each, and how far they have been relaxed. */
typedef struct {
    int64_t c, n;
    int64_t closed;
    int64_t *faces;        /* (c, n) */
    double *barycentric;   /* (c, n, 3) */
    const uint8_t *fixed;  /* (c, n) nodes that do not move; the first of each curve is one */
    int64_t *iterations;   /* (c) number of steps so far; that of the rules when a curve is done */
    int64_t *quiet;        /* (c) number of latest steps that were quiet */
    double *dampings;      /* (c) of the next step */
} CurveBatch;

/* Everything that the steps of one curve need. */
typedef struct {
    Nodes now, trial;
    Contacts contacts;
    Linearisation linearisation;
    System system;
    double *held_ds; /* (n) */
    double *moves;   /* (n) */
    double *arcs;    /* (n) */
    Scratch rest;    /* of damped steps, or of even spacing */
} Workspace;

static int64_t items_of_rest(int64_t n)
{
    int64_t one = items_of_damped_step(n), other = items_of_even_nodes(n);
    return one > other ? one : other;
}

/* Number of items of scratch for curves of n nodes with at most `pair_room` close pairs. */
EXPORTED int64_t relaxation_items(int64_t n, int64_t pair_room)
{
    return 2 * items_of_nodes(n) + items_of_contacts(pair_room) + items_of_linearisation(n) +
           items_of_system(n) + 3 * n + items_of_rest(n);
}

static int take_workspace(Scratch scratch, const CurveBatch *curves, int64_t pair_room,
                          Workspace *space)
{
    int64_t n = curves->n;
    TRY(take_nodes(&scratch, n, curves->closed, &space->now));
    TRY(take_nodes(&scratch, n, curves->closed, &space->trial));
    TRY(take_contacts(&scratch, pair_room, &space->contacts));
    TRY(take_linearisation(&scratch, n, &space->linearisation));
    TRY(take_system(&scratch, n, &space->system));
    TRY(take(&scratch, n, &space->held_ds));
    TRY(take(&scratch, n, &space->moves));
    TRY(take(&scratch, n, &space->arcs));
    space->rest = scratch;
    return OK;
}

static void take_trial(Workspace *space)
{
    Nodes before = space->now;
    space->now = space->trial;
    space->trial = before;
}

/* Moves the present nodes along their conormals by `moves` times a share; they become the trial. */
static int move_nodes(const Surface *surface, const TraceLimits *limits, const Workspace *space,
                      double share, int64_t *work)
{
    const Nodes *now = &space->now, *trial = &space->trial;
    copy_places(now, trial);
    for (int64_t i = 0; i < now->n; i++) {
        double length = space->moves[i] * share, direction[3];
        if (length == 0.0) continue;
        for (int axis = 0; axis < 3; axis++) {
            double conormal = now->conormals[3 * i + axis];
            direction[axis] = length > 0.0 ? conormal : -conormal;
        }
        uint8_t blocked;
        int64_t passed = 0;
        TRY(move_point(&surface->mesh, surface->folded, limits, direction, fabs(length),
                       trial->faces + i, trial->barycentric + 3 * i, &blocked, &passed));
        *work += passed;
    }
    TRY(place_nodes(surface, trial));
    measure_nodes(trial);
    return OK;
}

/* Evens the spacing of the present nodes, and finds the pairs that may come into contact. */
static int respace(const Surface *surface, const RelaxationRules *rules, const uint8_t *fixed,
                   Workspace *space, int64_t *work)
{
    TRY(space_evenly(surface, &rules->traces, &rules->spacing, &space->now, fixed, space->rest,
                     &space->trial, work));
    take_trial(space);
    if (rules->energy.contact > 0.0)
        TRY(find_close_pairs(&space->now, &rules->contact, 1.0, space->arcs, &space->contacts));
    return OK;
}

static int energy_with_contact(const RelaxationRules *rules, const Nodes *nodes,
                               const Weights *weights, Contacts *contacts, double *energy)
{
    *energy = elastic_energy(nodes, weights);
    if (!(rules->energy.contact > 0.0)) return OK;
    TRY(find_contacts(nodes, &rules->contact, contacts));
    *energy += contact_energy(contacts, weights);
    return OK;
}

/* Takes one step if it lowers the energy, and updates the damping and the count of quiet steps. */
static int step_curve(const Surface *surface, const RelaxationRules *rules, const uint8_t *fixed,
                      Workspace *space, double *damping, int64_t *quiet, int64_t *work)
{
    const StepRules *steps = &rules->steps;
    const Nodes *now = &space->now;
    Weights weights = balance(surface, now, &rules->energy, space->held_ds);
    double before, after;
    TRY(energy_with_contact(rules, now, &weights, &space->contacts, &before));
    /* With a map, the term of a lane is negative, so decreases are compared with the rest. */
    double scale = before;
    if (weights.held_ds) {
        Weights without_map = {weights.tension, 0.0, 0.0, NULL};
        scale = elastic_energy(now, &without_map);
    }
    TRY(assemble_system(surface, now, &weights, steps->shortest, &space->linearisation,
                        &space->system));
    if (rules->energy.contact > 0.0)
        TRY(add_contact(now, &space->contacts, &weights, &space->system));
    TRY(damped_step(&space->system, now->n, fixed, *damping, space->rest, space->moves));

    double farthest = 0.0;
    for (int64_t i = 0; i < now->n; i++) farthest = greater(farthest, fabs(space->moves[i]));
    farthest /= greater(length_of_curve(now) / (double)now->n, TINY);
    double share = lesser(1.0, steps->longest_move / greater(farthest, TINY));
    TRY(move_nodes(surface, &rules->traces, space, share, work));
    TRY(energy_with_contact(rules, &space->trial, &weights, &space->contacts, &after));

    int is_lower = after < before;
    double decrease = is_lower ? before - after : 0.0;
    int is_quiet = decrease <= steps->least_decrease * scale &&
                   share * farthest <= 0.5 * steps->longest_move;
    if (is_lower) take_trial(space);
    *damping = is_lower ? greater(*damping / steps->damping_factor, steps->least_damping)
                        : *damping * steps->damping_factor;
    *quiet = is_quiet ? *quiet + 1 : 0;
    *work += FACES_OF_A_NODE * now->n;
    return OK;
}

/* Relaxes a curve until it has converged, or until it is about to be respaced after enough work. */
static int relax_curve(const Surface *surface, const RelaxationRules *rules,
                       const CurveBatch *curves, int64_t curve, Workspace *space,
                       int64_t most_work, int64_t *work)
{
    const StepRules *steps = &rules->steps;
    int64_t n = curves->n, iteration = curves->iterations[curve], quiet = curves->quiet[curve];
    const uint8_t *fixed = curves->fixed + curve * n;
    Nodes given = {.n = n,
                   .faces = curves->faces + curve * n,
                   .barycentric = curves->barycentric + 3 * curve * n};
    double damping = curves->dampings[curve];
    if (!are_finite(given.barycentric, 3 * n)) return NOT_FINITE;
    copy_places(&given, &space->now);
    TRY(place_nodes(surface, &space->now));
    measure_nodes(&space->now);
    while (iteration < steps->iterations) {
        if (iteration % steps->respacing == 0) {
            if (*work >= most_work) break;
            TRY(respace(surface, rules, fixed, space, work));
        }
        TRY(step_curve(surface, rules, fixed, space, &damping, &quiet, work));
        iteration++;
        if (quiet >= steps->quiet || damping > steps->most_damping) iteration = steps->iterations;
    }
    copy_places(&space->now, &given);
    curves->iterations[curve] = iteration;
    curves->quiet[curve] = quiet;
    curves->dampings[curve] = damping;
    return OK;
}

/* Relaxes curves from where the previous call has left them.

   It returns after `most_work` faces or the time of as many; then some curves are not done. If it
   returns ARRAY_TOO_SMALL, a curve has more than `pair_room` close pairs: a call with more room
   continues.

   scratch : items of eight bytes, as many as `relaxation_items` says */
EXPORTED int relax_curves(const Surface *surface, const RelaxationRules *rules,
                          const CurveBatch *curves, int64_t pair_room, double *scratch,
                          int64_t scratch_items, int64_t most_work)
{
    Scratch all = {scratch, scratch_items};
    Workspace space;
    int64_t work = 0;
    if (rules->steps.respacing < 1) return INDEX_OUT_OF_RANGE;
    TRY(take_workspace(all, curves, pair_room, &space));
    for (int64_t curve = 0; curve < curves->c && work < most_work; curve++)
        if (curves->iterations[curve] < rules->steps.iterations)
            TRY(relax_curve(surface, rules, curves, curve, &space, most_work, &work));
    return OK;
}
