/* Straight traces over the faces of a mesh. */
#ifndef NICMM_TRACING_H
#define NICMM_TRACING_H

#include "mesh.h"

typedef struct {
    double least_inside; /* least barycentric coordinate of a point strictly inside its face */
    int64_t most_faces;  /* number of faces after which a trace ends */
} TraceLimits;

/* Moves a point straight along the surface by a length that is not negative.

   `folded`, (F) or NULL, tells which faces are folded back over their neighbours; over them a trace
   runs backward. `blocked` becomes whether the point stopped at a boundary; `most_passed` is raised
   to the number of faces passed. */
int move_point(const Mesh *mesh, const uint8_t *folded, const TraceLimits *limits,
               const double direction[3], double length, int64_t *face, double barycentric[3],
               uint8_t *blocked, int64_t *most_passed);

#endif
