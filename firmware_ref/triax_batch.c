#include "triax_batch.h"

#include "triax_calib.h"

static void run(const triax_calib_t *calib, size_t count, const int32_t *temp_code,
                const int32_t *raw_code, int32_t *accel, uint32_t *status)
{
    static const triax_state_t nothing;
    triax_state_t state = nothing;
    uint32_t temp_status = 0;
    size_t i;
    for (i = 0; i < count; i++) {
        if (i == 0 || temp_code[i] != temp_code[i - 1]) {
            temp_status = triax_set_temperature(&state, calib, temp_code[i]);
        }
        status[i] = temp_status | triax_apply(&state, &raw_code[3 * i], &accel[3 * i]);
    }
}

void triax_batch(size_t count, const int32_t *temp_code, const int32_t *raw_code, int32_t *accel,
                 uint32_t *status)
{
    run(&TRIAX_CALIB, count, temp_code, raw_code, accel, status);
}

uint32_t triax_batch_image(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                           const int32_t *raw_code, int32_t *accel, uint32_t *status)
{
    triax_calib_t calib;
    const uint32_t loaded = triax_calib_load(&calib, image, size);
    if (loaded == TRIAX_STATUS_OK) {
        run(&calib, count, temp_code, raw_code, accel, status);
    }
    return loaded;
}

#ifdef TRIAX_RATE_Q
uint32_t triax_batch_rate(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                          const int32_t *rate_code, const int32_t *raw_code, int32_t *accel,
                          uint32_t *status)
{
    triax_calib_t calib = TRIAX_CALIB;
    uint32_t loaded = TRIAX_STATUS_OK;
    size_t i;
    if (image != NULL) {
        loaded = triax_calib_load(&calib, image, size);
    }
    for (i = 0; (i < count) && (loaded == TRIAX_STATUS_OK); i++) {
        triax_state_t state;
        status[i] = (rate_code[i] == 0)
                        ? triax_set_temperature(&state, &calib, temp_code[i])
                        : triax_set_temperature_rate(&state, &calib, temp_code[i], rate_code[i]);
        status[i] |= triax_apply(&state, &raw_code[3 * i], &accel[3 * i]);
    }
    return loaded;
}
#endif

const char *triax_batch_compiler(void)
{
#ifdef __VERSION__
    return __VERSION__;
#else
    return "unknown";
#endif
}
