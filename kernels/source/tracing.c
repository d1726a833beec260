/* Straight traces over the faces of a mesh: between two points, or of a given length from a point.

   A trace is a normal section: the intersection of the surface with a plane that contains the
   surface normal. The signs of the corners' heights above this plane decide which side of a face is
   crossed next, so a trace cannot get lost between two faces. */
#include "tracing.h"

#include <string.h>

#include "vectors.h"

/* A trace in progress, about to cross a side of its current face. One end of this side lies above
   the plane of the trace or in it, and the other end lies below. */
typedef struct {
    int64_t start_face;
    double origin[3];       /* start point */
    double plane_normal[3];
    double position[3];     /* last crossing; before the first crossing, the start point */
    int64_t side;           /* the side that is crossed next */
    double first, second;   /* heights of its ends above the plane */
} Trace;

/* The crossing of a trace with a side. */
typedef struct {
    int64_t side;    /* the side, in the face that the trace leaves */
    int64_t beyond;  /* the same edge in the face that the trace enters; the side itself if none */
    double share;    /* the crossing, as a fraction from the first end of the side to the second */
    double length;   /* of the trace in the face that it leaves */
} Crossing;

/* Finds the side through which a trace leaves its first face: of the two sides that the plane
   crosses, the one farther along `ahead`. `crosses` is 0 if the plane crosses none. */
static void leave_first_face(Trace *trace, int64_t face, const double offsets[3][3],
                             const double ahead[3], int *crosses)
{
    double heights[3], along[3], farthest = -INFINITY;
    for (int j = 0; j < 3; j++) {
        heights[j] = dot(offsets[j], trace->plane_normal);
        along[j] = dot(offsets[j], ahead);
    }
    *crosses = 0;
    for (int j = 0; j < 3; j++) {
        double first = heights[FIRST_END[j]], second = heights[SECOND_END[j]];
        if ((first >= 0.0) == (second >= 0.0)) continue;
        double begin = along[FIRST_END[j]], end = along[SECOND_END[j]];
        double at = begin + first / (first - second) * (end - begin);
        if (*crosses && !(at > farthest)) continue;
        *crosses = 1;
        farthest = at;
        trace->start_face = face;
        trace->side = 3 * face + j;
        trace->first = first;
        trace->second = second;
    }
}

/* Crosses the next side. */
static int cross_side(const Mesh *mesh, Trace *trace, Crossing *crossing)
{
    int64_t low, high;
    TRY(ends_of(mesh, trace->side, &low, &high));
    crossing->side = trace->side;
    crossing->beyond = mesh->opposite_sides[trace->side];
    CHECK(crossing->beyond, 3 * mesh->face_count);
    crossing->share = trace->first / (trace->first - trace->second);
    const double *begin = mesh->vertices + 3 * low, *end = mesh->vertices + 3 * high;
    double way[3];
    for (int axis = 0; axis < 3; axis++) {
        double here = begin[axis] + crossing->share * (end[axis] - begin[axis]);
        way[axis] = here - trace->position[axis];
        trace->position[axis] = here;
    }
    crossing->length = length_of(way);
    return OK;
}

/* Finds the next side, in the face beyond a crossing. */
static int enter_face(const Mesh *mesh, Trace *trace, const Crossing *crossing)
{
    /* Consistently oriented faces traverse their common side in opposite directions. */
    double before = trace->second, after = trace->first;
    if (!mesh->is_oriented) {
        int64_t low, high, low_beyond, high_beyond;
        TRY(ends_of(mesh, crossing->side, &low, &high));
        TRY(ends_of(mesh, crossing->beyond, &low_beyond, &high_beyond));
        if (low == low_beyond) {
            before = trace->first;
            after = trace->second;
        }
    }
    int64_t vertex;
    TRY(vertex_at(mesh, crossing->beyond, &vertex));
    double offset[3];
    for (int axis = 0; axis < 3; axis++)
        offset[axis] = mesh->vertices[3 * vertex + axis] - trace->origin[axis];
    double height = dot(offset, trace->plane_normal);
    /* The next side joins the third corner and the end on the other side of the plane from it. */
    int64_t corner = crossing->beyond % 3, face_start = crossing->beyond - corner;
    if ((height >= 0.0) == (before >= 0.0)) {
        trace->side = face_start + FIRST_END[corner];
        trace->first = after;
        trace->second = height;
    } else {
        trace->side = face_start + SECOND_END[corner];
        trace->first = height;
        trace->second = before;
    }
    return OK;
}

