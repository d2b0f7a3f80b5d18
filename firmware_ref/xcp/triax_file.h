/*
 * triax_file.h - whose a triax_calib.bin is, and a change of its constants by a calibration tool.
 *
 * C99, no heap, no floats, no library calls of its own.
 */
#ifndef TRIAX_FILE_H
#define TRIAX_FILE_H

#include "triax_store.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TRIAX_FILE_EPK_SIZE 81u /* 64 bytes of serial number, a space, 16 hex digits */

/*
 * The EPK of a file that `check` takes, as the A2L of its delivery states it: serial number and first
 * 16 hex digits of the hash of the inputs. No 0 stands behind it. Returns its bytes, 0 for a file
 * without an identity.
 */
uint32_t triax_file_epk(const uint8_t *file, uint32_t file_size, uint8_t epk[TRIAX_FILE_EPK_SIZE]);

/*
 * Change `count` bytes of the constants of a file, from byte `at` on, and make its CRCs right again.
 * The hash of the inputs becomes zeros: the file is no longer what was delivered.
 * Returns 0. Returns 1 with the file as it was when there are no constants at `at`, or when `check`
 * refuses the file before or after the change.
 */
uint32_t triax_file_change(uint8_t *file, const triax_store_config_t *config, uint32_t at,
                           const uint8_t *bytes, uint32_t count);

#define TRIAX_FILE_CHANGE_MAX 8u /* the most bytes of one change */

#ifdef __cplusplus
}
#endif

#endif
