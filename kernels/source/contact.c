/* Contacts between strands of a curve. */
#include "contact.h"

int64_t items_of_contacts(int64_t room)
{
    return 7 * room;
}

int take_contacts(Scratch *scratch, int64_t room, Contacts *contacts)
{
    contacts->room = room;
    contacts->pair_count = contacts->count = 0;
    TRY(take_integers(scratch, 2 * room, &contacts->pairs));
    TRY(take_integers(scratch, 2 * room, &contacts->ends));
    TRY(take(scratch, room, &contacts->overlaps));
    TRY(take(scratch, 2 * room, &contacts->approaches));
    return OK;
}

double clearance_of(const Nodes *nodes, const ContactRules *rules)
{
    /* The clearance is positive even if the curve has no length. */
    double least = 0.0;
    for (int64_t i = 0; i < 3 * nodes->n; i++) least = greater(least, fabs(nodes->positions[i]));
    least = greater(rules->rounded * least, TINY);
    return rules->clearance * greater(mean_step(nodes), least);
}

int find_close_pairs(const Nodes *nodes, const ContactRules *rules, double reach, double *arcs,
                     Contacts *contacts)
{
    double clearance = clearance_of(nodes, rules), total = 0.0, longest = TINY;
    for (int64_t i = 0; i < nodes->n; i++) {
        arcs[i] = total;
        total += nodes->step_lengths[i];
        longest = greater(longest, nodes->step_lengths[i]);
    }
    double apart = rules->different_strands * clearance, per_step = 1.0 / longest;
    contacts->pair_count = 0;
    for (int64_t i = 0, first = 0; i < nodes->n; i++) {
        while (first < nodes->n && !(arcs[first] - arcs[i] > apart)) first++;
        for (int64_t j = first; j < nodes->n;) {
            if (nodes->closed && !(total - (arcs[j] - arcs[i]) > apart)) break;
            double distance = distance_between(nodes->positions + 3 * i, nodes->positions + 3 * j);
            double away = distance - reach * clearance;
            if (away > 0.0) {
                /* No node can be close before the curve has had the length to come back. The
                   factor makes up for rounding. */
                away *= 1.0 - 1e-9;
                double least = arcs[j] + away, steps = away * per_step;
                j += steps < 1.0 ? 1 : steps > (double)nodes->n ? nodes->n : (int64_t)steps;
                while (j < nodes->n && arcs[j] < least) j++;
            } else {
                if (contacts->pair_count >= contacts->room) return ARRAY_TOO_SMALL;
                contacts->pairs[2 * contacts->pair_count] = i;
                contacts->pairs[2 * contacts->pair_count + 1] = j;
                contacts->pair_count++;
                j++;
            }
        }
    }
    return OK;
}

int find_contacts(const Nodes *nodes, const ContactRules *rules, Contacts *contacts)
{
    double clearance = clearance_of(nodes, rules);
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
