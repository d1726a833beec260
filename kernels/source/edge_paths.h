/* Shortest paths along the edges of a mesh, vertex by vertex. */
#ifndef NICMM_EDGE_PATHS_H
#define NICMM_EDGE_PATHS_H

#include "mesh.h"
#include "queue.h"

/* The arcs from every vertex to its neighbours. */
typedef struct {
    int64_t vertex_count, arc_count;
    int64_t *begins; /* (V + 1) index of the first arc of each vertex; and the number of arcs */
    int64_t *ends;   /* (arc_count) vertices */
    int64_t *faces;  /* (arc_count) the first face that has the edge */
    double *lengths; /* (arc_count) */
} EdgeGraph;

/* A search for paths from one place. All arrays are as new between two searches. */
typedef struct {
    double *distances; /* (V) least lengths of paths found so far */
    int64_t *previous; /* (V) the vertex before each vertex on its path, -1 if it is the first */
    int64_t *arcs;     /* (V) the arc from there */
    int64_t *reached;  /* (V) vertices with a distance */
    int64_t reached_count;
    Queue queue;
} Search;

/* Number of items of scratch that `take_search` takes, for V vertices. */
EXPORTED int64_t edge_search_items(int64_t v);
int take_search(Scratch *scratch, int64_t v, Search *search);

/* Records a path to a vertex unless a path that is not longer is known. */
int reach(Search *search, int64_t vertex, double distance, int64_t previous, int64_t arc);

/* Finds the next vertex by distance, or -1 if there is none; goes on from it up to a distance. */
int next_vertex(const EdgeGraph *graph, double longest, Search *search, int64_t *vertex,
                int64_t *work);

int end_search(Search *search);

#endif
