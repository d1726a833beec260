/* Nodes on a polyline: about equally spaced on each leg, and not inside folds.

   Over folded faces a straight trace runs forward, backward and forward again. Nodes inside the
   fold would reverse the curve twice. So segments that run backward over folded faces count with
   negative length, and a node is placed at the last point of the leg where the net length equals
   its share. */
#include "curve.h"

#include <string.h>

/* A polyline with its arc lengths, and the legs between its control points. */
typedef struct {
    const PointList *points;
    int64_t closed;
    int64_t s;        /* number of segments */
    double *arcs;     /* (s + 1) at the begins of the segments and at the end */
    double *positions; /* (points + 1, 3); the last one is the first one again */
    uint8_t *back;    /* (s) whether each segment runs backward over a fold */
    double *covered;  /* (s + 1) scratch: net lengths, and the lowest of them from there on */
    double *lowest;   /* (s + 1) */
    double *wanted;   /* (n + 1) arc lengths of the nodes, and of the end */
    int64_t *segment; /* (n) index of the segment on which each node lies */
} Line;

int64_t items_of_placement(int64_t n, int64_t points)
{
    return 3 * (points + 1) + 3 * (points + 1) + points / 8 + 2 + 2 * n + 1;
}

static int take_line(Scratch *scratch, int64_t n, const PointList *points, int64_t closed,
                     Line *line)
{
    int64_t count = points->count;
    if (count < 1) return INDEX_OUT_OF_RANGE;
    line->points = points;
    line->closed = closed;
    line->s = closed ? count : count - 1;
    TRY(take(scratch, count + 1, &line->arcs));
    TRY(take(scratch, 3 * (count + 1), &line->positions));
    TRY(take_bytes(scratch, count, &line->back));
    TRY(take(scratch, count + 1, &line->covered));
    TRY(take(scratch, count + 1, &line->lowest));
    TRY(take(scratch, n + 1, &line->wanted));
    return take_integers(scratch, n, &line->segment);
}

int find_arcs_of_points(const Mesh *mesh, const PointList *points, int64_t closed, double *arcs)
{
    double first[3], here[3], next[3];
    arcs[0] = 0.0;
    for (int64_t k = 0; k < points->count; k++) {
        TRY(position_in_face(mesh, points->faces[k], points->barycentric + 3 * k, next));
        if (k > 0) arcs[k] = arcs[k - 1] + distance_between(next, here);
        if (k == 0) memcpy(first, next, sizeof first);
        memcpy(here, next, sizeof here);
    }
    int64_t last = points->count - 1;
    arcs[last + 1] = arcs[last] + (closed ? distance_between(first, here) : 0.0);
    return OK;
}

static double share_of(const Line *line, int64_t segment, double wanted)
{
    double length = line->arcs[segment + 1] - line->arcs[segment];
    double share = (wanted - line->arcs[segment]) / greater(length, TINY);
    return lesser(greater(share, 0.0), 1.0);
}

/* The position at an arc length; on a closed curve also below zero and beyond the end. */
static void position_at(const Line *line, double wanted, double position[3])
{
    double total = line->arcs[line->s];
    if (line->closed && wanted < 0.0) wanted += total;
    if (line->closed && wanted > total) wanted -= total;
    wanted = lesser(greater(wanted, 0.0), total);
    int64_t k = segment_at(line->arcs, 0, line->s + 1, wanted);
    double share = share_of(line, k, wanted);
    for (int axis = 0; axis < 3; axis++) {
        double begin = line->positions[3 * k + axis], end = line->positions[3 * (k + 1) + axis];
        position[axis] = begin + share * (end - begin);
    }
}

/* Finds which segments run over folded faces against the direction of the curve. */
static void find_backward(const Surface *surface, const PlacementRules *rules, const Line *line)
{
    double reach = lesser(rules->reach, rules->shortest_turn * line->arcs[line->s]);
    for (int64_t k = 0; k < line->s; k++) {
        line->back[k] = 0;
        if (!surface->folded || !surface->folded[line->points->faces[k]]) continue;
        double middle = 0.5 * (line->arcs[k] + line->arcs[k + 1]), ahead[3], behind[3], along = 0.0;
        position_at(line, middle + reach, ahead);
        position_at(line, middle - reach, behind);
        const double *begin = line->positions + 3 * k;
        for (int axis = 0; axis < 3; axis++)
            along += (begin[3 + axis] - begin[axis]) * (ahead[axis] - behind[axis]);
        line->back[k] = along < 0.0;
    }
}

