/* Points and segments of the traces between the nodes of curves. */
#include "points.h"

/* The traces from n nodes to the next ones. A trace that failed has no points. */
typedef struct {
    int64_t n, p;
    const int64_t *begins;     /* (n + 1) index of the first point of each trace; and p */
    const int64_t *faces;      /* (p) faces of the segments after the points */
    const double *barycentric; /* (p, 3) the points, in these faces */
    double *arcs;              /* (p) arc lengths from the beginnings of their traces */
} Traces;

/* The points of the trace of index `i`: from `first` up to `end`. */
static int points_of(const Traces *traces, int64_t i, int64_t *first, int64_t *end)
{
    CHECK(i, traces->n);
    *first = traces->begins[i];
    *end = traces->begins[i + 1];
    CHECK(*first, traces->p + 1);
    CHECK(*end, traces->p + 1);
    return OK;
}

/* Computes the arc lengths of all points. */
EXPORTED int measure_traces(const Mesh *mesh, const Traces *traces)
{
    for (int64_t i = 0; i < traces->n; i++) {
        int64_t first, end;
        TRY(points_of(traces, i, &first, &end));
        double arc = 0.0, before[3] = {0.0, 0.0, 0.0};
        for (int64_t k = first; k < end; k++) {
            double position[3];
            TRY(position_in_face(mesh, traces->faces[k], traces->barycentric + 3 * k, position));
            if (k > first) arc += distance_between(position, before);
            traces->arcs[k] = arc;
            for (int axis = 0; axis < 3; axis++) before[axis] = position[axis];
        }
    }
    return OK;
}

/* Finds q points at shares of the traces from nodes, strictly inside faces.

   nodes : (q) nodes at which the traces begin
   shares : (q) of their lengths
   faces, barycentric : (q), (q, 3) become the points
   lost : (q) becomes whether the trace failed, so that there is no point on it */
EXPORTED int places_on_traces(const Mesh *mesh, const Traces *traces, int64_t q,
                              const int64_t *nodes, const double *shares, double least_inside,
                              int64_t *faces, double *barycentric, uint8_t *lost)
{
    for (int64_t i = 0; i < q; i++) {
        int64_t first, end;
        TRY(points_of(traces, nodes[i], &first, &end));
        lost[i] = end - first < 2;
        if (lost[i]) continue;
        double wanted = shares[i] * traces->arcs[end - 1], there[3];
        int64_t k = segment_at(traces->arcs, first, end, wanted), face = traces->faces[k];
        double length = traces->arcs[k + 1] - traces->arcs[k];
        double along = (wanted - traces->arcs[k]) / greater(length, TINY);
        along = lesser(greater(along, 0.0), 1.0);
        const double *here = traces->barycentric + 3 * k;
        TRY(change_face(mesh, traces->faces[k + 1], here + 3, face, there));
        faces[i] = face;
        double *place = barycentric + 3 * i;
        for (int j = 0; j < 3; j++) place[j] = (1.0 - along) * here[j] + along * there[j];
        move_inside(place, least_inside);
    }
    return OK;
}

/* Expresses the ends of s segments of a polyline of p points in the faces of these segments.

   all_faces : (F, 3) vertices of all faces
   faces, barycentric : (p), (p, 3) faces of the segments after the points, and the points in them
   segments : (s) indices of the points at which the segments begin
   ends : (s, 2) become the first two coordinates of the points after these */
EXPORTED int segment_ends(int64_t face_count, const int64_t *all_faces, int64_t p,
                          const int64_t *faces, const double *barycentric, int64_t s,
                          const int64_t *segments, double *ends)
{
    const Mesh mesh = {.faces = all_faces, .face_count = face_count};
    for (int64_t i = 0; i < s; i++) {
        int64_t k = segments[i];
        CHECK(k, p);
        int64_t next = k + 1 < p ? k + 1 : 0;
        double changed[3];
        TRY(change_face(&mesh, faces[next], barycentric + 3 * next, faces[k], changed));
        ends[2 * i] = changed[0];
        ends[2 * i + 1] = changed[1];
    }
    return OK;
}
