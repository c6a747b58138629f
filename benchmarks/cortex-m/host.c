/* The machine that builds: output alone. */
#include "device.h"

#include <stdio.h>

void device_write(const char *text)
{
    (void)fputs(text, stdout);
}

uint32_t device_instructions(void)
{
    return 0;
}

uint32_t device_spend(uint32_t instructions)
{
    (void)instructions;
    return 0;
}

void device_paint_stack(void)
{
}

uint32_t device_used_stack(void)
{
    return 0;
}
