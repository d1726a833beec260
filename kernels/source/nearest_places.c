/* The place of some faces that is nearest to a position. */
#include "mesh.h"
#include "vectors.h"

/* Positions, each with a group of faces. */
typedef struct {
    int64_t n, g, q;
    const double *positions; /* (n, 3) */
    const int64_t *groups;   /* (n) group of each position */
    const int64_t *begins;   /* (g + 1) where each group begins among its faces, and its end */
    const int64_t *faces;    /* (q) */
} GroupedPositions;

static void set(double *result, double first, double second, double third)
{
    result[0] = first, result[1] = second, result[2] = third;
}

/* Barycentric coordinates of the point of a triangle that is nearest to a position: of a corner, of
   a side, or of the inside (Ericson, Real-Time Collision Detection, 5.1.5). Sides without a length
   are passed over. */
static void nearest_of_triangle(const double *const corners[3], const double *position,
                                double barycentric[3])
{
    double side[2][3], along[3][2]; /* position minus each corner, along both sides */
    for (int axis = 0; axis < 3; axis++) {
        side[0][axis] = corners[1][axis] - corners[0][axis];
        side[1][axis] = corners[2][axis] - corners[0][axis];
    }
    for (int j = 0; j < 3; j++) {
        double way[3];
        for (int axis = 0; axis < 3; axis++) way[axis] = position[axis] - corners[j][axis];
        for (int k = 0; k < 2; k++) along[j][k] = dot(side[k], way);
    }
    const double *a = along[0], *b = along[1], *c = along[2];
    double share, of_c = a[0] * b[1] - b[0] * a[1], of_b = c[0] * a[1] - a[0] * c[1],
                  of_a = b[0] * c[1] - c[0] * b[1];
    if (a[0] <= 0.0 && a[1] <= 0.0) {
        set(barycentric, 1.0, 0.0, 0.0);
    } else if (b[0] >= 0.0 && b[1] <= b[0]) {
        set(barycentric, 0.0, 1.0, 0.0);
    } else if (c[1] >= 0.0 && c[0] <= c[1]) {
        set(barycentric, 0.0, 0.0, 1.0);
    } else if (of_c <= 0.0 && a[0] >= 0.0 && b[0] <= 0.0 && a[0] > b[0]) {
        share = a[0] / (a[0] - b[0]);
        set(barycentric, 1.0 - share, share, 0.0);
    } else if (of_b <= 0.0 && a[1] >= 0.0 && c[1] <= 0.0 && a[1] > c[1]) {
        share = a[1] / (a[1] - c[1]);
        set(barycentric, 1.0 - share, 0.0, share);
    } else if (of_a <= 0.0 && b[1] >= b[0] && c[0] >= c[1] && (b[1] - b[0]) + (c[0] - c[1]) > 0.0) {
        share = (b[1] - b[0]) / ((b[1] - b[0]) + (c[0] - c[1]));
        set(barycentric, 0.0, 1.0 - share, share);
    } else {
        double sum = greater(of_a + of_b + of_c, TINY);
        set(barycentric, 1.0 - of_b / sum - of_c / sum, of_b / sum, of_c / sum);
    }
}

/* Finds, for positions in turn, the nearest place of the faces of their group; of several, that of
   the first face. Every group has a face.

   It returns early after `most_work` triangles; `done` is raised to the number of finished
   positions. */
EXPORTED int nearest_places(const Mesh *mesh, const GroupedPositions *given, int64_t most_work,
                            int64_t *done, int64_t *faces, double *barycentric)
{
    for (int64_t work = 0; *done < given->n && work < most_work; ++*done) {
        CHECK(*done, given->n);
        CHECK(given->groups[*done], given->g);
        const double *position = given->positions + 3 * *done;
        const int64_t *bounds = given->begins + given->groups[*done];
        double nearest = INFINITY;
        CHECK(bounds[0], bounds[1]);
        CHECK(bounds[1] - 1, given->q);
        if (!are_finite(position, 3)) return NOT_FINITE;
        for (int64_t i = bounds[0]; i < bounds[1]; i++, work++) {
            const double *corners[3];
            double place[3], there[3];
            CHECK(i, given->q);
            TRY(corners_of(mesh, given->faces[i], corners));
            nearest_of_triangle(corners, position, place);
            interpolate(corners, place, there);
            double away = distance_between(there, position);
            if (i > bounds[0] && !(away < nearest)) continue;
            nearest = away;
            faces[*done] = given->faces[i];
            set(barycentric + 3 * *done, place[0], place[1], place[2]);
        }
    }
    return OK;
}
