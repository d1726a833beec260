/* Exact distances along the surface from segments that lie in faces, up to a limit.

   Shortest paths from a segment are straight lines across unfolded faces. They are followed as
   windows, intervals of edges, as in Mitchell, Mount and Papadimitriou ("The discrete geodesic
   problem", 1987), in the order of their distances. Where a segment continues in another one, their
   lines are divided at the bisector of the angle between them. So windows overlap only where paths
   of different lengths meet; they are not trimmed there, and the least distance counts. Windows
   that no shortest path enters are removed with the criterion of Xin and Wang ("Improving Chen and
   Han's algorithm on the discrete geodesic problem", 2009). The cost follows the surface within the
   limit, not the size of the mesh. */
#include "segment_distances.h"

#include <string.h>

#include "arc_tangent.h"
#include "queue.h"
#include "vectors.h"

/* Lines of neighbouring segments overlap by this slope, so that rounding leaves no gap. */
static const double OVERLAP = 1.0 / 64.0;

/* Cosine of the angle between segments below which their lines are not divided. */
static const double SHARPEST = -0.99;

/* Cosine of the angle between segments below which the bend between them is sharp. */
static const double SHARP = 0.5;

/* Number of times that a side is halved to find the part of it that lines from a vertex reach. */
enum { HALVINGS = 7 };

/* Amount by which the angle around a vertex is greater than a full angle at least, if it is. */
static const double SADDLE = 1e-9;

static double cross_of(Vector one, Vector other)
{
    return one.x * other.y - one.y * other.x;
}

static Vector way(Vector from, Vector to)
{
    Vector found = {to.x - from.x, to.y - from.y};
    return found;
}

static double norm(Vector vector)
{
    return sqrt(vector.x * vector.x + vector.y * vector.y);
}

static Vector point_between(Vector start, Vector end, double share)
{
    Vector found = {start.x + share * (end.x - start.x), start.y + share * (end.y - start.y)};
    return found;
}

/* Position of the nearest point of a segment, as a fraction of its length. */
static double nearest_share(Vector start, Vector end, Vector point)
{
    Vector along = way(start, end), to = way(start, point);
    double squared = greater(along.x * along.x + along.y * along.y, TINY);
    return lesser(greater((to.x * along.x + to.y * along.y) / squared, 0.0), 1.0);
}

/* The nearest point of a segment. */
static Vector nearest_on(Vector start, Vector end, Vector point)
{
    return point_between(start, end, nearest_share(start, end, point));
}

/* A face in the plane, seen from one of its sides. */
typedef struct {
    double origin[3], x_axis[3], y_axis[3];
    double length; /* of the side */
    Vector apex;   /* the corner opposite to it */
} Plane;

static int plane_of(const Mesh *mesh, int64_t side, Plane *plane)
{
    const double *corners[3];
    CHECK(side, 3 * mesh->face_count);
    int64_t own = side % 3;
    TRY(corners_of(mesh, side / 3, corners));
    double to_apex[3];
    for (int i = 0; i < 3; i++) {
        plane->origin[i] = corners[FIRST_END[own]][i];
        plane->x_axis[i] = corners[SECOND_END[own]][i] - plane->origin[i];
        to_apex[i] = corners[own][i] - plane->origin[i];
    }
    plane->length = length_of(plane->x_axis);
    for (int i = 0; i < 3; i++) plane->x_axis[i] /= greater(plane->length, TINY);
    plane->apex.x = dot(to_apex, plane->x_axis);
    for (int i = 0; i < 3; i++)
        plane->y_axis[i] = to_apex[i] - plane->apex.x * plane->x_axis[i];
    plane->apex.y = length_of(plane->y_axis);
    for (int i = 0; i < 3; i++) plane->y_axis[i] /= greater(plane->apex.y, TINY);
    return OK;
}

static Vector direction_in(const Plane *plane, const double direction[3])
{
    Vector found = {dot(direction, plane->x_axis), dot(direction, plane->y_axis)};
    return found;
}

/* A point of the face, by barycentric coordinates. */
static Vector point_in(const Plane *plane, int64_t own, const double *barycentric)
{
    Vector found = {barycentric[SECOND_END[own]] * plane->length + barycentric[own] * plane->apex.x,
                    barycentric[own] * plane->apex.y};
    return found;
}

/* The nearest place of a segment to a point in its plane. */
static Nearest nearest_place(Vector start, Vector end, double before, double from, double to,
                             double side, Vector point)
{
    double share = nearest_share(start, end, point);
    Vector away = way(point_between(start, end, share), point);
    Nearest found = {before + norm(away), (1.0 - share) * from + share * to, side};
    return found;
}

/* The nearest place to a point of the face beyond a window; infinitely far if it is not seen. */
static Nearest nearest_if_seen(const Window *window, Vector point, double scale)
{
    Vector nearest = nearest_on(window->start, window->end, point), away = way(nearest, point);
    double crossing = point.x;
    if (away.y > 0.0) crossing = nearest.x - away.x * nearest.y / away.y;
    Nearest found = nearest_place(window->start, window->end, window->before, window->from,
                                  window->to, window->side, point);
    if (crossing < window->low - scale || crossing > window->high + scale)
        found.distance = INFINITY;
    return found;
}

/* The angle between two directions, in [0, pi]. */
static double angle_between(Vector one, Vector other)
{
    return angle_of(fabs(cross_of(one, other)), one.x * other.x + one.y * other.y);
}

