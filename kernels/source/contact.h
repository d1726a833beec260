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
    double nearby;            /* distance, in clearances, up to which pairs are kept for contacts
                                 after short moves; they are sought again after longer ones. With
                                 1, the same pairs are kept after all moves. */
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
    double reach;       /* distance up to which the pairs were found; below 0 before */
    double *positions;  /* (n, 3) of the nodes at that time */
    double *arcs;       /* (n) scratch */
} Contacts;

int64_t items_of_contacts(int64_t n, int64_t room);
int take_contacts(Scratch *scratch, int64_t n, int64_t room, Contacts *contacts);

/* Finds the contacts of a curve: nodes of different strands that are closer than the clearance, on
   one side of the surface.

   Pairs that may come into contact are found first if `reach` is below 0, and again after moves
   that are too long for them. Whether two nodes are far enough apart along the curve is decided
   then. Returns ARRAY_TOO_SMALL if there is no room for all pairs. */
EXPORTED int find_contacts(const Nodes *nodes, const ContactRules *rules, Contacts *contacts);

#endif
