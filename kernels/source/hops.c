/* Hops: straight ways over a surface from a place to the places nearby.

   Shortest paths along edges zigzag, so their edges are developed into the tangent plane of the
   place where they begin (Schmidt, Grimm and Wyvill, "Interactive decal compositing with discrete
   exponential maps", SIGGRAPH 2006). The sum of the developed edges has the direction and the
   length of the straight way. Normals may have any sign. */
#include "edge_paths.h"
#include "vectors.h"

/* Places, and hops from some of them. Row r has those from the place of index first + r. */
typedef struct {
    int64_t place_count;          /* P */
    int64_t cell_count;           /* the first n places are cells, which are vertices */
    int64_t first;                /* the first place from which hops are wanted */
    int64_t most;                 /* number of hops that are wanted from each place */
    double longest;               /* distance along edges up to which places are searched for */
    const int64_t *corners;       /* (P, 3) of the face of each place; of a cell, its vertex */
    const double *positions;      /* (P, 3) */
    const double *normals;        /* (P, 3) unit normals at the places */
    const double *vertex_normals; /* (V, 3) unit normals */
    int64_t *counts;              /* (P - first) become the numbers of hops */
    int64_t *ends;                /* (P - first, most) become the places where they end */
    double *distances;            /* (P - first, most) become the distances along edges */
    double *leaving;              /* (P - first, most, 3) become the ways, at the start */
    double *arriving;             /* (P - first, most, 3) become the same, at the end */
} Hops;

/* Ways from a place to the vertices reached so far. */
typedef struct {
    double *ways;  /* (V, 3) in the tangent plane of the place */
    double *turns; /* (V, 9) rows of the rotations from the planes of the vertices to that plane */
} Development;

/* Rows of the least rotation that turns the plane of one unit normal to that of another one. */
static void rotation(const double *from, const double *to, double rows[9])
{
    double cosine = dot(from, to), sign = cosine < 0.0 ? -1.0 : 1.0, axis[3];
    cross(from, to, axis);
    for (int j = 0; j < 3; j++) axis[j] *= sign;
    cosine *= sign;
    double share = 1.0 / (1.0 + cosine);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rows[3 * i + j] = share * axis[i] * axis[j] + (i == j ? cosine : 0.0);
    rows[1] -= axis[2];
    rows[2] += axis[1];
    rows[3] += axis[2];
    rows[5] -= axis[0];
    rows[6] -= axis[1];
    rows[7] += axis[0];
}

static void turned(const double rows[9], const double *vector, double *result)
{
    for (int i = 0; i < 3; i++) result[i] = dot(rows + 3 * i, vector);
}

/* The straight step between two points, in the tangent plane at the first. Its direction is that in
   the plane of the mean normal; its length is the distance. */
static void developed_step(const double *from, const double *normal, const double *to,
                           const double *normal_there, double *step)
{
    double sign = dot(normal, normal_there) < 0.0 ? -1.0 : 1.0, mean[3], way[3], rows[9];
    for (int j = 0; j < 3; j++) {
        mean[j] = normal[j] + sign * normal_there[j];
        way[j] = to[j] - from[j];
    }
    double size = greater(length_of(mean), TINY), length = length_of(way);
    for (int j = 0; j < 3; j++) mean[j] /= size;
    double height = dot(way, mean);
    for (int j = 0; j < 3; j++) way[j] -= height * mean[j];
    double scale = length / greater(length_of(way), TINY);
    for (int j = 0; j < 3; j++) way[j] *= scale;
    rotation(mean, normal, rows);
    turned(rows, way, step);
}

/* Develops the way to a vertex, from the place itself or from that to the vertex before it. */
static void develop_vertex(const Mesh *mesh, const Hops *hops, const Search *search,
                           const Development *found, int64_t place, int64_t vertex)
{
    int64_t previous = search->previous[vertex];
    const double *there = mesh->vertices + 3 * vertex;
    const double *normal = hops->vertex_normals + 3 * vertex;
    double *way = found->ways + 3 * vertex, *turn = found->turns + 9 * vertex, step[3], rows[9];
    if (previous < 0) {
        const double *own = hops->normals + 3 * place;
        developed_step(hops->positions + 3 * place, own, there, normal, way);
        rotation(normal, own, turn);
        return;
    }
    const double *before = hops->vertex_normals + 3 * previous;
    const double *turn_before = found->turns + 9 * previous;
    developed_step(mesh->vertices + 3 * previous, before, there, normal, step);
    turned(turn_before, step, way);
    for (int j = 0; j < 3; j++) way[j] += found->ways[3 * previous + j];
    rotation(normal, before, rows);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            turn[3 * i + j] = turn_before[3 * i] * rows[j] + turn_before[3 * i + 1] * rows[3 + j] +
                              turn_before[3 * i + 2] * rows[6 + j];
}

/* Makes room for a hop among those of a row by ascending distance; -1 if enough are nearer. */
static int64_t room_for_hop(const Hops *hops, int64_t row, double distance)
{
    int64_t first = row * hops->most, count = hops->counts[row], at = count;
    while (at > 0 && hops->distances[first + at - 1] > distance) at--;
    if (at >= hops->most) return -1;
    int64_t last = count < hops->most ? count : count - 1;
    hops->counts[row] = last + 1;
    for (int64_t i = first + last; i > first + at; i--) {
        hops->ends[i] = hops->ends[i - 1];
        hops->distances[i] = hops->distances[i - 1];
        for (int j = 0; j < 3; j++) {
            hops->leaving[3 * i + j] = hops->leaving[3 * (i - 1) + j];
            hops->arriving[3 * i + j] = hops->arriving[3 * (i - 1) + j];
        }
    }
    return first + at;
}

