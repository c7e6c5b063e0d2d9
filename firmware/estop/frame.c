#include "frame.h"

uint16_t crc16(const uint8_t *data, uint8_t size)
{
    uint16_t crc = 0xFFFF;
    for (uint8_t i = 0; i < size; i++) {
        crc ^= (uint16_t)data[i] << 8;
        for (uint8_t bit = 0; bit < 8; bit++)
            crc = (crc & 0x8000) ? (uint16_t)(crc << 1) ^ 0x1021 : (uint16_t)(crc << 1);
    }
    return crc;
}

void frame_write(uint8_t *out, uint16_t sequence, uint8_t pressed, uint8_t echo)
{
    out[0] = 0xA5;
    out[1] = 0x5A;
    out[2] = (uint8_t)sequence;
    out[3] = (uint8_t)(sequence >> 8);
    out[4] = pressed ? STATE_PRESSED : STATE_RELEASED;
    out[5] = echo;
    uint16_t crc = crc16(out, FRAME_SIZE - 2);
    out[6] = (uint8_t)crc;
    out[7] = (uint8_t)(crc >> 8);
}
