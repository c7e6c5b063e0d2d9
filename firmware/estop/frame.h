/* The frame that the board sends: 8 bytes that the host can tell from noise, from an old frame and from another state.

   byte 0, 1   0xA5 0x5A
   byte 2, 3   sequence, low byte first; counts up by one per frame and wraps
   byte 4      state: 0x3C released, 0xC3 pressed; all eight bits differ
   byte 5      echo: the newest byte that the host has sent; 0 before the first
   byte 6, 7   CRC-16/CCITT-FALSE of the bytes before, low byte first
*/
#ifndef GOLEM_ESTOP_FRAME_H
#define GOLEM_ESTOP_FRAME_H

#include <stdint.h>

#define FRAME_SIZE 8
#define STATE_RELEASED 0x3C
#define STATE_PRESSED 0xC3

/* Return the CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF) of `size` bytes. */
uint16_t crc16(const uint8_t *data, uint8_t size);

/* Write the frame with this sequence, state and echo to the FRAME_SIZE bytes at `out`. */
void frame_write(uint8_t *out, uint16_t sequence, uint8_t pressed, uint8_t echo);

#endif
