/* Replays recorded calls of the kernels, and writes what they return and change.

       replay LIBRARY RECORDING RESULTS

   Without arguments it does nothing, and so shows that programs for this platform run here.

   recording.py writes the recording, and kernels.h with a line for each of its kernels. A recording
   consists of 64-bit integers and of bytes: first blocks of memory, then calls. All calls start
   from copies of the blocks, into which the addresses of other copies are written. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

typedef void (*Function)(void);

/* An argument of a call. Integers, doubles and pointers are of the same size, also in structures,
   so recorded structures need only other addresses. */
typedef union {
    int64_t integer;
    double number;
    void *address;
} Word;

_Static_assert(sizeof(Word) == 8 && sizeof(void *) == 8, "arguments are not 8 bytes");

/* Memory at the start of a call. */
typedef struct {
    int64_t size;
    char *bytes;
} Block;

/* A pointer in the memory of a call. */
typedef struct {
    int64_t holder; /* index of the memory that contains the pointer */
    int64_t offset; /* where in it, in bytes */
    int64_t target; /* index of the memory to which it points; negative for NULL */
    int64_t inside; /* how far inside, in bytes */
} Pointer;

static void stop(const char *what, const char *why)
{
    fprintf(stderr, "replay: %s: %s\n", what, why);
    exit(EXIT_FAILURE);
}

static void *allocated(int64_t size)
{
    void *memory = calloc(size > 0 ? (size_t)size : 1, 1);
    if (memory == NULL) stop("memory", "there is not enough");
    return memory;
}

static void read_bytes(FILE *file, void *bytes, int64_t size)
{
    if (fread(bytes, 1, (size_t)size, file) != (size_t)size) stop("recording", "ends too early");
}

static int64_t read_integer(FILE *file)
{
    int64_t integer;
    read_bytes(file, &integer, sizeof integer);
    return integer;
}

static void write_bytes(FILE *file, const void *bytes, int64_t size)
{
    if (fwrite(bytes, 1, (size_t)size, file) != (size_t)size) stop("results", "cannot be written");
}

static FILE *opened(const char *path, const char *mode)
{
    FILE *file = fopen(path, mode);
    if (file == NULL) stop(path, "cannot be opened");
    return file;
}

#define KERNEL(result, name, types, arguments)                                                     \
    static int64_t call_##name(Function function, const Word *given)                               \
    {                                                                                              \
        return ((result(*) types)function) arguments;                                              \
    }
#include "kernels.h"
#undef KERNEL

#define KERNEL(result, name, types, arguments) {#name, call_##name},
static const struct {
    const char *name;
    int64_t (*call)(Function function, const Word *given);
} KERNELS[] = {
#include "kernels.h"
};

enum { KERNEL_COUNT = sizeof KERNELS / sizeof KERNELS[0] };

static void load_functions(const char *path, Function functions[KERNEL_COUNT])
{
#if defined(_WIN32)
    HMODULE library = LoadLibraryA(path);
#else
    void *library = dlopen(path, RTLD_NOW);
#endif
    if (library == NULL) stop(path, "cannot be loaded");
    for (int i = 0; i < KERNEL_COUNT; i++) {
#if defined(_WIN32)
        functions[i] = (Function)GetProcAddress(library, KERNELS[i].name);
#else
        functions[i] = (Function)dlsym(library, KERNELS[i].name);
#endif
        if (functions[i] == NULL) stop(KERNELS[i].name, "is not in the library");
    }
}

/* Repeats the next call of a recording. Its first memory consists of the arguments. */
static void replay_call(const Function functions[KERNEL_COUNT], const Block *blocks,
                        FILE *recording, FILE *results)
{
    int64_t kernel = read_integer(recording), count = read_integer(recording);
    const Block **before = allocated(count * (int64_t)sizeof *before);
    char **memory = allocated(count * (int64_t)sizeof *memory);
    for (int64_t i = 0; i < count; i++) {
        before[i] = blocks + read_integer(recording);
        memory[i] = allocated(before[i]->size);
        memcpy(memory[i], before[i]->bytes, (size_t)before[i]->size);
    }
    int64_t pointer_count = read_integer(recording);
    Pointer *pointers = allocated(pointer_count * (int64_t)sizeof *pointers);
    read_bytes(recording, pointers, pointer_count * (int64_t)sizeof *pointers);
    for (Pointer *p = pointers; p < pointers + pointer_count; p++) {
        char *address = p->target < 0 ? NULL : memory[p->target] + p->inside;
        memcpy(memory[p->holder] + p->offset, &address, sizeof address);
    }

    const Word *given = (const Word *)(void *)memory[0];
    int64_t returned = KERNELS[kernel].call(functions[kernel], given);

    write_bytes(results, &returned, sizeof returned);
    for (Pointer *p = pointers; p < pointers + pointer_count; p++)
        memset(memory[p->holder] + p->offset, 0, sizeof(char *));
    for (int64_t i = 0; i < count; i++) {
        if (memcmp(memory[i], before[i]->bytes, (size_t)before[i]->size) != 0) {
            write_bytes(results, &i, sizeof i);
            write_bytes(results, memory[i], before[i]->size);
        }
        free(memory[i]);
    }
    free(pointers);
    free(memory);
    free(before);
}

int main(int argument_count, char **arguments)
{
    if (argument_count == 1) return EXIT_SUCCESS;
    if (argument_count != 4) stop("arguments", "there have to be three or none");
    FILE *recording = opened(arguments[2], "rb"), *results = opened(arguments[3], "wb");
    int64_t block_count = read_integer(recording);
    Block *blocks = allocated(block_count * (int64_t)sizeof *blocks);
    for (Block *block = blocks; block < blocks + block_count; block++) {
        block->size = read_integer(recording);
        block->bytes = allocated(block->size); /* zeros at the end are not recorded */
        read_bytes(recording, block->bytes, read_integer(recording));
    }
    Function functions[KERNEL_COUNT];
    load_functions(arguments[1], functions);
    for (int64_t left = read_integer(recording); left > 0; left--)
        replay_call(functions, blocks, recording, results);
    if (fclose(results) != 0) stop(arguments[3], "cannot be written");
    return EXIT_SUCCESS;
}
