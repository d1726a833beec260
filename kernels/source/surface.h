/* The surface on which curves move. */
#ifndef NICMM_SURFACE_H
#define NICMM_SURFACE_H

#include "mesh.h"
#include "vectors.h"

typedef struct {
    Mesh mesh;
    const double *vertex_normals; /* (V, 3) unit vectors of arbitrary sign */
    const uint8_t *folded;        /* (F) whether a face is folded back over others; or NULL */
    const double *feature_map;    /* (V) phi_fea at the vertices; or NULL */
    double feature_weight;        /* factor of the map, in 1/length^2; 0 without a map */
    double normal_bending;        /* weight of the normal curvature, squared, in the bending */
} Surface;

/* Vertex normals at the corners of a face, turned to the side of the face. */
static inline int corner_normals(const Surface *surface, int64_t face, double normals[3][3])
{
    const Mesh *mesh = &surface->mesh;
    CHECK(face, mesh->face_count);
    for (int j = 0; j < 3; j++) {
        int64_t vertex;
        TRY(vertex_at(mesh, 3 * face + j, &vertex));
        const double *normal = surface->vertex_normals + 3 * vertex;
        double sign = dot(normal, mesh->face_normals + 3 * face) < 0.0 ? -1.0 : 1.0;
        for (int axis = 0; axis < 3; axis++) normals[j][axis] = sign * normal[axis];
    }
    return OK;
}

/* Weighted sum of phi_fea at the corners of a face; only for surfaces with a map. */
static inline int weighted_feature(const Surface *surface, int64_t face, const double weights[3],
                                   double *sum)
{
    double at_corners[3];
    for (int j = 0; j < 3; j++) {
        int64_t vertex;
        TRY(vertex_at(&surface->mesh, 3 * face + j, &vertex));
        at_corners[j] = surface->feature_map[vertex];
    }
    *sum = dot(weights, at_corners);
    return OK;
}

#endif
