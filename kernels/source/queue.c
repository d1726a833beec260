/* A queue of items by cost, as a heap. */
#include "queue.h"

int64_t items_of_queue(int64_t capacity)
{
    return 3 * capacity;
}

int take_queue(Scratch *scratch, int64_t capacity, Queue *queue)
{
    queue->capacity = capacity;
    queue->count = 0;
    TRY(take(scratch, capacity, &queue->costs));
    TRY(take_integers(scratch, capacity, &queue->items));
    TRY(take_integers(scratch, capacity, &queue->places));
    for (int64_t item = 0; item < capacity; item++) queue->places[item] = -1;
    return OK;
}

/* Whether an item of some cost comes before the one at a place of the heap. */
static int comes_before(const Queue *queue, int64_t item, double cost, int64_t place)
{
    return cost < queue->costs[place] ||
           (cost == queue->costs[place] && item < queue->items[place]);
}

static void put(Queue *queue, int64_t place, int64_t item, double cost)
{
    queue->costs[place] = cost;
    queue->items[place] = item;
    queue->places[item] = place;
}

int enqueue(Queue *queue, int64_t item, double cost)
{
    CHECK(item, queue->capacity);
    int64_t place = queue->places[item];
    if (place < 0) place = queue->count++;
    CHECK(place, queue->capacity);
    while (place > 0) {
        int64_t above = (place - 1) / ITEMS_BELOW;
        if (!comes_before(queue, item, cost, above)) break;
        put(queue, place, queue->items[above], queue->costs[above]);
        place = above;
    }
    put(queue, place, item, cost);
    return OK;
}

int dequeue(Queue *queue, int64_t *item)
{
    CHECK(0, queue->count);
    *item = queue->items[0];
    queue->places[*item] = -1;
    int64_t end = --queue->count, place = 0, last = queue->items[end];
    double cost = queue->costs[end];
    if (end == 0) return OK;
    for (;;) {
        int64_t first = ITEMS_BELOW * place + 1, least = first;
        if (first >= end) break;
        int64_t below = first + ITEMS_BELOW < end ? first + ITEMS_BELOW : end;
        for (int64_t other = first + 1; other < below; other++)
            if (comes_before(queue, queue->items[other], queue->costs[other], least)) least = other;
        if (comes_before(queue, last, cost, least)) break;
        put(queue, place, queue->items[least], queue->costs[least]);
        place = least;
    }
    put(queue, place, last, cost);
    return OK;
}
