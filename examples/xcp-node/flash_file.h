/* flash_file.h - two slots of flash in a file, which behave as flash does: erase to 0xFF, write once. */
#ifndef FLASH_FILE_H
#define FLASH_FILE_H

#include <stdint.h>

#define FLASH_SLOT_SIZE 4096u

/* Maps the file, which is made where it does not exist. Returns its 2 * FLASH_SLOT_SIZE bytes, or NULL. */
const uint8_t *flash_file_open(const char *path);

/* The program ends with 9, as if power had failed, before byte number `bytes` from now is changed. */
void flash_file_stop_after(unsigned long bytes);

uint32_t flash_file_erase(void *context, uint32_t slot);
uint32_t flash_file_program(void *context, uint32_t slot, uint32_t offset, const uint8_t *bytes, uint32_t size);

#endif
