/* Finds where a polyline on a mesh crosses or touches itself. */
#ifndef NICMM_CROSSINGS_H
#define NICMM_CROSSINGS_H

#include "points.h"
#include "scratch.h"

/* Pairs found so far, and where the search goes on. */
typedef struct {
    int64_t room;          /* number of pairs that the array can hold */
    int64_t count;
    int64_t *pairs;        /* (room, 2) */
    int64_t first, second; /* places in the order of the two segments that are compared next */
} PairSearch;

/* s segments, each in a group whose segments all lie in one face. */
typedef struct {
    int64_t s;
    const int64_t *order;  /* (s) the segments, sorted by their groups */
    const int64_t *groups; /* (s) */
    const double *starts;  /* (s, 2) first two barycentric coordinates of the ends in the face */
    const double *ends;    /* (s, 2) */
} Segments;

/* Number of items of scratch that `order_of_groups` takes. */
EXPORTED int64_t order_items(int64_t s);

/* Finds the order, (s), in which segments are sorted by their groups, (s), digit by digit. Segments
   of the same group keep their order. */
EXPORTED int order_of_groups(int64_t s, const int64_t *groups, double *scratch,
                             int64_t scratch_items, int64_t *order);

/* Finds the pairs of segments of one group that have a common point.

   It returns when all pairs have been compared, when there is no room for another one, or after
   `most_work` comparisons; another call continues. Then `first` is s when all is done.

   touching : distance in barycentric coordinates up to which segments touch */
EXPORTED int meeting_segments(const Segments *segments, double touching, int64_t most_work,
                              PairSearch *search);

int64_t items_of_crossings(int64_t points);

/* Finds the pairs of segments of a polyline, other than neighbours, that have a common point.

   It returns when all pairs have been found, when there is no room for another one, or after
   `most_work` comparisons; another call continues. `first` is above the number of points when all
   is done. Only the vertices of the faces of the mesh are used.

   touching : distance in barycentric coordinates up to which segments touch */
int find_crossings(const Mesh *mesh, const PointList *points, int64_t closed, double touching,
                   Scratch scratch, int64_t most_work, PairSearch *search);

#endif
