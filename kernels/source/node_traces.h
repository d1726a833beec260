/* Straight traces between the nodes of curves. */
#ifndef NICMM_NODE_TRACES_H
#define NICMM_NODE_TRACES_H

#include "nodes.h"
#include "tracing.h"

/* What all traces between nodes have in common. */
typedef struct {
    const int64_t *faces;      /* (n) faces of the nodes */
    const double *barycentric; /* (n, 3) coordinates in them; those of starts strictly inside */
    double detour;             /* greatest length of a trace, relative to the distance of nodes */
    double fold_margin;        /* length allowed before backward parts over folds are subtracted */
    int64_t most_faces;        /* number of faces after which a trace ends */
} NodePlaces;

/* Traces from a node to the next one or the previous one, in the plane that contains the mean
   normal of both nodes, or else in the one that contains the mean direction of the curve before and
   after the step. Its crossings are added if it reaches its end. `work` is raised by the number of
   faces passed. */
int trace_step(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
               int64_t per_curve, int64_t from, int64_t to, PointList *crossings, uint8_t *reached,
               int64_t *work);

/* The polyline of a curve of n nodes, and what is known about it. */
typedef struct {
    const uint8_t *is_control;   /* (n) control points, which need not lie strictly inside faces */
    const uint8_t *kept;         /* (n) nodes after which the former polyline is kept */
    const int64_t *former_index; /* (n) index of each node in the former polyline, ascending */
    int64_t former_count;
    const int64_t *former_faces; /* (former_count) faces of the segments of the former polyline */
    const double *former_places; /* (former_count, 3) coordinates of its points in them */
    int64_t before;              /* number of points that earlier calls have found */
    int64_t *node_index;         /* (n) becomes the index of each node in the polyline */
    uint8_t *lost;               /* (n) becomes whether the trace to the next node failed */
} TracedPolyline;

/* Traces a polyline through the nodes of a curve, from the node of index `done` on.

   Where a trace fails, the polyline has no points between the two nodes. The call returns early
   when the traces have passed `most_work` faces, or when the room that is left may not suffice for
   another piece; `done` is raised to the number of nodes that have been passed. */
EXPORTED int trace_polyline(const Surface *surface, const NodePlaces *places, const Nodes *nodes,
                            const TracedPolyline *polyline, PointList *points, int64_t most_work,
                            int64_t *done);

#endif