/* Lowers the distance of the vertex at a corner. */
static int lower(const Mesh *mesh, Propagation *work, int64_t corner, Nearest nearest,
                 double arrival)
{
    int64_t vertex;
    TRY(vertex_at(mesh, corner, &vertex));
    if (!(nearest.distance < work->distances[vertex] - work->scale)) return OK;
    work->distances[vertex] = nearest.distance;
    work->feet[vertex] = nearest.arc;
    work->beside[vertex] = nearest.side;
    work->corners[vertex] = corner;
    work->arrivals[vertex] = arrival;
    if (nearest.distance >= work->limit) return OK;
    Queue queue = {mesh->vertex_count + work->room, work->queued, work->costs, work->items,
                   work->places};
    TRY(enqueue(&queue, vertex, nearest.distance));
    work->queued = queue.count;
    return OK;
}

/* Lowers the distance of the corner opposite to a side by a straight path from a segment. */
static int lower_apex(const Mesh *mesh, Propagation *work, int64_t side, Vector apex, Vector start,
                      Vector end, Nearest nearest)
{
    Vector path = way(apex, nearest_on(start, end, apex)), first = {-apex.x, -apex.y};
    return lower(mesh, work, side, nearest, angle_between(first, path));
}

static double distance_at(const Window *window, double x)
{
    Vector point = {x, 0.0};
    return window->before + norm(way(nearest_on(window->start, window->end, point), point));
}

/* Least distance of a window, or infinity if no shortest path up to the limit passes through it. */
static int least_distance(const Mesh *mesh, const Propagation *work, int64_t side,
                          const Window *window, double *least)
{
    int64_t first, second;
    Plane plane;
    TRY(ends_of(mesh, side, &first, &second));
    TRY(plane_of(mesh, side, &plane));
    double at_low = distance_at(window, window->low), at_high = distance_at(window, window->high);
    Vector low = {window->low, 0.0}, high = {window->high, 0.0};
    double from_start = norm(way(nearest_on(low, high, window->start), window->start));
    double from_end = norm(way(nearest_on(low, high, window->end), window->end));
    *least = lesser(lesser(at_low, at_high), window->before + lesser(from_start, from_end));
    /* Where a path through a vertex is as short at the far end, it is everywhere. */
    int is_useful = at_high < work->distances[first] + window->high - work->scale &&
                    at_low < work->distances[second] + plane.length - window->low - work->scale;
    if (!is_useful || !(*least < work->limit)) *least = INFINITY;
    return OK;
}

/* Whether a straight path to an end of a window runs along the edge and reaches it from outside of
   the window. Then no path leads through the window; this one continues at a vertex. */
static int is_grazed(const Window *window, double scale)
{
    Vector low = {window->low, 0.0}, high = {window->high, 0.0};
    Vector to_low = nearest_on(window->start, window->end, low);
    Vector to_high = nearest_on(window->start, window->end, high);
    return (to_low.y >= -scale && to_low.x < low.x - scale) ||
           (to_high.y >= -scale && to_high.x > high.x + scale);
}

/* Leaves the part of a window's segment with y <= 0, up to rounding. Returns whether there is
   one. */
static int cut_at_edge(Window *window, double scale)
{
    int start_is_higher = window->start.y > window->end.y;
    Vector *higher = start_is_higher ? &window->start : &window->end;
    Vector *lower = start_is_higher ? &window->end : &window->start;
    if (lower->y > scale) return 0;
    if (higher->y > scale) {
        double share = lower->y < 0.0 ? lower->y / (lower->y - higher->y) : 0.0;
        double *high_arc = start_is_higher ? &window->from : &window->to;
        double low_arc = start_is_higher ? window->to : window->from;
        higher->x = lower->x + share * (higher->x - lower->x);
        *high_arc = low_arc + share * (*high_arc - low_arc);
    }
    higher->y = lesser(higher->y, 0.0);
    lower->y = lesser(lower->y, 0.0);
    return 1;
}

/* Adds a window on a side of a face, given in the plane of this face, which has y > 0. Nothing is
   added at a boundary, or if the window is of no use. */
static int add_window(const Mesh *mesh, Propagation *work, int64_t side, const Window *given,
                      double length)
{
    CHECK(side, 3 * mesh->face_count);
    int64_t beyond = mesh->opposite_sides[side], first, second, first_beyond;
    if (beyond == side) return OK;
    TRY(ends_of(mesh, side, &first, &second));
    TRY(ends_of(mesh, beyond, &first_beyond, &second));
    int is_turned = first != first_beyond;
    double sign = is_turned ? -1.0 : 1.0, shift = is_turned ? length : 0.0;
    Window window = {
        {shift + sign * given->start.x, -given->start.y},
        {shift + sign * given->end.x, -given->end.y},
        given->before,
        given->from,
        given->to,
        given->side,
        greater(is_turned ? length - given->high : given->low, 0.0),
        lesser(is_turned ? length - given->low : given->high, length),
        {0.0, 0.0},
        {0.0, 0.0},
    };
    Vector at_low = is_turned ? given->at_high : given->at_low;
    Vector at_high = is_turned ? given->at_low : given->at_high;
    window.at_low.x = sign * at_low.x;
    window.at_low.y = -at_low.y;
    window.at_high.x = sign * at_high.x;
    window.at_high.y = -at_high.y;
    if (!(window.high - window.low > work->scale)) return OK;
    if (!cut_at_edge(&window, work->scale)) return OK;
    if (is_grazed(&window, work->scale)) return OK;
    double least;
    TRY(least_distance(mesh, work, beyond, &window, &least));
    if (least == INFINITY) return OK;
    if (work->count >= work->room) return ARRAY_TOO_SMALL;
    work->sides[work->count] = beyond;
    work->windows[work->count] = window;
    Queue queue = {mesh->vertex_count + work->room, work->queued, work->costs, work->items,
                   work->places};
    TRY(enqueue(&queue, mesh->vertex_count + work->count++, least));
    work->queued = queue.count;
    return OK;
}

