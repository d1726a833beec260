/* Sparse symmetric matrices of which each row is stored from its first entry to the diagonal. */
#include "profile_matrix.h"

#include <math.h>
#include <string.h>

/* The unknowns coupled with each unknown. */
typedef struct {
    int64_t n;
    int64_t *begins; /* (n + 1) index of the first of them */
    int64_t *others; /* (begins[n]) */
} Couples;

#define CYCLIC 4 /* number of unknowns with which each one is coupled besides the pairs */

static int find_couples(Scratch *scratch, int64_t n, const int64_t *pairs, int64_t count,
                        Couples *couples)
{
    int64_t *filled;
    couples->n = n;
    TRY(take_integers(scratch, n + 1, &couples->begins));
    TRY(take_integers(scratch, CYCLIC * n + 2 * count, &couples->others));
    TRY(take_integers(scratch, n, &filled));
    for (int64_t i = 0; i < n; i++) filled[i] = CYCLIC;
    for (int64_t end = 0; end < 2 * count; end++) {
        CHECK(pairs[end], n);
        filled[pairs[end]]++;
    }
    couples->begins[0] = 0;
    for (int64_t i = 0; i < n; i++) {
        couples->begins[i + 1] = couples->begins[i] + filled[i];
        int64_t *others = couples->others + couples->begins[i];
        others[0] = (i + 1) % n;
        others[1] = (i + n - 1) % n;
        others[2] = (i + 2) % n;
        others[3] = (i + 2 * n - 2) % n;
        filled[i] = CYCLIC;
    }
    for (int64_t p = 0; p < count; p++) {
        int64_t i = pairs[2 * p], j = pairs[2 * p + 1];
        couples->others[couples->begins[i] + filled[i]++] = j;
        couples->others[couples->begins[j] + filled[j]++] = i;
    }
    return OK;
}

/* Lists the unknowns by their distance from one of them, (n); `seen`, (n), is scratch. */
static void list_by_distance(const Couples *couples, int64_t start, int64_t *seen, int64_t *list)
{
    memset(seen, 0, (size_t)couples->n * sizeof *seen);
    int64_t listed = 0;
    list[listed++] = start;
    seen[start] = 1;
    for (int64_t k = 0; k < listed; k++)
        for (int64_t at = couples->begins[list[k]]; at < couples->begins[list[k] + 1]; at++) {
            int64_t other = couples->others[at];
            if (seen[other]) continue;
            seen[other] = 1;
            list[listed++] = other;
        }
}

int take_profile_matrix(Scratch *scratch, int64_t n, const int64_t *pairs, int64_t count,
                        ProfileMatrix *matrix)
{
    Couples couples;
    int64_t *list, *seen;
    matrix->n = n;
    TRY(take_integers(scratch, n, &matrix->rows));
    TRY(take_integers(scratch, n, &matrix->first));
    TRY(take_integers(scratch, n + 1, &matrix->begins));
    TRY(take(scratch, n, &matrix->ordered));
    TRY(find_couples(scratch, n, pairs, count, &couples));
    TRY(take_integers(scratch, n, &list));
    TRY(take_integers(scratch, n, &seen));
    /* The order of Cuthill and McKee, reversed, from an unknown that is far from others. */
    list_by_distance(&couples, 0, seen, list);
    list_by_distance(&couples, list[n - 1], seen, list);
    list_by_distance(&couples, list[n - 1], seen, list);
    for (int64_t k = 0; k < n; k++) matrix->rows[list[k]] = n - 1 - k;
    for (int64_t i = 0; i < n; i++) {
        int64_t row = matrix->rows[i], first = row;
        for (int64_t at = couples.begins[i]; at < couples.begins[i + 1]; at++) {
            int64_t other = matrix->rows[couples.others[at]];
            if (other < first) first = other;
        }
        matrix->first[row] = first;
    }
    matrix->begins[0] = 0;
    for (int64_t row = 0; row < n; row++)
        matrix->begins[row + 1] = matrix->begins[row] + row - matrix->first[row] + 1;
    TRY(take(scratch, matrix->begins[n], &matrix->values));
    for (int64_t k = 0; k < matrix->begins[n]; k++) matrix->values[k] = 0.0;
    return OK;
}

int add_entry(const ProfileMatrix *matrix, int64_t i, int64_t j, double value)
{
    CHECK(i, matrix->n);
    CHECK(j, matrix->n);
    int64_t row = matrix->rows[i], column = matrix->rows[j];
    if (row < column) {
        int64_t other = row;
        row = column;
        column = other;
    }
    CHECK(column - matrix->first[row], row - matrix->first[row] + 1);
    matrix->values[matrix->begins[row] + column - matrix->first[row]] += value;
    return OK;
}

/* Four sums at a time, which do not wait for each other. */
static double product(const double *one, const double *other, int64_t count)
{
    double sums[4] = {0.0, 0.0, 0.0, 0.0};
    int64_t k = 0;
    for (; k + 4 <= count; k += 4)
        for (int part = 0; part < 4; part++) sums[part] += one[k + part] * other[k + part];
    for (; k < count; k++) sums[0] += one[k] * other[k];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

static int factorise(const ProfileMatrix *matrix)
{
    for (int64_t i = 0; i < matrix->n; i++) {
        int64_t first = matrix->first[i];
        double *row = matrix->values + matrix->begins[i];
        for (int64_t j = first; j < i; j++) {
            int64_t first_there = matrix->first[j];
            const double *there = matrix->values + matrix->begins[j];
            int64_t low = first > first_there ? first : first_there;
            double sum = product(row + (low - first), there + (low - first_there), j - low);
            row[j - first] = (row[j - first] - sum) / there[j - first_there];
        }
        double square = row[i - first] - product(row, row, i - first);
        if (!(square > 0.0)) return NOT_POSITIVE_DEFINITE;
        row[i - first] = sqrt(square);
    }
    return OK;
}

int solve_profile(const ProfileMatrix *matrix, double *values)
{
    double *ordered = matrix->ordered;
    TRY(factorise(matrix));
    for (int64_t i = 0; i < matrix->n; i++) ordered[matrix->rows[i]] = values[i];
    for (int64_t i = 0; i < matrix->n; i++) {
        int64_t first = matrix->first[i];
        const double *row = matrix->values + matrix->begins[i];
        ordered[i] = (ordered[i] - product(row, ordered + first, i - first)) / row[i - first];
    }
    for (int64_t i = matrix->n - 1; i >= 0; i--) {
        int64_t first = matrix->first[i];
        const double *row = matrix->values + matrix->begins[i];
        ordered[i] /= row[i - first];
        for (int64_t j = first; j < i; j++) ordered[j] -= row[j - first] * ordered[i];
    }
    for (int64_t i = 0; i < matrix->n; i++) values[i] = ordered[matrix->rows[i]];
    return OK;
}
