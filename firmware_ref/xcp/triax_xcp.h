/*
 * triax_xcp.h - a small XCP slave for one calibration: identify, read, download, try, store.
 *
 * ASAM MCD-1 XCP, over any transport with packets of up to 8 bytes (CAN). Byte order is Intel and the
 * address granularity one byte. Commands: CONNECT, DISCONNECT, GET_STATUS, SYNCH, GET_ID, SET_REQUEST
 * (STORE_CAL_REQ), SET_MTA, UPLOAD, SHORT_UPLOAD, DOWNLOAD, BUILD_CHECKSUM (XCP_CRC_32),
 * SET_CAL_PAGE, GET_CAL_PAGE, COPY_CAL_PAGE. Any other is answered with ERR_CMD_UNKNOWN.
 *
 * | address extension | what is there                                                   |
 * |-------------------|-----------------------------------------------------------------|
 * | 0                 | triax_calib.bin, from address 0; page 0 is flash, page 1 RAM    |
 * | 1                 | TRIAX_XCP_INFO_SIZE bytes about the slave, TRIAX_XCP_INFO_...   |
 * | 2                 | one sample                                                      |
 * | 3                 | as 0; a download is a change by a calibration tool              |
 *
 * A new sample is taken when address 0 is set, or a byte is read that was read since the last one was
 * taken: signals that are read in turn are of one sample.
 *
 * A download to extension 3 changes constants of the RAM page: triax_file_change. The page must hold a
 * whole calibration before (COPY_CAL_PAGE). Values whose arithmetic could overflow are answered with
 * ERR_OUT_OF_RANGE. If the application uses the RAM page, it gets the change at once.
 *
 * The application uses flash or RAM, and XCP reads and writes flash or RAM, each as SET_CAL_PAGE says.
 * Flash is written by SET_REQUEST alone, from the RAM page, by triax_store.
 *
 * C99, no heap, no floats, no library calls of its own. (gcc may make memset and strlen of the loops.)
 */
#ifndef TRIAX_XCP_H
#define TRIAX_XCP_H

#include "triax_file.h"
#include "triax_store.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TRIAX_XCP_PACKET 8u /* the most bytes of a command or a response */
#define TRIAX_XCP_INFO_SIZE 32u
#define TRIAX_XCP_SAMPLE_SIZE 40u

#define TRIAX_XCP_ID_VERSION 128u /* GET_ID: 0 is the name, 5 the EPK of the calibration in use */

#define TRIAX_XCP_FLASH_PAGE 0u
#define TRIAX_XCP_RAM_PAGE 1u

/* One sample as the application has compensated it. */
typedef struct {
    uint32_t count;     /* of samples; a value twice means the same sample twice */
    int32_t temp_code;  /* as triax_set_temperature took it */
    int32_t rate_code;  /* as triax_set_temperature_rate took it; 0 without a term in dT/dt */
    int32_t raw[3];     /* as triax_apply took them */
    int32_t accel[3];   /* as triax_apply returned them */
    uint32_t status;    /* of triax_set_temperature and of triax_apply */
} triax_xcp_sample_t;

typedef struct {
    triax_store_t *store;  /* open */
    uint32_t shape;        /* TRIAX_SHAPE */
    uint8_t *ram;          /* the RAM page: file_size bytes */
    const char *name;      /* serial number of the hardware, ended by 0; "" where it knows none */
    const char *version;   /* of the firmware, ended by 0: GET_ID TRIAX_XCP_ID_VERSION */
    const char *epk;       /* TRIAX_CALIB_EPK, where neither flash nor RAM have a calibration in use */
    void (*sample)(void *context, triax_xcp_sample_t *sample); /* the newest one */
    void (*use)(void *context, const uint8_t *file);           /* these constants from now on */
    void *context;                                             /* for sample and use */
} triax_xcp_config_t;

typedef struct {
    const triax_xcp_config_t *config;
    triax_store_t *store;
    uint8_t *ram;
    const uint8_t *text; /* of GET_ID */
    uint32_t text_size;
    uint32_t extension; /* memory transfer address */
    uint32_t address;
    uint32_t connected;
    uint32_t page;      /* that XCP reads and writes */
    uint32_t page_used; /* that the application uses */
    uint32_t error;     /* of the command in work */
    uint32_t seen[2];   /* a bit for each byte of the sample that was read */
    uint8_t epk[TRIAX_FILE_EPK_SIZE];
    uint8_t info[TRIAX_XCP_INFO_SIZE];
    uint8_t sample[TRIAX_XCP_SAMPLE_SIZE];
} triax_xcp_t;

/* Words of address extension 1, little-endian. */
#define TRIAX_XCP_INFO_VERSION 0u   /* of this layout: 1 */
#define TRIAX_XCP_INFO_SHAPE 4u     /* TRIAX_SHAPE */
#define TRIAX_XCP_INFO_SIZE_AT 8u   /* TRIAX_FILE_SIZE */
#define TRIAX_XCP_INFO_SLOT 12u     /* in use; TRIAX_STORE_NO_SLOT + triax_store_written without one */
#define TRIAX_XCP_INFO_SEQUENCE 16u /* its sequence number */
#define TRIAX_XCP_INFO_STORE 20u    /* status of the last store */
#define TRIAX_XCP_INFO_SLOT_SIZE 24u
#define TRIAX_XCP_INFO_USED 28u     /* page that the application uses */

/* Start, not connected. The RAM page becomes a copy of flash. `config` must stay. */
void triax_xcp_open(triax_xcp_t *xcp, const triax_xcp_config_t *config);

/*
 * Answer a command of `size` bytes. Returns the bytes of the response, 0 for none: a command before
 * CONNECT, or a packet of no or of more than TRIAX_XCP_PACKET bytes.
 */
uint32_t triax_xcp_receive(triax_xcp_t *xcp, const uint8_t *command, size_t size,
                           uint8_t response[TRIAX_XCP_PACKET]);

/*
 * Go on with a store that was requested: one operation of flash. Call it from the main loop, not
 * while triax_xcp_receive runs. Returns 1 as long as there is more to do.
 */
uint32_t triax_xcp_background(triax_xcp_t *xcp);

#ifdef __cplusplus
}
#endif

#endif
