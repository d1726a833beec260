/* Damped steps of a Gauss-Newton system. */
#ifndef NICMM_DAMPED_STEP_H
#define NICMM_DAMPED_STEP_H

#include "elastic_energy.h"

int64_t items_of_damped_step(int64_t n);

/* Finds the moves of the free nodes along conormals, (n), that lower the linearised energy.

   The damping is added to the diagonal of the matrix, relative to its greatest entry of a free
   node. Nothing moves if the linearisation is zero or not finite, as where nodes coincide. */
int damped_step(const System *system, int64_t n, const uint8_t *fixed, double damping,
                Scratch scratch, double *moves);

/* Decrease of the linearised energy by moves along the conormals, (n). */
double predicted_decrease(const System *system, int64_t n, const double *moves);

#endif