/* Lowers `high` or raises `low` so that a linear function is not negative between them. */
static void clip(double at_zero, double at_one, double *low, double *high)
{
    double zero = at_zero / (at_zero - at_one);
    if (at_zero < 0.0 && at_one < 0.0)
        *high = -1.0;
    else if (at_zero < 0.0)
        *low = greater(*low, at_one > 0.0 ? zero : 1.0);
    else if (at_one < 0.0)
        *high = lesser(*high, zero);
}

/* Direction of the line to a point of an edge from the nearest point of a segment; that of a given
   line if the segment touches the edge there. In the plane of the face that is left, it leads to
   y <= 0. */
static Vector line_through(const Window *window, double x, Vector line, double along, double scale)
{
    Vector point = {x, 0.0}, found = way(nearest_on(window->start, window->end, point), point);
    if (norm(found) <= scale) found = line;
    if (found.y >= 0.0) {
        found.x = along;
        found.y = 0.0;
    }
    return found;
}

/* Adds the window of the lines on one side of a segment through a side of its own face.

   arcs : arc lengths at the start and at the end
   sign : 1 for the lines to the left of the segment, -1 for those to the right
   lines : directions of the outermost lines, at the start and at the end */
static int add_from_segment(const Mesh *mesh, Propagation *work, int64_t side, const Plane *plane,
                            Vector start, Vector end, const double arcs[2], Vector along,
                            double sign, const Vector lines[2])
{
    Vector corners[2] = {{0.0, 0.0}, {plane->length, 0.0}};
    double values[3][2], low = 0.0, high = 1.0;
    for (int i = 0; i < 2; i++) {
        values[0][i] = sign * cross_of(along, way(start, corners[i]));
        values[1][i] = sign * cross_of(way(start, corners[i]), lines[0]);
        values[2][i] = sign * cross_of(lines[1], way(end, corners[i]));
        for (int k = 0; k < 3; k++)
            if (values[k][i] >= -work->scale) values[k][i] = greater(values[k][i], 0.0);
    }
    for (int k = 0; k < 3; k++) clip(values[k][0], values[k][1], &low, &high);
    if (!(low < high)) return OK;
    /* Lines that lead away from a side meet it only beyond an end of the segment. If the segment is
       almost parallel to the side, rounding errors are that large. */
    if (norm(way(start, end)) > work->scale && sign * along.x > 0.0 &&
        (high - low) * plane->length * fabs(along.y) <= work->scale)
        return OK;
    Window window = {start, end, 0.0, arcs[0], arcs[1], sign, low * plane->length,
                     high * plane->length, {0, 0}, {0, 0}};
    Vector at_low = {window.low, 0.0}, at_high = {window.high, 0.0};
    int low_at_end = norm(way(at_low, end)) < norm(way(at_low, start));
    int high_at_end = norm(way(at_high, end)) < norm(way(at_high, start));
    window.at_low = line_through(&window, window.low, lines[low_at_end], -1.0, work->scale);
    window.at_high = line_through(&window, window.high, lines[high_at_end], 1.0, work->scale);
    return add_window(mesh, work, side, &window, plane->length);
}

/* The direction of a segment, in space; zero if it has no length. */
static int direction_of(const Mesh *mesh, const Propagation *work, int64_t segment,
                        double direction[3])
{
    const double *corners[3];
    double start[3], end[3];
    CHECK(segment, work->s);
    TRY(corners_of(mesh, work->faces[segment], corners));
    interpolate(corners, work->starts + 3 * segment, start);
    interpolate(corners, work->ends + 3 * segment, end);
    for (int i = 0; i < 3; i++) direction[i] = end[i] - start[i];
    double length = length_of(direction);
    for (int i = 0; i < 3; i++) direction[i] = length > work->scale ? direction[i] / length : 0.0;
    return OK;
}

/* The direction of a neighbouring segment, unfolded into the plane of a face; zero if it is in
   neither this face nor one beside it. */
static int unfolded_direction(const Mesh *mesh, const Propagation *work, int64_t face,
                              int64_t neighbour, double found[3])
{
    double direction[3];
    for (int i = 0; i < 3; i++) found[i] = 0.0;
    if (neighbour < 0) return OK;
    TRY(direction_of(mesh, work, neighbour, direction));
    if (work->faces[neighbour] == face) {
        memcpy(found, direction, sizeof direction);
        return OK;
    }
    for (int64_t side = 3 * face; side < 3 * face + 3; side++) {
        int64_t beyond = mesh->opposite_sides[side];
        if (beyond == side || beyond / 3 != work->faces[neighbour]) continue;
        Plane plane, other;
        TRY(plane_of(mesh, side, &plane));
        TRY(plane_of(mesh, beyond, &other));
        double along = dot(direction, plane.x_axis), across = dot(direction, other.y_axis);
        for (int i = 0; i < 3; i++)
            found[i] = along * plane.x_axis[i] - across * plane.y_axis[i];
        return OK;
    }
    return OK;
}

