/* Exact distances along the surface from segments that lie in faces. */
#ifndef NICMM_SEGMENT_DISTANCES_H
#define NICMM_SEGMENT_DISTANCES_H

#include "mesh.h"

typedef struct {
    double x, y;
} Vector;

/* An interval of an edge, seen from a segment in the plane of the face beyond the edge. The edge
   runs along the x axis, from the first end of the side, at the origin, to the second one. The face
   beyond has y > 0, the segment y <= 0. */
typedef struct {
    Vector start, end;          /* of the segment, equal for a point */
    double before;              /* distance of the segment itself */
    double from, to;            /* arc lengths on the curve at the start and the end */
    double side;                /* 1 to the left of the curve, -1 to the right */
    double low, high;           /* ends of the interval */
    Vector at_low, at_high;     /* directions of the lines through these ends */
} Window;

typedef struct {
    /* Input. */
    int64_t s;                  /* number of segments */
    const int64_t *faces;       /* (s) face of each */
    const double *starts;       /* (s, 3) barycentric coordinates of its ends */
    const double *ends;
    const int64_t *previous;    /* (s) the segment that ends where it begins, or -1 */
    const int64_t *following;   /* (s) the segment that begins where it ends, or -1 */
    const double *arcs;         /* (s, 2) arc lengths at both ends */
    double limit;
    double scale;               /* distance below which points are the same */
    /* Output. */
    double *distances;          /* (V) of the vertices; infinite at first */
    int64_t room;
    int64_t count;              /* number of windows */
    int64_t *sides;             /* (room) side of the face beyond; -1 for a useless window */
    Window *windows;            /* (room) */
    double *feet;               /* (V) arc lengths at which the paths to the vertices begin */
    double *beside;             /* (V) side of the curve on which they lie; 0 on the curve */
    double *outer;              /* (s, 2) outer side of a sharp bend at each end; 0 without one */
    int64_t k;                  /* number of knots; 0 if all widths are equal */
    const double *knots;        /* (k) arc lengths, ascending */
    const double *widths;       /* (k) widths there, linear in between */
    double least_width;
    /* Work in progress. */
    int64_t *corners;           /* (V) the corner at which the path to each vertex arrives */
    double *arrivals;           /* (V) angle there from the first end of the side opposite to it to
                                   the path, in the face */
    int64_t *leaving;           /* (V) the segment that begins at each vertex; -1 at first */
    int64_t *arriving;          /* (V) the segment that ends there; -1 at first */
    int64_t queued;             /* number of items in the queue: vertices, then windows */
    double *costs;              /* (V + room) */
    int64_t *items;
    int64_t *places;            /* -1 at first */
} Propagation;

/* The nearest place of the curve to a point. */
typedef struct {
    double distance;
    double arc;  /* arc length at which the path begins */
    double side; /* of the curve on which it lies: 1 left, -1 right, 0 unknown */
} Nearest;

/* The nearest place to a point of a face, from windows in the order of their sides and segments in
   that of their faces. Greater distances than the limit may be too great. */
int nearest_to_point(const Mesh *mesh, const Propagation *found, int64_t face,
                     const double weights[3], Nearest *nearest);

/* The distance of a point, relative to the width of the curve at the nearest place, in units of the
   least width. Without widths it is the distance itself. */
int scaled_distance(const Mesh *mesh, const Propagation *found, int64_t face,
                    const double weights[3], double *distance);

#endif
