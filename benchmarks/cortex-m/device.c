/* A Cortex-M on an MPS2 board of qemu: start, output by semihosting, instructions counted.
   With `-icount shift=7` an instruction takes 128 ns of virtual time, whatever the host does, and
   SysTick counts that time at 25 MHz: 3.2 ticks an instruction. */
#include "device.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)
#define SYSTICK_CURRENT REGISTER(0xE000E018u)
#define COPROCESSORS REGISTER(0xE000ED88u)

enum { SYS_WRITE0 = 0x04, SYS_EXIT = 0x18 };

static const uint32_t STOPPED = 0x20026u; /* ADP_Stopped_ApplicationExit */
static const uint32_t FAULT = 0x20024u;   /* ADP_Stopped_InternalError */
static const uint32_t PAINT = 0xA5C3F00Du;

extern uint32_t stack_low[];
extern uint32_t stack_high[];

int main(void);
void reset(void);
static void fault(void);

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    stack_high, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};

static void semihost(uint32_t operation, uint32_t argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void fault(void)
{
    device_write("fault\n");
    semihost(SYS_EXIT, FAULT);
}

void reset(void)
{
    COPROCESSORS |= 0xFu << 20; /* the floating point unit */
    __asm__ volatile("dsb\n isb" ::: "memory");
    SYSTICK_RELOAD = 0x00FFFFFFu;
    SYSTICK_CURRENT = 0;
    SYSTICK_CONTROL = 5; /* on, by the processor's clock, without interrupts */
    (void)main();
    semihost(SYS_EXIT, STOPPED);
}

void device_write(const char *text)
{
    semihost(SYS_WRITE0, (uint32_t)text);
}

uint32_t device_instructions(void)
{
    /* the counter counts down and has 24 bits: it starts anew with every difference */
    static uint32_t last = 0x00FFFFFFu;
    static uint32_t ticks = 0;
    const uint32_t now = SYSTICK_CURRENT;
    ticks += (last - now) & 0x00FFFFFFu;
    last = now;
    return (uint32_t)(((uint64_t)ticks * 5u + 8u) / 16u);
}

uint32_t device_spend(uint32_t instructions)
{
    uint32_t rounds = instructions / 4u;
    __asm__ volatile("1: nop\n nop\n subs %0, #1\n bne 1b" : "+l"(rounds) : : "cc");
    return instructions / 4u * 4u;
}

__attribute__((noinline)) void device_paint_stack(void)
{
    uint32_t *here = __builtin_frame_address(0);
    for (volatile uint32_t *word = stack_low; word < here - 32; word++) {
        *word = PAINT;
    }
}

__attribute__((noinline)) uint32_t device_used_stack(void)
{
    uint32_t *here = __builtin_frame_address(0);
    volatile uint32_t *word = stack_low;
    while (word < here && *word == PAINT) {
        word++;
    }
    return (uint32_t)((uintptr_t)here - (uintptr_t)word);
}
