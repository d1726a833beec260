/* Memory of the caller, from which a function takes its arrays in turn. */
#ifndef NICMM_SCRATCH_H
#define NICMM_SCRATCH_H

#include <stddef.h>

#include "errors.h"

/* All items are eight bytes: doubles or integers. */
typedef struct {
    double *next;
    int64_t left; /* number of items */
} Scratch;

static inline int take(Scratch *scratch, int64_t count, double **array)
{
    if (count < 0 || count > scratch->left) return ARRAY_TOO_SMALL;
    *array = scratch->next;
    scratch->next += count;
    scratch->left -= count;
    return OK;
}

static inline int take_integers(Scratch *scratch, int64_t count, int64_t **array)
{
    double *taken = NULL;
    TRY(take(scratch, count, &taken));
    *array = (int64_t *)(void *)taken;
    return OK;
}

static inline int take_bytes(Scratch *scratch, int64_t count, uint8_t **array)
{
    double *taken = NULL;
    TRY(take(scratch, count / 8 + 1, &taken));
    *array = (uint8_t *)(void *)taken;
    return OK;
}

#endif