/* Barycentric coordinates in a face of a point on a side of this or an adjacent face. */
static int on_side(const Mesh *mesh, int64_t face, int64_t side, double share,
                   double barycentric[3])
{
    int64_t first, second;
    TRY(ends_of(mesh, side, &first, &second));
    for (int j = 0; j < 3; j++) {
        int64_t vertex;
        TRY(vertex_at(mesh, 3 * face + j, &vertex));
        barycentric[j] = (vertex == first) * (1.0 - share) + (vertex == second) * share;
    }
    return OK;
}

/* Places a point in the face that its trace does not leave any more, `to_go` after the begin of the
   trace in this face; `entry` is the crossing through which it came, NULL in the first face. */
static int stop_before(const Mesh *mesh, const Crossing *entry, const Crossing *exit, double to_go,
                       int64_t *face, double barycentric[3])
{
    double begin[3], end[3];
    *face = exit->side / 3;
    memcpy(begin, barycentric, sizeof begin);
    if (entry) TRY(on_side(mesh, *face, entry->side, entry->share, begin));
    TRY(on_side(mesh, *face, exit->side, exit->share, end));
    double share = lesser(to_go, exit->length) / greater(exit->length, TINY);
    for (int j = 0; j < 3; j++) barycentric[j] = begin[j] + share * (end[j] - begin[j]);
    return OK;
}

/* Follows a trace until it has the given length or is blocked. The point stays where it is if the
   trace returns to its first face, or passes too many faces. */
static int follow(const Mesh *mesh, const uint8_t *folded, const TraceLimits *limits, Trace *trace,
                  double length, int64_t *face, double barycentric[3], uint8_t *blocked,
                  int64_t *most_passed)
{
    int runs_back_over_folds = folded && !folded[trace->start_face];
    double covered = 0.0;
    Crossing crossing, entry;
    for (int64_t passed = 1; passed <= limits->most_faces; passed++) {
        TRY(cross_side(mesh, trace, &crossing));
        if (passed > *most_passed) *most_passed = passed;
        int back = runs_back_over_folds && folded[crossing.side / 3];
        double before = covered;
        covered += back ? -crossing.length : crossing.length;
        int is_blocked = crossing.beyond == crossing.side;
        if (is_blocked || (!back && covered >= length)) {
            double to_go = length - before;
            *blocked = to_go > crossing.length;
            return stop_before(mesh, passed > 1 ? &entry : NULL, &crossing, to_go, face,
                               barycentric);
        }
        if (crossing.beyond / 3 == trace->start_face) return OK;
        TRY(enter_face(mesh, trace, &crossing));
        entry = crossing;
    }
    return OK;
}

int move_point(const Mesh *mesh, const uint8_t *folded, const TraceLimits *limits,
               const double direction[3], double length, int64_t *face, double barycentric[3],
               uint8_t *blocked, int64_t *most_passed)
{
    const double *corners[3];
    TRY(corners_of(mesh, *face, corners));
    if (!are_finite(direction, 3) || !isfinite(length) || !are_finite(barycentric, 3))
        return NOT_FINITE;
    Trace trace;
    double offsets[3][3], heights[3], change[3], inside[3], speed[3];
    interpolate(corners, barycentric, trace.origin);
    memcpy(trace.position, trace.origin, sizeof trace.position);
    cross(mesh->face_normals + 3 * *face, direction, trace.plane_normal);
    for (int j = 0; j < 3; j++) {
        for (int axis = 0; axis < 3; axis++)
            offsets[j][axis] = corners[j][axis] - trace.origin[axis];
        heights[j] = dot(offsets[j], trace.plane_normal);
    }
    /* Most points stay in their faces. There, barycentric coordinates change linearly, in
       proportion to the differences of the corners' heights above the plane. */
    for (int j = 0; j < 3; j++) change[j] = heights[FIRST_END[j]] - heights[SECOND_END[j]];
    const double *const offset_rows[3] = {offsets[0], offsets[1], offsets[2]};
    interpolate(offset_rows, change, speed);
    double rate = length_of(speed);
    rate = length / (rate > 0.0 ? rate : 1.0);
    int stays = 1;
    for (int j = 0; j < 3; j++) {
        inside[j] = barycentric[j] + rate * change[j];
        stays &= inside[j] >= limits->least_inside;
    }
    *blocked = 0;
    if (stays || !(length > 0.0)) {
        memcpy(barycentric, inside, sizeof inside);
    } else {
        int crosses;
        leave_first_face(&trace, *face, offsets, direction, &crosses);
        if (crosses)
            TRY(follow(mesh, folded, limits, &trace, length, face, barycentric, blocked,
                       most_passed));
        else
            *blocked = 1;
    }
    move_inside(barycentric, limits->least_inside);
    return OK;
}

