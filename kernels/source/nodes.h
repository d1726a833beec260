/* Nodes of a curve on a surface, with what the energy needs to know of them. */
#ifndef NICMM_NODES_H
#define NICMM_NODES_H

#include "scratch.h"
#include "surface.h"

/* The n nodes of one curve. */
typedef struct {
    int64_t n;
    int64_t closed;       /* whether the last node is joined to the first */
    int64_t *faces;       /* (n) faces of the nodes */
    double *barycentric;  /* (n, 3) coordinates in them */
    double *positions;    /* (n, 3) */
    double *normals;      /* (n, 3) unit normals of the surface */
    double *phi_fea;      /* (n) */
    double *steps;        /* (n, 3) to the next node; zero at the last node of an open curve */
    double *step_lengths; /* (n) */
    double *conormals;    /* (n, 3) unit vectors in the tangent planes, normal to the curve */
    double *angles;       /* (n) turning in the tangent plane; zero at the ends of open curves, and
                             at corners */
    const uint8_t *is_corner; /* (n) whether the curve may turn freely at each node; or NULL */
} Nodes;

static inline int64_t node_before(const Nodes *nodes, int64_t i)
{
    return i > 0 ? i - 1 : nodes->n - 1;
}

static inline int64_t node_after(const Nodes *nodes, int64_t i)
{
    return i + 1 < nodes->n ? i + 1 : 0;
}

/* Whether the curve may turn freely at a node: at the ends of an open curve, and at corners. */
static inline int turns_freely(const Nodes *nodes, int64_t i)
{
    int is_end = !nodes->closed && (i == 0 || i == nodes->n - 1);
    return is_end || (nodes->is_corner && nodes->is_corner[i]);
}

/* Whether there is a step from a node to the next one. */
static inline int has_step(const Nodes *nodes, int64_t i)
{
    return nodes->closed || i < nodes->n - 1;
}

/* -1 if the normals of two neighbouring nodes point to opposite sides of the surface, as on a
   surface without an orientation; else 1. */
static inline double side_of_next(const Nodes *nodes, int64_t i)
{
    const double *normal = nodes->normals + 3 * i;
    return dot(normal, nodes->normals + 3 * node_after(nodes, i)) < 0.0 ? -1.0 : 1.0;
}

/* Arc length that belongs to a node: half the sum of its two steps. */
static inline double arc_of_node(const Nodes *nodes, int64_t i)
{
    double sum = nodes->step_lengths[i] + nodes->step_lengths[node_before(nodes, i)];
    return greater(0.5 * sum, TINY);
}

/* Turning of a curve at a node, from the steps before and after it. */
typedef struct {
    double out_before, out_after; /* components of the steps along the normal */
    double product[3];            /* cross product of the steps */
    double sine, cosine;          /* of the angle, times the lengths in the tangent plane */
} Turn;

Turn turn_at(const double before[3], const double after[3], const double normal[3]);

/* Number of items of scratch that `take_nodes` takes for n nodes. */
int64_t items_of_nodes(int64_t n);
int take_nodes(Scratch *scratch, int64_t n, int64_t closed, Nodes *nodes);

/* Computes positions, normals and phi_fea of nodes from their places in faces. */
EXPORTED int place_nodes(const Surface *surface, const Nodes *nodes);

/* Computes steps, their lengths, conormals and angles from positions and normals. */
void measure_nodes(const Nodes *nodes);

/* Copies the places of nodes in faces. */
void copy_places(const Nodes *from, const Nodes *to);

double length_of_curve(const Nodes *nodes);

/* Mean distance between neighbouring nodes. */
double mean_step(const Nodes *nodes);

#endif