/* Measures a polyline. */
static int measure_line(const Surface *surface, const PlacementRules *rules, Line *line)
{
    const PointList *points = line->points;
    TRY(find_arcs_of_points(&surface->mesh, points, line->closed, line->arcs));
    for (int64_t k = 0; k <= points->count; k++) {
        int64_t point = k < points->count ? k : 0;
        TRY(position_in_face(&surface->mesh, points->faces[point], points->barycentric + 3 * point,
                             line->positions + 3 * k));
    }
    find_backward(surface, rules, line);
    return OK;
}

/* Net lengths of a leg, without the parts that run backward; `end` is the end of its segments. */
static double net_length(const Line *line, int64_t begin, int64_t end)
{
    double *covered = line->covered, *lowest = line->lowest;
    covered[begin] = 0.0;
    for (int64_t k = begin; k < end; k++) {
        double step = line->arcs[k + 1] - line->arcs[k];
        covered[k + 1] = covered[k] + (line->back[k] ? -step : step);
    }
    double total = covered[end];
    for (int64_t k = end; k >= begin; k--) {
        covered[k] = lesser(greater(covered[k], 0.0), greater(total, 0.0));
        lowest[k] = k < end ? lesser(covered[k], lowest[k + 1]) : covered[k];
    }
    return total;
}

/* Places the nodes of a leg with `count` steps: the first one at the control point where it begins,
   and the others evenly. */
static void place_on_leg(const Line *line, int64_t begin, int64_t end, int64_t count,
                         int64_t first_node)
{
    int runs_back = 0;
    for (int64_t k = begin; k < end; k++) runs_back |= line->back[k];
    double net = runs_back ? net_length(line, begin, end) : 0.0;
    double low = line->arcs[begin], length = line->arcs[end] - low;
    line->wanted[first_node] = low;
    line->segment[first_node] = begin;
    for (int64_t j = 1, k = begin; j < count; j++) {
        double share = (double)j / (double)count, wanted = low + share * length;
        if (net > 0.0) {
            while (k + 1 < end && line->lowest[k + 1] <= share * net) k++;
            double rise = greater(line->covered[k + 1] - line->covered[k], TINY);
            double along = (share * net - line->covered[k]) / rise;
            along = lesser(greater(along, 0.0), 1.0);
            wanted = line->arcs[k] + along * (line->arcs[k + 1] - line->arcs[k]);
        } else {
            while (k + 1 < end && line->arcs[k + 1] <= wanted) k++;
        }
        line->wanted[first_node + j] = wanted;
        line->segment[first_node + j] = k;
    }
}

/* Number of steps of a leg. */
static int64_t steps_of_leg(const PlacementRules *rules, double length, double total, int64_t count)
{
    double share = (double)count * length / greater(total, TINY);
    int64_t steps = share > (double)rules->fewest_of_leg ? (int64_t)floor(share + 0.5) : 0;
    return steps > rules->fewest_of_leg ? steps : rules->fewest_of_leg;
}

/* Finds where the nodes lie; the number of nodes and which ones are control points are stored in
   the curve. */
static int place_on_legs(const PlacementRules *rules, const Line *line, int64_t k,
                         const int64_t *controls, const uint8_t *corners, int64_t count,
                         Curve *placed)
{
    int64_t legs = line->closed ? k : k - 1;
    for (int64_t leg = 0; leg < k; leg++) {
        CHECK(controls[leg], line->points->count);
        if (leg > 0 && controls[leg] <= controls[leg - 1]) return INDEX_OUT_OF_RANGE;
    }
    int64_t last = line->closed ? line->s : controls[k - 1];
    double total = line->arcs[last] - line->arcs[controls[0]];
    placed->n = 0;
    for (int64_t leg = 0; leg < legs; leg++) {
        int64_t begin = controls[leg], end = leg + 1 < k ? controls[leg + 1] : last;
        int64_t steps = steps_of_leg(rules, line->arcs[end] - line->arcs[begin], total, count);
        if (placed->n + steps + 1 > placed->room) return ARRAY_TOO_SMALL;
        memset(placed->is_control + placed->n, 0, (size_t)steps);
        memset(placed->is_corner + placed->n, 0, (size_t)steps);
        placed->is_control[placed->n] = 1;
        placed->is_corner[placed->n] = corners[leg];
        place_on_leg(line, begin, end, steps, placed->n);
        placed->n += steps;
    }
    if (!line->closed) {
        placed->is_control[placed->n] = 1;
        placed->is_corner[placed->n] = corners[k - 1];
        line->wanted[placed->n] = line->arcs[last];
        line->segment[placed->n] = last;
        placed->n++;
    }
    line->wanted[placed->n] = line->arcs[line->s];
    return OK;
}

