/* Vectors of three components.

   Sums are written out in the order of the components, and the compiler must not contract them
   (-ffp-contract=off), so that all platforms give the same bits. */
#ifndef NICMM_VECTORS_H
#define NICMM_VECTORS_H

#include <float.h>
#include <math.h>
#include <stdint.h>

/* Least divisor, for quotients whose dividend is zero whenever the divisor is. */
#define TINY DBL_MIN

static inline double dot(const double *one, const double *other)
{
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2];
}

/* The result must not be one of the factors. */
static inline void cross(const double *one, const double *other, double *result)
{
    result[0] = one[1] * other[2] - one[2] * other[1];
    result[1] = one[2] * other[0] - one[0] * other[2];
    result[2] = one[0] * other[1] - one[1] * other[0];
}

static inline double length_of(const double *vector)
{
    return sqrt(dot(vector, vector));
}

static inline double distance_between(const double *one, const double *other)
{
    double way[3] = {one[0] - other[0], one[1] - other[1], one[2] - other[2]};
    return length_of(way);
}

static inline void interpolate(const double *const corners[3], const double *barycentric,
                               double *result)
{
    for (int axis = 0; axis < 3; axis++)
        result[axis] = barycentric[0] * corners[0][axis] + barycentric[1] * corners[1][axis] +
                       barycentric[2] * corners[2][axis];
}

static inline double greater(double one, double other)
{
    return one > other ? one : other;
}

static inline double lesser(double one, double other)
{
    return one < other ? one : other;
}

/* Moves a point off the sides and corners of its face. */
static inline void move_inside(double barycentric[3], double least)
{
    for (int j = 0; j < 3; j++) barycentric[j] = greater(barycentric[j], least);
    double sum = barycentric[0] + barycentric[1] + barycentric[2];
    for (int j = 0; j < 3; j++) barycentric[j] /= sum;
}

static inline int are_finite(const double *values, int64_t count)
{
    for (int64_t i = 0; i < count; i++)
        if (!isfinite(values[i])) return 0;
    return 1;
}

#endif