/* Moves points straight along the surface, from the point of index `done` on. It returns early when
   the traces have passed `most_work` faces, so that the caller can do something else in between.

   faces : (n) faces of the points; replaced
   barycentric : (n, 3) coordinates in them; replaced
   directions : (n, 3) unit vectors, nearly tangent to the faces
   lengths : (n) distances to move, not negative. Points with length zero stay, wherever they are;
   all others are strictly inside their faces
   blocked : (n) becomes whether each point stopped at a boundary
   most_passed : raised to the greatest number of faces that a point passed
   done : raised to the number of points that have been moved */
EXPORTED int trace_from(const Mesh *mesh, const uint8_t *folded, const TraceLimits *limits,
                        int64_t n, int64_t *faces, double *barycentric, const double *directions,
                        const double *lengths, uint8_t *blocked, int64_t *most_passed,
                        int64_t most_work, int64_t *done)
{
    int64_t work = 0;
    for (; *done < n && work < most_work; ++*done) {
        int64_t i = *done, passed = 0;
        CHECK(i, n);
        work++;
        if (lengths[i] == 0.0) continue;
        TRY(move_point(mesh, folded, limits, directions + 3 * i, lengths[i], faces + i,
                       barycentric + 3 * i, blocked + i, &passed));
        if (passed > *most_passed) *most_passed = passed;
        work += passed;
    }
    return OK;
}

/* Whether a point lies in a face. A point on an edge or at a vertex lies in all faces that contain
   it. */
static int is_in_face(const Mesh *mesh, int64_t own_face, const double *barycentric, int64_t face,
                      int *holds)
{
    *holds = own_face == face;
    if (*holds || (barycentric[0] != 0.0 && barycentric[1] != 0.0 && barycentric[2] != 0.0))
        return OK;
    *holds = 1;
    for (int j = 0; j < 3; j++) {
        if (barycentric[j] == 0.0) continue;
        int64_t vertex, corner;
        int found = 0;
        TRY(vertex_at(mesh, 3 * own_face + j, &vertex));
        for (int k = 0; k < 3; k++) {
            TRY(vertex_at(mesh, 3 * face + k, &corner));
            found |= corner == vertex;
        }
        *holds &= found;
    }
    return OK;
}

/* The vertex at which a point lies, or -1. */
static int vertex_of_point(const Mesh *mesh, int64_t face, const double *barycentric,
                           int64_t *vertex)
{
    int positive = 0, corner = 0;
    for (int j = 2; j >= 0; j--)
        if (barycentric[j] > 0.0) {
            positive++;
            corner = j;
        }
    *vertex = -1;
    return positive == 1 ? vertex_at(mesh, 3 * face + corner, vertex) : OK;
}

/* The points of which `trace_between` is asked for traces, and what it found. */
typedef struct {
    const int64_t *start_faces;    /* (m) faces of the starts */
    const double *starts;          /* (m, 3) barycentric coordinates in them, strictly inside */
    const int64_t *end_faces;      /* (m) faces of the ends */
    const double *ends;            /* (m, 3) barycentric coordinates in them */
    const double *normals;         /* (m, 3) vectors in the planes, besides those to the ends */
    const double *ahead;           /* (m, 3) directions at the starts; NULL for those to the ends */
    const double *longest;         /* (m) greatest lengths up to the faces of the ends */
    double fold_margin;            /* length allowed before backward parts are subtracted */
    uint8_t *reached;              /* (m) becomes whether each trace reached its end */
    int64_t *crossing_counts;      /* (m) becomes the number of crossings of each trace */
} TracePairs;

/* Adds a crossing to those of a trace from index `first` on. Of consecutive crossings at one
   vertex, only the last is kept. */
