/* Flips the diagonals of nearly flat quadrilaterals of a mesh towards a Delaunay triangulation. */
#include "arc_tangent.h"
#include "scratch.h"
#include "vectors.h"

/* A mesh whose faces change. Side 3 f + j is opposite corner j of face f. */
typedef struct {
    int64_t vertex_count, face_count;
    const double *vertices; /* (V, 3) positions */
    int64_t *valences;      /* (V) number of faces at each vertex */
    int64_t *faces;         /* (F, 3) */
    int64_t *opposites;     /* (3 F) same edge as a side of the next face, or the side itself */
} FlippedMesh;

/* When an edge is flipped. */
typedef struct {
    double flattest; /* least cosine between normals of the faces before and after the flip */
    double tie;      /* difference of the sums of opposite angles, in radians, that decides */
} FlipRules;

/* The sides whose edges are yet to be checked, as a ring. */
typedef struct {
    int64_t first, count, flips; /* `flips` counts all of them */
    int64_t *sides;              /* (3 F) */
    uint8_t *waits;              /* (3 F) whether each side is in the ring */
} Waiting;

/* A quadrilateral: its corners in order, and its outer sides, each after the corner of the same
   index. Its diagonal goes from corner 1 to corner 3. */
typedef struct {
    int64_t face, other; /* with the corners 0, 1, 3 and 2, 3, 1 */
    int64_t corners[4], sides[4];
} Quadrilateral;

static int64_t next_in_face(int64_t side, int64_t step)
{
    return side / 3 * 3 + (side + step) % 3;
}

static void add(Waiting *waiting, int64_t size, int64_t side)
{
    if (waiting->waits[side]) return;
    waiting->waits[side] = 1;
    waiting->sides[(waiting->first + waiting->count++) % size] = side;
}

/* The quadrilateral of the two faces at a side; `found` is 0 at a boundary, where the orientations
   of both faces differ, and where they share two edges. */
static int quadrilateral_at(const FlippedMesh *mesh, int64_t side, Quadrilateral *quad, int *found)
{
    int64_t across = mesh->opposites[side];
    CHECK(across, 3 * mesh->face_count);
    *found = 0;
    quad->face = side / 3, quad->other = across / 3;
    if (quad->face == quad->other) return OK;
    quad->corners[0] = mesh->faces[side];
    quad->corners[1] = mesh->faces[next_in_face(side, 1)];
    quad->corners[2] = mesh->faces[across];
    quad->corners[3] = mesh->faces[next_in_face(side, 2)];
    if (mesh->faces[next_in_face(across, 1)] != quad->corners[3] ||
        mesh->faces[next_in_face(across, 2)] != quad->corners[1] ||
        quad->corners[0] == quad->corners[2])
        return OK;
    quad->sides[0] = next_in_face(side, 2), quad->sides[1] = next_in_face(across, 1);
    quad->sides[2] = next_in_face(across, 2), quad->sides[3] = next_in_face(side, 1);
    for (int j = 0; j < 4; j++) {
        CHECK(quad->corners[j], mesh->vertex_count);
        int64_t beyond = mesh->opposites[quad->sides[j]];
        CHECK(beyond, 3 * mesh->face_count);
        int64_t face = beyond / 3;
        if (beyond != quad->sides[j] && (face == quad->face || face == quad->other)) return OK;
    }
    *found = 1;
    return OK;
}

static int unit_normal(const double *one, const double *two, const double *three, double *normal)
{
    double first[3], second[3];
    for (int axis = 0; axis < 3; axis++) {
        first[axis] = two[axis] - one[axis];
        second[axis] = three[axis] - one[axis];
    }
    cross(first, second, normal);
    double length = length_of(normal);
    for (int axis = 0; axis < 3; axis++) normal[axis] /= greater(length, TINY);
    return length > 0.0;
}

/* Whether the triangles on both diagonals all have about the same normal. */
static int is_flat(const double *const corners[4], double flattest)
{
    double normals[4][3];
    for (int j = 0; j < 4; j++)
        if (!unit_normal(corners[(j + 3) % 4], corners[j], corners[(j + 1) % 4], normals[j]))
            return 0;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++)
            if (!(dot(normals[i], normals[j]) >= flattest)) return 0;
    return 1;
}

/* Angle at a corner of a quadrilateral. */
static double angle_at(const double *const corners[4], int corner)
{
    double one[3], other[3], normal[3];
    for (int axis = 0; axis < 3; axis++) {
        one[axis] = corners[(corner + 1) % 4][axis] - corners[corner][axis];
        other[axis] = corners[(corner + 3) % 4][axis] - corners[corner][axis];
    }
    cross(one, other, normal);
    return angle_of(length_of(normal), dot(one, other));
}

/* Whether the other diagonal, from corner 0 to corner 2, is better by the sums of the angles
   opposite both or, if the sums are about equal, by the vertex of least index. The angles are those
   of the quadrilateral in space, so the answer does not depend on the present diagonal. */
