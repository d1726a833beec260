/* Bisects triangles near a line at a constant distance until linear functions resolve it.

   A triangle is bisected at its longest side. First the triangle beyond this side is, unless it has
   the same longest side; so the mesh stays conforming, as with the longest-edge propagation paths
   of Rivara ("New longest-edge algorithms for the refinement and/or improvement of unstructured
   triangulations", 1997). */
#include <math.h>
#include <string.h>

#include "segment_distances.h"
#include "vectors.h"

typedef struct {
    int64_t face_room, face_count;
    int64_t *faces;    /* (face_room, 3) vertices of the triangles, parts of faces of the mesh */
    int64_t *opposite; /* (3 face_room) the same edge in the adjacent triangle; itself if none */
    int64_t *parents;  /* (face_room) face of the mesh that contains each triangle */
    double *corners;   /* (face_room, 3, 3) barycentric coordinates of the corners there */
    int64_t vertex_room, vertex_count;
    double *vertices;  /* (vertex_room, 3) */
    double *distances; /* (vertex_room) */
    uint8_t *fixed;    /* (vertex_room) a side between two such vertices stays */
    const uint8_t *reached; /* (F) faces of the mesh within the limit of the distances */
    double level;      /* distance of the line */
    double clearance;
    double coarsest;   /* greatest length of the longest side of a triangle at the line */
    double finest;     /* length of it up to which any triangle is accurate enough */
    double error;      /* greatest error of interpolated distances */
    int64_t *pending;  /* (face_room) triangles that may have to be bisected, as a stack */
    uint8_t *is_pending; /* (face_room) */
    int64_t pending_count;
} Refinement;

static int push(Refinement *parts, int64_t face)
{
    if (parts->is_pending[face]) return OK;
    CHECK(parts->pending_count, parts->face_room);
    parts->pending[parts->pending_count++] = face;
    parts->is_pending[face] = 1;
    return OK;
}

static int part_corner(const Refinement *parts, int64_t corner, int64_t *vertex)
{
    CHECK(corner, 3 * parts->face_count);
    *vertex = parts->faces[corner];
    CHECK(*vertex, parts->vertex_count);
    return OK;
}

/* The longest side of a triangle that may be bisected, -1 if all sides stay. Of sides of equal
   length, it is the same one in both triangles. */
static int longest_side(const Refinement *parts, int64_t face, int64_t *side, double *length)
{
    int64_t of_longest[2] = {0, 0};
    *side = -1;
    *length = 0.0;
    for (int64_t j = 0; j < 3; j++) {
        int64_t low, high, swapped;
        TRY(part_corner(parts, 3 * face + FIRST_END[j], &low));
        TRY(part_corner(parts, 3 * face + SECOND_END[j], &high));
        if (low > high) {
            swapped = low;
            low = high;
            high = swapped;
        }
        double own = distance_between(parts->vertices + 3 * low, parts->vertices + 3 * high);
        *length = greater(*length, own);
        if (parts->fixed[low] && parts->fixed[high]) continue;
        double before = *side < 0 ? -1.0 : distance_between(parts->vertices + 3 * of_longest[0],
                                                            parts->vertices + 3 * of_longest[1]);
        int is_longer = own > before;
        if (own == before)
            is_longer = low > of_longest[0] || (low == of_longest[0] && high > of_longest[1]);
        if (!is_longer) continue;
        *side = 3 * face + j;
        of_longest[0] = low;
        of_longest[1] = high;
    }
    return OK;
}

/* Divides one triangle at a vertex on a side. The triangle keeps the first end of the side; the new
   one, at the end of the list, has the second end. Sides along the divided one have no neighbour
   yet. */
static int divide(Refinement *parts, int64_t side, int64_t vertex)
{
    CHECK(side, 3 * parts->face_count);
    int64_t own = side % 3, face = side / 3, added = parts->face_count;
    CHECK(added, parts->face_room);
    int first = FIRST_END[own], second = SECOND_END[own];
    double *corners = parts->corners + 9 * face, *of_added = parts->corners + 9 * added;
    memcpy(parts->faces + 3 * added, parts->faces + 3 * face, 3 * sizeof *parts->faces);
    memcpy(of_added, corners, 9 * sizeof *corners);
    parts->parents[added] = parts->parents[face];
    parts->is_pending[added] = 0;
    for (int i = 0; i < 3; i++) {
        double middle = 0.5 * (corners[3 * first + i] + corners[3 * second + i]);
        corners[3 * second + i] = of_added[3 * first + i] = middle;
    }
    parts->faces[3 * face + second] = parts->faces[3 * added + first] = vertex;
    parts->face_count++;
    int64_t beyond = parts->opposite[3 * face + first], outer = 3 * added + first;
    CHECK(beyond, 3 * parts->face_count);
    parts->opposite[outer] = beyond == 3 * face + first ? outer : beyond;
    if (beyond != 3 * face + first) parts->opposite[beyond] = outer;
    parts->opposite[3 * face + first] = 3 * added + second;
    parts->opposite[3 * added + second] = 3 * face + first;
    parts->opposite[side] = side;
    parts->opposite[3 * added + own] = 3 * added + own;
    TRY(push(parts, face));
    return push(parts, added);
}

static void join(Refinement *parts, int64_t one, int64_t other)
{
    parts->opposite[one] = other;
    parts->opposite[other] = one;
}

