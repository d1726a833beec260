/* A queue of items by cost, for shortest paths. */
#ifndef NICMM_QUEUE_H
#define NICMM_QUEUE_H

#include "scratch.h"

/* The item of least cost is first; of several ones of the same cost, that of the lowest index. So
   the order in which items leave does not depend on the order in which they entered. */
typedef struct {
    int64_t capacity; /* items are 0 ... capacity - 1 */
    int64_t count;    /* number of items in the queue */
    double *costs;    /* (capacity) of the items in the heap, in which four are below each one */
    int64_t *items;   /* (capacity) of the heap */
    int64_t *places;  /* (capacity) of the items in the heap, -1 outside */
} Queue;

enum { ITEMS_BELOW = 4 };

/* Number of items of scratch that `take_queue` takes. */
int64_t items_of_queue(int64_t capacity);
int take_queue(Scratch *scratch, int64_t capacity, Queue *queue);

/* Adds an item, or moves it forward because its cost is lower now. */
int enqueue(Queue *queue, int64_t item, double cost);

/* Removes the first item of a queue that is not empty. */
int dequeue(Queue *queue, int64_t *item);

#endif