/* The direction of the outermost line on one side of a segment at one of its ends.

   outward : 1 at the end, -1 at the start
   is_at_vertex : whether the end is a vertex, at which lines in all directions begin */
static Vector outermost(Vector along, Vector neighbour, double sign, double outward,
                        int is_at_vertex)
{
    Vector line = {outward * along.x, outward * along.y};
    Vector perpendicular = {-sign * along.y, sign * along.x}, limit = perpendicular;
    double cosine = along.x * neighbour.x + along.y * neighbour.y;
    if (!is_at_vertex) {
        if (norm(neighbour) < 0.5 || cosine < SHARPEST) return line;
        Vector mean = {along.x + neighbour.x, along.y + neighbour.y};
        double size = norm(mean);
        Vector bisector = {-sign * mean.y / size, sign * mean.x / size};
        /* On the inner side of a bend, the lines themselves are perpendicular to the segment. */
        if (outward * (bisector.x * along.x + bisector.y * along.y) >= 0.0) limit = bisector;
    }
    line.x = limit.x + OVERLAP * outward * along.x;
    line.y = limit.y + OVERLAP * outward * along.y;
    return line;
}

/* Marks a segment at the vertex at which it begins or ends, if it does.

   weights : barycentric coordinates of the end in its face
   is_at_vertex : becomes 1 if it does */
static int mark_at_vertex(const Mesh *mesh, int64_t *marks, int64_t face, const double *weights,
                          int64_t segment, int *is_at_vertex)
{
    *is_at_vertex = 0;
    for (int64_t j = 0; j < 3; j++) {
        int64_t vertex;
        if (weights[FIRST_END[j]] != 0.0 || weights[SECOND_END[j]] != 0.0) continue;
        TRY(vertex_at(mesh, 3 * face + j, &vertex));
        marks[vertex] = segment;
        *is_at_vertex = 1;
    }
    return OK;
}

/* The outer side of the bend between the directions of two segments; 0 if it is not sharp. */
static double outer_side(Vector before, Vector after)
{
    double turn = cross_of(before, after), cosine = before.x * after.x + before.y * after.y;
    if (norm(before) < 0.5 || norm(after) < 0.5 || cosine > SHARP) return 0.0;
    return turn > 0.0 ? -1.0 : 1.0;
}

/* The nearest place of a segment to a point in the plane of its face. */
static Nearest nearest_of_segment(const Propagation *work, int64_t segment, Vector start,
                                  Vector end, Vector point)
{
    const double *arcs = work->arcs + 2 * segment, *outer = work->outer + 2 * segment;
    double share = nearest_share(start, end, point);
    double side = cross_of(way(start, end), way(start, point)) < 0.0 ? -1.0 : 1.0;
    /* A point whose path begins at a bend is on the outer side of it. */
    if (share <= 0.0 && outer[0] != 0.0) side = outer[0];
    if (share >= 1.0 && outer[1] != 0.0) side = outer[1];
    return nearest_place(start, end, 0.0, arcs[0], arcs[1], side, point);
}

static int begin_segment(const Mesh *mesh, Propagation *work, int64_t segment)
{
    double direction[3], before[3], after[3];
    const double *arcs = work->arcs + 2 * segment;
    int64_t face = work->faces[segment];
    CHECK(face, mesh->face_count);
    CHECK(work->previous[segment] + 1, work->s + 1);
    CHECK(work->following[segment] + 1, work->s + 1);
    int at_start, at_end;
    TRY(mark_at_vertex(mesh, work->leaving, face, work->starts + 3 * segment, segment, &at_start));
    TRY(mark_at_vertex(mesh, work->arriving, face, work->ends + 3 * segment, segment, &at_end));
    TRY(direction_of(mesh, work, segment, direction));
    TRY(unfolded_direction(mesh, work, face, work->previous[segment], before));
    TRY(unfolded_direction(mesh, work, face, work->following[segment], after));
    for (int64_t side = 3 * face; side < 3 * face + 3; side++) {
        Plane plane;
        TRY(plane_of(mesh, side, &plane));
        int64_t own = side % 3;
        Vector start = point_in(&plane, own, work->starts + 3 * segment);
        Vector end = point_in(&plane, own, work->ends + 3 * segment);
        Vector along = direction_in(&plane, direction);
        if (norm(along) < 0.5) along.x = 1.0; /* a point, which has lines in all directions */
        double *outer = work->outer + 2 * segment;
        outer[0] = outer_side(direction_in(&plane, before), along);
        outer[1] = outer_side(along, direction_in(&plane, after));
        TRY(lower_apex(mesh, work, side, plane.apex, start, end,
                       nearest_of_segment(work, segment, start, end, plane.apex)));
        for (int is_right = 0; is_right < 2; is_right++) {
            double sign = is_right ? -1.0 : 1.0;
            Vector lines[2] = {
                outermost(along, direction_in(&plane, before), sign, -1.0, at_start),
                outermost(along, direction_in(&plane, after), sign, 1.0, at_end)};
            TRY(add_from_segment(mesh, work, side, &plane, start, end, arcs, along, sign, lines));
        }
    }
    return OK;
}

static Vector in_axes(Vector vector, Vector x_axis)
{
    Vector found = {vector.x * x_axis.x + vector.y * x_axis.y,
                    vector.y * x_axis.x - vector.x * x_axis.y};
    return found;
}

