/* Contacts between strands of a curve, for the energy term that repels the strands. */
#ifndef NICMM_CONTACT_H
#define NICMM_CONTACT_H

#include "nodes.h"

typedef struct {
    double clearance;         /* distance below which strands repel, in mean steps of the curve */
    double different_strands; /* distance along the curve above which nodes are on different ones,
                                 in clearances */
    double same_side;         /* least cosine between the normals of two nodes in contact */
    double rounded;           /* least mean step, relative to the greatest coordinate */
} ContactRules;

/* Pairs of nodes that may be in contact, and the contacts among them. */
typedef struct {
    int64_t room;       /* number of pairs that the arrays can hold */
    int64_t pair_count;
    int64_t *pairs;     /* (room, 2) */
    int64_t count;
    int64_t *ends;      /* (room, 2) nodes in contact */
    double *overlaps;   /* (room) 1 - distance / clearance */
    double *approaches; /* (room, 2) derivatives of the overlap by the moves of both nodes */
} Contacts;

int64_t items_of_contacts(int64_t room);
int take_contacts(Scratch *scratch, int64_t room, Contacts *contacts);

/* Distance below which the strands of a curve repel. */
double clearance_of(const Nodes *nodes, const ContactRules *rules);

/* Finds the pairs of nodes that are at most `reach` clearances apart, but far along the curve.
   `arcs`, (n), is scratch. Returns ARRAY_TOO_SMALL if there is no room for all of them. */
EXPORTED int find_close_pairs(const Nodes *nodes, const ContactRules *rules, double reach,
                              double *arcs, Contacts *contacts);

/* Finds the contacts among the pairs: closer than the clearance, on one side of the surface. */
EXPORTED int find_contacts(const Nodes *nodes, const ContactRules *rules, Contacts *contacts);

#endif
