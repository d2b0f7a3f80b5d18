/*
 * triax_memory.h - what an XCP master reads and writes at the addresses of triax_xcp.h. For triax_xcp.c
 * alone.
 */
#ifndef TRIAX_MEMORY_H
#define TRIAX_MEMORY_H

#include "triax_xcp.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ERR_CMD_SYNCH 0x00u
#define ERR_CMD_BUSY 0x10u
#define ERR_CMD_UNKNOWN 0x20u
#define ERR_CMD_SYNTAX 0x21u
#define ERR_OUT_OF_RANGE 0x22u
#define ERR_WRITE_PROTECTED 0x23u
#define ERR_ACCESS_DENIED 0x24u
#define ERR_PAGE_NOT_VALID 0x26u
#define ERR_MODE_NOT_VALID 0x27u
#define ERR_SEGMENT_NOT_VALID 0x28u
#define NO_ERROR 0x100u

#define EXTENSION_FILE 0u
#define EXTENSION_INFO 1u
#define EXTENSION_SAMPLE 2u
#define EXTENSION_CHANGE 3u
#define EXTENSION_TEXT 0xFFu /* of GET_ID; a master cannot set it */

/* Bytes of the calibration's file. */
uint32_t triax_memory_file_size(const triax_xcp_t *xcp);

/* 1 while a store goes on. */
uint32_t triax_memory_is_storing(const triax_xcp_t *xcp);

/* The RAM page as flash has it, and no sample yet. */
void triax_memory_open(triax_xcp_t *xcp);

/* The functions from here on set xcp->error when they do not succeed. */

void triax_memory_set_address(triax_xcp_t *xcp, uint32_t extension, uint32_t address);

/* `count` bytes from the memory transfer address, which goes on by them; NULL with an error. */
const uint8_t *triax_memory_readable(triax_xcp_t *xcp, uint32_t count);

/* The same, copied; a sample is read. */
void triax_memory_read(triax_xcp_t *xcp, uint8_t *bytes, uint32_t count);

void triax_memory_write(triax_xcp_t *xcp, const uint8_t *bytes, uint32_t count);

/* The RAM page becomes that in flash. */
void triax_memory_copy_page(triax_xcp_t *xcp);

/* Whether the application can use a page. */
uint32_t triax_memory_is_usable(const triax_xcp_t *xcp, uint32_t page);

/* The application uses a page that it can use. */
void triax_memory_use_page(triax_xcp_t *xcp, uint32_t page);

/* The EPK of the calibration that the application uses, in xcp->epk; its bytes, 0 where there is none. */
uint32_t triax_memory_epk(triax_xcp_t *xcp);

#ifdef __cplusplus
}
#endif

#endif