/* Adds the part of a side of a face that is seen through a window on another one. The face is to
   the left of the side, which runs from the line at the high end of the window to that at the low
   end. */
static int add_through_window(const Mesh *mesh, Propagation *work, int64_t side,
                              const Window *window, Vector begin, Vector end)
{
    Vector at_low = {window->low, 0.0}, at_high = {window->high, 0.0}, edge = way(begin, end);
    double length = norm(edge), low = 0.0, high = 1.0;
    if (!(length > 0.0)) return OK;
    clip(cross_of(way(at_low, begin), window->at_low), cross_of(way(at_low, end), window->at_low),
         &low, &high);
    clip(cross_of(window->at_high, way(at_high, begin)),
         cross_of(window->at_high, way(at_high, end)), &low, &high);
    if (!(low < high)) return OK;
    Vector x_axis = {edge.x / length, edge.y / length};
    Window next = {.start = in_axes(way(begin, window->start), x_axis),
                   .end = in_axes(way(begin, window->end), x_axis),
                   .before = window->before,
                   .from = window->from,
                   .to = window->to,
                   .side = window->side,
                   .low = low * length,
                   .high = high * length};
    Vector first = in_axes(window->at_high, x_axis), last = in_axes(window->at_low, x_axis);
    next.at_low = low > 0.0 && first.y < 0.0
                      ? first
                      : line_through(&next, next.low, first, -1.0, work->scale);
    next.at_high = high < 1.0 && last.y < 0.0
                       ? last
                       : line_through(&next, next.high, last, 1.0, work->scale);
    return add_window(mesh, work, side, &next, length);
}

/* Adds the windows on the other two sides of the face that a window leads into. */
static int cross_face(const Mesh *mesh, Propagation *work, int64_t side, Window window)
{
    Plane plane;
    TRY(plane_of(mesh, side, &plane));
    int64_t own = side % 3, face_start = side - own;
    Vector apex = plane.apex, first = {0.0, 0.0}, second = {plane.length, 0.0};
    Nearest nearest = nearest_if_seen(&window, apex, work->scale);
    if (nearest.distance < INFINITY)
        TRY(lower_apex(mesh, work, side, apex, window.start, window.end, nearest));
    int64_t sides[2] = {face_start + (own + 1) % 3, face_start + (own + 2) % 3};
    TRY(add_through_window(mesh, work, sides[0], &window, second, apex));
    return add_through_window(mesh, work, sides[1], &window, apex, first);
}

/* A corner at the same vertex in the face beyond one of the two sides there, or -1 at a boundary.

   side : the side through which the vertex is left; becomes the next one */
static int next_corner(const Mesh *mesh, int64_t vertex, int64_t *side, int64_t *corner)
{
    CHECK(*side, 3 * mesh->face_count);
    int64_t beyond = mesh->opposite_sides[*side], start, found;
    *corner = -1;
    if (beyond == *side) return OK;
    CHECK(beyond, 3 * mesh->face_count);
    start = beyond - beyond % 3;
    for (int64_t j = 0; j < 3; j++) {
        TRY(vertex_at(mesh, start + j, &found));
        if (found == vertex && start + j != beyond) *corner = start + j;
    }
    if (*corner >= 0) *side = 3 * start + 3 - beyond - *corner; /* the third one of this face */
    return OK;
}

/* The face at a corner in the plane, seen from the side opposite to it, and the angle there. */
typedef struct {
    Plane plane;
    Vector first, second; /* from the corner to the ends of the side */
    double angle;
} CornerView;

static int view_corner(const Mesh *mesh, int64_t corner, CornerView *view)
{
    TRY(plane_of(mesh, corner, &view->plane));
    Vector apex = view->plane.apex;
    Vector first = {-apex.x, -apex.y}, second = {view->plane.length - apex.x, -apex.y};
    view->first = first;
    view->second = second;
    view->angle = angle_between(first, second);
    return OK;
}

/* Lowers the distances of the other vertices of a face at a corner by paths along its sides.

   to_first, to_second : the nearest place to the corner, with the side on which each path lies */
static int lower_in_face(const Mesh *mesh, Propagation *work, int64_t corner,
                         const CornerView *view, Nearest to_first, Nearest to_second)
{
    int64_t own = corner % 3, start = corner - own;
    Vector first = view->first, second = view->second, along = {1.0, 0.0};
    to_first.distance += norm(first);
    to_second.distance += norm(second);
    /* Seen from the first end, the corner is the second end of the opposite side. */
    TRY(lower(mesh, work, start + FIRST_END[own], to_first,
              angle_between(along, way(first, (Vector){0.0, 0.0}))));
    return lower(mesh, work, start + SECOND_END[own], to_second, 0.0);
}

/* Adds the window of the lines from a vertex across the face at a corner that make an angle from
   `low` to `high` with the edge to the first end of the opposite side. */
static int add_from_vertex(const Mesh *mesh, Propagation *work, int64_t corner,
                           const CornerView *view, Nearest nearest, double low, double high)
{
    Vector apex = view->plane.apex, to_first = view->first;
    double length = view->plane.length, bounds[2] = {0.0, length}, wanted[2] = {low, high};
    for (int k = 0; k < 2; k++) { /* the widest interval of some that are halved in turn */
        double inside = k ? 0.0 : length, outside = bounds[k];
        for (int i = 0; i < HALVINGS; i++) {
            Vector to_middle = {0.5 * (inside + outside) - apex.x, -apex.y};
            double angle = angle_between(to_first, to_middle);
            if (k ? angle > wanted[k] : angle < wanted[k])
                outside = 0.5 * (inside + outside);
            else
                inside = 0.5 * (inside + outside);
        }
        bounds[k] = outside;
    }
    Window window = {apex, apex, nearest.distance, nearest.arc, nearest.arc, nearest.side,
                     bounds[0], bounds[1],
                     {bounds[0] - apex.x, -apex.y}, {bounds[1] - apex.x, -apex.y}};
    return add_window(mesh, work, corner, &window, length);
}

