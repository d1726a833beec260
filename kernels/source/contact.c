/* Contacts between strands of a curve. */
#include "contact.h"

#include <string.h>

#define NEARBY 2.0 /* distance, in clearances, within which pairs are kept for short moves */

#define BLOCK 4    /* number of nodes that are compared with other strands at once */

int64_t items_of_contacts(int64_t n, int64_t room)
{
    return 7 * room + 4 * n;
}

int take_contacts(Scratch *scratch, int64_t n, int64_t room, Contacts *contacts)
{
    contacts->room = room;
    contacts->pair_count = contacts->count = 0;
    contacts->reach = -1.0;
    TRY(take(scratch, 3 * n, &contacts->positions));
    TRY(take(scratch, n, &contacts->arcs));
    TRY(take_integers(scratch, 2 * room, &contacts->pairs));
    TRY(take_integers(scratch, 2 * room, &contacts->ends));
    TRY(take(scratch, room, &contacts->overlaps));
    TRY(take(scratch, 2 * room, &contacts->approaches));
    return OK;
}

/* Distance below which the strands of a curve repel. */
static double clearance_of(const Nodes *nodes, const ContactRules *rules)
{
    /* The clearance is positive even if the curve has no length. */
    double least = 0.0;
    for (int64_t i = 0; i < 3 * nodes->n; i++) least = greater(least, fabs(nodes->positions[i]));
    least = greater(rules->rounded * least, TINY);
    return rules->clearance * greater(mean_step(nodes), least);
}

/* The first node from index `j` on that is at most `reach` away from another one, or one after the
   last if none is. `longest` is the greatest step of the curve. */
static int64_t next_close(const Nodes *nodes, const double *arcs, int64_t i, int64_t j,
                          double reach, double longest)
{
    while (j < nodes->n) {
        double distance = distance_between(nodes->positions + 3 * i, nodes->positions + 3 * j);
        double away = distance - reach;
        if (!(away > 0.0)) return j;
        /* No node can be close before the curve has had the length to come back. The factor makes
           up for rounding. */
        away *= 1.0 - 1e-9;
        double least = arcs[j] + away, steps = away / longest;
        j += steps < 1.0 ? 1 : steps > (double)nodes->n ? nodes->n : (int64_t)steps;
        while (j < nodes->n && arcs[j] < least) j++;
    }
    return j;
}

/* The first node from index `j` on that is more than `apart` farther along than node i. */
static int64_t first_apart(const Nodes *nodes, const double *arcs, int64_t i, int64_t j,
                           double apart)
{
    while (j < nodes->n && !(arcs[j] - arcs[i] > apart)) j++;
    return j;
}

/* Whether a node may be close to a later one from the other side of the start of a closed curve. */
static int is_beyond(const Nodes *nodes, const double *arcs, int64_t i, int64_t j, double total,
                     double apart)
{
    return j >= nodes->n || (nodes->closed && !(total - (arcs[j] - arcs[i]) > apart));
}

/* Finds the pairs of nodes that are at most `reach` away, but more than `apart` along the curve. */
static int find_close_pairs(const Nodes *nodes, double reach, double apart, Contacts *contacts)
{
    double *arcs = contacts->arcs, total = 0.0, longest = TINY;
    for (int64_t i = 0; i < nodes->n; i++) {
        arcs[i] = total;
        total += nodes->step_lengths[i];
        longest = greater(longest, nodes->step_lengths[i]);
    }
    contacts->pair_count = 0;
    for (int64_t begin = 0, near = 0, first = 0; begin < nodes->n; begin += BLOCK) {
        /* Mostly no node of a block is close to another strand, as its first node tells. */
        int64_t end = begin + BLOCK < nodes->n ? begin + BLOCK : nodes->n;
        double radius = arcs[end - 1] - arcs[begin];
        near = first_apart(nodes, arcs, begin, near, apart);
        int64_t close = next_close(nodes, arcs, begin, near, reach + radius, longest);
        if (is_beyond(nodes, arcs, begin, close, total + radius, apart)) continue;
        for (int64_t i = begin; i < end; i++) {
            first = first_apart(nodes, arcs, i, first, apart);
            int64_t j = next_close(nodes, arcs, i, first, reach, longest);
            while (!is_beyond(nodes, arcs, i, j, total, apart)) {
                if (contacts->pair_count >= contacts->room) return ARRAY_TOO_SMALL;
                contacts->pairs[2 * contacts->pair_count] = i;
                contacts->pairs[2 * contacts->pair_count + 1] = j;
                contacts->pair_count++;
                j = next_close(nodes, arcs, i, j + 1, reach, longest);
            }
        }
    }
    return OK;
}

int find_contacts(const Nodes *nodes, const ContactRules *rules, Contacts *contacts)
{
    double clearance = clearance_of(nodes, rules), moved = 0.0;
    if (rules->nearby > 1.0 && contacts->reach >= 0.0)
        for (int64_t i = 0; i < nodes->n; i++)
            moved = greater(moved, distance_between(nodes->positions + 3 * i,
                                                    contacts->positions + 3 * i));
    if (contacts->reach < 0.0 ||
        (rules->nearby > 1.0 && 2.0 * moved + clearance > contacts->reach)) {
        contacts->reach = rules->nearby * clearance;
        memcpy(contacts->positions, nodes->positions, 3 * (size_t)nodes->n * sizeof(double));
        TRY(find_close_pairs(nodes, contacts->reach, rules->different_strands * clearance,
                             contacts));
    }
    contacts->count = 0;
    for (int64_t p = 0; p < contacts->pair_count; p++) {
        int64_t i = contacts->pairs[2 * p], j = contacts->pairs[2 * p + 1], at = contacts->count;
        CHECK(i, nodes->n);
        CHECK(j, nodes->n);
        CHECK(at, contacts->room);
        double way[3];
        for (int axis = 0; axis < 3; axis++)
            way[axis] = nodes->positions[3 * i + axis] - nodes->positions[3 * j + axis];
        double distance = greater(length_of(way), TINY);
        if (!(distance < clearance)) continue;
        if (!(dot(nodes->normals + 3 * i, nodes->normals + 3 * j) > rules->same_side)) continue;
        contacts->ends[2 * at] = i;
        contacts->ends[2 * at + 1] = j;
        contacts->overlaps[at] = 1.0 - distance / clearance;
        double scale = distance * clearance;
        contacts->approaches[2 * at] = -dot(way, nodes->conormals + 3 * i) / scale;
        contacts->approaches[2 * at + 1] = dot(way, nodes->conormals + 3 * j) / scale;
        contacts->count++;
    }
    return OK;
}
