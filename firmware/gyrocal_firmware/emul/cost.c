/* Counts the cost of a part on this CPU: instructions per call (mean and largest) and stack. With QEMU's -icount shift=0 an
   instruction takes a nanosecond. */
#include "cost.h"

#include <stdint.h>
#include <stdio.h>

#define STACK_BYTES 32768u
#define PAINT 0xA5u

#if defined(__riscv)
static uint32_t count(void) {
    uint32_t instructions;
    __asm__ volatile("rdinstret %0" : "=r"(instructions));
    return instructions;
}

static uint32_t counted(uint32_t from, uint32_t to) {
    return to - from;
}
#elif defined(__arm__)
#define SYSTICK ((volatile uint32_t *)0xE000E010u)
#define INSTRUCTIONS_PER_TICK 40u /* mps2-an386: 25 MHz */

static uint32_t count(void) {
    if (SYSTICK[0] == 0u) {
        SYSTICK[1] = 0xFFFFFFu;
        SYSTICK[2] = 0;
        SYSTICK[0] = 5;
    }
    return SYSTICK[2]; /* downwards */
}

static uint32_t counted(uint32_t from, uint32_t to) {
    return ((from - to) & 0xFFFFFFu) * INSTRUCTIONS_PER_TICK;
}
#endif

static volatile uint8_t *paint_stack(void) {
    volatile uint8_t *here = __builtin_frame_address(0);
    for (volatile uint8_t *p = here - STACK_BYTES; p < here - 64; p++) {
        *p = PAINT;
    }
    return here;
}

static unsigned long painted_over(const volatile uint8_t *here) {
    const volatile uint8_t *p = here - STACK_BYTES;
    while (*p == PAINT) {
        p++;
    }
    return (unsigned long)(here - p);
}

int main(int argc, char **argv) {
    (void)argc;
    (void)argv;
    cost_prepare();
    (void)count();
    volatile uint8_t *here = paint_stack();
    cost_act();
    const unsigned long stack = painted_over(here);
    uint32_t largest = 0;
    const uint32_t begin = count();
    for (unsigned i = 0; i < cost_times; i++) {
        const uint32_t from = count();
        cost_act();
        const uint32_t one = counted(from, count());
        largest = one > largest ? one : largest;
    }
    const uint32_t mean = (counted(begin, count()) + cost_times / 2u) / cost_times;
    const unsigned long late = painted_over(here);
    printf("%lu %lu %lu\n", (unsigned long)mean, (unsigned long)largest, late > stack ? late : stack);
    return 0;
}
