/*
 * triax_store.h - a calibration in two slots of flash, of which one is always whole.
 *
 * A slot holds a triax_calib.bin from its first byte, and in its last TRIAX_STORE_RECORD_SIZE bytes a
 * record with a sequence number. In use is the slot whose record and file are valid and whose
 * sequence number is the higher one. A new file goes to the other slot, is read back and checked
 * there, and only then gets its record. When power fails at any moment, the slot in use before is
 * untouched.
 *
 * C99, no heap, no floats, no library calls of its own. (gcc may make memset of the loops.) Flash must
 * be readable through a pointer.
 */
#ifndef TRIAX_STORE_H
#define TRIAX_STORE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TRIAX_STORE_RECORD_SIZE 32u
#define TRIAX_STORE_UNIT_MAX 32u /* the most bytes that one call of `program` gets */
#define TRIAX_STORE_NO_SLOT 2u

/* What a store in progress or the last one came to. */
#define TRIAX_STORE_IDLE 0u       /* none since triax_store_open */
#define TRIAX_STORE_BUSY 1u       /* call triax_store_step again */
#define TRIAX_STORE_DONE 2u       /* the new calibration is in use */
#define TRIAX_STORE_REFUSED 3u    /* triax_calib_check refused the file; flash was not touched */
#define TRIAX_STORE_NOT_ERASED 4u /* `erase` failed, or left bytes other than 0xFF */
#define TRIAX_STORE_NOT_WRITTEN 5u /* `program` failed, or other bytes are read back */

/* The flash and what belongs in it. Every function of flash returns 0 when it has succeeded. */
typedef struct {
    const uint8_t *slot[2]; /* slot_size bytes each */
    uint32_t slot_size;     /* at least file_size rounded up to `unit`, and the record */
    uint32_t unit;          /* bytes of one write: a power of two up to TRIAX_STORE_UNIT_MAX */
    uint32_t (*erase)(void *context, uint32_t slot);
    uint32_t (*program)(void *context, uint32_t slot, uint32_t offset, const uint8_t *bytes, uint32_t size);
    void *context;                                         /* for erase and program */
    uint32_t (*check)(const uint8_t *image, size_t size); /* triax_calib_check */
    uint32_t file_size;                                    /* TRIAX_FILE_SIZE */
} triax_store_config_t;

typedef struct {
    const triax_store_config_t *config;
    const uint8_t *file; /* being stored */
    uint32_t active;     /* slot in use, or TRIAX_STORE_NO_SLOT */
    uint32_t sequence;   /* of the slot in use; 0 without one */
    uint32_t status;     /* TRIAX_STORE_... */
    uint32_t phase;
    uint32_t offset;
} triax_store_t;

/* Find the slot in use. `config` must stay. Returns 0, or 1 when `config` is not as described. */
uint32_t triax_store_open(triax_store_t *store, const triax_store_config_t *config);

/* The file in use, file_size bytes; NULL where neither slot has one. */
const uint8_t *triax_store_file(const triax_store_t *store);

/* Slots whose record is not erased, valid or not: bit 0 and bit 1. */
uint32_t triax_store_written(const triax_store_t *store);

/*
 * Begin to store `file`, which must not change until triax_store_step says another thing than BUSY.
 * Returns the status: BUSY or REFUSED. A store in progress goes on, with BUSY.
 */
uint32_t triax_store_begin(triax_store_t *store, const uint8_t *file);

/* One operation of flash at the most. Returns the status. */
uint32_t triax_store_step(triax_store_t *store);

/* Words of four bytes, little-endian. */
uint32_t triax_store_get_word(const uint8_t *bytes);
void triax_store_put_word(uint8_t *bytes, uint32_t word);

/* CRC-32 of IEEE 802.3, as XCP_CRC_32 and zlib have it. */
uint32_t triax_store_crc32(const uint8_t *bytes, uint32_t size);

#ifdef __cplusplus
}
#endif

#endif
