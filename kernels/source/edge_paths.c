/* Shortest paths along the edges of a mesh.

   Of several paths of the same length, the one whose last vertex but one comes first counts: that
   at the smaller distance, or of the lower index. */
#include "edge_paths.h"
#include "points.h"

static int add_arc(const EdgeGraph *graph, int64_t start, int64_t end, int64_t face,
                   int64_t *places)
{
    int64_t place = places[start]++;
    CHECK(place, graph->arc_count);
    graph->ends[place] = end;
    graph->faces[place] = face;
    return OK;
}

/* Stores both directions of all sides of faces; the arcs of a vertex are in the order of faces. */
static int add_sides(const Mesh *mesh, const EdgeGraph *graph, int64_t *places)
{
    int64_t v = graph->vertex_count, vertex, first, second;
    for (int64_t i = 0; i <= v; i++) graph->begins[i] = 0;
    for (int64_t corner = 0; corner < 3 * mesh->face_count; corner++) {
        TRY(vertex_at(mesh, corner, &vertex));
        graph->begins[vertex + 1] += 2;
    }
    for (int64_t i = 0; i < v; i++) {
        graph->begins[i + 1] += graph->begins[i];
        places[i] = graph->begins[i];
    }
    for (int64_t side = 0; side < 3 * mesh->face_count; side++) {
        TRY(ends_of(mesh, side, &first, &second));
        TRY(add_arc(graph, first, second, side / 3, places));
        TRY(add_arc(graph, second, first, side / 3, places));
    }
    return OK;
}

/* Builds the graph of a mesh. Its arrays have room for 6 F arcs; `arc_count` becomes the number of
   arcs, two for each edge. `last_seen`, (V), is scratch. */
EXPORTED int edge_graph(const Mesh *mesh, EdgeGraph *graph, int64_t *last_seen)
{
    int64_t v = graph->vertex_count, kept = 0;
    if (v != mesh->vertex_count) return ARRAY_TOO_SMALL;
    TRY(add_sides(mesh, graph, last_seen));
    for (int64_t i = 0; i < v; i++) last_seen[i] = -1;
    for (int64_t i = 0, k = 0; i < v; i++) {
        int64_t end = graph->begins[i + 1];
        graph->begins[i] = kept;
        for (; k < end; k++) {
            int64_t other = graph->ends[k];
            if (last_seen[other] == i || other == i) continue;
            last_seen[other] = i;
            graph->ends[kept] = other;
            graph->faces[kept] = graph->faces[k];
            graph->lengths[kept++] =
                distance_between(mesh->vertices + 3 * i, mesh->vertices + 3 * other);
        }
    }
    graph->begins[v] = graph->arc_count = kept;
    return OK;
}

int64_t edge_search_items(int64_t v)
{
    return 4 * v + items_of_queue(v);
}

int take_search(Scratch *scratch, int64_t v, Search *search)
{
    TRY(take(scratch, v, &search->distances));
    TRY(take_integers(scratch, v, &search->previous));
    TRY(take_integers(scratch, v, &search->arcs));
    TRY(take_integers(scratch, v, &search->reached));
    TRY(take_queue(scratch, v, &search->queue));
    search->reached_count = 0;
    for (int64_t i = 0; i < v; i++) search->distances[i] = INFINITY;
    return OK;
}

int reach(Search *search, int64_t vertex, double distance, int64_t previous, int64_t arc)
{
    CHECK(vertex, search->queue.capacity);
    if (!(distance < search->distances[vertex])) return OK;
    if (search->distances[vertex] == INFINITY) {
        CHECK(search->reached_count, search->queue.capacity);
        search->reached[search->reached_count++] = vertex;
    }
    search->distances[vertex] = distance;
    search->previous[vertex] = previous;
    search->arcs[vertex] = arc;
    return enqueue(&search->queue, vertex, distance);
}

int next_vertex(const EdgeGraph *graph, double longest, Search *search, int64_t *vertex,
                int64_t *work)
{
    *vertex = -1;
    if (search->queue.count == 0) return OK;
    TRY(dequeue(&search->queue, vertex));
    int64_t first = graph->begins[*vertex], end = graph->begins[*vertex + 1];
    *work += 1 + end - first;
    for (int64_t k = first; k < end; k++) {
        CHECK(k, graph->arc_count);
        double distance = search->distances[*vertex] + graph->lengths[k];
        if (distance <= longest) TRY(reach(search, graph->ends[k], distance, *vertex, k));
    }
    return OK;
}

int end_search(Search *search)
{
    int64_t item;
    while (search->queue.count > 0) TRY(dequeue(&search->queue, &item));
    for (int64_t i = 0; i < search->reached_count; i++)
        search->distances[search->reached[i]] = INFINITY;
    search->reached_count = 0;
    return OK;
}

