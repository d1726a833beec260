/* Damped steps of a Gauss-Newton system. */
#include "damped_step.h"

#include "profile_matrix.h"

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

/* A system of one curve with the entries of pairs of nodes in contact. */
typedef struct {
    int64_t n;
    System system;
    int64_t pair_count;
    const int64_t *pairs;        /* (pair_count, 2) */
    const double *pair_entries;  /* (3, pair_count) entries (i, i), (i, j) and (j, j) */
} PairedSystem;

/* The greatest diagonal entry of a free node; `diagonal`, (n), is scratch. */
static int greatest_entry(const PairedSystem *paired, const uint8_t *fixed, double *diagonal,
                          double *greatest)
{
    int64_t count = paired->pair_count;
    for (int64_t i = 0; i < paired->n; i++) diagonal[i] = paired->system.bands[i];
    for (int64_t p = 0; p < count; p++)
        for (int end = 0; end < 2; end++) {
            int64_t i = paired->pairs[2 * p + end];
            CHECK(i, paired->n);
            diagonal[i] += paired->pair_entries[2 * end * count + p];
        }
    *greatest = 0.0;
    for (int64_t i = 0; i < paired->n; i++)
        if (!fixed[i]) *greatest = greater(*greatest, diagonal[i]);
    return OK;
}

/* A damped step with the entries of pairs, for which there is no order with few bands. */
static int damped_step_with_pairs(const PairedSystem *paired, const uint8_t *fixed, double damping,
                                  Scratch scratch, double *moves)
{
    int64_t n = paired->n, count = paired->pair_count;
    ProfileMatrix matrix;
    double greatest, check = 0.0;
    TRY(greatest_entry(paired, fixed, moves, &greatest));
    TRY(take_profile_matrix(&scratch, n, paired->pairs, count, &matrix));
    for (int64_t i = 0; i < n; i++) {
        for (int64_t offset = 0; offset < 3; offset++) {
            int64_t j = (i + offset) % n;
            double entry = fixed[i] || fixed[j] ? 0.0 : paired->system.bands[offset * n + i];
            if (offset == 0) entry += fixed[i] ? 1.0 : damping * greatest;
            TRY(add_entry(&matrix, i, j, entry));
            check += entry;
        }
        moves[i] = fixed[i] ? 0.0 : -paired->system.slope[i];
        check += moves[i];
    }
    for (int64_t p = 0; p < count; p++) {
        int64_t ends[2] = {paired->pairs[2 * p], paired->pairs[2 * p + 1]};
        for (int k = 0; k < 3; k++) {
            int64_t i = ends[k / 2], j = ends[(k + 1) / 2];
            if (fixed[i] || fixed[j]) continue;
            double entry = paired->pair_entries[k * count + p];
            TRY(add_entry(&matrix, i, j, entry));
            check += entry;
        }
    }
    if (isfinite(check) && greatest > TINY) return solve_profile(&matrix, moves);
    for (int64_t i = 0; i < n; i++) moves[i] = 0.0;
    return OK;
}

/* Finds a damped step of one curve; see `damped_step`. It returns ARRAY_TOO_SMALL if the scratch
   does not suffice, which is known only when the nodes have been ordered. */
EXPORTED int step_of_curve(const PairedSystem *paired, const uint8_t *fixed, double damping,
                           double *scratch, int64_t scratch_items, double *moves)
{
    Scratch all = {scratch, scratch_items};
    if (paired->pair_count > 0)
        return damped_step_with_pairs(paired, fixed, damping, all, moves);
    return damped_step(&paired->system, paired->n, fixed, damping, all, moves);
}

/* Number of items of scratch that always suffice without pairs, and mostly with them. */
EXPORTED int64_t step_items(int64_t n, int64_t pair_count)
{
    return items_of_damped_step(n) + 40 * n + 4 * pair_count + 2;
}

/* Decrease of the linearised energy by given moves along the conormals, (n). */
EXPORTED int predicted_decrease(const PairedSystem *paired, const double *moves, double *decrease)
{
    int64_t n = paired->n, count = paired->pair_count;
    const double *bands = paired->system.bands, *entries = paired->pair_entries;
    double sum = 0.0;
    int moves_any = 0;
    for (int64_t i = 0; i < n; i++) {
        double one = moves[(i + 1) % n], other = moves[(i + 2) % n];
        double half = 0.5 * bands[i] * moves[i] + bands[n + i] * one + bands[2 * n + i] * other;
        sum += 2.0 * moves[i] * (paired->system.slope[i] + half);
        moves_any |= moves[i] != 0.0;
    }
    for (int64_t p = 0; p < count; p++) {
        CHECK(paired->pairs[2 * p], n);
        CHECK(paired->pairs[2 * p + 1], n);
        double one = moves[paired->pairs[2 * p]], other = moves[paired->pairs[2 * p + 1]];
        sum += entries[p] * one * one + 2.0 * entries[count + p] * one * other +
               entries[2 * count + p] * other * other;
    }
    *decrease = moves_any ? -sum : 0.0; /* the matrix need not be finite */
    return OK;
}
