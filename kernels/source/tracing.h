/* Straight traces over the faces of a mesh. */
#ifndef NICMM_TRACING_H
#define NICMM_TRACING_H

#include "points.h"

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

/* A trace from a point to another one. */
typedef struct {
    int64_t start_face;
    const double *start;  /* (3) barycentric coordinates in this face, strictly inside */
    int64_t end_face;
    const double *end;    /* (3) barycentric coordinates in this face */
    const double *normal; /* (3) vector in the plane of the trace, besides that to the end */
    const double *ahead;  /* (3) direction in which the trace leaves; NULL for that to the end */
    double longest;       /* greatest length up to the face of the end */
    double fold_margin;   /* length allowed before backward parts over folds are subtracted */
} TraceRequest;

/* Traces from one point to another. Its crossings are added if it reaches its end; there has to be
   room for `most_faces` of them. `passed` is raised by the number of faces passed. */
int trace_to(const Mesh *mesh, const uint8_t *folded, int64_t most_faces,
             const TraceRequest *request, PointList *crossings, uint8_t *reached, int64_t *passed);

#endif