/* Finds the distances along edges from k points to all vertices, from the point of index `done` on.

   corners : (k, 3) vertices to which each point is joined
   away : (k, 3) its distances to them
   distances : (k, V) become the distances
   It returns early after `most_work` arcs; `done` is raised to the number of finished points. */
EXPORTED int distances_along_edges(const EdgeGraph *graph, int64_t k, const int64_t *corners,
                                   const double *away, double *scratch,
                                   int64_t scratch_items, int64_t most_work, int64_t *done,
                                   double *distances)
{
    Scratch memory = {scratch, scratch_items};
    Search search;
    int64_t v = graph->vertex_count, work = 0, vertex;
    TRY(take_search(&memory, v, &search));
    for (; *done < k && work < most_work; ++*done) {
        CHECK(*done, k);
        for (int64_t j = 3 * *done; j < 3 * *done + 3; j++)
            TRY(reach(&search, corners[j], away[j], -1, -1));
        do {
            TRY(next_vertex(graph, INFINITY, &search, &vertex, &work));
        } while (vertex >= 0);
        for (int64_t i = 0; i < v; i++) distances[*done * v + i] = search.distances[i];
        TRY(end_search(&search));
    }
    return OK;
}

/* Points on paths between vertices. */
typedef struct {
    int64_t q;
    const int64_t *starts; /* (q) vertices */
    const int64_t *ends;   /* (q) vertices */
    const double *shares;  /* (q) of the lengths of the paths, at which the points are wanted */
    double longest;        /* length up to which paths are searched for */
    int64_t *faces;        /* (q) become faces of the points */
    double *barycentric;   /* (q, 3) become their coordinates in them */
} EdgePoints;

/* Coordinates in a face of the point at a share of the way from a vertex of it to another one. */
static int place_between(const Mesh *mesh, int64_t face, int64_t low, int64_t high, double share,
                         double barycentric[3])
{
    for (int j = 0; j < 3; j++) {
        int64_t vertex;
        TRY(vertex_at(mesh, 3 * face + j, &vertex));
        barycentric[j] = (1.0 - share) * (vertex == low) + share * (vertex == high);
    }
    return OK;
}

static int first_face_at(const EdgeGraph *graph, int64_t vertex, int64_t *face)
{
    int64_t first = graph->begins[vertex], end = graph->begins[vertex + 1];
    CHECK(first, end); /* a vertex without edges is in no face */
    CHECK(end - 1, graph->arc_count);
    *face = graph->faces[first];
    for (int64_t k = first + 1; k < end; k++)
        if (graph->faces[k] < *face) *face = graph->faces[k];
    return OK;
}

static int point_on_path(const Mesh *mesh, const EdgeGraph *graph, Search *search,
                         const EdgePoints *points, int64_t i, int64_t *work)
{
    int64_t start = points->starts[i], end = points->ends[i], vertex, face;
    CHECK(start, graph->vertex_count);
    CHECK(end, graph->vertex_count);
    TRY(reach(search, start, 0.0, -1, -1));
    do {
        TRY(next_vertex(graph, points->longest, search, &vertex, work));
    } while (vertex >= 0 && vertex != end);
    int64_t low = vertex == end ? end : start, high = low, arc = -1;
    double wanted = points->shares[i] * search->distances[low], share = 0.0;
    while (search->distances[low] > wanted && search->previous[low] >= 0) {
        high = low;
        arc = search->arcs[low];
        low = search->previous[low];
    }
    if (arc < 0) {
        TRY(first_face_at(graph, low, &face));
    } else {
        double length = search->distances[high] - search->distances[low];
        share = length > 0.0 ? (wanted - search->distances[low]) / length : 0.0;
        face = graph->faces[arc];
    }
    points->faces[i] = face;
    TRY(place_between(mesh, face, low, high, share, points->barycentric + 3 * i));
    return end_search(search);
}

/* Finds points at shares of the shortest paths along edges, from the path of index `done` on. A
   point stays at the start if there is no path.

   It returns early after `most_work` arcs; `done` is raised to the number of finished points. */
EXPORTED int points_on_edge_paths(const Mesh *mesh, const EdgeGraph *graph,
                                  const EdgePoints *points, double *scratch,
                                  int64_t scratch_items, int64_t most_work, int64_t *done)
{
    Scratch memory = {scratch, scratch_items};
    Search search;
    int64_t work = 0;
    TRY(take_search(&memory, graph->vertex_count, &search));
    for (; *done < points->q && work < most_work; ++*done) {
        CHECK(*done, points->q);
        TRY(point_on_path(mesh, graph, &search, points, *done, &work));
    }
    return OK;
}

/* Paths from points of faces to others. */
typedef struct {
    int64_t q;
    const int64_t *start_faces;
    const double *starts; /* (q, 3) barycentric coordinates in these faces */
    const int64_t *end_faces;
    const double *ends;    /* (q, 3) */
    const double *longest; /* (q) lengths up to which paths are searched for */
    uint8_t *reached;      /* (q) become whether there is a path */
    int64_t *counts;       /* (q) become numbers of points of the paths */
} PointPaths;

