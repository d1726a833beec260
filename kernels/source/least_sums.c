/* The product of two matrices with sums instead of products, and minima instead of sums. */
#include "errors.h"
#include "vectors.h"

/* The least sums over the middle, (a, c), of entries of two matrices, (a, b) and (b, c). The least
   of no sums is infinite. */
EXPORTED int least_sums(int64_t a, int64_t b, int64_t c, const double *one, const double *other,
                        double *sums)
{
    for (int64_t i = 0; i < a; i++) {
        double *row = sums + i * c;
        for (int64_t k = 0; k < c; k++) row[k] = INFINITY;
        for (int64_t j = 0; j < b; j++) {
            double first = one[i * b + j];
            if (first == INFINITY) continue;
            for (int64_t k = 0; k < c; k++) row[k] = lesser(first + other[j * c + k], row[k]);
        }
    }
    return OK;
}
