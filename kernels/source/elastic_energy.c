/* The energy of a curve and its Gauss-Newton system. */
#include "elastic_energy.h"

#include "arc_tangent.h"

int64_t items_of_system(int64_t n)
{
    return 4 * n;
}

int take_system(Scratch *scratch, int64_t n, System *system)
{
    TRY(take(scratch, 3 * n, &system->bands));
    return take(scratch, n, &system->slope);
}

int64_t items_of_linearisation(int64_t n)
{
    return 12 * n;
}

int take_linearisation(Scratch *scratch, int64_t n, Linearisation *linearisation)
{
    TRY(take(scratch, 2 * n, &linearisation->residuals));
    TRY(take(scratch, 6 * n, &linearisation->jacobian));
    TRY(take(scratch, n, &linearisation->drift));
    return take(scratch, 3 * n, &linearisation->normal_turns);
}

/* Tension at a node, with the excess of phi_fea in an obstacle. */
static double tension_at(const Nodes *nodes, const Weights *weights, int64_t i)
{
    double excess = nodes->phi_fea[i] * nodes->phi_fea[i] - 1.0;
    return weights->tension + weights->feature * greater(excess, 0.0);
}

/* Change of the normal along the step after a node, (3), and its product with the step. The normal
   of the next node is turned to the same side. */
static double normal_change(const Nodes *nodes, int64_t i, double change[3])
{
    const double *normal = nodes->normals + 3 * i;
    const double *next = nodes->normals + 3 * node_after(nodes, i);
    double side = side_of_next(nodes, i);
    for (int axis = 0; axis < 3; axis++) change[axis] = side * next[axis] - normal[axis];
    return dot(change, nodes->steps + 3 * i);
}

double normal_bending_of_step(const Nodes *nodes, int64_t i)
{
    double change[3], length = greater(nodes->step_lengths[i], TINY);
    if (!has_step(nodes, i)) return 0.0;
    double along = normal_change(nodes, i, change) / length;
    return along * along / length;
}

double elastic_energy(const Nodes *nodes, const Weights *weights)
{
    double energy = 0.0;
    for (int64_t i = 0; i < nodes->n; i++) {
        double ds = arc_of_node(nodes, i), angle = nodes->angles[i];
        double at_node = angle * angle / ds + tension_at(nodes, weights, i) * ds;
        if (weights->frozen_ds) {
            double phi = lesser(nodes->phi_fea[i], 1.0);
            at_node += weights->feature * (phi * phi - 1.0) * weights->frozen_ds[i];
        }
        if (weights->normal_bending > 0.0)
            at_node += weights->normal_bending * normal_bending_of_step(nodes, i);
        energy += at_node;
    }
    return energy;
}

Weights balance(const Surface *surface, const Nodes *nodes, const EnergyRules *rules,
                double *frozen_ds)
{
    double turn = 2.0 * PI / length_of_curve(nodes), tension = turn * turn / rules->smoothness;
    Weights weights = {.tension = rules->tautness * tension,
                       .normal_bending = surface->normal_bending};
    if (rules->contact > 0.0)
        weights.contact = rules->contact * elastic_energy(nodes, &weights) / (double)nodes->n;
    if (surface->feature_map) {
        weights.feature =
            surface->feature_weight / rules->smoothness + rules->over_tension * tension;
        weights.frozen_ds = frozen_ds;
        for (int64_t i = 0; i < nodes->n; i++) frozen_ds[i] = arc_of_node(nodes, i);
    }
    return weights;
}

double contact_energy(const Contacts *contacts, const Weights *weights)
{
    double energy = 0.0;
    for (int64_t p = 0; p < contacts->count; p++)
        energy += 2.0 * weights->contact * (contacts->overlaps[p] * contacts->overlaps[p]);
    return energy;
}

/* Derivatives of the normal at a node and of phi_fea there by a move along the conormal. */
static int conormal_derivative(const Surface *surface, const Nodes *nodes, int64_t i,
                               double turn[3], double *drift)
{
    const double *corners[3], *conormal = nodes->conormals + 3 * i;
    const double *normal = nodes->normals + 3 * i;
    int64_t face = nodes->faces[i];
    double at_corners[3][3], one[3], other[3], sum[3];
    TRY(corners_of(&surface->mesh, face, corners));
    TRY(corner_normals(surface, face, at_corners));
    const double *const normals[3] = {at_corners[0], at_corners[1], at_corners[2]};
    for (int axis = 0; axis < 3; axis++) {
        one[axis] = corners[1][axis] - corners[0][axis];
        other[axis] = corners[2][axis] - corners[0][axis];
    }
    /* Barycentric coordinates of the move: least squares in the plane of the face. The determinant
       is not below its rounding error, where two long sides are almost parallel. */
    double p = dot(one, one), q = dot(one, other), r = dot(other, other);
    double f = dot(one, conormal), g = dot(other, conormal);
    double determinant = greater(p * r - q * q, DBL_EPSILON * p * r);
    determinant = greater(determinant, TINY);
    double u = (r * f - q * g) / determinant, v = (p * g - q * f) / determinant;
    double change[3] = {-u - v, u, v};
    interpolate(normals, nodes->barycentric + 3 * i, sum);
    interpolate(normals, change, turn);
    double length = greater(dot(sum, normal), TINY);
    for (int axis = 0; axis < 3; axis++) turn[axis] /= length;
    double along_normal = dot(turn, normal);
    for (int axis = 0; axis < 3; axis++) turn[axis] -= along_normal * normal[axis];
    *drift = 0.0;
    return surface->feature_map ? weighted_feature(surface, face, change, drift) : OK;
}