static int add_crossing(const Mesh *mesh, const Crossing *crossing, int64_t first,
                        int64_t *last_vertex, PointList *crossings)
{
    int64_t face = crossing->beyond / 3, vertex;
    double barycentric[3];
    TRY(on_side(mesh, face, crossing->side, crossing->share, barycentric));
    TRY(vertex_of_point(mesh, face, barycentric, &vertex));
    if (crossings->count > first && vertex >= 0 && vertex == *last_vertex) crossings->count--;
    if (crossings->count >= crossings->room) return ARRAY_TOO_SMALL;
    crossings->faces[crossings->count] = face;
    memcpy(crossings->barycentric + 3 * crossings->count, barycentric, sizeof barycentric);
    crossings->count++;
    *last_vertex = vertex;
    return OK;
}

int trace_to(const Mesh *mesh, const uint8_t *folded, int64_t most_faces,
             const TraceRequest *request, PointList *crossings, uint8_t *reached, int64_t *passed)
{
    int64_t face = request->start_face, end_face = request->end_face;
    const double *corners[3];
    int64_t first = crossings->count, last_vertex = -1;
    Trace trace;
    double goal[3], forward[3], offsets[3][3];
    TRY(corners_of(mesh, end_face, corners));
    interpolate(corners, request->end, goal);
    TRY(corners_of(mesh, face, corners));
    interpolate(corners, request->start, trace.origin);
    if (!are_finite(goal, 3) || !are_finite(trace.origin, 3) || !are_finite(request->normal, 3))
        return NOT_FINITE;
    int arrived, crosses;
    TRY(is_in_face(mesh, end_face, request->end, face, &arrived));
    *reached = (uint8_t)arrived;
    if (arrived) return OK;
    memcpy(trace.position, trace.origin, sizeof trace.position);
    for (int axis = 0; axis < 3; axis++) {
        forward[axis] = goal[axis] - trace.origin[axis];
        for (int j = 0; j < 3; j++) offsets[j][axis] = corners[j][axis] - trace.origin[axis];
    }
    cross(request->normal, forward, trace.plane_normal);
    leave_first_face(&trace, face, offsets, request->ahead ? request->ahead : forward, &crosses);
    double travelled = 0.0, covered = 0.0;
    Crossing crossing;
    for (int64_t count = 0; crosses && count < most_faces; count++) {
        TRY(cross_side(mesh, &trace, &crossing));
        ++*passed;
        travelled += crossing.length;
        covered += folded && folded[crossing.side / 3] ? -crossing.length : crossing.length;
        if (crossing.beyond == crossing.side || crossing.beyond / 3 == face ||
            travelled > request->longest + request->fold_margin)
            break;
        TRY(add_crossing(mesh, &crossing, first, &last_vertex, crossings));
        TRY(is_in_face(mesh, end_face, request->end, crossing.beyond / 3, &arrived));
        if (arrived) {
            *reached = covered <= request->longest;
            break;
        }
        TRY(enter_face(mesh, &trace, &crossing));
    }
    if (!*reached) crossings->count = first;
    return OK;
}

/* Traces between m pairs of points, from the pair of index `done` on.

   It returns early when the traces have passed `most_work` faces, or when the room that is left may
   not suffice for another trace; `done` is raised to the number of pairs that have been traced. */
EXPORTED int trace_between(const Mesh *mesh, const uint8_t *folded, int64_t most_faces, int64_t m,
                           const TracePairs *pairs, PointList *crossings, int64_t most_work,
                           int64_t *done)
{
    if (crossings->room < most_faces) return ARRAY_TOO_SMALL;
    int64_t work = 0;
    for (; *done < m && work < most_work; ++*done) {
        if (crossings->room - crossings->count < most_faces) return OK;
        int64_t i = *done, first = crossings->count;
        CHECK(i, m);
        TraceRequest request = {pairs->start_faces[i], pairs->starts + 3 * i,
                                pairs->end_faces[i],   pairs->ends + 3 * i,
                                pairs->normals + 3 * i, pairs->ahead ? pairs->ahead + 3 * i : NULL,
                                pairs->longest[i],     pairs->fold_margin};
        work++;
        TRY(trace_to(mesh, folded, most_faces, &request, crossings, pairs->reached + i, &work));
        pairs->crossing_counts[i] = crossings->count - first;
    }
    return OK;
}
