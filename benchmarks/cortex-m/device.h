/* What the bench asks of the machine that it runs on. */
#ifndef DEVICE_H
#define DEVICE_H

#include <stdint.h>

/* Writes a text. */
void device_write(const char *text);

/* Instructions since some moment; differences count, below five million. */
uint32_t device_instructions(void);

/* Loops of as many instructions as given, at least 8. Returns how many: what the counter must show. */
uint32_t device_spend(uint32_t instructions);

/* Marks the stack below the caller, to tell later how deep it was used. */
void device_paint_stack(void);

/* Bytes of stack used below the caller since it was marked. */
uint32_t device_used_stack(void);

#endif
