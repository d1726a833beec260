/* A queue of items by cost, as a heap. */
#include "queue.h"

int take_queue(Scratch *scratch, int64_t capacity, const double *costs, Queue *queue)
{
    queue->capacity = capacity;
    queue->count = 0;
    queue->costs = costs;
    TRY(take_integers(scratch, capacity, &queue->items));
    TRY(take_integers(scratch, capacity, &queue->places));
    for (int64_t item = 0; item < capacity; item++) queue->places[item] = -1;
    return OK;
}

static int comes_before(const Queue *queue, int64_t one, int64_t other)
{
    double cost = queue->costs[one], other_cost = queue->costs[other];
    return cost < other_cost || (cost == other_cost && one < other);
}

static void put(Queue *queue, int64_t place, int64_t item)
{
    queue->items[place] = item;
    queue->places[item] = place;
}

int enqueue(Queue *queue, int64_t item)
{
    CHECK(item, queue->capacity);
    int64_t place = queue->places[item];
    if (place < 0) place = queue->count++;
    CHECK(place, queue->capacity);
    while (place > 0) {
        int64_t above = (place - 1) / ITEMS_BELOW;
        if (!comes_before(queue, item, queue->items[above])) break;
        put(queue, place, queue->items[above]);
        place = above;
    }
    put(queue, place, item);
    return OK;
}

int dequeue(Queue *queue, int64_t *item)
{
    CHECK(0, queue->count);
    *item = queue->items[0];
    queue->places[*item] = -1;
    int64_t last = queue->items[--queue->count], place = 0;
    if (queue->count == 0) return OK;
    for (;;) {
        int64_t below = ITEMS_BELOW * place + 1, least = below;
        if (below >= queue->count) break;
        int64_t end = below + ITEMS_BELOW < queue->count ? below + ITEMS_BELOW : queue->count;
        for (int64_t other = below + 1; other < end; other++)
            if (comes_before(queue, queue->items[other], queue->items[least])) least = other;
        if (!comes_before(queue, queue->items[least], last)) break;
        put(queue, place, queue->items[least]);
        place = least;
    }
    put(queue, place, last);
    return OK;
}
