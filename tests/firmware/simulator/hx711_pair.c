/* Two HX711 on D2 (clock), D3 (table) and D4 (relative), bit by bit, from Avia's data sheet.
 *
 * Each converts by a clock of its own: the table's at 80 Hz, the relative one's 2 % slower. A result that is
 * not fetched gives way to the next one. Switched off and on they begin the file of readings anew.
 */
#include "board.h"

#define BITS 24
#define PULSES 25                       /* 24 bits, and one more for channel A at gain 128 */
#define POWER_DOWN_CYCLES (60 * CYCLES_PER_US)
#define SHORTEST_HIGH_CYCLES 3          /* 0.2 us */
#define SETTLING_CYCLES (50000 * CYCLES_PER_US)

struct chip {
    bool is_table;
    int data_bit;
    avr_cycle_count_t period;
    uint64_t conversions;
    uint32_t value;
    bool is_ready;
    int pulses;                         /* of the reading under way */
    avr_cycle_count_t rose;
};

static struct chip table_chip = {.is_table = true, .data_bit = 3, .period = CLOCK_HZ / 80};
static struct chip relative_chip = {.is_table = false, .data_bit = 4, .period = CLOCK_HZ / 80 * 51 / 50};

static void set_data(avr_t *avr, const struct chip *chip, bool level)
{
    drive_pin(avr, 'D', chip->data_bit, level);
}

static avr_cycle_count_t converted(avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct chip *chip = param;
    const struct reading reading = reading_at(chip->conversions);
    if (chip->pulses != 0) {
        return when + CYCLES_PER_US;    /* not while it is read */
    }
    chip->conversions++;
    chip->is_ready = true;
    chip->value = (uint32_t)(chip->is_table ? reading.table : reading.relative) & 0xFFFFFF;
    set_data(avr, chip, false);
    return when + chip->period;
}

static void rise(avr_t *avr, struct chip *chip)
{
    chip->rose = avr->cycle;
    chip->pulses++;
    const int bit = BITS - chip->pulses;
    set_data(avr, chip, bit < 0 || (chip->value >> bit & 1));
}

static void switch_on(avr_t *avr, struct chip *chip)
{
    chip->pulses = 0;
    chip->conversions = 0;
    chip->is_ready = false;
    set_data(avr, chip, true);
    avr_cycle_timer_register(avr, SETTLING_CYCLES, converted, chip);
}

static void fall(avr_t *avr, struct chip *chip)
{
    const avr_cycle_count_t high = avr->cycle - chip->rose;
    if (high >= POWER_DOWN_CYCLES) {
        switch_on(avr, chip);
        return;
    }
    if (!chip->is_ready) {
        fault(avr, "HX711: read before it was ready");
    }
    if (high < SHORTEST_HIGH_CYCLES) {
        fault(avr, "HX711: clock high for less than 0.2 us");
    }
    if (chip->pulses == PULSES) {
        chip->pulses = 0;
        chip->is_ready = false;
    }
}

static void clock_changed(avr_irq_t *irq, uint32_t level, void *param)
{
    avr_t *avr = param;
    (void)irq;
    for (int i = 0; i < 2; i++) {
        struct chip *chip = i == 0 ? &table_chip : &relative_chip;
        if (level) {
            rise(avr, chip);
        } else if (chip->pulses > 0) {
            fall(avr, chip);
        }
    }
}

void connect_hx711_pair(avr_t *avr)
{
    watch_pin(avr, 'D', 2, clock_changed, avr);
    switch_on(avr, &table_chip);
    switch_on(avr, &relative_chip);
}
