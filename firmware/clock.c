#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "watchdog.h"

#define TICKS_PER_US 2 /* 16 MHz / 8 */
#define US_PER_OVERFLOW_BITS 15

_Static_assert(F_CPU / 8 == TICKS_PER_US * 1000000UL, "the clock needs a 16 MHz board");

static volatile uint32_t overflows;

ISR(TIMER1_OVF_vect)
{
    overflows++;
    watchdog_count_overdue();
}

void clock_start(void)
{
    TCCR1B = _BV(CS11); /* prescaler 8 */
    TIMSK1 = _BV(TOIE1);
}

uint32_t clock_us(void)
{
    uint32_t count;
    uint16_t ticks;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        ticks = TCNT1;
        count = overflows;
        if ((TIFR1 & _BV(TOV1)) && ticks < 0x8000) {
            count++; /* it ran over while interrupts were off */
        }
    }
    return (count << US_PER_OVERFLOW_BITS) + ticks / TICKS_PER_US;
}
