/* Sparse symmetric matrices of which each row is stored from its first entry to the diagonal. */
#ifndef NICMM_PROFILE_MATRIX_H
#define NICMM_PROFILE_MATRIX_H

#include "scratch.h"

typedef struct {
    int64_t n;
    int64_t *rows;   /* (n) row of each unknown */
    int64_t *first;  /* (n) first column of each row */
    int64_t *begins; /* (n + 1) index of the first value of each row */
    double *values;  /* the rows, one after the other */
    double *ordered; /* (n) values of the unknowns in the order of the rows */
} ProfileMatrix;

/* Orders n unknowns so that coupled ones have rows close together, and takes room for the rows.

   Each unknown is coupled with the two after it, modulo n, and with those in `pairs`, (count, 2).
   All values become zero. */
int take_profile_matrix(Scratch *scratch, int64_t n, const int64_t *pairs, int64_t count,
                        ProfileMatrix *matrix);

/* Adds a value to the entries (i, j) and (j, i) of two coupled unknowns, or to (i, i). */
int add_entry(const ProfileMatrix *matrix, int64_t i, int64_t j, double value);

/* Solves a positive definite system by Cholesky's method. The matrix becomes its factor, and
   `values`, (n), become the solution. */
int solve_profile(const ProfileMatrix *matrix, double *values);

#endif
