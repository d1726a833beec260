/* Finds segments that have a common point, face by face.

   Every segment lies in one face. So two strands can meet only inside a face through which both
   run, at a point of an edge between their faces, or at a vertex. */
#include "crossings.h"

#include "vectors.h"

enum { DIGIT = 11, DIGITS = 1 << DIGIT }; /* number of bits, and of values, of a digit */

int64_t order_items(int64_t s)
{
    return s + DIGITS;
}

/* Sorts s segments by one digit of their groups; equal ones keep their order. */
static int sort_by_digit(int64_t s, const int64_t *groups, int shift, const int64_t *from,
                         int64_t *counts, int64_t *to)
{
    for (int64_t digit = 0; digit < DIGITS; digit++) counts[digit] = 0;
    for (int64_t i = 0; i < s; i++) counts[((uint64_t)groups[i] >> shift) % DIGITS]++;
    int64_t before = 0;
    for (int64_t digit = 0; digit < DIGITS; digit++) {
        int64_t count = counts[digit];
        counts[digit] = before;
        before += count;
    }
    for (int64_t i = 0; i < s; i++) {
        CHECK(from[i], s);
        int64_t place = counts[((uint64_t)groups[from[i]] >> shift) % DIGITS]++;
        CHECK(place, s);
        to[place] = from[i];
    }
    return OK;
}

int order_of_groups(int64_t s, const int64_t *groups, double *scratch, int64_t scratch_items,
                    int64_t *order)
{
    Scratch memory = {scratch, scratch_items};
    int64_t *counts, *sorted;
    uint64_t used = 0;
    TRY(take_integers(&memory, DIGITS, &counts));
    TRY(take_integers(&memory, s, &sorted));
    for (int64_t i = 0; i < s; i++) {
        order[i] = i;
        used |= (uint64_t)groups[i];
    }
    for (int shift = 0; shift < 64 && used >> shift; shift += DIGIT) {
        TRY(sort_by_digit(s, groups, shift, order, counts, sorted));
        for (int64_t i = 0; i < s; i++) order[i] = sorted[i];
    }
    return OK;
}

static int boxes_overlap(const double *a, const double *b, const double *c, const double *d,
                         double touching)
{
    for (int axis = 0; axis < 2; axis++) {
        if (!(lesser(a[axis], b[axis]) <= greater(c[axis], d[axis]) + touching)) return 0;
        if (!(lesser(c[axis], d[axis]) <= greater(a[axis], b[axis]) + touching)) return 0;
    }
    return 1;
}

/* Twice the signed area of the triangle abc. */
static double turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Whether c and d lie on different sides of the line ab, or at least one lies on it. */
static int reaches_across(const double *a, const double *b, const double *c, const double *d,
                          double touching)
{
    double one = turn(a, b, c), other = turn(a, b, d), x = b[0] - a[0], y = b[1] - a[1];
    double width = touching * sqrt(x * x + y * y);
    return lesser(one, other) <= width && greater(one, other) >= -width;
}

int meeting_segments(const Segments *segments, double touching, int64_t most_work,
                     PairSearch *search)
{
    int64_t work = 0, s = segments->s;
    while (search->first < s) {
        CHECK(search->first, s);
        int64_t one = segments->order[search->first];
        CHECK(one, s);
        const double *a = segments->starts + 2 * one, *b = segments->ends + 2 * one;
        for (; search->second < s; search->second++) {
            CHECK(search->second, s);
            int64_t other = segments->order[search->second];
            CHECK(other, s);
            if (segments->groups[other] != segments->groups[one]) break;
            if (work++ >= most_work || search->count >= search->room) return OK;
            const double *c = segments->starts + 2 * other, *d = segments->ends + 2 * other;
            /* Boxes are necessary, since collinear segments pass the other tests even if they are
               disjoint. */
            if (!boxes_overlap(a, b, c, d, touching)) continue;
            if (!reaches_across(a, b, c, d, touching)) continue;
            if (!reaches_across(c, d, a, b, touching)) continue;
            search->pairs[2 * search->count] = one;
            search->pairs[2 * search->count + 1] = other;
            search->count++;
        }
        search->first++;
        search->second = search->first + 1;
    }
    return OK;
}

/* A polyline of s segments, and which of its points are at vertices. */
typedef struct {
    int64_t s, n, vertex_count;
    double *starts, *ends; /* (s, 2) */
    int64_t *order;        /* (s) of the segments by their faces */
    int64_t *vertices;     /* (n) the vertices at which points are, with gaps */
    int64_t *points;       /* (n) these points */
    int64_t *by_vertex;    /* (n) order of these points by their vertices */
} Strands;

