/* flash_file.c - see flash_file.h. On a device this is the driver of its flash. */
#define _POSIX_C_SOURCE 200809L
#include "flash_file.h"

#include <fcntl.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

static uint8_t *memory;
static unsigned long left = (unsigned long)-1;

const uint8_t *flash_file_open(const char *path)
{
    const size_t size = (size_t)2 * FLASH_SLOT_SIZE;
    struct stat found;
    void *mapped;
    int file = open(path, O_RDWR | O_CREAT, 0644);
    int is_new;

    if (file < 0) {
        return NULL;
    }
    is_new = fstat(file, &found) == 0 && found.st_size == 0;
    if (ftruncate(file, (off_t)size) != 0) {
        (void)close(file);
        return NULL;
    }
    mapped = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    (void)close(file);
    if (mapped == MAP_FAILED) {
        return NULL;
    }
    memory = mapped;
    if (is_new) {
        memset(memory, 0xFF, size);
    }
    return memory;
}

void flash_file_stop_after(unsigned long bytes)
{
    left = bytes;
}

static void change(uint32_t at, uint8_t value)
{
    if (left == 0) {
        _exit(9);
    }
    left--;
    memory[at] = value;
}

uint32_t flash_file_erase(void *context, uint32_t slot)
{
    uint32_t i;

    (void)context;
    for (i = 0; i < FLASH_SLOT_SIZE; i++) {
        change(slot * FLASH_SLOT_SIZE + i, 0xFF);
    }
    return 0;
}

uint32_t flash_file_program(void *context, uint32_t slot, uint32_t offset, const uint8_t *bytes, uint32_t size)
{
    const uint32_t start = slot * FLASH_SLOT_SIZE + offset;
    uint32_t i;

    (void)context;
    for (i = 0; i < size; i++) {
        if (memory[start + i] != 0xFF) {
            return 1; /* written before and not erased */
        }
    }
    for (i = 0; i < size; i++) {
        change(start + i, bytes[i]);
    }
    return 0;
}
