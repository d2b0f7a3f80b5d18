/*
 * triax_ref.h - reference of the compensation arithmetic, for any shape.
 *
 * Written by hand from docs/explanation/fixed-point.md, not from the templates: one plain function a step,
 * floors without a signed shift, every parameter read from the image. It is what the generated
 * routine is compared with, not what a unit runs.
 */
#ifndef TRIAX_REF_H
#define TRIAX_REF_H

#include <stddef.h>
#include <stdint.h>

/* 64 segments of order 9 take 31 KB; a small target says less. */
#ifndef TRIAX_REF_MAX_SEGMENTS
#define TRIAX_REF_MAX_SEGMENTS 64
#endif
#define TRIAX_REF_MAX_ORDER 9
#define TRIAX_REF_HEADER_WORDS 15
#define TRIAX_REF_IDENTITY_SIZE 252u /* bytes behind the constants */

/* The same bits as TRIAX_STATUS_*. */
enum {
    TRIAX_REF_OK = 0,
    TRIAX_REF_TEMP_LOW = 1,
    TRIAX_REF_TEMP_HIGH = 2,
    TRIAX_REF_RAW_RANGE = 4,
    TRIAX_REF_SATURATED = 8,
    TRIAX_REF_BAD_IMAGE = 16,
    TRIAX_REF_RATE_RANGE = 32
};

/* Bits of the word that says which terms there are beyond the linear ones. */
enum {
    TRIAX_REF_QUADRATIC = 1,
    TRIAX_REF_RATE = 2,
    TRIAX_REF_SENSITIVITY = 4, /* of a gyro, with the Q of the force it takes times 256 */
    TRIAX_REF_HIGH_WORDS = 8   /* no term: each product is floored before the sum */
};

typedef struct {
    int32_t first_code;
    int32_t origin_code;
    int32_t gain;
    int32_t coefficient[12][TRIAX_REF_MAX_ORDER + 1];
} triax_ref_segment_t;

typedef struct {
    /* shape */
    int inverse_form;
    int segments;
    int order;
    int output_q;
    int output_shift;
    int32_t raw_min;
    int32_t raw_max;
    int raw_shift;
    int adjugate_shift;
    int determinant_shift;
    int reciprocal_log2;
    int gain_shift;
    int terms;
    /* constants */
    int32_t temp_min_code;
    int32_t temp_max_code;
    triax_ref_segment_t segment[TRIAX_REF_MAX_SEGMENTS];
    int32_t quadratic[3][6]; /* xx, yy, zz, xy, xz, yz */
    int32_t sensitivity[3][3];
    int32_t rate_min_code;
    int32_t rate_max_code;
    int32_t rate_gain;
    int32_t rate_offset[3];
} triax_ref_t;

typedef struct {
    int32_t gain[3][3];
    int32_t offset[3];
} triax_ref_state_t;

/* Reads an image of any shape; TRIAX_REF_BAD_IMAGE when it is damaged or beyond the limits above. */
uint32_t triax_ref_open(triax_ref_t *ref, const uint8_t *image, size_t size);

uint32_t triax_ref_set_temperature(triax_ref_state_t *state, const triax_ref_t *ref, int32_t temp_code);

/* The same with dT/dt in 2^-16 temperature codes per second, for constants with that term. */
uint32_t triax_ref_set_temperature_rate(triax_ref_state_t *state, const triax_ref_t *ref,
                                        int32_t temp_code, int32_t rate_code);

uint32_t triax_ref_apply(const triax_ref_state_t *state, const triax_ref_t *ref,
                         const int32_t raw_code[3], int32_t accel[3]);

/* The same for a gyro's constants: force is the accelerometer's result, any int32_t. */
uint32_t triax_ref_apply_gyro(const triax_ref_state_t *state, const triax_ref_t *ref,
                              const int32_t raw_code[3], const int32_t force[3], int32_t rate[3]);

/*
 * Runs count vectors: temp_code[count], raw_code[count][3] to accel[count][3] and status[count],
 * the temperature's status or-ed with the sample's. Returns TRIAX_REF_BAD_IMAGE when the image
 * does not open; nothing is written then.
 */
uint32_t triax_ref_batch(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                         const int32_t *raw_code, int32_t *accel, uint32_t *status);

/* The same with rate_code[count]. */
uint32_t triax_ref_batch_rate(const uint8_t *image, size_t size, size_t count,
                              const int32_t *temp_code, const int32_t *rate_code,
                              const int32_t *raw_code, int32_t *accel, uint32_t *status);

/* The same for a gyro, with force[count][3]. */
uint32_t triax_ref_batch_gyro(const uint8_t *image, size_t size, size_t count,
                              const int32_t *temp_code, const int32_t *raw_code,
                              const int32_t *force, int32_t *rate, uint32_t *status);

#endif
