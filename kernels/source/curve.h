/* A curve as a polyline on the mesh, with nodes that move it. */
#ifndef NICMM_CURVE_H
#define NICMM_CURVE_H

#include "nodes.h"
#include "points.h"

/* Each segment of the polyline lies in one face. The nodes are points of the polyline, or have
   moved away from it since it was traced. */
typedef struct {
    int64_t room;        /* number of nodes that the arrays can hold */
    int64_t n;
    int64_t closed;
    int64_t *faces;      /* (room) faces of the nodes */
    double *barycentric; /* (room, 3) coordinates in them; positive except at control points */
    uint8_t *is_control; /* (room) whether each node is a control point; the first one is */
    uint8_t *is_corner;  /* (room) control points at which the curve may turn freely */
    uint8_t *is_stuck;   /* (room) nodes that must not move, as they could not be retraced, or have
                            reached a boundary */
    double *positions;   /* (room, 3) of the nodes; only results have them */
    int64_t *node_index; /* (room) index of each node in the polyline, ascending */
    PointList polyline;
} Curve;

typedef struct {
    double least_inside;    /* least barycentric coordinate of a point strictly inside its face */
    double same_place;      /* distance within which a node replaces a point of the polyline,
                               relative to the length of the curve */
    double reach;           /* length of curve on either side over which its direction is measured
                               at folds, in mesh units */
    double shortest_turn;   /* upper limit of that, relative to the length of the curve */
    int64_t fewest_of_leg;  /* least number of nodes on a leg */
} PlacementRules;

int64_t items_of_placement(int64_t n, int64_t points);

/* Arc lengths, (points + 1), at the points of a polyline, and at the end of a closed one. */
int find_arcs_of_points(const Mesh *mesh, const PointList *points, int64_t closed, double *arcs);

/* Places evenly spaced nodes on a polyline, with the control points among them.

   The polyline keeps its shape: nodes are inserted, and points inside faces are dropped only where
   a node is. `controls`, (k), are the indices of the control points in the polyline, ascending; the
   first one is 0. `corners`, (k), tells at which of them the curve may turn freely. `count` is the
   approximate number of nodes. */
int place_on_polyline(const Surface *surface, const PlacementRules *rules, const PointList *points,
                      int64_t closed, int64_t k, const int64_t *controls, const uint8_t *corners,
                      int64_t count, Scratch scratch, Curve *placed);

int copy_curve(const Curve *from, Curve *to);

#endif
