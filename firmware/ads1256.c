/* One ADS1256 that turns between two inputs: the table on AIN0-AIN1, the relative gauge on AIN2-AIN3.
 *
 * The two conversions begin half a sample period apart by the board's clock, so that delay_s of the relative
 * gauge is 1 / (2 rate). Each is restarted (SYNC) after its input was switched, and the first result after
 * that is taken, which is settled. Pins in README.md; commands and times from Texas Instruments' data sheet
 * SBAS288K.
 */
#include <avr/io.h>
#include <util/atomic.h>
#include <util/delay.h>

#include "clock.h"
#include "converter.h"
#include "pace.h"

#define SELECT _BV(PB2)          /* D10, CS */
#define MOSI _BV(PB3)            /* D11, DIN */
#define MISO _BV(PB4)            /* D12, DOUT */
#define SCK _BV(PB5)             /* D13, SCLK */
#define DATA_READY _BV(PB1)      /* D9, DRDY, low when a conversion is done */

#define WAKEUP 0x00
#define RDATA 0x01
#define SELFCAL 0xF0
#define SYNC 0xFC
#define WREG 0x50

#define MUX 1                    /* register; ADCON and DRATE follow it */
#define MUX_TABLE 0x01           /* AIN0 against AIN1 */
#define MUX_RELATIVE 0x23        /* AIN2 against AIN3 */

#define T6_US 7                  /* RDATA to its data: 50 clocks of 7.68 MHz */
#define T11_US 4                 /* after SYNC: 24 clocks */
#define SWITCHING_US 180         /* switching 60, fetching 60, and how late the main loop may be */
#define NEAR_US 40               /* with WAKEUP 50: a received byte waits 60 before the next is lost */
#define READY_MS 150             /* a calibration is done by then */

#define DEFAULT_RATE_HZ 1000
#define MAX_RATE_HZ 10000        /* before the sums below would overflow */
#define HIGHEST 0x7FFFFFL
#define LOWEST (-0x800000L)

#if GAIN == 1
#define ADCON 0x00
#elif GAIN == 2
#define ADCON 0x01
#elif GAIN == 4
#define ADCON 0x02
#elif GAIN == 8
#define ADCON 0x03
#elif GAIN == 16
#define ADCON 0x04
#elif GAIN == 32
#define ADCON 0x05
#elif GAIN == 64
#define ADCON 0x06
#else
#error "GAIN of the ADS1256 is 1, 2, 4, 8, 16, 32 or 64"
#endif

/* The chip's own data rates, slowest first, with their settling times (table 13). Slow ones are the quieter.
 * From 15 kHz on the next result could come while this one is fetched.
 */
static const struct {
    uint8_t drate;
    uint16_t settling_us;
} speeds[] = {
    {0x82, 10180}, {0x92, 2180}, {0xA1, 1180}, {0xB0, 680}, {0xC0, 440}, {0xD0, 310},
};
#define FASTEST (sizeof speeds / sizeof speeds[0] - 1)

const char converter_name[] = "ads1256";

enum channel { TABLE, RELATIVE }; /* also which of a sample's two steps is its own */

static uint16_t rate_hz = DEFAULT_RATE_HZ;
static struct pace pace;         /* two steps a sample: even ones begin the table's conversion */
static uint32_t step;
static uint32_t next_index;      /* of the sample that would follow without a loss */
static enum channel channel;     /* whose input is on */
static enum { CALIBRATING, HELD, CONVERTING } state;
static bool is_in_time;          /* both conversions of the sample under way began at their steps */
static struct sample latest;

static uint8_t exchange(uint8_t byte)
{
    SPDR = byte;
    while (!(SPSR & _BV(SPIF))) {
    }
    return SPDR;
}

static bool is_done(void)
{
    return (PINB & DATA_READY) == 0;
}

static void wait_until_done(void)
{
    for (uint8_t ms = 0; ms < READY_MS && !is_done(); ms++) {
        _delay_ms(1);
    }
}

void converter_init(void)
{
    PORTB |= SELECT | DATA_READY; /* DRDY pulled up: a chip that is not there is never ready */
    DDRB |= SELECT | MOSI | SCK;
    SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPHA) | _BV(SPR0); /* mode 1, 1 MHz: at most 7.68 MHz / 4 */
}

