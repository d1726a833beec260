/* Error codes, and the checks that return them.

   Every function returns OK or the code of what is wrong; the Python package turns the code into an
   exception. No function allocates memory or has state: the caller passes all arrays. */
#ifndef NICMM_ERRORS_H
#define NICMM_ERRORS_H

#include <stdint.h>

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

enum {
    OK = 0,
    INDEX_OUT_OF_RANGE = 1,
    ARRAY_TOO_SMALL = 2,
    NOT_FINITE = 3,
    NOT_POSITIVE_DEFINITE = 4,
    NEGATIVE_COST = 5
};

/* The comparison of unsigned numbers is also true for a negative index. */
#define CHECK(index, count)                                                                        \
    do {                                                                                           \
        if ((uint64_t)(index) >= (uint64_t)(count)) return INDEX_OUT_OF_RANGE;                     \
    } while (0)

#define TRY(call)                                                                                  \
    do {                                                                                           \
        int error_ = (call);                                                                       \
        if (error_ != OK) return error_;                                                           \
    } while (0)

#endif
