/*
 * run_vectors.c - the generated routine as a program of its own, for sanitizers and optimisers.
 *
 * Reads a file of int32 in the host's order: the number of vectors and, for each, temp_code,
 * raw_code[3], accel[3], status; then the number of images and, for each, its size, the status
 * that triax_calib_load must return, and its bytes, one an int32; then, when that status is 0, what
 * its constants answer to every vector: accel[3] and status. Returns 0 when every answer is right;
 * prints the first that is not.
 */
#include <stdio.h>
#include <stdlib.h>

#include "triax_calib.h"

typedef struct {
    int32_t temp_code;
    int32_t raw_code[3];
    int32_t accel[3];
    uint32_t status;
} vector_t;

static int32_t next(FILE *file)
{
    int32_t value;
    if (fread(&value, sizeof value, 1, file) != 1) {
        fputs("the file ends too early\n", stderr);
        exit(2);
    }
    return value;
}

static uint32_t run(const triax_calib_t *calib, const vector_t *v, int32_t accel[3], int same_array)
{
    triax_state_t state;
    const uint32_t status = triax_set_temperature(&state, calib, v->temp_code);
    int i;
    if (!same_array) {
        return status | triax_apply(&state, v->raw_code, accel);
    }
    for (i = 0; i < 3; i++) {
        accel[i] = v->raw_code[i];
    }
    return status | triax_apply(&state, accel, accel);
}

static int wrong(const triax_calib_t *calib, const vector_t *v, int same_array)
{
    int32_t accel[3];
    const uint32_t status = run(calib, v, accel, same_array);
    if (status == v->status && accel[0] == v->accel[0] && accel[1] == v->accel[1] &&
        accel[2] == v->accel[2]) {
        return 0;
    }
    printf("temp_code %ld raw_code %ld %ld %ld: found %ld %ld %ld status %lu%s\n",
           (long)v->temp_code, (long)v->raw_code[0], (long)v->raw_code[1], (long)v->raw_code[2],
           (long)accel[0], (long)accel[1], (long)accel[2], (unsigned long)status,
           same_array ? ", raw_code and accel the same array" : "");
    return 1;
}

static void read_answer(FILE *file, vector_t *v)
{
    int i;
    for (i = 0; i < 3; i++) {
        v->accel[i] = next(file);
    }
    v->status = (uint32_t)next(file);
}

/* The image lies in a block of just its size, so that a sanitizer sees one byte too many read. */
static int image_wrong(FILE *file, int number, vector_t *vectors, int32_t count)
{
    const size_t size = (size_t)next(file);
    const uint32_t expected = (uint32_t)next(file);
    uint8_t *const image = malloc(size);
    triax_calib_t calib;
    uint32_t found;
    size_t byte;
    for (byte = 0; byte < size; byte++) {
        image[byte] = (uint8_t)next(file);
    }
    found = triax_calib_load(&calib, image, size);
    free(image);
    if (found != expected) {
        printf("image %d: found status %lu, expected %lu\n", number, (unsigned long)found,
               (unsigned long)expected);
        return 1;
    }
    if (found == TRIAX_STATUS_OK) {
        int32_t i;
        for (i = 0; i < count; i++) {
            read_answer(file, &vectors[i]);
        }
        for (i = 0; i < count; i++) {
            if (wrong(&calib, &vectors[i], 0)) {
                printf("with image %d\n", number);
                return 1;
            }
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    FILE *const file = (argc == 2) ? fopen(argv[1], "rb") : NULL;
    vector_t *vectors;
    int32_t count;
    int32_t images;
    int32_t i;
    int failed = 0;
    if (file == NULL) {
        return 2;
    }
    count = next(file);
    vectors = calloc((size_t)count, sizeof *vectors);
    for (i = 0; i < count; i++) {
        int j;
        vectors[i].temp_code = next(file);
        for (j = 0; j < 3; j++) {
            vectors[i].raw_code[j] = next(file);
        }
        read_answer(file, &vectors[i]);
    }
    for (i = 0; i < count && !failed; i++) {
        failed = wrong(&TRIAX_CALIB, &vectors[i], 0) || wrong(&TRIAX_CALIB, &vectors[i], 1);
    }
    images = next(file);
    for (i = 0; i < images && !failed; i++) {
        failed = image_wrong(file, (int)i, vectors, count);
    }
    free(vectors);
    fclose(file);
    return failed;
}