int64_t items_of_crossings(int64_t points)
{
    return 8 * points + order_items(points);
}

/* Numbers of items of scratch of `polyline_crossings`. */
EXPORTED int64_t crossings_items(int64_t points)
{
    return items_of_crossings(points);
}

static int find_strands(const Mesh *mesh, const PointList *points, int64_t closed, Scratch *scratch,
                        Strands *strands)
{
    int64_t n = points->count, s = closed || n == 0 ? n : n - 1;
    strands->s = s;
    strands->n = n;
    strands->vertex_count = 0;
    TRY(take(scratch, 2 * s, &strands->starts));
    TRY(take(scratch, 2 * s, &strands->ends));
    TRY(take_integers(scratch, s, &strands->order));
    TRY(take_integers(scratch, n, &strands->vertices));
    TRY(take_integers(scratch, n, &strands->points));
    TRY(take_integers(scratch, n, &strands->by_vertex));
    for (int64_t k = 0; k < n; k++) {
        const double *here = points->barycentric + 3 * k;
        int64_t face = points->faces[k], next = k + 1 < n ? k + 1 : 0;
        int positive = 0, corner = 0;
        CHECK(face, mesh->face_count);
        for (int j = 0; j < 3; j++)
            if (here[j] > 0.0) {
                positive++;
                corner = j;
            }
        if (positive == 1) {
            strands->vertices[strands->vertex_count] = mesh->faces[3 * face + corner];
            strands->points[strands->vertex_count++] = k;
        }
        if (k == s) continue;
        double changed[3];
        TRY(change_face(mesh, points->faces[next], points->barycentric + 3 * next, face, changed));
        for (int axis = 0; axis < 2; axis++) {
            strands->starts[2 * k + axis] = here[axis];
            strands->ends[2 * k + axis] = changed[axis];
        }
    }
    TRY(order_of_groups(s, points->faces, scratch->next, scratch->left, strands->order));
    return order_of_groups(strands->vertex_count, strands->vertices, scratch->next, scratch->left,
                           strands->by_vertex);
}

/* Removes neighbours from the pairs that were found after the first `kept` ones. */
static void remove_neighbours(const Strands *strands, int64_t closed, int64_t kept,
                              PairSearch *search)
{
    int64_t found = search->count;
    search->count = kept;
    for (int64_t p = kept; p < found; p++) {
        int64_t one = search->pairs[2 * p], other = search->pairs[2 * p + 1];
        int64_t apart = one > other ? one - other : other - one;
        if (apart == 1 || (closed && apart == strands->s - 1)) continue;
        search->pairs[2 * search->count] = one;
        search->pairs[2 * search->count + 1] = other;
        search->count++;
    }
}

/* Adds pairs of segments that begin at the same vertex. */
static int find_common_vertices(const Strands *strands, int64_t closed, PairSearch *search)
{
    for (; search->second < strands->vertex_count; search->second++) {
        if (search->count >= search->room) return OK;
        int64_t one = strands->by_vertex[search->second - 1];
        int64_t other = strands->by_vertex[search->second], last = strands->s - 1;
        int64_t apart = strands->points[other] - strands->points[one];
        if (strands->vertices[one] != strands->vertices[other] || apart == 1) continue;
        if (closed && apart >= strands->n - 1) continue;
        int64_t *pair = search->pairs + 2 * search->count++;
        pair[0] = strands->points[one] < last ? strands->points[one] : last;
        pair[1] = strands->points[other] < last ? strands->points[other] : last;
    }
    search->first = strands->n + 1;
    return OK;
}

int find_crossings(const Mesh *mesh, const PointList *points, int64_t closed, double touching,
                   Scratch scratch, int64_t most_work, PairSearch *search)
{
    Strands strands;
    TRY(find_strands(mesh, points, closed, &scratch, &strands));
    Segments segments = {strands.s, strands.order, points->faces, strands.starts, strands.ends};
    if (search->first < strands.s) {
        int64_t kept = search->count;
        TRY(meeting_segments(&segments, touching, most_work, search));
        remove_neighbours(&strands, closed, kept, search);
        if (search->first < strands.s) return OK;
        search->second = 1;
    }
    return find_common_vertices(&strands, closed, search);
}

/* Finds the crossings of a polyline; see `find_crossings`. */
EXPORTED int polyline_crossings(int64_t face_count, const int64_t *all_faces,
                                const PointList *points, int64_t closed, double touching,
                                double *scratch, int64_t scratch_items, int64_t most_work,
                                PairSearch *search)
{
    const Mesh mesh = {.faces = all_faces, .face_count = face_count};
    const Scratch memory = {scratch, scratch_items};
    return find_crossings(&mesh, points, closed, touching, memory, most_work, search);
}
