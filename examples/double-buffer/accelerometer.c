/*
 * accelerometer.c - two states: the interrupt reads one while the other is written.
 *
 * One core, one interrupt that samples. The store to `active` is one aligned 32-bit store, so the
 * interrupt sees either index. When it runs, it runs to its end before the writer goes on; so nobody
 * reads the state that is being written. With two cores or two threads that does not hold: take a
 * lock around accelerometer_sample and around the writers.
 */
#include "accelerometer.h"

#include "triax_calib.h"

typedef struct {
    triax_state_t state;
    uint32_t status;
} half_t;

static volatile half_t half[2];
static volatile uint32_t active;

static triax_calib_t loaded;
static uint32_t is_loaded;
static int32_t last_temp_code;

/* Writes the half that the interrupt does not read, then lets it read that one. */
static void evaluate(int32_t temp_code)
{
    const uint32_t next = 1u - active;
    half_t made;

    if (is_loaded != 0u) {
        made.status = triax_set_temperature(&made.state, &loaded, temp_code);
    } else {
        made.status = triax_set_temperature(&made.state, &TRIAX_CALIB, temp_code);
    }
    half[next] = made;
    active = next;
    last_temp_code = temp_code;
}

void accelerometer_start(int32_t temp_code)
{
    is_loaded = 0u;
    evaluate(temp_code);
}

void accelerometer_set_temperature(int32_t temp_code)
{
    if (temp_code != last_temp_code) {
        evaluate(temp_code);
    }
}

uint32_t accelerometer_load(const uint8_t *file, size_t size)
{
    const uint32_t status = triax_calib_load(&loaded, file, size);

    if (status == TRIAX_STATUS_OK) {
        is_loaded = 1u;
        evaluate(last_temp_code);
    }
    return status;
}

uint32_t accelerometer_sample(const int32_t raw_code[3], int32_t accel[3])
{
    const half_t now = half[active];
    return now.status | triax_apply(&now.state, raw_code, accel);
}
