/* Products of matrices in single and double precision.

   Every entry is the sum of its terms in their order, so wider vectors give the same bits. */
#include "errors.h"

#include <string.h>

enum { SINGLE_ROWS = 4, DOUBLE_ROWS = 2, WIDTH = 16, DEPTH = 256 };

/* The product (n, m) of (n, k) and (k, m), in blocks of ROWS rows and WIDTH columns, which stay in
   registers while up to DEPTH terms are added. A panel holds these columns of the second matrix,
   with zeros beyond its last one. */
#define DEFINE_PRODUCT(NAME, REAL, ROWS, TARGET)                                                   \
    TARGET static void NAME(int64_t n, int64_t k, int64_t m, const REAL *first,                    \
                            const REAL *second, REAL *product)                                     \
    {                                                                                              \
        REAL panel[DEPTH * WIDTH], sums[ROWS][WIDTH];                                              \
        for (int64_t column = 0; column < m; column += WIDTH) {                                    \
            size_t width = sizeof(REAL) * (size_t)(m - column < WIDTH ? m - column : WIDTH);       \
            for (int64_t begin = 0; begin < k; begin += DEPTH) {                                   \
                int64_t depth = k - begin < DEPTH ? k - begin : DEPTH;                             \
                memset(panel, 0, sizeof panel);                                                    \
                for (int64_t term = 0; term < depth; term++)                                       \
                    memcpy(panel + term * WIDTH, second + (begin + term) * m + column, width);     \
                for (int64_t row = 0; row < n; row += ROWS) {                                      \
                    const REAL *rows[ROWS];                                                        \
                    int64_t last = n - 1 - row;                                                    \
                    for (int64_t i = 0; i < ROWS; i++)                                             \
                        rows[i] = first + (row + (i < last ? i : last)) * k + begin;               \
                    memset(sums, 0, sizeof sums);                                                  \
                    for (int64_t i = 0; begin > 0 && i < ROWS && i <= last; i++)                   \
                        memcpy(sums[i], product + (row + i) * m + column, width);                  \
                    for (int64_t term = 0; term < depth; term++)                                   \
                        for (int i = 0; i < ROWS; i++)                                             \
                            for (int j = 0; j < WIDTH; j++)                                        \
                                sums[i][j] += rows[i][term] * panel[term * WIDTH + j];             \
                    for (int64_t i = 0; i < ROWS && i <= last; i++)                                \
                        memcpy(product + (row + i) * m + column, sums[i], width);                  \
                }                                                                                  \
            }                                                                                      \
        }                                                                                          \
    }

#if defined(__x86_64__)
#include <cpuid.h>

DEFINE_PRODUCT(wide_single, float, SINGLE_ROWS, __attribute__((target("avx2"))))
DEFINE_PRODUCT(wide_double, double, DOUBLE_ROWS, __attribute__((target("avx2"))))

/* Whether the processor has vectors of 256 bits, and the system saves their registers. */
EXPORTED int has_wide_vectors(void)
{
    unsigned a, b, c, d, saved, above;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE)) return 0;
    __asm__ volatile("xgetbv" : "=a"(saved), "=d"(above) : "c"(0));
    if ((saved & 6) != 6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d)) return 0;
    return (b & bit_AVX2) != 0;
}
#else
#define wide_single narrow_single
#define wide_double narrow_double

EXPORTED int has_wide_vectors(void)
{
    return 0;
}
#endif

DEFINE_PRODUCT(narrow_single, float, SINGLE_ROWS, )
DEFINE_PRODUCT(narrow_double, double, DOUBLE_ROWS, )

EXPORTED int single_product(int64_t n, int64_t k, int64_t m, const float *first,
                            const float *second, int64_t wide, float *product)
{
    (wide ? wide_single : narrow_single)(n, k, m, first, second, product);
    return OK;
}

EXPORTED int double_product(int64_t n, int64_t k, int64_t m, const double *first,
                            const double *second, int64_t wide, double *product)
{
    (wide ? wide_double : narrow_double)(n, k, m, first, second, product);
    return OK;
}
