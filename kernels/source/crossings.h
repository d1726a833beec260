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

int64_t items_of_crossings(int64_t points);

/* Finds the pairs of segments of a polyline, other than neighbours, that have a common point.

   It returns when all pairs have been found, when there is no room for another one, or after
   `most_work` comparisons; another call continues. `first` is above the number of points when all
   is done. Only the vertices of the faces of the mesh are used.

   touching : distance in barycentric coordinates up to which segments touch */
int find_crossings(const Mesh *mesh, const PointList *points, int64_t closed, double touching,
                   Scratch scratch, int64_t most_work, PairSearch *search);

#endif
