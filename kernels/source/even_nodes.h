/* Spaces the nodes of a curve evenly between its fixed nodes. */
#ifndef NICMM_EVEN_NODES_H
#define NICMM_EVEN_NODES_H

#include "nodes.h"
#include "tracing.h"

typedef struct {
    double nodes_per_radian; /* additional nodes per radian by which the normals turn */
    double short_move;       /* move below which a node stays, in mean steps of the curve */
} SpacingRules;

int64_t items_of_even_nodes(int64_t n);

/* Moves nodes so that they are evenly spaced along the straight lines between them; closer together
   where the normals turn, as around the edge of a thin part. The first node has to be fixed.

   `spaced` become the moved nodes; `work` is raised by the number of faces that they pass. */
int space_evenly(const Surface *surface, const TraceLimits *limits, const SpacingRules *rules,
                 const Nodes *nodes, const uint8_t *fixed, Scratch scratch, const Nodes *spaced,
                 int64_t *work);

#endif
