/* A queue of items by cost, for shortest paths. */
#ifndef NICMM_QUEUE_H
#define NICMM_QUEUE_H

#include "scratch.h"

/* The item of least cost is first; of several ones of the same cost, that of the lowest index. So
   the order in which items leave does not depend on the order in which they entered. */
typedef struct {
    int64_t capacity;    /* items are 0 ... capacity - 1 */
    int64_t count;       /* number of items in the queue */
    const double *costs; /* (capacity) those of items in the queue may only fall */
    int64_t *items;      /* (capacity) a heap in which every item has four others below it */
    int64_t *places;     /* (capacity) of the items in the heap, -1 outside */
} Queue;

enum { ITEMS_BELOW = 4 };

int take_queue(Scratch *scratch, int64_t capacity, const double *costs, Queue *queue);

/* Adds an item, or moves it forward after its cost has fallen. */
int enqueue(Queue *queue, int64_t item);

/* Removes the first item of a queue that is not empty. */
int dequeue(Queue *queue, int64_t *item);

#endif