/* The faces around a vertex, in order, with their angles. */
typedef struct {
    int64_t vertex;
    int64_t first;   /* the corner at which it begins */
    int64_t corner;  /* the present one; -1 behind the boundary */
    int64_t side;    /* through which the present face is left */
    int64_t steps;   /* number of faces so far */
    int is_reversed; /* whether the face before is at the edge to the second end, not the first */
} Fan;

/* Begins at the corner at which the path to a vertex arrives. The present face is left at its
   second end, or at its first one if `is_reversed`. */
static Fan fan_around(const Propagation *work, int64_t vertex, int is_reversed)
{
    int64_t first = work->corners[vertex], own = first % 3;
    int64_t side = first - own + (is_reversed ? SECOND_END[own] : FIRST_END[own]);
    Fan fan = {vertex, first, first, side, 0, is_reversed};
    return fan;
}

static int is_in_fan(const Mesh *mesh, const Fan *fan)
{
    return fan->corner >= 0 && (fan->corner != fan->first || fan->steps == 0) &&
           fan->steps <= mesh->face_count;
}

static int next_in_fan(const Mesh *mesh, Fan *fan)
{
    TRY(next_corner(mesh, fan->vertex, &fan->side, &fan->corner));
    fan->steps++;
    if (fan->corner < 0) return OK;
    int64_t own = fan->corner % 3;
    fan->is_reversed = fan->side == fan->corner - own + SECOND_END[own];
    return OK;
}

/* Directions at a vertex, as angles from the first edge of the fan around it. They increase in the
   order of the fan, and decrease in that of the reversed fan at a boundary. */
typedef struct {
    double of_first;  /* angle of the first face */
    double sum;       /* of the angles of all faces */
    int is_boundary;
    double leaving;   /* direction of the curve, if it begins a segment here; else NAN */
    double arriving;  /* direction back along the curve, if a segment ends here; else NAN */
} Directions;

/* The angle of a direction in the face at a corner, from the edge at which a fan enters it. */
static double angle_in_face(const CornerView *view, int is_reversed, const double direction[3])
{
    return angle_between(is_reversed ? view->second : view->first,
                         direction_in(&view->plane, direction));
}

/* The angle in the present face of a fan of a segment that begins or ends at its vertex; NAN if it
   is in another face.

   sign : 1 if it begins there, -1 if it ends there */
static int angle_of_segment(const Mesh *mesh, const Propagation *work, const Fan *fan,
                            const CornerView *view, int64_t segment, double sign, double *angle)
{
    double along[3];
    *angle = NAN;
    if (segment < 0) return OK;
    CHECK(segment, work->s);
    if (work->faces[segment] != fan->corner / 3) return OK;
    TRY(direction_of(mesh, work, segment, along));
    for (int i = 0; i < 3; i++) along[i] *= sign;
    *angle = angle_in_face(view, fan->is_reversed, along);
    return OK;
}

/* Angles around a vertex; those of the curve only if it passes the vertex. */
static int directions_at(const Mesh *mesh, const Propagation *work, int64_t vertex,
                         Directions *found)
{
    Directions result = {0.0, 0.0, 0, NAN, NAN};
    int is_on_curve = work->distances[vertex] <= work->scale;
    for (int is_reversed = 0; is_reversed < 1 + result.is_boundary; is_reversed++) {
        Fan fan = fan_around(work, vertex, is_reversed);
        double begin = 0.0;
        while (is_in_fan(mesh, &fan)) {
            CornerView view;
            double leaving = NAN, arriving = NAN;
            TRY(view_corner(mesh, fan.corner, &view));
            if (fan.steps == 0) result.of_first = view.angle;
            if (fan.steps > 0 || !is_reversed) result.sum += view.angle;
            if (is_on_curve) {
                TRY(angle_of_segment(mesh, work, &fan, &view, work->leaving[vertex], 1.0,
                                     &leaving));
                TRY(angle_of_segment(mesh, work, &fan, &view, work->arriving[vertex], -1.0,
                                     &arriving));
            }
            double sign = is_reversed ? -1.0 : 1.0, offset = is_reversed ? result.of_first : 0.0;
            if (leaving == leaving) result.leaving = offset + sign * (begin + leaving);
            if (arriving == arriving) result.arriving = offset + sign * (begin + arriving);
            begin += view.angle;
            TRY(next_in_fan(mesh, &fan));
        }
        result.is_boundary = fan.corner < 0;
    }
    *found = result;
    return OK;
}

/* The side of the curve on which a direction at one of its vertices lies. */
static double side_of(const Directions *directions, double angle)
{
    double leaving = directions->leaving, arriving = directions->arriving;
    /* At its end, the curve is continued in the opposite direction. */
    double half = 0.5 * directions->sum;
    if (leaving != leaving) leaving = arriving < half ? arriving + half : arriving - half;
    if (arriving != arriving) arriving = leaving < half ? leaving + half : leaving - half;
    if (leaving != leaving) return 0.0;
    int is_between = angle > lesser(leaving, arriving) && angle < greater(leaving, arriving);
    return is_between == (leaving < arriving) ? 1.0 : -1.0;
}

