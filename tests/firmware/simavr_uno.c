/* Runs a firmware on a simulated Arduino Uno, in the time of whoever asks.

   usage: simavr_uno FIRMWARE.elf
   It prints `terminal NAME`, the pseudo terminal that is the board's serial port. Then it takes words, each on a line:
   press, release     opens or closes the contact between pins 2 and 5, and closes or opens that between 3 and 5
   weld               keeps the first of them closed
   cut PIN            takes the wire from pin 2 or 3
   ground PIN         connects it to ground
   flip ADDRESS BIT   flips a bit of a register of the board, e.g. 2b 2 of PORTD
   hang               lets the board's timer stand still
   run MS RECEIVED    waits until RECEIVED bytes in all have come over the serial port, lets MS milliseconds pass on the
                      board, and answers `ran SENT` with the number of bytes in all that the board has sent
*/
#define _GNU_SOURCE
#include <fcntl.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define CLOCK 16000000UL
#define MILLISECOND (CLOCK / 1000)
#define PORTD 0x2B
#define TCCR0B 0x45

static int terminal;
static long bytes_sent, bytes_received;
static int pressed, welded;
static uint8_t lost, grounded;

/* Connect pins 2 and 3 to pin 5, to ground, or to nothing: then each is at the level of the firmware's pull-up. */
static void connect(avr_t *avr, uint8_t port)
{
    uint8_t fed = (port & 32) ? 0xFF : 0, joined = (uint8_t)(((!pressed || welded) ? 4 : 0) | (pressed ? 8 : 0));
    joined &= (uint8_t)~lost;
    avr_ioport_external_t outside = {.name = 'D', .mask = joined | grounded, .value = fed & joined & ~grounded};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
    for (int pin = 2; pin < 4; pin++) {
        avr_irq_t *level = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), pin);
        uint32_t high = ((outside.mask & (1 << pin) ? outside.value : port) >> pin) & 1;
        avr_raise_irq(level, !high); /* what does not change is not told, not even after a reset */
        avr_raise_irq(level, high);
    }
}

static void written(struct avr_irq_t *irq, uint32_t value, void *avr)
{
    (void)irq;
    connect(avr, (uint8_t)value);
}

static void flip(avr_t *avr, unsigned address, unsigned bit)
{
    uint8_t value = avr->data[address] ^ (uint8_t)(1 << bit);
    if (avr->io[AVR_DATA_TO_IO(address)].w.c)
        avr->io[AVR_DATA_TO_IO(address)].w.c(avr, address, value, avr->io[AVR_DATA_TO_IO(address)].w.param);
    else
        avr->data[address] = value;
}

static void stop_timer(avr_t *avr)
{
    avr->io[AVR_DATA_TO_IO(TCCR0B)].w.c(avr, TCCR0B, 0, avr->io[AVR_DATA_TO_IO(TCCR0B)].w.param);
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    uint8_t byte = (uint8_t)value;
    (void)irq;
    (void)unused;
    if (write(terminal, &byte, 1) == 1)
        bytes_sent++;
}

static int open_terminal(void)
{
    struct termios raw;
    int host;
    terminal = posix_openpt(O_RDWR | O_NOCTTY);
    if (terminal < 0 || grantpt(terminal) || unlockpt(terminal))
        return -1;
    /* Held open, so that the terminal outlives the host's opening and closing it. */
    host = open(ptsname(terminal), O_RDWR | O_NOCTTY);
    if (host < 0 || tcgetattr(host, &raw))
        return -1;
    cfmakeraw(&raw);
    return tcsetattr(host, TCSANOW, &raw);
}

static int run(avr_t *avr, long milliseconds, long received)
{
    avr_irq_t *input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    uint8_t byte;
    for (; bytes_received < received; bytes_received++) {
        if (read(terminal, &byte, 1) != 1)
            return -1;
        avr_raise_irq(input, byte);
    }
    for (; milliseconds > 0; milliseconds--) {
        avr_cycle_count_t end = avr->cycle + MILLISECOND, before = avr->cycle;
        while (avr->cycle < end && avr->cycle >= before) { /* a reset sets the counter back */
            int state = avr_run(avr);
            if (state == cpu_Done || state == cpu_Crashed)
                return -1;
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    elf_firmware_t firmware;
    uint32_t flags = 0;
    char line[64];
    long milliseconds, received;
    unsigned pin, bit;

    memset(&firmware, 0, sizeof firmware);
    if (argc != 2 || elf_read_firmware(argv[1], &firmware) || open_terminal())
        return 2;
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    if (!avr || avr_init(avr))
        return 3;
    firmware.frequency = CLOCK;
    avr_load_firmware(avr, &firmware);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags); /* neither a copy on stdout nor a nap at each poll */
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), IOPORT_IRQ_REG_PORT), written, avr);
    connect(avr, 0);

    printf("terminal %s\n", ptsname(terminal));
    fflush(stdout);
    while (fgets(line, sizeof line, stdin)) {
        if (!strcmp(line, "press\n"))
            pressed = 1;
        else if (!strcmp(line, "release\n"))
            pressed = 0;
        else if (!strcmp(line, "weld\n"))
            welded = 1;
        else if (sscanf(line, "cut %u", &pin) == 1)
            lost |= (uint8_t)(1 << pin);
        else if (sscanf(line, "ground %u", &pin) == 1)
            grounded |= (uint8_t)(1 << pin);
        else if (sscanf(line, "flip %x %u", &pin, &bit) == 2)
            flip(avr, pin, bit);
        else if (!strcmp(line, "hang\n"))
            stop_timer(avr);
        else if (sscanf(line, "run %ld %ld", &milliseconds, &received) == 2) {
            if (run(avr, milliseconds, received))
                return 4;
            printf("ran %ld\n", bytes_sent);
            fflush(stdout);
        } else
            return 5;
    }
    return 0;
}