static bool is_fast_enough(uint8_t speed, uint32_t hz)
{
    return (speeds[speed].settling_us + SWITCHING_US) * 2UL * hz <= 1000000UL;
}

bool converter_set_rate(uint32_t asked_hz)
{
    if (asked_hz < 1 || asked_hz > MAX_RATE_HZ || !is_fast_enough(FASTEST, asked_hz)) {
        return false;
    }
    rate_hz = asked_hz;
    return true;
}

uint16_t converter_rate_hz(void)
{
    return rate_hz;
}

static uint8_t quietest_drate(void)
{
    uint8_t speed = 0;
    while (!is_fast_enough(speed, rate_hz)) {
        speed++;
    }
    return speeds[speed].drate;
}

/* Put an input on, and hold the chip there: SYNC stops it until the WAKEUP of wake(). */
static void prepare(enum channel next)
{
    channel = next;
    PORTB &= ~SELECT;
    exchange(WREG | MUX);
    exchange(0);                 /* one register */
    exchange(next == TABLE ? MUX_TABLE : MUX_RELATIVE);
    exchange(SYNC);
    _delay_us(T11_US);
    state = HELD;
}

static void wake(void)
{
    exchange(WAKEUP);
    PORTB |= SELECT;
    state = CONVERTING;
}

/* Set the chip up for the rate and let it calibrate itself; converter_ready() sees when that is done. */
void converter_start(void)
{
    if (state == HELD) {
        wake();
    }
    wait_until_done();           /* the chip takes no command while it calibrates itself */
    PORTB &= ~SELECT;
    exchange(WREG | MUX);
    exchange(2);                 /* three registers */
    exchange(MUX_TABLE);
    exchange(ADCON);
    exchange(quietest_drate());
    exchange(SELFCAL);
    _delay_us(T11_US);
    PORTB |= SELECT;
    state = CALIBRATING;
}

static int32_t result(void)
{
    PORTB &= ~SELECT;
    exchange(RDATA);
    _delay_us(T6_US);
    uint32_t value = 0;
    for (uint8_t byte = 0; byte < 3; byte++) {
        value = value << 8 | exchange(0);
    }
    PORTB |= SELECT;
    return (int32_t)(value << 8) >> 8;
}

static void begin(void)
{
    prepare(TABLE);
    step = UINT32_MAX;           /* the first one due makes it 0 */
    next_index = 0;
    pace_start(&pace, 2UL * rate_hz);
}

/* Whether the step that is due is the one of the input that is on. Steps that came too late are passed over. */
static bool is_turn(void)
{
    uint16_t due;
    do {
        due = pace_due(&pace);
    } while (due == 0);
    step += due;
    if (due > 1) {
        is_in_time = false;
    }
    return step % 2 == channel;
}

static void take_turn(void)
{
    if (channel == TABLE) {
        is_in_time = true;
        latest.time_us = pace.due_us;
    }
    wake();
}

/* The last moments before a step pass with interrupts off, so that the conversion begins in time. */
static void take_turn_if_near(void)
{
    if (!pace_is_near(&pace, NEAR_US)) {
        return;
    }
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        if (is_turn()) {
            take_turn();
        }
    }
}

/* True if that made the sample whole. */
static bool finish_conversion(void)
{
    const int32_t value = result();
    if (channel == TABLE) {
        latest.table = value;
        prepare(RELATIVE);
        return false;
    }
    latest.relative = value;
    prepare(TABLE);
    return is_in_time;
}

bool converter_ready(void)
{
    switch (state) {
    case CALIBRATING:
        if (is_done()) {
            begin();
        }
        return false;
    case HELD:
        take_turn_if_near();
        return false;
    case CONVERTING:
        return is_done() && finish_conversion();
    }
    return false;
}

static bool is_saturated(int32_t value)
{
    return value == HIGHEST || value == LOWEST;
}

void converter_read(struct sample *sample)
{
    const uint32_t index = step / 2;
    *sample = latest;
    sample->missed = index - next_index;
    sample->overload = (is_saturated(latest.table) ? OVERLOAD_TABLE : 0) |
                       (is_saturated(latest.relative) ? OVERLOAD_RELATIVE : 0);
    next_index = index + 1;
}