/* Adds the hop to a place, whose way is that to a corner of its face and from there. */
static void add_hop(const Mesh *mesh, const Hops *hops, const Development *found, int64_t row,
                    int64_t end, int64_t corner, double distance)
{
    int64_t i = room_for_hop(hops, row, distance);
    if (i < 0) return;
    const double *normal = hops->vertex_normals + 3 * corner, *own = hops->normals + 3 * end;
    const double *turn = found->turns + 9 * corner;
    double *leaving = hops->leaving + 3 * i, step[3], rows[9], at_corner[3];
    developed_step(mesh->vertices + 3 * corner, normal, hops->positions + 3 * end, own, step);
    turned(turn, step, leaving);
    for (int j = 0; j < 3; j++) leaving[j] += found->ways[3 * corner + j];
    for (int j = 0; j < 3; j++)
        at_corner[j] = turn[j] * leaving[0] + turn[3 + j] * leaving[1] + turn[6 + j] * leaving[2];
    rotation(normal, own, rows);
    turned(rows, at_corner, hops->arriving + 3 * i);
    hops->ends[i] = end;
    hops->distances[i] = distance;
}

static int corner_at(const Mesh *mesh, const Hops *hops, int64_t place, int j, int64_t *corner,
                     double *distance)
{
    *corner = hops->corners[3 * place + j];
    CHECK(*corner, mesh->vertex_count);
    *distance = distance_between(hops->positions + 3 * place, mesh->vertices + 3 * *corner);
    return OK;
}

/* Adds hops to cells, and develops all vertices on the way. */
static int hops_to_cells(const Mesh *mesh, const EdgeGraph *graph, const Hops *hops,
                         const int64_t *cell_at, Search *search, const Development *found,
                         int64_t place, int64_t *work)
{
    int64_t vertex;
    double away;
    for (int j = 0; j < 3; j++) {
        TRY(corner_at(mesh, hops, place, j, &vertex, &away));
        TRY(reach(search, vertex, away, -1, -1));
    }
    for (int64_t cells = 0; cells < hops->most;) {
        TRY(next_vertex(graph, hops->longest, search, &vertex, work));
        if (vertex < 0) break;
        develop_vertex(mesh, hops, search, found, place, vertex);
        int64_t cell = cell_at[vertex];
        if (cell < 0 || cell == place) continue;
        add_hop(mesh, hops, found, place - hops->first, cell, vertex, search->distances[vertex]);
        cells++;
    }
    return OK;
}

/* Adds hops to the places that are no cells, from those of their corners that are developed. */
static int hops_to_points(const Mesh *mesh, const Hops *hops, Search *search,
                          const Development *found, int64_t place)
{
    double longest = hops->longest;
    int64_t next, corner;
    if (search->queue.count > 0) { /* all nearer vertices are developed */
        TRY(dequeue(&search->queue, &next));
        longest = lesser(longest, search->distances[next]);
    }
    for (int64_t end = hops->cell_count; end < hops->place_count; end++) {
        int64_t nearest = -1;
        double least = longest, away;
        for (int j = 0; j < 3; j++) {
            TRY(corner_at(mesh, hops, end, j, &corner, &away));
            double distance = search->distances[corner] + away;
            if (!(distance < least)) continue;
            least = distance;
            nearest = corner;
        }
        if (nearest >= 0 && end != place)
            add_hop(mesh, hops, found, place - hops->first, end, nearest, least);
    }
    return OK;
}

/* Number of items of scratch of `surface_hops`, for V vertices. */
EXPORTED int64_t surface_hops_items(int64_t v)
{
    return edge_search_items(v) + 13 * v;
}

/* Finds hops to the nearest places, from the row of index `done` on. Of several cells at the same
   distance, that of the lowest index is nearer.

   It returns early after `most_work` arcs; `done` is raised to the number of finished rows. */
EXPORTED int surface_hops(const Mesh *mesh, const EdgeGraph *graph, const Hops *hops,
                          double *scratch, int64_t scratch_items, int64_t most_work, int64_t *done)
{
    Scratch memory = {scratch, scratch_items};
    Search search;
    Development found;
    int64_t v = mesh->vertex_count, work = 0, *cell_at, vertex;
    if (v != graph->vertex_count) return ARRAY_TOO_SMALL;
    TRY(take_search(&memory, v, &search));
    TRY(take(&memory, 3 * v, &found.ways));
    TRY(take(&memory, 9 * v, &found.turns));
    TRY(take_integers(&memory, v, &cell_at));
    for (int64_t i = 0; i < v; i++) cell_at[i] = -1;
    for (int64_t cell = 0; cell < hops->cell_count; cell++) {
        CHECK(cell, hops->place_count);
        vertex = hops->corners[3 * cell];
        CHECK(vertex, v);
        cell_at[vertex] = cell;
    }
    for (; hops->first + *done < hops->place_count && work < most_work; ++*done) {
        int64_t place = hops->first + *done;
        CHECK(place, hops->place_count);
        hops->counts[*done] = 0;
        TRY(hops_to_cells(mesh, graph, hops, cell_at, &search, &found, place, &work));
        TRY(hops_to_points(mesh, hops, &search, &found, place));
        TRY(end_search(&search));
    }
    return OK;
}
