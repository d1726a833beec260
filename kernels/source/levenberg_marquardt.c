/* Levenberg-Marquardt steps of the nodes of a curve. */
#include "levenberg_marquardt.h"

#define WORTHWHILE 0.05 /* predicted decrease, relative to that so far, above which another step is
                           taken */
#define FURTHER_TRIES 2 /* number of trial steps, after a step that has lowered the energy */
#define LEAST_BENDING 2e-3 /* lower bound on the bending energy in comparisons, relative to the
                              scale */
/* The Gauss-Newton matrix is too stiff where the curve bends strongly. If the energy falls by more
   than this, relative to the half derivative along the step, the parabola through both energies,
   with the slope of the energy at the start, is lower at twice the step. */
#define DOUBLE_STEP_DECREASE (4.0 / 3.0)

static int64_t items_of_rest(int64_t n)
{
    int64_t one = items_of_damped_step(n), other = items_of_even_nodes(n);
    return one > other ? one : other;
}

int64_t items_of_workspace(int64_t n, int64_t pair_room)
{
    return 3 * items_of_nodes(n) + items_of_contacts(n, pair_room) + items_of_linearisation(n) +
           items_of_system(n) + 2 * n + 2 * (n / 8 + 1) + items_of_rest(n);
}

int take_workspace(Scratch scratch, int64_t n, int64_t closed, int64_t pair_room, Workspace *space)
{
    TRY(take_nodes(&scratch, n, closed, &space->now));
    TRY(take_nodes(&scratch, n, closed, &space->trial));
    TRY(take_nodes(&scratch, n, closed, &space->farther));
    TRY(take_contacts(&scratch, n, pair_room, &space->contacts));
    TRY(take_linearisation(&scratch, n, &space->linearisation));
    TRY(take_system(&scratch, n, &space->system));
    TRY(take(&scratch, n, &space->frozen_ds));
    TRY(take(&scratch, n, &space->moves));
    TRY(take_bytes(&scratch, n, &space->fixed));
    TRY(take_bytes(&scratch, n, &space->blocked));
    space->rest = scratch;
    return OK;
}

void set_corners(Workspace *space, const uint8_t *is_corner)
{
    space->now.is_corner = space->trial.is_corner = space->farther.is_corner = is_corner;
}

void take_trial(Workspace *space)
{
    Nodes before = space->now;
    space->now = space->trial;
    space->trial = before;
}

int locate_nodes(const Surface *surface, const Nodes *nodes)
{
    TRY(place_nodes(surface, nodes));
    measure_nodes(nodes);
    return OK;
}

int move_nodes(const Surface *surface, const TraceLimits *limits, const Workspace *space,
               double share, const Nodes *moved, int64_t *work)
{
    const Nodes *now = &space->now;
    copy_places(now, moved);
    for (int64_t i = 0; i < now->n; i++) {
        double length = space->moves[i] * share, direction[3];
        space->blocked[i] = 0;
        if (length == 0.0) continue;
        for (int axis = 0; axis < 3; axis++) {
            double conormal = now->conormals[3 * i + axis];
            direction[axis] = length > 0.0 ? conormal : -conormal;
        }
        int64_t passed = 0;
        TRY(move_point(&surface->mesh, surface->folded, limits, direction, fabs(length),
                       moved->faces + i, moved->barycentric + 3 * i, space->blocked + i, &passed));
        *work += passed;
    }
    *work += FACES_OF_A_NODE * now->n;
    return locate_nodes(surface, moved);
}

int energy_with_contact(const RelaxationRules *rules, const Nodes *nodes, const Weights *weights,
                        Contacts *contacts, double *energy)
{
    *energy = elastic_energy(nodes, weights);
    if (!(rules->energy.contact > 0.0)) return OK;
    TRY(find_contacts(nodes, &rules->contact, contacts));
    *energy += contact_energy(contacts, weights);
    return OK;
}

double bending_energy(const Nodes *nodes, double normal_bending)
{
    double sum = 0.0;
    for (int64_t i = 0; i < nodes->n; i++) {
        sum += nodes->angles[i] * nodes->angles[i] / arc_of_node(nodes, i);
        if (normal_bending > 0.0) sum += normal_bending * normal_bending_of_step(nodes, i);
    }
    return sum;
}

double scale_of_decrease(const Nodes *nodes, const Steps *found, const Weights *weights)
{
    double bending = bending_energy(nodes, weights->normal_bending);
    return greater(bending, LEAST_BENDING * found->scale);
}

/* Computes the energy and assembles the system of the present nodes. */
static int linearise(const Surface *surface, const RelaxationRules *rules, const Weights *weights,
                     Workspace *space, double *energy)
{
    TRY(energy_with_contact(rules, &space->now, weights, &space->contacts, energy));
    TRY(assemble_system(surface, &space->now, weights, rules->steps.shortest,
                        &space->linearisation, &space->system));
    if (rules->energy.contact > 0.0)
        TRY(add_contact(&space->now, &space->contacts, weights, &space->system));
    return OK;
}

/* Half the derivative of the energy along the moves. */
static double slope_along(const Workspace *space)
{
    double sum = 0.0;
    for (int64_t i = 0; i < space->now.n; i++) sum += space->system.slope[i] * space->moves[i];
    return sum;
}