/* Computes the place of a node on its segment. */
static int find_place(const Mesh *mesh, const PlacementRules *rules, const Line *line, int64_t i,
                      const Curve *placed)
{
    const PointList *points = line->points;
    int64_t k = line->segment[i], next = k + 1 < points->count ? k + 1 : 0;
    CHECK(k, points->count);
    const double *here = points->barycentric + 3 * k;
    double there[3], *place = placed->barycentric + 3 * i;
    placed->faces[i] = points->faces[k];
    memcpy(place, here, sizeof there);
    if (placed->is_control[i]) return OK;
    TRY(change_face(mesh, points->faces[next], points->barycentric + 3 * next, points->faces[k],
                    there));
    double along = share_of(line, k, line->wanted[i]);
    for (int j = 0; j < 3; j++) place[j] = (1.0 - along) * here[j] + along * there[j];
    move_inside(place, rules->least_inside);
    return OK;
}

/* Whether a point of the polyline lies inside a face, at the same place as a node. `node` is the
   first node that is not before the point. */
static int is_replaced(const PlacementRules *rules, const Line *line, int64_t k, int64_t node)
{
    const double *here = line->points->barycentric + 3 * k;
    if (!(here[0] > 0.0 && here[1] > 0.0 && here[2] > 0.0)) return 0;
    double nearest = node > 0 ? lesser(line->wanted[node] - line->arcs[k],
                                       line->arcs[k] - line->wanted[node - 1])
                              : 0.0;
    return nearest < rules->same_place * line->arcs[line->s];
}

int place_on_polyline(const Surface *surface, const PlacementRules *rules, const PointList *points,
                      int64_t closed, int64_t k, const int64_t *controls, const uint8_t *corners,
                      int64_t count, Scratch scratch, Curve *placed)
{
    Line line;
    if (k < 1 || controls[0] != 0 || (k < 2 && !closed)) return INDEX_OUT_OF_RANGE;
    TRY(take_line(&scratch, placed->room, points, closed, &line));
    TRY(measure_line(surface, rules, &line));
    TRY(place_on_legs(rules, &line, k, controls, corners, count, placed));
    placed->closed = closed;
    placed->polyline.count = 0;
    memset(placed->is_stuck, 0, (size_t)placed->n);
    for (int64_t p = 0, i = 0, ahead = 0; p < points->count; p++) {
        while (ahead < placed->n && line.wanted[ahead] < line.arcs[p]) ahead++;
        int is_control = i < placed->n && placed->is_control[i] && line.segment[i] == p;
        if (!is_control && !is_replaced(rules, &line, p, ahead))
            TRY(append_point(points->faces[p], points->barycentric + 3 * p, &placed->polyline));
        for (; i < placed->n && line.segment[i] == p; i++) {
            TRY(find_place(&surface->mesh, rules, &line, i, placed));
            placed->node_index[i] = placed->polyline.count;
            TRY(append_point(placed->faces[i], placed->barycentric + 3 * i, &placed->polyline));
        }
    }
    return OK;
}

int copy_curve(const Curve *from, Curve *to)
{
    size_t n = (size_t)from->n, count = (size_t)from->polyline.count;
    if (from->n > to->room || from->polyline.count > to->polyline.room) return ARRAY_TOO_SMALL;
    to->n = from->n;
    to->closed = from->closed;
    to->polyline.count = from->polyline.count;
    memcpy(to->faces, from->faces, n * sizeof *from->faces);
    memcpy(to->barycentric, from->barycentric, 3 * n * sizeof *from->barycentric);
    memcpy(to->is_control, from->is_control, n);
    memcpy(to->is_corner, from->is_corner, n);
    memcpy(to->is_stuck, from->is_stuck, n);
    memcpy(to->node_index, from->node_index, n * sizeof *from->node_index);
    memcpy(to->polyline.faces, from->polyline.faces, count * sizeof *from->faces);
    memcpy(to->polyline.barycentric, from->polyline.barycentric,
           3 * count * sizeof *from->barycentric);
    return OK;
}

EXPORTED int64_t placement_items(int64_t n, int64_t points)
{
    return items_of_placement(n, points);
}

/* Places nodes on a polyline; see `place_on_polyline`. */
EXPORTED int place_curve(const Surface *surface, const PlacementRules *rules,
                         const PointList *points, int64_t closed, int64_t k,
                         const int64_t *controls, const uint8_t *corners, int64_t count,
                         double *scratch, int64_t scratch_items, Curve *placed)
{
    const Scratch memory = {scratch, scratch_items};
    return place_on_polyline(surface, rules, points, closed, k, controls, corners, count, memory,
                             placed);
}