/* Bisects a side, and the triangles on both sides of it. */
static int bisect(const Mesh *mesh, const Propagation *found, Refinement *parts, int64_t side)
{
    if (parts->face_count + 2 > parts->face_room || parts->vertex_count + 1 > parts->vertex_room)
        return ARRAY_TOO_SMALL;
    int64_t own = side % 3, face = side / 3, beyond = parts->opposite[side], first, second, start;
    TRY(part_corner(parts, 3 * face + FIRST_END[own], &first));
    TRY(part_corner(parts, 3 * face + SECOND_END[own], &second));
    int64_t vertex = parts->vertex_count++, added = parts->face_count;
    for (int i = 0; i < 3; i++)
        parts->vertices[3 * vertex + i] =
            0.5 * (parts->vertices[3 * first + i] + parts->vertices[3 * second + i]);
    parts->fixed[vertex] = 0;
    TRY(divide(parts, side, vertex));
    TRY(scaled_distance(mesh, found, parts->parents[face],
                        parts->corners + 9 * face + 3 * SECOND_END[own],
                        parts->distances + vertex));
    if (beyond == side) return OK;
    CHECK(beyond, 3 * added);
    int64_t added_beyond = parts->face_count;
    TRY(part_corner(parts, beyond - beyond % 3 + FIRST_END[beyond % 3], &start));
    TRY(divide(parts, beyond, vertex));
    int64_t other = 3 * added_beyond + beyond % 3;
    join(parts, side, start == first ? beyond : other);
    join(parts, 3 * added + own, start == first ? other : beyond);
    return OK;
}

/* Bisects sides until a triangle is bisected; counts them. */
static int bisect_face(const Mesh *mesh, const Propagation *found, Refinement *parts, int64_t face,
                       int64_t *work)
{
    int64_t present = face, side, beyond, longest, steps = 0;
    double length;
    for (;;) {
        TRY(longest_side(parts, present, &side, &length));
        if (side < 0) return OK;
        beyond = parts->opposite[side];
        CHECK(beyond, 3 * parts->face_count);
        TRY(longest_side(parts, beyond / 3, &longest, &length));
        ++*work;
        /* The sides become longer and longer, so this ends on a sound mesh. */
        if (beyond != side && longest != beyond && steps++ < parts->face_count) {
            present = beyond / 3;
            continue;
        }
        TRY(bisect(mesh, found, parts, side));
        if (present == face || beyond / 3 == face) return OK;
        present = face;
    }
}

/* Whether a triangle is accurate: interpolated distances are correct at its centroid and in the
   middle of its sides. */
static int is_accurate(const Mesh *mesh, const Propagation *found, const Refinement *parts,
                       int64_t face, const double at_corners[3], int *result)
{
    static const double SHARES[4][3] = {
        {0.0, 0.5, 0.5}, {0.5, 0.0, 0.5}, {0.5, 0.5, 0.0}, {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0}};
    const double *corners = parts->corners + 9 * face;
    *result = 1;
    for (int k = 0; k < 4 && *result; k++) {
        double weights[3], exact;
        for (int i = 0; i < 3; i++)
            weights[i] = SHARES[k][0] * corners[i] + SHARES[k][1] * corners[3 + i] +
                         SHARES[k][2] * corners[6 + i];
        TRY(scaled_distance(mesh, found, parts->parents[face], weights, &exact));
        *result = fabs(dot(SHARES[k], at_corners) - exact) <= parts->error;
    }
    return OK;
}

/* Whether a triangle has to be bisected. */
static int is_coarse(const Mesh *mesh, const Propagation *found, const Refinement *parts,
                     int64_t face, int *result)
{
    int64_t side;
    double longest, at_corners[3], least = INFINITY, most = 0.0;
    *result = 0;
    CHECK(parts->parents[face], mesh->face_count);
    if (!parts->reached[parts->parents[face]]) return OK;
    TRY(longest_side(parts, face, &side, &longest));
    if (side < 0 || longest <= parts->finest) return OK;
    for (int j = 0; j < 3; j++) {
        int64_t vertex;
        TRY(part_corner(parts, 3 * face + j, &vertex));
        at_corners[j] = parts->distances[vertex];
        least = lesser(least, at_corners[j]);
        most = greater(most, at_corners[j]);
    }
    /* In a small triangle, the line may cross a side without enclosing an end of it; if it is an
       arc about a point, it reaches this far into the triangle. */
    int is_large = longest > parts->coarsest;
    double margin = is_large ? longest : longest * longest / (8.0 * parts->clearance);
    if (least > parts->level + margin || most < parts->level - margin) return OK;
    if (!is_large) TRY(is_accurate(mesh, found, parts, face, at_corners, result));
    *result = !*result;
    return OK;
}

/* Bisects triangles near the line, in calls of about `most_work` triangles each. The triangles that
   are pending at first are those that may have to be. It returns ARRAY_TOO_SMALL, and may be called
   again, if there is no room.

   done : 0 at first; 1 after the last call */
EXPORTED int refine_at_level(const Mesh *mesh, const Propagation *found, Refinement *parts,
                             int64_t most_work, int64_t *done)
{
    int64_t work = 0;
    while (work < most_work) {
        if (parts->pending_count == 0) {
            *done = 1;
            return OK;
        }
        int64_t face = parts->pending[parts->pending_count - 1];
        CHECK(face, parts->face_count);
        int coarse;
        work++;
        TRY(is_coarse(mesh, found, parts, face, &coarse));
        if (coarse) {
            TRY(bisect_face(mesh, found, parts, face, &work));
            continue; /* it is looked at again; so are the triangles that it was divided into */
        }
        parts->is_pending[face] = 0;
        parts->pending_count--;
    }
    return OK;
}
