/* Points on the faces of a mesh, in order along polylines and traces. */
#ifndef NICMM_POINTS_H
#define NICMM_POINTS_H

#include <string.h>

#include "mesh.h"
#include "vectors.h"

typedef struct {
    int64_t room;        /* number of points that the arrays can hold */
    int64_t count;       /* number of points that they hold */
    int64_t *faces;      /* (room) face of the segment after each point */
    double *barycentric; /* (room, 3) the point, in this face */
} PointList;

static inline int append_point(int64_t face, const double *barycentric, PointList *points)
{
    if (points->count >= points->room) return ARRAY_TOO_SMALL;
    points->faces[points->count] = face;
    memcpy(points->barycentric + 3 * points->count, barycentric, 3 * sizeof *barycentric);
    points->count++;
    return OK;
}

static inline int position_in_face(const Mesh *mesh, int64_t face, const double *barycentric,
                                   double position[3])
{
    const double *corners[3];
    TRY(corners_of(mesh, face, corners));
    interpolate(corners, barycentric, position);
    return OK;
}

/* Index of the last of some ascending arc lengths, from index `first` up to `end`, that is not
   above a wanted one; at most that of the last but one. */
static inline int64_t segment_at(const double *arcs, int64_t first, int64_t end, double wanted)
{
    int64_t low = first, high = end - 1; /* it is `low` or later, before `high` */
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (arcs[middle] <= wanted)
            low = middle;
        else
            high = middle;
    }
    return low;
}

#endif