/* The nearest place to a vertex, as seen from a point in some direction. */
static Nearest nearest_from(const Propagation *work, int64_t vertex, const Directions *directions,
                            double angle)
{
    Nearest nearest = {work->distances[vertex], work->feet[vertex], work->beside[vertex]};
    if (nearest.distance <= work->scale) nearest.side = side_of(directions, angle);
    return nearest;
}

/* Adds the lines from a vertex into the present face of a fan that make an angle from `low` to
   `high` with its first edge, on each side of the curve.

   sign : 1, or -1 in the reversed fan
   begin : angle of the edge at which the face is entered, from the first edge of this fan */
static int add_into_face(const Mesh *mesh, Propagation *work, const Fan *fan,
                         const CornerView *view, const Directions *directions, double sign,
                         double begin, double low, double high)
{
    double end = begin + view->angle;
    double offset = sign > 0.0 ? 0.0 : directions->of_first;
    double cuts[2] = {sign * (directions->leaving - offset),
                      sign * (directions->arriving - offset)};
    double from = greater(low, begin), last = lesser(high, end);
    while (from < last) {
        double to = last;
        for (int k = 0; k < 2; k++)
            if (cuts[k] > from && cuts[k] < to) to = cuts[k];
        Nearest nearest =
            nearest_from(work, fan->vertex, directions, offset + sign * 0.5 * (from + to));
        double least = fan->is_reversed ? end - to : from - begin;
        double most = fan->is_reversed ? end - from : to - begin;
        TRY(add_from_vertex(mesh, work, fan->corner, view, nearest, least, most));
        from = to;
    }
    return OK;
}

/* Follows paths along the edges of a fan, and adds the lines that make an angle from `low` to
   `high` with its first edge. */
static int add_from_fan(const Mesh *mesh, Propagation *work, Fan fan, const Directions *directions,
                        double low, double high)
{
    double sign = fan.is_reversed ? -1.0 : 1.0, begin = 0.0;
    double offset = fan.is_reversed ? directions->of_first : 0.0;
    while (is_in_fan(mesh, &fan)) {
        CornerView view;
        TRY(view_corner(mesh, fan.corner, &view));
        double end = begin + view.angle;
        Nearest entered = nearest_from(work, fan.vertex, directions, offset + sign * begin);
        Nearest left = nearest_from(work, fan.vertex, directions, offset + sign * end);
        TRY(lower_in_face(mesh, work, fan.corner, &view, fan.is_reversed ? left : entered,
                          fan.is_reversed ? entered : left));
        TRY(add_into_face(mesh, work, &fan, &view, directions, sign, begin, low, high));
        begin = end;
        TRY(next_in_fan(mesh, &fan));
    }
    return OK;
}

/* Follows paths along the edges at a vertex. Shortest paths also bend at a vertex with more than a
   full angle and on the boundary, by at least half a full angle on both sides; and they begin at a
   vertex on a segment, in all directions. */
static int leave_vertex(const Mesh *mesh, Propagation *work, int64_t vertex)
{
    double arrival = work->arrivals[vertex];
    CHECK(work->corners[vertex], 3 * mesh->face_count);
    Directions directions;
    TRY(directions_at(mesh, work, vertex, &directions));
    int is_source = work->distances[vertex] <= work->scale;
    double low = arrival + PI - OVERLAP, high = arrival + directions.sum - PI + OVERLAP;
    if (is_source) low = -INFINITY;
    if (is_source || directions.is_boundary) high = INFINITY;
    if (!is_source && !directions.is_boundary && directions.sum <= 2.0 * PI + SADDLE)
        low = INFINITY;
    TRY(add_from_fan(mesh, work, fan_around(work, vertex, 0), &directions, low, high));
    if (!directions.is_boundary) return OK;
    low = is_source ? -INFINITY : directions.of_first - arrival + PI - OVERLAP;
    return add_from_fan(mesh, work, fan_around(work, vertex, 1), &directions, low, INFINITY);
}

/* Finds the distances of vertices and all windows, in calls of about `most_work` windows each.

   done : 0 at first; 1 after the last call */
EXPORTED int segment_distances(const Mesh *mesh, Propagation *work, int64_t most_work,
                               int64_t *done)
{
    if (work->count == 0 && work->queued == 0) {
        if (!are_finite(work->starts, 3 * work->s) || !are_finite(work->ends, 3 * work->s))
            return NOT_FINITE;
        for (int64_t i = 0; i < work->s; i++) TRY(begin_segment(mesh, work, i));
    }
    for (int64_t steps = 0; steps < most_work; steps++) {
        if (work->queued == 0) {
            *done = 1;
            return OK;
        }
        Queue queue = {mesh->vertex_count + work->room, work->queued, work->costs, work->items,
                       work->places};
        int64_t item;
        TRY(dequeue(&queue, &item));
        work->queued = queue.count;
        if (item < mesh->vertex_count) {
            TRY(leave_vertex(mesh, work, item));
            continue;
        }
        item -= mesh->vertex_count;
        double least;
        TRY(least_distance(mesh, work, work->sides[item], &work->windows[item], &least));
        if (least == INFINITY)
            work->sides[item] = -1;
        else
            TRY(cross_face(mesh, work, work->sides[item], work->windows[item]));
    }
    return OK;
}

