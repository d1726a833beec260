/* Measures of the faces and edges of a mesh, and connected components of a graph. */
#include "errors.h"
#include "vectors.h"

typedef struct {
    int64_t vertex_count;
    const double *vertices; /* (V, 3) positions */
} Vertices;

static int vertex_of(const Vertices *mesh, int64_t vertex, const double **position)
{
    CHECK(vertex, mesh->vertex_count);
    *position = mesh->vertices + 3 * vertex;
    return OK;
}

/* Computes the normals of faces, (count, 3), whose lengths are twice the areas. */
EXPORTED int area_vectors(const Vertices *mesh, int64_t count, const int64_t *faces,
                          double *vectors)
{
    for (int64_t face = 0; face < count; face++) {
        const double *corners[3];
        double one[3], other[3];
        for (int j = 0; j < 3; j++) TRY(vertex_of(mesh, faces[3 * face + j], corners + j));
        for (int axis = 0; axis < 3; axis++) {
            one[axis] = corners[1][axis] - corners[0][axis];
            other[axis] = corners[2][axis] - corners[0][axis];
        }
        cross(one, other, vectors + 3 * face);
    }
    return OK;
}

/* Computes the lengths of edges, (count, 2). */
EXPORTED int edge_lengths(const Vertices *mesh, int64_t count, const int64_t *edges,
                          double *lengths)
{
    for (int64_t edge = 0; edge < count; edge++) {
        const double *start, *end;
        TRY(vertex_of(mesh, edges[2 * edge], &start));
        TRY(vertex_of(mesh, edges[2 * edge + 1], &end));
        lengths[edge] = distance_between(end, start);
    }
    return OK;
}

/* The first node of the part of a component that is known so far. It halves the path there. */
static int64_t root_of(int64_t *parent, int64_t node)
{
    while (parent[node] != node) {
        parent[node] = parent[parent[node]];
        node = parent[node];
    }
    return node;
}

/* Joins the components of the two ends of arcs, (count) each.

   parent : (size) a node of the same component that is not after each node; at first the node
            itself */
EXPORTED int join_components(int64_t size, int64_t count, const int64_t *one, const int64_t *other,
                             int64_t *parent)
{
    for (int64_t arc = 0; arc < count; arc++) {
        CHECK(one[arc], size);
        CHECK(other[arc], size);
        int64_t first = root_of(parent, one[arc]), second = root_of(parent, other[arc]);
        if (first < second)
            parent[second] = first;
        else
            parent[first] = second;
    }
    return OK;
}

/* Numbers the components in the order of their first nodes. `parent` becomes the index of the
   component of each node, and `number` that of components. */
EXPORTED int number_components(int64_t size, int64_t *parent, int64_t *number)
{
    *number = 0;
    for (int64_t node = 0; node < size; node++) {
        CHECK(parent[node], node + 1);
        parent[node] = parent[node] == node ? (*number)++ : parent[parent[node]];
    }
    return OK;
}
