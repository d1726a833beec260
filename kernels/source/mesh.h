/* A triangle mesh, as arrays of the caller. */
#ifndef NICMM_MESH_H
#define NICMM_MESH_H

#include "errors.h"

/* Side 3 f + j is opposite corner j of face f, and runs from corner j + 1 to corner j + 2. */
typedef struct {
    const double *vertices;        /* (V, 3) positions */
    const int64_t *faces;          /* (F, 3) vertices of the corners */
    const double *face_normals;    /* (F, 3) unit vectors; zero where a face has no area */
    const int64_t *opposite_sides; /* (3 F) the same edge in the adjacent face; itself if none */
    int64_t vertex_count;
    int64_t face_count;
    int64_t is_oriented; /* whether no two faces traverse an edge in the same direction */
} Mesh;

static const int FIRST_END[3] = {1, 2, 0}, SECOND_END[3] = {2, 0, 1};

static inline int vertex_at(const Mesh *mesh, int64_t corner, int64_t *vertex)
{
    CHECK(corner, 3 * mesh->face_count);
    *vertex = mesh->faces[corner];
    CHECK(*vertex, mesh->vertex_count);
    return OK;
}

/* Positions of the corners of a face. */
static inline int corners_of(const Mesh *mesh, int64_t face, const double *corners[3])
{
    CHECK(face, mesh->face_count);
    for (int j = 0; j < 3; j++) {
        int64_t vertex;
        TRY(vertex_at(mesh, 3 * face + j, &vertex));
        corners[j] = mesh->vertices + 3 * vertex;
    }
    return OK;
}

/* Vertices at both ends of a side. */
static inline int ends_of(const Mesh *mesh, int64_t side, int64_t *first, int64_t *second)
{
    CHECK(side, 3 * mesh->face_count);
    int64_t corner = side % 3, face_start = side - corner;
    TRY(vertex_at(mesh, face_start + FIRST_END[corner], first));
    TRY(vertex_at(mesh, face_start + SECOND_END[corner], second));
    return OK;
}

/* Expresses a point of one face in another face that contains it. */
static inline int change_face(const Mesh *mesh, int64_t from, const double barycentric[3],
                              int64_t to, double changed[3])
{
    CHECK(from, mesh->face_count);
    CHECK(to, mesh->face_count);
    const int64_t *vertices = mesh->faces + 3 * from, *corners = mesh->faces + 3 * to;
    for (int j = 0; j < 3; j++) {
        changed[j] = 0.0;
        for (int k = 0; k < 3; k++)
            if (vertices[k] == corners[j]) changed[j] += barycentric[k];
    }
    return OK;
}

#endif
