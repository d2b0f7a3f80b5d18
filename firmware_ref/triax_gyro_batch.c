#include "triax_gyro_batch.h"

#include "triax_gyro_calib.h"

static void run(const triax_gyro_calib_t *calib, size_t count, const int32_t *temp_code,
                const int32_t *raw_code, const int32_t *force, int32_t *rate, uint32_t *status)
{
    static const triax_gyro_state_t nothing;
    triax_gyro_state_t state = nothing;
    uint32_t temp_status = 0;
    size_t i;
    for (i = 0; i < count; i++) {
        if (i == 0 || temp_code[i] != temp_code[i - 1]) {
            temp_status = triax_gyro_set_temperature(&state, calib, temp_code[i]);
        }
        status[i] = temp_status | triax_gyro_apply(&state, &raw_code[3 * i], &force[3 * i], &rate[3 * i]);
    }
}

void triax_gyro_batch(size_t count, const int32_t *temp_code, const int32_t *raw_code,
                      const int32_t *force, int32_t *rate, uint32_t *status)
{
    run(&TRIAX_GYRO_CALIB, count, temp_code, raw_code, force, rate, status);
}

uint32_t triax_gyro_batch_image(const uint8_t *image, size_t size, size_t count,
                                const int32_t *temp_code, const int32_t *raw_code,
                                const int32_t *force, int32_t *rate, uint32_t *status)
{
    triax_gyro_calib_t calib;
    const uint32_t loaded = triax_gyro_calib_load(&calib, image, size);
    if (loaded == TRIAX_STATUS_OK) {
        run(&calib, count, temp_code, raw_code, force, rate, status);
    }
    return loaded;
}