static int is_better(const FlippedMesh *mesh, const Quadrilateral *quad, const FlipRules *rules)
{
    const double *corners[4];
    for (int j = 0; j < 4; j++) corners[j] = mesh->vertices + 3 * quad->corners[j];
    if (!is_flat(corners, rules->flattest)) return 0;
    double excess = angle_at(corners, 0) + angle_at(corners, 2) - angle_at(corners, 1) -
                    angle_at(corners, 3);
    if (!(fabs(excess) <= rules->tie)) return excess > 0.0;
    int least = 0;
    for (int j = 1; j < 4; j++)
        if (quad->corners[j] < quad->corners[least]) least = j;
    return least % 2 == 0;
}

/* Whether the corner opposite a side may get an edge to another vertex: all faces at the corner are
   connected by edges, and none has the other vertex. `work` is raised by the number of faces. */
static int may_join(const FlippedMesh *mesh, int64_t side, int64_t other, int64_t *work, int *may)
{
    int64_t vertex = mesh->faces[side], count = 1;
    CHECK(vertex, mesh->vertex_count);
    *may = 0;
    /* In one direction around the vertex and, if that ends at a boundary, in the other one. */
    for (int direction = 1, is_around = 0; direction <= 2 && !is_around; direction++) {
        int64_t at = next_in_face(side, direction), across = mesh->opposites[at];
        while (across != at && !is_around) {
            int64_t corner = -1;
            CHECK(across, 3 * mesh->face_count);
            is_around = across / 3 == side / 3;
            for (int64_t step = 0; step < 3 && !is_around; step++) {
                int64_t here = next_in_face(across, step);
                if (mesh->faces[here] == other) return OK;
                if (mesh->faces[here] == vertex) corner = here;
            }
            if (is_around) break;
            if (corner < 0 || corner == across || ++count > mesh->valences[vertex]) return OK;
            int64_t next = next_in_face(corner, 1);
            at = next == across ? next_in_face(corner, 2) : next;
            across = mesh->opposites[at];
            ++*work;
        }
    }
    *may = count == mesh->valences[vertex];
    return OK;
}

static void join(FlippedMesh *mesh, int64_t side, int64_t across)
{
    mesh->opposites[side] = across;
    mesh->opposites[across] = side;
}

/* Replaces the diagonal of a quadrilateral by the other one. */
static void flip(FlippedMesh *mesh, const Quadrilateral *quad, Waiting *waiting)
{
    int64_t one = 3 * quad->face, other = 3 * quad->other, size = 3 * mesh->face_count;
    const int64_t *corners = quad->corners;
    int64_t beyond[4], outer[4] = {one + 2, one, other + 2, other};
    for (int j = 0; j < 4; j++) {
        beyond[j] = mesh->opposites[quad->sides[j]];
        if (beyond[j] == quad->sides[j]) beyond[j] = outer[j];
    }
    /* The faces are 0, 1, 2 and 2, 3, 0. */
    for (int j = 0; j < 3; j++) {
        mesh->faces[one + j] = corners[j];
        mesh->faces[other + j] = corners[(2 + j) % 4];
    }
    for (int j = 0; j < 4; j++) {
        join(mesh, outer[j], beyond[j]);
        add(waiting, size, outer[j]);
        mesh->valences[corners[j]] += j % 2 == 0 ? 1 : -1;
    }
    join(mesh, one + 1, other + 1);
    waiting->flips++;
}

/* Number of items of scratch for F faces. */
EXPORTED int64_t flip_diagonals_items(int64_t face_count)
{
    return 3 * face_count + 3 * face_count / 8 + 1;
}

/* Flips diagonals until each is the better one of its quadrilateral, or `most_flips` are done.

   ring : (3) the members `first`, `count` and `flips` of the ring; 0, 3 F and 0 before the first
          call, between two of which scratch must not change
   It returns early after `most_work` checks; all is done when the ring is empty. */
EXPORTED int flip_diagonals(FlippedMesh *mesh, const FlipRules *rules, int64_t most_flips,
                            double *scratch, int64_t items, int64_t most_work, int64_t *ring)
{
    Scratch left = {scratch, items};
    int64_t size = 3 * mesh->face_count;
    Waiting waiting = {ring[0], ring[1], ring[2], 0, 0};
    TRY(take_integers(&left, size, &waiting.sides));
    TRY(take_bytes(&left, size, &waiting.waits));
    if (ring[0] == 0 && ring[1] == size && ring[2] == 0)
        for (int64_t side = 0; side < size; side++)
            waiting.sides[side] = side, waiting.waits[side] = 1;
    int64_t work = 0;
    for (; waiting.count && waiting.flips < most_flips && work < most_work; work++) {
        CHECK(waiting.first, size);
        int64_t side = waiting.sides[waiting.first];
        CHECK(side, size);
        waiting.first = (waiting.first + 1) % size;
        waiting.count--;
        waiting.waits[side] = 0;
        Quadrilateral quad;
        int found, may;
        TRY(quadrilateral_at(mesh, side, &quad, &found));
        if (!found || !is_better(mesh, &quad, rules)) continue;
        TRY(may_join(mesh, side, quad.corners[2], &work, &may));
        if (may) TRY(may_join(mesh, mesh->opposites[side], quad.corners[0], &work, &may));
        if (may) flip(mesh, &quad, &waiting);
    }
    if (waiting.flips >= most_flips) waiting.count = 0;
    ring[0] = waiting.first, ring[1] = waiting.count, ring[2] = waiting.flips;
    return OK;
}
