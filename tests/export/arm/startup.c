/* From reset to `main` on a Cortex-M: the stack, then the unit for floating point, then the library's start. */

#include <stdint.h>

extern uint32_t stack_top;
void _start(void);

static void fault(void)
{
    for (;;) {
    }
}

void reset(void)
{
    volatile uint32_t *const access_control = (volatile uint32_t *)0xE000ED88u; /* CPACR of ARMv7-M */
    *access_control |= 0xFu << 20;                                              /* coprocessors 10 and 11: full access */
    __asm volatile("dsb\n isb");
    _start();
}

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16] = {
    (uintptr_t)&stack_top, (uintptr_t)reset, (uintptr_t)fault, (uintptr_t)fault,
    (uintptr_t)fault,      (uintptr_t)fault, (uintptr_t)fault,
};