int conormal_derivatives(const Surface *surface, const Nodes *nodes, double *turns, double *drifts)
{
    for (int64_t i = 0; i < nodes->n; i++)
        TRY(conormal_derivative(surface, nodes, i, turns + 3 * i, drifts + i));
    return OK;
}

/* Computes the residuals of a node and their derivatives. */
static int linearise_node(const Surface *surface, const Nodes *nodes, const Weights *weights,
                          int64_t i, const Linearisation *linearisation)
{
    int64_t h = node_before(nodes, i), j = node_after(nodes, i);
    const double *before = nodes->steps + 3 * h, *after = nodes->steps + 3 * i;
    const double *normal = nodes->normals + 3 * i, *here = nodes->conormals + 3 * i;
    const double *here_before = nodes->conormals + 3 * h, *here_after = nodes->conormals + 3 * j;
    double length_before = nodes->step_lengths[h], length_after = nodes->step_lengths[i];
    double flat_before[3], flat_after[3], by_before[3], by_after[3], by_here[3];
    double along_before[3], along_after[3], along_here[3];
    double *drift = linearisation->drift + i, *normal_turn = linearisation->normal_turns + 3 * i;
    TRY(conormal_derivative(surface, nodes, i, normal_turn, drift));

    Turn turn = turn_at(before, after, normal);
    for (int axis = 0; axis < 3; axis++) {
        flat_before[axis] = before[axis] - turn.out_before * normal[axis];
        flat_after[axis] = after[axis] - turn.out_after * normal[axis];
        along_before[axis] = before[axis] / greater(length_before, TINY);
        along_after[axis] = after[axis] / greater(length_after, TINY);
        along_here[axis] = along_before[axis] - along_after[axis];
    }
    double squared_before = greater(dot(flat_before, flat_before), TINY);
    double squared_after = greater(dot(flat_after, flat_after), TINY);
    cross(flat_before, normal, by_before);
    cross(normal, flat_after, by_after);
    for (int axis = 0; axis < 3; axis++) {
        by_before[axis] /= squared_before;
        by_after[axis] /= squared_after;
        by_here[axis] = by_before[axis] - by_after[axis];
    }
    double by_normal = turn.sine * (turn.out_after * dot(before, normal_turn) +
                                    turn.out_before * dot(after, normal_turn));
    /* Divided by one square after the other: the product of two tiny squares may underflow. */
    by_normal += turn.cosine * dot(turn.product, normal_turn);
    by_normal = by_normal / squared_before / squared_after;

    double root = sqrt(greater(0.5 * (length_before + length_after), TINY));
    double angle_by[3] = {-dot(by_before, here_before), dot(by_here, here) + by_normal,
                          dot(by_after, here_after)};
    double root_by[3] = {-dot(along_before, here_before) / (4.0 * root),
                         dot(along_here, here) / (4.0 * root),
                         dot(along_after, here_after) / (4.0 * root)};
    if (turns_freely(nodes, i))
        for (int k = 0; k < 3; k++) angle_by[k] = 0.0;
    if (!has_step(nodes, h)) root_by[0] = 0.0;
    if (!has_step(nodes, i)) root_by[2] = 0.0;
    double bending = nodes->angles[i] / root, phi = nodes->phi_fea[i];
    double pulled = sqrt(greater(tension_at(nodes, weights, i), TINY));
    double rising = phi > 1.0 ? weights->feature * phi * *drift : 0.0;
    double *by = linearisation->jacobian + 6 * i;
    for (int k = 0; k < 3; k++) {
        by[2 * k] = (angle_by[k] - bending * root_by[k]) / root;
        by[2 * k + 1] = pulled * root_by[k];
    }
    by[3] += rising / pulled * root;
    linearisation->residuals[2 * i] = bending;
    linearisation->residuals[2 * i + 1] = pulled * root;
    return OK;
}

