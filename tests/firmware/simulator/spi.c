/* The SPI pins of the board, to which one converter is connected. */
#include <simavr/avr_spi.h>
#include <stddef.h>

#include "board.h"

#define SPCR 0x4C                       /* addresses of the ATmega328P */
#define SPSR 0x4D
#define SPDR 0x4E
#define SPI_MODE 0x0C
#define MODE_1 0x04

static struct {
    spi_answer_t answer;
    unsigned fastest_hz;
    uint8_t byte;
    avr_irq_t *reply;
} line;

struct spi_times spi_times;

static avr_cycle_count_t byte_ended(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)param;
    const uint8_t reply = line.answer(avr, line.byte);
    spi_times.byte_ended = when;
    avr_raise_irq(line.reply, reply);
    return 0;
}

/* simavr 1.6 gives every byte 100 us; here it takes its eight clocks. */
static void byte_began(avr_t *avr, avr_io_addr_t address, uint8_t byte, void *param)
{
    static const int divisors[] = {4, 16, 64, 128};
    const int divisor = divisors[avr->data[SPCR] & 3] / (1 + (avr->data[SPSR] & 1));
    (void)address;
    (void)param;
    if (CLOCK_HZ / divisor > line.fastest_hz) {
        fault(avr, "SPI: SCLK is too fast");
    }
    if ((avr->data[SPCR] & SPI_MODE) != MODE_1) {
        fault(avr, "SPI: the converter needs mode 1");
    }
    line.byte = byte;
    spi_times.byte_began = avr->cycle;
    avr_cycle_timer_register(avr, 8 * divisor, byte_ended, &line);
}

void connect_spi(avr_t *avr, unsigned fastest_hz, spi_answer_t answer)
{
    line.answer = answer;
    line.fastest_hz = fastest_hz;
    line.reply = avr_io_getirq(avr, AVR_IOCTL_SPI_GETIRQ(0), SPI_IRQ_INPUT);
    avr_register_io_write(avr, SPDR, byte_began, NULL);
}
