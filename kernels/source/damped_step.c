/* Damped steps of a Gauss-Newton system. */
#include "damped_step.h"

/* Bands on one side of the diagonal, after the nodes have been put in the order 0, n - 1, 1, n - 2
   and so on: there, nodes that are at most two apart on the closed curve are at most four positions
   apart. */
#define SIDE_BANDS 4
#define STORED_BANDS (SIDE_BANDS + 1)

int64_t items_of_damped_step(int64_t n)
{
    return (STORED_BANDS + 1) * n;
}

static int64_t position_in_order(int64_t node, int64_t n)
{
    return node < (n + 1) / 2 ? 2 * node : 2 * (n - 1 - node) + 1;
}

/* Solves a positive definite system by Cholesky's method.

   matrix : (n, 5) entries (i, i), (i + 1, i), ..., (i + 4, i) of each column; becomes the factor
   values : (n) right-hand side, replaced by the solution */
static int solve(int64_t n, double *matrix, double *values)
{
    for (int64_t i = 0; i < n; i++) {
        double *column = matrix + STORED_BANDS * i;
        if (!(column[0] > 0.0)) return NOT_POSITIVE_DEFINITE;
        double root = sqrt(column[0]);
        int64_t below = n - 1 - i < SIDE_BANDS ? n - 1 - i : SIDE_BANDS;
        column[0] = root;
        for (int64_t k = 1; k <= below; k++) column[k] /= root;
        for (int64_t k = 1; k <= below; k++)
            for (int64_t l = k; l <= below; l++)
                matrix[STORED_BANDS * (i + k) + l - k] -= column[k] * column[l];
        values[i] /= root;
        for (int64_t k = 1; k <= below; k++) values[i + k] -= column[k] * values[i];
    }
    for (int64_t i = n - 1; i >= 0; i--) {
        const double *column = matrix + STORED_BANDS * i;
        int64_t below = n - 1 - i < SIDE_BANDS ? n - 1 - i : SIDE_BANDS;
        for (int64_t k = 1; k <= below; k++) values[i] -= column[k] * values[i + k];
        values[i] /= column[0];
    }
    return OK;
}

int damped_step(const System *system, int64_t n, const uint8_t *fixed, double damping,
                Scratch scratch, double *moves)
{
    double *matrix, *values, greatest = 0.0, check = 0.0;
    TRY(take(&scratch, STORED_BANDS * n, &matrix));
    TRY(take(&scratch, n, &values));
    for (int64_t i = 0; i < n; i++) {
        moves[i] = 0.0;
        if (!fixed[i]) greatest = greater(greatest, system->bands[i]);
    }
    for (int64_t k = 0; k < STORED_BANDS * n; k++) matrix[k] = 0.0;
    for (int64_t i = 0; i < n; i++) {
        int64_t at = position_in_order(i, n);
        CHECK(at, n);
        for (int64_t offset = 0; offset < 3; offset++) {
            int64_t j = (i + offset) % n, there = position_in_order(j, n);
            int64_t least = at < there ? at : there, band = at + there - 2 * least;
            CHECK(least, n);
            CHECK(band, STORED_BANDS);
            double entry = fixed[i] || fixed[j] ? 0.0 : system->bands[offset * n + i];
            if (offset == 0) entry += fixed[i] ? 1.0 : damping * greatest;
            matrix[STORED_BANDS * least + band] += entry;
            check += entry;
        }
        values[at] = fixed[i] ? 0.0 : -system->slope[i];
        check += values[at];
    }
    if (!isfinite(check) || !(greatest > TINY)) return OK;
    TRY(solve(n, matrix, values));
    for (int64_t i = 0; i < n; i++) moves[i] = values[position_in_order(i, n)];
    return OK;
}

double predicted_decrease(const System *system, int64_t n, const double *moves)
{
    double sum = 0.0;
    for (int64_t i = 0; i < n; i++) {
        if (moves[i] == 0.0) continue; /* the matrix need not be finite */
        double one = moves[(i + 1) % n], other = moves[(i + 2) % n];
        double half = 0.5 * system->bands[i] * moves[i];
        if (one != 0.0) half += system->bands[n + i] * one;
        if (other != 0.0) half += system->bands[2 * n + i] * other;
        sum += 2.0 * moves[i] * (system->slope[i] + half);
    }
    return -sum;
}

EXPORTED int64_t step_items(int64_t n)
{
    return items_of_damped_step(n);
}

/* Finds a damped step of a curve, and the decrease of the linearised energy that it predicts. */
EXPORTED int step_of_curve(const System *system, int64_t n, const uint8_t *fixed, double damping,
                           double *scratch, int64_t scratch_items, double *moves, double *decrease)
{
    const Scratch memory = {scratch, scratch_items};
    TRY(damped_step(system, n, fixed, damping, memory, moves));
    *decrease = predicted_decrease(system, n, moves);
    return OK;
}