/* The residual sqrt(weight kappa_n^2 ds) of the step after a node, with its sign, and its
   derivatives by the moves of both nodes; `turns`, (n, 3), are those of the normals. */
static double linearise_step(const Nodes *nodes, double weight, const double *turns, int64_t i,
                             double by[2])
{
    int64_t j = node_after(nodes, i);
    const double *step = nodes->steps + 3 * i;
    const double *here = nodes->conormals + 3 * i, *there = nodes->conormals + 3 * j;
    double change[3], along = normal_change(nodes, i, change), side = side_of_next(nodes, i);
    double length = greater(nodes->step_lengths[i], TINY);
    double factor = sqrt(weight / length) / length;
    double by_length = 1.5 * along / length / length;
    by[0] = -dot(turns + 3 * i, step) - dot(change, here) + by_length * dot(step, here);
    by[1] = side * dot(turns + 3 * j, step) + dot(change, there) - by_length * dot(step, there);
    by[0] *= factor;
    by[1] *= factor;
    return factor * along;
}

/* Adds the bending by the normal curvature to a system. */
static void add_normal_bending(const Nodes *nodes, double weight, const double *turns,
                               const System *system)
{
    int64_t n = nodes->n;
    for (int64_t i = 0; i < n; i++) {
        if (!has_step(nodes, i)) continue;
        int64_t j = node_after(nodes, i);
        double by[2], residual = linearise_step(nodes, weight, turns, i, by);
        system->bands[i] += by[0] * by[0];
        system->bands[j] += by[1] * by[1];
        system->bands[n + i] += by[0] * by[1];
        system->slope[i] += by[0] * residual;
        system->slope[j] += by[1] * residual;
    }
}

static inline double dot2(const double *one, const double *other)
{
    return one[0] * other[0] + one[1] * other[1];
}

int assemble_system(const Surface *surface, const Nodes *nodes, const Weights *weights,
                    double shortest, const Linearisation *linearisation, const System *system)
{
    int64_t n = nodes->n;
    for (int64_t i = 0; i < n; i++)
        TRY(linearise_node(surface, nodes, weights, i, linearisation));
    for (int64_t i = 0; i < n; i++) {
        int64_t h = node_before(nodes, i), j = node_after(nodes, i);
        const double *of_h = linearisation->jacobian + 6 * h;
        const double *of_i = linearisation->jacobian + 6 * i;
        const double *of_j = linearisation->jacobian + 6 * j;
        const double *residuals = linearisation->residuals;
        system->bands[i] = dot2(of_h + 4, of_h + 4) + dot2(of_i + 2, of_i + 2) + dot2(of_j, of_j);
        system->bands[n + i] = dot2(of_i + 2, of_i + 4) + dot2(of_j, of_j + 2);
        system->bands[2 * n + i] = dot2(of_j, of_j + 4);
        system->slope[i] = dot2(of_j, residuals + 2 * j) + dot2(of_i + 2, residuals + 2 * i) +
                           dot2(of_h + 4, residuals + 2 * h);
        double phi = nodes->phi_fea[i], drift = linearisation->drift[i];
        if (weights->frozen_ds && phi < 1.0) {
            double pull = weights->feature * weights->frozen_ds[i] * drift;
            system->bands[i] += pull * drift;
            system->slope[i] += pull * phi;
        }
    }
    /* The products of the Jacobian lack a part of the second derivative of the length: the
       stiffness of a taut string. */
    for (int64_t i = 0; i < n; i++) {
        if (!has_step(nodes, i)) continue;
        int64_t j = node_after(nodes, i);
        double length = greater(nodes->step_lengths[i], shortest);
        double stiffness = tension_at(nodes, weights, i) / length;
        /* Without an orientation, moves of two neighbours to the same side may have opposite
           signs. */
        system->bands[i] += stiffness;
        system->bands[j] += stiffness;
        system->bands[n + i] -= side_of_next(nodes, i) * stiffness;
    }
    if (weights->normal_bending > 0.0)
        add_normal_bending(nodes, weights->normal_bending, linearisation->normal_turns, system);
    return OK;
}

int add_contact(const Nodes *nodes, const Contacts *contacts, const Weights *weights,
                const System *system)
{
    for (int64_t p = 0; p < contacts->count; p++) {
        double weight = 2.0 * weights->contact, pull = weight * contacts->overlaps[p];
        for (int end = 0; end < 2; end++) {
            int64_t i = contacts->ends[2 * p + end];
            double approach = contacts->approaches[2 * p + end];
            CHECK(i, nodes->n);
            system->slope[i] += pull * approach;
            system->bands[i] += 2.0 * weight * (approach * approach);
        }
    }
    return OK;
}