/* Index of the first of some ascending numbers that is not below a wanted one. */
static int64_t first_not_below(const int64_t *numbers, int64_t count, int64_t wanted)
{
    int64_t low = 0, high = count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (numbers[middle] < wanted)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* The side of the curve on which the straight path from a vertex of the curve to a point of a face
   lies.

   corner : the vertex, in the face */
static int side_at_vertex(const Mesh *mesh, const Propagation *found, int64_t corner,
                          const double direction[3], double *side)
{
    Directions directions;
    int64_t vertex;
    TRY(vertex_at(mesh, corner, &vertex));
    CHECK(found->corners[vertex], 3 * mesh->face_count);
    TRY(directions_at(mesh, found, vertex, &directions));
    for (int is_reversed = 0; is_reversed < 1 + directions.is_boundary; is_reversed++) {
        Fan fan = fan_around(found, vertex, is_reversed);
        double begin = 0.0;
        while (is_in_fan(mesh, &fan)) {
            CornerView view;
            TRY(view_corner(mesh, fan.corner, &view));
            if (fan.corner == corner) {
                double angle = begin + angle_in_face(&view, fan.is_reversed, direction);
                *side = side_of(&directions, is_reversed ? directions.of_first - angle : angle);
                return OK;
            }
            begin += view.angle;
            TRY(next_in_fan(mesh, &fan));
        }
    }
    return OK;
}

/* The nearest place to a point by a straight path in its face from a corner. */
static int nearest_from_corner(const Mesh *mesh, const Propagation *found, int64_t corner,
                               const double *place, const double position[3], Nearest *nearest)
{
    int64_t vertex;
    TRY(vertex_at(mesh, corner, &vertex));
    double through = found->distances[vertex] + distance_between(position, place);
    if (!(through < nearest->distance - found->scale)) return OK;
    nearest->distance = through;
    nearest->arc = found->feet[vertex];
    nearest->side = found->beside[vertex];
    if (found->distances[vertex] > found->scale) return OK;
    double direction[3];
    for (int i = 0; i < 3; i++) direction[i] = position[i] - place[i];
    return side_at_vertex(mesh, found, corner, direction, &nearest->side);
}

/* Segments in the face itself come first: a window that only touches a bend would show the points
   near it on the wrong side. */
int nearest_to_point(const Mesh *mesh, const Propagation *found, int64_t face,
                     const double weights[3], Nearest *nearest)
{
    double position[3];
    const double *corners[3];
    Nearest least = {INFINITY, 0.0, 0.0};
    Plane plane;
    TRY(corners_of(mesh, face, corners));
    interpolate(corners, weights, position);
    TRY(plane_of(mesh, 3 * face, &plane));
    Vector point = point_in(&plane, 0, weights);
    int64_t k = first_not_below(found->faces, found->s, face);
    for (; k < found->s && found->faces[k] == face; k++) {
        Vector start = point_in(&plane, 0, found->starts + 3 * k);
        Vector end = point_in(&plane, 0, found->ends + 3 * k);
        Nearest own = nearest_of_segment(found, k, start, end, point);
        if (own.distance < least.distance - found->scale) least = own;
    }
    k = first_not_below(found->sides, found->count, 3 * face);
    for (int64_t side = 3 * face; k < found->count && found->sides[k] < 3 * face + 3; k++) {
        if (found->sides[k] != side) {
            side = found->sides[k];
            TRY(plane_of(mesh, side, &plane));
            point = point_in(&plane, side % 3, weights);
        }
        Nearest seen = nearest_if_seen(&found->windows[k], point, found->scale);
        if (seen.distance < least.distance - found->scale) least = seen;
    }
    for (int j = 0; j < 3; j++)
        TRY(nearest_from_corner(mesh, found, 3 * face + j, corners[j], position, &least));
    *nearest = least;
    return OK;
}

/* The width at an arc length. */
static double width_at(const Propagation *found, double arc)
{
    int64_t low = 0, high = found->k - 1;
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (found->knots[middle] <= arc)
            low = middle;
        else
            high = middle;
    }
    double length = greater(found->knots[high] - found->knots[low], TINY);
    double share = lesser(greater((arc - found->knots[low]) / length, 0.0), 1.0);
    return (1.0 - share) * found->widths[low] + share * found->widths[high];
}

static double scaled(const Propagation *found, const Nearest *nearest)
{
    if (found->k == 0 || nearest->distance == INFINITY) return nearest->distance;
    return nearest->distance * found->least_width / width_at(found, nearest->arc);
}

int scaled_distance(const Mesh *mesh, const Propagation *found, int64_t face,
                    const double weights[3], double *distance)
{
    Nearest nearest;
    TRY(nearest_to_point(mesh, found, face, weights, &nearest));
    *distance = scaled(found, &nearest);
    return OK;
}

/* The nearest places to m points, and their scaled distances. */
EXPORTED int nearest_to_points(const Mesh *mesh, const Propagation *found, int64_t m,
                               const int64_t *faces, const double *barycentric, double *distances,
                               double *arcs, double *sides)
{
    for (int64_t i = 0; i < m; i++) {
        Nearest nearest;
        TRY(nearest_to_point(mesh, found, faces[i], barycentric + 3 * i, &nearest));
        distances[i] = scaled(found, &nearest);
        arcs[i] = nearest.arc;
        sides[i] = nearest.side;
    }
    return OK;
}