/* The nodes that a trial has moved to a boundary do not move any more. */
static void fix_blocked(const Workspace *space)
{
    for (int64_t i = 0; i < space->now.n; i++) space->fixed[i] |= space->blocked[i];
}

/* Tries the moves, or their part within the trust radius, and takes them if they lower the energy.
   If it falls far, twice the moves are taken if that is still lower. */
static int try_moves(const Surface *surface, const RelaxationRules *rules, const Weights *weights,
                     Workspace *space, Steps *found, int *is_lower, int64_t *work)
{
    double farthest = 0.0, reached, longest = rules->steps.longest_move;
    for (int64_t i = 0; i < space->now.n; i++)
        farthest = greater(farthest, fabs(space->moves[i]));
    farthest /= greater(length_of_curve(&space->now) / (double)space->now.n, TINY);
    double share = lesser(1.0, longest / greater(farthest, TINY));
    found->farthest += share * farthest;
    TRY(move_nodes(surface, &rules->traces, space, share, &space->trial, work));
    TRY(energy_with_contact(rules, &space->trial, weights, &space->contacts, &reached));
    double decrease = found->after - reached;
    *is_lower = decrease > 0.0;
    if (!*is_lower) return OK;
    fix_blocked(space);
    if (rules->steps.doubles && found->taken == 0 &&
        decrease > -DOUBLE_STEP_DECREASE * share * slope_along(space)) {
        double reached_farther;
        TRY(move_nodes(surface, &rules->traces, space, 2.0 * share, &space->farther, work));
        TRY(energy_with_contact(rules, &space->farther, weights, &space->contacts,
                                &reached_farther));
        if (reached_farther < reached) {
            Nodes nearer = space->trial;
            space->trial = space->farther;
            space->farther = nearer;
            reached = reached_farther;
            found->farthest += share * farthest;
            fix_blocked(space);
        }
    }
    take_trial(space);
    found->after = reached;
    found->taken++;
    return OK;
}

/* Takes a step with the least damping with which it lowers the energy. `least` is the predicted
   decrease up to which it is not worthwhile. */
static int take_step(const Surface *surface, const RelaxationRules *rules, const Weights *weights,
                     double least, int64_t most_work, Workspace *space, Steps *found,
                     int *is_lower, int64_t *work)
{
    const StepRules *steps = &rules->steps;
    int64_t n = space->now.n, tries = found->taken > 0 ? FURTHER_TRIES : steps->tries;
    *is_lower = 0;
    for (int64_t k = 0; k < tries && !*is_lower && *work < most_work; k++) {
        TRY(damped_step(&space->system, n, space->fixed, found->damping, space->rest,
                        space->moves));
        if (predicted_decrease(&space->system, n, space->moves) <= least) {
            found->is_negligible = found->taken == 0;
            return OK;
        }
        if (steps->steps == 0) return OK;
        TRY(try_moves(surface, rules, weights, space, found, is_lower, work));
        if (!*is_lower)
            found->damping *= steps->damping_factor;
        else if (found->taken == 1) /* Further steps have the damping of the second one. */
            found->damping = greater(found->damping / steps->damping_factor, steps->least_damping);
        if (found->damping > steps->most_damping) return OK;
    }
    return OK;
}

int take_steps(const Surface *surface, const RelaxationRules *rules, double negligible,
               int64_t most_work, Workspace *space, Steps *found, Weights *weights, int64_t *work)
{
    int is_lower = 0;
    *weights = balance(surface, &space->now, &rules->energy, space->frozen_ds);
    found->taken = found->is_negligible = 0;
    found->farthest = 0.0;
    TRY(linearise(surface, rules, weights, space, &found->before));
    found->after = found->scale = found->before;
    if (weights->frozen_ds) {
        Weights without_map = {.tension = weights->tension,
                               .normal_bending = weights->normal_bending};
        found->scale = elastic_energy(&space->now, &without_map);
    }
    double least = negligible * scale_of_decrease(&space->now, found, weights);
    do {
        TRY(take_step(surface, rules, weights, least, most_work, space, found, &is_lower, work));
        if (!is_lower || found->taken >= rules->steps.steps) break;
        TRY(linearise(surface, rules, weights, space, &found->after));
        least = WORTHWHILE * (found->before - found->after);
    } while (*work < most_work);
    return OK;
}

EXPORTED int64_t linearisation_items(int64_t n, int64_t pair_room)
{
    return items_of_contacts(n, pair_room) + items_of_linearisation(n);
}

/* Computes the weights, the energy and the Gauss-Newton system of a curve. `frozen_ds`, (n), become
   its ds if there is a map. */
EXPORTED int linearise_curve(const Surface *surface, const Nodes *nodes,
                             const RelaxationRules *rules, int64_t pair_room, double *scratch,
                             int64_t scratch_items, double *frozen_ds, Weights *weights,
                             double *energy, System *system)
{
    Scratch memory = {scratch, scratch_items};
    Workspace space = {.now = *nodes, .system = *system};
    TRY(take_contacts(&memory, nodes->n, pair_room, &space.contacts));
    TRY(take_linearisation(&memory, nodes->n, &space.linearisation));
    *weights = balance(surface, nodes, &rules->energy, frozen_ds);
    return linearise(surface, rules, weights, &space, energy);
}