/* A point of a face, and the straight ways to its corners. */
typedef struct {
    int64_t face;
    const double *barycentric; /* (3) */
    int64_t vertices[3];
    double away[3]; /* zero if the point lies at the vertex */
} JoinedPoint;

static int join_point(const Mesh *mesh, int64_t face, const double *barycentric,
                      JoinedPoint *point)
{
    double position[3];
    point->face = face;
    point->barycentric = barycentric;
    TRY(position_in_face(mesh, face, barycentric, position));
    for (int j = 0; j < 3; j++) {
        TRY(vertex_at(mesh, 3 * face + j, &point->vertices[j]));
        int is_vertex = barycentric[j] >= 1.0;
        double away = distance_between(position, mesh->vertices + 3 * point->vertices[j]);
        point->away[j] = is_vertex ? 0.0 : away;
    }
    return OK;
}

static int lies_at(const JoinedPoint *point, int64_t vertex)
{
    for (int j = 0; j < 3; j++)
        if (point->vertices[j] == vertex) return point->barycentric[j] >= 1.0;
    return 0;
}

/* Finds the last vertex of the shortest path to a point, or -1 if there is no path. */
static int last_on_path(const EdgeGraph *graph, Search *search, const JoinedPoint *end,
                        double longest, int64_t *last, int64_t *work)
{
    double least = INFINITY;
    int64_t vertex;
    *last = -1;
    for (;;) {
        TRY(next_vertex(graph, longest, search, &vertex, work));
        if (vertex < 0 || search->distances[vertex] >= least) return OK;
        for (int j = 0; j < 3; j++) {
            double length = search->distances[vertex] + end->away[j];
            if (end->vertices[j] != vertex || length > longest || length >= least) continue;
            least = length;
            *last = vertex;
        }
    }
}

/* Adds the points of a path but its end, each in the face of the segment after it. A start at a
   vertex is not repeated; nor is an end. */
static int add_path(const Mesh *mesh, const EdgeGraph *graph, const Search *search,
                    const JoinedPoint *start, const JoinedPoint *end, int64_t last,
                    PointList *points)
{
    int64_t first = last, length = 1;
    for (; search->previous[first] >= 0; first = search->previous[first]) length++;
    int64_t before = !lies_at(start, first), after = !lies_at(end, last);
    if (length + before + after == 1) before = 1; /* start and end are the same vertex */
    int64_t begin = points->count, added = before + length - 1 + after;
    if (points->room - begin < added) return ARRAY_TOO_SMALL;
    points->count += added;
    if (before) {
        points->faces[begin] = start->face;
        memcpy(points->barycentric + 3 * begin, start->barycentric, 3 * sizeof(double));
    }
    int64_t vertex = last, face = end->face;
    for (int64_t i = begin + before + length - 1; i >= begin + before; i--) {
        if (i < begin + added) {
            points->faces[i] = face;
            TRY(place_between(mesh, face, vertex, vertex, 0.0, points->barycentric + 3 * i));
        }
        if (search->arcs[vertex] >= 0) face = graph->faces[search->arcs[vertex]];
        vertex = search->previous[vertex];
    }
    return OK;
}

/* Finds the shortest paths along edges between points, from the path of index `done` on. Points are
   joined to the corners of their faces.

   It returns early after `most_work` arcs, or when the room that is left may not suffice for the
   next path; `done` is raised to the number of finished paths. */
EXPORTED int paths_along_edges(const Mesh *mesh, const EdgeGraph *graph, const PointPaths *paths,
                               PointList *points, double *scratch, int64_t scratch_items,
                               int64_t most_work, int64_t *done)
{
    Scratch memory = {scratch, scratch_items};
    Search search;
    int64_t work = 0, last;
    TRY(take_search(&memory, graph->vertex_count, &search));
    for (; *done < paths->q && work < most_work; ++*done) {
        CHECK(*done, paths->q);
        int64_t i = *done, begin = points->count;
        if (begin > 0 && points->room - begin <= graph->vertex_count) return OK;
        JoinedPoint start, end;
        TRY(join_point(mesh, paths->start_faces[i], paths->starts + 3 * i, &start));
        TRY(join_point(mesh, paths->end_faces[i], paths->ends + 3 * i, &end));
        for (int j = 0; j < 3; j++) {
            if (start.away[j] > paths->longest[i]) continue;
            TRY(reach(&search, start.vertices[j], start.away[j], -1, -1));
        }
        TRY(last_on_path(graph, &search, &end, paths->longest[i], &last, &work));
        if (last >= 0) TRY(add_path(mesh, graph, &search, &start, &end, last, points));
        paths->reached[i] = last >= 0;
        paths->counts[i] = points->count - begin;
        TRY(end_search(&search));
    }
    return OK;
}
