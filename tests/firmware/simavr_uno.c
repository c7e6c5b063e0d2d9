/* Runs a firmware on a simulated Arduino Uno, in the time of whoever asks.

   usage: simavr_uno FIRMWARE.elf
   It prints `terminal NAME`, the pseudo terminal that is the board's serial port. Then it takes words, each on a line:
   press, release     opens or closes the contact between pin 2 and ground
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

/* Connect pin 2 to ground, or to nothing: then it is at the level that the firmware's pull-up gives it. */
static void connect(avr_t *avr, int to_ground)
{
    avr_ioport_external_t outside = {.name = 'D', .mask = to_ground ? 4 : 0, .value = 0};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2),
                  to_ground ? 0 : (avr->data[PORTD] >> 2) & 1);
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
    connect(avr, 1);

    printf("terminal %s\n", ptsname(terminal));
    fflush(stdout);
    while (fgets(line, sizeof line, stdin)) {
        if (!strcmp(line, "press\n"))
            connect(avr, 0);
        else if (!strcmp(line, "release\n"))
            connect(avr, 1);
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
